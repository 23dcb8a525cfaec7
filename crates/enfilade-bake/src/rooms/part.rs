//! The air of a part of a scene, in the voxels of the whole scene.

use enfilade_geom::{Aabb, Allowance, DVec3};

use super::air::{Solid, VoxelAir, plots};
use super::lids::Lids;
use super::votes::block_of;
use crate::structure::{Site, Structure};
use crate::voxel::{Grid, SparseVolume, distance_squared};
use crate::{BakeConfig, BakeContext, BakeError, Resolution, Stage};

/// Surfaces farther than this from a voxel do not count for its distance, beside a part's border. [Units: vx]
const AROUND: usize = 16;

/// The voxels of a whole scene, before distances are measured in any part of it.
pub(crate) struct WholeAir {
    pub(crate) grid: Grid,
    /// Surfaces, closures, and all that stops a flood besides surfaces.
    occupied: SparseVolume,
    closures: SparseVolume,
    shut: SparseVolume,
    pub(crate) slabs: Vec<f64>,
    resolution: Resolution,
}

impl WholeAir {
    /// Voxelizes a structure that is all one site without missing roofs or floors; `None` for others: where they are is
    /// decided by the whole scene.
    ///
    /// # Errors
    /// As [`plots`].
    pub(crate) fn of(
        structure: &Structure<'_>,
        sites: &[Site],
        config: &BakeConfig,
        context: &BakeContext<'_>,
    ) -> Result<Option<Self>, BakeError> {
        let [site] = *sites else {
            return Ok(None);
        };
        let plots = plots(structure, vec![site], config, context)?;
        context.begin(Stage::Voxelize)?;
        let (grid, resolution) = (plots[0].grid, plots[0].resolution);
        let solid = Solid::of(structure, &grid, config);
        if solid.lids.lids.is_some() || solid.lids.floors.is_some() {
            return Ok(None);
        }
        Ok(Some(Self {
            slabs: structure.slabs(&site.core),
            closures: solid.closures,
            shut: solid.shut,
            occupied: solid.occupied,
            grid,
            resolution,
        }))
    }

    /// Returns the range of voxels of the smallest part that contains a box, aligned to the blocks of votes.
    pub(crate) fn range(&self, bounds: &Aabb) -> VoxelRange {
        let block = block_of(self.grid.n_voxels());
        let [low, high] = [bounds.min, bounds.max].map(|p| self.grid.to_voxel(p).to_array());
        let mut out = VoxelRange::default();
        for k in 0..3 {
            out.from[k] = low[k].max(0.0) as usize / block * block;
            let to = (high[k].ceil().max(1.0) as usize).div_ceil(block) * block;
            out.to[k] = to.min(self.grid.dims[k]).max(out.from[k] + 1);
        }
        out
    }

    /// Returns the air of a part, and the squared distance of each voxel to the nearest surface. [Units: vx²]
    ///
    /// Time and memory are linear in its voxels.
    pub(crate) fn part(&self, range: &VoxelRange, allowance: &Allowance) -> (VoxelAir, Vec<u16>) {
        let wide = range.grown(AROUND, self.grid.dims);
        let mut blocked = cut(&self.occupied, &wide).dense();
        cut(&self.shut, &wide).add_to(&mut blocked);
        let around = distance_squared(&blocked, allowance);
        let [nx, ny, _] = wide.dims();
        let dims = range.dims();
        let offset: [usize; 3] = std::array::from_fn(|k| range.from[k] - wide.from[k]);
        let mut distances = Vec::with_capacity(dims.iter().product());
        for z in 0..dims[2] {
            for y in 0..dims[1] {
                let first = offset[0] + nx * (y + offset[1] + ny * (z + offset[2]));
                distances.extend_from_slice(&around[first..first + dims[0]]);
            }
        }
        let from = DVec3::from_array(range.from.map(|v| v as f64));
        let grid = Grid {
            origin: self.grid.to_world(from),
            voxel: self.grid.voxel,
            dims,
        };
        let n_whole = self.grid.n_voxels() as f64;
        let air = VoxelAir {
            solid: Solid {
                occupied: cut(&self.occupied, range),
                closures: cut(&self.closures, range),
                lids: Lids::default(),
                shut: cut(&self.shut, range),
            },
            slabs: self.slabs.clone(),
            // A little more, so that rounding does not make blocks of votes larger.
            share: grid.n_voxels() as f64 / n_whole * 1.000_001 + 1e-5,
            resolution: self.resolution,
            grid,
        };
        (air, distances)
    }
}

/// A box of voxels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct VoxelRange {
    pub(crate) from: [usize; 3],
    pub(crate) to: [usize; 3],
}

impl VoxelRange {
    pub(crate) fn dims(&self) -> [usize; 3] {
        std::array::from_fn(|k| self.to[k] - self.from[k])
    }

    fn grown(&self, by: usize, dims: [usize; 3]) -> Self {
        Self {
            from: self.from.map(|v| v.saturating_sub(by)),
            to: std::array::from_fn(|k| (self.to[k] + by).min(dims[k])),
        }
    }
}

/// Returns the bits of a part.
fn cut(whole: &SparseVolume, range: &VoxelRange) -> SparseVolume {
    let dims = range.dims();
    let [_, ny, _] = whole.dims();
    let (skip, shift) = (range.from[0] / 64, range.from[0] % 64);
    let last = u64::MAX >> (63 - (dims[0] + 63) % 64);
    SparseVolume::from_rows(dims, |row, words| {
        let [y, z] = [row % dims[1], row / dims[1]];
        let row = whole.row(y + range.from[1] + ny * (z + range.from[2]));
        for (i, word) in words.iter_mut().enumerate() {
            let at = |k: usize| row.get(k).copied().unwrap_or(0);
            let low = at(skip + i) >> shift;
            let high = if shift == 0 {
                0
            } else {
                at(skip + i + 1) << (64 - shift)
            };
            *word = low | high;
        }
        if let Some(word) = words.last_mut() {
            *word &= last;
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::voxel::BitVolume;

    #[test]
    fn a_part_has_the_bits_of_the_whole() {
        let dims = [150, 7, 5];
        let is_set = |i: usize| i.is_multiple_of(7) || i % 11 == 3;
        let whole = BitVolume::from_fn(dims, is_set);
        for (from, to) in [
            ([0, 0, 0], dims),
            ([3, 1, 2], [149, 6, 4]),
            ([64, 2, 0], [130, 3, 5]),
        ] {
            let part = cut(&SparseVolume::of(&whole), &VoxelRange { from, to });
            for z in from[2]..to[2] {
                for y in from[1]..to[1] {
                    for x in from[0]..to[0] {
                        let here = part.get(x - from[0], y - from[1], z - from[2]);
                        assert_eq!(here, whole.get(x, y, z), "{x} {y} {z}");
                    }
                }
            }
            // Bits past the end of a row stay clear.
            assert_eq!(part.dense().iter_set().count(), part.count());
        }
    }
}
