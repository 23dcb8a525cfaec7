//! Triangles that run through each other.

use enfilade_geom::{Aabb, Bvh, DVec3, Triangle, triangle_area_normal};

/// Visits each pair of triangles where an edge of one runs through the inside of the other: the first triangle and
/// the point. `false` if the search stopped after `budget` pairs whose boxes meet.
///
/// Edges that only touch, and triangles in one plane, do not cross: both ends of the edge must lie more than
/// `distance` off the plane, and the point more than that inside. [Units: wu] A tree of boxes finds the pairs:
/// `n log n` for `n` triangles, plus the pairs.
pub(crate) fn for_each(
    triangles: &[Triangle],
    distance: f64,
    budget: u64,
    is_pair: impl Fn(usize, usize) -> bool,
    mut visit: impl FnMut(usize, DVec3),
) -> bool {
    if budget == 0 || triangles.is_empty() {
        return triangles.is_empty();
    }
    let bvh = Bvh::build(triangles);
    let mut left = budget;
    for (t, corners) in triangles.iter().enumerate() {
        bvh.for_each_in_box(&Aabb::of_points(corners), |u| {
            let u = u as usize;
            if u <= t || left == 0 {
                return;
            }
            left -= 1;
            if is_pair(t, u)
                && let Some(at) = crossing(corners, &triangles[u], distance)
            {
                visit(t, at);
            }
        });
        if left == 0 {
            return false;
        }
    }
    true
}

/// Returns the point where an edge of one triangle runs through the inside of the other.
fn crossing(a: &Triangle, b: &Triangle, distance: f64) -> Option<DVec3> {
    let through = |edges: &Triangle, face: &Triangle| {
        (0..3).find_map(|k| pierced(edges[k], edges[(k + 1) % 3], face, distance))
    };
    through(a, b).or_else(|| through(b, a))
}

/// Returns the point where a segment runs through a triangle, more than `distance` from its edges.
fn pierced(from: DVec3, to: DVec3, face: &Triangle, distance: f64) -> Option<DVec3> {
    let normal = triangle_area_normal(face).try_normalize()?;
    let (d, e) = ((from - face[0]).dot(normal), (to - face[0]).dot(normal));
    if d * e >= 0.0 || d.abs().min(e.abs()) <= distance {
        return None;
    }
    let at = from + (to - from) * (d / (d - e));
    let is_inside = (0..3).all(|k| {
        let (p, q) = (face[k], face[(k + 1) % 3]);
        let inwards = normal.cross(q - p).normalize_or_zero();
        (at - p).dot(inwards) > distance
    });
    is_inside.then_some(at)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_runs_through_crosses_and_what_touches_does_not() {
        let floor = [DVec3::ZERO, DVec3::X * 4.0, DVec3::Y * 4.0];
        let upright = |x: f64, low: f64| {
            [
                DVec3::new(x, 1.0, low),
                DVec3::new(x, 1.5, 2.0),
                DVec3::new(x, 0.5, 2.0),
            ]
        };
        let n = |low: f64, x: f64, budget: u64| {
            let mut n = 0;
            let all = [floor, upright(x, low)];
            let is_done = for_each(&all, 1e-5, budget, |_, _| true, |_, _| n += 1);
            (n, is_done)
        };
        assert_eq!(n(-1.0, 1.0, 9), (1, true));
        assert_eq!(n(0.0, 1.0, 9), (0, true));
        assert_eq!(n(-1.0, 3.5, 9), (0, true));
        assert_eq!(n(-1.0, 1.0, 0), (0, false));
    }
}
