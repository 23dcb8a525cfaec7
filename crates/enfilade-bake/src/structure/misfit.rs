//! How badly the triangles of a model fit together.
//!
//! Exporters and scanners move vertices, and a hurried hand leaves walls a bit short: then two triangles that are meant to
//! share an edge do not, and a slit as wide as the error lies between them. In a model that was made like that as a whole,
//! no slit of that width means anything.
//!
//! Measured at edges that only one triangle has: how far the middle is from the next triangle. Edges in the open, far from
//! all others, are the rims of sheets and say nothing; in a model that fits most edges are shared.
//!
//! Time: a box query for each edge of a few thousand triangles. In doubt the result is 0, and the model is baked as if it fitted.

use enfilade_geom::{Aabb, Allowance, Bvh, DVec3, Triangle, closest_point_on_triangle};
use rayon::prelude::*;

/// So many triangles are looked at, about.
const SAMPLES: usize = 4096;
/// An edge that is farther than this from all other triangles is the rim of a sheet. [Units: wu]
const RIM: f64 = 0.05;
/// Edges that are nearer than this to another triangle fit: rounding. [Units: wu]
const FITS: f64 = 1e-5;
/// Share of all edges that must not fit before the model counts as made like that.
const MOST: f64 = 0.5;
/// Of the edges that do not fit, this share is nearer to the next triangle than what is returned.
const QUANTILE: f64 = 0.95;

/// How far edges that are meant to be one lie apart, nearly all of them; 0 where most fit. [Units: wu]
///
/// The order of the triangles has no say.
pub(crate) fn misfit(triangles: &[Triangle], bvh: &Bvh, allowance: &Allowance) -> f64 {
    let sampled: Vec<usize> = sampled(triangles);
    let mut gaps: Vec<f64> = sampled
        .par_iter()
        .flat_map_iter(|&t| (0..3).map(move |k| gap(triangles, bvh, t, k, allowance)))
        .collect();
    let n_edges = gaps.len();
    gaps.retain(|d| *d > FITS && *d < RIM);
    if gaps.len() as f64 <= MOST * n_edges as f64 {
        return 0.0;
    }
    gaps.sort_by(f64::total_cmp);
    gaps[((gaps.len() - 1) as f64 * QUANTILE) as usize]
}

/// About [`SAMPLES`] triangles, chosen by where they are.
fn sampled(triangles: &[Triangle]) -> Vec<usize> {
    let every = triangles.len().div_ceil(SAMPLES) as u64;
    let is_chosen = |t: &Triangle| {
        // A sum, so that it does not matter with which vertex a file begins.
        let mixed = t.iter().map(|p| mixed(*p));
        mixed.fold(0_u64, u64::wrapping_add) % every == 0
    };
    (0..triangles.len())
        .filter(|&t| is_chosen(&triangles[t]))
        .collect()
}

/// A point as a number without pattern (the finalizer of SplitMix64, Steele, Lea & Flood 2014).
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

/// Distance from the middle of the edge that begins at vertex `k` of triangle `t` to the next triangle; 0 where one has the
/// same edge, infinite where none is near.
fn gap(triangles: &[Triangle], bvh: &Bvh, t: usize, k: usize, allowance: &Allowance) -> f64 {
    let [a, b] = [triangles[t][k], triangles[t][(k + 1) % 3]];
    let middle = a.midpoint(b);
    let mut nearest = f64::INFINITY;
    // Nothing is nearer than one that has the same edge.
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
        for jitter in [1e-3, 5e-3] {
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
