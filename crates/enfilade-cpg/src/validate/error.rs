//! Problems of a graph or a world, and a list to collect them.

use enfilade_geom::shown;

use super::special_error::SpecialProblem;
use crate::{Locator, SpecialId};

/// Most problems that one call reports; a world with more usually repeats the same one.
pub const MAX_REPORTED: usize = 64;

/// An invariant that a graph or a world breaks. Ids are positions in the lists of the graph.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GraphError {
    /// Two cells share a name.
    #[error("cells {first} and {second} are both called {name:?}; names must be unique")]
    DuplicateName {
        /// The earlier cell.
        first: u32,
        /// The later cell.
        second: u32,
        /// Their name.
        name: String,
    },
    /// More than one cell is marked as the outdoors.
    #[error("cells {first} and {second} are both outdoors; there is at most one")]
    TwoOutdoors {
        /// The earlier cell.
        first: u32,
        /// The later cell.
        second: u32,
    },
    /// The outdoors is marked as a void.
    #[error("cell {cell} is both outdoors and a void")]
    OutdoorVoid {
        /// The cell.
        cell: u32,
    },
    /// A cell's box or volume is not finite, or its box is turned inside out.
    #[error(
        "cell {cell}: box {aabb:?} and volume {volume} must be finite, ordered and not negative"
    )]
    CellExtent {
        /// The cell.
        cell: u32,
        /// Its box. [Units: wu]
        aabb: [[f32; 3]; 2],
        /// Its volume. [Units: wu³]
        volume: f32,
    },
    /// A cell's list of portals is not exactly its portals, ascending.
    #[error("cell {cell} lists portals {listed:?}, but the portals that name it are {actual:?}")]
    CellPortals {
        /// The cell.
        cell: u32,
        /// Its list, from the first difference on; at most eight entries.
        listed: Vec<u32>,
        /// The correct list, from the same place on.
        actual: Vec<u32>,
    },
    /// The leak path has a single point, or one that is not finite.
    #[error("the leak path must be empty or have at least two points, all finite")]
    LeakPath,
    /// A number of a decision is not finite.
    #[error("{owner}: a number of its decision is not finite")]
    Decision {
        /// The cell, portal or place.
        owner: String,
    },
    /// Facts of a room contradict each other or the graph.
    #[error(
        "facts of the rooms, at cell {cell}: {problem}; who changes rooms or portals drops `room_facts`"
    )]
    RoomFacts {
        /// The room.
        cell: u32,
        /// The problem.
        problem: &'static str,
    },
    /// A source or a reference to one is invalid.
    #[error("{}: {}", shown(owner), shown(problem))]
    Source {
        /// The owner of the source.
        owner: String,
        /// The problem.
        problem: String,
    },
    /// A fitting does not exist or has an invalid motion.
    #[error("{}: {}", shown(owner), shown(problem))]
    Fitting {
        /// The portal or detail.
        owner: String,
        /// The problem.
        problem: String,
    },
    /// A row of the potentially visible set does not fit the graph.
    #[error("potentially visible set, cell {cell}: {problem}")]
    Pvs {
        /// The cell.
        cell: u32,
        /// The problem of its row.
        problem: &'static str,
    },
    /// The visible parts or volumes of a pair of cells do not fit the world.
    #[error("potentially visible set, from cell {} into cell {}: {problem}; compute it again", .cells[0], .cells[1])]
    PvsPair {
        /// The cells; past the last one if the problem is not that of a pair.
        cells: [u32; 2],
        /// The problem.
        problem: &'static str,
    },
    /// A portal joins a cell to itself or to a cell that does not exist.
    #[error("portal {portal} joins cells {cells:?}; they must be different cells below {n_cells}")]
    PortalCells {
        /// The portal.
        portal: u32,
        /// The cells that it refers to.
        cells: [u32; 2],
        /// Number of cells.
        n_cells: usize,
    },
    /// A portal's normal is not of unit length.
    #[error("portal {portal}: normal {normal:?} is not of unit length")]
    PortalNormal {
        /// The portal.
        portal: u32,
        /// Its normal.
        normal: [f32; 3],
    },
    /// A vertex of a portal is not finite.
    #[error("portal {portal}: vertex {at:?} is not finite")]
    PortalCorner {
        /// The portal.
        portal: u32,
        /// The vertex.
        at: [f32; 3],
    },
    /// An outline or a piece has fewer than three vertices.
    #[error("portal {portal}, {}: a polygon needs at least 3 vertices, not {n_corners}", polygon_name(*.piece))]
    TooFewCorners {
        /// The portal.
        portal: u32,
        /// The piece, or `None` for the outline.
        piece: Option<u32>,
        /// Its number of vertices.
        n_corners: usize,
    },
    /// A vertex is off the portal's plane.
    #[error("portal {portal}, {}: vertex {at:?} is {distance} off the portal's plane", polygon_name(*.piece))]
    NotPlanar {
        /// The portal.
        portal: u32,
        /// The piece, or `None` for the outline.
        piece: Option<u32>,
        /// The vertex. [Units: wu]
        at: [f32; 3],
        /// Its distance from the plane. [Units: wu]
        distance: f64,
    },
    /// An outline or a piece is not convex.
    #[error("portal {portal}, {} near {near:?}: not convex", polygon_name(*.piece))]
    NotConvex {
        /// The portal.
        portal: u32,
        /// The piece, or `None` for the outline.
        piece: Option<u32>,
        /// Its first vertex. [Units: wu]
        near: [f32; 3],
    },
    /// An outline or a piece runs clockwise, or an outline has no area.
    #[error(
        "portal {portal}, {} near {near:?}: vertices must run counter-clockwise seen from the second cell",
        polygon_name(*.piece)
    )]
    WrongWay {
        /// The portal.
        portal: u32,
        /// The piece, or `None` for the outline.
        piece: Option<u32>,
        /// Its first vertex. [Units: wu]
        near: [f32; 3],
    },
    /// A piece reaches out of the outline.
    #[error("portal {portal}: its pieces extend beyond the outline, farthest at {at:?}")]
    PieceOutside {
        /// The portal.
        portal: u32,
        /// The piece's vertex farthest from the outline's center. [Units: wu]
        at: [f32; 3],
    },
    /// A portal has no pieces, or its area is not the sum of theirs.
    #[error("portal {portal}: the stored area is {stored}, but its pieces add up to {measured}")]
    PortalArea {
        /// The portal.
        portal: u32,
        /// Stored area. [Units: wu²]
        stored: f32,
        /// Sum over the pieces. [Units: wu²]
        measured: f64,
    },
    /// A special portal is broken.
    #[error("{special}{}: {problem}", shown(place))]
    Special {
        /// The special portal.
        special: SpecialId,
        /// Its name, cell and middle, as far as they are known; empty or in parentheses.
        place: String,
        /// The problem.
        problem: SpecialProblem,
    },
    /// The locator's box is not finite and ordered (nor the empty box).
    #[error("the locator's box {min:?} to {max:?} is neither finite and ordered nor empty")]
    LocatorBounds {
        /// Its minimum.
        min: [f64; 3],
        /// Its maximum.
        max: [f64; 3],
    },
    /// A plane of the locator is not finite or has no direction.
    #[error("plane {plane} of the locator, {value:?}, is not a plane")]
    LocatorPlane {
        /// The plane.
        plane: u32,
        /// `[nx, ny, nz, d]`.
        value: [f64; 4],
    },
    /// A node of the locator refers to a plane that does not exist.
    #[error("node {node} of the locator refers to plane {plane}, but there are {n_planes}")]
    LocatorNode {
        /// The node.
        node: u32,
        /// The plane that it refers to.
        plane: u32,
        /// Number of planes.
        n_planes: usize,
    },
    /// A child in the locator is neither a later node nor a leaf with an existing cell.
    #[error("{} leads to {child}, which is neither a later node nor a leaf of an existing cell", node_name(*.node))]
    LocatorChild {
        /// The node, or `None` for the root.
        node: Option<u32>,
        /// The child value.
        child: i32,
    },
    /// Two children in the locator, or the root and a child, are the same node: it is not a tree.
    #[error("node {node} of the locator is reached twice; in a tree each node has one parent")]
    LocatorShared {
        /// The node.
        node: u32,
    },
    /// A node of the locator is too deep.
    #[error(
        "node {node} of the locator is deeper than {} nodes; balance the tree",
        Locator::MAX_DEPTH
    )]
    LocatorDepth {
        /// The first such node.
        node: u32,
    },
    /// The cell beyond the locator's box does not exist.
    #[error("the locator's outside is cell {cell}, but there are {n_cells} cells")]
    LocatorOutside {
        /// The cell that it refers to.
        cell: u32,
        /// Number of cells.
        n_cells: usize,
    },
    /// The cell beyond the locator's box and the outdoors differ.
    #[error("the locator's outside is {}, but the outdoors is {}; they must be the same", cell_name(*.outside), cell_name(*.outdoors))]
    OutsideOutdoors {
        /// The cell beyond the locator's box.
        outside: Option<u32>,
        /// The cell that is marked as the outdoors.
        outdoors: Option<u32>,
    },
    /// A box extends beyond the region that should hold it.
    #[error("{}: the box {min:?} to {max:?} extends beyond {of}", shown(owner))]
    FarBox {
        /// Owner of the box, e.g. `cell 3`, `the locator`.
        owner: String,
        /// The region that should hold it.
        of: &'static str,
        /// Its minimum. [Units: wu]
        min: [f64; 3],
        /// Its maximum. [Units: wu]
        max: [f64; 3],
    },
    /// A count in the statistics is not finite.
    #[error("statistic {name:?} is {value}, not a finite number")]
    Statistic {
        /// Its name.
        name: String,
        /// Its value.
        value: f64,
    },
    /// A list of cells is not ascending, repeats one, or names a cell that does not exist.
    #[error(
        "{}: cells must be ascending, without duplicates and below {n_cells}; {cell} is not",
        shown(owner)
    )]
    CellList {
        /// Owner of the list, e.g. `batch 3` or `detail 7 (chair)`.
        owner: String,
        /// The first invalid cell.
        cell: u32,
        /// Number of cells.
        n_cells: usize,
    },
    /// A list of triangles is broken.
    #[error("{}: {}", shown(owner), shown(problem))]
    Primitive {
        /// Owner of the triangles, e.g. `batch 3` or `detail mesh 2, primitive 0`.
        owner: String,
        /// The problem.
        problem: String,
    },
    /// A detail object refers to a mesh that does not exist or has an invalid transform.
    #[error("detail {detail} ({}): {}", shown(name), shown(problem))]
    Detail {
        /// The detail object.
        detail: u32,
        /// Its name.
        name: String,
        /// The problem.
        problem: String,
    },
    /// A material, texture or sampler is broken.
    #[error("{}: {}", shown(owner), shown(problem))]
    Look {
        /// Its name, e.g. `material 3`.
        owner: String,
        /// The problem.
        problem: String,
    },
}

fn polygon_name(piece: Option<u32>) -> String {
    piece.map_or_else(|| "outline".into(), |i| format!("piece {i}"))
}

fn cell_name(cell: Option<u32>) -> String {
    cell.map_or_else(|| "no cell".into(), |i| format!("cell {i}"))
}

fn node_name(node: Option<u32>) -> String {
    node.map_or_else(
        || "the locator's root".into(),
        |i| format!("node {i} of the locator"),
    )
}

/// Collects problems up to [`MAX_REPORTED`].
#[derive(Default)]
pub(super) struct Findings(Vec<GraphError>);

impl Findings {
    pub(super) fn push(&mut self, error: GraphError) {
        if !self.is_full() {
            self.0.push(error);
        }
    }

    pub(super) fn is_full(&self) -> bool {
        self.0.len() >= MAX_REPORTED
    }

    pub(super) fn into_result(self) -> Result<(), Vec<GraphError>> {
        if self.0.is_empty() {
            Ok(())
        } else {
            Err(self.0)
        }
    }
}
