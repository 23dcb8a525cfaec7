//! Triangles that run through each other.

use enfilade_geom::{Aabb, Bvh, DVec3, Triangle, triangle_area_normal};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Number of triangles whose pairs are collected before they are visited.
const BLOCK: usize = 1 << 12;

/// Visits each pair of triangles where an edge of one runs through the inside of the other: the first triangle and
/// the point. `false` if the search stopped after `budget` pairs whose boxes meet.
///
/// Edges that only touch, and triangles in one plane, do not cross: both ends of the edge must lie more than
/// `distance` off the plane, and the point more than that inside. [Units: wu] A tree of boxes finds the pairs:
/// `n log n` for `n` triangles, plus the pairs. The order of visits, and where the search stops, do not depend on the
/// number of threads.
pub(crate) fn for_each(
    triangles: &[Triangle],
    distance: f64,
    budget: u64,
    is_pair: impl Fn(usize, usize) -> bool + Sync,
    mut visit: impl FnMut(usize, DVec3),
) -> bool {
    if budget == 0 || triangles.is_empty() {
        return triangles.is_empty();
    }
    let bvh = Bvh::build(triangles);
    let pairs_of = |t: usize, most: u64| {
        let mut pairs = Pairs::default();
        bvh.for_each_in_box(&Aabb::of_points(&triangles[t]), |u| {
            let u = u as usize;
            if u <= t || pairs.n == most {
                return;
            }
            pairs.n += 1;
            if is_pair(t, u) {
                pairs
                    .crossings
                    .extend(crossing(&triangles[t], &triangles[u], distance));
            }
        });
        pairs
    };
    let mut left = budget;
    for block in (0..triangles.len()).step_by(BLOCK) {
        let block = block..triangles.len().min(block + BLOCK);
        let counted = AtomicU64::new(0);
        let found: Option<Vec<Pairs>> = block
            .clone()
            .into_par_iter()
            .map(|t| {
                let pairs = pairs_of(t, left);
                let before = counted.fetch_add(pairs.n, Ordering::Relaxed);
                (before + pairs.n < left).then_some(pairs)
            })
            .collect();
        let mut found = found.map(Vec::into_iter);
        for t in block {
            // Where the budget ends, one triangle after the other.
            let next = found.as_mut().and_then(Iterator::next);
            let pairs = next.unwrap_or_else(|| pairs_of(t, left));
            left -= pairs.n;
            pairs.crossings.into_iter().for_each(|at| visit(t, at));
            if left == 0 {
                return false;
            }
        }
    }
    true
}

/// The pairs of a triangle with later ones whose boxes meet.
#[derive(Default)]
struct Pairs {
    n: u64,
    crossings: Vec<DVec3>,
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

    #[test]
    fn a_search_stops_after_the_same_pairs_for_any_number_of_threads() {
        // More triangles than a block, every other one through the next.
        let sheet = |k: usize| {
            let x = k as f64;
            let p = |dx: f64, y: f64, z: f64| DVec3::new(x + dx, y, z);
            if k.is_multiple_of(2) {
                [p(0.0, 0.0, 0.0), p(1.5, 0.0, 0.0), p(0.0, 1.0, 0.0)]
            } else {
                [p(0.0, 0.3, -1.0), p(0.0, 0.3, 1.0), p(0.1, 0.5, 1.0)]
            }
        };
        let all: Vec<Triangle> = (0..2 * BLOCK).map(sheet).collect();
        let found = |budget: u64, n_threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads);
            pool.build().expect("threads").install(|| {
                let mut at = Vec::new();
                let is_done = for_each(&all, 1e-5, budget, |_, _| true, |t, p| at.push((t, p)));
                (at, is_done)
            })
        };
        let whole = found(u64::MAX, 2);
        assert!(whole.1 && whole.0.len() > BLOCK / 2, "{}", whole.0.len());
        for budget in [1, 1000, 3 * BLOCK as u64 / 4] {
            let one = found(budget, 1);
            assert!(!one.1 && one.0 == whole.0[..one.0.len()]);
            assert_eq!(found(budget, 3), one);
        }
    }
}
