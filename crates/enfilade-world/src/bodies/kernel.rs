//! One body and one triangle: contact, depth, and first contact of a moving body.
//!
//! - **Boxes**: separating axes, and for moving ones the interval of time in which none separates (Ericson, *Real-Time Collision
//!   Detection*, 2005, sections 5.2.9 and 5.5.8). Closed form. The cross product of nearly parallel edges is noise; the other
//!   axes decide for these.
//! - **Spheres and capsules**: the distance of two convex sets in straight motion is a convex function of time, and the nearest
//!   points give its slope. Newton's steps from the left never pass its first root, and take only a few iterations, since they
//!   start where the separating axes of the triangle's plane and of the world end. Where the body only grazes, steps halve;
//!   a search that reaches [`MAX_STEPS`] counts as touching.
//!
//! All intervals are widened by [`TOUCH`]: a body without thickness touches a triangle for an instant only, which two axes
//! round differently. The method of the parry library (GJK on the difference) was measured and rejected: see
//! `docs/benchmarks/living.md`. Coordinates are relative to the body's start, so that their rounding is that of the file.

use enfilade_geom::{Aabb, DVec3, Triangle, closest_point_on_segment};

use super::body::BodyCore;

/// Distance that counts as touching. [Units: wu]
const TOUCH: f64 = 1e-9;
/// Maximum number of steps of Newton's method.
const MAX_STEPS: usize = 48;

/// First contact of a moving body with a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct FirstTouch {
    /// Time in lengths of the motion.
    pub(super) t: f64,
    /// Unit normal, from the triangle to the body.
    pub(super) normal: DVec3,
}

/// Contact of a resting body with a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Penetration {
    /// Unit vector of the shortest way out.
    pub(super) normal: DVec3,
    /// Depth along it. [Units: wu]
    pub(super) depth: f64,
}

/// A time interval that axes narrow.
#[derive(Clone, Copy)]
struct Meeting {
    enter: f64,
    leave: f64,
}

impl Meeting {
    /// Narrows the interval to the times at which the body, with its center at `center`, moving by `speed` along an axis and
    /// extending by `reach` on either side, touches `low..=high`; returns `true` if any is left.
    #[inline]
    fn narrow(&mut self, speed: f64, reach: f64, low: f64, high: f64) -> bool {
        let (low, high) = (low - reach, high + reach);
        if speed == 0.0 {
            return low <= 0.0 && high >= 0.0;
        }
        let (a, b) = (low / speed, high / speed);
        self.enter = self.enter.max(a.min(b));
        self.leave = self.leave.min(a.max(b));
        self.enter <= self.leave
    }
}

/// Returns half of a body's extent along a direction, with [`TOUCH`] added.
#[inline]
fn reach_along(core: &BodyCore, axis: DVec3) -> f64 {
    core.support(axis) + TOUCH * axis.abs().element_sum()
}

/// Returns the time up to `t_max` at which the bounding box of a body that moves by `by` from the origin first touches that of a
/// triangle.
///
/// `reach`: half sizes of the body's bounding box.
#[inline]
pub(super) fn boxes_meet(reach: DVec3, by: DVec3, t_max: f64, bounds: &Aabb) -> Option<f64> {
    let mut span = Meeting {
        enter: 0.0,
        leave: t_max,
    };
    let meet = (0..3).all(|k| span.narrow(by[k], reach[k] + TOUCH, bounds.min[k], bounds.max[k]));
    meet.then_some(span.enter)
}

/// Returns the first contact, up to `t_max`, of a body that moves by `by` with a triangle. Vertices are relative to the body's
/// center.
pub(super) fn sweep(
    core: &BodyCore,
    by: DVec3,
    t_max: f64,
    triangle: &Triangle,
) -> Option<FirstTouch> {
    if core.n_axes == 3 {
        sweep_box(core, by, t_max, triangle)
    } else {
        sweep_round(core, by, t_max, triangle)
    }
}

/// Returns the contact of a resting body with a triangle, if any. Vertices are relative to the body's center.
pub(super) fn depth(core: &BodyCore, triangle: &Triangle) -> Option<Penetration> {
    if core.n_axes == 3 {
        return depth_of_box(core, triangle);
    }
    let (p, q) = nearest(core.axes[0], core.n_axes == 0, DVec3::ZERO, triangle);
    let apart = (p - q).length();
    (apart <= core.radius + TOUCH).then(|| Penetration {
        normal: normal_of(p - q, triangle, DVec3::ZERO, DVec3::ZERO),
        depth: (core.radius - apart).max(0.0),
    })
}

/// Returns the point of a triangle where a body touches it, or near there. All are relative to the body's center.
pub(super) fn point_of_contact(core: &BodyCore, triangle: &Triangle) -> DVec3 {
    if core.n_axes < 3 {
        return nearest(core.axes[0], core.n_axes == 0, DVec3::ZERO, triangle).1;
    }
    // The middle of the triangle's section with the slightly grown box.
    let mut corners = [DVec3::ZERO; 12];
    corners[..3].copy_from_slice(triangle);
    let mut n = 3;
    let slack = 1e-6 + 1e-6 * core.reach().max_element();
    for (axis, u) in core.axes.iter().zip(core.directions) {
        for side in [1.0, -1.0] {
            let mut kept = [DVec3::ZERO; 12];
            let mut n_kept = 0;
            for i in 0..n {
                let (a, b) = (corners[i], corners[(i + 1) % n]);
                let limit = axis.length() + slack;
                let [da, db] = [a, b].map(|p| side * u.dot(p) - limit);
                let crossing = (da > 0.0) != (db > 0.0);
                for p in [
                    (da <= 0.0).then_some(a),
                    crossing.then(|| a.lerp(b, da / (da - db))),
                ] {
                    if let Some(p) = p.filter(|_| n_kept < kept.len()) {
                        kept[n_kept] = p;
                        n_kept += 1;
                    }
                }
            }
            if n_kept > 0 {
                (corners, n) = (kept, n_kept);
            }
        }
    }
    corners[..n].iter().sum::<DVec3>() / n as f64
}

fn sweep_round(core: &BodyCore, by: DVec3, t_max: f64, t: &Triangle) -> Option<FirstTouch> {
    let mut span = Meeting {
        enter: 0.0,
        leave: t_max,
    };
    let face = (t[1] - t[0]).cross(t[2] - t[0]);
    let at = face.dot(t[0]);
    // Planes of slivers are noise.
    let is_sure = face.length_squared() > 1e-20;
    let reach = reach_along(core, face);
    if is_sure && !span.narrow(face.dot(by), reach, at, at) {
        return None;
    }
    for k in 0..3 {
        let axis = DVec3::AXES[k];
        let [a, b, c] = t.map(|p| p[k]);
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        if !span.narrow(by[k], reach_along(core, axis), low, high) {
            return None;
        }
    }
    let mut now = span.enter;
    for _ in 0..MAX_STEPS {
        let (p, q) = nearest(core.axes[0], core.n_axes == 0, by * now, t);
        let away = p - q;
        let distance = away.length();
        let gap = distance - core.radius;
        // At the start of the interval, the gap is at most the sum of both widenings.
        if gap <= 2.0 * TOUCH {
            let normal = normal_of(away, t, by * now, by);
            return Some(FirstTouch { t: now, normal });
        }
        let speed = -away.dot(by) / distance;
        let next = now + gap / speed;
        if speed <= 0.0 || next > span.leave {
            return None;
        }
        now = next;
    }
    let (p, q) = nearest(core.axes[0], core.n_axes == 0, by * now, t);
    let normal = normal_of(p - q, t, by * now, by);
    Some(FirstTouch { t: now, normal })
}

/// Returns the direction of `away`; if it is zero, the normal of the triangle on the side of `center`, or else against `by`.
fn normal_of(away: DVec3, t: &Triangle, center: DVec3, by: DVec3) -> DVec3 {
    if away.length_squared() > TOUCH * TOUCH * 1e-6 {
        return away.normalize();
    }
    let face = (t[1] - t[0]).cross(t[2] - t[0]).normalize_or(DVec3::Y);
    let height = face.dot(center - t[0]);
    let side = if height.abs() > TOUCH {
        height
    } else {
        -face.dot(by)
    };
    face * if side < 0.0 { -1.0 } else { 1.0 }
}

/// Calls `visit` with the axes that may separate a box from a triangle until it returns `false`; returns `true` if it never did.
#[inline]
fn for_each_axis(core: &BodyCore, t: &Triangle, mut visit: impl FnMut(DVec3) -> bool) -> bool {
    let edges = [t[1] - t[0], t[2] - t[1], t[0] - t[2]];
    if !core.directions.iter().all(|&a| visit(a)) {
        return false;
    }
    let face = edges[0].cross(edges[1]);
    if face.length_squared() > 1e-20 && !visit(face) {
        return false;
    }
    core.directions.iter().all(|a| {
        edges.iter().all(|e| {
            let axis = a.cross(*e);
            let noise = 1e-20 * e.length_squared();
            axis.length_squared() <= noise || visit(axis)
        })
    })
}

/// Returns the interval of a triangle along an axis.
#[inline]
fn extent(axis: DVec3, t: &Triangle) -> (f64, f64) {
    let [a, b, c] = t.map(|p| axis.dot(p));
    (a.min(b).min(c), a.max(b).max(c))
}

fn sweep_box(core: &BodyCore, by: DVec3, t_max: f64, t: &Triangle) -> Option<FirstTouch> {
    let mut span = Meeting {
        enter: 0.0,
        leave: t_max,
    };
    let mut last = None;
    let meets = for_each_axis(core, t, |axis| {
        let (low, high) = extent(axis, t);
        let before = span.enter;
        let speed = axis.dot(by);
        let is_left = span.narrow(speed, reach_along(core, axis), low, high);
        if span.enter > before {
            last = Some(axis * -speed.signum());
        }
        is_left
    });
    if !meets {
        return None;
    }
    let normal = match last {
        Some(axis) => axis.normalize(),
        // In contact from the start.
        None => depth_of_box(core, t).map_or(DVec3::Y, |d| d.normal),
    };
    let t = span.enter;
    Some(FirstTouch { t, normal })
}

fn depth_of_box(core: &BodyCore, t: &Triangle) -> Option<Penetration> {
    let mut best: Option<Penetration> = None;
    let meets = for_each_axis(core, t, |axis| {
        let (low, high) = extent(axis, t);
        let (reach, length) = (core.support(axis), axis.length());
        // Out on the lower or on the upper side.
        let (down, up) = ((reach - low) / length, (high + reach) / length);
        let (depth, side) = if down < up { (down, -1.0) } else { (up, 1.0) };
        if best.is_none_or(|b| depth < b.depth) {
            let normal = axis * (side / length);
            best = Some(Penetration { normal, depth });
        }
        depth >= -TOUCH
    });
    let best = best.filter(|_| meets)?;
    Some(Penetration {
        depth: best.depth.max(0.0),
        ..best
    })
}

/// Returns the nearest points of the segment from `center - half` to `center + half`, or of `center` alone, and of a triangle:
/// first the body's, then the triangle's. Twice the same point if they meet.
fn nearest(half: DVec3, is_point: bool, center: DVec3, t: &Triangle) -> (DVec3, DVec3) {
    if is_point {
        return (center, nearest_on_triangle(center, t));
    }
    let (a, b) = (center - half, center + half);
    let face = (t[1] - t[0]).cross(t[2] - t[0]);
    let (da, db) = (face.dot(a - t[0]), face.dot(b - t[0]));
    if (da < 0.0) != (db < 0.0) {
        let p = a.lerp(b, da / (da - db));
        let is_in = (0..3).all(|i| face.cross(t[(i + 1) % 3] - t[i]).dot(p - t[i]) >= 0.0);
        if is_in && face != DVec3::ZERO {
            return (p, p);
        }
    }
    let mut best = (a, nearest_on_triangle(a, t));
    let mut least = best.0.distance_squared(best.1);
    let mut take = |p: DVec3, q: DVec3| {
        let d2 = p.distance_squared(q);
        if d2 < least {
            (best, least) = ((p, q), d2);
        }
    };
    take(b, nearest_on_triangle(b, t));
    for i in 0..3 {
        take(closest_point_on_segment(t[i], a, b), t[i]);
        if let Some((p, q)) = common_perpendicular(a, b, t[i], t[(i + 1) % 3]) {
            take(p, q);
        }
    }
    best
}

/// Returns the feet of the common perpendicular of two segments, if both lie in them; otherwise one of the nearest points is an
/// end. Lines that are parallel up to rounding count as parallel.
fn common_perpendicular(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> Option<(DVec3, DVec3)> {
    let (u, v, w) = (b - a, d - c, a - c);
    let n = u.cross(v);
    let n2 = n.length_squared();
    if n2 <= 1e-20 * u.length_squared() * v.length_squared() {
        return None;
    }
    let (s, r) = (v.cross(w).dot(n) / n2, u.cross(w).dot(n) / n2);
    let is_in = (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&r);
    is_in.then(|| (a + u * s, c + v * r))
}

/// Ericson, section 5.1.5, for many calls: by the region of the triangle's vertices, edges and face that contains the point.
fn nearest_on_triangle(p: DVec3, [a, b, c]: &Triangle) -> DVec3 {
    let (ab, ac, ap) = (*b - *a, *c - *a, p - *a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return *a;
    }
    let bp = p - *b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return *b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return *a + ab * (d1 / (d1 - d3));
    }
    let cp = p - *c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return *c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return *a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return *b + (*c - *b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    if sum <= 1e-20 * ab.length_squared() * ac.length_squared() {
        return nearest_on_sliver(p, &[*a, *b, *c]);
    }
    // Along the normal, not by weights of the edges: for long triangles these are far less exact.
    let face = ab.cross(ac);
    p - face * (face.dot(ap) / face.length_squared())
}

/// The same for a triangle that is a line up to rounding.
fn nearest_on_sliver(p: DVec3, t: &Triangle) -> DVec3 {
    let mut best = t[0];
    for i in 0..3 {
        let q = closest_point_on_segment(p, t[i], t[(i + 1) % 3]);
        if q.distance_squared(p) < best.distance_squared(p) {
            best = q;
        }
    }
    best
}
