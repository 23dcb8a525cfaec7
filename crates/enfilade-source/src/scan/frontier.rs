//! The border between what the stations saw and what they did not.
//!
//! No surface is there, so its place matters little, but the edges of views are steps of pixels, and each step would become triangles.

use enfilade_geom::Purse;
use rayon::prelude::*;

use super::cells::ScanGrid;

/// Rounds of averages: more make fewer triangles, and lose thin shadows and slits of views.
const ROUNDS: usize = 3;

/// Averages the values that were not measured with those around them, along each axis in turn, until the purse is empty.
pub(super) fn smooth(grid: &ScanGrid, is_measured: &[bool], values: &mut [f32], purse: Purse<'_>) {
    let [nx, ny, _] = grid.size;
    for _ in 0..ROUNDS {
        // A voxel takes a few nanoseconds.
        if !purse.spend(values.len() as u64 / 8) {
            return;
        }
        let rows = values.par_chunks_mut(nx).zip(is_measured.par_chunks(nx));
        rows.for_each(|(row, is_measured)| average(row, 1, nx, is_measured));
        let layers = (values.par_chunks_mut(nx * ny)).zip(is_measured.par_chunks(nx * ny));
        layers.for_each(|(layer, is_measured)| average(layer, nx, ny, is_measured));
        average(values, nx * ny, grid.size[2], is_measured);
    }
}

/// Averages the values of `n` rows of `stride` values with those before and after them.
fn average(values: &mut [f32], stride: usize, n: usize, is_measured: &[bool]) {
    let mut before = values[..stride].to_vec();
    for k in 0..n {
        let at = k * stride;
        for (i, before) in before.iter_mut().enumerate() {
            let here = values[at + i];
            let after = if k + 1 < n {
                values[at + stride + i]
            } else {
                here
            };
            if !is_measured[at + i] {
                values[at + i] = (*before + here + after) / 3.0;
            }
            *before = here;
        }
    }
}
