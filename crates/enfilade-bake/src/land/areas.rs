//! The areas of open land: a watershed of the plan.
//!
//! Low ground is to a plan what air is to a building: the distance to all that is not low ground is flooded, and the rules
//! of rooms decide which basins are one (`rooms`), on a grid of one layer whose squares count as voxels of the default
//! edge. Only the rule for corridors differs: in a building, corridors that cross are one room; streets that cross are not, or a town
//! would be one cell. A street ends where the space is [`FORK`] times as wide.
//!
//! All that is not low, the tops of houses and the sides of hills, is then flooded by height from the areas (Haumont, Debeir
//! and Sillion 2003, §7), so that areas meet on ridges. Minima that a user places take the place of the first step.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use enfilade_geom::{Allowance, DVec3};

use super::relief::{NOTHING, Relief};
use crate::MergeSettings;
use crate::rooms::{Flooded, LimbRule, LimbSettings, merge_basins, split_limbs};
use crate::structure::OUTDOORS;
use crate::voxel::{BitVolume, Grid, SparseVolume, WatershedOptions, distance_squared, watershed};

/// Squares of something else around the plan.
const RIM: usize = 2;
/// Edge that squares have in the rules of rooms: that of a voxel, six to the narrowest opening. [Units: wu]
const NOMINAL: f64 = 0.1;
/// Ratio of widths at which a street ends. Between those of a bend (1.17) and of a fork (1.25) of streets of one width.
const FORK: f64 = 1.2;
const STREETS: LimbRule = LimbRule {
    thicker: FORK,
    is_net: true,
};

/// The area of each square, from 1 on; 0 where there is no surface.
pub(super) struct Areas {
    pub(super) of_square: Vec<u32>,
    pub(super) n: usize,
}

/// Finds the areas of low ground, and gives everything else to them.
pub(super) fn areas(
    relief: &Relief,
    is_low: &[bool],
    noise: f64,
    settings: &MergeSettings,
    allowance: &Allowance,
) -> Areas {
    let plan = LandPlan::of(relief, is_low, allowance);
    let rooms = plan.rooms(relief, noise, settings, allowance);
    let mut numbers: BTreeMap<u32, u32> = BTreeMap::new();
    let number = |room: u32| match room {
        0 => 0,
        _ => {
            let next = numbers.len() as u32 + 1;
            *numbers.entry(room).or_insert(next)
        }
    };
    let of_square: Vec<u32> = rooms.into_iter().map(number).collect();
    let n = numbers.len();
    let keys = keys(relief, &vec![0; relief.len()]);
    flooded(relief, of_square, n, &keys)
}

/// Floods everything from these squares, one area each: low ground from wide to narrow, then the rest by height.
pub(super) fn areas_from(
    relief: &Relief,
    is_low: &[bool],
    minima: &[usize],
    allowance: &Allowance,
) -> Areas {
    let plan = LandPlan::of(relief, is_low, allowance);
    let mut of_square = vec![0; relief.len()];
    for (area, &square) in (1..).zip(minima) {
        if of_square[square] == 0 {
            of_square[square] = area;
        }
    }
    let inner = (0..relief.len()).map(|i| plan.squared[plan.index(relief.at(i))]);
    let keys = keys(relief, &inner.collect::<Vec<_>>());
    flooded(relief, of_square, minima.len(), &keys)
}

/// The plan as a grid of one layer.
struct LandPlan {
    grid: Grid,
    /// Squared distance of low ground to what is not. [Units: vx²]
    squared: Vec<u16>,
}

impl LandPlan {
    fn of(relief: &Relief, is_low: &[bool], allowance: &Allowance) -> Self {
        let [nx, nz] = relief.dims;
        let dims = [nx + 2 * RIM, 1, nz + 2 * RIM];
        let grid = Grid {
            origin: DVec3::ZERO,
            voxel: NOMINAL,
            dims,
        };
        // The first square of the rim stands for the outdoors, which the rules of rooms know, and touches no area.
        let is_taken = |i: usize| {
            let [x, _, z] = grid.coords(i);
            let inner = [x.wrapping_sub(RIM), z.wrapping_sub(RIM)];
            let is_in = inner[0] < nx && inner[1] < nz;
            i != 0 && !(is_in && is_low[inner[0] + nx * inner[1]])
        };
        let taken = BitVolume::from_fn(dims, is_taken);
        Self {
            squared: distance_squared(&taken, allowance),
            grid,
        }
    }

    fn index(&self, [x, z]: [usize; 2]) -> usize {
        self.grid.index(x + RIM, 0, z + RIM)
    }

    /// Returns the room of each square, 0 for those that have none.
    fn rooms(
        &self,
        relief: &Relief,
        noise: f64,
        settings: &MergeSettings,
        allowance: &Allowance,
    ) -> Vec<u32> {
        let grid = &self.grid;
        let mut outdoors = BitVolume::new(grid.dims);
        outdoors.set(0, 0, 0, true);
        let options = WatershedOptions {
            h: noise / NOMINAL,
            outdoors: Some(outdoors),
        };
        let flood = watershed(grid.dims, self.squared.clone(), &options, allowance);
        let radii = flood.basins.iter().map(|b| b.peak as f32);
        let mut peaks: Vec<f32> = std::iter::once(0.0).chain(radii).collect();
        if let Some(outdoors) = peaks.get_mut(OUTDOORS as usize) {
            *outdoors = f32::INFINITY;
        }
        let saddles = flood.saddles.iter();
        let saddles = saddles.map(|s| ((s.a, s.b), s.distance as f32)).collect();
        let mut labels = flood.labels;
        let shut = SparseVolume::of(&BitVolume::new(grid.dims));
        let flooded = Flooded {
            grid,
            labels: &labels,
            peaks: &peaks,
            closures: None,
            slabs: &[],
            allowance,
        };
        let mut regions = merge_basins(flooded, &saddles, settings);
        split_limbs(
            grid,
            &mut labels,
            &mut regions,
            &mut peaks,
            &shut,
            LimbSettings {
                merge: settings,
                rule: STREETS,
            },
            allowance,
        );
        let room = |i: usize| {
            let basin = labels.get(self.index(relief.at(i))) as usize;
            regions.region_of_basin[basin]
        };
        let rooms: Vec<u32> = (0..relief.len()).map(room).collect();
        // Crevices that open to no other area are dropped.
        let mut widest: BTreeMap<u32, u16> = BTreeMap::new();
        for (i, &room) in rooms.iter().enumerate() {
            let squared = self.squared[self.index(relief.at(i))];
            let most = widest.entry(room).or_default();
            *most = squared.max(*most);
        }
        let least = settings.min_radius / NOMINAL + 0.5;
        let is_wide = |room: &u32| f64::from(widest[room]).sqrt() >= least;
        rooms
            .into_iter()
            .map(|room| if is_wide(&room) { room } else { 0 })
            .collect()
    }
}

/// Returns the order in which squares are flooded, least first: those with a distance from wide to narrow, then all others by
/// height, to the millimeter.
fn keys(relief: &Relief, squared: &[u16]) -> Vec<i64> {
    let least = relief.top.iter().filter(|h| **h != NOTHING);
    let least = f64::from(least.copied().fold(f32::INFINITY, f32::min));
    let key = |(&height, &squared): (&f32, &u16)| match squared {
        0 => ((f64::from(height) - least) * 1e3) as i64,
        _ => -i64::from(squared),
    };
    relief.top.iter().zip(squared).map(key).collect()
}

/// Floods the squares without an area from those that have one, in the order of their keys; equal ones from all sides.
fn flooded(relief: &Relief, mut of_square: Vec<u32>, n: usize, keys: &[i64]) -> Areas {
    let mut queue: BinaryHeap<Reverse<(i64, usize, usize, u32)>> = BinaryHeap::new();
    let mut turn = 0;
    let mut add = |queue: &mut BinaryHeap<_>, of_square: &[u32], from: usize| {
        for next in relief.beside(from) {
            if of_square[next] == 0 && relief.top[next] != NOTHING {
                queue.push(Reverse((keys[next], turn, next, of_square[from])));
                turn += 1;
            }
        }
    };
    for i in 0..relief.len() {
        if of_square[i] != 0 {
            add(&mut queue, &of_square, i);
        }
    }
    while let Some(Reverse((_, _, square, area))) = queue.pop() {
        if of_square[square] == 0 {
            of_square[square] = area;
            add(&mut queue, &of_square, square);
        }
    }
    Areas { of_square, n }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Covers V11.
    #[test]
    fn streets_end_where_they_cross_and_go_on_where_a_lane_opens() {
        // Blocks of 50 squares, and streets of 10 between them; across the middle of each row of blocks a lane of 8.
        const PITCH: usize = 60;
        let is_street = |v: usize| v % PITCH < 10;
        let is_lane = |v: usize| (31..39).contains(&(v % PITCH));
        let side = 4 * PITCH + 10;
        let is_low = |x: usize, z: usize| is_street(x) || is_street(z) || is_lane(z);
        let all: Vec<bool> = (0..side * side)
            .map(|i| is_low(i % side, i / side))
            .collect();
        let top: Vec<f32> = all.iter().map(|low| if *low { 0.0 } else { 9.0 }).collect();
        let relief = Relief {
            origin: [0.0; 2],
            square: 0.5,
            dims: [side; 2],
            ground: top.clone(),
            top,
        };
        let settings = MergeSettings::default();
        let found = areas(&relief, &all, 0.015, &settings, &Allowance::default());
        let at = |x: usize, z: usize| found.of_square[x + side * z];
        // Along a street across its lanes; along x from crossing to crossing.
        assert_eq!(at(65, 80), at(65, 110));
        assert_ne!(at(65, 80), at(65, 140));
        assert_ne!(at(90, 65), at(150, 65));
        assert_ne!(at(90, 65), at(65, 80));
        // The lane, and the crossing.
        assert!(![at(65, 80), at(125, 80)].contains(&at(95, 95)));
        assert!(![at(65, 80), at(90, 65)].contains(&at(65, 65)));
        assert!(found.of_square.iter().all(|a| *a != 0));
    }
}
