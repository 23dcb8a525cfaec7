//! Reads models of MagicaVoxel (`.vox`), by the crate `dot_vox`: cubes become rectangles, transforms place them.
//!
//! The faces between matter and air, or glass, are kept, joined to rectangles of one color. They close the matter. A cube has 0.1 m by
//! default, as ten of them are a meter in most levels made of them. Up is z.

use std::collections::{BTreeMap, BTreeSet};

use dot_vox::{DotVoxData, Frame, Model, SceneNode};
use enfilade_geom::scene::{Material, Mesh, Primitive};
use enfilade_geom::{DMat3, DMat4, DVec3};
use serde_json::json;

use crate::builder::{Builder, Placement};
use crate::caught::caught;
use crate::{ImportError, Up, soup};

/// The format read here.
pub(crate) const VOX: &str = "MagicaVoxel";
/// First bytes of a file.
const MAGIC: &[u8] = b"VOX ";
/// Bytes before the first chunk, and of the head of a chunk: name, length, length of its children.
const HEADS: [usize; 2] = [8, 12];
/// Default edge of a cube. [Units: m]
const CUBE: f64 = 0.1;
/// Cubes along a side of the largest model.
const SIDE: usize = 256;
/// Share of light that glass lets pass if the file does not say it.
const CLEAR: f32 = 0.5;
/// Work of a cube, in units of an allowance.
const WORK_A_CUBE: u64 = 2;

/// Returns `true` if the bytes begin a file of MagicaVoxel.
pub(crate) fn is_vox(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// Reads one file into the builder.
pub(crate) fn read(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    builder.set_format(VOX);
    check_chunks(bytes, builder)?;
    let data = caught(|| dot_vox::load_bytes(bytes).ok()).flatten();
    let Some(data) = data.filter(|data| !data.models.is_empty()) else {
        return Err(builder.malformed("chunks", "no model; save the file again in MagicaVoxel"));
    };
    let mut options = builder.options.clone();
    options.unit = options.unit.or(Some(CUBE));
    options.up = options.up.or(Some(Up::Z));
    let base = options.base_transform()?;
    let looks = looks(&data);
    let mut cubes = Cubes::default();
    let mut meshes = Vec::with_capacity(data.models.len());
    for (i, model) in data.models.iter().enumerate() {
        let place = format!("model {i}");
        builder.spend(&place, WORK_A_CUBE * model.voxels.len() as u64)?;
        let quads = cubes.quads(model, |color| looks[usize::from(color)][3] < 1.0);
        builder.charge_vertices(&place, 4 * quads.len() as u64)?;
        builder.check_triangles(&place, 2 * quads.len() as u64)?;
        meshes.push(mesh(&place, model, &quads));
    }
    // Only colors that a face has become materials.
    let mut material_of = BTreeMap::new();
    let meshes: Vec<u32> = meshes
        .into_iter()
        .map(|(mut mesh, colors)| {
            for (primitive, color) in mesh.primitives.iter_mut().zip(colors) {
                let next = || builder.push_material(material(color, looks[usize::from(color)]));
                primitive.material = Some(*material_of.entry(color).or_insert_with(next));
            }
            builder.push_mesh(mesh)
        })
        .collect();
    let mut places = Places {
        data: &data,
        meshes: &meshes,
        seen: BTreeSet::new(),
    };
    if data.scenes.is_empty() {
        for model in 0..meshes.len() {
            places.put(model, base, "", None, builder)?;
        }
        return Ok(());
    }
    places.walk(base, builder)
}

/// Checks that the chunks fill the file, one behind the other and none in another, and are whole.
fn check_chunks(bytes: &[u8], builder: &Builder<'_>) -> Result<(), ImportError> {
    let cut = |at: usize| {
        builder.malformed(
            format!("byte {at}"),
            "a chunk is cut off or holds others; save the file again",
        )
    };
    let lengths = |at: usize| {
        let head = bytes.get(at..)?.get(4..HEADS[1])?.as_chunks::<4>().0;
        Some([0, 1].map(|k| u32::from_le_bytes(head[k]) as usize))
    };
    let main = HEADS[0];
    let [own, below] = lengths(main).ok_or_else(|| cut(main))?;
    let mut at = main + HEADS[1] + own;
    let end = at.saturating_add(below);
    if end > bytes.len() {
        return Err(cut(main));
    }
    while at < end {
        let next = lengths(at).filter(|l| l[1] == 0);
        at = next.map_or(usize::MAX, |l| at + HEADS[1] + l[0]);
        if at > end {
            return Err(cut(end.min(at)));
        }
    }
    Ok(())
}

/// Returns the linear color of each entry of the palette, and its opacity.
fn looks(data: &DotVoxData) -> Vec<[f32; 4]> {
    let linear = |c: u8| soup::srgb_to_linear(f32::from(c) / 255.0);
    let mut looks: Vec<[f32; 4]> = data
        .palette
        .iter()
        .map(|c| [linear(c.r), linear(c.g), linear(c.b), 1.0])
        .collect();
    looks.resize(SIDE, [1.0; 4]);
    for m in &data.materials {
        if m.material_type() == Some("_glass") {
            let clear = m.transparency().or(m.opacity().map(|a| 1.0 - a));
            let clear = clear.filter(|c| *c > 0.0 && *c < 1.0).unwrap_or(CLEAR);
            // Entries of the palette are numbered from 1.
            looks[(m.id as usize).wrapping_sub(1) % SIDE][3] = 1.0 - clear;
        }
    }
    looks
}

fn material(color: u8, look: [f32; 4]) -> Material {
    let is_clear = look[3] < 1.0;
    let name = format!("color {}", u32::from(color) + 1);
    let mut fields = json!({
        "name": name,
        "pbrMetallicRoughness": {
            "baseColorFactor": look, "metallicFactor": 0.0, "roughnessFactor": 1.0
        }
    });
    if is_clear {
        fields["alphaMode"] = json!("BLEND");
    }
    Material {
        name,
        gltf: fields.to_string(),
        double_sided: false,
        transparent: is_clear,
        base_color: look,
    }
}

/// A rectangle of faces of one color, in cubes.
struct Quad {
    color: u8,
    /// Axis across it.
    axis: usize,
    /// Its front looks to larger coordinates.
    is_up: bool,
    at: i32,
    /// Along the two other axes, in the order of a right-handed turn.
    low: [i32; 2],
    high: [i32; 2],
}

/// The cubes of one model at a time: 0 is air, any other a color and one.
struct Cubes(Vec<u16>);

impl Default for Cubes {
    fn default() -> Self {
        Self(vec![0; SIDE * SIDE * SIDE])
    }
}

impl Cubes {
    fn index(at: [i32; 3]) -> Option<usize> {
        let side = SIDE as i32;
        let is_in = at.iter().all(|c| (0..side).contains(c));
        is_in.then(|| ((at[2] * side + at[1]) * side + at[0]) as usize)
    }

    /// Returns the faces of a model, joined to rectangles. `O(n log n)` in cubes.
    fn quads(&mut self, model: &Model, is_clear: impl Fn(u8) -> bool) -> Vec<Quad> {
        let place = |v: &dot_vox::Voxel| [v.x, v.y, v.z].map(i32::from);
        for v in &model.voxels {
            if let Some(i) = Self::index(place(v)) {
                self.0[i] = u16::from(v.i) + 1;
            }
        }
        let color_at = |at: [i32; 3]| {
            let cube = Self::index(at).map_or(0, |i| self.0[i]);
            cube.checked_sub(1).map(|color| color as u8)
        };
        let mut quads = Vec::new();
        for axis in 0..3 {
            let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
            for is_up in [false, true] {
                let mut faces: Vec<(i32, u8, [i32; 2])> = Vec::new();
                for voxel in &model.voxels {
                    let at = place(voxel);
                    let mut beyond = at;
                    beyond[axis] += if is_up { 1 } else { -1 };
                    let other = color_at(beyond);
                    let is_seen = |color: u8| other.is_none_or(|o| is_clear(o) && !is_clear(color));
                    if let Some(color) = color_at(at).filter(|&c| is_seen(c)) {
                        faces.push((at[axis] + i32::from(is_up), color, [at[v], at[u]]));
                    }
                }
                // A cube may be listed twice.
                faces.sort_unstable();
                faces.dedup();
                let runs = faces.chunk_by(|a, b| {
                    (a.0, a.1, a.2[0]) == (b.0, b.1, b.2[0]) && a.2[1] + 1 == b.2[1]
                });
                // Runs that end where a run of the row before ends make one rectangle with it.
                let mut open: BTreeMap<[i32; 2], usize> = BTreeMap::new();
                for run in runs {
                    let (at, color, [row, first]) = run[0];
                    let along = [first, first + run.len() as i32];
                    let before = open.get(&along).copied().filter(|&q: &usize| {
                        let q: &Quad = &quads[q];
                        (q.axis, q.is_up, q.at, q.color, q.high[1]) == (axis, is_up, at, color, row)
                    });
                    if let Some(quad) = before {
                        quads[quad].high[1] += 1;
                        continue;
                    }
                    open.insert(along, quads.len());
                    quads.push(Quad {
                        color,
                        axis,
                        is_up,
                        at,
                        low: [along[0], row],
                        high: [along[1], row + 1],
                    });
                }
            }
        }
        for v in &model.voxels {
            if let Some(i) = Self::index(place(v)) {
                self.0[i] = 0;
            }
        }
        quads
    }
}

/// Returns the mesh of a model around its middle, and the color of each primitive.
fn mesh(name: &str, model: &Model, quads: &[Quad]) -> (Mesh, Vec<u8>) {
    let size = [model.size.x, model.size.y, model.size.z];
    let middle = size.map(|s| (s / 2) as i32);
    let mut primitives: BTreeMap<u8, Primitive> = BTreeMap::new();
    for q in quads {
        let to = primitives.entry(q.color).or_default();
        let first = to.positions.len() as u32;
        let [u, v] = [(q.axis + 1) % 3, (q.axis + 2) % 3];
        let mut normal = [0.0; 3];
        normal[q.axis] = if q.is_up { 1.0 } else { -1.0 };
        for [a, b] in [
            [q.low[0], q.low[1]],
            [q.high[0], q.low[1]],
            [q.high[0], q.high[1]],
            [q.low[0], q.high[1]],
        ] {
            let mut p = [0; 3];
            (p[q.axis], p[u], p[v]) = (q.at, a, b);
            to.positions
                .push([0, 1, 2].map(|k| (p[k] - middle[k]) as f32));
            to.normals.push(normal);
        }
        let turn = |k: u32| first + if q.is_up { k } else { (4 - k) % 4 };
        to.indices.extend([0, 1, 2, 0, 2, 3].map(turn));
    }
    let (colors, primitives) = primitives.into_iter().unzip();
    let name = name.to_owned();
    (Mesh { name, primitives }, colors)
}

/// The tree of a file, which places its models.
struct Places<'d> {
    data: &'d DotVoxData,
    /// Number of the mesh of each model.
    meshes: &'d [u32],
    /// Nodes met so far: a tree has each once.
    seen: BTreeSet<u32>,
}

impl Places<'_> {
    fn walk(&mut self, base: DMat4, builder: &mut Builder<'_>) -> Result<(), ImportError> {
        let mut next = vec![(0_u32, base, String::new(), None)];
        while let Some((id, transform, name, parent)) = next.pop() {
            let Some(node) = self.data.scenes.get(id as usize) else {
                builder.note(format!("node {id}"), "it does not exist; left out");
                continue;
            };
            if !self.seen.insert(id) {
                builder.note(format!("node {id}"), "below two nodes; left out once");
                continue;
            }
            match node {
                SceneNode::Transform {
                    attributes,
                    frames,
                    child,
                    layer_id,
                } => {
                    let name = attributes.get("_name").cloned().unwrap_or_default();
                    let layer = self.data.layers.get(*layer_id as usize);
                    let is_hidden = attributes.get("_hidden").is_some_and(|h| h == "1");
                    if is_hidden || layer.is_some_and(dot_vox::Layer::hidden) {
                        builder.report.leave_out("hidden in its file", &name, 1);
                        continue;
                    }
                    let own = frames.first().map_or(DMat4::IDENTITY, matrix);
                    next.push((*child, transform * own, name, parent));
                }
                SceneNode::Group { children, .. } => {
                    let node = builder.add_source(&format!("node {id}"), parent, &name, "")?;
                    let children = children.iter().rev();
                    next.extend(children.map(|&c| (c, transform, String::new(), node)));
                }
                SceneNode::Shape { models, .. } => {
                    // Further models are frames of an animation.
                    if let Some(first) = models.first() {
                        self.put(first.model_id as usize, transform, &name, parent, builder)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Places a model.
    fn put(
        &self,
        model: usize,
        transform: DMat4,
        name: &str,
        parent: Option<u32>,
        builder: &mut Builder<'_>,
    ) -> Result<(), ImportError> {
        let place = format!("model {model}");
        let Some(&mesh) = self.meshes.get(model) else {
            builder.note(place, "it does not exist; left out");
            return Ok(());
        };
        let source = builder.add_source(&place, parent, name, "")?;
        builder.place(&Placement {
            mesh,
            names: [name, &place],
            ancestors: &[],
            transforms: &[transform],
            moves: None,
            place: &place,
            source,
        })
    }
}

/// Returns the transform of a frame: `_t` is a translation, `_r` a byte with the places and the signs of the rows of a rotation.
fn matrix(frame: &Frame) -> DMat4 {
    let numbers = frame.attributes.get("_t").map(|t| {
        let numbers = t.split_whitespace().map_while(|n| n.parse::<i32>().ok());
        numbers.map(f64::from).collect::<Vec<_>>()
    });
    let to = match numbers.as_deref() {
        Some([x, y, z]) => DVec3::new(*x, *y, *z),
        _ => DVec3::ZERO,
    };
    let byte = frame
        .attributes
        .get("_r")
        .and_then(|r| r.parse::<u8>().ok());
    let turn = byte.and_then(|r| {
        let places = [r & 3, r >> 2 & 3].map(usize::from);
        let last = 3_usize.checked_sub(places[0] + places[1])?;
        let is_one = places[0] != places[1] && places.iter().all(|&p| p < 3) && last < 3;
        let sign = |k: usize| if r >> (4 + k) & 1 == 1 { -1.0 } else { 1.0 };
        let row = |k: usize, at: usize| DVec3::AXES[at] * sign(k);
        let rows = [row(0, *places.first()?), row(1, places[1]), row(2, last)];
        is_one.then(|| DMat3::from_cols_array_2d(&rows.map(|r| r.to_array())).transpose())
    });
    DMat4::from_translation(to) * DMat4::from_mat3(turn.unwrap_or(DMat3::IDENTITY))
}
