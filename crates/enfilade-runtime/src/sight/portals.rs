//! Portals of a world as exits of its cells, with convex outlines of few vertices.

use enfilade_cpg::{CellPortalGraph, PortalId, SpecialId};
use enfilade_geom::{DVec2, DVec3, Plane, Winding, world_tolerance};

use crate::exits::{Exit, NO_PORTAL, SPECIAL};
use crate::point::point;
use crate::region::{MAX_CORNERS, reduced_around};
use crate::sight_error::SightError;

/// Maximum number of pieces used in place of the outline.
const MAX_PIECES: usize = 4;
/// Pieces replace the outline only if they fill less than this share of it.
const PIECES_SHARE: f64 = 0.75;

/// Exits under construction.
#[derive(Default)]
pub(super) struct Portals {
    /// Each with the cell that it leaves.
    exits: Vec<(u32, Exit)>,
    pub(super) corners: Vec<[f32; 3]>,
    pub(super) extent: f64,
    pub(super) off_plane: f64,
}

impl Portals {
    /// Makes the exits of all cells.
    pub(super) fn of(graph: &CellPortalGraph) -> Result<Self, SightError> {
        let mut portals = Self::default();
        for id in graph.portal_ids() {
            portals.add(id, graph)?;
        }
        for id in graph.special_ids() {
            portals.add_special(id, graph)?;
        }
        Ok(portals)
    }

    /// Returns the tolerance of answers, given the largest absolute coordinate of what is drawn.
    pub(super) fn tolerance(&self, extent: f64) -> f64 {
        // Snapping by a builder plus rounding in a file, for outline and wall each; `enfilade-verify` uses
        // the same bound.
        (2.0 * world_tolerance(extent.max(self.extent))).max(self.off_plane)
    }

    /// Adds a special portal as an exit of its cell.
    fn add_special(&mut self, id: SpecialId, graph: &CellPortalGraph) -> Result<(), SightError> {
        let side = &graph.specials[id.idx()];
        let (special, n_cells) = (id.0, graph.cells.len());
        let portal = side.portal();
        let is_known = side.cell.idx() < n_cells
            && portal.is_none_or(|p| {
                let portal = graph.portals.get(p.idx());
                portal.is_some_and(|p| p.cells.contains(&side.cell))
            })
            && (side.leads_to()).is_none_or(|(to, map)| to.idx() < n_cells && map.is_valid());
        let (normal, pieces) = if is_known {
            graph.special_opening(id)
        } else {
            (DVec3::ZERO, Vec::new())
        };
        let is_flat = |p: &Winding| p.points.len() < 3 || !p.points.iter().all(|p| p.is_finite());
        if normal == DVec3::ZERO || pieces.is_empty() || pieces.iter().any(is_flat) {
            return Err(SightError::Special { special });
        }
        let plane = Plane::through(pieces[0].mean(), normal);
        let portal = portal.map_or(NO_PORTAL, |p| p.0);
        for piece in &pieces {
            let Some(opening) = convex_of(&plane, &piece.points) else {
                continue;
            };
            let exit = self.add_outline(portal, &opening, normal);
            let to = SPECIAL | special;
            self.exits.push((side.cell.0, Exit { to, ..exit }));
        }
        Ok(())
    }

    fn add(&mut self, id: PortalId, graph: &CellPortalGraph) -> Result<(), SightError> {
        let (portal, n_cells) = (&graph[id], graph.cells.len());
        let cells = portal.cells.map(|c| c.0);
        if cells[0] == cells[1] || cells.iter().any(|&c| c as usize >= n_cells) {
            return Err(SightError::PortalCells {
                portal: id.0,
                cells,
                n_cells,
            });
        }
        let outline = || SightError::PortalOutline {
            portal: id.0,
            n_corners: portal.outline.len(),
        };
        let normal = point(portal.normal).try_normalize().ok_or_else(outline)?;
        let whole = convex(&portal.outline, normal).ok_or_else(outline)?;
        let pieces: Vec<Winding> = portal
            .pieces
            .iter()
            .filter_map(|p| convex(p, normal))
            .collect();
        // A piece without an area may be a sliver by rounding, and light passes it all the same.
        let is_whole = pieces.len() != portal.pieces.len();
        let area: f64 = pieces.iter().map(Winding::area).sum();
        let openings = if is_whole
            || pieces.is_empty()
            || pieces.len() > MAX_PIECES
            || area > PIECES_SHARE * whole.area()
        {
            vec![whole]
        } else {
            pieces
        };
        // A cell that sees a special side has no other way there, unless that side lets it through.
        let is_replaced = portal.cells.map(|cell| {
            let side = graph.special_side(id, cell);
            side.is_some_and(|s| !graph.specials[s.idx()].is_through())
        });
        for opening in openings {
            let exit = self.add_outline(id.0, &opening, normal);
            let turned = Exit {
                normal: exit.normal.map(|x| -x),
                is_turned: false,
                ..exit
            };
            for (side, exit) in [exit, turned].into_iter().enumerate() {
                if !is_replaced[side] {
                    let to = cells[1 - side];
                    self.exits.push((cells[side], Exit { to, ..exit }));
                }
            }
        }
        Ok(())
    }

    /// Adds the vertices of an outline, counter-clockwise about `normal`; returns an exit along the normal to nowhere.
    fn add_outline(&mut self, portal: u32, opening: &Winding, normal: DVec3) -> Exit {
        // Compute bounds from the rounded `f32` values, as they are read.
        let center = opening.aabb().center().as_vec3();
        let middle = center.as_dvec3();
        let first_corner = self.corners.len() as u32;
        let (mut radius, n_corners) = (0.0_f64, opening.points.len() as u32);
        for &p in &opening.points {
            radius = radius.max(p.distance(middle));
            self.off_plane = self.off_plane.max(normal.dot(p - middle).abs());
            self.extent = self.extent.max(p.abs().max_element());
            self.corners.push(p.as_vec3().to_array());
        }
        Exit {
            center: center.to_array(),
            radius: (radius as f32).next_up(),
            normal: normal.as_vec3().to_array(),
            to: SPECIAL,
            portal,
            first_corner,
            n_corners,
            is_turned: true,
        }
    }

    pub(super) fn by_cell(&mut self, n_cells: usize) -> (Vec<u32>, Vec<Exit>) {
        self.exits.sort_by_key(|(from, _)| *from);
        let mut first = vec![0; n_cells + 1];
        for (from, _) in &self.exits {
            first[*from as usize + 1] += 1;
        }
        for c in 0..n_cells {
            first[c + 1] += first[c];
        }
        (first, self.exits.iter().map(|(_, e)| *e).collect())
    }
}

/// Returns the convex polygon around points of a plane, counter-clockwise about `normal`, of at most
/// `MAX_CORNERS` vertices; `None` if it has no area, or a point is not finite.
fn convex(corners: &[[f32; 3]], normal: DVec3) -> Option<Winding> {
    if corners.len() < 3 || corners.iter().flatten().any(|x| !x.is_finite()) {
        return None;
    }
    let points: Vec<DVec3> = corners.iter().map(|p| point(*p)).collect();
    let middle = points.iter().sum::<DVec3>() / points.len() as f64;
    convex_of(&Plane::through(middle, normal), &points)
}

/// As [`convex`], for points of a plane.
fn convex_of(plane: &Plane, points: &[DVec3]) -> Option<Winding> {
    let hull = Winding::hull_in_plane(plane, points);
    // The tolerance covers vertices that rounding put off the hull.
    if hull.points.len() < 3 {
        return None;
    }
    if hull.points.len() <= MAX_CORNERS {
        return Some(hull);
    }
    let (u, v) = plane.basis();
    let middle = hull.mean();
    let flat: Vec<DVec2> = hull
        .points
        .iter()
        .map(|&p| DVec2::new(u.dot(p - middle), v.dot(p - middle)))
        .collect();
    let around = reduced_around(&flat, MAX_CORNERS);
    Some(Winding::new(
        around.iter().map(|p| middle + u * p.x + v * p.y).collect(),
    ))
}
