//! Arms of forks: measures how deep they are, and how round their walls.
//!
//! Crossing corridors of a building are forks, too, but one room to their architect. Corridors have flat walls at right
//! angles: with θ the direction of a normal about the axis, the mean of `exp(4iθ)` has length one there and zero in any
//! round tube.

use std::f64::consts::TAU;

use enfilade_geom::{Bvh, DVec3, Ray, Triangle, triangle_area_normal};

use super::balls::Balls;
use super::rule::{Arm, ArmFacts, classify_arm};

/// Rays about an axis: enough for a polygon of a dozen sides to count as round.
const RAYS: usize = 32;

/// The walls around a place, for normals.
pub(crate) struct Walls<'a> {
    pub(crate) triangles: &'a [Triangle],
    pub(crate) bvh: &'a Bvh,
}

/// A piece of the space around a fork.
pub(crate) struct ArmPiece {
    /// Parts, nearest to the middle of the fork first.
    pub(crate) parts: Vec<u32>,
    /// Mean radius of its balls. [Units: wu]
    pub(crate) radius: f64,
    /// The place where it begins. [Units: wu]
    pub(crate) mouth: DVec3,
    pub(crate) kind: Arm,
}

/// Measures an arm. `piece` contains its parts, nearest first, with their distances from the middle of the fork,
/// where a ball of radius `removed` is removed; `radius` is that of the ball in the middle.
pub(crate) fn measure_arm(
    balls: &impl Balls,
    piece: &[(f64, u32)],
    removed: f64,
    radius: f64,
    walls: &Walls<'_>,
) -> ArmPiece {
    // Mean center of the balls of a stretch, given by distances in radii from the start of the arm.
    let stretch = |from: f64, to: f64| {
        let at = |d: f64| piece.partition_point(|p| (p.0 - removed) / radius < d);
        let from = at(from).min(piece.len() - 1);
        let within = &piece[from..at(to).max(from + 1)];
        let sum: DVec3 = within.iter().map(|p| balls.center(p.1)).sum();
        sum / within.len() as f64
    };
    let [mouth, middle, far] = [0.0, 1.0, 2.0].map(|d| stretch(d, d + 1.0));
    let depth = |p: &(f64, u32)| balls.center(p.1).distance(mouth) + balls.radius(p.1);
    let (enclosed, squareness) = squareness(middle, far - mouth, walls);
    let facts = ArmFacts {
        depth: piece.iter().map(depth).fold(0.0, f64::max),
        radius,
        enclosed,
        squareness,
    };
    let sum: f64 = piece.iter().map(|p| balls.radius(p.1)).sum();
    ArmPiece {
        parts: piece.iter().map(|p| p.1).collect(),
        radius: sum / piece.len() as f64,
        mouth,
        kind: classify_arm(&facts),
    }
}

impl Walls<'_> {
    /// Returns `true` if the walls around a point are those of a corridor, not of a tube. The axis is the level direction
    /// in which the nearest wall is farthest.
    pub(crate) fn are_of_corridor(&self, origin: DVec3, radius: f64) -> bool {
        let level = (0..RAYS).map(|i| {
            let (sin, cos) = (TAU * i as f64 / RAYS as f64).sin_cos();
            let direction = DVec3::new(cos, 0.0, sin);
            let ray = Ray {
                origin,
                direction,
                t_max: f64::INFINITY,
            };
            let hit = self.bvh.closest_hit(&ray, |_| false);
            (hit.map_or(f64::INFINITY, |h| h.t), direction)
        });
        let axis = level.max_by(|a, b| a.0.total_cmp(&b.0));
        let (enclosed, squareness) = squareness(origin, axis.map_or(DVec3::X, |a| a.1), self);
        let facts = ArmFacts {
            depth: f64::INFINITY,
            radius,
            enclosed,
            squareness,
        };
        classify_arm(&facts) == Arm::Corridor
    }
}

/// Returns the share of rays about an axis that meet a wall, and the length of the mean of `exp(4iθ)` over these walls.
fn squareness(origin: DVec3, axis: DVec3, walls: &Walls<'_>) -> (f64, f64) {
    let Some(axis) = axis.try_normalize() else {
        return (0.0, 0.0);
    };
    let (u, v) = axis.any_orthonormal_pair();
    let (mut re, mut im, mut n_hits) = (0.0, 0.0, 0);
    for i in 0..RAYS {
        let (sin, cos) = (TAU * i as f64 / RAYS as f64).sin_cos();
        let ray = Ray {
            origin,
            direction: u * cos + v * sin,
            t_max: f64::INFINITY,
        };
        if let Some(hit) = walls.bvh.closest_hit(&ray, |_| false) {
            let normal = triangle_area_normal(&walls.triangles[hit.triangle as usize]);
            let (sin, cos) = (4.0 * normal.dot(v).atan2(normal.dot(u))).sin_cos();
            re += cos;
            im += sin;
            n_hits += 1;
        }
    }
    let n_hits = f64::from(n_hits);
    (n_hits / RAYS as f64, f64::hypot(re, im) / n_hits)
}
