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
    let count = match labels {
        Labels::U16(v) => count_by_storey(grid.dims, v, n_labels, &storeys, n_storeys),
        Labels::U32(v) => count_by_storey(grid.dims, v, n_labels, &storeys, n_storeys),
    };
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
    if n_labels + parents.len() > usize::from(u16::MAX)
        && let Labels::U16(v) = labels
    {
        *labels = Labels::U32(v.iter().map(|&l| l.into()).collect());
    }
    match labels {
        Labels::U16(v) => relabel(grid.dims, v, |l, y| {
            new_label[usize::from(l) * n_storeys + storeys[y]] as u16
        }),
        Labels::U32(v) => {
            relabel(grid.dims, v, |l, y| {
                new_label[l as usize * n_storeys + storeys[y]]
            });
        }
    }
    parents
}

/// Counts the voxels of each basin in each storey, `[basin][storey]`, without the outdoors.
fn count_by_storey<T: Copy + Into<u32> + Sync>(
    dims: [usize; 3],
    labels: &[T],
    n_labels: usize,
    storeys: &[usize],
    n_storeys: usize,
) -> Vec<u32> {
    let mut count = vec![0_u32; n_labels * n_storeys];
    for slice in labels.chunks(dims[0] * dims[1]) {
        for (y, row) in slice.chunks(dims[0]).enumerate() {
            for &l in row {
                let l: u32 = l.into();
                if l > OUTDOORS {
                    count[l as usize * n_storeys + storeys[y]] += 1;
                }
            }
        }
    }
    count
}

/// Replaces every label except solid and outdoors, given the label and the row (y).
fn relabel<T: Copy + Into<u32> + Send>(
    dims: [usize; 3],
    labels: &mut [T],
    new: impl Fn(T, usize) -> T + Sync,
) {
    labels.par_chunks_mut(dims[0] * dims[1]).for_each(|slice| {
        for (y, row) in slice.chunks_mut(dims[0]).enumerate() {
            for l in row {
                if (*l).into() > OUTDOORS {
                    *l = new(*l, y);
                }
            }
        }
    });
}
