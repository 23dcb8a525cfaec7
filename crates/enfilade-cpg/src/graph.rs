//! Cells, portals and the graph they form.

use std::collections::BTreeMap;

use enfilade_geom::scene::{About, Fixture, Image, Material, Mesh, Primitive, SourceNode, Texture};

use crate::{CellId, Fitting, Locator, PortalId, Pvs, SourceRuns};

/// A connected region of empty space bounded by structural triangles and portals. May be concave.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cell {
    /// Name, unique in the graph: `cell-0`, `cell-1`, … or `outdoors`.
    pub name: String,
    /// Least and greatest corner. [Units: wu] For outdoors, the scene's padded box.
    pub aabb: [[f32; 3]; 2],
    /// Volume of the air in it. [Units: wu³]
    pub volume: f32,
    /// Structural triangles that can be seen from it without passing a portal.
    pub n_triangles: u32,
    /// Triangles of the detail objects that stand in it.
    pub n_detail_triangles: u32,
    /// Its portals, ascending.
    pub portals: Vec<PortalId>,
    /// The space around the building, all in one cell.
    pub outdoor: bool,
}

/// A planar opening that joins exactly two cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Portal {
    /// The two cells; the normal points from the first to the second. Never equal.
    pub cells: [CellId; 2],
    /// What kind of opening it is.
    pub kind: PortalKind,
    /// Unit normal of its plane.
    pub normal: [f32; 3],
    /// Convex outline around all pieces, counter-clockwise seen from the second cell. [Units: wu]
    pub outline: Vec<[f32; 3]>,
    /// The true opening as convex polygons, each counter-clockwise seen from the second cell.
    pub pieces: Vec<Vec<[f32; 3]>>,
    /// Area of the true opening, the sum over the pieces. [Units: wu²]
    pub area: f32,
    /// The objects that stand in it: leaves of a door, frames, panes. Ascending by object, none twice.
    pub fittings: Vec<Fitting>,
}

/// What kind of opening a portal is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PortalKind {
    /// An opening to walk or look through.
    Open,
    /// An opening with a door leaf.
    Door,
    /// An opening with glass, or above a parapet.
    Window,
    /// A gap of the model too narrow to be meant: light passes, so it is a portal.
    Crack,
}

/// The cells, the portals, and where every point belongs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CellPortalGraph {
    /// By [`CellId`].
    pub cells: Vec<Cell>,
    /// By [`PortalId`].
    pub portals: Vec<Portal>,
    /// Point to cell.
    pub locator: Locator,
    /// How the graph came to be.
    pub provenance: Provenance,
    /// What the bake counted and timed.
    pub statistics: Statistics,
}

/// What made a graph, and from what.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Provenance {
    /// Program and version, e.g. `enfilade 0.1.0`.
    pub generator: String,
    /// `watershed`, `bsp` or `delaunay`.
    pub method: String,
    /// Every setting by name, as text.
    pub settings: BTreeMap<String, String>,
    /// Hash of the input triangles and settings, in hexadecimal.
    pub input_hash: String,
}

/// What the bake counted. Timings are left out of the file so that equal input gives equal bytes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Named counts, e.g. `input_triangles`, `voxels`, `leaks`.
    pub counts: BTreeMap<String, f64>,
}

/// A graph together with the geometry of its cells.
#[derive(Clone, Debug, Default)]
pub struct World {
    /// Cells, portals and locator.
    pub graph: CellPortalGraph,
    /// Structural geometry; each triangle, or piece of one, stands in exactly one batch.
    pub batches: Vec<Batch>,
    /// Detail objects with the cells they touch.
    pub details: Vec<DetailObject>,
    /// Meshes that detail objects place.
    pub detail_meshes: Vec<Mesh>,
    /// Materials, as in [`enfilade_geom::scene::Scene`].
    pub materials: Vec<Material>,
    /// Textures.
    pub textures: Vec<Texture>,
    /// Pictures.
    pub images: Vec<Image>,
    /// A line for people to look at: the way out of air that should be a room, where it is widest. Of two points or more, in
    /// world space; empty where none was asked for. No matter to anything that reads a world. [Units: wu]
    pub leak_path: Vec<[f32; 3]>,
    /// The input's own tree of names, which triangles and details refer to. A node comes after the one above it.
    pub sources: Vec<SourceNode>,
    /// The input's lights, cameras and marked places.
    pub fixtures: Vec<Fixture>,
    /// What the input says of itself as a whole.
    pub about: About,
    /// What can be seen from each cell, if it was computed. What changes cells or portals drops it.
    pub pvs: Option<Pvs>,
}

/// Structural triangles of one material that are seen from exactly the same cells.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// The cells that see them, ascending, none twice. Empty for what no cell sees (inside walls).
    pub cells: Vec<CellId>,
    /// The triangles, in world space.
    pub primitive: Primitive,
    /// Which of [`World::sources`] each triangle comes from; empty where that is not known.
    pub sources: SourceRuns,
    /// They are seals: no part of the model, but added to close gaps of it. Matter to every consumer.
    pub is_seal: bool,
}

/// A placed detail object.
#[derive(Clone, Debug)]
pub struct DetailObject {
    /// Name as in the input.
    pub name: String,
    /// Index into [`World::detail_meshes`].
    pub mesh: u32,
    /// Mesh space to world space, column-major as in glTF.
    pub transform: [f32; 16],
    /// The cells it touches, ascending.
    pub cells: Vec<CellId>,
    /// What it comes from. Index into [`World::sources`].
    pub source: Option<u32>,
    /// The object that it was taken out of, as a leaf is out of a door modeled in one piece with its frame. Index into
    /// [`World::details`].
    pub part_of: Option<u32>,
}
