//! The widest place in each block of 2 × 2 × 2 voxels.

use rayon::prelude::*;

use super::DistanceField;
use super::basins::STEPS;
use super::levels::level;
use super::shape::Shape;

/// Edge of a block. [Units: vx]
const BLOCK: usize = 2;

/// Distances of the voxels of a box, the largest of each block of 2 × 2 × 2.
#[derive(Clone, Debug)]
pub struct WidestOfBlocks {
    /// Numbers of blocks along the axes.
    pub dims: [usize; 3],
    /// In steps of 1/64 voxel.
    steps: Vec<u16>,
}

impl WidestOfBlocks {
    /// Returns the largest distance in a block, given by its index. [Units: vx]
    ///
    /// # Panics
    /// If there is no such block.
    #[must_use]
    pub fn distance(&self, block: usize) -> f64 {
        f64::from(self.steps[block]) / f64::from(STEPS)
    }

    /// Returns those of blocks twice as long.
    #[must_use]
    pub fn coarser(&self) -> Self {
        let [nx, ny, nz] = self.dims;
        let dims = self.dims.map(|n| n.div_ceil(BLOCK));
        let mut steps = vec![0; dims.iter().product()];
        let layers = steps.par_chunks_mut((dims[0] * dims[1]).max(1)).enumerate();
        layers.for_each(|(z, out)| {
            let from = BLOCK * z * nx * ny;
            let to = (from + BLOCK * nx * ny).min(nx * ny * nz);
            widest([nx, ny], &self.steps[from..to], dims[0], out);
        });
        Self { dims, steps }
    }
}

impl DistanceField {
    /// Returns the largest distance in each block of 2 × 2 × 2 voxels: a quarter of a byte a voxel.
    #[must_use]
    pub fn widest_of_blocks(&self) -> WidestOfBlocks {
        let Shape { dims } = self.shape;
        let [nx, ny, nz] = dims;
        let dims = dims.map(|n| n.div_ceil(BLOCK));
        let mut steps = vec![0; dims.iter().product()];
        let layers = steps.par_chunks_mut((dims[0] * dims[1]).max(1)).enumerate();
        layers.for_each_init(Vec::new, |buffer, (z, out)| {
            let span = [BLOCK * z, nz.min(BLOCK * (z + 1))];
            let words = self.levels.read(self.shape, span, buffer);
            widest([nx, ny], words, dims[0], out);
        });
        WidestOfBlocks { dims, steps }
    }
}

/// Enters the largest of layers of `[nx, ny]` words into one layer of blocks, `width` in a row.
fn widest([nx, ny]: [usize; 2], words: &[u16], width: usize, out: &mut [u16]) {
    for (row, words) in words.chunks(nx.max(1)).enumerate() {
        let first = row % ny / BLOCK * width;
        for (x, &word) in words.iter().enumerate() {
            let most = &mut out[first + x / BLOCK];
            *most = level(word).max(*most);
        }
    }
}
