//! Convex pieces of openings, and edges of two points, as strings pass them: best places, room to move, barriers.

use enfilade_geom::DVec3;

use crate::sound::blocks::Block;

pub(super) fn middle(corners: &[DVec3]) -> DVec3 {
    corners.iter().sum::<DVec3>() / corners.len().max(1) as f64
}

/// Returns the normal with twice the area as length.
fn area_normal(corners: &[DVec3]) -> DVec3 {
    let Some((&first, rest)) = corners.split_first() else {
        return DVec3::ZERO;
    };
    let fan = rest.windows(2).map(|p| (p[0] - first).cross(p[1] - first));
    fan.sum()
}

pub(super) fn plane_axes(corners: &[DVec3]) -> [DVec3; 2] {
    let normal = area_normal(corners).normalize_or_zero();
    if normal == DVec3::ZERO {
        return [DVec3::ZERO; 2];
    }
    let (u, v) = normal.any_orthonormal_pair();
    [u, v]
}

fn edges(corners: &[DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> {
    let nexts = corners.iter().cycle().skip(1);
    corners.iter().zip(nexts).map(|(a, b)| (*a, *b))
}

/// Returns the point of a polygon whose distances from `a` and `b` have the least sum, and the directions in which it may move.
pub(super) fn best_place(a: DVec3, b: DVec3, corners: &[DVec3]) -> (DVec3, [DVec3; 2]) {
    if let [from, to] = *corners {
        let (place, axis) = best_on_edge(a, b, from, to);
        return (place, [axis, DVec3::ZERO]);
    }
    let normal = area_normal(corners);
    let Some(&first) = corners.first() else {
        return (a, [DVec3::ZERO; 2]);
    };
    // As if `b` were on the other side: distances to points of the plane are the same. Heights by the length of the normal.
    let square = normal.length_squared().max(1e-300);
    let (h_a, h_b) = (
        normal.dot(a - first) / square,
        normal.dot(b - first) / square,
    );
    let (p, q) = (a - normal * h_a, b - normal * h_b);
    let (h_a, h_b) = (h_a.abs(), h_b.abs());
    let through = if h_a + h_b > 0.0 {
        p.lerp(q, h_a / (h_a + h_b))
    } else {
        p
    };
    let is_out = |from: DVec3, to: DVec3| normal.dot((to - from).cross(through - from)) < 0.0;
    let mut best = (through, [DVec3::ZERO; 2]);
    let mut least = f64::INFINITY;
    let mut is_inside = true;
    for (from, to) in edges(corners) {
        // Both ends in the plane: any edge may be the nearest.
        let is_flat = h_a + h_b == 0.0;
        if !is_flat && !is_out(from, to) {
            continue;
        }
        is_inside &= is_flat && !is_out(from, to);
        let (place, axis) = best_on_edge(a, b, from, to);
        let length = place.distance(a) + place.distance(b);
        if length < least {
            least = length;
            best = (place, [axis, DVec3::ZERO]);
        }
    }
    if is_inside {
        let (u, v) = normal.normalize_or_zero().any_orthonormal_pair();
        return (through, [u, v]);
    }
    best
}

/// As [`best_place`], on an edge: unfolds the triangles of `a` and of `b` with its line into one plane.
fn best_on_edge(a: DVec3, b: DVec3, from: DVec3, to: DVec3) -> (DVec3, DVec3) {
    let length = from.distance(to);
    if length == 0.0 {
        return (from, DVec3::ZERO);
    }
    let along = (to - from) / length;
    let (t_a, t_b) = (along.dot(a - from), along.dot(b - from));
    let r_a = (a - from - along * t_a).length();
    let r_b = (b - from - along * t_b).length();
    let t = if r_a + r_b > 0.0 {
        (t_a * r_b + t_b * r_a) / (r_a + r_b)
    } else {
        t_a
    };
    if t <= 0.0 {
        (from, DVec3::ZERO)
    } else if t >= length {
        (to, DVec3::ZERO)
    } else {
        (from + along * t, along)
    }
}

/// Returns the fraction of a step, at most 1, that keeps a point within a polygon.
pub(super) fn room(at: DVec3, step: DVec3, corners: &[DVec3]) -> f64 {
    if let [from, to] = *corners {
        let end = if step.dot(to - from) > 0.0 { to } else { from };
        return (end.distance(at) / step.length().max(1e-300)).min(1.0);
    }
    let normal = area_normal(corners);
    let mut share: f64 = 1.0;
    for (from, to) in edges(corners) {
        let inward = normal.cross(to - from);
        let (depth, toward) = (inward.dot(at - from), -inward.dot(step));
        // Along the edge at which it is caught, rounding does not count as motion.
        let least = 1e-24 * step.length_squared() * inward.length_squared();
        if toward > 0.0 && toward * toward > least && toward * share > depth {
            share = (depth / toward).max(0.0);
        }
    }
    share
}

/// Returns minus the sum of logarithms of the distances from a polygon's edges; infinite on them and outside.
pub(super) fn barrier(at: DVec3, corners: &[DVec3]) -> f64 {
    if corners.len() < 3 {
        return 0.0;
    }
    let normal = area_normal(corners).normalize_or_zero();
    let depths = edges(corners).map(|(a, b)| normal.cross(b - a).normalize_or_zero().dot(at - a));
    // The logarithm of the product, unless that vanishes: logarithms take most of the time.
    let (mut sum, mut product) = (0.0, 1.0);
    for depth in depths {
        if depth <= 0.0 {
            return f64::INFINITY;
        }
        product *= depth;
        if !(1e-200..1e200).contains(&product) {
            sum -= product.ln();
            product = 1.0;
        }
    }
    sum - product.ln()
}

pub(super) fn add_barrier(
    at: DVec3,
    corners: &[DVec3],
    weight: f64,
    axes: &[DVec3; 2],
    block: &mut Block,
) {
    if corners.len() < 3 {
        return;
    }
    let normal = area_normal(corners).normalize_or_zero();
    for (a, b) in edges(corners) {
        let inward = normal.cross(b - a).normalize_or_zero();
        let slope = axes.map(|axis| inward.dot(axis) / inward.dot(at - a));
        for k in 0..2 {
            block.right[k] += weight * slope[k];
            for l in 0..2 {
                block.diagonal[k][l] += weight * slope[k] * slope[l];
            }
        }
    }
}
