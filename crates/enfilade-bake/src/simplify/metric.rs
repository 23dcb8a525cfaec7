//! What portals are worth, sampled with rays.
//!
//! Two ways, compared in `docs/benchmarks/bsp.md`: how much of the scene sees a portal (Lefebvre &
//! Hornus 2003, §3.0.2; their cube map is a fixed set of directions here), and how many triangles a
//! sampled view draws more without it.

use std::collections::BTreeMap;

use enfilade_cpg::World;
use enfilade_geom::{Bvh, DVec3, Ray, Triangle};
use rayon::prelude::*;

use super::merge::{Eyes, PairScores};

/// Texels along an edge of the cube map.
const CUBE: usize = 8;
/// Points on each portal.
const POINTS: usize = 4;
/// A ray that meets nothing goes this far, as a share of the scene's size.
const SKY: f64 = 1.0;

/// All structural triangles of a world.
pub(super) fn triangles_of(world: &World) -> Vec<Triangle> {
    world
        .batches
        .iter()
        .flat_map(|b| {
            b.primitive.indices.chunks_exact(3).map(|t| {
                [0, 1, 2].map(|k| DVec3::from(b.primitive.positions[t[k] as usize].map(f64::from)))
            })
        })
        .collect()
}

/// Directions through the texels of a cube map with their solid angles.
fn cube_map() -> Vec<(DVec3, f64)> {
    let mut out = Vec::with_capacity(6 * CUBE * CUBE);
    let at = |i: usize| (2.0 * i as f64 + 1.0) / CUBE as f64 - 1.0;
    for face in 0..6 {
        for (u, v) in (0..CUBE * CUBE).map(|i| (at(i % CUBE), at(i / CUBE))) {
            let mut d = DVec3::ZERO;
            let (axis, sign) = (face % 3, if face < 3 { 1.0 } else { -1.0 });
            d[axis] = sign;
            d[(axis + 1) % 3] = u;
            d[(axis + 2) % 3] = v;
            let length = d.length();
            // A texel's area seen from the middle, at its distance and slant.
            let solid_angle = (2.0 / CUBE as f64).powi(2) / length.powi(3);
            out.push((d / length, solid_angle));
        }
    }
    out
}

/// The volume from which each pair of cells' most visible portal is seen. [Units: wu³]
pub(super) fn visible_volumes(world: &World) -> PairScores {
    let bvh = Bvh::build(&triangles_of(world));
    let far = SKY * bvh.bounds().size().length().max(1.0);
    let directions = cube_map();
    let volumes: Vec<([u32; 2], f64)> = world
        .graph
        .portals
        .par_iter()
        .map(|p| {
            let normal = DVec3::from(p.normal.map(f64::from));
            let mut sum = 0.0;
            let mut n = 0;
            for point in points_on(&p.pieces) {
                n += 1;
                for &(direction, solid_angle) in &directions {
                    // Off the plane, lest what lies in it is met at once.
                    let origin = point + normal * 1e-4_f64.copysign(direction.dot(normal));
                    let t = bvh
                        .closest_hit(
                            &Ray {
                                origin,
                                direction,
                                t_max: far,
                            },
                            |_| false,
                        )
                        .map_or(far, |h| h.t);
                    sum += solid_angle * t.powi(3) / 3.0;
                }
            }
            let [a, b] = p.cells.map(|c| c.0);
            ([a.min(b), a.max(b)], sum / f64::from(n.max(1)))
        })
        .collect();
    let mut out = BTreeMap::new();
    for (pair, volume) in volumes {
        let slot = out.entry(pair).or_insert(0.0);
        *slot = f64::max(*slot, volume);
    }
    PairScores(out)
}

/// Middles of the largest pieces and points halfway from there to their corners.
fn points_on(pieces: &[Vec<[f32; 3]>]) -> impl Iterator<Item = DVec3> + '_ {
    pieces
        .iter()
        .flat_map(|piece| {
            let corners: Vec<DVec3> = piece
                .iter()
                .map(|p| DVec3::from(p.map(f64::from)))
                .collect();
            let middle = corners.iter().sum::<DVec3>() / corners.len().max(1) as f64;
            let step = corners.len().div_ceil(POINTS - 1).max(1);
            let halfway: Vec<DVec3> = corners
                .iter()
                .step_by(step)
                .map(|&c| (c + middle) * 0.5)
                .collect();
            std::iter::once(middle).chain(halfway)
        })
        .take(POINTS)
}

/// Eyes of which views are sampled.
const RAYS: usize = 160;
/// Steps along a ray at which the cell is asked; a cell thinner than a step may be missed.
const STEPS: usize = 48;

/// For each cell the eyes whose view reaches it. Eyes are spread over the indoors by a fixed sequence
/// that starts at `first`, each looking a level way of its own with a field of 90 by 60 degrees.
pub(super) fn views(world: &World, n_eyes: usize, first: u32) -> Eyes {
    let locator = &world.graph.locator;
    let bvh = Bvh::build(&triangles_of(world));
    let indoor = |p: DVec3| {
        locator
            .locate(p)
            .filter(|c| !world.graph.cells[c.0 as usize].outdoor)
    };
    let b = locator.bounds;
    // Halton's sequence: even, and the same every time.
    let halton = |mut i: u32, base: u32| {
        let (mut f, mut r) = (1.0, 0.0);
        while i > 0 {
            f /= f64::from(base);
            r += f * f64::from(i % base);
            i /= base;
        }
        r
    };
    let mut eyes: Vec<(DVec3, f64)> = Vec::with_capacity(n_eyes);
    let mut take = |is_eye: &dyn Fn(DVec3) -> bool| {
        for i in (first + 1)..(first + 1 + 400 * n_eyes as u32) {
            if eyes.len() == n_eyes {
                break;
            }
            let p = b.min + b.size() * DVec3::new(halton(i, 2), halton(i, 3), halton(i, 5));
            if is_eye(p) {
                eyes.push((p, halton(i, 7) * std::f64::consts::TAU));
            }
        }
    };
    take(&|p| indoor(p).is_some());
    if world.graph.cells.iter().all(|c| c.outdoor) {
        take(&|p| locator.locate(p).is_some());
    }
    let far = b.size().length().max(1.0);
    let seen: Vec<Vec<u32>> = eyes
        .par_iter()
        .map(|&(eye, yaw)| {
            let mut cells: Vec<u32> = locator.locate(eye).iter().map(|c| c.0).collect();
            for k in 0..RAYS as u32 {
                let (x, y) = (2.0 * halton(k + 1, 2) - 1.0, 2.0 * halton(k + 1, 3) - 1.0);
                let d = DVec3::new(x, 0.577 * y, 1.0);
                let (s, c) = yaw.sin_cos();
                let direction = DVec3::new(c * d.x + s * d.z, d.y, c * d.z - s * d.x).normalize();
                let t_max = bvh
                    .closest_hit(
                        &Ray {
                            origin: eye,
                            direction,
                            t_max: far,
                        },
                        |_| false,
                    )
                    .map_or(far, |h| h.t);
                for step in 1..=STEPS {
                    // Just before the surface at last.
                    let t = t_max * (step as f64 / STEPS as f64) * (1.0 - 1e-6);
                    cells.extend(locator.locate(eye + direction * t).iter().map(|c| c.0));
                }
            }
            cells.sort_unstable();
            cells.dedup();
            cells
        })
        .collect();
    let mut bits = vec![vec![0_u64; n_eyes.div_ceil(64)]; world.graph.cells.len()];
    for (eye, cells) in seen.iter().enumerate() {
        for &c in cells {
            bits[c as usize][eye / 64] |= 1 << (eye % 64);
        }
    }
    Eyes(bits)
}
