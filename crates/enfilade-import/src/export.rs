//! Writes a [`Scene`] as a plain GLB (Khronos, *glTF 2.0 Specification*, version 2.0.1).
//!
//! Meshes, materials with their extensions, textures and pictures are kept; objects become nodes below the scene.
//! Only names carry the roles, so that other programs see nothing unusual.

use enfilade_geom::scene::{Mesh, Object, Primitive, Scene};
use enfilade_geom::{DMat3, DMat4, DVec3};
use serde_json::{Map, Value, json};
use std::collections::{BTreeSet, HashMap};

const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const U32: u32 = 5125;
const F32: u32 = 5126;

/// Writes the scene as one GLB.
///
/// Omits content that glTF cannot hold: triangles without vertices, empty meshes and the objects that place them,
/// pictures without bytes or in a format that no extension names. The same scene gives the same bytes. Linear time
/// and memory.
///
/// # Panics
///
/// When the scene breaks its own promises: an index out of range, attributes of unequal lengths,
/// or more than 4 GiB of data.
#[must_use]
pub fn export_glb(scene: &Scene) -> Vec<u8> {
    let mut writer = Writer::default();
    let (textures, images) = writer.write_textures(scene);
    let materials = writer.write_materials(scene, &textures);
    let mut meshes: Vec<Value> = Vec::new();
    let mut mesh_numbers: HashMap<u32, usize> = HashMap::new();
    let mut nodes = Vec::new();
    for object in &scene.objects {
        let mesh = &scene.meshes[object.mesh as usize];
        if mesh.primitives.iter().all(|p| p.indices.len() < 3) {
            continue;
        }
        if is_trs(&object.transform) {
            let number = *mesh_numbers.entry(object.mesh).or_insert_with(|| {
                meshes.push(writer.write_mesh(mesh));
                meshes.len() - 1
            });
            nodes.push(node(object, number));
        } else {
            meshes.push(writer.write_mesh(&baked(mesh, &object.transform)));
            let placed = Object {
                transform: DMat4::IDENTITY,
                ..object.clone()
            };
            nodes.push(node(&placed, meshes.len() - 1));
        }
    }
    let mut root = Map::new();
    let generator = concat!("enfilade ", env!("CARGO_PKG_VERSION"));
    root.insert(
        "asset".into(),
        json!({ "version": "2.0", "generator": generator }),
    );
    // glTF allows no empty arrays.
    let mut scene_def = Map::new();
    if !nodes.is_empty() {
        scene_def.insert("nodes".into(), (0..nodes.len()).collect::<Vec<_>>().into());
    }
    root.insert("scene".into(), 0.into());
    root.insert("scenes".into(), json!([scene_def]));
    let lists = [
        ("nodes", nodes),
        ("meshes", meshes),
        ("materials", materials),
        ("textures", textures.defs),
        ("samplers", textures.samplers),
        ("images", images),
        ("accessors", std::mem::take(&mut writer.accessors)),
        ("bufferViews", std::mem::take(&mut writer.views)),
    ];
    for (name, list) in lists {
        if !list.is_empty() {
            root.insert(name.into(), list.into());
        }
    }
    if !writer.extensions.is_empty() {
        let used: Vec<_> = writer.extensions.iter().cloned().collect();
        root.insert("extensionsUsed".into(), used.into());
    }
    if !writer.bin.is_empty() {
        root.insert(
            "buffers".into(),
            json!([{ "byteLength": writer.bin.len() }]),
        );
    }
    container(&Value::Object(root), writer.bin)
}

/// Returns `true` if the transform is a translation, rotation and scale, as glTF requires of a node.
///
/// Flattened hierarchies may shear: a rotation below an uneven scale.
fn is_trs(m: &DMat4) -> bool {
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(|c| c.truncate().normalize_or_zero());
    // 1e-6: far above rounding, far below the validator's limit for shear.
    let is_square = [x.dot(y), y.dot(z), z.dot(x)]
        .iter()
        .all(|d| d.abs() < 1e-6);
    let volume = m.determinant();
    is_square && volume.is_normal()
}

/// Returns the mesh in world space.
fn baked(mesh: &Mesh, transform: &DMat4) -> Mesh {
    let linear = DMat3::from_mat4(*transform);
    let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
    // Cofactors transform normals even where there is no inverse.
    let sign = if linear.determinant() < 0.0 {
        -1.0
    } else {
        1.0
    };
    let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * sign;
    let wide = |v: &[f32; 3]| DVec3::from_array(v.map(f64::from));
    let narrow = |v: DVec3| v.to_array().map(|c| c as f32);
    let mut mesh = mesh.clone();
    for primitive in &mut mesh.primitives {
        for p in &mut primitive.positions {
            *p = narrow(transform.transform_point3(wide(p)));
        }
        for n in &mut primitive.normals {
            *n = narrow((cofactors * wide(n)).normalize_or(DVec3::Y));
        }
        for t in &mut primitive.tangents {
            let direction = (linear * wide(&[t[0], t[1], t[2]])).normalize_or(DVec3::X);
            let [x, y, z] = narrow(direction);
            *t = [x, y, z, t[3] * sign as f32];
        }
        if sign < 0.0 {
            primitive
                .indices
                .chunks_exact_mut(3)
                .for_each(|t| t.swap(1, 2));
        }
    }
    mesh
}

fn container(root: &Value, mut bin: Vec<u8>) -> Vec<u8> {
    let mut json = root.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    bin.resize(bin.len().next_multiple_of(4), 0);
    let has_bin = !bin.is_empty();
    let length = 12 + 8 + json.len() + if has_bin { 8 + bin.len() } else { 0 };
    let word = |n: usize| {
        u32::try_from(n)
            .expect("a GLB holds at most 4 GiB")
            .to_le_bytes()
    };
    let mut glb = Vec::with_capacity(length);
    glb.extend(b"glTF");
    glb.extend(word(2));
    glb.extend(word(length));
    glb.extend(word(json.len()));
    glb.extend(b"JSON");
    glb.append(&mut json);
    if has_bin {
        glb.extend(word(bin.len()));
        glb.extend(b"BIN\0");
        glb.append(&mut bin);
    }
    glb
}

fn node(object: &Object, mesh: usize) -> Value {
    let mut node = Map::new();
    if !object.name.is_empty() {
        node.insert("name".into(), object.name.as_str().into());
    }
    node.insert("mesh".into(), mesh.into());
    if object.transform != DMat4::IDENTITY {
        node.insert(
            "matrix".into(),
            object.transform.to_cols_array().to_vec().into(),
        );
    }
    Value::Object(node)
}

#[derive(Default)]
struct Writer {
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    extensions: BTreeSet<String>,
}

/// The written textures, and the new index of each of the scene's.
#[derive(Default)]
struct Textures {
    defs: Vec<Value>,
    samplers: Vec<Value>,
}

/// Returns the name of the extension that a picture format needs; empty if it needs none.
fn image_extension(mime: &str) -> Option<&'static str> {
    Some(match mime {
        "image/png" | "image/jpeg" => "",
        "image/webp" => "EXT_texture_webp",
        "image/avif" => "EXT_texture_avif",
        "image/ktx2" => "KHR_texture_basisu",
        "image/vnd-ms.dds" => "MSFT_texture_dds",
        _ => return None,
    })
}

impl Writer {
    fn view(&mut self, bytes: impl Iterator<Item = u8>, target: Option<u32>) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let start = self.bin.len();
        self.bin.extend(bytes);
        let mut view = json!({
            "buffer": 0, "byteOffset": start, "byteLength": self.bin.len() - start
        });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.views.push(view);
        self.views.len() - 1
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]], has_bounds: bool) -> usize {
        let bytes = values.iter().flatten().flat_map(|c| c.to_le_bytes());
        let view = self.view(bytes, Some(ARRAY_BUFFER));
        let shape = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let mut accessor = json!({
            "bufferView": view, "componentType": F32, "count": values.len(),
            "type": shape
        });
        if has_bounds {
            let bound = |f: fn(f32, f32) -> f32| {
                let first = values[0];
                let bound = values
                    .iter()
                    .fold(first, |b, v| std::array::from_fn(|k| f(b[k], v[k])));
                // The exact value of the f32, as readers may compare with it.
                bound.map(f64::from).to_vec()
            };
            accessor["min"] = bound(f32::min).into();
            accessor["max"] = bound(f32::max).into();
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn indices(&mut self, indices: &[u32]) -> usize {
        let view = self.view(
            indices.iter().flat_map(|i| i.to_le_bytes()),
            Some(ELEMENT_ARRAY_BUFFER),
        );
        self.accessors.push(json!({
            "bufferView": view, "componentType": U32, "count": indices.len(), "type": "SCALAR"
        }));
        self.accessors.len() - 1
    }

    fn write_mesh(&mut self, mesh: &Mesh) -> Value {
        let primitives: Vec<Value> = mesh
            .primitives
            .iter()
            .filter(|p| p.indices.len() >= 3)
            .map(|p| self.write_primitive(p))
            .collect();
        let mut def = json!({ "primitives": primitives });
        if !mesh.name.is_empty() {
            def["name"] = mesh.name.as_str().into();
        }
        def
    }

    fn write_primitive(&mut self, primitive: &Primitive) -> Value {
        let mut attributes = Map::new();
        let position = self.floats(&primitive.positions, true);
        attributes.insert("POSITION".into(), position.into());
        let n = primitive.positions.len();
        let check = |m: usize| assert_eq!(m, n, "one attribute value a position");
        if !primitive.normals.is_empty() {
            check(primitive.normals.len());
            let normals: Vec<_> = primitive.normals.iter().map(|n| unit(*n)).collect();
            attributes.insert("NORMAL".into(), self.floats(&normals, false).into());
        }
        // A tangent is meaningless without its normal.
        if !primitive.tangents.is_empty() && !primitive.normals.is_empty() {
            check(primitive.tangents.len());
            let tangents: Vec<_> = primitive
                .tangents
                .iter()
                .map(|t| {
                    let [x, y, z] = unit([t[0], t[1], t[2]]);
                    [x, y, z, if t[3] < 0.0 { -1.0 } else { 1.0 }]
                })
                .collect();
            attributes.insert("TANGENT".into(), self.floats(&tangents, false).into());
        }
        for (k, set) in primitive.uvs.iter().enumerate() {
            check(set.len());
            attributes.insert(format!("TEXCOORD_{k}"), self.floats(set, false).into());
        }
        if !primitive.colors.is_empty() {
            check(primitive.colors.len());
            attributes.insert(
                "COLOR_0".into(),
                self.floats(&primitive.colors, false).into(),
            );
        }
        let n_whole = primitive.indices.len() / 3 * 3;
        let indices = self.indices(&primitive.indices[..n_whole]);
        let mut def = json!({ "attributes": attributes, "indices": indices });
        if let Some(material) = primitive.material {
            def["material"] = material.into();
        }
        def
    }

    fn write_textures(&mut self, scene: &Scene) -> (Textures, Vec<Value>) {
        let mut images = Vec::new();
        let mut image_numbers = Vec::new();
        for image in &scene.images {
            let is_known = image_extension(&image.mime).is_some() && !image.bytes.is_empty();
            image_numbers.push(is_known.then_some(images.len()));
            if is_known {
                let view = self.view(image.bytes.iter().copied(), None);
                let mut def = json!({ "bufferView": view, "mimeType": image.mime });
                if !image.name.is_empty() {
                    def["name"] = image.name.as_str().into();
                }
                images.push(def);
            }
        }
        let mut textures = Textures::default();
        let mut sampler_numbers: HashMap<&str, usize> = HashMap::new();
        for texture in &scene.textures {
            let mut def = Map::new();
            let image = texture.image.map(|i| i as usize);
            if let Some(number) = image.and_then(|i| image_numbers[i]) {
                let mime = image.map_or("", |i| &scene.images[i].mime);
                let extension = image_extension(mime).unwrap_or_default();
                if extension.is_empty() {
                    def.insert("source".into(), number.into());
                } else {
                    let source = json!({ extension: { "source": number } });
                    def.insert("extensions".into(), source);
                    self.extensions.insert(extension.into());
                }
            }
            if !texture.sampler.is_empty()
                && let Ok(sampler) = serde_json::from_str::<Value>(&texture.sampler)
            {
                let number = *sampler_numbers.entry(&texture.sampler).or_insert_with(|| {
                    textures.samplers.push(sampler);
                    textures.samplers.len() - 1
                });
                def.insert("sampler".into(), number.into());
            }
            textures.defs.push(Value::Object(def));
        }
        (textures, images)
    }

    fn write_materials(&mut self, scene: &Scene, textures: &Textures) -> Vec<Value> {
        let n_textures = textures.defs.len();
        scene
            .materials
            .iter()
            .map(|material| {
                let mut value: Value = match serde_json::from_str(&material.gltf) {
                    Ok(value @ Value::Object(_)) => value,
                    _ => described(material),
                };
                self.visit_material(&mut value, n_textures);
                value
            })
            .collect()
    }

    /// Records the extensions in use, and drops references to missing textures.
    fn visit_material(&mut self, value: &mut Value, n_textures: usize) {
        let Value::Object(fields) = value else {
            return;
        };
        fields.retain(|key, inner| {
            let index = inner.get("index").and_then(Value::as_u64);
            !(key.ends_with("Texture") && index.is_some_and(|i| i >= n_textures as u64))
        });
        for (key, inner) in fields.iter_mut() {
            if key == "extras" {
                continue;
            }
            if key == "extensions"
                && let Value::Object(extensions) = inner
            {
                self.extensions.extend(extensions.keys().cloned());
            }
            self.visit_material(inner, n_textures);
        }
    }
}

/// Returns the JSON of a material without any, as generators make it.
fn described(material: &enfilade_geom::scene::Material) -> Value {
    let mut value = json!({
        "pbrMetallicRoughness": {
            "baseColorFactor": material.base_color.map(|c| c.clamp(0.0, 1.0)),
            "metallicFactor": 0.0
        }
    });
    if !material.name.is_empty() {
        value["name"] = material.name.as_str().into();
    }
    if material.double_sided {
        value["doubleSided"] = true.into();
    }
    if material.transparent {
        value["alphaMode"] = "BLEND".into();
    }
    value
}

/// Returns the direction with length 1, as glTF requires; `+Y` for a zero vector.
fn unit(n: [f32; 3]) -> [f32; 3] {
    let length = n.iter().map(|c| c * c).sum::<f32>().sqrt();
    // The validator accepts it as length 1: kept bit for bit.
    if (length - 1.0).abs() < 1e-4 {
        n
    } else if length > 0.0 && length.is_finite() {
        n.map(|c| c / length)
    } else {
        [0.0, 1.0, 0.0]
    }
}
