//! The flooded volume, and the faces between its basins.

use std::collections::BTreeMap;

use enfilade_geom::Allowance;
use rayon::prelude::*;

use crate::structure::OUTDOORS;
use crate::voxel::{BitVolume, Grid, Labels};

/// Faces through which two cells touch: voxel index × 4 + axis, for the face between the voxel and the next one
/// along the axis.
pub(super) type Faces = Vec<u64>;

/// A flooded volume, the input of merging.
#[derive(Clone, Copy)]
pub(crate) struct Flooded<'a> {
    /// Position and size of the voxels.
    pub(crate) grid: &'a Grid,
    /// Basin of each voxel, 0 where solid.
    pub(crate) labels: &'a Labels,
    /// Largest distance in each basin. [Units: vx]
    pub(crate) peaks: &'a [f32],
    /// Voxels that a door leaf or a pane fills.
    pub(crate) closures: Option<&'a BitVolume>,
    /// Heights at which basins were cut at slabs, ascending. [Units: wu]
    pub(crate) slabs: &'a [f64],
    /// Shared budget of all that works on the volume.
    pub(crate) allowance: &'a Allowance,
}

/// Collects the faces between voxels of different labels, by pair, ascending.
///
/// Linear in voxels; dozens at a time within the outdoors.
pub(super) fn contact_faces(dims: [usize; 3], labels: &Labels) -> BTreeMap<(u32, u32), Faces> {
    let layer = dims[0] * dims[1];
    let per_slab: Vec<BTreeMap<(u32, u32), Faces>> = (0..dims[2])
        .into_par_iter()
        .map(|z| {
            let mut found: BTreeMap<(u32, u32), Faces> = BTreeMap::new();
            labels.for_runs(z * layer..(z + 1) * layer, |voxels, label| {
                if label > OUTDOORS {
                    for i in voxels {
                        add_faces(dims, labels, i, &mut found);
                    }
                }
            });
            found
        })
        .collect();
    let mut all: BTreeMap<(u32, u32), Faces> = BTreeMap::new();
    for slab in per_slab {
        for (pair, faces) in slab {
            all.entry(pair).or_default().extend(faces);
        }
    }
    all.values_mut().for_each(|faces| faces.sort_unstable());
    all
}

/// Adds the faces of a voxel that is not outdoors: those to the next voxels, and those from outdoor voxels before it,
/// since outdoor voxels themselves are skipped.
fn add_faces(dims: [usize; 3], labels: &Labels, i: usize, found: &mut BTreeMap<(u32, u32), Faces>) {
    let [nx, ny, nz] = dims;
    let [x, y, z] = [i % nx, i / nx % ny, i / (nx * ny)];
    let label = labels.get(i);
    let mut add = |other: u32, of: usize, axis: u64| {
        let pair = (label.min(other), label.max(other));
        found.entry(pair).or_default().push(of as u64 * 4 + axis);
    };
    for (at, n, step, axis) in [(x, nx, 1, 0), (y, ny, nx, 1), (z, nz, nx * ny, 2)] {
        let next = if at + 1 < n { labels.get(i + step) } else { 0 };
        if next != 0 && next != label {
            add(next, i, axis);
        }
        if at > 0 && labels.get(i - step) == OUTDOORS {
            add(OUTDOORS, i - step, axis);
        }
    }
}
