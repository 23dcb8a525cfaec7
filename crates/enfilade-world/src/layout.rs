//! Shared cell and portal layout of all queries.

use std::fmt;
use std::sync::Arc;

use enfilade_cpg::{CellId, Locator, Portal, PortalId, PortalKind, SpecialId, Way, World};
use enfilade_geom::{Aabb, DVec3, Plane, Similarity, Winding, world_tolerance};

/// The cells and portals of a world in double precision, in contiguous arrays.
///
/// Made once. A portal's opening is its convex pieces, not the outline around them: a shape that touches only the outline does
/// not touch the opening.
#[derive(Clone, Debug)]
pub struct Layout {
    pub(crate) cells: Vec<CellShape>,
    /// Per cell its first exit, and the number of all.
    pub(crate) first_exit: Vec<u32>,
    pub(crate) exits: Vec<LayoutExit>,
    /// Per exit, the box around its opening; contiguous, for distance bounds to all of them.
    pub(crate) exit_bounds: Vec<Aabb>,
    pub(crate) openings: Vec<OpeningShape>,
    pub(crate) specials: Vec<SpecialSide>,
    /// Pairs of a cell and a special portal that it sees, ascending.
    pub(crate) specials_by_cell: Vec<(CellId, SpecialId)>,
    /// Per piece its first vertex, and the number of all.
    pub(crate) first_corner: Vec<u32>,
    pub(crate) corners: Vec<DVec3>,
    pub(crate) locator: Arc<Locator>,
    pub(crate) tolerance: f64,
}

/// Extent of a cell.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct CellShape {
    /// Bounding box. For outdoors, the scene's padded box. [Units: wu]
    pub bounds: Aabb,
    /// Volume of its air. [Units: wu³]
    pub volume: f64,
    /// True for the space around the building.
    pub is_outdoor: bool,
    /// True for a space in which nobody can stand.
    pub is_void: bool,
}

/// A portal as left from one of its cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayoutExit {
    /// The portal.
    pub portal: PortalId,
    /// The cell behind it.
    pub to: CellId,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct OpeningShape {
    pub(crate) cells: [CellId; 2],
    pub(crate) kind: PortalKind,
    pub(crate) normal: DVec3,
    pub(crate) center: DVec3,
    pub(crate) radius: f64,
    pub(crate) area: f64,
    pub(crate) bounds: Aabb,
    pub(crate) pieces: [u32; 2],
}

/// A special portal in a layout.
#[derive(Clone, Debug)]
pub(crate) struct SpecialSide {
    shape: OpeningShape,
    portal: Option<PortalId>,
    /// Per pass, from the side of those who look to the side that is seen.
    maps: Vec<Option<Similarity>>,
    /// The cell where those who pass come out, and the pass.
    leads_to: Option<(CellId, usize)>,
}

/// A portal's true opening.
#[derive(Clone, Copy)]
pub struct Opening<'a> {
    layout: &'a Layout,
    shape: &'a OpeningShape,
}

impl fmt::Debug for Opening<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Opening")
            .field("cells", &self.cells())
            .field("kind", &self.kind())
            .finish_non_exhaustive()
    }
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
                is_void: cell.is_void,
            })
            .collect();
        let mut first_exit = vec![0];
        let mut exits = Vec::new();
        for cell in graph.cell_ids() {
            // A special side replaces the way, unless it lets through.
            let is_way = |portal| {
                let side = graph.special_side(portal, cell);
                side.is_none_or(|s| graph.specials[s.idx()].is_through())
            };
            let ways = graph.exits(cell).filter(|e| is_way(e.id));
            exits.extend(ways.map(|e| LayoutExit {
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
            specials: Vec::new(),
            specials_by_cell: Vec::new(),
            first_corner: vec![0],
            corners: Vec::new(),
            locator: graph.locator.clone(),
            tolerance: world_tolerance(extent),
        };
        for portal in &graph.portals {
            let opening = layout.opening_of(portal);
            layout.openings.push(opening);
        }
        for id in graph.special_ids() {
            layout.add_special(id, world);
        }
        layout.specials_by_cell.sort_unstable();
        let bounds = |e: &LayoutExit| layout.openings[e.portal.idx()].bounds;
        layout.exit_bounds = layout.exits.iter().map(bounds).collect();
        layout
    }

    fn add_special(&mut self, id: SpecialId, world: &World) {
        let side = &world.graph.specials[id.idx()];
        let (normal, pieces) = world.graph.special_opening(id);
        let (first_piece, first) = (self.first_corner.len() as u32 - 1, self.corners.len());
        let area = (pieces.iter())
            .map(|piece| self.add_piece(&piece.points, normal))
            .sum();
        let mut numbered = (0..).zip(&side.passes);
        let leads_to = numbered.find_map(|(pass, it)| match it.way {
            Way::Lead { to, .. } => Some((to, pass)),
            _ => None,
        });
        let beyond = leads_to.map_or(side.cell, |(to, _)| to);
        self.specials.push(SpecialSide {
            shape: self.shape_of(
                [side.cell, beyond],
                PortalKind::Open,
                normal,
                area,
                first_piece,
                first,
            ),
            portal: side.portal(),
            maps: (0..side.passes.len())
                .map(|pass| world.graph.map_of_pass(id, pass))
                .collect(),
            leads_to,
        });
        self.specials_by_cell.push((side.cell, id));
    }

    fn opening_of(&mut self, portal: &Portal) -> OpeningShape {
        let normal = point(portal.normal).normalize_or_zero();
        let (first_piece, first) = (self.first_corner.len() as u32 - 1, self.corners.len());
        let mut add = |piece: &[[f32; 3]]| {
            let points: Vec<DVec3> = piece.iter().map(|p| point(*p)).collect();
            self.add_piece(&points, normal)
        };
        let mut area = portal.pieces.iter().map(|piece| add(piece)).sum();
        if area == 0.0 {
            area = add(&portal.outline);
        }
        self.shape_of(portal.cells, portal.kind, normal, area, first_piece, first)
    }

    /// Returns the shape of an opening whose pieces and vertices are the last ones.
    fn shape_of(
        &self,
        cells: [CellId; 2],
        kind: PortalKind,
        normal: DVec3,
        area: f64,
        first_piece: u32,
        first: usize,
    ) -> OpeningShape {
        let own = &self.corners[first..];
        let bounds = Aabb::of_points(own);
        let center = if own.is_empty() {
            DVec3::ZERO
        } else {
            bounds.center()
        };
        let radius = own.iter().map(|p| p.distance(center)).fold(0.0, f64::max);
        OpeningShape {
            cells,
            kind,
            normal,
            center,
            radius,
            area,
            bounds,
            pieces: [first_piece, self.first_corner.len() as u32 - 1],
        }
    }

    /// Adds a piece, counter-clockwise about `normal`, unless it has no area; returns its area.
    fn add_piece(&mut self, points: &[DVec3], normal: DVec3) -> f64 {
        if !points.iter().all(|p| p.is_finite()) || normal == DVec3::ZERO {
            return 0.0;
        }
        let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
        let plane = Plane::through(middle, normal);
        let hull: Winding = Winding::hull_in_plane(&plane, points);
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
    pub fn exits(&self, cell: CellId) -> &[LayoutExit] {
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
    pub(crate) fn distance_to_exits(&self, cell: CellId, p: DVec3) -> f64 {
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

    /// Returns the number of special portals.
    #[must_use]
    #[doc(hidden)]
    pub fn n_specials(&self) -> usize {
        self.specials.len()
    }

    /// Returns the special portals that a cell sees, ascending. O(log).
    pub(crate) fn specials_of(&self, cell: CellId) -> impl ExactSizeIterator<Item = SpecialId> {
        let all = &self.specials_by_cell;
        let first = all.partition_point(|s| s.0 < cell);
        let end = all.partition_point(|s| s.0 <= cell);
        all[first..end].iter().map(|s| s.1)
    }

    /// Returns a special portal's polygon: the normal points out of its cell, the first of the opening's cells; the second is
    /// the cell where those who pass come out, or the first again.
    ///
    /// # Panics
    ///
    /// If there is no such special portal; likewise in all queries of one.
    #[must_use]
    #[doc(hidden)]
    pub fn special_opening(&self, special: SpecialId) -> Opening<'_> {
        Opening {
            layout: self,
            shape: &self.specials[special.idx()].shape,
        }
    }

    /// Returns the doorway of which a special portal is a side.
    #[must_use]
    pub(crate) fn portal_of_special(&self, special: SpecialId) -> Option<PortalId> {
        self.specials[special.idx()].portal
    }

    /// Returns the map of a pass, from the side of those who look to the side that is seen; `None` for a monitor.
    ///
    /// # Panics
    ///
    /// If there is no such pass.
    #[must_use]
    #[doc(hidden)]
    pub fn map_of_pass(&self, special: SpecialId, pass: usize) -> Option<&Similarity> {
        self.specials[special.idx()].maps[pass].as_ref()
    }

    /// Returns where those who pass a special portal come out: the cell, and the map from here to there. `None` if nobody
    /// passes it.
    #[must_use]
    pub(crate) fn passage(&self, special: SpecialId) -> Option<(CellId, &Similarity)> {
        let side = &self.specials[special.idx()];
        let (to, pass) = side.leads_to?;
        Some((to, side.maps[pass].as_ref()?))
    }

    /// Returns the rectangle around a special portal, upright as far as its plane allows, as seen from its cell: its lower left
    /// vertex, and its edges to the right and up. A monitor's picture fills it. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn special_rectangle(&self, special: SpecialId) -> [DVec3; 3] {
        let opening = self.special_opening(special);
        let normal = opening.normal();
        let right = normal.cross(DVec3::Y).try_normalize();
        // As far as a level plane allows: with -Z up, as on a map.
        let right = right
            .filter(|_| normal.y.abs() < 1.0 - 1e-9)
            .unwrap_or(DVec3::X);
        let up = right.cross(normal);
        let corners = || opening.pieces().flatten();
        let range = |axis: DVec3| {
            let along = corners().map(move |p| axis.dot(*p - opening.center()));
            along.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| {
                [a.min(x), b.max(x)]
            })
        };
        let ([left, r], [bottom, top]) = (range(right), range(up));
        let corner = opening.center() + right * left + up * bottom;
        [corner, right * (r - left), up * (top - bottom)]
    }

    /// Returns the cell of a point; `None` in solid matter and for points that are not finite. Takes about 100 ns. [Units: wu]
    #[must_use]
    pub fn locate(&self, p: DVec3) -> Option<CellId> {
        self.locator.locate(p)
    }

    /// As [`Layout::locate`]; also returns a distance from the point within which the cell is certainly the same. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn locate_with_room(&self, p: DVec3) -> (Option<CellId>, f64) {
        self.locator.locate_with_room(p)
    }

    /// Adds to `cells` those that the hull of `points`, grown by `margin`, may touch; `cells` stays ascending and without
    /// repeats. `stack` is a buffer to keep between calls. As [`Locator::cells_near`]. [Units: wu]
    #[doc(hidden)]
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
    #[doc(hidden)]
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
    #[doc(hidden)]
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
    #[doc(hidden)]
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

    /// Returns `true` if a point of its plane is in one of its pieces, or within `margin` of the line of each edge. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn is_over(&self, p: DVec3, margin: f64) -> bool {
        let normal = self.normal();
        self.pieces().any(|piece| {
            (0..piece.len()).all(|i| {
                let along = piece[(i + 1) % piece.len()] - piece[i];
                normal.cross(along).dot(p - piece[i]) >= -margin * along.length()
            })
        })
    }

    /// Returns its convex pieces, each counter-clockwise seen from the second cell. [Units: wu]
    #[doc(hidden)]
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
