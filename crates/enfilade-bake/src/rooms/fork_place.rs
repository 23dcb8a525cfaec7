//! A fork among voxels: the ball to take out, and the air around it.

use enfilade_geom::DVec3;

use crate::tubes::{Arm, REMOVED};
use crate::voxel::Grid;

/// A fork in the space of the grid.
pub(super) struct ForkPlace {
    /// [Units: wu]
    pub(super) center: DVec3,
    /// Radius of the ball in the middle, and of that which is taken out. [Units: wu]
    pub(super) radius: f64,
    pub(super) removed: f64,
    /// Arms, widest first.
    pub(super) arms: Vec<ForkArm>,
}

/// A tube that leaves a fork.
pub(super) struct ForkArm {
    pub(super) kind: Arm,
    /// [Units: wu]
    pub(super) radius: f64,
    /// Centers of its balls, nearest to the fork first. [Units: wu]
    pub(super) points: Vec<DVec3>,
}

impl ForkPlace {
    /// Returns the first ball of an arm that is farther than `removed` from the middle.
    pub(super) fn seed(&self, grid: &Grid, arm: &ForkArm, removed: f64) -> Option<[usize; 3]> {
        let is_out = |p: &&DVec3| p.distance(self.center) > removed + 2.0 * grid.voxel;
        grid.voxel_at(*arm.points.iter().find(is_out)?)
    }

    /// Widens the ball to take out until nothing but it connects the arms nearby: they begin where a wall parts them.
    pub(super) fn widen(&mut self, grid: &Grid, is_in: &dyn Fn([usize; 3]) -> bool) {
        let from = self.removed;
        for removed in REMOVED
            .map(|k| k * self.radius)
            .into_iter()
            .filter(|&r| r >= from)
        {
            let seeds: Vec<_> = self
                .arms
                .iter()
                .map(|a| self.seed(grid, a, removed))
                .collect();
            let shell = [removed, removed + self.radius];
            let are_apart = seeds.iter().enumerate().all(|(i, seed)| {
                let reached = seed.map(|s| flood_shell(grid, is_in, self.center, shell, s));
                let reached = reached.unwrap_or_default();
                let meets =
                    |other: &Option<[usize; 3]>| other.is_some_and(|o| reached.contains(&o));
                !seeds[..i].iter().any(meets)
            });
            if are_apart {
                self.removed = removed;
                return;
            }
        }
    }
}

/// Returns the voxels of a region that a ball reaches from its center.
pub(super) fn ball(
    grid: &Grid,
    is_in: &dyn Fn([usize; 3]) -> bool,
    place: &ForkPlace,
) -> Vec<[usize; 3]> {
    let start = grid.voxel_at(place.center);
    let flood = |s| flood_shell(grid, is_in, place.center, [-1.0, place.removed], s);
    start.map_or_else(Vec::new, flood)
}

/// Returns the voxels of a region, farther than the first and not farther than the second distance from a center, that
/// connect to `start`. [Units: wu]
fn flood_shell(
    grid: &Grid,
    is_in: &dyn Fn([usize; 3]) -> bool,
    center: DVec3,
    shell: [f64; 2],
    start: [usize; 3],
) -> Vec<[usize; 3]> {
    let center = grid.to_voxel(center);
    let [near, far] = shell.map(|d| d / grid.voxel);
    let reach = far.ceil() as usize + 1;
    let low = center
        .to_array()
        .map(|c| (c as usize).saturating_sub(reach));
    let side = 2 * reach + 2;
    let mut was_met = vec![false; side.pow(3)];
    let mut found = Vec::new();
    let mut add = |at: [usize; 3], found: &mut Vec<[usize; 3]>| {
        let distance = DVec3::from_array(at.map(|c| c as f64 + 0.5)).distance(center);
        if distance > near && distance <= far && is_in(at) {
            let [x, y, z] = [0, 1, 2].map(|k| at[k] - low[k]);
            if !std::mem::replace(&mut was_met[x + side * (y + side * z)], true) {
                found.push(at);
            }
        }
    };
    add(start, &mut found);
    let mut next = 0;
    while let Some(&at) = found.get(next) {
        next += 1;
        for k in 0..3 {
            let mut to = at;
            to[k] += 1;
            if to[k] < grid.dims[k] {
                add(to, &mut found);
            }
            if at[k] > 0 {
                to[k] = at[k] - 1;
                add(to, &mut found);
            }
        }
    }
    found
}
