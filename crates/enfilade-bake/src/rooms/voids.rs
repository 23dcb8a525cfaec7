//! Shallow voids: the air above a hung ceiling, below a raised floor.
//!
//! Nothing can get into them and no ball of a room's size fits, yet they are air between two front
//! faces, not the inside of anything. They belong to the room whose ceiling they lie on. Voxels are
//! too coarse for them, so rays find them: straight up from every surface that faces up, a
//! surface that faces down, close above.
//!
//! Cost: a ray for each 0.5 m² of level surface, and a walk down a few voxels.

use enfilade_geom::{Allowance, Attitude, Bvh, DVec3, Ray, Triangle, triangle_area_normal};
use rayon::prelude::*;

use crate::budget::WORK_A_LOOK;
use crate::structure::count_backs;

/// Voids are lower than this. [Units: wu] Higher ones are rooms of their own.
const MAX_HEIGHT: f64 = 0.5;
/// Largest thickness between a void and its room. [Units: wu]
const MAX_CEILING: f64 = 0.4;
/// Surface area per sample. [Units: wu²]
const SAMPLE_AREA: f64 = 0.5;
/// Most samples on one triangle.
const MAX_SAMPLES: usize = 64;

/// Returns points in shallow voids, each with the region below its floor, in order of the triangles.
///
/// `region_at` returns the region of a point, 0 if there is none.
#[must_use]
pub(crate) fn shallow_voids(
    triangles: &[Triangle],
    bvh: &Bvh,
    region_at: &(dyn Fn(DVec3) -> u32 + Sync),
    allowance: &Allowance,
) -> Vec<(DVec3, u32)> {
    triangles
        .par_iter()
        .flat_map_iter(|t| {
            let n = triangle_area_normal(t);
            let faces_up = n.y > 0.0 && Attitude::of(n) == Attitude::Level;
            let wanted = (n.length() * 0.5 / SAMPLE_AREA).ceil() as usize;
            let samples = if faces_up {
                wanted.clamp(1, MAX_SAMPLES)
            } else {
                0
            };
            let samples_in_turn = (0..samples).filter(allowance.each(WORK_A_LOOK));
            samples_in_turn.filter_map(move |k| {
                let p = sample(t, k, samples);
                let ray = Ray {
                    origin: p + DVec3::Y * 1e-3,
                    direction: DVec3::Y,
                    t_max: MAX_HEIGHT,
                };
                let hit = bvh.closest_hit(&ray, |_| false)?;
                if !hit.front {
                    return None; // the back of a face: inside something
                }
                let middle = p + DVec3::Y * (hit.t * 0.5);
                // Where solids overlap, rays hit fronts up and down and backs to the sides.
                if count_backs(bvh, &[middle], allowance).0 > 0.0 {
                    return None;
                }
                let mut depth = 0.05;
                while depth <= MAX_CEILING {
                    let region = region_at(p - DVec3::Y * depth);
                    if region != 0 {
                        return Some((middle, region));
                    }
                    depth += 0.05;
                }
                None
            })
        })
        .collect()
}

/// Returns a point behind each triangle of the `stairs`, half way to the next surface, with the region that the flood
/// found there: it ignores stairs. A flight belongs to the room that it stands in, with everything inside it.
#[must_use]
pub(crate) fn inside_stairs(
    stairs: &[Triangle],
    bvh: &Bvh,
    region_at: &(dyn Fn(DVec3) -> u32 + Sync),
    allowance: &Allowance,
) -> Vec<(DVec3, u32)> {
    let in_turn = stairs.par_iter().filter(allowance.each(WORK_A_LOOK));
    let inside = in_turn.filter_map(|t| {
        let inward = -triangle_area_normal(t).try_normalize()?;
        let origin = (t[0] + t[1] + t[2]) / 3.0 + inward * 1e-4;
        let ray = Ray {
            origin,
            direction: inward,
            t_max: f64::INFINITY,
        };
        let hit = bvh.closest_hit(&ray, |_| false)?;
        let middle = origin + inward * (hit.t * 0.5);
        Some((middle, region_at(middle))).filter(|_| !hit.front)
    });
    inside.filter(|(_, region)| *region != 0).collect()
}

/// Returns the `k`-th of `n` points spread over a triangle by the R2 sequence (Roberts 2018), folded.
fn sample(t: &Triangle, k: usize, n: usize) -> DVec3 {
    if n == 1 {
        return (t[0] + t[1] + t[2]) / 3.0;
    }
    let i = k as f64 + 1.0;
    let (mut u, mut v) = (
        (0.5 + i * 0.754_877_666_2).fract(),
        (0.5 + i * 0.569_840_291).fract(),
    );
    if u + v > 1.0 {
        (u, v) = (1.0 - u, 1.0 - v);
    }
    t[0] + (t[1] - t[0]) * u + (t[2] - t[0]) * v
}
