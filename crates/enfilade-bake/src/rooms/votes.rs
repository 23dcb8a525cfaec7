//! Votes: voxels that assign a region to a point.

use std::collections::BTreeMap;

use enfilade_geom::{Aabb, Allowance, Bvh, DVec3, Ray, Triangle};
use rayon::prelude::*;

use super::regions::Regions;
use crate::budget::WORK_A_LOOK;
use crate::complex::{Label, Vote};
use crate::structure::Frame;
use crate::voxel::{BitVolume, Grid, Labels, SparseVolume, voxelize};

/// Approximate upper limit on the number of votes.
const MAX_VOTES: usize = 1_000_000;
/// Voxels this close to where two regions meet do not vote: a candidate may lie on either
/// side of them. [Units: wu]
const UNSURE: f64 = 0.35;

/// Returns the number of voxels along an edge of the blocks that cast votes, to which parts are aligned.
pub(super) fn block_of(n_voxels: usize) -> usize {
    (1..)
        .find(|b| n_voxels / (b * b * b) <= MAX_VOTES)
        .unwrap_or(1)
}

/// Returns the number of votes of as many voxels.
pub(super) fn n_votes(n_voxels: usize) -> usize {
    n_voxels / block_of(n_voxels).pow(3)
}

/// Compact votes: there are many, and the labels are still in memory.
pub(super) struct Ballots {
    /// Voxels along each edge of a block.
    block: usize,
    /// Blocks along each axis.
    dims: [usize; 3],
    /// Region that each block votes for; 0 is none.
    region: Vec<u32>,
    /// Index within the block of the voxel that votes: 17³ of them at most, with 2³² voxels in all.
    voter: Vec<u16>,
}

impl Ballots {
    /// Casts this `share` of all votes: one voxel of each block of `block`³ votes for its region.
    pub(super) fn cast(
        grid: &Grid,
        labels: &Labels,
        regions: &Regions,
        hollow: &[u32],
        solid: &SparseVolume,
        share: f64,
        allowance: &Allowance,
    ) -> Self {
        let mut unsure = BitVolume::new(grid.dims);
        let reach = (UNSURE / grid.voxel).ceil() as usize;
        let n_near = (2 * reach as u64 + 1).pow(3);
        for faces in regions.contacts.values() {
            let mut last = u64::MAX;
            for &face in faces {
                if face / 4 == last {
                    continue;
                }
                last = face / 4;
                if !allowance.spend(1 + n_near / 32) {
                    break;
                }
                let at = grid.coords(last as usize);
                let range =
                    |k: usize| at[k].saturating_sub(reach)..(at[k] + reach + 1).min(grid.dims[k]);
                for z in range(2) {
                    for y in range(1) {
                        unsure.fill_row(y + grid.dims[1] * z, range(0));
                    }
                }
            }
        }
        let mut block = 1;
        let most = (share * MAX_VOTES as f64) as usize;
        while grid.n_voxels() / (block * block * block) > most {
            block += 1;
        }
        let dims = grid.dims.map(|n| n.div_ceil(block));
        let n_blocks = dims.iter().product();
        let mut ballots = Self {
            block,
            dims,
            region: vec![0; n_blocks],
            voter: vec![0; n_blocks],
        };
        let region_of = |[x, y, z]: [usize; 3]| {
            let region = regions.region_of_basin[labels.at([x, y, z]) as usize];
            let votes = region != 0
                && !unsure.get(x, y, z)
                && !solid.get(x, y, z)
                && hollow.binary_search(&region).is_err();
            votes.then_some(region)
        };
        ballots
            .region
            .par_iter_mut()
            .zip(&mut ballots.voter)
            .enumerate()
            .with_min_len(4096)
            .for_each(|(b, (region, voter))| {
                let [bx, by, bz] = [b % dims[0], b / dims[0] % dims[1], b / (dims[0] * dims[1])];
                let found = (0..block * block * block).find_map(|k| {
                    let at = voter_at([bx, by, bz], block, k);
                    let is_inside = (0..3).all(|axis| at[axis] < grid.dims[axis]);
                    is_inside.then(|| region_of(at)).flatten().map(|of| (k, of))
                });
                if let Some((k, of)) = found {
                    (*voter, *region) = (k as u16, of);
                }
            });
        ballots
    }

    pub(super) fn count(self, grid: &Grid, frame: &Frame) -> Vec<Vote> {
        let weight = (grid.voxel * self.block as f64).powi(3) as f32;
        let [nx, ny, _] = self.dims;
        // Sequential, into a list of the right size: a parallel version would hold them twice.
        let n = self.region.iter().filter(|&&region| region != 0).count();
        let mut votes = Vec::with_capacity(n);
        for (b, (label, k)) in self.region.into_iter().zip(self.voter).enumerate() {
            if label == 0 {
                continue;
            }
            let at = [b % nx, b / nx % ny, b / (nx * ny)];
            let [x, y, z] = voter_at(at, self.block, usize::from(k));
            votes.push(Vote {
                point: frame.to_scene(grid.center(x, y, z)),
                label: Label::Region(label),
                weight,
            });
        }
        votes
    }
}

/// Returns the coordinates of voxel number `k` of a block, along x first.
fn voter_at(of: [usize; 3], block: usize, k: usize) -> [usize; 3] {
    let within = [k % block, k / block % block, k / (block * block)];
    [0, 1, 2].map(|axis| of[axis] * block + within[axis])
}

/// Returns the columns of voxels (z, x) that stairs are in, and those beside them, each with the heights between which
/// they are: most of a building has none.
fn columns_of(stairs: &[Triangle], grid: &Grid) -> BTreeMap<[usize; 2], [usize; 2]> {
    let mut columns = BTreeMap::new();
    for triangle in stairs {
        let bounds = Aabb::of_points(triangle);
        let (Some(lo), Some(hi)) = (grid.voxel_at(bounds.min), grid.voxel_at(bounds.max)) else {
            continue;
        };
        let around = |k: usize| lo[k].saturating_sub(1)..=(hi[k] + 1).min(grid.dims[k] - 1);
        for z in around(2) {
            for x in around(0) {
                let [low, high] = columns.entry([z, x]).or_insert([lo[1], hi[1]]);
                *low = (*low).min(lo[1]);
                *high = (*high).max(hi[1]);
            }
        }
    }
    columns
}

/// Returns the voxels that stairs fill: those that they touch, and those between where rays up and down hit back
/// faces.
pub(super) fn inside_of(
    stairs: &[Triangle],
    grid: &Grid,
    bvh: &Bvh,
    allowance: &Allowance,
) -> SparseVolume {
    let mut filled = voxelize(grid, stairs, allowance);
    let columns = columns_of(stairs, grid);
    let is_free = |&[x, y, z]: &[usize; 3]| !filled.get(x, y, z);
    let is_inside = |&[x, y, z]: &[usize; 3]| {
        let origin = grid.center(x, y, z);
        let up_and_down = [
            DVec3::new(0.013, 1.0, 0.007),
            DVec3::new(-0.007, -1.0, 0.013),
        ];
        up_and_down.into_iter().all(|direction| {
            let ray = Ray {
                origin,
                direction,
                t_max: f64::INFINITY,
            };
            bvh.closest_hit(&ray, |_| false).is_some_and(|h| !h.front)
        })
    };
    let inner: Vec<[usize; 3]> = columns
        .into_par_iter()
        .flat_map_iter(|([z, x], [low, high])| (low..=high).map(move |y| [x, y, z]))
        .filter(is_free)
        .filter(allowance.each(WORK_A_LOOK))
        .filter(is_inside)
        .collect();
    for [x, y, z] in inner {
        filled.set(x, y, z, true);
    }
    SparseVolume::of(&filled)
}
