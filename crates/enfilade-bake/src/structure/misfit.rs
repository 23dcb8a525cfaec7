//! How badly the triangles of a model fit together.
//!
//! Exporters and scanners move vertices, and hasty modeling leaves walls a bit short. Then two triangles that should
//! share an edge do not, and a slit as wide as the error lies between them. If a whole model was made like that,
//! no slit of that width carries meaning.
//!
//! Measures, at edges with a single triangle, the distance from the edge's midpoint to the nearest other triangle.
//! Edges far from all other triangles are rims of sheets and carry no information. If a model fits, most are shared to
//! the bit; if it was moved, by however little, none is.
//!
//! Time: a box query for each edge of a few thousand triangles. In doubt the result is 0: the model counts as fitting.

use enfilade_geom::{Aabb, Allowance, Bvh, DVec3, Triangle, closest_point_on_triangle};
use rayon::prelude::*;

/// Approximate number of triangles sampled.
const SAMPLES: usize = 4096;
/// An edge farther than this from all other triangles is the rim of a sheet. [Units: wu]
const RIM: f64 = 0.05;
/// Least share of all edges that must not fit for a misfit to count.
const MOST: f64 = 0.5;
/// Quantile, among the edges that do not fit, of the returned distance.
const QUANTILE: f64 = 0.95;

/// Returns how far apart nearly all edges lie that should coincide; 0 if most fit. [Units: wu]
///
/// Independent of the order of the triangles.
pub(crate) fn misfit(triangles: &[Triangle], bvh: &Bvh, allowance: &Allowance) -> f64 {
    let sampled: Vec<usize> = sampled(triangles);
    let mut gaps: Vec<f64> = sampled
        .par_iter()
        .flat_map_iter(|&t| (0..3).map(move |k| gap(triangles, bvh, t, k, allowance)))
        .collect();
    let n_edges = gaps.len();
    // Shared edges have exactly none.
    gaps.retain(|d| *d > 0.0 && *d < RIM);
    if gaps.len() as f64 <= MOST * n_edges as f64 {
        return 0.0;
    }
    gaps.sort_by(f64::total_cmp);
    gaps[((gaps.len() - 1) as f64 * QUANTILE) as usize]
}

/// Returns about [`SAMPLES`] triangles, chosen by position.
fn sampled(triangles: &[Triangle]) -> Vec<usize> {
    let every = triangles.len().div_ceil(SAMPLES) as u64;
    let is_chosen = |t: &Triangle| {
        // A sum, so that the first vertex in the file does not matter.
        let mixed = t.iter().map(|p| mixed(*p));
        mixed.fold(0_u64, u64::wrapping_add) % every == 0
    };
    (0..triangles.len())
        .filter(|&t| is_chosen(&triangles[t]))
        .collect()
}

/// Hashes a point (the finalizer of SplitMix64, Steele, Lea & Flood 2014).
fn mixed(p: DVec3) -> u64 {
    p.to_array().iter().fold(0, |sum: u64, x| {
        let mut z = sum
            .wrapping_add(x.to_bits())
            .wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    })
}

/// Returns the distance from the midpoint of the edge that begins at vertex `k` of triangle `t` to the nearest other
/// triangle; 0 if one shares the edge, infinite if none is near.
fn gap(triangles: &[Triangle], bvh: &Bvh, t: usize, k: usize, allowance: &Allowance) -> f64 {
    let [a, b] = [triangles[t][k], triangles[t][(k + 1) % 3]];
    let middle = a.midpoint(b);
    let mut nearest = f64::INFINITY;
    // No distance is below that of a shared edge.
    bvh.any_in_box(&Aabb::new(middle, middle).expanded(RIM), |other| {
        if other as usize != t {
            let other = &triangles[other as usize];
            let has = |p: DVec3| other.contains(&p);
            let distance = if has(a) && has(b) {
                0.0
            } else {
                closest_point_on_triangle(middle, other).distance(middle)
            };
            nearest = nearest.min(distance);
        }
        nearest == 0.0 || !allowance.spend(1)
    });
    nearest
}

#[cfg(test)]
mod tests {
    use enfilade_testkit::{Disturbance, disturb, furnished_house};

    use super::*;
    use crate::structure::structural_triangles;

    fn misfit_of(jitter: f64) -> f64 {
        let mut scene = furnished_house().scene;
        if jitter > 0.0 {
            scene = disturb(
                &scene,
                &Disturbance {
                    jitter,
                    ..Disturbance::default()
                },
            );
        }
        let (_, triangles) = structural_triangles(&scene);
        misfit(&triangles, &Bvh::build(&triangles), &Allowance::default())
    }

    #[test]
    fn a_model_that_fits_has_none_and_moved_vertices_show_by_how_much() {
        assert_eq!(misfit_of(0.0), 0.0);
        for jitter in [1e-5, 1e-3, 5e-3] {
            let found = misfit_of(jitter) / jitter;
            // The distance of two lines in space, each with ends that are off by a normal deviation of `jitter`.
            assert!((1.0..3.5).contains(&found), "{found} times {jitter}");
        }
    }

    #[test]
    fn the_order_of_triangles_and_vertices_has_no_say() {
        let moved = Disturbance {
            jitter: 3e-3,
            ..Disturbance::default()
        };
        let (_, triangles) = structural_triangles(&disturb(&furnished_house().scene, &moved));
        let other: Vec<Triangle> = triangles
            .iter()
            .rev()
            .map(|[a, b, c]| [*b, *c, *a])
            .collect();
        let of = |t: &[Triangle]| misfit(t, &Bvh::build(t), &Allowance::default());
        assert!((of(&triangles) - of(&other)).abs() < 1e-12);
    }
}
