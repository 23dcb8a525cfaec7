//! The JSON of a world, for writing and reading.
//!
//! Contains only the parts of glTF that a world needs; reading ignores other properties. Numbers that are `f32` in
//! the graph are written as the `f64` of the same value, so that nothing rounds twice.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;

use crate::{DecidedPlace, PortalKind, Why};

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Root {
    pub(super) asset: Asset,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) extensions_used: Vec<String>,
    #[serde(default)]
    pub(super) scene: u32,
    #[serde(default)]
    pub(super) scenes: Vec<Scene>,
    #[serde(default)]
    pub(super) nodes: Vec<Node>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) meshes: Vec<Mesh>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) cameras: Vec<Box<RawValue>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) materials: Vec<Box<RawValue>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) textures: Vec<Texture>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) samplers: Vec<Box<RawValue>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) images: Vec<Image>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) accessors: Vec<Accessor>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) buffer_views: Vec<BufferView>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) buffers: Vec<Buffer>,
    pub(super) extensions: RootExtensions,
}

#[derive(Serialize, Deserialize)]
pub(super) struct Asset {
    pub(super) version: String,
    #[serde(default)]
    pub(super) generator: String,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(super) copyright: String,
}

#[derive(Serialize, Deserialize)]
pub(super) struct Scene {
    #[serde(default)]
    pub(super) nodes: Vec<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) extras: Option<Box<RawValue>>,
}

#[derive(Default, Serialize, Deserialize)]
pub(super) struct Node {
    #[serde(default)]
    pub(super) name: String,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) children: Vec<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) mesh: Option<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) matrix: Option<[f64; 16]>,
    /// Other programs write these instead of a matrix; we only read them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) translation: Option<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) rotation: Option<[f64; 4]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) scale: Option<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) camera: Option<u32>,
    #[serde(default, skip_serializing_if = "NodeExtensions::is_empty")]
    pub(super) extensions: NodeExtensions,
    /// For details, written only for other programs; we read them from the table of sources.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) extras: Option<Box<RawValue>>,
}

#[derive(Default, Serialize, Deserialize)]
pub(super) struct NodeExtensions {
    #[serde(
        rename = "KHR_lights_punctual",
        default,
        skip_serializing_if = "Option::is_none"
    )]
    pub(super) light: Option<LightRef>,
}

impl NodeExtensions {
    fn is_empty(&self) -> bool {
        self.light.is_none()
    }
}

#[derive(Serialize, Deserialize)]
pub(super) struct LightRef {
    pub(super) light: u32,
}

#[derive(Serialize, Deserialize)]
pub(super) struct Mesh {
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(super) name: String,
    pub(super) primitives: Vec<Primitive>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct Primitive {
    pub(super) attributes: BTreeMap<String, u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) indices: Option<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) material: Option<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) mode: Option<u32>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct Texture {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) sampler: Option<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) source: Option<u32>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) extensions: BTreeMap<String, TextureSource>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct TextureSource {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) source: Option<u32>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Image {
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(super) name: String,
    #[serde(default)]
    pub(super) mime_type: String,
    pub(super) buffer_view: u32,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<u32>,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
    pub(super) count: u64,
    #[serde(rename = "type")]
    pub(super) kind: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) min: Option<Vec<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) max: Option<Vec<f64>>,
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: u32,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) byte_stride: Option<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) target: Option<u32>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer {
    pub(super) byte_length: u64,
    #[serde(default, skip_serializing)]
    pub(super) uri: Option<String>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct RootExtensions {
    #[serde(rename = "ENFILADE_cell_portal_graph")]
    pub(super) graph: Graph,
    #[serde(
        rename = "KHR_lights_punctual",
        default,
        skip_serializing_if = "Option::is_none"
    )]
    pub(super) lights: Option<Lights>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct Lights {
    pub(super) lights: Vec<Box<RawValue>>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Graph {
    pub(super) version: u64,
    pub(super) cells: Vec<CellJson>,
    pub(super) portals: Vec<PortalJson>,
    /// Buffer view of all portals' vertices.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) portal_corners: Option<u32>,
    /// Since version 2.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) specials: Vec<SpecialJson>,
    /// Buffer view of the vertices of special portals in walls.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) special_corners: Option<u32>,
    pub(super) batches: Vec<BatchJson>,
    pub(super) details: Vec<Detail>,
    /// For each detail mesh, its glTF mesh; null for a mesh without triangles.
    pub(super) detail_meshes: Vec<Option<u32>>,
    pub(super) locator: LocatorJson,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) sources: Vec<SourceJson>,
    /// Buffer view of all batches' runs of sources.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) source_runs: Option<u32>,
    /// Nodes of lights, cameras and marked places.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) fixtures: Vec<u32>,
    /// Node of the leak path.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) leak_path: Option<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) pvs: Option<PvsJson>,
    /// Facts of all rooms, ascending. Absent unless computed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) rooms: Option<Vec<RoomJson>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) places: Vec<DecidedPlace>,
    pub(super) provenance: ProvenanceJson,
    pub(super) statistics: BTreeMap<String, f64>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct CellJson {
    pub(super) name: String,
    pub(super) node: u32,
    pub(super) aabb: [[f64; 3]; 2],
    pub(super) volume: f64,
    pub(super) triangles: u32,
    pub(super) detail_triangles: u32,
    pub(super) portals: Vec<u32>,
    #[serde(default, skip_serializing_if = "is_false")]
    pub(super) outdoor: bool,
    #[serde(default, skip_serializing_if = "is_false")]
    pub(super) void: bool,
    #[serde(default, skip_serializing_if = "is_false")]
    pub(super) land: bool,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) why: Vec<Why>,
}

/// Facts of a room. Its doors and windows are portals.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct RoomJson {
    pub(super) cell: u32,
    pub(super) storeys: Vec<String>,
    pub(super) floor_area: f64,
    #[serde(rename = "areaAbove1_5")]
    pub(super) area_above_1_5: f64,
    #[serde(rename = "areaAbove2_3")]
    pub(super) area_above_2_3: f64,
    pub(super) height: f64,
}

#[derive(Serialize, Deserialize)]
pub(super) struct PortalJson {
    pub(super) cells: [u32; 2],
    pub(super) kind: Kind,
    pub(super) normal: [f64; 3],
    pub(super) area: f64,
    /// Number of vertices of the outline.
    pub(super) outline: u32,
    /// Number of vertices of each piece.
    pub(super) pieces: Vec<u32>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) fittings: Vec<FittingJson>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) why: Vec<Why>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct FittingJson {
    pub(super) detail: u32,
    pub(super) part: PartJson,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) turn: Option<TurnJson>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) slide: Option<SlideJson>,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum PartJson {
    Leaf,
    Frame,
    Pane,
}

#[derive(Serialize, Deserialize)]
pub(super) struct TurnJson {
    pub(super) through: [f64; 3],
    pub(super) axis: [f64; 3],
    pub(super) shut: f64,
    pub(super) open: f64,
}

#[derive(Serialize, Deserialize)]
pub(super) struct SlideJson {
    pub(super) along: [f64; 3],
    pub(super) shut: f64,
    pub(super) open: f64,
}

/// A side of a portal, or a part of a wall: either `portal`, or `normal` and `pieces`.
#[derive(Serialize, Deserialize)]
pub(super) struct SpecialJson {
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(super) name: String,
    pub(super) cell: u32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) portal: Option<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) normal: Option<[f64; 3]>,
    /// Number of vertices of each piece.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) pieces: Option<Vec<u32>>,
    pub(super) passes: Vec<PassJson>,
}

/// Fields that do not belong to the way are absent.
#[derive(Default, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct PassJson {
    pub(super) way: WayJson,
    /// Absent if it changes nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) tint: Option<[f64; 4]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) to: Option<u32>,
    /// As a glTF node's; absent for none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) translation: Option<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) rotation: Option<[f64; 4]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) scale: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) back: Option<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) eye: Option<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) toward: Option<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) up: Option<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) fov_y: Option<f64>,
}

#[derive(Clone, Copy, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum WayJson {
    #[default]
    Through,
    Mirror,
    Lead,
    Monitor,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Kind {
    Open,
    Door,
    Window,
    Crack,
}

impl From<Kind> for PortalKind {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Open => Self::Open,
            Kind::Door => Self::Door,
            Kind::Window => Self::Window,
            Kind::Crack => Self::Crack,
        }
    }
}

impl From<PortalKind> for Kind {
    fn from(kind: PortalKind) -> Self {
        match kind {
            PortalKind::Open => Self::Open,
            PortalKind::Door => Self::Door,
            PortalKind::Window => Self::Window,
            PortalKind::Crack => Self::Crack,
        }
    }
}

#[derive(Serialize, Deserialize)]
pub(super) struct BatchJson {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) mesh: Option<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) primitive: Option<u32>,
    pub(super) cells: Vec<u32>,
    /// Number of runs of sources.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub(super) sources: u32,
    #[serde(default, skip_serializing_if = "is_false")]
    pub(super) seal: bool,
}

#[derive(Serialize, Deserialize)]
pub(super) struct SourceJson {
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(super) name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) parent: Option<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) extras: Option<Box<RawValue>>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Detail {
    pub(super) node: u32,
    /// Index into `detailMeshes`.
    pub(super) mesh: u32,
    pub(super) cells: Vec<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) source: Option<u32>,
    /// The detail from which it was separated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) part_of: Option<u32>,
    /// Absent for a mesh without vertices, and in older files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) aabb: Option<[[f64; 3]; 2]>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct LocatorJson {
    /// Absent for an empty locator.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) bounds: Option<[[f64; 3]; 2]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) outside: Option<u32>,
    pub(super) root: i32,
    /// Buffer view of planes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) planes: Option<u32>,
    /// Buffer view of nodes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) nodes: Option<u32>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct PvsJson {
    /// Buffer view: for each cell, the end of its runs. Absent without cells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) rows: Option<u32>,
    /// Buffer view of runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) runs: Option<u32>,
    /// Parts visible by pair of cells. Absent if not requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) parts: Option<PartsJson>,
    /// Volumes visible by pair of cells. Absent if not requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) volumes: Option<VolumesJson>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct PartsJson {
    /// Buffer view: for each pair, the end of its runs. Absent without cells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) rows: Option<u32>,
    /// Buffer view of runs. Absent if there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) runs: Option<u32>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct VolumesJson {
    /// Buffer view: for each pair, the end of its pieces. Absent without cells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) rows: Option<u32>,
    /// Buffer view: for each piece, the end of its planes. Absent if there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) pieces: Option<u32>,
    /// Buffer view of planes. Absent if there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) planes: Option<u32>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct ProvenanceJson {
    pub(super) generator: String,
    pub(super) method: String,
    pub(super) settings: BTreeMap<String, String>,
    pub(super) input_hash: String,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn is_false(value: &bool) -> bool {
    !*value
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn is_zero(value: &u32) -> bool {
    *value == 0
}

/// `FLOAT` of glTF.
pub(super) const FLOAT: u32 = 5126;
/// `UNSIGNED_BYTE`.
pub(super) const U8: u32 = 5121;
/// `UNSIGNED_SHORT`.
pub(super) const U16: u32 = 5123;
/// `UNSIGNED_INT`.
pub(super) const U32: u32 = 5125;
/// `LINE_STRIP`.
pub(super) const LINE_STRIP: u32 = 3;
/// `ARRAY_BUFFER`.
pub(super) const VERTICES: u32 = 34962;
/// `ELEMENT_ARRAY_BUFFER`.
pub(super) const TRIANGLES: u32 = 34963;

/// Extension for a texture's image, by MIME type; core glTF allows only PNG and JPEG.
pub(super) const TEXTURE_EXTENSIONS: [(&str, &str); 4] = [
    ("image/webp", "EXT_texture_webp"),
    ("image/avif", "EXT_texture_avif"),
    ("image/ktx2", "KHR_texture_basisu"),
    ("image/vnd-ms.dds", "MSFT_texture_dds"),
];
