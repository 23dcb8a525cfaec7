//! Line of sight from point to point: the first triangle met, found cell by cell.
//!
//! A segment stays in its cell until it crosses a portal (*sealed*), and whatever it meets before
//! that is listed in the cell (*complete*); so the trees of the cells on its way answer, and these are
//! small. Picking, bullets and what one character sees of another (Gjørup 1999, sections 2.2.4 and
//! 3.3.4).
//!
//! **Equal to the tree of the whole world**, hit for hit. Both promises hold but for what is nearer
//! than a tolerance to an edge, so wherever anything is that near, the tree of the whole world is
//! asked instead: a segment that passes an edge of a triangle or the rim of an opening, starts in
//! matter, leaves a cell where no portal is, or meets a triangle that another of other cells overlaps.
//! The tests of triangles are the same in all trees, to the bit.

use std::ops::ControlFlow;

use enfilade_cpg::{CellId, Locator, PortalId, World};
use enfilade_geom::ray::segment_to_edges_distance;
use enfilade_geom::{Aabb, Bvh, DVec3, Plane, Ray, Triangle};

use crate::sight::point;
use crate::state::SightState;

/// Cells followed before the whole world's tree is asked; it is the faster one by then.
const MAX_CELLS: usize = 6;

const NONE: u32 = u32::MAX;

/// The first structural triangle on a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SightHit {
    /// Where along the segment, 0 to 1.
    pub t: f64,
    /// Index into `World::batches`.
    pub batch: u32,
    /// The triangle in its batch.
    pub triangle: u32,
    /// Whether its front was met: the side from which the corners run counter-clockwise.
    pub front: bool,
    /// The cell in which the segment ended; `None` where the whole world's tree was asked.
    pub cell: Option<CellId>,
}

/// The trees of one cell.
#[derive(Clone, Debug)]
struct CellTrees {
    walls: Bvh,
    /// Triangle of the world by triangle of `walls`, ascending: ties are broken alike.
    triangle_of: Vec<u32>,
    /// Fans over the openings of the portals.
    openings: Bvh,
    /// Portal, and whether the edges of the fan's triangle are the opening's rim.
    opening_of: Vec<(u32, u32, [bool; 3])>,
}

/// A world made ready for lines of sight. Apart from [`Sight`](crate::Sight), because it holds the
/// triangles themselves: about 150 bytes each, more for those that several cells see.
#[derive(Clone, Debug)]
pub struct Sightlines {
    locator: Locator,
    whole: Bvh,
    /// Batch and number in it.
    source: Vec<(u32, u32)>,
    /// Overlapped by a triangle that other cells list.
    is_doubtful: Vec<bool>,
    cells: Vec<CellTrees>,
    near: f64,
}

/// How following a segment ended.
enum Walk {
    /// What it met (`t`, triangle, front), and the cell where it ended.
    Sure(Option<(f64, u32, bool)>, u32),
    Doubtful,
}

impl Sightlines {
    /// Makes a valid world ready: O(n log n) in its triangles.
    #[must_use]
    pub fn build(world: &World) -> Self {
        let mut triangles: Vec<Triangle> = Vec::new();
        let mut source = Vec::new();
        let mut by_cell: Vec<Vec<u32>> = vec![Vec::new(); world.graph.cells.len()];
        for (b, batch) in world.batches.iter().enumerate() {
            let p = &batch.primitive;
            for (i, t) in p.indices.chunks_exact(3).enumerate() {
                for c in &batch.cells {
                    by_cell[c.0 as usize].push(triangles.len() as u32);
                }
                triangles.push([0, 1, 2].map(|k| point(p.positions[t[k] as usize])));
                source.push((b as u32, i as u32));
            }
        }
        let whole = Bvh::build(&triangles);
        let bounds = whole.bounds();
        let extent = if bounds.is_empty() {
            0.0
        } else {
            bounds.min.abs().max(bounds.max.abs()).max_element()
        };
        // As for `Sight`: twice what a builder may snap.
        let near = 2.0 * (4e-7 * extent).max(2e-5);
        let cells = by_cell
            .iter()
            .enumerate()
            .map(|(c, list)| CellTrees::new(world, c, list, &triangles))
            .collect();
        let is_doubtful = doubtful(world, &triangles, &source, &whole, near);
        Self {
            locator: world.graph.locator.clone(),
            whole,
            source,
            is_doubtful,
            cells,
            near,
        }
    }

    /// The first structural triangle on the closed segment from `a` to `b`, as the tree of the whole
    /// world would give it. Details do not count. `None` also for points that are not finite.
    #[must_use]
    pub fn first_hit(&self, a: [f32; 3], b: [f32; 3]) -> Option<SightHit> {
        let (a, b) = (point(a), point(b));
        let (hit, cell) = match self.walk(a, b) {
            Walk::Sure(hit, cell) => (hit, Some(CellId(cell))),
            Walk::Doubtful => (self.hit_of_whole(a, b), None),
        };
        hit.map(|(t, triangle, front)| {
            let (batch, index) = self.source[triangle as usize];
            SightHit {
                t,
                batch,
                triangle: index,
                front,
                cell,
            }
        })
    }

    /// The same from the tree of the whole world alone; for comparison.
    #[must_use]
    pub fn first_hit_of_whole(&self, a: [f32; 3], b: [f32; 3]) -> Option<SightHit> {
        let hit = self.hit_of_whole(point(a), point(b));
        hit.map(|(t, triangle, front)| {
            let (batch, index) = self.source[triangle as usize];
            SightHit {
                t,
                batch,
                triangle: index,
                front,
                cell: None,
            }
        })
    }

    /// Whether a segment meets neither a structural triangle nor a portal that is closed in `state`.
    #[must_use]
    pub fn is_clear(&self, state: &SightState, a: [f32; 3], b: [f32; 3]) -> bool {
        self.first_hit(a, b).is_none() && !self.meets_closed(state, point(a), point(b))
    }

    fn meets_closed(&self, state: &SightState, a: DVec3, b: DVec3) -> bool {
        let ray = Ray::segment(a, b);
        let (mut t, mut came_by) = (0.0, NONE);
        let mut cell = self.locator.locate(a).map(|c| c.0);
        while let Some(from) = cell {
            let Some((at, portal, to)) = self.next_opening(from, &ray, t, came_by) else {
                return false;
            };
            if !state.is_open(PortalId(portal)) {
                return true;
            }
            // Every step is farther along, so it ends.
            (t, came_by, cell) = (at.next_up(), portal, Some(to));
        }
        false
    }

    fn hit_of_whole(&self, a: DVec3, b: DVec3) -> Option<(f64, u32, bool)> {
        let hit = self.whole.closest_hit(&Ray::segment(a, b), |_| false)?;
        Some((hit.t, hit.triangle, hit.front))
    }

    /// The first opening of a cell from `t` on, but for the portal come by: where, its portal, and
    /// the cell behind.
    fn next_opening(&self, cell: u32, ray: &Ray, t: f64, came_by: u32) -> Option<(f64, u32, u32)> {
        let trees = &self.cells[cell as usize];
        let mut first: Option<(f64, u32)> = None;
        trees.openings.for_each_hit(ray, |hit| {
            // A straight line crosses a portal once.
            let is_new = trees.opening_of[hit.triangle as usize].0 != came_by;
            if is_new && hit.t >= t && first.is_none_or(|f| (hit.t, hit.triangle) < f) {
                first = Some((hit.t, hit.triangle));
            }
        });
        let (at, triangle) = first?;
        let (portal, to, _) = trees.opening_of[triangle as usize];
        Some((at, portal, to))
    }

    /// Follows the segment from cell to cell.
    fn walk(&self, a: DVec3, b: DVec3) -> Walk {
        let length = a.distance(b);
        if length.is_nan() || length <= 16.0 * self.near {
            return Walk::Doubtful;
        }
        let Some(start) = self.locator.locate(a) else {
            return Walk::Doubtful;
        };
        let ray = Ray::segment(a, b);
        let (mut cell, mut came_by) = (start.0, NONE);
        // Events nearer to each other than this may be in the other order.
        let step = 4.0 * self.near / length;
        let mut t = 0.0;
        for _ in 0..MAX_CELLS {
            let trees = &self.cells[cell as usize];
            let hit = trees.walls.closest_hit(&ray, |_| false);
            // What the cell lists and the segment met before it came here would have been in its way.
            if hit.is_some_and(|h| h.t < t + step) {
                return Walk::Doubtful;
            }
            let exit = self.next_opening(cell, &ray, t - step, came_by);
            if exit.is_some_and(|e| e.0 < t + step || e.0 > 1.0 - step) {
                return Walk::Doubtful;
            }
            let exit = match (exit, hit) {
                (Some(e), Some(h)) if (e.0 - h.t).abs() < step => return Walk::Doubtful,
                (Some(e), Some(h)) if e.0 > h.t => None,
                (exit, _) => exit,
            };
            let until = exit.map_or(hit.map_or(1.0, |h| h.t), |e| e.0);
            if self.is_near_edge(trees, &ray, t, until) {
                return Walk::Doubtful;
            }
            if let Some((at, portal, to)) = exit {
                (t, came_by, cell) = (at, portal, to);
                continue;
            }
            let Some(hit) = hit else {
                // Nothing met to the end: the end must be in this cell.
                if self.locator.locate(b) != Some(CellId(cell)) {
                    return Walk::Doubtful;
                }
                return Walk::Sure(None, cell);
            };
            let triangle = trees.triangle_of[hit.triangle as usize];
            if self.is_doubtful[triangle as usize] {
                return Walk::Doubtful;
            }
            return Walk::Sure(Some((hit.t, triangle, hit.front)), cell);
        }
        Walk::Doubtful
    }

    /// Whether the ray passes an edge of a wall or the rim of an opening of the cell within the
    /// tolerance, from `t` to `until`.
    fn is_near_edge(&self, trees: &CellTrees, ray: &Ray, t: f64, until: f64) -> bool {
        let past = 2.0 * self.near / ray.direction.length();
        let (a, b) = (ray.at((t - past).max(0.0)), ray.at(until + past));
        let near = self.near;
        let walls = trees
            .walls
            .for_each_around_segment(a, b, near, |_, triangle| {
                if is_near_edges(a, b, triangle, near) {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            });
        let rims = trees
            .openings
            .for_each_around_segment(a, b, near, |i, triangle| {
                let (_, _, is_rim) = trees.opening_of[i as usize];
                for k in (0..3).filter(|&k| is_rim[k]) {
                    let edge = [triangle[k], triangle[(k + 1) % 3], triangle[(k + 1) % 3]];
                    if segment_to_edges_distance(a, b, &edge) < near {
                        return ControlFlow::Break(());
                    }
                }
                ControlFlow::Continue(())
            });
        walls.is_break() || rims.is_break()
    }
}

/// Whether a segment is nearer than `near` to an edge of a triangle.
fn is_near_edges(a: DVec3, b: DVec3, t: &Triangle, near: f64) -> bool {
    // Far from the plane with both ends on one side: far from the edges.
    let n = (t[1] - t[0]).cross(t[2] - t[0]);
    let (da, db) = (n.dot(a - t[0]), n.dot(b - t[0]));
    if da * db > 0.0 && da.abs().min(db.abs()) > 1.001 * near * n.length() {
        return false;
    }
    segment_to_edges_distance(a, b, t) < near
}

impl CellTrees {
    fn new(world: &World, cell: usize, list: &[u32], triangles: &[Triangle]) -> Self {
        let own: Vec<Triangle> = list.iter().map(|&i| triangles[i as usize]).collect();
        let mut fans = Vec::new();
        let mut opening_of = Vec::new();
        for id in &world.graph.cells[cell].portals {
            let portal = &world.graph.portals[id.0 as usize];
            let to = portal.cells[usize::from(portal.cells[0].0 as usize == cell)].0;
            for piece in &portal.pieces {
                let n = piece.len();
                for k in 1..n.saturating_sub(1) {
                    fans.push([piece[0], piece[k], piece[k + 1]].map(point));
                    opening_of.push((id.0, to, [k == 1, true, k + 2 == n]));
                }
            }
        }
        Self {
            walls: Bvh::build(&own),
            triangle_of: list.to_vec(),
            openings: Bvh::build(&fans),
            opening_of,
        }
    }
}

/// Which triangles are overlapped, in their plane, by one that other cells list: a segment meets both
/// at once, and which comes first is not for one cell to say.
fn doubtful(
    world: &World,
    triangles: &[Triangle],
    source: &[(u32, u32)],
    whole: &Bvh,
    near: f64,
) -> Vec<bool> {
    let cells = |i: u32| &world.batches[source[i as usize].0 as usize].cells;
    (0..triangles.len() as u32)
        .map(|i| {
            let t = &triangles[i as usize];
            let Some(plane) = Plane::of_triangle(t) else {
                return true;
            };
            let mut is_doubtful = false;
            whole.for_each_in_box(&Aabb::of_points(t).expanded(4.0 * near), |j| {
                let other = &triangles[j as usize];
                is_doubtful |= i != j
                    && cells(i) != cells(j)
                    && other
                        .iter()
                        .all(|&p| plane.signed_distance(p).abs() < 4.0 * near)
                    && overlap_in_plane(&plane, t, other, near);
            });
            is_doubtful
        })
        .collect()
}

/// Whether two triangles of a plane overlap by more than `near`: no edge has them on two sides.
fn overlap_in_plane(plane: &Plane, a: &Triangle, b: &Triangle, near: f64) -> bool {
    let apart = |t: &Triangle, other: &Triangle| {
        (0..3).any(|k| {
            let along = t[(k + 1) % 3] - t[k];
            let mut out = along.cross(plane.normal).normalize_or_zero();
            // Away from the third corner.
            if out.dot(t[(k + 2) % 3] - t[k]) > 0.0 {
                out = -out;
            }
            other.iter().all(|&p| out.dot(p - t[k]) > -near)
        })
    };
    !apart(a, b) && !apart(b, a)
}
