//! The world under test, prepared for many rays.

use std::ops::ControlFlow;

use enfilade_cpg::{CellId, Locator, PortalId, World};
use enfilade_geom::ray::{segment_distance_squared, segment_to_edges_distance};
use enfilade_geom::{Aabb, Bvh, DVec3, Plane, Ray, Triangle, world_tolerance};

use crate::options::VerifyOptions;
use crate::rng::Rng;

/// Points tried in a cell's box to estimate the share of it that the cell fills.
const PROBES: usize = 4096;
/// Points kept for a cell that fills little of its box.
const POOL: usize = 512;
/// Attempts in the box of a cell that fills more than `POOL / PROBES` of it.
const TRIES: usize = 24;

/// Returns `max(2e-5 m, 4e-7 · extent)`, where extent is the largest absolute coordinate: the distance up to which a
/// builder may snap planes and an `f32` file may round. [Units: wu]
#[must_use]
pub fn tolerance(bounds: &Aabb) -> f64 {
    world_tolerance(bounds.extent())
}

/// Returns all structural triangles of a world with the batch of each, in order of batch and index.
///
/// # Panics
///
/// If an index is out of range; `World::validate` finds that.
#[must_use]
pub fn structural_triangles(world: &World) -> Vec<(Triangle, u32)> {
    let mut out = Vec::new();
    for (i, batch) in world.batches.iter().enumerate() {
        out.extend(batch.primitive.triangles().map(|t| (t, i as u32)));
    }
    out
}

pub(crate) fn to_dvec(p: [f32; 3]) -> DVec3 {
    DVec3::new(p[0].into(), p[1].into(), p[2].into())
}

/// One triangle of the fan over a portal's piece.
struct PortalTriangle {
    corners: Triangle,
    portal: PortalId,
    /// For each edge (the first starts at vertex 0), true if it is the piece's own, not a diagonal of the fan.
    is_rim: [bool; 3],
}

/// The part of a portal that rays need.
pub(crate) struct PortalView {
    pub(crate) cells: [CellId; 2],
    pub(crate) normal: DVec3,
    /// Its triangles in [`Subject::portal_triangles`].
    pub(crate) fan: std::ops::Range<usize>,
    /// For each of its cells, `true` if one does not look through it from there.
    pub(crate) is_closed: [bool; 2],
}

/// Returns `true` if a special portal that does not let through covers a portal's side in a cell.
pub(crate) fn is_closed(world: &World, portal: PortalId, cell: CellId) -> bool {
    let special = world.graph.special_side(portal, cell);
    special.is_some_and(|s| !world.graph.specials[s.idx()].is_through())
}

/// A crossing of a portal by a segment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crossing {
    pub(crate) t: f64,
    pub(crate) portal: PortalId,
    /// True along the portal's normal: from the first cell to the second.
    pub(crate) is_forward: bool,
    /// Possible shift of `t` if the portal's plane moves by `2 eps`.
    slack: f64,
}

pub(crate) struct CellView {
    pub(crate) bounds: Aabb,
    /// Points in the cell, for cells that random points of their box rarely hit.
    pool: Vec<DVec3>,
    /// True if drawing from the box is hopeless.
    is_sparse: bool,
}

/// The world under test.
pub(crate) struct Subject<'a> {
    pub(crate) world: &'a World,
    pub(crate) locator: &'a Locator,
    pub(crate) eps: f64,
    pub(crate) has_source: bool,
    /// The triangles that block.
    pub(crate) triangles: Vec<Triangle>,
    pub(crate) blockers: Bvh,
    /// The world's own triangles with their batches.
    pub(crate) own: Vec<(Triangle, u32)>,
    /// Tree over `own`; `None` if those block.
    own_bvh: Option<Bvh>,
    portal_triangles: Vec<PortalTriangle>,
    portal_bvh: Bvh,
    pub(crate) portals: Vec<PortalView>,
    pub(crate) cells: Vec<CellView>,
    /// Cells in which a point was found, ascending.
    pub(crate) sampled: Vec<CellId>,
    /// Portals with a piece, ascending.
    pub(crate) crossable: Vec<PortalId>,
    /// Box from which uniform points are drawn.
    pub(crate) padded: Aabb,
}

impl<'a> Subject<'a> {
    pub(crate) fn new(
        world: &'a World,
        source: Option<&[Triangle]>,
        options: &VerifyOptions,
    ) -> Self {
        let own = structural_triangles(world);
        let own_triangles: Vec<Triangle> = own.iter().map(|t| t.0).collect();
        let (triangles, own_bvh) = match source {
            Some(source) => {
                // Seals are matter, although no model contains them.
                let is_seal = |t: &&(Triangle, u32)| world.batches[t.1 as usize].is_seal;
                let seals = own.iter().filter(is_seal).map(|t| t.0);
                let all = source.iter().copied().chain(seals).collect();
                (all, Some(Bvh::build(&own_triangles)))
            }
            None => (own_triangles, None),
        };
        let blockers = Bvh::build(&triangles);
        let mut portal_triangles = Vec::new();
        let mut portals = Vec::new();
        for (i, portal) in world.graph.portals.iter().enumerate() {
            let first = portal_triangles.len();
            for piece in &portal.pieces {
                let n = piece.len();
                for k in 1..n.saturating_sub(1) {
                    portal_triangles.push(PortalTriangle {
                        corners: [piece[0], piece[k], piece[k + 1]].map(to_dvec),
                        portal: PortalId(i as u32),
                        is_rim: [k == 1, true, k + 2 == n],
                    });
                }
            }
            portals.push(PortalView {
                cells: portal.cells,
                normal: to_dvec(portal.normal),
                fan: first..portal_triangles.len(),
                is_closed: portal
                    .cells
                    .map(|cell| is_closed(world, PortalId(i as u32), cell)),
            });
        }
        let fans: Vec<Triangle> = portal_triangles.iter().map(|t| t.corners).collect();
        let portal_bvh = Bvh::build(&fans);
        let bounds = blockers.bounds().union(portal_bvh.bounds());
        let padded = if bounds.is_empty() {
            Aabb::new(DVec3::ZERO, DVec3::ONE)
        } else {
            bounds.expanded(0.05 * bounds.size().max_element() + 0.1)
        };
        let mut this = Self {
            world,
            locator: &world.graph.locator,
            eps: options.tolerance.unwrap_or_else(|| tolerance(&bounds)),
            has_source: source.is_some(),
            triangles,
            blockers,
            own,
            own_bvh,
            portal_triangles,
            portal_bvh,
            crossable: (0..portals.len())
                .filter(|&i| !portals[i].fan.is_empty())
                .map(|i| PortalId(i as u32))
                .collect(),
            portals,
            cells: Vec::new(),
            sampled: Vec::new(),
            padded,
        };
        this.probe_cells(options.seed);
        this
    }

    /// Finds points in each cell.
    fn probe_cells(&mut self, seed: u64) {
        for (i, cell) in self.world.graph.cells.iter().enumerate() {
            let id = CellId(i as u32);
            let bounds = Aabb::new(to_dvec(cell.aabb[0]), to_dvec(cell.aabb[1]));
            // Chunk numbers of rays count up from 0, these down from the other end.
            let mut rng = Rng::new(seed, u64::MAX - i as u64);
            let mut pool = Vec::new();
            for _ in 0..PROBES {
                let p = point_in(&mut rng, &bounds);
                if pool.len() < POOL && self.locator.locate(p) == Some(id) {
                    pool.push(p);
                }
            }
            let is_sparse = pool.len() < POOL;
            // A cell too thin for random points begins behind its portals.
            for portal in cell
                .portals
                .iter()
                .filter(|p| (p.0 as usize) < self.portals.len())
            {
                let view = &self.portals[portal.0 as usize];
                if view.fan.is_empty() || pool.len() >= POOL {
                    continue;
                }
                for _ in 0..64 {
                    let away = rng.sign() * rng.log_range(10.0 * self.eps, 1.0);
                    let p = self.point_of_portal(&mut rng, *portal) + view.normal * away;
                    if self.locator.locate(p) == Some(id) {
                        pool.push(p);
                    }
                }
            }
            if !pool.is_empty() {
                self.sampled.push(id);
            }
            self.cells.push(CellView {
                bounds,
                pool,
                is_sparse,
            });
        }
    }

    pub(crate) fn cell_name(&self, cell: CellId) -> &str {
        &self.world.graph[cell].name
    }

    /// Returns a point of a cell in `sampled`.
    pub(crate) fn point_in_cell(&self, rng: &mut Rng, cell: CellId) -> DVec3 {
        let view = &self.cells[cell.0 as usize];
        if !view.is_sparse {
            for _ in 0..TRIES {
                let p = point_in(rng, &view.bounds);
                if self.locator.locate(p) == Some(cell) {
                    return p;
                }
            }
        }
        let base = view.pool[rng.below(view.pool.len())];
        // Move it randomly, so that a small pool still gives many points.
        let p = base + rng.direction() * rng.log_range(self.eps, 0.3);
        if self.locator.locate(p) == Some(cell) {
            p
        } else {
            base
        }
    }

    /// Returns a point uniform over the pieces' fan triangles of a portal in `crossable`.
    pub(crate) fn point_of_portal(&self, rng: &mut Rng, portal: PortalId) -> DVec3 {
        let fan = &self.portals[portal.0 as usize].fan;
        let t = &self.portal_triangles[fan.start + rng.below(fan.len())];
        point_of_triangle(rng, &t.corners)
    }

    /// Returns a point on the rim of a piece of a portal in `crossable`.
    pub(crate) fn rim_point_of_portal(&self, rng: &mut Rng, portal: PortalId) -> DVec3 {
        let fan = &self.portals[portal.0 as usize].fan;
        let t = &self.portal_triangles[fan.start + rng.below(fan.len())];
        // The edge from vertex 1 to 2 is always the piece's own.
        let k = (0..3)
            .find(|&k| t.is_rim[k] && rng.unit() < 0.5)
            .unwrap_or(1);
        t.corners[k].lerp(t.corners[(k + 1) % 3], rng.unit())
    }

    /// Returns `true` if `p` is closer than `2 eps` to a structural triangle or a portal.
    pub(crate) fn is_close_to_surface(&self, p: DVec3) -> bool {
        !self.is_clear(p, 2.0 * self.eps) || self.nearest_portal(p).is_some()
    }

    /// Returns `true` if `p` is at least `reach` from all structural triangles. [Units: wu]
    pub(crate) fn is_clear(&self, p: DVec3, reach: f64) -> bool {
        self.blockers.nearest(p, reach).is_none()
    }

    /// Returns the portal nearest to `p`, if one is within `2 eps`.
    pub(crate) fn nearest_portal(&self, p: DVec3) -> Option<PortalId> {
        let nearest = self.portal_bvh.nearest(p, 2.0 * self.eps)?;
        Some(self.portal_triangles[nearest.triangle as usize].portal)
    }

    /// Finds the portals that the open segment crosses, in order, each once.
    pub(crate) fn crossings(&self, a: DVec3, b: DVec3, out: &mut Vec<Crossing>) {
        out.clear();
        self.portal_bvh.for_each_hit(&Ray::segment(a, b), |hit| {
            let portal = self.portal_triangles[hit.triangle as usize].portal;
            // A line meets a plane once: a second hit is an edge shared by two pieces.
            if out.iter().any(|c| c.portal == portal) {
                return;
            }
            let slope = self.portals[portal.0 as usize].normal.dot(b - a);
            let slack = 2.0 * self.eps / slope.abs().max(1e-300);
            out.push(Crossing {
                t: hit.t,
                portal,
                is_forward: slope > 0.0,
                slack,
            });
        });
        out.sort_by(|x, y| x.t.total_cmp(&y.t).then(x.portal.cmp(&y.portal)));
    }

    /// Moves a crossing that leaves `cell` to the front of `rest` if the first does not, and both may be crossed in
    /// either order.
    pub(crate) fn settle_order(&self, cell: CellId, rest: &mut [Crossing]) {
        let Some(first) = rest.first().copied() else {
            return;
        };
        // Directions matter: two portals between the same cells, a hair apart, may be met in the wrong order, too.
        let leaves = |c: &Crossing| {
            self.portals[c.portal.0 as usize].cells[usize::from(!c.is_forward)] == cell
        };
        if leaves(&first) {
            return;
        }
        let other = rest[1..]
            .iter()
            .take_while(|c| c.t - c.slack <= first.t + first.slack)
            .position(leaves);
        if let Some(other) = other {
            rest[..=other + 1].rotate_right(1);
        }
    }

    /// Returns `true` if the segment passes an edge of a blocking triangle, or the rim of a portal's piece, closer than
    /// `2 eps`, or runs along a portal.
    pub(crate) fn is_grazing(&self, a: DVec3, b: DVec3) -> bool {
        self.edge_clearance(a, b, 2.0 * self.eps) < 2.0 * self.eps || self.runs_along_portal(a, b)
    }

    /// Returns `true` if the segment lies in the plane of a portal that it touches, within `2 eps`: rounding decides on
    /// which side of the portal each of its points is.
    fn runs_along_portal(&self, a: DVec3, b: DVec3) -> bool {
        let reach = 2.0 * self.eps;
        let along = self
            .portal_bvh
            .for_each_around_segment(a, b, reach, |_, t| {
                let is_in = |plane: Plane| {
                    let far = [a, b].map(|p| plane.signed_distance(p).abs());
                    far[0].max(far[1]) <= reach
                };
                if Plane::of_triangle(t).is_some_and(is_in) {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            });
        along.is_break()
    }

    /// Returns the distance from the segment to the nearest edge of a blocking triangle or rim of a portal's piece:
    /// exact below `reach`, else at least `reach`.
    pub(crate) fn edge_clearance(&self, a: DVec3, b: DVec3, reach: f64) -> f64 {
        let mut least = nearest_edge(&self.blockers, a, b, reach);
        let _ = self
            .portal_bvh
            .for_each_around_segment(a, b, reach, |id, t| {
                let is_rim = self.portal_triangles[id as usize].is_rim;
                for k in (0..3).filter(|&k| is_rim[k]) {
                    let d2 = segment_distance_squared(a, b, t[k], t[(k + 1) % 3]);
                    least = least.min(d2.sqrt());
                }
                ControlFlow::Continue(())
            });
        least
    }

    /// Same as [`Self::is_grazing`] for the world's own triangles, which may be cut finer than those that block.
    pub(crate) fn is_grazing_own(&self, a: DVec3, b: DVec3) -> bool {
        let reach = 2.0 * self.eps;
        self.own_bvh
            .as_ref()
            .is_some_and(|bvh| nearest_edge(bvh, a, b, reach) < reach)
    }

    /// Returns `true` if a triangle that blocks is so thin that all rays that meet it graze, and where they do is rounding.
    pub(crate) fn is_thin(&self, triangle: u32) -> bool {
        is_thin(&self.triangles[triangle as usize], self.eps)
    }

    /// Returns `true` if the segment [grazes](Self::is_grazing), or meets a [thin](Self::is_thin) triangle.
    pub(crate) fn grazes(&self, triangle: u32, a: DVec3, b: DVec3) -> bool {
        self.is_thin(triangle) || self.is_grazing(a, b)
    }

    /// Calls `visit` with each of the world's own triangles that the ray meets and whose plane is within `2 eps` of
    /// `at`, and its batch.
    pub(crate) fn for_each_own_at(&self, ray: &Ray, at: DVec3, mut visit: impl FnMut(u32, u32)) {
        let bvh = self.own_bvh.as_ref().unwrap_or(&self.blockers);
        bvh.for_each_hit(ray, |hit| {
            let (triangle, batch) = &self.own[hit.triangle as usize];
            let distance = Plane::of_triangle(triangle).map(|p| p.signed_distance(at).abs());
            if distance.is_some_and(|d| d <= 2.0 * self.eps) {
                visit(hit.triangle, *batch);
            }
        });
    }
}

/// Returns `true` if all points of a triangle are within `2 eps` of its edges.
pub(crate) fn is_thin(t: &Triangle, eps: f64) -> bool {
    let edges = [t[1] - t[0], t[2] - t[1], t[0] - t[2]];
    let longest = edges.map(DVec3::length).into_iter().fold(0.0, f64::max);
    // The height over the longest edge.
    edges[0].cross(edges[1]).length() <= 2.0 * eps * longest
}

fn nearest_edge(bvh: &Bvh, a: DVec3, b: DVec3, reach: f64) -> f64 {
    let mut least = f64::INFINITY;
    let _ = bvh.for_each_around_segment(a, b, reach, |_, t| {
        // Far from the plane with both ends on one side: far from the edges.
        let n = (t[1] - t[0]).cross(t[2] - t[0]);
        let (da, db) = (n.dot(a - t[0]), n.dot(b - t[0]));
        if da * db <= 0.0 || da.abs().min(db.abs()) <= 1.001 * reach * n.length() {
            least = least.min(segment_to_edges_distance(a, b, t));
        }
        ControlFlow::Continue(())
    });
    least
}

/// Returns a point uniform in a box.
pub(crate) fn point_in(rng: &mut Rng, bounds: &Aabb) -> DVec3 {
    bounds.min + bounds.size() * DVec3::new(rng.unit(), rng.unit(), rng.unit())
}

/// Returns a point uniform on a triangle.
pub(crate) fn point_of_triangle(rng: &mut Rng, t: &Triangle) -> DVec3 {
    let (mut u, mut v) = (rng.unit(), rng.unit());
    if u + v > 1.0 {
        (u, v) = (1.0 - u, 1.0 - v);
    }
    t[0] + (t[1] - t[0]) * u + (t[2] - t[0]) * v
}
