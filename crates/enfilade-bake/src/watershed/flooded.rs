//! The flooded volume, and the faces between its basins.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::fronts::Faces;
use crate::voxel::{BitVolume, Grid, Labels};

/// A flooded volume, as merging sees it.
#[derive(Clone, Copy)]
pub(crate) struct Flooded<'a> {
    /// Place and size of the voxels.
    pub(crate) grid: &'a Grid,
    /// Basin of each voxel, 0 where solid.
    pub(crate) labels: &'a Labels,
    /// Greatest distance in each basin. [Units: vx]
    pub(crate) peaks: &'a [f32],
    /// Voxels that a door leaf or a pane fills.
    pub(crate) closures: Option<&'a BitVolume>,
    /// Heights at which basins were cut at slabs, ascending. [Units: wu]
    pub(crate) slabs: &'a [f64],
}

/// Collects the faces between differently labelled voxels, by pair, in order of the voxels.
pub(super) fn contact_faces(dims: [usize; 3], labels: &Labels) -> BTreeMap<(u32, u32), Faces> {
    let [nx, ny, nz] = dims;
    let layer = nx * ny;
    let per_slab: Vec<BTreeMap<(u32, u32), Faces>> = (0..nz)
        .into_par_iter()
        .map(|z| {
            let mut found: BTreeMap<(u32, u32), Faces> = BTreeMap::new();
            for y in 0..ny {
                let row = z * layer + y * nx;
                for x in 0..nx {
                    let i = row + x;
                    let a = labels.get(i);
                    if a == 0 {
                        continue;
                    }
                    let mut face = |inside: bool, step: usize, axis: u64| {
                        if inside {
                            let b = labels.get(i + step);
                            if b != 0 && b != a {
                                found
                                    .entry((a.min(b), a.max(b)))
                                    .or_default()
                                    .push(i as u64 * 4 + axis);
                            }
                        }
                    };
                    face(x + 1 < nx, 1, 0);
                    face(y + 1 < ny, nx, 1);
                    face(z + 1 < nz, layer, 2);
                }
            }
            found
        })
        .collect();
    let mut all: BTreeMap<(u32, u32), Faces> = BTreeMap::new();
    for slab in per_slab {
        for (pair, faces) in slab {
            all.entry(pair).or_default().extend(faces);
        }
    }
    all
}
