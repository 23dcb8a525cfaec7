//! GLB files in another order: everything that the document numbers.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use enfilade_demo::Rng;

/// Returns a GLB with its nodes, children, meshes, primitives, materials, textures, images, triangles and vertices in
/// another order, and triangles that start at another vertex. Names, shapes and places stay.
///
/// Vertices are neither merged nor split. Primitives that are not triangle lists, or are compressed or sparse, keep
/// their order.
///
/// # Panics
/// If the bytes are not a GLB.
#[must_use]
pub fn shuffled_glb(glb: &[u8], seed: u64) -> Vec<u8> {
    let word =
        |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().expect("four bytes")) as usize;
    let n_json = word(12);
    let root: Value = serde_json::from_slice(&glb[20..20 + n_json]).expect("a JSON chunk");
    let at = 20 + n_json;
    let bin = if glb.len() > at {
        glb[at + 8..at + 8 + word(at)].to_vec()
    } else {
        Vec::new()
    };
    let mut document = Document {
        root,
        bin,
        rng: Rng::new(seed),
    };
    document.shuffle_triangles();
    document.shuffle_looks();
    document.shuffle_meshes();
    document.shuffle_nodes();
    document.written()
}

struct Document {
    root: Value,
    bin: Vec<u8>,
    rng: Rng,
}

impl Document {
    /// Shuffles a list of the root; returns the new index of each old one.
    fn shuffle_list(&mut self, name: &str) -> Vec<usize> {
        let Some(list) = self.root.get_mut(name).and_then(Value::as_array_mut) else {
            return Vec::new();
        };
        let mut items: Vec<(usize, Value)> = list.drain(..).enumerate().collect();
        self.rng.shuffle(&mut items);
        let mut number = vec![0; items.len()];
        for (new, (old, item)) in items.into_iter().enumerate() {
            number[old] = new;
            list.push(item);
        }
        number
    }

    fn each(&mut self, list: &str, change: impl FnMut(&mut Value)) {
        let items = self.root.get_mut(list).and_then(Value::as_array_mut);
        items.into_iter().flatten().for_each(change);
    }

    fn shuffle_looks(&mut self) {
        let images = self.shuffle_list("images");
        self.each("textures", |texture| {
            renumber_at(texture, "source", &images);
        });
        let textures = self.shuffle_list("textures");
        self.each("materials", |material| {
            renumber_textures(material, &textures);
        });
        let materials = self.shuffle_list("materials");
        self.each("meshes", |mesh| {
            let primitives = mesh["primitives"].as_array_mut();
            primitives
                .into_iter()
                .flatten()
                .for_each(|p| renumber_at(p, "material", &materials));
        });
    }

    fn shuffle_meshes(&mut self) {
        let Self { root, rng, .. } = self;
        let meshes = root.get_mut("meshes").and_then(Value::as_array_mut);
        for mesh in meshes.into_iter().flatten() {
            if let Some(primitives) = mesh["primitives"].as_array_mut() {
                rng.shuffle(primitives);
            }
        }
        let meshes = self.shuffle_list("meshes");
        self.each("nodes", |node| renumber_at(node, "mesh", &meshes));
    }

    fn shuffle_nodes(&mut self) {
        let nodes = self.shuffle_list("nodes");
        let Self { root, rng, .. } = self;
        let mut lists: Vec<&mut Value> = Vec::new();
        let Value::Object(root) = root else { return };
        for (name, value) in root.iter_mut() {
            let key = match name.as_str() {
                "nodes" => "children",
                "scenes" => "nodes",
                _ => continue,
            };
            let items = value.as_array_mut().into_iter().flatten();
            lists.extend(items.filter_map(|item| item.get_mut(key)));
        }
        for list in lists.into_iter().filter_map(Value::as_array_mut) {
            list.iter_mut().for_each(|node| renumber(node, &nodes));
            rng.shuffle(list);
        }
        self.each("skins", |skin| {
            renumber_at(skin, "skeleton", &nodes);
            let joints = skin["joints"].as_array_mut().into_iter().flatten();
            joints.for_each(|joint| renumber(joint, &nodes));
        });
        self.each("animations", |animation| {
            let channels = animation["channels"].as_array_mut().into_iter().flatten();
            channels.for_each(|c| renumber_at(&mut c["target"], "node", &nodes));
        });
    }

    /// Gives each primitive accessors of its own, with triangles and vertices in another order.
    fn shuffle_triangles(&mut self) {
        let Some(mut meshes) = self.root.get_mut("meshes").map(Value::take) else {
            return;
        };
        for mesh in meshes.as_array_mut().into_iter().flatten() {
            for primitive in mesh["primitives"].as_array_mut().into_iter().flatten() {
                self.shuffle_primitive(primitive);
            }
        }
        self.root["meshes"] = meshes;
    }

    fn shuffle_primitive(&mut self, primitive: &mut Value) {
        let is_list = primitive.get("mode").is_none_or(|mode| *mode == json!(4));
        if !is_list || primitive.get("extensions").is_some() {
            return;
        }
        let Some(n) = self.count(&primitive["attributes"]["POSITION"]) else {
            return;
        };
        let triangles = match primitive.get("indices") {
            Some(accessor) => self.indices(accessor),
            None => Some((0..n).collect()),
        };
        let mut sets = vec![primitive["attributes"].clone()];
        sets.extend(primitive["targets"].as_array().cloned().unwrap_or_default());
        let accessors = sets
            .iter()
            .filter_map(Value::as_object)
            .flat_map(Map::values);
        let old: Option<BTreeMap<u64, Elements>> = accessors
            .map(|a| Some((a.as_u64()?, self.elements(a)?)))
            .collect();
        let (Some(triangles), Some(old)) = (triangles, old) else {
            return;
        };
        let mut triangles: Vec<[usize; 3]> = triangles
            .chunks_exact(3)
            .map(|t| [t[0], t[1], t[2]])
            .collect();
        self.rng.shuffle(&mut triangles);
        for t in &mut triangles {
            t.rotate_left(self.rng.below(3));
        }
        // The old index of each new vertex.
        let mut vertices: Vec<usize> = (0..n).collect();
        if primitive.get("indices").is_some() {
            self.rng.shuffle(&mut vertices);
            let mut number = vec![0; n];
            for (new, &old) in vertices.iter().enumerate() {
                number[old] = new as u32;
            }
            let indices = triangles.concat();
            let bytes = indices.iter().map(|&i| number[i].to_le_bytes().to_vec());
            let accessor = json!({ "componentType": 5125, "type": "SCALAR" });
            primitive["indices"] = self.add_accessor(accessor, bytes.collect());
        } else {
            vertices = triangles.concat();
        }
        let made: BTreeMap<u64, Value> = old
            .iter()
            .map(|(&number, elements)| {
                let accessor = self.root["accessors"][number as usize].clone();
                let moved = vertices.iter().map(|&v| elements[v].clone()).collect();
                (number, self.add_accessor(accessor, moved))
            })
            .collect();
        for set in sets.iter_mut().filter_map(Value::as_object_mut) {
            for accessor in set.values_mut() {
                let new = accessor.as_u64().and_then(|old| made.get(&old));
                *accessor = new.cloned().unwrap_or_default();
            }
        }
        primitive["attributes"] = sets.remove(0);
        if !sets.is_empty() {
            primitive["targets"] = sets.into();
        }
    }

    fn count(&self, accessor: &Value) -> Option<usize> {
        let number = accessor.as_u64()? as usize;
        Some(self.root["accessors"][number]["count"].as_u64()? as usize)
    }

    /// Returns the bytes of each element; `None` if they are not plainly in the binary chunk.
    fn elements(&self, accessor: &Value) -> Option<Elements> {
        let accessor = &self.root["accessors"][accessor.as_u64()? as usize];
        let view = &self.root["bufferViews"][accessor.get("bufferView")?.as_u64()? as usize];
        let is_packed = accessor.get("sparse").is_some() || view.get("extensions").is_some();
        if is_packed || view["buffer"] != json!(0) {
            return None;
        }
        let width = match accessor["componentType"].as_u64()? {
            5120 | 5121 => 1,
            5122 | 5123 => 2,
            _ => 4,
        };
        let n = match accessor["type"].as_str()? {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            _ => 4,
        };
        let offset = |of: &Value| of["byteOffset"].as_u64().unwrap_or(0) as usize;
        let stride = view["byteStride"]
            .as_u64()
            .map_or(width * n, |s| s as usize);
        let first = offset(view) + offset(accessor);
        let element = |i: u64| {
            let at = first + i as usize * stride;
            Some(self.bin.get(at..at + width * n)?.to_vec())
        };
        (0..accessor["count"].as_u64()?).map(element).collect()
    }

    fn indices(&self, accessor: &Value) -> Option<Vec<usize>> {
        let number = |bytes: &Vec<u8>| bytes.iter().rev().fold(0, |n, &b| n << 8 | usize::from(b));
        Some(self.elements(accessor)?.iter().map(number).collect())
    }

    /// Adds an accessor like `accessor` for these elements; returns its index.
    fn add_accessor(&mut self, mut accessor: Value, elements: Elements) -> Value {
        let stride = elements.first().map_or(4, |e| e.len().next_multiple_of(4));
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let mut view = json!({
            "buffer": 0, "byteOffset": self.bin.len(), "byteLength": stride * elements.len()
        });
        if accessor["type"] != json!("SCALAR") {
            view["byteStride"] = stride.into();
        }
        accessor["count"] = elements.len().into();
        accessor["byteOffset"] = 0.into();
        for mut element in elements {
            element.resize(stride, 0);
            self.bin.extend(element);
        }
        accessor["bufferView"] = push(&mut self.root["bufferViews"], view);
        push(&mut self.root["accessors"], accessor)
    }

    fn written(mut self) -> Vec<u8> {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        if !self.bin.is_empty() {
            self.root["buffers"][0]["byteLength"] = self.bin.len().into();
        }
        let mut json = self.root.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut out = Vec::new();
        for (kind, chunk) in [(b"JSON", json), (b"BIN\0", self.bin)] {
            out.extend((chunk.len() as u32).to_le_bytes());
            out.extend(kind);
            out.extend(chunk);
        }
        let length = out.len() as u32 + 12;
        [
            &b"glTF"[..],
            &2_u32.to_le_bytes(),
            &length.to_le_bytes(),
            &out,
        ]
        .concat()
    }
}

/// The bytes of each element.
type Elements = Vec<Vec<u8>>;

fn push(list: &mut Value, item: Value) -> Value {
    let list = list
        .as_array_mut()
        .expect("a list that something refers to");
    list.push(item);
    (list.len() - 1).into()
}

/// Changes an index to its new value, if there is one.
fn renumber(value: &mut Value, number: &[usize]) {
    if let Some(old) = value.as_u64() {
        *value = number[old as usize].into();
    }
}

fn renumber_at(value: &mut Value, key: &str, number: &[usize]) {
    if let Some(old) = value.get_mut(key) {
        renumber(old, number);
    }
}

/// Applies [`renumber`] to all textures of a material.
fn renumber_textures(value: &mut Value, number: &[usize]) {
    match value {
        Value::Array(items) => items.iter_mut().for_each(|i| renumber_textures(i, number)),
        Value::Object(fields) => {
            for (key, inner) in fields.iter_mut().filter(|(key, _)| *key != "extras") {
                if let Some(index) = inner.get_mut("index").filter(|_| key.ends_with("Texture")) {
                    renumber(index, number);
                }
                renumber_textures(inner, number);
            }
        }
        _ => {}
    }
}
