//! Labels voxels that only door leaves and panes fill: walls to the flood, but air.

use rayon::prelude::*;

use crate::voxel::{Labels, SparseVolume};

/// Labels the voxels that only closures fill: walls to the flood, but air. The basins
/// on both sides grow into them at the same pace and meet in the middle of the leaf or pane.
pub(crate) fn flood_closures(labels: &mut Labels, occupied: &SparseVolume) {
    let [nx, ny, nz] = labels.dims();
    let neighbors = |[x, y, z]: [usize; 3]| {
        [
            (x > 0, [x.wrapping_sub(1), y, z]),
            (x + 1 < nx, [x + 1, y, z]),
            (y > 0, [x, y.wrapping_sub(1), z]),
            (y + 1 < ny, [x, y + 1, z]),
            (z > 0, [x, y, z.wrapping_sub(1)]),
            (z + 1 < nz, [x, y, z + 1]),
        ]
        .into_iter()
        .filter(|n| n.0)
        .map(|n| n.1)
    };
    // First round: air voxels without a label that touch a labelled one.
    let before = &*labels;
    let of_layer = |layer: usize| {
        let waiting = before.voxels_of(0, layer).into_iter();
        waiting
            .filter(|&[x, y, z]| !occupied.get(x, y, z))
            .filter_map(|at| {
                let around = neighbors(at).map(|at| before.at(at));
                let first = around.into_iter().find(|&label| label != 0);
                first.map(|label| ([at[2], at[1], at[0]], label))
            })
    };
    let layers = (0..labels.n_layers()).into_par_iter();
    let mut front: Vec<([usize; 3], u32)> = layers.flat_map_iter(of_layer).collect();
    front.par_sort_unstable();
    while !front.is_empty() {
        for &([z, y, x], label) in &front {
            labels.set([x, y, z], label);
        }
        let mut next: Vec<([usize; 3], u32)> = Vec::new();
        for &([z, y, x], label) in &front {
            let is_waiting =
                |&[x, y, z]: &[usize; 3]| labels.at([x, y, z]) == 0 && !occupied.get(x, y, z);
            let around = neighbors([x, y, z]).filter(is_waiting);
            next.extend(around.map(|[x, y, z]| ([z, y, x], label)));
        }
        next.sort_by_key(|e| e.0);
        next.dedup_by_key(|e| e.0);
        front = next;
    }
}
