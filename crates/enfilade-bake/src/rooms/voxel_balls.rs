//! Balls of the air in voxels, coarse ones where they are wide, for the search of forks.

use enfilade_geom::{Allowance, DVec3, Sets};
use rayon::prelude::*;

use super::regions::Regions;
use crate::structure::OUTDOORS;
use crate::tubes::{Balls, NARROWS, REMOVED, STRIDE, WIDEST};
use crate::voxel::{BitVolume, Grid, Labels, WidestOfBlocks};

/// Marks a block that was not met.
const NONE: u32 = u32::MAX;

/// Balls of one width: blocks of air, each with the widest ball about it.
pub(super) struct BlockBalls<'a> {
    grid: &'a Grid,
    /// Edge of a block. [Units: vx]
    edge: usize,
    dims: [usize; 3],
    /// Blocks with a ball, and the number of those before each word of the rows.
    is_ball: BitVolume,
    before: Vec<u32>,
    /// Block of each ball, ascending, and its radius. [Units: wu]
    blocks: Vec<u32>,
    radii: Vec<f32>,
    allowance: &'a Allowance,
}

impl<'a> BlockBalls<'a> {
    /// Takes the blocks of rooms whose balls may belong to a fork of tubes of these radii: at least, and less than. [Units: vx]
    pub(super) fn of(
        grid: &'a Grid,
        widest: &WidestOfBlocks,
        edge: usize,
        [least, most]: [f64; 2],
        labels: &Labels,
        regions: &Regions,
        allowance: &'a Allowance,
    ) -> Self {
        let dims = widest.dims;
        let [nx, ny, _] = dims;
        // Wider ones only show that tubes end.
        let (least, most) = (least / NARROWS, most * NARROWS + 2.0 * edge as f64);
        let is_ball = |i: usize| {
            let d = widest.distance(i);
            d >= least && d < most && {
                let at = [i % nx, i / nx % ny, i / (nx * ny)].map(|c| c * edge);
                is_indoors(grid, labels, regions, at, edge)
            }
        };
        let is_ball = BitVolume::from_fn(dims, is_ball);
        let mut before = Vec::new();
        let mut n = 0;
        for row in 0..dims[1] * dims[2] {
            for word in is_ball.row(row) {
                before.push(n);
                n += word.count_ones();
            }
        }
        let blocks: Vec<u32> = is_ball.iter_set().map(|i| i as u32).collect();
        let radius = |&b: &u32| (widest.distance(b as usize) * grid.voxel) as f32;
        let radii = blocks.par_iter().map(radius).collect();
        Self {
            grid,
            edge,
            dims,
            is_ball,
            before,
            blocks,
            radii,
            allowance,
        }
    }

    /// Returns the balls of at least one radius and less than another that may be in the middle of a fork, widest first. [Units: wu]
    pub(super) fn middles(&self, [least, most]: [f64; 2]) -> Vec<u32> {
        let is_middle = |&t: &u32| {
            let radius = self.radius(t);
            let is_wide = |(other, _): (u32, f64)| self.radius(other) > radius * WIDEST;
            radius >= least && radius < most && !self.ways(t).any(is_wide)
        };
        let all = 0..self.blocks.len() as u32;
        let mut middles: Vec<u32> = all.into_par_iter().filter(is_middle).collect();
        middles.sort_by(|&a, &b| self.radius(b).total_cmp(&self.radius(a)).then(a.cmp(&b)));
        let mut is_near = vec![false; self.blocks.len()];
        middles.retain(|&t| {
            let is_new = !is_near[t as usize];
            if is_new {
                let reach = STRIDE * self.radius(t) / self.step();
                self.for_cube(t, reach as usize, |other| is_near[other as usize] = true);
            }
            is_new
        });
        let parts = |&t: &u32| self.parts_air(t);
        middles.into_par_iter().filter(parts).collect()
    }

    /// Calls `visit` for each ball of a cube of blocks.
    fn for_cube(&self, t: u32, reach: usize, mut visit: impl FnMut(u32)) {
        let at = self.place(t);
        let low = at.map(|c| c.saturating_sub(reach));
        let high = [0, 1, 2].map(|k| (at[k] + reach + 1).min(self.dims[k]));
        for z in low[2]..high[2] {
            for y in low[1]..high[1] {
                for x in low[0]..high[0] {
                    self.ball_at([x, y, z]).into_iter().for_each(&mut visit);
                }
            }
        }
    }

    /// Returns `true` if the air around a removed ball is in two or more pieces, as it has to be at a fork: in a hall, it is in
    /// one. Faster than the search itself, for it looks no farther than the next radius.
    fn parts_air(&self, t: u32) -> bool {
        let (radius, center) = (self.radius(t), self.center(t));
        let [removed, far] = [REMOVED[0], REMOVED[0] + 1.0].map(|k| k * radius);
        let reach = (far / self.step()) as usize + 1;
        let (at, side) = (self.place(t), 2 * reach + 1);
        let local = |at_other: [usize; 3]| {
            let [x, y, z] = [0, 1, 2].map(|k| at_other[k] + reach - at[k]);
            x + side * (y + side * z)
        };
        // Balls as far as `far`, each with its place among those beyond the removed one.
        let mut place = vec![NONE; side.pow(3)];
        place[local(at)] = 0;
        let mut found = vec![t];
        let mut sets = Sets::new(1);
        let mut next = 0;
        while let Some(&one) = found.get(next) {
            next += 1;
            if !self.allowance.spend(1) {
                return false;
            }
            let is_out = |t: u32| self.center(t).distance(center) > removed;
            for (other, passes) in self.ways(one) {
                if passes * NARROWS < radius || self.center(other).distance(center) > far {
                    continue;
                }
                let of = &mut place[local(self.place(other))];
                if *of == NONE {
                    *of = sets.add();
                    found.push(other);
                }
                if is_out(one) == is_out(other) {
                    sets.join(next as u32 - 1, *of);
                }
            }
        }
        let outer = (0..)
            .zip(&found)
            .filter(|(_, t)| self.center(**t).distance(center) > removed);
        let mut pieces: Vec<u32> = outer.map(|(i, _)| sets.find(i)).collect();
        pieces.sort_unstable();
        pieces.dedup();
        pieces.len() >= 2
    }

    /// Returns the edge of a block. [Units: wu]
    pub(super) fn step(&self) -> f64 {
        self.edge as f64 * self.grid.voxel
    }

    fn ball_at(&self, [x, y, z]: [usize; 3]) -> Option<u32> {
        let row = y + self.dims[1] * z;
        let words = self.is_ball.row(row);
        let (word, bit) = (x / 64, x % 64);
        let below = words[word] & ((1 << bit) - 1);
        let is_set = words[word] >> bit & 1 != 0;
        is_set.then(|| self.before[row * words.len() + word] + below.count_ones())
    }

    fn place(&self, t: u32) -> [usize; 3] {
        let i = self.blocks[t as usize] as usize;
        let [nx, ny, _] = self.dims;
        [i % nx, i / nx % ny, i / (nx * ny)]
    }
}

/// Returns `true` if the middle of a block is in a room.
fn is_indoors(
    grid: &Grid,
    labels: &Labels,
    regions: &Regions,
    from: [usize; 3],
    edge: usize,
) -> bool {
    let at = [0, 1, 2].map(|k| (from[k] + edge / 2).min(grid.dims[k] - 1));
    regions.region_of_basin[labels.at(at) as usize] > OUTDOORS
}

impl Balls for BlockBalls<'_> {
    fn n_parts(&self) -> usize {
        self.blocks.len()
    }

    fn radius(&self, t: u32) -> f64 {
        f64::from(self.radii[t as usize])
    }

    fn center(&self, t: u32) -> DVec3 {
        let at = self.place(t).map(|c| (c as f64 + 0.5) * self.edge as f64);
        self.grid.to_world(DVec3::from_array(at))
    }

    fn owner(&self, _: u32) -> u32 {
        0
    }

    fn ways(&self, t: u32) -> impl Iterator<Item = (u32, f64)> {
        let at = self.place(t);
        let radius = self.radius(t);
        let beside = (0..27).filter(|&i| i != 13).filter_map(move |i| {
            let step = [i % 3, i / 3 % 3, i / 9];
            let mut to = [0; 3];
            for k in 0..3 {
                let c = (at[k] + step[k]).checked_sub(1)?;
                if c >= self.dims[k] {
                    return None;
                }
                to[k] = c;
            }
            self.ball_at(to)
        });
        beside.map(move |other| (other, radius.min(self.radius(other))))
    }

    fn allowance(&self) -> &Allowance {
        self.allowance
    }
}
