//! Cells and portals as all that walks through them reads them.

use enfilade_cpg::{CellId, Locator, Portal, PortalId, PortalKind, World};
use enfilade_geom::{Aabb, DVec3, Plane, Winding, world_tolerance};

/// The cells and portals of a world in double precision, side by side.
///
/// Made once. A portal's opening is its convex pieces, not the outline around them: what touches the outline alone does not
/// touch the opening.
#[derive(Clone, Debug)]
pub struct Layout {
    cells: Vec<CellShape>,
    /// By cell its first exit, and the number of all.
    first_exit: Vec<u32>,
    exits: Vec<Exit>,
    /// By exit, around its opening: side by side, for who only wants to know how far off all are.
    exit_bounds: Vec<Aabb>,
    openings: Vec<OpeningShape>,
    /// By piece its first corner, and the number of all.
    first_corner: Vec<u32>,
    corners: Vec<DVec3>,
    locator: Locator,
    tolerance: f64,
}

/// A cell by its size.
#[derive(Clone, Copy, Debug)]
pub struct CellShape {
    /// Around it. For outdoors, the scene's padded box. [Units: wu]
    pub bounds: Aabb,
    /// Of the air in it. [Units: wu³]
    pub volume: f64,
    /// Whether it is the space around the building.
    pub is_outdoor: bool,
}

/// A portal as left from one of its cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exit {
    /// The portal.
    pub portal: PortalId,
    /// The cell behind it.
    pub to: CellId,
}

#[derive(Clone, Copy, Debug)]
struct OpeningShape {
    cells: [CellId; 2],
    kind: PortalKind,
    normal: DVec3,
    center: DVec3,
    radius: f64,
    area: f64,
    bounds: Aabb,
    pieces: [u32; 2],
}

/// A portal's true opening.
#[derive(Clone, Copy)]
pub struct Opening<'a> {
    layout: &'a Layout,
    shape: &'a OpeningShape,
}

impl Layout {
    /// Of a world whose graph is [valid](enfilade_cpg::CellPortalGraph::validate). O(cells + corners of portals).
    ///
    /// A piece that has no area, by rounding, is left out; a portal without any other has its outline for an opening, and one
    /// whose outline is none either has no opening at all: nothing passes it.
    #[must_use]
    pub fn new(world: &World) -> Self {
        let graph = &world.graph;
        let cells: Vec<CellShape> = graph
            .cells
            .iter()
            .map(|cell| CellShape {
                bounds: Aabb::of_points(&cell.aabb.map(point)),
                volume: f64::from(cell.volume),
                is_outdoor: cell.outdoor,
            })
            .collect();
        let mut first_exit = vec![0];
        let mut exits = Vec::new();
        for cell in graph.cell_ids() {
            exits.extend(graph.exits(cell).map(|e| Exit {
                portal: e.id,
                to: e.to,
            }));
            first_exit.push(exits.len() as u32);
        }
        let extent = cells.iter().fold(0.0, |extent: f64, cell| {
            let [low, high] = [cell.bounds.min, cell.bounds.max].map(|p| p.abs().max_element());
            extent.max(low).max(high)
        });
        let mut layout = Self {
            cells,
            first_exit,
            exits,
            exit_bounds: Vec::new(),
            openings: Vec::new(),
            first_corner: vec![0],
            corners: Vec::new(),
            locator: graph.locator.clone(),
            tolerance: world_tolerance(extent),
        };
        for portal in &graph.portals {
            layout.add_opening(portal);
        }
        let bounds = |e: &Exit| layout.openings[e.portal.idx()].bounds;
        layout.exit_bounds = layout.exits.iter().map(bounds).collect();
        layout
    }

    fn add_opening(&mut self, portal: &Portal) {
        let normal = point(portal.normal).normalize_or_zero();
        let first_piece = self.first_corner.len() as u32 - 1;
        let first = self.corners.len();
        let mut area = 0.0;
        for piece in &portal.pieces {
            area += self.add_piece(piece, normal);
        }
        if area == 0.0 {
            area = self.add_piece(&portal.outline, normal);
        }
        let own = &self.corners[first..];
        let bounds = Aabb::of_points(own);
        let center = if own.is_empty() {
            DVec3::ZERO
        } else {
            bounds.center()
        };
        let radius = own.iter().map(|p| p.distance(center)).fold(0.0, f64::max);
        self.openings.push(OpeningShape {
            cells: portal.cells,
            kind: portal.kind,
            normal,
            center,
            radius,
            area,
            bounds,
            pieces: [first_piece, self.first_corner.len() as u32 - 1],
        });
    }

    /// Adds a piece that has an area, counter-clockwise about `normal`; its area.
    fn add_piece(&mut self, corners: &[[f32; 3]], normal: DVec3) -> f64 {
        if corners.iter().flatten().any(|x| !x.is_finite()) || normal == DVec3::ZERO {
            return 0.0;
        }
        let points: Vec<DVec3> = corners.iter().map(|p| point(*p)).collect();
        let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
        let plane = Plane::through(middle, normal);
        let hull: Winding = Winding::hull_in_plane(&plane, &points);
        let area = hull.area();
        if hull.points.len() < 3 || area <= 0.0 {
            return 0.0;
        }
        self.corners.extend_from_slice(&hull.points);
        self.first_corner.push(self.corners.len() as u32);
        area
    }

    /// How many cells there are.
    #[must_use]
    pub fn n_cells(&self) -> usize {
        self.cells.len()
    }

    /// How many portals there are.
    #[must_use]
    pub fn n_portals(&self) -> usize {
        self.openings.len()
    }

    /// A cell by its size.
    ///
    /// # Panics
    ///
    /// When there is no such cell.
    #[must_use]
    pub fn cell(&self, cell: CellId) -> &CellShape {
        &self.cells[cell.idx()]
    }

    /// The portals of a cell, ascending, each with the cell behind it.
    ///
    /// # Panics
    ///
    /// When there is no such cell.
    #[must_use]
    pub fn exits(&self, cell: CellId) -> &[Exit] {
        let first = &self.first_exit[cell.idx()..];
        &self.exits[first[0] as usize..first[1] as usize]
    }

    /// How far a point is from the nearest box around an opening of a cell; infinite where the cell has none. O(its openings).
    /// [Units: wu]
    ///
    /// # Panics
    ///
    /// When there is no such cell.
    #[must_use]
    pub fn distance_to_exits(&self, cell: CellId, p: DVec3) -> f64 {
        let first = &self.first_exit[cell.idx()..];
        let bounds = &self.exit_bounds[first[0] as usize..first[1] as usize];
        let squares = bounds.iter().map(|b| b.distance_squared(p));
        squares.fold(f64::INFINITY, f64::min).sqrt()
    }

    /// A portal's opening.
    ///
    /// # Panics
    ///
    /// When there is no such portal.
    #[must_use]
    pub fn opening(&self, portal: PortalId) -> Opening<'_> {
        Opening {
            layout: self,
            shape: &self.openings[portal.idx()],
        }
    }

    /// The cell of a point; `None` in solid matter and for points that are not finite. About 100 ns. [Units: wu]
    #[must_use]
    pub fn locate(&self, p: DVec3) -> Option<CellId> {
        self.locator.locate(p)
    }

    /// The same, and how far from the point it surely is the same cell. [Units: wu]
    #[must_use]
    pub fn locate_with_room(&self, p: DVec3) -> (Option<CellId>, f64) {
        self.locator.locate_with_room(p)
    }

    /// Adds the cells that the hull of `points` may touch, grown by `margin`, to `cells`, which stays ascending and without
    /// repeats; `stack` is a buffer to be kept. As [`Locator::cells_near`]. [Units: wu]
    pub fn cells_near(
        &self,
        points: &[DVec3],
        margin: f64,
        cells: &mut Vec<CellId>,
        stack: &mut Vec<i32>,
    ) {
        self.locator.cells_near_with(points, margin, cells, stack);
    }

    /// The cell that is the space around the building, if there is one. O(cells).
    #[must_use]
    pub fn outdoors(&self) -> Option<CellId> {
        let at = self.cells.iter().position(|c| c.is_outdoor)?;
        Some(CellId(at as u32))
    }

    /// How far what is stored may be off what is true, by rounding. [Units: wu]
    #[must_use]
    pub fn tolerance(&self) -> f64 {
        self.tolerance
    }
}

impl<'a> Opening<'a> {
    /// Its two cells; the normal points from the first to the second.
    #[must_use]
    pub fn cells(&self) -> [CellId; 2] {
        self.shape.cells
    }

    /// What kind of opening it is.
    #[must_use]
    pub fn kind(&self) -> PortalKind {
        self.shape.kind
    }

    /// Unit normal, from the first cell to the second.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        self.shape.normal
    }

    /// Signed distance of a point from its plane, above 0 on the side of the second cell. [Units: wu]
    #[must_use]
    pub fn height_of(&self, p: DVec3) -> f64 {
        self.shape.normal.dot(p - self.shape.center)
    }

    /// The middle of its box; on its plane but for rounding, not always in the opening. [Units: wu]
    #[must_use]
    pub fn center(&self) -> DVec3 {
        self.shape.center
    }

    /// Of the sphere about the center that holds it. [Units: wu]
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.shape.radius
    }

    /// Around it. [Units: wu]
    #[must_use]
    pub fn bounds(&self) -> &'a Aabb {
        &self.shape.bounds
    }

    /// The sum over its pieces. [Units: wu²]
    #[must_use]
    pub fn area(&self) -> f64 {
        self.shape.area
    }

    /// Its convex pieces, each counter-clockwise seen from the second cell. [Units: wu]
    pub fn pieces(&self) -> impl ExactSizeIterator<Item = &'a [DVec3]> + Clone + use<'a> {
        let (layout, [first, end]) = (self.layout, self.shape.pieces);
        (first as usize..end as usize).map(move |i| {
            let at = layout.first_corner[i] as usize..layout.first_corner[i + 1] as usize;
            &layout.corners[at]
        })
    }
}

fn point(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}
