//! World → GLB.
//!
//! Two passes: the first lays out the buffer and writes the JSON, the second streams the bulk data behind it. So peak
//! memory is the file itself, without a copy of the geometry.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use enfilade_geom::Aabb;
use enfilade_geom::scene::{FixtureKind, Image, Mesh, SourceNode};
use serde_json::value::RawValue;

use super::boxes;
use super::buffer::{Layout, image_bytes, mime};
use super::fitting;
use super::json::{self, TEXTURE_EXTENSIONS};
use super::special;
use super::transform::{IDENTITY, is_trs, transformed};
use super::{
    CHUNK_BIN, CHUNK_JSON, EXTENSION, GLB_MAGIC, GLB_VERSION, LEAK_PATH, LIGHTS, VERSION, WireError,
};
use crate::look::{add_extensions, material_text, n_texcoord_sets, sampler_text};
use crate::{CellId, RoomFacts, World};

/// Encodes a world as one GLB.
///
/// Equal worlds give equal bytes. Changes values that glTF forbids as the [module](super) describes. Takes time and
/// memory linear in the world; nothing is allocated twice.
///
/// # Errors
///
/// [`WireError::Invalid`] for a world that breaks its invariants, [`WireError::TooLarge`] beyond
/// 4 GiB.
pub fn encode_glb(world: &World) -> Result<Vec<u8>, WireError> {
    world.validate().map_err(WireError::Invalid)?;
    let n_uvs = world
        .materials
        .iter()
        .map(|m| n_texcoord_sets(&material_text(m)))
        .collect();
    let mut layout = Layout::new(n_uvs);
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
    let leak_path = lay_out_leak_path(layout, world, &mut meshes, &mut nodes);
    top.extend(leak_path);
    let placed = lay_out_fixtures(world, &mut nodes, &mut top);
    nodes[0].children = top;
    layout.close_sections();

    let mut used = BTreeSet::from([EXTENSION.to_owned()]);
    let materials = world.materials.iter().map(|m| {
        let text = material_text(m);
        add_extensions(&mut used, &text);
        raw(text)
    });
    let materials = materials.collect();
    add_fixture_extensions(&mut used, world);
    let (textures, samplers) = lay_out_textures(world, &mut used);
    let images = lay_out_images(layout, world);

    let corners: usize = graph
        .portals
        .iter()
        .map(|p| p.outline.len() + p.pieces.iter().map(Vec::len).sum::<usize>())
        .sum();
    let portal_corners = layout.view(corners as u64 * 12);
    let corners = graph.specials.iter().filter_map(special::surface).flatten();
    let special_corners = layout.view(corners.map(|p| p.len() as u64 * 12).sum());
    let locator = lay_out_locator(layout, world);
    let pvs = lay_out_pvs(layout, world);
    let n_runs: usize = world.batches.iter().map(|b| b.sources.runs().len()).sum();
    let source_runs = layout.view(n_runs as u64 * 8);
    let n_bin = layout.len.next_multiple_of(4);
    json::Root {
        asset: asset(world),
        extensions_used: used.into_iter().collect(),
        scene: 0,
        scenes: vec![json::Scene {
            nodes: vec![0],
            extras: optional_raw(&world.about.extras),
        }],
        nodes,
        meshes,
        cameras: placed.cameras,
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
                version: version(world),
                cells: cells(world),
                portals: portals(world),
                portal_corners,
                specials: graph.specials.iter().map(special::written).collect(),
                special_corners,
                batches,
                details,
                detail_meshes,
                locator,
                sources: sources(world),
                source_runs,
                fixtures: placed.nodes,
                leak_path,
                pvs,
                rooms: rooms(world),
                places: graph.places.clone(),
                provenance: provenance(world),
                statistics: statistics(layout, world),
            },
            lights: placed.lights,
        },
    }
}

/// Returns the lowest version that holds a world.
fn version(world: &World) -> u64 {
    if world.graph.specials.is_empty() {
        1
    } else {
        VERSION
    }
}

/// Lays out the potentially visible set, in the order in which [`visible::words`](super::visible::words) and its
/// planes are written.
fn lay_out_pvs(layout: &mut Layout<'_>, world: &World) -> Option<json::PvsJson> {
    world.pvs.as_ref().map(|pvs| json::PvsJson {
        rows: layout.view(pvs.ends.len() as u64 * 4),
        runs: layout.view(pvs.runs.len() as u64 * 8),
        parts: pvs.parts.as_ref().map(|parts| json::PartsJson {
            rows: layout.view(parts.ends.len() as u64 * 4),
            runs: layout.view(parts.runs.len() as u64 * 8),
        }),
        volumes: pvs.volumes.as_ref().map(|volumes| json::VolumesJson {
            rows: layout.view(volumes.ends.len() as u64 * 4),
            pieces: layout.view(volumes.piece_ends.len() as u64 * 4),
            planes: layout.view(volumes.planes.len() as u64 * 32),
        }),
    })
}

/// Makes one mesh for every set of cells; returns the batches in the world's order.
fn lay_out_batches<'a>(
    layout: &mut Layout<'a>,
    world: &'a World,
    meshes: &mut Vec<json::Mesh>,
    nodes: &mut Vec<json::Node>,
    top: &mut Vec<u32>,
) -> Vec<json::BatchJson> {
    let mut batches: Vec<json::BatchJson> = world
        .batches
        .iter()
        .map(|b| json::BatchJson {
            mesh: None,
            primitive: None,
            cells: ids(&b.cells),
            sources: b.sources.runs().len() as u32,
            seal: b.is_seal,
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
            [cell] => world.graph[*cell].name.clone(),
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
    let boxes: Vec<Aabb> = (world.detail_meshes.iter())
        .map(|mesh| boxes::of_mesh(drawn(mesh)))
        .collect();
    let mut details = Vec::new();
    let mut tree = NameTree::default();
    for detail in &world.details {
        let mut local = boxes[detail.mesh as usize];
        let mut mesh = detail.mesh;
        let mut transform = detail.transform;
        if detail_meshes[mesh as usize].is_some() && !is_trs(&transform) {
            let source = &world.detail_meshes[mesh as usize];
            let moved: Vec<_> = drawn(source).map(|p| transformed(p, &transform)).collect();
            local = boxes::of_mesh(&moved);
            let moved = moved.into_iter().map(Cow::Owned);
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
            extras: detail
                .source
                .and_then(|s| optional_raw(&world.sources[s as usize].extras)),
            ..Default::default()
        });
        let node = nodes.len() as u32 - 1;
        tree.add(world, nodes, node, detail.source);
        details.push(json::Detail {
            node,
            mesh,
            cells: ids(&detail.cells),
            source: detail.source,
            part_of: detail.part_of,
            aabb: boxes::placed(&local, &transform),
        });
    }
    push_parent(nodes, top, "details", tree.top);
    (details, detail_meshes)
}

/// The input's nodes above those of details, so that viewers show details in groups. Their transforms are identities.
#[derive(Default)]
struct NameTree {
    /// For each source, its node.
    nodes: BTreeMap<u32, u32>,
    /// Nodes without a parent.
    top: Vec<u32>,
}

impl NameTree {
    /// Adds `node`, which comes from `source`, below the nodes of that source's ancestors.
    fn add(&mut self, world: &World, nodes: &mut Vec<json::Node>, node: u32, source: Option<u32>) {
        let mut below = node;
        let mut above = source.and_then(|s| world.sources[s as usize].parent);
        while let Some(s) = above {
            if let Some(&known) = self.nodes.get(&s) {
                nodes[known as usize].children.push(below);
                return;
            }
            let source = &world.sources[s as usize];
            nodes.push(json::Node {
                name: source.name.clone(),
                children: vec![below],
                extras: optional_raw(&source.extras),
                ..Default::default()
            });
            below = nodes.len() as u32 - 1;
            self.nodes.insert(s, below);
            above = source.parent;
        }
        self.top.push(below);
    }
}

/// Nodes and definitions of lights, cameras and marked places.
struct Placed {
    nodes: Vec<u32>,
    lights: Option<json::Lights>,
    cameras: Vec<Box<RawValue>>,
}

/// Makes a node for each light, camera or marked place; writes equal lights and cameras once.
fn lay_out_fixtures(world: &World, nodes: &mut Vec<json::Node>, top: &mut Vec<u32>) -> Placed {
    let mut number_of: BTreeMap<(FixtureKind, &str), u32> = BTreeMap::new();
    let (mut lights, mut cameras, mut placed) = (Vec::new(), Vec::new(), Vec::new());
    for fixture in &world.fixtures {
        let mut number_in = |list: &mut Vec<Box<RawValue>>| {
            let key = (fixture.kind, fixture.gltf.as_str());
            *number_of.entry(key).or_insert_with(|| {
                list.push(raw(fixture.gltf.clone()));
                list.len() as u32 - 1
            })
        };
        let transform = fixture.transform.to_cols_array().map(|v| v as f32);
        let mut node = json::Node {
            name: fixture.name.clone(),
            matrix: (transform != IDENTITY).then(|| transform.map(f64::from)),
            extras: optional_raw(&fixture.extras),
            ..Default::default()
        };
        match fixture.kind {
            FixtureKind::Light => {
                let light = number_in(&mut lights);
                node.extensions.light = Some(json::LightRef { light });
            }
            FixtureKind::Camera => node.camera = Some(number_in(&mut cameras)),
            FixtureKind::Marker => {}
        }
        nodes.push(node);
        placed.push(nodes.len() as u32 - 1);
    }
    push_parent(nodes, top, "fixtures", placed.clone());
    Placed {
        nodes: placed,
        lights: (!lights.is_empty()).then_some(json::Lights { lights }),
        cameras,
    }
}

/// Adds the extension for lights, and the extensions that lights and cameras use.
fn add_fixture_extensions(used: &mut BTreeSet<String>, world: &World) {
    for fixture in &world.fixtures {
        if fixture.kind == FixtureKind::Light {
            used.insert(LIGHTS.to_owned());
        }
        add_extensions(used, &fixture.gltf);
    }
}

fn sources(world: &World) -> Vec<json::SourceJson> {
    let source = |node: &SourceNode| json::SourceJson {
        name: node.name.clone(),
        parent: node.parent,
        extras: optional_raw(&node.extras),
    };
    world.sources.iter().map(source).collect()
}

fn lay_out_leak_path<'a>(
    layout: &mut Layout<'a>,
    world: &'a World,
    meshes: &mut Vec<json::Mesh>,
    nodes: &mut Vec<json::Node>,
) -> Option<u32> {
    if world.leak_path.is_empty() {
        return None;
    }
    meshes.push(layout.push_line(LEAK_PATH, &world.leak_path));
    nodes.push(json::Node {
        name: LEAK_PATH.into(),
        mesh: Some(meshes.len() as u32 - 1),
        ..Default::default()
    });
    Some(nodes.len() as u32 - 1)
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
        // An image without bytes is written as a white pixel, so that a view always exists.
        buffer_view: layout
            .view(image_bytes(image).len() as u64)
            .unwrap_or_default(),
    };
    world.images.iter().map(image).collect()
}

fn lay_out_locator(layout: &mut Layout, world: &World) -> json::LocatorJson {
    let locator = &world.graph.locator;
    let (min, max) = (locator.bounds.min.to_array(), locator.bounds.max.to_array());
    json::LocatorJson {
        bounds: (!locator.bounds.is_empty()).then_some([min, max]),
        outside: locator.outside.map(|c| c.0),
        root: locator.root,
        planes: layout.view(locator.planes.len() as u64 * 32),
        nodes: layout.view(locator.nodes.len() as u64 * 12),
    }
}

fn asset(world: &World) -> json::Asset {
    let generator = match world.graph.provenance.generator.as_str() {
        "" => "enfilade",
        generator => generator,
    };
    json::Asset {
        version: "2.0".into(),
        generator: generator.into(),
        copyright: world.about.copyright.clone(),
    }
}

fn provenance(world: &World) -> json::ProvenanceJson {
    let provenance = &world.graph.provenance;
    json::ProvenanceJson {
        generator: provenance.generator.clone(),
        method: provenance.method.clone(),
        settings: provenance.settings.clone(),
        input_hash: provenance.input_hash.clone(),
    }
}

fn cells(world: &World) -> Vec<json::CellJson> {
    let cell = |(i, cell): (usize, &crate::Cell)| json::CellJson {
        name: cell.name.clone(),
        node: i as u32 + 1,
        aabb: cell.aabb.map(|corner| corner.map(f64::from)),
        volume: cell.volume.into(),
        triangles: cell.n_triangles,
        detail_triangles: cell.n_detail_triangles,
        portals: cell.portals.iter().map(|p| p.0).collect(),
        outdoor: cell.outdoor,
        void: cell.is_void,
        land: cell.is_land,
        why: cell.why.clone(),
    };
    world.graph.cells.iter().enumerate().map(cell).collect()
}

fn rooms(world: &World) -> Option<Vec<json::RoomJson>> {
    let room = |room: &RoomFacts| json::RoomJson {
        cell: room.cell.0,
        storeys: room.storeys.clone(),
        floor_area: room.floor_area,
        area_above_1_5: room.area_above_1_5,
        area_above_2_3: room.area_above_2_3,
        height: room.height,
    };
    let facts = world.room_facts.as_ref()?;
    Some(facts.iter().map(room).collect())
}

fn portals(world: &World) -> Vec<json::PortalJson> {
    let portal = |portal: &crate::Portal| json::PortalJson {
        cells: portal.cells.map(|c| c.0),
        kind: portal.kind.into(),
        normal: portal.normal.map(f64::from),
        area: portal.area.into(),
        outline: portal.outline.len() as u32,
        pieces: portal
            .pieces
            .iter()
            .map(|piece| piece.len() as u32)
            .collect(),
        fittings: portal.fittings.iter().map(fitting::written).collect(),
        why: portal.why.clone(),
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

fn ids(cells: &[CellId]) -> Vec<u32> {
    cells.iter().map(|c| c.0).collect()
}

/// Embeds JSON text as it is, unless it is empty.
fn optional_raw(text: &str) -> Option<Box<RawValue>> {
    (!text.is_empty()).then(|| raw(text.to_owned()))
}

/// Embeds JSON text as it is. The world is valid, so the text parses.
fn raw(text: String) -> Box<RawValue> {
    RawValue::from_string(text).unwrap_or_else(|_| RawValue::NULL.to_owned())
}
