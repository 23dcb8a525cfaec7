//! The invariants of a graph and of a world, checked one by one.
//!
//! Everything that reads a graph relies on these: a decoded world passes them or is not returned,
//! and a world that breaks one is never written. All checks together take time near-linear in the
//! size of what is checked, so that a hostile file cannot buy hours with a few bytes.

use std::collections::HashMap;

use enfilade_geom::scene::{Mesh, Primitive};
use enfilade_geom::{DVec3, Plane, Winding};

use crate::{CellId, CellPortalGraph, Locator, Portal, PortalId, World};

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
    /// A row of the potentially visible set does not fit the graph.
    #[error("potentially visible set, cell {cell}: {problem}")]
    Pvs {
        /// The cell.
        cell: u32,
        /// What is wrong with its row.
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
    /// The cell beyond the locator's box does not exist.
    #[error("the locator's outside is cell {cell} of {n_cells}")]
    LocatorOutside {
        /// The cell that it names.
        cell: u32,
        /// How many there are.
        n_cells: usize,
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
    #[error("{owner}: cells must ascend, none twice, all below {n_cells}; {cell} does not fit")]
    CellList {
        /// Whose list it is, e.g. `batch 3` or `detail 7 (chair)`.
        owner: String,
        /// The first cell that does not fit.
        cell: u32,
        /// How many cells there are.
        n_cells: usize,
    },
    /// A list of triangles is broken.
    #[error("{owner}: {problem}")]
    Primitive {
        /// Whose triangles they are, e.g. `batch 3` or `detail mesh 2, primitive 0`.
        owner: String,
        /// What is wrong.
        problem: String,
    },
    /// A detail object names a mesh that does not exist or has a transform that is none.
    #[error("detail {detail} ({name}): {problem}")]
    Detail {
        /// The detail object.
        detail: u32,
        /// Its name.
        name: String,
        /// What is wrong.
        problem: String,
    },
    /// A material, texture or sampler is broken.
    #[error("{owner}: {problem}")]
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

fn node_name(node: Option<u32>) -> String {
    node.map_or_else(
        || "the locator's root".into(),
        |i| format!("node {i} of the locator"),
    )
}

/// Collects problems up to [`MAX_REPORTED`].
#[derive(Default)]
struct Findings(Vec<GraphError>);

impl Findings {
    fn push(&mut self, error: GraphError) {
        if !self.is_full() {
            self.0.push(error);
        }
    }

    fn is_full(&self) -> bool {
        self.0.len() >= MAX_REPORTED
    }

    fn into_result(self) -> Result<(), Vec<GraphError>> {
        if self.0.is_empty() {
            Ok(())
        } else {
            Err(self.0)
        }
    }
}

impl CellPortalGraph {
    /// Checks every invariant of the graph.
    ///
    /// Takes time near-linear in cells, portal corners and locator nodes.
    ///
    /// # Errors
    ///
    /// What is broken and where, in the order of the lists; at most [`MAX_REPORTED`] problems.
    pub fn validate(&self) -> Result<(), Vec<GraphError>> {
        let mut found = Findings::default();
        self.check(&mut found);
        found.into_result()
    }

    fn check(&self, found: &mut Findings) {
        check_cells(self, found);
        check_cell_portals(self, found);
        for (i, portal) in self.portals.iter().enumerate() {
            if found.is_full() {
                return;
            }
            check_portal(i as u32, portal, self.cells.len(), found);
        }
        check_locator(&self.locator, self.cells.len(), found);
        for (name, &value) in &self.statistics.counts {
            if !value.is_finite() {
                found.push(GraphError::Statistic {
                    name: name.clone(),
                    value,
                });
            }
        }
    }
}

impl World {
    /// Checks every invariant of the graph ([`CellPortalGraph::validate`]) and of its geometry.
    ///
    /// Takes time near-linear in the size of the world.
    ///
    /// # Errors
    ///
    /// What is broken and where; at most [`MAX_REPORTED`] problems.
    pub fn validate(&self) -> Result<(), Vec<GraphError>> {
        let mut found = Findings::default();
        self.graph.check(&mut found);
        let n_cells = self.graph.cells.len();
        for (i, batch) in self.batches.iter().enumerate() {
            let owner = || format!("batch {i}");
            check_cell_list(owner, &batch.cells, n_cells, &mut found);
            check_primitive(owner, &batch.primitive, self.materials.len(), &mut found);
        }
        for (i, mesh) in self.detail_meshes.iter().enumerate() {
            check_mesh(i, mesh, self.materials.len(), &mut found);
        }
        for (i, detail) in self.details.iter().enumerate() {
            let owner = || format!("detail {i} ({})", detail.name);
            check_cell_list(owner, &detail.cells, n_cells, &mut found);
            let mut problem = |problem: String| {
                let (detail, name) = (i as u32, detail.name.clone());
                found.push(GraphError::Detail {
                    detail,
                    name,
                    problem,
                });
            };
            if detail.mesh as usize >= self.detail_meshes.len() {
                problem(format!(
                    "mesh {} of {}",
                    detail.mesh,
                    self.detail_meshes.len()
                ));
            }
            let t = &detail.transform;
            if !t.iter().all(|v| v.is_finite()) {
                problem("the transform is not finite".into());
            } else if [t[3], t[7], t[11], t[15]] != [0.0, 0.0, 0.0, 1.0] {
                problem("the transform's last row is not 0 0 0 1".into());
            }
        }
        let is_finite = self.leak_path.as_flattened().iter().all(|v| v.is_finite());
        if self.leak_path.len() == 1 || !is_finite {
            found.push(GraphError::LeakPath);
        }
        let pvs = self.pvs.as_ref().and_then(|p| p.problem(n_cells));
        if let Some((cell, problem)) = pvs {
            found.push(GraphError::Pvs { cell, problem });
        }
        crate::look::check(self, &mut |owner, problem| {
            found.push(GraphError::Look { owner, problem });
        });
        found.into_result()
    }
}

fn check_cells(graph: &CellPortalGraph, found: &mut Findings) {
    let mut first_of_name = HashMap::with_capacity(graph.cells.len());
    let mut outdoors = None;
    for (i, cell) in graph.cells.iter().enumerate() {
        let i = i as u32;
        if let Some(first) = first_of_name.insert(cell.name.as_str(), i) {
            found.push(GraphError::DuplicateName {
                first,
                second: i,
                name: cell.name.clone(),
            });
        }
        if cell.outdoor {
            if let Some(first) = outdoors {
                found.push(GraphError::TwoOutdoors { first, second: i });
            }
            outdoors = outdoors.or(Some(i));
        }
        let [min, max] = cell.aabb;
        let ordered = (0..3).all(|k| min[k].is_finite() && max[k].is_finite() && min[k] <= max[k]);
        if !ordered || !cell.volume.is_finite() || cell.volume < 0.0 {
            let (aabb, volume) = (cell.aabb, cell.volume);
            found.push(GraphError::CellExtent {
                cell: i,
                aabb,
                volume,
            });
        }
    }
}

fn check_cell_portals(graph: &CellPortalGraph, found: &mut Findings) {
    let mut actual: Vec<Vec<PortalId>> = vec![Vec::new(); graph.cells.len()];
    for (i, portal) in graph.portals.iter().enumerate() {
        let [a, b] = portal.cells;
        for id in if a == b {
            &portal.cells[..1]
        } else {
            &portal.cells[..]
        } {
            if let Some(list) = actual.get_mut(id.0 as usize) {
                list.push(PortalId(i as u32));
            }
        }
    }
    for (i, (cell, actual)) in graph.cells.iter().zip(&actual).enumerate() {
        if cell.portals != *actual {
            let same = cell
                .portals
                .iter()
                .zip(actual)
                .take_while(|(a, b)| a == b)
                .count();
            let rest = |list: &[PortalId]| list[same..].iter().take(8).map(|p| p.0).collect();
            found.push(GraphError::CellPortals {
                cell: i as u32,
                listed: rest(&cell.portals),
                actual: rest(actual),
            });
        }
    }
}

/// How far a stored corner may be from where it was computed. [Units: wu]
///
/// Corners and normal are computed in `f64` and rounded once to `f32`, which moves each coordinate
/// by at most 2⁻²⁴ of its size: √3·2⁻²⁴·|corner| for a corner, and the normal's own rounding tilts
/// the plane by as much across the polygon. Rounding outlines *outwards* takes the neighbouring
/// `f32` instead of the nearest, twice as far. Four times their sum leaves room for the corners
/// that a check compares with each other, and is still a tenth of a millimeter at 100 m.
fn corner_slack<'a>(corners: impl IntoIterator<Item = &'a [f32; 3]>) -> f64 {
    let largest = corners
        .into_iter()
        .flatten()
        .fold(0.0_f32, |m, c| m.max(c.abs()));
    4.0 * 2.0 * (3.0_f64.sqrt() * 2.0_f64.powi(-24)) * 2.0 * f64::from(largest)
        // Coordinates near zero: what is below a nanometer does not matter to anyone.
        + 1e-9
}

/// Relative error of an area that was summed in `f64` and stored as `f32`, doubled.
const AREA_ROUNDING: f64 = 2.4e-7;

/// How far the length of a normal rounded to `f32` may be from 1: √3 · 2⁻²⁴, times ten for
/// normals that were normalized in `f32` arithmetic.
const UNIT_SLACK: f64 = 1e-6;

fn check_portal(portal: u32, p: &Portal, n_cells: usize, found: &mut Findings) {
    let cells = p.cells.map(|c| c.0);
    if cells[0] == cells[1] || cells.iter().any(|&c| c as usize >= n_cells) {
        found.push(GraphError::PortalCells {
            portal,
            cells,
            n_cells,
        });
    }
    let normal = dvec(p.normal);
    if exceeds((normal.length() - 1.0).abs(), UNIT_SLACK) {
        return found.push(GraphError::PortalNormal {
            portal,
            normal: p.normal,
        });
    }
    let corners = || p.outline.iter().chain(p.pieces.iter().flatten());
    if let Some(&at) = corners().find(|c| !c.iter().all(|v| v.is_finite())) {
        return found.push(GraphError::PortalCorner { portal, at });
    }
    let slack = corner_slack(corners());
    if p.outline.len() < 3 {
        let n_corners = p.outline.len();
        return found.push(GraphError::TooFewCorners {
            portal,
            piece: None,
            n_corners,
        });
    }
    let outline: Vec<DVec3> = p.outline.iter().map(|&c| dvec(c)).collect();
    let plane = Plane::through(Winding::new(outline.clone()).mean(), normal.normalize());
    let check = PolygonCheck {
        portal,
        plane,
        slack,
    };
    check.polygon(None, &p.outline, found);
    let mut measured = 0.0;
    for (i, piece) in p.pieces.iter().enumerate() {
        if found.is_full() {
            return;
        }
        measured += check.polygon(Some(i as u32), piece, found);
    }
    check.pieces_inside(p, &outline, found);
    let reach: f64 = p.pieces.iter().map(|piece| perimeter(&dvecs(piece))).sum();
    let allowed = measured * AREA_ROUNDING + reach * slack;
    if p.pieces.is_empty() || exceeds((f64::from(p.area) - measured).abs(), allowed) {
        found.push(GraphError::PortalArea {
            portal,
            stored: p.area,
            measured,
        });
    }
}

/// Checks the polygons of one portal.
///
/// Whether a polygon is convex, and whether polygons lie inside another, is asked of convex hulls:
/// a closed curve is convex if and only if it is as long as its hull's and encloses as much, and a
/// set lies in a convex polygon if and only if it adds nothing to its hull. That takes
/// O(n log n) for n corners, does not depend on how short an edge is (a corner test across a
/// hair-short edge amplifies rounding without bound), and the allowance is exact: the hull of
/// points moved by at most ε has at most ε·perimeter + πε² more area and is at most 2πε longer
/// (Steiner's formula).
struct PolygonCheck {
    portal: u32,
    plane: Plane,
    slack: f64,
}

impl PolygonCheck {
    /// Checks one polygon and returns its area.
    fn polygon(&self, piece: Option<u32>, corners: &[[f32; 3]], found: &mut Findings) -> f64 {
        let Self {
            portal,
            plane,
            slack,
        } = *self;
        if corners.len() < 3 {
            let n_corners = corners.len();
            found.push(GraphError::TooFewCorners {
                portal,
                piece,
                n_corners,
            });
            return 0.0;
        }
        for &at in corners {
            let distance = plane.signed_distance(dvec(at));
            if distance.abs() > slack {
                found.push(GraphError::NotPlanar {
                    portal,
                    piece,
                    at,
                    distance,
                });
                return 0.0;
            }
        }
        let points = dvecs(corners);
        let length = perimeter(&points);
        let area = Winding::new(points.clone()).area_normal().dot(plane.normal) * 0.5;
        // A piece may be a sliver that rounding has flattened or turned; an outline may not.
        let least = if piece.is_some() {
            -slack * length
        } else {
            f64::MIN_POSITIVE
        };
        if area < least {
            found.push(GraphError::WrongWay {
                portal,
                piece,
                near: corners[0],
            });
            return 0.0;
        }
        let hull = Winding::hull_in_plane(&plane, &points);
        let hull_length = perimeter(&hull.points);
        let dent = hull.area() - area;
        // Each corner moved by the slack makes two edges longer by it; a curve that runs around
        // twice is twice as long, however many corners it has.
        let longer = (4.0 * points.len() as f64 * slack).min(0.25 * hull_length.max(slack));
        if dent > slack * (length + 4.0 * slack) || length > hull_length + longer {
            found.push(GraphError::NotConvex {
                portal,
                piece,
                near: corners[0],
            });
        }
        area.max(0.0)
    }

    fn pieces_inside(&self, p: &Portal, outline: &[DVec3], found: &mut Findings) {
        let Self {
            portal,
            plane,
            slack,
        } = *self;
        let own = Winding::hull_in_plane(&plane, outline);
        let mut all = outline.to_vec();
        all.extend(p.pieces.iter().flatten().map(|&c| dvec(c)));
        let both = Winding::hull_in_plane(&plane, &all);
        let length = perimeter(&own.points);
        let tau = std::f64::consts::TAU;
        if both.area() > own.area() + slack * (length + tau * slack)
            || perimeter(&both.points) > length + tau * slack
        {
            let middle = own.mean();
            let far = |c: &&[f32; 3]| dvec(**c).distance_squared(middle);
            let farthest = p
                .pieces
                .iter()
                .flatten()
                .max_by(|a, b| far(a).total_cmp(&far(b)))
                .copied();
            found.push(GraphError::PieceOutside {
                portal,
                at: farthest.unwrap_or_default(),
            });
        }
    }
}

/// Whether `value` is above `limit`, or no number at all.
fn exceeds(value: f64, limit: f64) -> bool {
    value.is_nan() || value > limit
}

fn dvec(p: [f32; 3]) -> DVec3 {
    DVec3::from(p.map(f64::from))
}

fn dvecs(points: &[[f32; 3]]) -> Vec<DVec3> {
    points.iter().map(|&p| dvec(p)).collect()
}

fn perimeter(points: &[DVec3]) -> f64 {
    let Some(&last) = points.last() else {
        return 0.0;
    };
    let mut from = last;
    points
        .iter()
        .map(|&p| std::mem::replace(&mut from, p).distance(p))
        .sum()
}

fn check_locator(locator: &Locator, n_cells: usize, found: &mut Findings) {
    let bounds = locator.bounds;
    let finite = bounds.min.is_finite() && bounds.max.is_finite() && !bounds.is_empty();
    if !finite && bounds != enfilade_geom::Aabb::EMPTY {
        let (min, max) = (bounds.min.into(), bounds.max.into());
        found.push(GraphError::LocatorBounds { min, max });
    }
    if let Some(CellId(cell)) = locator.outside
        && cell as usize >= n_cells
    {
        found.push(GraphError::LocatorOutside { cell, n_cells });
    }
    for (i, &value) in locator.planes.iter().enumerate() {
        if !value.iter().all(|v| v.is_finite()) || value[..3] == [0.0; 3] {
            found.push(GraphError::LocatorPlane {
                plane: i as u32,
                value,
            });
        }
    }
    let n_nodes = locator.nodes.len();
    let fits = |parent: i64, child: i32| {
        if child >= 0 {
            i64::from(child) > parent && (child as usize) < n_nodes
        } else {
            child == -1 || (-2 - i64::from(child)) < n_cells as i64
        }
    };
    if !fits(-1, locator.root) {
        found.push(GraphError::LocatorChild {
            node: None,
            child: locator.root,
        });
    }
    let n_planes = locator.planes.len();
    for (i, node) in locator.nodes.iter().enumerate() {
        let i32_id = i as u32;
        if node.plane as usize >= n_planes {
            found.push(GraphError::LocatorNode {
                node: i32_id,
                plane: node.plane,
                n_planes,
            });
        }
        for child in node.children {
            if !fits(i as i64, child) {
                found.push(GraphError::LocatorChild {
                    node: Some(i32_id),
                    child,
                });
            }
        }
    }
}

fn check_cell_list(
    owner: impl Fn() -> String,
    cells: &[CellId],
    n_cells: usize,
    found: &mut Findings,
) {
    let unsorted = cells.windows(2).find(|w| w[0] >= w[1]).map(|w| w[1]);
    let beyond = cells.last().copied().filter(|c| c.0 as usize >= n_cells);
    if let Some(CellId(cell)) = unsorted.or(beyond) {
        found.push(GraphError::CellList {
            owner: owner(),
            cell,
            n_cells,
        });
    }
}

fn check_mesh(i: usize, mesh: &Mesh, n_materials: usize, found: &mut Findings) {
    for (j, primitive) in mesh.primitives.iter().enumerate() {
        let owner = || format!("detail mesh {i} ({}), primitive {j}", mesh.name);
        check_primitive(owner, primitive, n_materials, found);
    }
}

fn check_primitive(
    owner: impl Fn() -> String,
    p: &Primitive,
    n_materials: usize,
    found: &mut Findings,
) {
    let mut problem = |problem: String| {
        found.push(GraphError::Primitive {
            owner: owner(),
            problem,
        });
    };
    let n = p.positions.len();
    if let Some(i) = p
        .positions
        .iter()
        .position(|p| !p.iter().all(|v| v.is_finite()))
    {
        problem(format!("position {i}, {:?}, is not finite", p.positions[i]));
    }
    let mut per_position = |what: &str, len: usize| {
        if len != 0 && len != n {
            problem(format!("{len} {what} for {n} positions"));
        }
    };
    per_position("normals", p.normals.len());
    per_position("tangents", p.tangents.len());
    per_position("colors", p.colors.len());
    for (set, uvs) in p.uvs.iter().enumerate() {
        if uvs.len() != n {
            problem(format!(
                "{} texture coordinates in set {set} for {n} positions",
                uvs.len()
            ));
        }
    }
    if !p.indices.len().is_multiple_of(3) {
        problem(format!(
            "{} indices are no whole number of triangles",
            p.indices.len()
        ));
    }
    if let Some(index) = p.indices.iter().find(|&&i| i as usize >= n) {
        problem(format!("index {index} into {n} positions"));
    }
    if let Some(material) = p.material.filter(|&m| m as usize >= n_materials) {
        problem(format!("material {material} of {n_materials}"));
    }
}
