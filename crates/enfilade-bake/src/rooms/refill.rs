//! Labels voxels that only door leaves and panes fill: walls to the flood, but air.

use rayon::prelude::*;

use crate::voxel::{BitVolume, Labels};

/// Labels the voxels that only closures fill: walls to the flood, but air. The basins
/// on both sides grow into them at the same pace and meet in the middle of the leaf or pane.
pub(crate) fn flood_closures(dims: [usize; 3], labels: &mut Labels, occupied: &BitVolume) {
    match labels {
        Labels::U16(v) => grow(dims, v, occupied),
        Labels::U32(v) => grow(dims, v, occupied),
    }
}

fn grow<T>(dims: [usize; 3], labels: &mut [T], occupied: &BitVolume)
where
    T: Copy + Default + PartialEq + Send + Sync,
{
    let [nx, ny, nz] = dims;
    let layer = nx * ny;
    let each_neighbor = |i: usize, visit: &mut dyn FnMut(usize)| {
        let (x, y, z) = (i % nx, i / nx % ny, i / layer);
        for (exists, next) in [
            (x > 0, i.wrapping_sub(1)),
            (x + 1 < nx, i + 1),
            (y > 0, i.wrapping_sub(nx)),
            (y + 1 < ny, i + nx),
            (z > 0, i.wrapping_sub(layer)),
            (z + 1 < nz, i + layer),
        ] {
            if exists {
                visit(next);
            }
        }
    };
    let solid = T::default();
    // First round: air voxels without a label that touch a labelled one, in index order.
    let before = &*labels;
    let first_of = &|i: usize| {
        let mut first = None;
        each_neighbor(i, &mut |j| {
            if first.is_none() && before[j] != solid {
                first = Some((i, before[j]));
            }
        });
        first
    };
    let of_row = |row: usize| {
        let bits = occupied.row(row);
        let is_free = move |x: usize| bits[x / 64] >> (x % 64) & 1 == 0;
        let waiting = (0..nx).filter(move |&x| before[row * nx + x] == solid && is_free(x));
        waiting.filter_map(move |x| first_of(row * nx + x))
    };
    let rows = (0..ny * nz).into_par_iter().with_min_len(64);
    let mut front: Vec<(usize, T)> = rows.flat_map_iter(of_row).collect();
    while !front.is_empty() {
        for &(i, l) in &front {
            labels[i] = l;
        }
        let mut next: Vec<(usize, T)> = Vec::new();
        for &(i, l) in &front {
            each_neighbor(i, &mut |j| {
                if labels[j] == solid && !occupied.get_index(j) {
                    next.push((j, l));
                }
            });
        }
        next.sort_by_key(|e| e.0);
        next.dedup_by_key(|e| e.0);
        front = next;
    }
}
