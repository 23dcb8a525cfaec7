//! World → GLB.
//!
//! Two passes: the first lays out the buffer and writes the JSON, the second streams the bulk data
//! behind it, so that the peak is the file itself and no copy of the geometry.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use enfilade_geom::scene::{Image, Mesh, Primitive};
use enfilade_geom::{DMat3, DMat4, DVec3};
use serde_json::value::RawValue;

use super::json::{self, FLOAT, TEXTURE_EXTENSIONS, TRIANGLES, U16, U32, VERTICES};
use super::{CHUNK_BIN, CHUNK_JSON, EXTENSION, GLB_MAGIC, GLB_VERSION, VERSION, WireError};
use crate::look::{add_extensions, material_text, sampler_text};
use crate::{CellId, PortalKind, World};

/// Encodes a world as one GLB.
///
/// Equal worlds give equal bytes. What glTF forbids is mended as the [module](super) says.
/// Takes time and memory linear in the world; nothing is allocated twice.
///
/// # Errors
///
/// [`WireError::Invalid`] for a world that breaks its invariants, [`WireError::TooLarge`] beyond
/// 4 GiB.
pub fn encode_glb(world: &World) -> Result<Vec<u8>, WireError> {
    world.validate().map_err(WireError::Invalid)?;
    let mut layout = Layout::default();
    let root = lay_out(&mut layout, world);
    let mut text = serde_json::to_vec(&root).map_err(|e| WireError::Json(e.to_string()))?;
    text.resize(text.len().next_multiple_of(4), b' ');

    let n_bin = layout.len.next_multiple_of(4);
    let bin_header = if n_bin > 0 { 8 } else { 0 };
    let n_all = 12 + 8 + text.len() as u64 + bin_header + n_bin;
    let length = |n: u64| u32::try_from(n).map_err(|_| WireError::TooLarge { bytes: n_all });
    let mut out = Vec::with_capacity(n_all as usize);
    out.extend(GLB_MAGIC);
    out.extend(GLB_VERSION.to_le_bytes());
    out.extend(length(n_all)?.to_le_bytes());
    out.extend(length(text.len() as u64)?.to_le_bytes());
    out.extend(CHUNK_JSON);
    out.append(&mut text);
    if n_bin > 0 {
        out.extend(length(n_bin)?.to_le_bytes());
        out.extend(CHUNK_BIN);
        layout.write(world, &mut out);
    }
    debug_assert_eq!(out.len() as u64, n_all);
    Ok(out)
}

/// A stretch of the buffer that holds one kind of vertex data or indices for all primitives.
#[derive(Clone, Copy, PartialEq)]
enum Section {
    Positions,
    Normals,
    Tangents,
    Uvs,
    Colors,
    Indices16,
    Indices32,
}

impl Section {
    const ALL: [Self; 7] = [
        Self::Positions,
        Self::Normals,
        Self::Tangents,
        Self::Uvs,
        Self::Colors,
        Self::Indices16,
        Self::Indices32,
    ];

    const fn element_size(self) -> u64 {
        match self {
            Self::Positions | Self::Normals => 12,
            Self::Tangents | Self::Colors => 16,
            Self::Uvs => 8,
            Self::Indices16 => 2,
            Self::Indices32 => 4,
        }
    }

    const fn is_indices(self) -> bool {
        matches!(self, Self::Indices16 | Self::Indices32)
    }

    const fn component_type(self) -> u32 {
        match self {
            Self::Indices16 => U16,
            Self::Indices32 => U32,
            _ => FLOAT,
        }
    }

    const fn kind(self) -> &'static str {
        match self {
            Self::Positions | Self::Normals => "VEC3",
            Self::Tangents | Self::Colors => "VEC4",
            Self::Uvs => "VEC2",
            Self::Indices16 | Self::Indices32 => "SCALAR",
        }
    }
}

/// A primitive and which of its attributes are fit to be written.
struct Prepared<'a> {
    primitive: Cow<'a, Primitive>,
    has_normals: bool,
    has_tangents: bool,
    indices: Section,
}

/// Where everything goes in the buffer.
#[derive(Default)]
struct Layout<'a> {
    prepared: Vec<Prepared<'a>>,
    /// With the section's position in [`Section::ALL`] in place of the buffer view.
    accessors: Vec<json::Accessor>,
    section_len: [u64; Section::ALL.len()],
    views: Vec<json::BufferView>,
    len: u64,
    n_dropped_normals: u32,
    n_dropped_tangents: u32,
    n_flattened: u32,
}

impl<'a> Layout<'a> {
    fn push_mesh(
        &mut self,
        name: &str,
        parts: impl Iterator<Item = Cow<'a, Primitive>>,
    ) -> json::Mesh {
        json::Mesh {
            name: name.to_owned(),
            primitives: parts.map(|p| self.push(p)).collect(),
        }
    }

    fn push(&mut self, primitive: Cow<'a, Primitive>) -> json::Primitive {
        let p = &*primitive;
        let has_normals = !p.normals.is_empty() && p.normals.iter().all(|&n| is_unit(n));
        let are_tangents_fit = p
            .tangents
            .iter()
            .all(|&[x, y, z, w]| is_unit([x, y, z]) && w.abs() == 1.0);
        let has_tangents = has_normals && !p.tangents.is_empty() && are_tangents_fit;
        self.n_dropped_normals += u32::from(!has_normals && !p.normals.is_empty());
        self.n_dropped_tangents += u32::from(!has_tangents && !p.tangents.is_empty());
        let n = p.positions.len();
        // 65,535 restarts a strip, so that it can be no index.
        let indices = if n <= 65_535 {
            Section::Indices16
        } else {
            Section::Indices32
        };

        let mut attributes = BTreeMap::new();
        let position = self.accessor(Section::Positions, n);
        let (min, max) = extent(&p.positions);
        self.accessors[position as usize].min = Some(min.to_vec());
        self.accessors[position as usize].max = Some(max.to_vec());
        attributes.insert("POSITION".to_owned(), position);
        if has_normals {
            attributes.insert("NORMAL".to_owned(), self.accessor(Section::Normals, n));
        }
        if has_tangents {
            attributes.insert("TANGENT".to_owned(), self.accessor(Section::Tangents, n));
        }
        for set in 0..p.uvs.len() {
            attributes.insert(format!("TEXCOORD_{set}"), self.accessor(Section::Uvs, n));
        }
        if !p.colors.is_empty() {
            attributes.insert("COLOR_0".to_owned(), self.accessor(Section::Colors, n));
        }
        let (n_indices, material) = (p.indices.len(), p.material);
        let index_accessor = Some(self.accessor(indices, n_indices));
        self.prepared.push(Prepared {
            primitive,
            has_normals,
            has_tangents,
            indices,
        });
        json::Primitive {
            attributes,
            indices: index_accessor,
            material,
        }
    }

    fn accessor(&mut self, section: Section, count: usize) -> u32 {
        let slot = section as usize;
        self.accessors.push(json::Accessor {
            buffer_view: Some(slot as u32),
            byte_offset: self.section_len[slot],
            component_type: section.component_type(),
            count: count as u64,
            kind: section.kind().to_owned(),
            min: None,
            max: None,
        });
        self.section_len[slot] += count as u64 * section.element_size();
        self.accessors.len() as u32 - 1
    }

    /// Gives every section in use its buffer view, once all primitives are known.
    fn close_sections(&mut self) {
        let mut view_of = [None; Section::ALL.len()];
        for section in Section::ALL {
            let slot = section as usize;
            view_of[slot] = self.view(self.section_len[slot]);
            if let Some(view) = view_of[slot] {
                let view = &mut self.views[view as usize];
                view.target = Some(if section.is_indices() {
                    TRIANGLES
                } else {
                    VERTICES
                });
                view.byte_stride = (!section.is_indices()).then_some(section.element_size());
            }
        }
        for accessor in &mut self.accessors {
            accessor.buffer_view = accessor.buffer_view.and_then(|slot| view_of[slot as usize]);
        }
    }

    /// Reserves `byte_length` bytes; `None` for none, because glTF knows no empty buffer view.
    fn view(&mut self, byte_length: u64) -> Option<u32> {
        if byte_length == 0 {
            return None;
        }
        let byte_offset = self.len.next_multiple_of(ALIGNMENT);
        self.len = byte_offset + byte_length;
        self.views.push(json::BufferView {
            buffer: 0,
            byte_offset,
            byte_length,
            byte_stride: None,
            target: None,
        });
        Some(self.views.len() as u32 - 1)
    }

    /// Appends everything in the order in which the views were reserved.
    fn write(&self, world: &World, out: &mut Vec<u8>) {
        let start = out.len();
        let mut bulk = Bulk { start, out };
        for section in Section::ALL {
            if self.section_len[section as usize] > 0 {
                bulk.align(ALIGNMENT);
                self.prepared.iter().for_each(|p| bulk.section(section, p));
            }
        }
        for image in &world.images {
            bulk.align(ALIGNMENT);
            bulk.out.extend_from_slice(&image_bytes(image));
        }
        if !world.graph.portals.is_empty() {
            bulk.align(ALIGNMENT);
            for portal in &world.graph.portals {
                bulk.floats(&portal.outline);
                portal.pieces.iter().for_each(|piece| bulk.floats(piece));
            }
        }
        let locator = &world.graph.locator;
        if !locator.planes.is_empty() {
            bulk.align(ALIGNMENT);
            for v in locator.planes.as_flattened() {
                bulk.out.extend_from_slice(&v.to_le_bytes());
            }
        }
        if !locator.nodes.is_empty() {
            bulk.align(ALIGNMENT);
            for node in &locator.nodes {
                bulk.out.extend_from_slice(&node.plane.to_le_bytes());
                bulk.out.extend_from_slice(&node.children[0].to_le_bytes());
                bulk.out.extend_from_slice(&node.children[1].to_le_bytes());
            }
        }
        bulk.align(4);
    }
}

/// Buffer views start at multiples of this, which suits `f64` planes as well as vertices.
const ALIGNMENT: u64 = 8;

/// The buffer while it is written.
struct Bulk<'o> {
    start: usize,
    out: &'o mut Vec<u8>,
}

impl Bulk<'_> {
    fn align(&mut self, to: u64) {
        let len = (self.out.len() - self.start).next_multiple_of(to as usize);
        self.out.resize(self.start + len, 0);
    }

    fn floats<const N: usize>(&mut self, rows: &[[f32; N]]) {
        self.mapped(rows, |v| v);
    }

    fn mapped<const N: usize>(&mut self, rows: &[[f32; N]], f: impl Fn(f32) -> f32) {
        for &v in rows.as_flattened() {
            self.out.extend_from_slice(&f(v).to_le_bytes());
        }
    }

    fn section(&mut self, section: Section, prepared: &Prepared) {
        let p = &*prepared.primitive;
        match section {
            Section::Positions => self.floats(&p.positions),
            Section::Normals if prepared.has_normals => self.floats(&p.normals),
            Section::Tangents if prepared.has_tangents => self.floats(&p.tangents),
            Section::Uvs => {
                for set in &p.uvs {
                    self.mapped(set, |v| if v.is_finite() { v } else { 0.0 });
                }
            }
            // Compared, so that NaN becomes 0 and no minus zero is left to chance.
            Section::Colors => {
                self.mapped(&p.colors, |v| if v > 0.0 { v.min(1.0) } else { 0.0 });
            }
            Section::Indices16 if prepared.indices == section => {
                for &i in &p.indices {
                    self.out.extend_from_slice(&(i as u16).to_le_bytes());
                }
            }
            Section::Indices32 if prepared.indices == section => {
                for &i in &p.indices {
                    self.out.extend_from_slice(&i.to_le_bytes());
                }
            }
            _ => {}
        }
    }
}

/// Builds the whole JSON and reserves the buffer.
fn lay_out<'a>(layout: &mut Layout<'a>, world: &'a World) -> json::Root {
    let graph = &world.graph;
    let mut meshes = Vec::new();
    let mut nodes = vec![json::Node {
        name: "world".into(),
        ..Default::default()
    }];
    let mut top = Vec::new();

    for (i, cell) in graph.cells.iter().enumerate() {
        nodes.push(json::Node {
            name: cell.name.clone(),
            ..Default::default()
        });
        top.push(i as u32 + 1);
    }
    let batches = lay_out_batches(layout, world, &mut meshes, &mut nodes, &mut top);
    let (details, detail_meshes) =
        lay_out_details(layout, world, &mut meshes, &mut nodes, &mut top);
    nodes[0].children = top;
    layout.close_sections();

    let mut used = BTreeSet::from([EXTENSION.to_owned()]);
    let materials = world.materials.iter().map(|m| {
        let text = material_text(m);
        add_extensions(&mut used, &text);
        raw(text)
    });
    let materials = materials.collect();
    let (textures, samplers) = lay_out_textures(world, &mut used);
    let images = lay_out_images(layout, world);

    let corners: usize = graph
        .portals
        .iter()
        .map(|p| p.outline.len() + p.pieces.iter().map(Vec::len).sum::<usize>())
        .sum();
    let portal_corners = layout.view(corners as u64 * 12);
    let locator = lay_out_locator(layout, world);
    let n_bin = layout.len.next_multiple_of(4);
    let generator = match graph.provenance.generator.as_str() {
        "" => "enfilade",
        generator => generator,
    };
    json::Root {
        asset: json::Asset {
            version: "2.0".into(),
            generator: generator.into(),
        },
        extensions_used: used.into_iter().collect(),
        scene: 0,
        scenes: vec![json::Scene { nodes: vec![0] }],
        nodes,
        meshes,
        materials,
        textures,
        samplers,
        images,
        accessors: std::mem::take(&mut layout.accessors),
        buffer_views: std::mem::take(&mut layout.views),
        buffers: (n_bin > 0)
            .then_some(json::Buffer {
                byte_length: n_bin,
                uri: None,
            })
            .into_iter()
            .collect(),
        extensions: json::RootExtensions {
            graph: json::Graph {
                version: VERSION,
                cells: cells(world),
                portals: portals(world),
                portal_corners,
                batches,
                details,
                detail_meshes,
                locator,
                provenance: json::Provenance {
                    generator: graph.provenance.generator.clone(),
                    method: graph.provenance.method.clone(),
                    settings: graph.provenance.settings.clone(),
                    input_hash: graph.provenance.input_hash.clone(),
                },
                statistics: statistics(layout, world),
            },
        },
    }
}

/// One mesh for every set of cells; returns the batches in the world's order.
fn lay_out_batches<'a>(
    layout: &mut Layout<'a>,
    world: &'a World,
    meshes: &mut Vec<json::Mesh>,
    nodes: &mut Vec<json::Node>,
    top: &mut Vec<u32>,
) -> Vec<json::Batch> {
    let mut batches: Vec<json::Batch> = world
        .batches
        .iter()
        .map(|b| json::Batch {
            mesh: None,
            primitive: None,
            cells: ids(&b.cells),
        })
        .collect();
    let mut groups: BTreeMap<&[CellId], Vec<usize>> = BTreeMap::new();
    for (i, batch) in world.batches.iter().enumerate() {
        if !batch.primitive.indices.is_empty() {
            groups.entry(&batch.cells).or_default().push(i);
        }
    }
    let (mut shared, mut unseen) = (Vec::new(), None);
    for (cells, members) in groups {
        let mesh = meshes.len() as u32;
        for (primitive, &batch) in members.iter().enumerate() {
            batches[batch].mesh = Some(mesh);
            batches[batch].primitive = Some(primitive as u32);
        }
        let name = match cells {
            [] => "unseen".to_owned(),
            [cell] => world.graph.cells[cell.0 as usize].name.clone(),
            _ => format!("shared-{}", shared.len()),
        };
        let parts = members
            .iter()
            .map(|&b| Cow::Borrowed(&world.batches[b].primitive));
        meshes.push(layout.push_mesh(&name, parts));
        if let [cell] = cells {
            nodes[cell.0 as usize + 1].mesh = Some(mesh);
            continue;
        }
        nodes.push(json::Node {
            name,
            mesh: Some(mesh),
            ..Default::default()
        });
        let node = nodes.len() as u32 - 1;
        if cells.is_empty() {
            unseen = Some(node);
        } else {
            shared.push(node);
        }
    }
    push_parent(nodes, top, "shared", shared);
    top.extend(unseen);
    batches
}

fn push_parent(nodes: &mut Vec<json::Node>, top: &mut Vec<u32>, name: &str, children: Vec<u32>) {
    if !children.is_empty() {
        nodes.push(json::Node {
            name: name.into(),
            children,
            ..Default::default()
        });
        top.push(nodes.len() as u32 - 1);
    }
}

fn lay_out_details<'a>(
    layout: &mut Layout<'a>,
    world: &'a World,
    meshes: &mut Vec<json::Mesh>,
    nodes: &mut Vec<json::Node>,
    top: &mut Vec<u32>,
) -> (Vec<json::Detail>, Vec<Option<u32>>) {
    let drawn = |mesh: &'a Mesh| mesh.primitives.iter().filter(|p| !p.indices.is_empty());
    let mut detail_meshes = Vec::with_capacity(world.detail_meshes.len());
    for mesh in &world.detail_meshes {
        detail_meshes.push(drawn(mesh).next().map(|_| {
            meshes.push(layout.push_mesh(&mesh.name, drawn(mesh).map(Cow::Borrowed)));
            meshes.len() as u32 - 1
        }));
    }
    let (mut details, mut children) = (Vec::new(), Vec::new());
    for detail in &world.details {
        let mut mesh = detail.mesh;
        let mut transform = detail.transform;
        if detail_meshes[mesh as usize].is_some() && !is_trs(&transform) {
            let source = &world.detail_meshes[mesh as usize];
            let moved = drawn(source).map(|p| Cow::Owned(transformed(p, &transform)));
            meshes.push(layout.push_mesh(&source.name, moved));
            layout.n_flattened += 1;
            mesh = detail_meshes.len() as u32;
            detail_meshes.push(Some(meshes.len() as u32 - 1));
            transform = IDENTITY;
        }
        nodes.push(json::Node {
            name: detail.name.clone(),
            mesh: detail_meshes[mesh as usize],
            matrix: (transform != IDENTITY).then(|| transform.map(f64::from)),
            ..Default::default()
        });
        let node = nodes.len() as u32 - 1;
        children.push(node);
        details.push(json::Detail {
            node,
            mesh,
            cells: ids(&detail.cells),
        });
    }
    push_parent(nodes, top, "details", children);
    (details, detail_meshes)
}

pub(super) const IDENTITY: [f32; 16] = [
    1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0,
];

/// Whether a transform is translation, rotation and scale, as glTF demands of a node's matrix.
///
/// The limit is a fifth of what the Khronos validator allows (columns' sums of absolute values
/// within 5·10⁻⁵, whatever the scale), so that its decomposition in `f32` has room to round.
fn is_trs(transform: &[f32; 16]) -> bool {
    let m = linear(transform);
    let columns = [m.x_axis, m.y_axis, m.z_axis];
    let lengths = columns.map(DVec3::length);
    // A validator that works in f32 sees a smaller determinant as none.
    if m.determinant().abs() < 1e-30 || lengths.iter().any(|&l| l < 1e-9) {
        return transform == &IDENTITY;
    }
    let largest = lengths.into_iter().fold(0.0, f64::max);
    [(0, 1), (0, 2), (1, 2)].into_iter().all(|(a, b)| {
        let cosine = columns[a].dot(columns[b]) / (lengths[a] * lengths[b]);
        cosine.abs() * largest <= 1e-5
    })
}

fn linear(t: &[f32; 16]) -> DMat3 {
    DMat3::from_mat4(DMat4::from_cols_array(&t.map(f64::from)))
}

/// The primitive with `transform` applied to its vertices.
fn transformed(p: &Primitive, transform: &[f32; 16]) -> Primitive {
    let whole = DMat4::from_cols_array(&transform.map(f64::from));
    let linear = linear(transform);
    // The adjugate's transpose carries normals through singular matrices, too, and keeps the side.
    let normal_matrix = DMat3::from_cols(
        linear.y_axis.cross(linear.z_axis),
        linear.z_axis.cross(linear.x_axis),
        linear.x_axis.cross(linear.y_axis),
    );
    let mirror = if linear.determinant() < 0.0 {
        -1.0
    } else {
        1.0
    };
    let vec = |v: [f32; 3]| DVec3::from(v.map(f64::from));
    let mut moved = p.clone();
    for position in &mut moved.positions {
        *position = whole.transform_point3(vec(*position)).as_vec3().to_array();
    }
    for normal in &mut moved.normals {
        let n = (normal_matrix * vec(*normal) * mirror).normalize_or_zero();
        *normal = n.as_vec3().to_array();
    }
    for tangent in &mut moved.tangents {
        let [x, y, z, w] = *tangent;
        let t = (linear * vec([x, y, z])).normalize_or_zero().as_vec3();
        *tangent = [t.x, t.y, t.z, w * mirror as f32];
    }
    if mirror < 0.0 {
        // Front faces stay front faces.
        for triangle in moved.indices.chunks_exact_mut(3) {
            triangle.swap(1, 2);
        }
    }
    moved
}

fn lay_out_textures(
    world: &World,
    used: &mut BTreeSet<String>,
) -> (Vec<json::Texture>, Vec<Box<RawValue>>) {
    let mut samplers: Vec<Box<RawValue>> = Vec::new();
    let mut sampler_of: BTreeMap<&str, u32> = BTreeMap::new();
    let mut textures = Vec::with_capacity(world.textures.len());
    for texture in &world.textures {
        let sampler = sampler_text(texture).map(|text| {
            *sampler_of.entry(text).or_insert_with(|| {
                add_extensions(used, text);
                samplers.push(raw(text.to_owned()));
                samplers.len() as u32 - 1
            })
        });
        let mime = texture
            .image
            .map_or("", |i| mime(&world.images[i as usize]));
        let mut entry = json::Texture {
            sampler,
            source: texture.image,
            extensions: BTreeMap::new(),
        };
        if let Some((_, extension)) = TEXTURE_EXTENSIONS.iter().find(|(m, _)| *m == mime) {
            used.insert((*extension).to_owned());
            let source = json::TextureSource {
                source: entry.source.take(),
            };
            entry.extensions.insert((*extension).to_owned(), source);
        }
        textures.push(entry);
    }
    (textures, samplers)
}

fn lay_out_images(layout: &mut Layout, world: &World) -> Vec<json::Image> {
    let image = |image: &Image| json::Image {
        name: image.name.clone(),
        mime_type: mime(image).to_owned(),
        // An image without bytes is written as a white pixel, so that there always is a view.
        buffer_view: layout
            .view(image_bytes(image).len() as u64)
            .unwrap_or_default(),
    };
    world.images.iter().map(image).collect()
}

fn lay_out_locator(layout: &mut Layout, world: &World) -> json::Locator {
    let locator = &world.graph.locator;
    let (min, max) = (locator.bounds.min.to_array(), locator.bounds.max.to_array());
    json::Locator {
        bounds: (!locator.bounds.is_empty()).then_some([min, max]),
        outside: locator.outside.map(|c| c.0),
        root: locator.root,
        planes: layout.view(locator.planes.len() as u64 * 32),
        nodes: layout.view(locator.nodes.len() as u64 * 12),
    }
}

fn cells(world: &World) -> Vec<json::Cell> {
    let cell = |(i, cell): (usize, &crate::Cell)| json::Cell {
        name: cell.name.clone(),
        node: i as u32 + 1,
        aabb: cell.aabb.map(|corner| corner.map(f64::from)),
        volume: cell.volume.into(),
        triangles: cell.n_triangles,
        detail_triangles: cell.n_detail_triangles,
        portals: cell.portals.iter().map(|p| p.0).collect(),
        outdoor: cell.outdoor,
    };
    world.graph.cells.iter().enumerate().map(cell).collect()
}

fn portals(world: &World) -> Vec<json::Portal> {
    let portal = |portal: &crate::Portal| json::Portal {
        cells: portal.cells.map(|c| c.0),
        kind: match portal.kind {
            PortalKind::Open => json::Kind::Open,
            PortalKind::Door => json::Kind::Door,
            PortalKind::Window => json::Kind::Window,
            PortalKind::Crack => json::Kind::Crack,
        },
        normal: portal.normal.map(f64::from),
        area: portal.area.into(),
        outline: portal.outline.len() as u32,
        pieces: portal
            .pieces
            .iter()
            .map(|piece| piece.len() as u32)
            .collect(),
    };
    world.graph.portals.iter().map(portal).collect()
}

fn statistics(layout: &Layout, world: &World) -> BTreeMap<String, f64> {
    let mut counts = world.graph.statistics.counts.clone();
    for (name, n) in [
        ("dropped_normals", layout.n_dropped_normals),
        ("dropped_tangents", layout.n_dropped_tangents),
        ("flattened_details", layout.n_flattened),
    ] {
        if n > 0 {
            *counts.entry(name.to_owned()).or_default() += f64::from(n);
        }
    }
    counts
}

/// One white pixel, as PNG.
const WHITE_PIXEL: [u8; 67] = [
    0x89, b'P', b'N', b'G', 0x0d, 0x0a, 0x1a, 0x0a, 0, 0, 0, 0x0d, b'I', b'H', b'D', b'R', 0, 0, 0,
    1, 0, 0, 0, 1, 8, 0, 0, 0, 0, 0x3a, 0x7e, 0x9b, 0x55, 0, 0, 0, 0x0a, b'I', b'D', b'A', b'T',
    0x78, 0xda, 0x63, 0xf8, 0x0f, 0, 1, 1, 1, 0, 0x1b, 0xb6, 0xee, 0x56, 0, 0, 0, 0, b'I', b'E',
    b'N', b'D', 0xae, 0x42, 0x60, 0x82,
];

fn image_bytes(image: &Image) -> Cow<'_, [u8]> {
    if image.bytes.is_empty() {
        Cow::Owned(WHITE_PIXEL.to_vec())
    } else {
        Cow::Borrowed(&image.bytes)
    }
}

/// The picture's MIME type: by its first bytes where they tell, else as the input said.
fn mime(image: &Image) -> &str {
    let bytes = image_bytes(image);
    if bytes.starts_with(&WHITE_PIXEL[..8]) {
        "image/png"
    } else if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
        "image/jpeg"
    } else if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
        "image/webp"
    } else if bytes.starts_with(&[0xab, b'K', b'T', b'X', b' ', b'2', b'0', 0xbb]) {
        "image/ktx2"
    } else {
        &image.mime
    }
}

fn ids(cells: &[CellId]) -> Vec<u32> {
    cells.iter().map(|c| c.0).collect()
}

/// Embeds JSON text as it is. The world was validated, so that it parses.
fn raw(text: String) -> Box<RawValue> {
    RawValue::from_string(text).unwrap_or_else(|_| RawValue::NULL.to_owned())
}

/// Whether a stored direction counts as of unit length; the Khronos validator allows 0.00674.
fn is_unit(v: [f32; 3]) -> bool {
    (DVec3::from(v.map(f64::from)).length() - 1.0).abs() <= 0.006
}

fn extent(positions: &[[f32; 3]]) -> ([f64; 3], [f64; 3]) {
    let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for p in positions {
        for k in 0..3 {
            // Compared, because `f32::min` may pick either of plus and minus zero.
            if p[k] < min[k] {
                min[k] = p[k];
            }
            if p[k] > max[k] {
                max[k] = p[k];
            }
        }
    }
    (min.map(f64::from), max.map(f64::from))
}
