//! What can be broken, and the list of what is.

use crate::Locator;
use enfilade_geom::shown;

/// Most problems that one call reports; a world with more is broken in the same way many times.
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
        /// What it lists, from the first difference on; at most eight.
        listed: Vec<u32>,
        /// What it should list there.
        actual: Vec<u32>,
    },
    /// The leak path has a single point, or one that is not finite.
    #[error("the leak path must be of two finite points or more, or empty")]
    LeakPath,
    /// What says where something comes from does not hold together.
    #[error("{}: {}", shown(owner), shown(problem))]
    Source {
        /// Whose source it is.
        owner: String,
        /// What is wrong with it.
        problem: String,
    },
    /// What fills an opening is not there or moves by no number.
    #[error("{}: {}", shown(owner), shown(problem))]
    Fitting {
        /// The portal or detail.
        owner: String,
        /// What is wrong with it.
        problem: String,
    },
    /// A row of the potentially visible set does not fit the graph.
    #[error("potentially visible set, cell {cell}: {problem}")]
    Pvs {
        /// The cell.
        cell: u32,
        /// What is wrong with its row.
        problem: &'static str,
    },
    /// What may be seen of one cell from another does not fit the world.
    #[error("potentially visible set, what cell {} sees of cell {}: {problem}; compute it again", .cells[0], .cells[1])]
    PvsPair {
        /// The cells; past the last one where no pair is to blame.
        cells: [u32; 2],
        /// What is wrong.
        problem: &'static str,
    },
    /// A portal joins a cell to itself or to a cell that does not exist.
    #[error("portal {portal} joins cells {cells:?}; they must differ and lie below {n_cells}")]
    PortalCells {
        /// The portal.
        portal: u32,
        /// The cells that it names.
        cells: [u32; 2],
        /// How many cells there are.
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
    /// A corner of a portal is not finite.
    #[error("portal {portal}: corner {at:?} is not finite")]
    PortalCorner {
        /// The portal.
        portal: u32,
        /// The corner.
        at: [f32; 3],
    },
    /// An outline or a piece has fewer than three corners.
    #[error("portal {portal}, {}: {n_corners} corners are no polygon", polygon_name(*.piece))]
    TooFewCorners {
        /// The portal.
        portal: u32,
        /// The piece, or `None` for the outline.
        piece: Option<u32>,
        /// How many corners it has.
        n_corners: usize,
    },
    /// A corner is off the portal's plane.
    #[error("portal {portal}, {}: corner {at:?} is {distance} off the portal's plane", polygon_name(*.piece))]
    NotPlanar {
        /// The portal.
        portal: u32,
        /// The piece, or `None` for the outline.
        piece: Option<u32>,
        /// The corner. [Units: wu]
        at: [f32; 3],
        /// Its distance. [Units: wu]
        distance: f64,
    },
    /// An outline or a piece is not convex.
    #[error("portal {portal}, {} near {near:?}: not convex", polygon_name(*.piece))]
    NotConvex {
        /// The portal.
        portal: u32,
        /// The piece, or `None` for the outline.
        piece: Option<u32>,
        /// Its first corner. [Units: wu]
        near: [f32; 3],
    },
    /// An outline or a piece runs clockwise, or an outline has no area.
    #[error(
        "portal {portal}, {} near {near:?}: corners must run counter-clockwise seen from the second cell",
        polygon_name(*.piece)
    )]
    WrongWay {
        /// The portal.
        portal: u32,
        /// The piece, or `None` for the outline.
        piece: Option<u32>,
        /// Its first corner. [Units: wu]
        near: [f32; 3],
    },
    /// A piece reaches out of the outline.
    #[error("portal {portal}: its pieces reach out of the outline, farthest at {at:?}")]
    PieceOutside {
        /// The portal.
        portal: u32,
        /// The piece's corner farthest from the outline's middle. [Units: wu]
        at: [f32; 3],
    },
    /// A portal without pieces, or whose area is not the sum of its pieces.
    #[error("portal {portal}: area {stored} is stored, its pieces sum up to {measured}")]
    PortalArea {
        /// The portal.
        portal: u32,
        /// Stored. [Units: wu²]
        stored: f32,
        /// Summed over the pieces. [Units: wu²]
        measured: f64,
    },
    /// The locator's box is not finite and ordered (nor the empty box).
    #[error("the locator's box {min:?} to {max:?} is neither finite and ordered nor empty")]
    LocatorBounds {
        /// Least corner.
        min: [f64; 3],
        /// Greatest corner.
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
    /// A node of the locator names a plane that does not exist.
    #[error("node {node} of the locator names plane {plane} of {n_planes}")]
    LocatorNode {
        /// The node.
        node: u32,
        /// The plane that it names.
        plane: u32,
        /// How many there are.
        n_planes: usize,
    },
    /// A child in the locator is neither a later node nor a leaf with an existing cell.
    #[error("{} leads to {child}, which is neither a later node nor a leaf of an existing cell", node_name(*.node))]
    LocatorChild {
        /// The node, or `None` for the root.
        node: Option<u32>,
        /// Where it leads.
        child: i32,
    },
    /// Two children in the locator, or the root and a child, are the same node: it is not a tree.
    #[error("node {node} of the locator is a child twice; a tree reaches each node once")]
    LocatorShared {
        /// The node.
        node: u32,
    },
    /// A walk down the locator takes too long.
    #[error(
        "node {node} of the locator is deeper than {} nodes; balance the tree",
        Locator::MAX_DEPTH
    )]
    LocatorDepth {
        /// The first such node.
        node: u32,
    },
    /// The cell beyond the locator's box does not exist.
    #[error("the locator's outside is cell {cell} of {n_cells}")]
    LocatorOutside {
        /// The cell that it names.
        cell: u32,
        /// How many there are.
        n_cells: usize,
    },
    /// What lies beyond the locator's box is not the outdoors, or the outdoors does not lie there.
    #[error("the locator's outside is {}, the outdoors {}; they must be the same", cell_name(*.outside), cell_name(*.outdoors))]
    OutsideOutdoors {
        /// The cell beyond the locator's box.
        outside: Option<u32>,
        /// The cell that is marked as the outdoors.
        outdoors: Option<u32>,
    },
    /// A box lies, or reaches, where nothing of the world can be.
    #[error("{}: the box {min:?} to {max:?} reaches out of {of}", shown(owner))]
    FarBox {
        /// Whose box it is, e.g. `cell 3`, `the locator`.
        owner: String,
        /// What it should lie in or around.
        of: &'static str,
        /// Least corner. [Units: wu]
        min: [f64; 3],
        /// Greatest corner. [Units: wu]
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
        "{}: cells must ascend, none twice, all below {n_cells}; {cell} does not fit",
        shown(owner)
    )]
    CellList {
        /// Whose list it is, e.g. `batch 3` or `detail 7 (chair)`.
        owner: String,
        /// The first cell that does not fit.
        cell: u32,
        /// How many cells there are.
        n_cells: usize,
    },
    /// A list of triangles is broken.
    #[error("{}: {}", shown(owner), shown(problem))]
    Primitive {
        /// Whose triangles they are, e.g. `batch 3` or `detail mesh 2, primitive 0`.
        owner: String,
        /// What is wrong.
        problem: String,
    },
    /// A detail object names a mesh that does not exist or has a transform that is none.
    #[error("detail {detail} ({}): {}", shown(name), shown(problem))]
    Detail {
        /// The detail object.
        detail: u32,
        /// Its name.
        name: String,
        /// What is wrong.
        problem: String,
    },
    /// A material, texture or sampler is broken.
    #[error("{}: {}", shown(owner), shown(problem))]
    Look {
        /// What it is, e.g. `material 3`.
        owner: String,
        /// What is wrong.
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
