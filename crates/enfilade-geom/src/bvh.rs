//! Bounding volume hierarchy: finds the triangles that a ray, a box or a point meets.
//!
//! Built top-down by the binned surface-area heuristic (Wald, "On fast Construction of SAH-based
//! Bounding Volume Hierarchies", RT 2007), four children per node. Boxes are `f32`, rounded outwards, and
//! every box test errs to "may meet"; triangles are `f64` and decide. The tree never loses a hit: its
//! answers are those of testing every triangle.
//!
//! Equal triangles in equal order give an equal tree and equal answers.

mod build;

use std::ops::ControlFlow;

use glam::Vec4;
use smallvec::SmallVec;

use crate::ray::{
    Ray, RayHit, ShearedRay, closest_point_on_triangle, closest_with_normal, triangle_touches_box,
};
use crate::{Aabb, DVec3, Triangle};
use build::{Built, Node, build_nodes, round_down, round_up};

/// Enough for `MAX_SAH_DEPTH` levels and 16 more that quarter 2³² triangles, three pushes each.
const STACK_SIZE: usize = 192;
/// A tree over triangles, with queries in time about logarithmic in their number.
#[derive(Clone, Debug)]
pub struct Bvh {
    nodes: Vec<Node>,
    /// In leaf order.
    triangles: Vec<[[f64; 3]; 3]>,
    /// Index of each in the caller's list.
    ids: Vec<u32>,
    bounds: Aabb,
}

/// Result of [`Bvh::nearest`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Distance. [Units: wu]
    pub distance: f64,
    /// Index of the triangle.
    pub triangle: u32,
    /// Nearest point of the triangle.
    pub point: DVec3,
}

/// A series of queries of one tree with [`Bvh::any_within`], at points near each other.
#[derive(Clone, Debug, Default)]
pub struct NearSeries {
    /// Position in leaf order of the last triangle found.
    last: Option<usize>,
    /// Number of triangles tested by all queries.
    pub n_looked: u64,
}

impl Bvh {
    /// Builds the tree. O(n log n); 128 bytes per node and 76 per triangle.
    ///
    /// Ignores triangles with a vertex that is not finite or beyond 10¹⁵.
    #[must_use]
    pub fn build(triangles: &[Triangle]) -> Self {
        let Built { nodes, ids, bounds } = build_nodes(triangles);
        let triangles = ids
            .iter()
            .map(|&i| triangles[i as usize].map(|p| p.to_array()))
            .collect();
        Self {
            nodes,
            triangles,
            ids,
            bounds,
        }
    }

    /// Returns the triangles in the order that it was built from, with points in one place for those that it ignores. Linear.
    #[must_use]
    pub fn to_triangles(&self) -> Vec<Triangle> {
        let n = self.ids.iter().map(|&id| id as usize + 1).max();
        let mut triangles = vec![[DVec3::ZERO; 3]; n.unwrap_or(0)];
        for (&id, corners) in self.ids.iter().zip(&self.triangles) {
            triangles[id as usize] = corners.map(DVec3::from_array);
        }
        triangles
    }

    /// Returns the box around all triangles.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Returns the number of triangles in the tree.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// Returns `true` if the tree has no triangle.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }

    /// Returns `true` if the closed segment from `a` to `b` meets a triangle for which `excluded` returns `false`.
    #[must_use]
    pub fn any_hit(&self, a: DVec3, b: DVec3, mut excluded: impl FnMut(u32) -> bool) -> bool {
        let ray = Ray::segment(a, b);
        let sheared = ShearedRay::new(&ray);
        let met = self.walk(&ray, DVec3::ZERO, |i, t_max| {
            if sheared.hit(&self.triangles[i], *t_max).is_some() && !excluded(self.ids[i]) {
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        });
        met.is_break()
    }

    /// Returns the first triangle along the ray for which `excluded` returns `false`.
    ///
    /// At equal `t`, the triangle with the least index.
    #[must_use]
    pub fn closest_hit(&self, ray: &Ray, mut excluded: impl FnMut(u32) -> bool) -> Option<RayHit> {
        let sheared = ShearedRay::new(ray);
        let mut best: Option<RayHit> = None;
        let _ = self.walk::<()>(ray, DVec3::ZERO, |i, t_max| {
            if let Some((t, front)) = sheared.hit(&self.triangles[i], *t_max) {
                let id = self.ids[i];
                let is_nearer = best.is_none_or(|b| t < b.t || (t == b.t && id < b.triangle));
                if is_nearer && !excluded(id) {
                    best = Some(RayHit {
                        t,
                        triangle: id,
                        front,
                    });
                    *t_max = t;
                }
            }
            ControlFlow::Continue(())
        });
        best
    }

    /// Calls `visit` for each triangle that the ray meets, in arbitrary order.
    pub fn for_each_hit(&self, ray: &Ray, mut visit: impl FnMut(RayHit)) {
        let sheared = ShearedRay::new(ray);
        let _ = self.walk::<()>(ray, DVec3::ZERO, |i, t_max| {
            if let Some((t, front)) = sheared.hit(&self.triangles[i], *t_max) {
                visit(RayHit {
                    t,
                    triangle: self.ids[i],
                    front,
                });
            }
            ControlFlow::Continue(())
        });
    }

    /// Calls `visit` for each triangle in a leaf whose box, grown by `radius` (finite), the closed segment
    /// meets: a superset of those within `radius`. Stops if `visit` breaks.
    pub fn for_each_around_segment(
        &self,
        a: DVec3,
        b: DVec3,
        radius: f64,
        mut visit: impl FnMut(u32, &Triangle) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        // A segment without length has no direction; any will do.
        let mut ray = Ray::segment(a, b);
        if ray.direction == DVec3::ZERO {
            ray = Ray {
                origin: a,
                direction: DVec3::X,
                t_max: 0.0,
            };
        }
        self.walk(&ray, DVec3::splat(radius), |i, _| {
            visit(self.ids[i], &self.triangle(i))
        })
    }

    /// Calls `visit` for each triangle in a leaf whose box may be touched by a box of half sizes `half` whose center moves along
    /// the ray: a superset of the triangles touched, roughly near to far. `visit` may lower the `t` after which triangles are
    /// ignored. A ray without a direction stands for its origin.
    pub fn for_each_swept(
        &self,
        ray: &Ray,
        half: DVec3,
        mut visit: impl FnMut(u32, &Triangle, &mut f64),
    ) {
        let mut ray = *ray;
        if ray.direction == DVec3::ZERO {
            ray.direction = DVec3::X;
            ray.t_max = 0.0;
        }
        let _ = self.walk::<()>(&ray, half, |i, t_max| {
            visit(self.ids[i], &self.triangle(i), t_max);
            ControlFlow::Continue(())
        });
    }

    /// Calls `visit` for each triangle that touches the closed box, and perhaps for some that miss it by
    /// rounding.
    pub fn for_each_in_box(&self, query: &Aabb, mut visit: impl FnMut(u32)) {
        self.walk_box(query, |i| {
            if triangle_touches_box(&self.triangle(i), query) {
                visit(self.ids[i]);
            }
            true
        });
    }

    /// As [`Bvh::for_each_in_box`], until `is_found` returns `true`; returns `true` if it did.
    pub fn any_in_box(&self, query: &Aabb, is_found: impl FnMut(u32) -> bool) -> bool {
        self.any_in_box_of(query, |_| true, is_found)
    }

    /// Does [`Bvh::any_in_box`] for the triangles that a test accepts, which is made first.
    pub fn any_in_box_of(
        &self,
        query: &Aabb,
        is_asked: impl Fn(&Triangle) -> bool,
        mut is_found: impl FnMut(u32) -> bool,
    ) -> bool {
        let mut any = false;
        self.walk_box(query, |i| {
            let triangle = self.triangle(i);
            any = is_asked(&triangle)
                && triangle_touches_box(&triangle, query)
                && is_found(self.ids[i]);
            !any
        });
        any
    }

    /// Calls `visit` with the positions of triangles in leaves whose boxes touch the closed box, until it returns `false`.
    fn walk_box(&self, query: &Aabb, mut visit: impl FnMut(usize) -> bool) {
        if self.nodes.is_empty() || query.is_empty() {
            return;
        }
        let (min, max) = (round_down(query.min), round_up(query.max));
        // Children and their counts. Most queries are small: a large stack takes longer to clear than they do.
        let mut stack: SmallVec<[(u32, u32); 64]> = SmallVec::new();
        stack.push((0, 0));
        while let Some((child, count)) = stack.pop() {
            if count > 0 {
                let first = child as usize;
                for i in first..first + count as usize {
                    if !visit(i) {
                        return;
                    }
                }
                continue;
            }
            let node = &self.nodes[child as usize];
            let [low, high] = &node.bounds;
            let meets = low[0].cmple(Vec4::splat(max.x))
                & low[1].cmple(Vec4::splat(max.y))
                & low[2].cmple(Vec4::splat(max.z))
                & high[0].cmpge(Vec4::splat(min.x))
                & high[1].cmpge(Vec4::splat(min.y))
                & high[2].cmpge(Vec4::splat(min.z));
            let mask = meets.bitmask();
            for k in (0..4).rev().filter(|k| mask >> k & 1 == 1) {
                stack.push((node.children[k], node.counts[k]));
            }
        }
    }

    /// Returns the distance from `p` of some triangle within `reach`: the first found, not the nearest. [Units: wu]
    ///
    /// A query of a series starts with the triangle of the last one, which is mostly near enough for the next point, too.
    #[must_use]
    pub fn any_within(&self, p: DVec3, reach: f64, series: &mut NearSeries) -> Option<f64> {
        if !p.is_finite() {
            return None;
        }
        let known = series.last.and_then(|at| self.within(at, p, reach));
        if known.is_some() {
            return known;
        }
        let mut found = None;
        self.walk_box(&Aabb::new(p - reach, p + reach), |i| {
            series.n_looked += 1;
            found = self.within(i, p, reach);
            if found.is_some() {
                series.last = Some(i);
            }
            found.is_none()
        });
        found
    }

    /// Returns the distance of `p` from the triangle at a position in leaf order, if at most `reach`.
    fn within(&self, place: usize, p: DVec3, reach: f64) -> Option<f64> {
        let t = self.triangle(place);
        let n = (t[1] - t[0]).cross(t[2] - t[0]);
        // The plane rejects nearly all triangles whose boxes are near.
        let off = n.dot(p - t[0]);
        if off * off > reach * reach * n.length_squared() {
            return None;
        }
        let d2 = closest_with_normal(p, &t, n).distance_squared(p);
        (d2 <= reach * reach).then(|| d2.sqrt())
    }

    /// Returns the triangle nearest to `p`, if one is within `max_distance` (infinity allowed).
    ///
    /// At equal distance, the triangle with the least index.
    #[must_use]
    pub fn nearest(&self, p: DVec3, max_distance: f64) -> Option<Nearest> {
        self.nearest_counted(p, max_distance, &mut 0)
    }

    /// As [`Bvh::nearest`]; also returns the number of triangles tested.
    #[must_use]
    pub fn nearest_counted(
        &self,
        p: DVec3,
        max_distance: f64,
        n_looked: &mut u64,
    ) -> Option<Nearest> {
        if self.nodes.is_empty() || !p.is_finite() {
            return None;
        }
        let margin = box_margin(&self.bounds, p);
        let (low_p, high_p) = ((p + margin).as_vec3(), (p - margin).as_vec3());
        let mut best: Option<Nearest> = None;
        let mut limit = max_distance * max_distance;
        let mut stack = Stack::new();
        stack.push(Pending {
            child: 0,
            count: 0,
            near: 0.0,
        });
        while let Some(at) = stack.pop() {
            if f64::from(at.near) > limit {
                continue;
            }
            if at.count > 0 {
                let first = at.child as usize;
                *n_looked += u64::from(at.count);
                for i in first..first + at.count as usize {
                    let point = closest_point_on_triangle(p, &self.triangle(i));
                    let d2 = point.distance_squared(p);
                    let id = self.ids[i];
                    if d2 < limit || (d2 == limit && best.is_none_or(|b| id < b.triangle)) {
                        limit = d2;
                        best = Some(Nearest {
                            distance: d2.sqrt(),
                            triangle: id,
                            point,
                        });
                    }
                }
                continue;
            }
            let node = &self.nodes[at.child as usize];
            let [low, high] = &node.bounds;
            let mut d2 = Vec4::ZERO;
            for axis in 0..3 {
                let below = low[axis] - Vec4::splat(low_p[axis]);
                let above = Vec4::splat(high_p[axis]) - high[axis];
                let d = below.max(above).max(Vec4::ZERO);
                d2 += d * d;
            }
            // Five roundings of 2⁻²⁴ at most; 2⁻²⁰ covers them.
            let near = d2 * (1.0 - 1.0 / 1_048_576.0);
            let is_used = low[0].cmple(high[0]);
            stack.push_sorted(node, near, is_used.bitmask());
        }
        best
    }

    fn triangle(&self, i: usize) -> Triangle {
        self.triangles[i].map(DVec3::from_array)
    }

    /// Visits the triangles (by position in leaf order) of every leaf whose box, grown by `reach` along each
    /// axis, the ray meets before `t_max`, roughly near to far. `visit` may lower `t_max`.
    #[inline]
    fn walk<B>(
        &self,
        ray: &Ray,
        reach: DVec3,
        mut visit: impl FnMut(usize, &mut f64) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let longest = ray.direction.abs().max_element();
        if self.nodes.is_empty() || !(longest > 0.0 && longest.is_finite()) {
            return ControlFlow::Continue(());
        }
        // Scaled so that the longest component is 1: no `f32` overflows. A component under 1e-12
        // of it is raised to that, which moves the ray by less than the margin within reach of the boxes.
        let direction = ray.direction / longest;
        let direction = direction
            .abs()
            .max(DVec3::splat(1e-12))
            .copysign(direction)
            .as_vec3();
        let inverse = direction.recip();
        // The factor covers the rounding of a reach that dwarfs the scene.
        let margin = (box_margin(&self.bounds, ray.origin) + reach) * (1.0 + 1e-6);
        let from = [
            (ray.origin + margin).as_vec3(),
            (ray.origin - margin).as_vec3(),
        ];
        let is_back = [direction.x < 0.0, direction.y < 0.0, direction.z < 0.0].map(usize::from);
        let inverse4 = [
            Vec4::splat(inverse.x),
            Vec4::splat(inverse.y),
            Vec4::splat(inverse.z),
        ];
        let near_from = [0, 1, 2].map(|axis| Vec4::splat(from[is_back[axis]][axis]));
        let far_from = [0, 1, 2].map(|axis| Vec4::splat(from[1 - is_back[axis]][axis]));
        // Four roundings of 2⁻²⁴ on either side of each comparison; 2⁻²⁰ covers them.
        const GROW: f32 = 1.0 + 1.0 / 1_048_576.0;

        let mut t_max = ray.t_max;
        let mut limit = (t_max * longest) as f32 * GROW;
        let mut stack = Stack::new();
        stack.push(Pending {
            child: 0,
            count: 0,
            near: 0.0,
        });
        while let Some(at) = stack.pop() {
            if at.near > limit {
                continue;
            }
            if at.count > 0 {
                let first = at.child as usize;
                for i in first..first + at.count as usize {
                    visit(i, &mut t_max)?;
                }
                limit = (t_max * longest) as f32 * GROW;
                continue;
            }
            let node = &self.nodes[at.child as usize];
            let plane = |far: usize, axis: usize| node.bounds[is_back[axis] ^ far][axis];
            let near = ((plane(0, 0) - near_from[0]) * inverse4[0])
                .max((plane(0, 1) - near_from[1]) * inverse4[1])
                .max((plane(0, 2) - near_from[2]) * inverse4[2])
                .max(Vec4::ZERO);
            let far = ((plane(1, 0) - far_from[0]) * inverse4[0])
                .min((plane(1, 1) - far_from[1]) * inverse4[1])
                .min((plane(1, 2) - far_from[2]) * inverse4[2]);
            let meets = near.cmple((far * GROW).min(Vec4::splat(limit)));
            stack.push_sorted(node, near, meets.bitmask());
        }
        ControlFlow::Continue(())
    }
}

/// Returns the largest shift of a box plane by the rounding of `p` and of differences with it. [Units: wu]
fn box_margin(bounds: &Aabb, p: DVec3) -> f64 {
    let reach = bounds
        .min
        .abs()
        .max(bounds.max.abs())
        .max(p.abs())
        .max_element();
    // Two roundings of 2⁻²⁴ of up to twice the reach, doubled.
    (reach * (1.0 / 2_097_152.0)).max(1e-30)
}

/// A child still to be visited.
#[derive(Clone, Copy)]
struct Pending {
    child: u32,
    count: u32,
    near: f32,
}

struct Stack {
    entries: [Pending; STACK_SIZE],
    len: usize,
}

impl Stack {
    fn new() -> Self {
        Self {
            entries: [Pending {
                child: 0,
                count: 0,
                near: 0.0,
            }; STACK_SIZE],
            len: 0,
        }
    }

    #[inline]
    fn push(&mut self, entry: Pending) {
        self.entries[self.len] = entry;
        self.len += 1;
    }

    #[inline]
    fn pop(&mut self) -> Option<Pending> {
        self.len = self.len.checked_sub(1)?;
        Some(self.entries[self.len])
    }

    /// Pushes the children in `mask`, the nearest last.
    #[inline]
    fn push_sorted(&mut self, node: &Node, near: Vec4, mut mask: u32) {
        let near = near.to_array();
        let base = self.len;
        while mask != 0 {
            let k = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            // From an origin that `f32` cannot hold, even the empty box of an unused child is met; it must not be taken for a
            // child, or it would lead back to the root for ever.
            if node.counts[k] == 0 && node.children[k] == 0 {
                continue;
            }
            let entry = Pending {
                child: node.children[k],
                count: node.counts[k],
                near: near[k],
            };
            let mut at = self.len;
            self.len += 1;
            while at > base && self.entries[at - 1].near < entry.near {
                self.entries[at] = self.entries[at - 1];
                at -= 1;
            }
            self.entries[at] = entry;
        }
    }
}

#[cfg(test)]
mod tests;
