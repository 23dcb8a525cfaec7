//! The supported parts of a glTF 2.0 document.
//!
//! These types replace the `gltf` crate: it skips validation of documents with unknown required extensions, and its
//! accessors then panic on the first bad index; it also supports neither instancing nor quantized positions.
//! Materials stay plain JSON so that every extension survives.

use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use serde_json::Value;
use serde_json::value::RawValue;
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

/// Longest array read. `{}` takes 2 bytes of JSON and a hundred in memory; this bounds the sum.
const MAX_ITEMS: usize = 1 << 22;

/// A list with a bounded length.
pub(super) struct List<T>(pub(super) Vec<T>);

impl<T> Default for List<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> std::ops::Deref for List<T> {
    type Target = [T];
    fn deref(&self) -> &[T] {
        &self.0
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for List<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Items<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Items<T> {
            type Value = Vec<T>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "an array")
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Vec<T>, A::Error> {
                let mut items = Vec::new();
                while let Some(item) = seq.next_element()? {
                    if items.len() == MAX_ITEMS {
                        return Err(A::Error::custom(format!(
                            "an array of more than {MAX_ITEMS} items"
                        )));
                    }
                    items.push(item);
                }
                Ok(items)
            }
        }
        deserializer.deserialize_seq(Items(PhantomData)).map(Self)
    }
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Root {
    pub(super) asset: Asset,
    pub(super) scene: Option<usize>,
    #[serde(default)]
    pub(super) scenes: List<SceneDef>,
    #[serde(default)]
    pub(super) nodes: List<Node>,
    #[serde(default)]
    pub(super) meshes: List<MeshDef>,
    #[serde(default)]
    pub(super) accessors: List<Accessor>,
    #[serde(default)]
    pub(super) buffer_views: List<BufferView>,
    #[serde(default)]
    pub(super) buffers: List<BufferDef>,
    #[serde(default)]
    pub(super) materials: List<Value>,
    #[serde(default)]
    pub(super) textures: List<TextureDef>,
    #[serde(default)]
    pub(super) images: List<ImageDef>,
    #[serde(default)]
    pub(super) samplers: List<Value>,
    #[serde(default)]
    pub(super) animations: List<Animation>,
    #[serde(default)]
    pub(super) cameras: List<Value>,
    #[serde(default)]
    pub(super) skins: List<Skin>,
    pub(super) extensions: Option<Box<RootExtensions>>,
    #[serde(default)]
    pub(super) extensions_required: List<String>,
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Asset {
    pub(super) version: String,
    pub(super) copyright: Option<String>,
}

#[derive(serde::Deserialize)]
pub(super) struct RootExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    pub(super) lights: Option<Lights>,
}

#[derive(serde::Deserialize)]
pub(super) struct Lights {
    #[serde(default)]
    pub(super) lights: List<Value>,
}

#[derive(serde::Deserialize)]
pub(super) struct Skin {
    #[serde(default)]
    pub(super) joints: List<u32>,
}

#[derive(serde::Deserialize)]
pub(super) struct SceneDef {
    pub(super) name: Option<Box<str>>,
    #[serde(default)]
    pub(super) nodes: List<usize>,
    pub(super) extras: Option<Box<RawValue>>,
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Node {
    pub(super) name: Option<Box<str>>,
    pub(super) mesh: Option<u32>,
    pub(super) skin: Option<u32>,
    pub(super) camera: Option<u32>,
    /// Replaces the weights of the mesh.
    pub(super) weights: Option<Box<List<f64>>>,
    #[serde(default)]
    pub(super) children: List<u32>,
    pub(super) matrix: Option<Box<[f64; 16]>>,
    pub(super) translation: Option<Box<[f64; 3]>>,
    pub(super) rotation: Option<Box<[f64; 4]>>,
    pub(super) scale: Option<Box<[f64; 3]>>,
    pub(super) extensions: Option<Box<NodeExtensions>>,
    pub(super) extras: Option<Box<RawValue>>,
}

#[derive(serde::Deserialize)]
pub(super) struct NodeExtensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub(super) instancing: Option<Instancing>,
    #[serde(rename = "KHR_node_visibility")]
    pub(super) visibility: Option<Visibility>,
    #[serde(rename = "KHR_lights_punctual")]
    pub(super) light: Option<LightRef>,
}

#[derive(serde::Deserialize)]
pub(super) struct LightRef {
    pub(super) light: u32,
}

#[derive(serde::Deserialize)]
pub(super) struct Instancing {
    #[serde(default)]
    pub(super) attributes: BTreeMap<String, u32>,
}

#[derive(serde::Deserialize)]
pub(super) struct Visibility {
    pub(super) visible: Option<bool>,
}

#[derive(serde::Deserialize)]
pub(super) struct MeshDef {
    pub(super) name: Option<String>,
    #[serde(default)]
    pub(super) primitives: List<PrimitiveDef>,
    /// Weights of the primitives' morph targets.
    #[serde(default)]
    pub(super) weights: List<f64>,
}

/// Accessors by attribute name.
pub(super) type AccessorOf = BTreeMap<String, u32>;

#[derive(serde::Deserialize)]
pub(super) struct PrimitiveDef {
    #[serde(default)]
    pub(super) attributes: AccessorOf,
    pub(super) indices: Option<u32>,
    pub(super) material: Option<u32>,
    pub(super) mode: Option<u32>,
    #[serde(default)]
    pub(super) targets: List<AccessorOf>,
    pub(super) extensions: Option<PrimitiveExtensions>,
}

#[derive(serde::Deserialize)]
pub(super) struct PrimitiveExtensions {
    #[serde(rename = "KHR_draco_mesh_compression")]
    pub(super) draco: Option<DracoDef>,
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
#[cfg_attr(
    not(feature = "draco"),
    expect(dead_code, reason = "no decoder reads it")
)]
pub(super) struct DracoDef {
    pub(super) buffer_view: u32,
    /// Unique ids in the bitstream, by attribute name.
    #[serde(default)]
    pub(super) attributes: BTreeMap<String, u32>,
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<u32>,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
    #[serde(default)]
    pub(super) normalized: bool,
    pub(super) count: u64,
    #[serde(rename = "type")]
    pub(super) shape: String,
    pub(super) sparse: Option<Box<Sparse>>,
}

#[derive(serde::Deserialize)]
pub(super) struct Sparse {
    pub(super) count: u64,
    pub(super) indices: SparseIndices,
    pub(super) values: SparseValues,
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseIndices {
    pub(super) buffer_view: u32,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseValues {
    pub(super) buffer_view: u32,
    #[serde(default)]
    pub(super) byte_offset: u64,
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: u32,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    pub(super) byte_stride: Option<u64>,
    extensions: Option<Box<ViewExtensions>>,
}

impl BufferView {
    /// Returns the compression of the view, if it has one.
    pub(super) fn meshopt(&self) -> Option<&MeshoptDef> {
        let extensions = self.extensions.as_ref()?;
        extensions.khr.as_ref().or(extensions.ext.as_ref())
    }
}

#[derive(serde::Deserialize)]
struct ViewExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    ext: Option<MeshoptDef>,
    #[serde(rename = "KHR_meshopt_compression")]
    khr: Option<MeshoptDef>,
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct MeshoptDef {
    pub(super) buffer: u32,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    pub(super) byte_stride: u64,
    pub(super) count: u64,
    pub(super) mode: String,
    pub(super) filter: Option<String>,
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferDef {
    pub(super) uri: Option<String>,
    pub(super) byte_length: u64,
    extensions: Option<Box<BufferExtensions>>,
}

impl BufferDef {
    /// Returns `true` for a placeholder that readers without the codec find in place of compressed buffer views.
    pub(super) fn is_fallback(&self) -> bool {
        let extensions = self.extensions.as_ref();
        let either = extensions.map(|e| [&e.ext, &e.khr]);
        either.is_some_and(|e| e.into_iter().flatten().any(|m| m.fallback))
    }
}

#[derive(serde::Deserialize)]
struct BufferExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    ext: Option<MeshoptBuffer>,
    #[serde(rename = "KHR_meshopt_compression")]
    khr: Option<MeshoptBuffer>,
}

#[derive(serde::Deserialize)]
struct MeshoptBuffer {
    #[serde(default)]
    fallback: bool,
}

#[derive(serde::Deserialize)]
pub(super) struct TextureDef {
    pub(super) sampler: Option<u32>,
    pub(super) source: Option<u32>,
    pub(super) extensions: Option<BTreeMap<String, Value>>,
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct ImageDef {
    pub(super) name: Option<String>,
    pub(super) uri: Option<String>,
    pub(super) mime_type: Option<String>,
    pub(super) buffer_view: Option<u32>,
}

#[derive(serde::Deserialize)]
pub(super) struct Animation {
    #[serde(default)]
    pub(super) channels: List<Channel>,
}

#[derive(serde::Deserialize)]
pub(super) struct Channel {
    pub(super) target: Target,
}

#[derive(serde::Deserialize)]
pub(super) struct Target {
    pub(super) node: Option<u32>,
    #[serde(default)]
    pub(super) path: String,
}
