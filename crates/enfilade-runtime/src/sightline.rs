//! Lines of sight from point to point: the first triangle hit, found cell by cell.
//!
//! A segment stays in its cell until it crosses a portal (*sealed*), and everything it meets before
//! that is listed in the cell (*complete*); so the small trees of the cells on its way suffice. For
//! picking, bullets, and visibility between characters (Gjørup 1999, sections 2.2.4 and 3.3.4).
//!
//! **Equal to the tree of the whole world**, hit for hit. Both promises hold except within a tolerance
//! of an edge, so wherever anything is that near, the tree of the whole world is queried instead: if a
//! segment passes an edge of a triangle or the rim of an opening, starts in solid matter, leaves a cell
//! where no portal is, or meets a triangle overlapped by another of other cells. The triangle tests are
//! identical in all trees, to the bit.

use std::sync::Arc;

use enfilade_cpg::{CellId, Locator, World};
use enfilade_geom::ray::hit_triangle;
use enfilade_geom::{Aabb, Bvh, DVec2, DVec3, Plane, Ray, Triangle, world_tolerance};

use crate::boxes::{BoxRay, BoxTrees, Boxed, Root};
use crate::details::Details;
use crate::point::point;

/// Cells followed before falling back to the whole world's tree, which is faster by then.
const MAX_CELLS: usize = 6;

const NONE: u32 = u32::MAX;

/// The first structural triangle on a segment, from [`Sightlines::first_hit`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SightHit {
    /// Parameter along the segment, 0 to 1.
    pub t: f64,
    /// Index into `World::batches`.
    pub batch: u32,
    /// Index of the triangle in its batch.
    pub triangle: u32,
    /// True if its front was hit, from which its vertices run counter-clockwise.
    pub front: bool,
    /// The cell in which the segment ended, if following it from cell to cell was unambiguous.
    pub cell: Option<CellId>,
}

/// A triangle of an opening.
#[derive(Clone, Debug)]
pub(crate) struct Opening {
    pub(crate) corners: Triangle,
    pub(crate) portal: u32,
    /// The two cells.
    cells: [u32; 2],
    /// Per edge, opposite each vertex: true if it is on the opening's rim.
    is_rim: [bool; 3],
}

/// Longest segment followed from cell to cell, in tolerances: `f64` rounds positions along it to a thousandth of one.
const LONGEST: f64 = 1e12;

/// Marks an item that is an opening, not a wall.
const OPENING: u32 = 1 << 30;

/// A world prepared for lines of sight. Separate from [`Sight`](crate::Sight), because it holds the triangles
/// themselves: about 150 bytes each, more for those seen by several cells; those of a detail mesh once, however
/// often it is placed.
#[derive(Clone, Debug)]
pub struct Sightlines {
    pub(crate) locator: Arc<Locator>,
    pub(crate) whole: Bvh,
    /// Per triangle: batch, and index in it.
    pub(crate) source: Vec<(u32, u32)>,
    /// Per triangle: true if one listed by other cells overlaps it.
    is_doubtful: Vec<bool>,
    /// All walls; the trees of the cells refer to them.
    pub(crate) triangles: Vec<Triangle>,
    pub(crate) openings: Vec<Opening>,
    /// Tree over the openings.
    pub(crate) shut: Bvh,
    pub(crate) details: Details,
    trees: BoxTrees,
    /// Per cell: root over its walls and openings.
    roots: Vec<Root>,
    near: f64,
}

/// Outcome of following a segment.
enum Walk {
    /// The hit, if any (`t`, triangle, front), and the cell where it ended.
    Sure(Option<(f64, u32, bool)>, u32),
    Doubtful,
}

impl Sightlines {
    /// Prepares a valid world for [`Sightlines::pick`] and [`Sightlines::is_clear`]. O(n log n) in its triangles.
    #[must_use]
    pub fn build(world: &World) -> Self {
        let mut triangles: Vec<Triangle> = Vec::new();
        let mut source = Vec::new();
        let mut by_cell: Vec<Vec<u32>> = vec![Vec::new(); world.graph.cells.len()];
        for (b, batch) in world.batches.iter().enumerate() {
            for (i, t) in (0..).zip(batch.primitive.triangles()) {
                for c in &batch.cells {
                    by_cell[c.idx()].push(triangles.len() as u32);
                }
                triangles.push(t);
                source.push((b as u32, i));
            }
        }
        let whole = Bvh::build(&triangles);
        let extent = whole.bounds().extent();
        // As for `Sight`: twice the snapping of a builder.
        let near = 2.0 * world_tolerance(extent);
        let mut openings = Vec::new();
        let mut opening_boxes: Vec<Vec<u32>> = vec![Vec::new(); by_cell.len()];
        for (i, portal) in world.graph.portals.iter().enumerate() {
            for piece in &portal.pieces {
                let n = piece.len();
                for k in 1..n.saturating_sub(1) {
                    for c in portal.cells {
                        opening_boxes[c.idx()].push(openings.len() as u32);
                    }
                    openings.push(Opening {
                        corners: [piece[0], piece[k], piece[k + 1]].map(point),
                        portal: i as u32,
                        cells: portal.cells.map(|c| c.0),
                        is_rim: [true, k + 2 == n, k == 1],
                    });
                }
            }
        }
        let mut trees = BoxTrees::default();
        // Twice the tolerance, because the edge test measures at a slant; plus the rounding of `f32`.
        let margin = 2.0 * near + extent * (1.0 / 1_048_576.0);
        let roots = by_cell
            .iter()
            .zip(&opening_boxes)
            .map(|(walls, fans)| {
                let boxed = |t: &Triangle, item: u32| Boxed {
                    bounds: Aabb::of_points(t),
                    item,
                };
                let walls = walls.iter().map(|&i| boxed(&triangles[i as usize], i));
                let fans = fans
                    .iter()
                    .map(|&i| boxed(&openings[i as usize].corners, i | OPENING));
                let mut items: Vec<Boxed> = walls.chain(fans).collect();
                trees.add(&mut items, margin)
            })
            .collect();
        let is_doubtful = doubtful(world, &triangles, &source, &whole, near);
        Self {
            locator: world.graph.locator.clone(),
            whole,
            source,
            is_doubtful,
            triangles,
            shut: Bvh::build(&openings.iter().map(|o| o.corners).collect::<Vec<_>>()),
            details: Details::build(world),
            openings,
            trees,
            roots,
            near,
        }
    }

    /// Returns the first structural triangle on the closed segment from `a` to `b`; `None` for points that are
    /// not finite. Ignores details.
    ///
    /// Uses one tree over the whole world, which measured faster than following the segment from cell to
    /// cell (`docs/benchmarks/sight.md`).
    #[must_use]
    #[doc(hidden)]
    pub fn first_hit(&self, a: [f32; 3], b: [f32; 3]) -> Option<SightHit> {
        self.hit_of_whole(point(a), point(b))
            .map(|hit| self.named(hit.0, hit.1, hit.2, None))
    }

    /// As [`Sightlines::first_hit`], by following the segment from cell to cell; also reports the cell where it ends.
    #[must_use]
    #[doc(hidden)]
    pub fn first_hit_by_cells(&self, a: [f32; 3], b: [f32; 3]) -> Option<SightHit> {
        let (a, b) = (point(a), point(b));
        match self.walk(a, b) {
            Walk::Sure(hit, cell) => {
                hit.map(|hit| self.named(hit.0, hit.1, hit.2, Some(CellId(cell))))
            }
            Walk::Doubtful => self
                .hit_of_whole(a, b)
                .map(|hit| self.named(hit.0, hit.1, hit.2, None)),
        }
    }

    fn named(&self, t: f64, triangle: u32, front: bool, cell: Option<CellId>) -> SightHit {
        let (batch, triangle) = self.source[triangle as usize];
        SightHit {
            t,
            batch,
            triangle,
            front,
            cell,
        }
    }

    fn hit_of_whole(&self, a: DVec3, b: DVec3) -> Option<(f64, u32, bool)> {
        let hit = self.whole.closest_hit(&Ray::segment(a, b), |_| false)?;
        Some((hit.t, hit.triangle, hit.front))
    }

    /// Returns the first hits of the ray in one cell beyond `from`, except on the portal entered by.
    fn events(&self, cell: u32, look: &Look, from: f64, came_by: u32) -> Events {
        let mut found = Events {
            wall: (f64::INFINITY, NONE),
            next_wall: f64::INFINITY,
            opening: (f64::INFINITY, NONE),
            edge: f64::INFINITY,
        };
        let root = self.roots[cell as usize];
        let limit = |found: &Events| {
            let until = found.wall.0.min(found.opening.0).min(1.0);
            (until + look.step) as f32 * (1.0 + 1e-6)
        };
        let first = limit(&found);
        self.trees
            .for_each_on_ray(root, &look.boxes, first, |item| {
                if item & OPENING == 0 {
                    match look.meet(&self.triangles[item as usize], self.near, [true; 3]) {
                        Met::Nothing => {}
                        Met::Edge(low, high) => found.add_edge(low, high, from),
                        Met::Inside(t) => {
                            if t < found.wall.0 {
                                found.next_wall = found.wall.0;
                                found.wall = (t, item);
                            } else {
                                found.next_wall = found.next_wall.min(t);
                            }
                        }
                    }
                } else {
                    let opening = &self.openings[(item & !OPENING) as usize];
                    match look.meet(&opening.corners, self.near, opening.is_rim) {
                        Met::Nothing => {}
                        Met::Edge(low, high) => found.add_edge(low, high, from),
                        // A straight line crosses a portal once.
                        Met::Inside(t) if opening.portal != came_by && t >= from => {
                            if t < found.opening.0 {
                                found.opening = (t, item & !OPENING);
                            }
                        }
                        Met::Inside(_) => {}
                    }
                }
                limit(&found)
            });
        found
    }

    /// Follows the segment from cell to cell.
    fn walk(&self, a: DVec3, b: DVec3) -> Walk {
        let ray = Ray::segment(a, b);
        let Some(look) = Look::new(&ray, self.near) else {
            return Walk::Doubtful;
        };
        let Some(start) = self.locator.locate(a) else {
            return Walk::Doubtful;
        };
        let (mut cell, mut came_by) = (start.0, NONE);
        let step = look.step;
        let mut t = 0.0;
        for _ in 0..MAX_CELLS {
            let found = self.events(cell, &look, t - step, came_by);
            let until = found.wall.0.min(found.opening.0).min(1.0);
            let is_doubtful = found.edge <= until + step
                // A wall or opening of this cell hit before entry should have stopped the segment.
                || found.wall.0 < t + step
                || found.opening.0 < t + step
                // Two at once.
                || (found.wall.0 - found.opening.0).abs() < step
                || (found.opening.0 - 1.0).abs() < step
                || (found.next_wall - found.wall.0) < 1e-3 * step;
            if is_doubtful {
                return Walk::Doubtful;
            }
            if found.opening.0 < found.wall.0.min(1.0) {
                let opening = &self.openings[found.opening.1 as usize];
                (t, came_by, cell) = (found.opening.0, opening.portal, opening.other(cell));
                continue;
            }
            // The same test as in the whole world's tree.
            let hit = self
                .triangles
                .get(found.wall.1 as usize)
                .and_then(|t| hit_triangle(&ray, t));
            let Some(hit) = hit else {
                if found.wall.0 < 1.0 || self.locator.locate(b) != Some(CellId(cell)) {
                    return Walk::Doubtful;
                }
                return Walk::Sure(None, cell);
            };
            if self.is_doubtful[found.wall.1 as usize] {
                return Walk::Doubtful;
            }
            return Walk::Sure(Some((hit.t, found.wall.1, hit.front)), cell);
        }
        Walk::Doubtful
    }
}

impl Opening {
    fn other(&self, cell: u32) -> u32 {
        self.cells[usize::from(self.cells[0] == cell)]
    }
}

/// First hits of a ray in one cell, each the least `t`.
struct Events {
    wall: (f64, u32),
    next_wall: f64,
    opening: (f64, u32),
    edge: f64,
}

impl Events {
    fn add_edge(&mut self, low: f64, high: f64, from: f64) {
        if high >= from {
            self.edge = self.edge.min(low.max(from));
        }
    }
}

/// Intersection of a ray with a triangle.
enum Met {
    Nothing,
    /// Passes an edge within the tolerance, for `t` between these.
    Edge(f64, f64),
    /// Hits the interior at about this `t`.
    Inside(f64),
}

/// A segment prepared for triangle tests, sheared as in `enfilade_geom::ray`.
struct Look {
    boxes: BoxRay,
    origin: [f64; 3],
    axes: [usize; 3],
    shear: [f64; 3],
    /// Differences in `t` below this do not decide an order.
    step: f64,
}

impl Look {
    /// `None` if the segment is not longer than a few tolerances, is so long that rounding exceeds those, or is not
    /// finite.
    fn new(ray: &Ray, near: f64) -> Option<Self> {
        let d = ray.direction;
        let length = d.length();
        let is_usual = length > 16.0 * near && length < LONGEST * near;
        if !is_usual {
            return None;
        }
        let a = d.abs();
        let kz = if a.x >= a.y && a.x >= a.z {
            0
        } else if a.y >= a.z {
            1
        } else {
            2
        };
        let (kx, ky) = ((kz + 1) % 3, (kz + 2) % 3);
        let inverse = 1.0 / d[kz];
        Some(Self {
            boxes: BoxRay::new(ray.origin, d),
            origin: ray.origin.to_array(),
            axes: [kx, ky, kz],
            shear: [d[kx] * inverse, d[ky] * inverse, inverse],
            step: 4.0 * near / length,
        })
    }

    #[inline]
    fn meet(&self, t: &Triangle, near: f64, is_rim: [bool; 3]) -> Met {
        let [kx, ky, kz] = self.axes;
        let [sx, sy, sz] = self.shear;
        let o = &self.origin;
        let p = t.map(|p| {
            let z = p[kz] - o[kz];
            (
                DVec2::new(p[kx] - o[kx] - sx * z, p[ky] - o[ky] - sy * z),
                z,
            )
        });
        // Twice the area beside each edge, each opposite its vertex.
        let beside = |i: usize, j: usize| p[j].0.perp_dot(p[i].0);
        let side = [beside(2, 1), beside(0, 2), beside(1, 0)];
        let det = side[0] + side[1] + side[2];
        let sign = if det < 0.0 { -1.0 } else { 1.0 };
        // The shear measures along a coordinate plane: up to √3 times the perpendicular distance. Squared.
        let reach2 = 3.0625 * near * near;
        let mut is_edge = false;
        for k in 0..3 {
            let d = p[(k + 1) % 3].0 - p[(k + 2) % 3].0;
            let out = sign * side[k];
            let is_clear = out * out > reach2 * d.length_squared();
            if out < 0.0 && is_clear {
                return Met::Nothing;
            }
            is_edge |= is_rim[k] && !is_clear;
        }
        let (low, high) = (
            p[0].1.min(p[1].1).min(p[2].1),
            p[0].1.max(p[1].1).max(p[2].1),
        );
        let (low, high) = if sz < 0.0 {
            (high * sz, low * sz)
        } else {
            (low * sz, high * sz)
        };
        let at = (side[0] * p[0].1 + side[1] * p[1].1 + side[2] * p[2].1) * sz / det;
        // Along the plane, `t` is rounding noise: anywhere on the triangle.
        let is_steep = det.abs()
            > 1e-3
                * (p[0].0 - p[1].0)
                    .length_squared()
                    .max((p[0].0 - p[2].0).length_squared())
                * 1e-3;
        if !is_steep || !at.is_finite() {
            return if high < -self.step || low > 1.0 + self.step {
                Met::Nothing
            } else {
                Met::Edge(low, high)
            };
        }
        if at < -self.step || at > 1.0 + self.step {
            return Met::Nothing;
        }
        if is_edge {
            return Met::Edge(at - self.step, at + self.step);
        }
        Met::Inside(at)
    }
}

/// Per triangle, `true` if one listed by other cells overlaps it in its plane: a segment meets both at
/// once, and a single cell cannot decide which comes first.
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

/// Returns `true` if two coplanar triangles overlap by more than `near`, so that no edge separates them.
fn overlap_in_plane(plane: &Plane, a: &Triangle, b: &Triangle, near: f64) -> bool {
    let apart = |t: &Triangle, other: &Triangle| {
        (0..3).any(|k| {
            let along = t[(k + 1) % 3] - t[k];
            let mut out = along.cross(plane.normal).normalize_or_zero();
            // Away from the third vertex.
            if out.dot(t[(k + 2) % 3] - t[k]) > 0.0 {
                out = -out;
            }
            other.iter().all(|&p| out.dot(p - t[k]) > -near)
        })
    };
    !apart(a, b) && !apart(b, a)
}
