//! The first picture of a walk: a small model of what is seen from its beginning, to be drawn before the world has come.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use enfilade_cpg::World;
use enfilade_geom::scene::Primitive;
use enfilade_geom::{DMat4, DVec3};
use enfilade_runtime::{Sight, SightState, Start, View, Viewer};
use serde_json::{Value, json};

use crate::PackError;
use crate::head::damaged;

/// Most triangles; those farther away come with the world. About 200 kB unpacked, and 70 kB packed.
const MOST: usize = 20_000;

/// Steps of a coordinate from end to end of what is seen.
const STEPS: f64 = 65_535.0;

const ARRAY_BUFFER: u32 = 34_962;
const ELEMENT_ARRAY_BUFFER: u32 = 34_963;
const U16: u32 = 5123;
const U32: u32 = 5125;

/// Makes a model of what may be seen from the beginning of a walk in any direction: a GLB with `KHR_mesh_quantization`, one mesh
/// for each material, without pictures and normals. Coordinates have 16 bits, so they are rounded to 0.4 mm over 50 m. `extras` of
/// the scene have `eye` and `yaw`. Packed with zstd. `None` for a world without cells.
///
/// # Errors
///
/// A world that cannot be prepared for queries.
pub fn first_picture(world: &World) -> Result<Option<Vec<u8>>, PackError> {
    let sight = Sight::build(world)?;
    let state = SightState::as_modeled(&sight);
    let Some(start) = Start::find(world, &sight, &state) else {
        return Ok(None);
    };
    let mut viewer = Viewer::new(&sight);
    let view = View::around(start.eye).map_err(|e| damaged(e.to_string()))?;
    let seen = viewer.see(&sight, &state, &view);

    let mut soup = Soup::default();
    for &id in seen.chunks() {
        let chunk = &sight.chunks()[id.0 as usize];
        let batch = &world.batches[chunk.batch as usize];
        let first = chunk.first_index as usize;
        let indices = &sight.indices(chunk.batch)[first..first + chunk.n_indices as usize];
        soup.add(&batch.primitive, indices, DMat4::IDENTITY);
    }
    for &id in seen.details() {
        let detail = &world[id];
        let placed = DMat4::from_cols_array(&detail.transform.map(f64::from));
        for primitive in &world.detail_meshes[detail.mesh as usize].primitives {
            soup.add(primitive, &primitive.indices, placed);
        }
    }
    let glb = soup.encode(world, &start);
    let packed = zstd::bulk::compress(&glb, 19);
    packed.map(Some).map_err(|e| damaged(e.to_string()))
}

/// Triangles by material.
#[derive(Default)]
struct Soup {
    of_material: BTreeMap<Option<u32>, Vec<[DVec3; 3]>>,
    n: usize,
}

impl Soup {
    fn add(&mut self, primitive: &Primitive, indices: &[u32], placed: DMat4) {
        if self.n + indices.len() / 3 > MOST {
            return;
        }
        self.n += indices.len() / 3;
        let corner = |i: u32| {
            let p = DVec3::from_array(primitive.positions[i as usize].map(f64::from));
            placed.transform_point3(p)
        };
        let triangles = indices
            .as_chunks()
            .0
            .iter()
            .map(|t: &[u32; 3]| t.map(corner));
        let own = self.of_material.entry(primitive.material).or_default();
        own.extend(triangles);
    }

    fn encode(&self, world: &World, start: &Start) -> Vec<u8> {
        let corners = || self.of_material.values().flatten().flatten();
        let low = corners().fold(DVec3::splat(f64::INFINITY), |a, p| a.min(*p));
        let high = corners().fold(DVec3::splat(f64::NEG_INFINITY), |a, p| a.max(*p));
        let low = if self.n == 0 { DVec3::ZERO } else { low };
        let unit = ((high - low).max_element() / STEPS).max(1e-6);
        let (mut bin, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
        let (mut primitives, mut materials) = (Vec::new(), Vec::new());
        for (material, triangles) in &self.of_material {
            let Indexed { vertices, indices } = Indexed::of(triangles, low, unit);
            if indices.is_empty() {
                continue;
            }
            let bounds = |pick: fn(u16, u16) -> u16, from: u16| {
                [0, 1, 2].map(|k| vertices.iter().fold(from, |a, v| pick(a, v[k])))
            };
            let n = accessors.len();
            let is_small = vertices.len() <= usize::from(u16::MAX);
            // glTF requires that rows of vertices are multiples of four bytes.
            push(&mut bin, &mut views, ARRAY_BUFFER, Some(8), |bin| {
                bin.extend(vertices.iter().flatten().flat_map(|x| x.to_le_bytes()));
            });
            push(&mut bin, &mut views, ELEMENT_ARRAY_BUFFER, None, |bin| {
                for i in &indices {
                    bin.extend(&i.to_le_bytes()[..if is_small { 2 } else { 4 }]);
                }
            });
            accessors.push(json!({
                "bufferView": n, "componentType": U16, "count": vertices.len(), "type": "VEC3",
                "min": bounds(u16::min, u16::MAX), "max": bounds(u16::max, 0),
            }));
            let kind = if is_small { U16 } else { U32 };
            accessors.push(json!({
                "bufferView": n + 1, "componentType": kind, "count": indices.len(), "type": "SCALAR",
            }));
            primitives.push(json!({
                "attributes": { "POSITION": n }, "indices": n + 1, "material": materials.len(),
            }));
            materials.push(plain(world, *material));
        }
        let node = json!({ "mesh": 0, "translation": low.to_array(), "scale": [unit, unit, unit] });
        let is_empty = primitives.is_empty();
        let extras = json!({ "eye": start.eye, "yaw": start.yaw });
        let mut root = json!({
            "asset": { "version": "2.0" },
            "extensionsUsed": ["KHR_mesh_quantization"],
            "extensionsRequired": ["KHR_mesh_quantization"],
            "scene": 0,
            "scenes": [{ "nodes": [0], "extras": extras }],
            "nodes": [node],
            "meshes": [{ "primitives": primitives }],
            "materials": materials,
            "accessors": accessors,
            "bufferViews": views,
            "buffers": [{ "byteLength": bin.len() }],
        });
        if is_empty {
            // glTF allows no empty lists.
            root = json!({ "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "extras": extras }] });
        }
        container(&root, &bin)
    }
}

/// Triangles with shared vertices, which are in the order of their first use.
struct Indexed {
    /// Coordinates, and a number that fills the row.
    vertices: Vec<[u16; 4]>,
    indices: Vec<u32>,
}

impl Indexed {
    fn of(triangles: &[[DVec3; 3]], low: DVec3, unit: f64) -> Self {
        let mut known: BTreeMap<[u16; 4], u32> = BTreeMap::new();
        let (mut vertices, mut indices) = (Vec::new(), Vec::new());
        for triangle in triangles {
            let corners = triangle.map(|p| {
                let [x, y, z] = ((p - low) / unit).round().to_array().map(|x| x as u16);
                [x, y, z, 0]
            });
            if corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0] {
                continue;
            }
            for corner in corners {
                let next = vertices.len() as u32;
                indices.push(match known.entry(corner) {
                    Entry::Occupied(known) => *known.get(),
                    Entry::Vacant(new) => {
                        vertices.push(corner);
                        *new.insert(next)
                    }
                });
            }
        }
        Self { vertices, indices }
    }
}

/// Appends a view of the buffer.
fn push(
    bin: &mut Vec<u8>,
    views: &mut Vec<Value>,
    target: u32,
    stride: Option<u32>,
    fill: impl FnOnce(&mut Vec<u8>),
) {
    let start = bin.len();
    fill(bin);
    let mut view = json!({
        "buffer": 0, "byteOffset": start, "byteLength": bin.len() - start, "target": target,
    });
    if let Some(stride) = stride {
        view["byteStride"] = stride.into();
    }
    views.push(view);
    bin.resize(bin.len().next_multiple_of(4), 0);
}

/// Returns a material without its pictures.
fn plain(world: &World, material: Option<u32>) -> Value {
    let material = material.and_then(|m| world.materials.get(m as usize));
    let text = material.map_or("{}", |m| m.gltf.as_str());
    let Ok(Value::Object(mut fields)) = serde_json::from_str(text) else {
        return json!({});
    };
    let kept = [
        "pbrMetallicRoughness",
        "emissiveFactor",
        "alphaMode",
        "alphaCutoff",
    ];
    fields.retain(|name, _| kept.contains(&name.as_str()));
    if let Some(Value::Object(surface)) = fields.get_mut("pbrMetallicRoughness") {
        surface.retain(|name, _| name.ends_with("Factor"));
    }
    Value::Object(fields)
}

/// Returns a GLB.
fn container(root: &Value, bin: &[u8]) -> Vec<u8> {
    let mut text = root.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let n = 12 + 8 + text.len() + 8 + bin.len();
    let mut out = b"glTF".to_vec();
    for word in [2, n as u32, text.len() as u32] {
        out.extend(word.to_le_bytes());
    }
    out.extend(b"JSON");
    out.append(&mut text);
    out.extend((bin.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(bin);
    out
}
