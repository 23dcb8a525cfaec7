//! Scores of portals, sampled with rays.
//!
//! Two metrics, compared in `docs/benchmarks/bsp.md`: how much of the scene sees a portal (Lefebvre &
//! Hornus 2003, §3.0.2; a fixed set of directions replaces their cube map), and how many more triangles a
//! sampled view draws without it.

use std::collections::BTreeMap;

use enfilade_cpg::{Portal, World};
use enfilade_geom::{Bvh, DVec3, Ray, Triangle, Winding};
use rayon::prelude::*;

use super::cost::{CostModel, costs};
use super::merge::{Eyes, PairScores};

/// Texels along an edge of the cube map.
const CUBE: usize = 8;
/// Points on each portal that has no more pieces than this.
const POINTS: usize = 4;
/// Length of a ray that hits nothing, as a share of the scene's size.
const SKY: f64 = 1.0;

/// Returns all structural triangles of a world.
pub(super) fn triangles_of(world: &World) -> Vec<Triangle> {
    world
        .batches
        .iter()
        .flat_map(|b| b.primitive.triangles())
        .collect()
}

/// Returns directions through the texels of a cube map with their solid angles.
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
            // A texel's area seen from the center, at its distance and slant.
            let solid_angle = (2.0 / CUBE as f64).powi(2) / length.powi(3);
            out.push((d / length, solid_angle));
        }
    }
    out
}

/// Score of a portal by the paper's metric (Lefebvre & Hornus 2003, §3.0.2). Lower is better.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PortalScore {
    /// Volume that sees the portal. [Units: wu³]
    pub visible_volume: f64,
    /// Difference between the costs of its two cells.
    pub balance: f64,
}

impl PortalScore {
    /// Returns visible volume times balance: the portal of highest score is removed first.
    #[must_use]
    pub fn score(&self) -> f64 {
        self.visible_volume * self.balance
    }
}

/// Returns the scores of all portals of a world.
///
/// Samples 384 rays, through the texels of a cube map, from each of several points: about four on a portal, but at
/// least one on every piece of it, each weighted by its share of the area. Deterministic; takes the time of the rays.
#[must_use]
pub fn portal_scores(world: &World, cost: &CostModel) -> Vec<PortalScore> {
    let costs = costs(world, cost);
    let of_portal = |(p, visible_volume): (&Portal, f64)| {
        let [a, b] = p.cells.map(|c| costs[c.0 as usize]);
        PortalScore {
            visible_volume,
            balance: (a - b).abs(),
        }
    };
    let portals = world.graph.portals.iter();
    portals.zip(volumes(world)).map(of_portal).collect()
}

/// Returns, for each pair of cells, the volume that sees their most visible portal. [Units: wu³]
pub(super) fn visible_volumes(world: &World) -> PairScores {
    let mut out = BTreeMap::new();
    for (p, volume) in world.graph.portals.iter().zip(volumes(world)) {
        let [a, b] = p.cells.map(|c| c.0);
        let slot = out.entry([a.min(b), a.max(b)]).or_insert(0.0);
        *slot = f64::max(*slot, volume);
    }
    PairScores(out)
}

/// Returns the volume that sees each portal. [Units: wu³]
fn volumes(world: &World) -> Vec<f64> {
    let bvh = Bvh::build(&triangles_of(world));
    let far = SKY * bvh.bounds().size().length().max(1.0);
    let directions = cube_map();
    let of_portal = |p: &Portal| {
        let normal = DVec3::from(p.normal.map(f64::from));
        let (mut sum, mut weights) = (0.0, 0.0);
        for (point, weight) in points_on(&p.pieces) {
            weights += weight;
            for &(direction, solid_angle) in &directions {
                // Off the plane, so that the ray does not hit surfaces in it at once.
                let origin = point + normal * 1e-4_f64.copysign(direction.dot(normal));
                let ray = Ray {
                    origin,
                    direction,
                    t_max: far,
                };
                let t = bvh.closest_hit(&ray, |_| false).map_or(far, |h| h.t);
                sum += weight * solid_angle * t.powi(3) / 3.0;
            }
        }
        if weights > 0.0 { sum / weights } else { 0.0 }
    };
    world.graph.portals.par_iter().map(of_portal).collect()
}

/// Returns points on every piece of a portal, [`POINTS`] in total or one per piece, with the area each represents.
fn points_on(pieces: &[Vec<[f32; 3]>]) -> impl Iterator<Item = (DVec3, f64)> + '_ {
    let most = POINTS.div_ceil(pieces.len().max(1));
    pieces.iter().flat_map(move |piece| {
        let corners: Vec<DVec3> = piece
            .iter()
            .map(|p| DVec3::from(p.map(f64::from)))
            .collect();
        let middle = corners.iter().sum::<DVec3>() / corners.len().max(1) as f64;
        let step = corners.len().div_ceil((most - 1).max(1)).max(1);
        let halfway = corners.iter().step_by(step).take(most - 1);
        let mut points = vec![middle];
        points.extend(halfway.map(|&c| (c + middle) * 0.5));
        let weight = Winding::new(corners).area() / points.len() as f64;
        points.into_iter().map(move |p| (p, weight))
    })
}

/// Rays of each sampled view.
const RAYS: usize = 160;
/// Steps along a ray at which cells are located; a cell thinner than a step may be missed.
const STEPS: usize = 48;

/// Returns, for each cell, the eyes whose view reaches it. Eyes spread over the indoors by a fixed sequence
/// that starts at `first`; each looks in a level direction of its own with a field of view of 90 by 60 degrees.
pub(super) fn views(world: &World, n_eyes: usize, first: u32) -> Eyes {
    let locator = &world.graph.locator;
    let bvh = Bvh::build(&triangles_of(world));
    let indoor = |p: DVec3| locator.locate(p).filter(|c| !world.graph[*c].outdoor);
    let b = locator.bounds;
    // Halton sequence: even, and the same every time.
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
                    // The last step ends just before the surface.
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

#[cfg(test)]
mod tests {
    use super::*;

    // Covers P2.
    #[test]
    fn every_piece_of_a_portal_is_sampled_and_stands_for_its_area() {
        for n in 1..12_usize {
            // A row of rectangles, each twice as wide as the one before.
            let from = |i: usize| (1 << i) as f32;
            let piece = |i: usize| {
                let (a, b) = (from(i), from(i + 1));
                vec![[a, 0.0, 0.0], [b, 0.0, 0.0], [b, 3.0, 0.0], [a, 3.0, 0.0]]
            };
            let pieces: Vec<_> = (0..n).map(piece).collect();
            let points: Vec<(DVec3, f64)> = points_on(&pieces).collect();
            assert!(points.len() <= n.max(2 * POINTS), "{}", points.len());
            for i in 0..n {
                let [a, b] = [from(i), from(i + 1)].map(f64::from);
                let inside = points.iter().filter(|p| p.0.x > a && p.0.x < b);
                let sum: f64 = inside.map(|p| p.1).sum();
                assert!((sum - 3.0 * (b - a)).abs() < 1e-9, "{n} {i}: {sum}");
            }
        }
    }
}
