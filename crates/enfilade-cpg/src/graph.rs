//! Cells, portals and the graph they form.

use std::collections::BTreeMap;
use std::sync::Arc;

use enfilade_geom::scene::{About, Fixture, Image, Material, Mesh, Primitive, SourceNode, Texture};

use crate::{
    CellId, DecidedPlace, Fitting, Locator, PartNumbers, PortalId, Pvs, RoomFacts, SourceRuns,
    SpecialPortal, Why,
};

/// A connected region of empty space bounded by structural triangles and portals. May be concave.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cell {
    /// Name, unique in the graph: that of the room in the scene, else `cell-0`, `cell-1`, … or `outdoors`.
    pub name: String,
    /// Minimum and maximum. For outdoors, the scene's padded box. [Units: wu]
    pub aabb: [[f32; 3]; 2],
    /// Volume of the air in it. [Units: wu³]
    pub volume: f32,
    /// Number of structural triangles seen from it without passing a portal.
    pub n_triangles: u32,
    /// Number of triangles of the detail objects that stand in it.
    pub n_detail_triangles: u32,
    /// Its portals, ascending.
    pub portals: Vec<PortalId>,
    /// `true` for the space around the building, which is all one cell.
    pub outdoor: bool,
    /// `true` for a space in which nobody can stand and into which no doorway leads: above a hung ceiling, in a shaft or a
    /// hollow wall. Sight and sound pass it as any other cell, but it counts as no room. Never outdoors.
    pub is_void: bool,
    /// `true` for an area of open land, from the ground to a sky limit: a street, a valley. It counts as no room. Never outdoors
    /// and never a void.
    pub is_land: bool,
    /// Why it is a cell, and of this kind; empty where no bake decided it.
    pub why: Vec<Why>,
}

impl Cell {
    /// Returns `true` if it is neither outdoors, nor a void, nor open land.
    #[must_use]
    pub fn is_room(&self) -> bool {
        self.is_indoors() && !self.is_void
    }

    /// Returns `true` if it is a room or open land: people stand in it, and maps show it.
    #[must_use]
    pub fn is_place(&self) -> bool {
        !self.outdoor && !self.is_void
    }

    /// Returns `true` if it is neither outdoors nor open land.
    #[must_use]
    pub fn is_indoors(&self) -> bool {
        !self.outdoor && !self.is_land
    }
}

/// A planar opening that joins exactly two cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Portal {
    /// The two cells; the normal points from the first to the second. Never equal.
    pub cells: [CellId; 2],
    /// Kind of the opening.
    pub kind: PortalKind,
    /// Unit normal of its plane.
    pub normal: [f32; 3],
    /// Convex outline around all pieces, counter-clockwise seen from the second cell. [Units: wu]
    pub outline: Vec<[f32; 3]>,
    /// The true opening as convex polygons, each counter-clockwise seen from the second cell.
    pub pieces: Vec<Vec<[f32; 3]>>,
    /// Area of the true opening, the sum over the pieces. [Units: wu²]
    pub area: f32,
    /// The objects that stand in it: leaves of a door, frames, panes. Ascending by object, without duplicates.
    pub fittings: Vec<Fitting>,
    /// Why there are two cells; empty where no bake decided it.
    pub why: Vec<Why>,
}

/// Kind of a portal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PortalKind {
    /// An opening to walk or look through.
    Open,
    /// An opening with a door leaf.
    Door,
    /// An opening with a window in it, or above a parapet.
    Window,
    /// A gap of the model: nothing fills it, and nobody fits through. Light passes it, so it is a portal.
    Crack,
}

/// The cells, the portals, and the locator.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CellPortalGraph {
    /// Indexed by [`CellId`].
    pub cells: Vec<Cell>,
    /// Indexed by [`PortalId`].
    pub portals: Vec<Portal>,
    /// Mirrors, monitors, teleporters. Indexed by [`SpecialId`](crate::SpecialId).
    pub specials: Vec<SpecialPortal>,
    /// Finds the cell of a point; what is prepared from the graph shares it.
    pub locator: Arc<Locator>,
    /// Decisions of the bake about places that are neither a cell nor a portal: openings within a cell that nearly parted it,
    /// and spaces that are not cells.
    pub places: Vec<DecidedPlace>,
    /// Origin of the graph.
    pub provenance: Provenance,
    /// Counts from the bake.
    pub statistics: Statistics,
}

/// The program, settings and input that a graph was made with.
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

/// Counts from the bake. The file holds no timings, so that equal input gives equal bytes.
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
    /// Structural geometry; each triangle, or piece of one, is in exactly one batch.
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
    /// A polyline for people: the path along which air leaks out of a place that should be a room, where it is
    /// widest. In world space; at least two points, or empty if not requested. Readers of worlds ignore it.
    /// [Units: wu]
    pub leak_path: Vec<[f32; 3]>,
    /// The input's own tree of names, referenced by triangles and details. A node comes after its parent.
    pub sources: Vec<SourceNode>,
    /// The input's lights, cameras and marked places.
    pub fixtures: Vec<Fixture>,
    /// Information of the input about itself as a whole.
    pub about: About,
    /// Cells visible from each cell, if computed. Changes of cells or portals drop it.
    pub pvs: Option<Pvs>,
    /// Facts of all rooms, ascending by cell, if computed. Changes of cells, portals or walls drop them.
    pub room_facts: Option<Vec<RoomFacts>>,
}

impl PartNumbers {
    /// Numbers a world's parts. O(batches). A file has fewer than 2³² of them.
    #[must_use]
    pub fn new(world: &World) -> Self {
        let mut first = vec![0];
        let mut n = 0_u32;
        for batch in &world.batches {
            n = n.saturating_add((batch.primitive.indices.len() / 3) as u32);
            first.push(n);
        }
        Self {
            first,
            n_details: world.details.len() as u32,
        }
    }
}

/// Structural triangles of one material that exactly the same cells see.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// The cells that see them, ascending, without duplicates. Empty for triangles that no cell sees (inside walls).
    pub cells: Vec<CellId>,
    /// The triangles, in world space.
    pub primitive: Primitive,
    /// For each triangle, its source in [`World::sources`]; empty if unknown.
    pub sources: SourceRuns,
    /// `true` for seals: triangles that are not part of the model but close gaps of it. Solid for every consumer.
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
    /// Its source. Index into [`World::sources`].
    pub source: Option<u32>,
    /// The object from which it was separated, such as a door modeled in one piece with its frame. Index into
    /// [`World::details`].
    pub part_of: Option<u32>,
}
