//! Shared cell and portal layout of all queries.

use enfilade_cpg::{CellId, Locator, Portal, PortalId, PortalKind, World};
use enfilade_geom::{Aabb, DVec3, Plane, Winding, world_tolerance};

/// The cells and portals of a world in double precision, in contiguous arrays.
///
/// Made once. A portal's opening is its convex pieces, not the outline around them: a shape that touches only the outline does
/// not touch the opening.
#[derive(Clone, Debug)]
pub struct Layout {
    cells: Vec<CellShape>,
    /// Per cell its first exit, and the number of all.
    first_exit: Vec<u32>,
    exits: Vec<Exit>,
    /// Per exit, the box around its opening; contiguous, for distance bounds to all of them.
    exit_bounds: Vec<Aabb>,
    openings: Vec<OpeningShape>,
    /// Per piece its first vertex, and the number of all.
    first_corner: Vec<u32>,
    corners: Vec<DVec3>,
    locator: Locator,
    tolerance: f64,
}

/// Extent of a cell.
#[derive(Clone, Copy, Debug)]
pub struct CellShape {
    /// Bounding box. For outdoors, the scene's padded box. [Units: wu]
    pub bounds: Aabb,
    /// Volume of its air. [Units: wu³]
    pub volume: f64,
    /// True for the space around the building.
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
    /// Makes the layout of a world whose graph is [valid](enfilade_cpg::CellPortalGraph::validate). O(cells + vertices of
    /// portals).
    ///
    /// Leaves out pieces without area, by rounding. A portal without any other piece has its outline for an opening; if that has
    /// no area either, it has no opening at all: nothing passes it.
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

    /// Adds a piece, counter-clockwise about `normal`, unless it has no area; returns its area.
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

    /// Returns the number of cells.
    #[must_use]
    pub fn n_cells(&self) -> usize {
        self.cells.len()
    }

    /// Returns the number of portals.
    #[must_use]
    pub fn n_portals(&self) -> usize {
        self.openings.len()
    }

    /// Returns the extent of a cell.
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    #[must_use]
    pub fn cell(&self, cell: CellId) -> &CellShape {
        &self.cells[cell.idx()]
    }

    /// Returns the portals of a cell, ascending, each with the cell behind it.
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    #[must_use]
    pub fn exits(&self, cell: CellId) -> &[Exit] {
        let first = &self.first_exit[cell.idx()..];
        &self.exits[first[0] as usize..first[1] as usize]
    }

    /// Returns the distance of a point from the nearest box around an opening of a cell; infinite if the cell has none.
    /// O(its openings). [Units: wu]
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    #[must_use]
    pub fn distance_to_exits(&self, cell: CellId, p: DVec3) -> f64 {
        let first = &self.first_exit[cell.idx()..];
        let bounds = &self.exit_bounds[first[0] as usize..first[1] as usize];
        let squares = bounds.iter().map(|b| b.distance_squared(p));
        squares.fold(f64::INFINITY, f64::min).sqrt()
    }

    /// Returns a portal's opening.
    ///
    /// # Panics
    ///
    /// If there is no such portal.
    #[must_use]
    pub fn opening(&self, portal: PortalId) -> Opening<'_> {
        Opening {
            layout: self,
            shape: &self.openings[portal.idx()],
        }
    }

    /// Returns the cell of a point; `None` in solid matter and for points that are not finite. Takes about 100 ns. [Units: wu]
    #[must_use]
    pub fn locate(&self, p: DVec3) -> Option<CellId> {
        self.locator.locate(p)
    }

    /// As [`Layout::locate`]; also returns a distance from the point within which the cell is certainly the same. [Units: wu]
    #[must_use]
    pub fn locate_with_room(&self, p: DVec3) -> (Option<CellId>, f64) {
        self.locator.locate_with_room(p)
    }

    /// Adds to `cells` those that the hull of `points`, grown by `margin`, may touch; `cells` stays ascending and without
    /// repeats. `stack` is a buffer to keep between calls. As [`Locator::cells_near`]. [Units: wu]
    pub fn cells_near(
        &self,
        points: &[DVec3],
        margin: f64,
        cells: &mut Vec<CellId>,
        stack: &mut Vec<i32>,
    ) {
        self.locator.cells_near_with(points, margin, cells, stack);
    }

    /// Returns the space around the building, if any. O(cells).
    #[must_use]
    pub fn outdoors(&self) -> Option<CellId> {
        let at = self.cells.iter().position(|c| c.is_outdoor)?;
        Some(CellId(at as u32))
    }

    /// Returns the largest deviation of stored from true geometry by rounding. [Units: wu]
    #[must_use]
    pub fn tolerance(&self) -> f64 {
        self.tolerance
    }
}

impl<'a> Opening<'a> {
    /// Returns its two cells; the normal points from the first to the second.
    #[must_use]
    pub fn cells(&self) -> [CellId; 2] {
        self.shape.cells
    }

    /// Returns the kind of opening.
    #[must_use]
    pub fn kind(&self) -> PortalKind {
        self.shape.kind
    }

    /// Returns the unit normal, from the first cell to the second.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        self.shape.normal
    }

    /// Returns the signed distance of a point from its plane, above 0 on the side of the second cell. [Units: wu]
    #[must_use]
    pub fn height_of(&self, p: DVec3) -> f64 {
        self.shape.normal.dot(p - self.shape.center)
    }

    /// Returns the center of its box; on its plane up to rounding, not always in the opening. [Units: wu]
    #[must_use]
    pub fn center(&self) -> DVec3 {
        self.shape.center
    }

    /// Returns the radius of the bounding sphere about the center. [Units: wu]
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.shape.radius
    }

    /// Returns the bounding box. [Units: wu]
    #[must_use]
    pub fn bounds(&self) -> &'a Aabb {
        &self.shape.bounds
    }

    /// Returns the total area of its pieces. [Units: wu²]
    #[must_use]
    pub fn area(&self) -> f64 {
        self.shape.area
    }

    /// Returns its convex pieces, each counter-clockwise seen from the second cell. [Units: wu]
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
