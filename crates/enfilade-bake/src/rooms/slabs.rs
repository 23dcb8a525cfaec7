//! Cuts at slabs: where a storey ends although the distance field shows no pinch.
//!
//! A stair hole, and even more the open side of a gallery, is as wide as the rooms are high: one basin
//! forms across the slab, and no merging can undo that. But an opening lies *in a wall* (or a slab):
//! Lefebvre & Hornus 2003 find their separators by extending the model's own planes. So basins are
//! cut, before merging, along the planes of large level surfaces. Merging is the judge: if a cut
//! goes through the middle of a tall room, the opening is as large as the room, and both halves
//! become one again.
//!
//! Cost: linear in voxels.

use rayon::prelude::*;

use crate::structure::OUTDOORS;
use crate::voxel::{Grid, Labels};

/// Least volume of a part of a basin that is worth a cut. [Units: wu³]
const MIN_VOLUME: f64 = 0.3;

/// Gives the parts of each basin above and below the `heights` labels of their own. Returns the
/// basin that each new label was cut from; new labels follow the existing `n_labels`.
pub(crate) fn cut_at_slabs(
    grid: &Grid,
    labels: &mut Labels,
    n_labels: usize,
    heights: &[f64],
) -> Vec<u32> {
    let storey_of_row = |y: usize| {
        let center = grid.origin.y + (y as f64 + 0.5) * grid.voxel;
        heights.partition_point(|&h| h < center)
    };
    let storeys: Vec<usize> = (0..grid.dims[1]).map(storey_of_row).collect();
    let n_storeys = heights.len() + 1;
    let count = count_by_storey(grid.dims, labels, n_labels, &storeys, n_storeys);
    let enough = (MIN_VOLUME / grid.voxel.powi(3)).ceil() as u32;
    let mut parents = Vec::new();
    let mut new_label = vec![0_u32; n_labels * n_storeys];
    for l in 0..n_labels {
        let mut current = l as u32;
        let mut any = false;
        for s in 0..n_storeys {
            let slot = l * n_storeys + s;
            if count.get(slot).is_some_and(|&c| c >= enough) {
                if any {
                    current = (n_labels + parents.len()) as u32;
                    parents.push(l as u32);
                }
                any = true;
            }
            new_label[slot] = current;
        }
    }
    if parents.is_empty() {
        return parents;
    }
    labels.relabel(|l, y| {
        if l > OUTDOORS {
            new_label[l as usize * n_storeys + storeys[y]]
        } else {
            l
        }
    });
    parents
}

/// Counts the voxels of each basin in each storey, `[basin][storey]`, without the outdoors.
fn count_by_storey(
    [nx, ny, nz]: [usize; 3],
    labels: &Labels,
    n_labels: usize,
    storeys: &[usize],
    n_storeys: usize,
) -> Vec<u32> {
    let zero = || vec![0_u32; n_labels * n_storeys];
    let count = |mut count: Vec<u32>, z: usize| {
        for y in 0..ny {
            let from = (z * ny + y) * nx;
            labels.for_runs(from..from + nx, |run, label| {
                if label > OUTDOORS {
                    count[label as usize * n_storeys + storeys[y]] += run.len() as u32;
                }
            });
        }
        count
    };
    let layers = (0..nz).into_par_iter().with_min_len(LAYERS);
    layers.fold(zero, count).reduce(zero, sum)
}

/// Least number of layers that are counted one after the other.
pub(super) const LAYERS: usize = 32;

/// Adds up counts.
pub(super) fn sum(mut sum: Vec<u32>, part: Vec<u32>) -> Vec<u32> {
    for (s, p) in sum.iter_mut().zip(part) {
        *s += p;
    }
    sum
}
