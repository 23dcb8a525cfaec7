//! Structs that callers have and functions fill. Pointers come first, so that no layout has gaps; all other fields take
//! four bytes. Pointers without values behind them are never read: their count is 0.

use std::ffi::c_char;

/// Ids in a buffer of the handle.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EnfList {
    /// The ids.
    pub ids: *const u32,
    /// Number of ids.
    pub n: u32,
}

/// A cell.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EnfCell {
    /// Name in UTF-8, without a zero byte at its end.
    pub name: *const c_char,
    /// Portals of the cell, ascending.
    pub portals: *const u32,
    /// Length of the name. [Units: bytes]
    pub name_length: u32,
    /// Number of portals.
    pub n_portals: u32,
    /// `ENF_ROOM`, `ENF_OUTDOORS` or `ENF_VOID`.
    pub kind: u32,
    /// Minimum and maximum. [Units: m]
    pub aabb: [f32; 6],
    /// Volume of its air. [Units: m³]
    pub volume: f32,
}

/// Facts of a room.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EnfRoom {
    /// Names of the storeys that it stands on, from below, parted by blanks, in UTF-8, without a zero byte at their end.
    pub storeys: *const c_char,
    /// Length of these names. [Units: bytes]
    pub storeys_length: u32,
    /// Area of its floors as seen from above, without the recesses of doors and windows. [Units: m²]
    pub floor_area: f32,
    /// The part of that area where the room is 1.5 m high or more. [Units: m²]
    pub area_above_1_5: f32,
    /// The part where it is 2.3 m high or more. [Units: m²]
    pub area_above_2_3: f32,
    /// Clear height over most of that area. [Units: m]
    pub height: f32,
    /// Number of its doors.
    pub n_doors: u32,
    /// Number of its windows.
    pub n_windows: u32,
}

/// A portal.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EnfPortal {
    /// Vertices of the convex outline, three numbers each, counter-clockwise seen from the second cell. [Units: m]
    pub outline: *const f32,
    /// Number of vertices of the outline.
    pub n_outline: u32,
    /// The two cells; the normal points from the first to the second.
    pub cells: [u32; 2],
    /// `ENF_OPENING`, `ENF_DOOR`, `ENF_WINDOW` or `ENF_CRACK`.
    pub kind: u32,
    /// 1 if anything passes it, 0 if it is closed.
    pub is_open: u32,
    /// Position of its leaves, from 0 for shut to 1 for open. Without leaves, as `is_open`.
    pub openness: f32,
    /// Number of its leaves.
    pub n_leaves: u32,
    /// Unit normal.
    pub normal: [f32; 3],
    /// Area of the opening. [Units: m²]
    pub area: f32,
    /// Distance of the middle of its shut leaves from its plane, along the normal: a panel there that fills the outline is
    /// hidden by them. 0 without leaves. [Units: m]
    pub leaf_depth: f32,
}

/// A measured quantity behind a decision.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EnfFact {
    /// Name as in the file, such as `area`, in UTF-8, without a zero byte at its end.
    pub name: *const c_char,
    /// Length of the name. [Units: bytes]
    pub name_length: u32,
    /// Its value.
    pub value: f32,
}

/// A decision of the bake.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EnfWhy {
    /// The decision with its facts in words, in UTF-8, without a zero byte at its end.
    pub text: *const c_char,
    /// The reason as in the file, such as `narrow`, in UTF-8, without a zero byte at its end.
    pub reason: *const c_char,
    /// All that was measured.
    pub facts: *const EnfFact,
    /// Length of the text. [Units: bytes]
    pub text_length: u32,
    /// Length of the reason. [Units: bytes]
    pub reason_length: u32,
    /// Number of facts.
    pub n_facts: u32,
    /// Index in `facts` of the fact that was compared with the limit, or `ENF_NO_ID` if nothing was weighed.
    pub compared: u32,
    /// The number of the rule, or 0 if nothing was weighed.
    pub limit: f32,
    /// Distance of that fact from the limit: 0 at it, 1 far from it and if nothing was weighed.
    pub margin: f32,
    /// Middle of the cell's box or of the portal, or a point of the place. [Units: m]
    pub position: [f32; 3],
}

/// A leaf of a door and its motion, measured from its pose in the file.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EnfLeaf {
    /// The object.
    pub detail: u32,
    /// `ENF_TURN` or `ENF_SLIDE`.
    pub motion: u32,
    /// Motion to shut. [Units: rad of a turn, m of a slide]
    pub shut: f32,
    /// Motion to fully open. [Units: rad of a turn, m of a slide]
    pub open: f32,
    /// A point of the hinge; 0 for a slide. [Units: m]
    pub through: [f32; 3],
    /// Unit direction of the hinge or of the slide.
    pub axis: [f32; 3],
}

/// Triangles of one material that exactly the same cells see.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EnfBatch {
    /// Vertices, three numbers each. [Units: m]
    pub positions: *const f32,
    /// Normals of the vertices, three numbers each; null if there are none.
    pub normals: *const f32,
    /// Three indices of vertices for each triangle, in such an order that every chunk is a range.
    pub indices: *const u32,
    /// Number of vertices.
    pub n_vertices: u32,
    /// Number of indices.
    pub n_indices: u32,
    /// Index of the material in the file, or `ENF_NO_ID`.
    pub material: u32,
    /// 1 if it is not part of the model but closes its gaps.
    pub is_seal: u32,
}

/// A placed object.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EnfDetail {
    /// Name in UTF-8, without a zero byte at its end.
    pub name: *const c_char,
    /// Length of the name. [Units: bytes]
    pub name_length: u32,
    /// Index of its mesh among the meshes of objects.
    pub mesh: u32,
    /// Number of its triangles.
    pub n_triangles: u32,
    /// Mesh to world, as in the file.
    pub transform: [f32; 16],
    /// Minimum and maximum as in the file; all 0 without vertices. [Units: m]
    pub aabb: [f32; 6],
}

/// A range of a batch's indices that is culled as a unit.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EnfChunk {
    /// The batch.
    pub batch: u32,
    /// First index, three for each triangle, in `EnfBatch.indices`.
    pub first_index: u32,
    /// Number of indices.
    pub n_indices: u32,
    /// Minimum and maximum. [Units: m]
    pub aabb: [f32; 6],
}

/// One cell seen through one part of the screen.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EnfVisit {
    /// The cell.
    pub cell: u32,
    /// The portal entered by, or `ENF_NO_ID` for the eye's own cell.
    pub via: u32,
    /// Left, bottom, right and top of the part of the screen, from -1 to 1.
    pub rectangle: [f32; 4],
    /// Depth of the nearest point of that portal along the view's direction. [Units: m]
    pub depth: f32,
    /// Face of a view that looks all around, otherwise 0.
    pub face: u32,
    /// Index of its first plane in `EnfSeen.planes`.
    pub first_plane: u32,
    /// Number of its planes.
    pub n_planes: u32,
}

/// The answer to one view: everything that may be visible, near to far.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EnfSeen {
    /// Visible cells, each once.
    pub cells: *const u32,
    /// For each of `cells` its share of the screen, 0 to 1.
    pub shares: *const f32,
    /// Portals through which anything is seen, each once.
    pub portals: *const u32,
    /// Visible chunks, each once, by cells.
    pub chunks: *const u32,
    /// Batches of these chunks, each once, in order of their first chunk.
    pub batches: *const u32,
    /// Visible objects, each once, by cells.
    pub details: *const u32,
    /// Special portals in view, each once.
    pub specials: *const u32,
    /// Cells through parts of the screen.
    pub visits: *const EnfVisit,
    /// Planes of visits, four numbers each: inside is `n · p + d >= 0`.
    pub planes: *const f32,
    /// Number of cells, and of shares.
    pub n_cells: u32,
    /// Number of portals.
    pub n_portals: u32,
    /// Number of chunks.
    pub n_chunks: u32,
    /// Number of batches.
    pub n_batches: u32,
    /// Number of objects.
    pub n_details: u32,
    /// Number of special portals.
    pub n_specials: u32,
    /// Number of visits.
    pub n_visits: u32,
    /// Number of planes.
    pub n_planes: u32,
    /// Number of triangles of the chunks and objects.
    pub n_triangles: u32,
    /// The eye's cell, or `ENF_NO_ID` in solid matter, where everything in the view counts as visible.
    pub eye_cell: u32,
}

/// The end of a picked segment.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EnfHit {
    /// Parameter along the segment, 0 to 1.
    pub t: f32,
    /// Position. [Units: m]
    pub position: [f32; 3],
    /// Unit normal on the side of the segment's start.
    pub normal: [f32; 3],
    /// `ENF_WALL`, `ENF_DETAIL` or `ENF_CLOSED_PORTAL`.
    pub target: u32,
    /// The batch, detail or portal.
    pub index: u32,
    /// Index of the primitive in an object's mesh, otherwise 0.
    pub primitive: u32,
    /// Index of the triangle in its batch or primitive, otherwise 0.
    pub triangle: u32,
    /// The cell from which the segment hit, or `ENF_NO_ID`.
    pub cell: u32,
    /// For a leaf, the first portal that it shuts; for a closed portal, itself; otherwise `ENF_NO_ID`.
    pub portal: u32,
}

/// A place to begin a walk.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EnfStart {
    /// The eye, 1.6 m above the floor. [Units: m]
    pub eye: [f32; 3],
    /// Direction in which the way is free farthest: 0 along -z, counter-clockwise seen from above. [Units: rad]
    pub yaw: f32,
}

/// The end of a step.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EnfStep {
    /// Portals crossed, in order; at most 16.
    pub crossed: *const u32,
    /// Number of portals crossed.
    pub n_crossed: u32,
    /// Cell at the end, or that of the start if the end is in solid matter; `ENF_NO_ID` if both are.
    pub cell: u32,
    /// 1 if the portals on the way do not lead to the end, which was located anew.
    pub is_relocated: u32,
}
