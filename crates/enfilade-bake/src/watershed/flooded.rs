//! The flooded volume, and the faces between its basins.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::fronts::Faces;
use crate::structure::OUTDOORS;
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

/// Collects the faces between differently labelled voxels, by pair, ascending.
///
/// Linear in voxels; within the outdoors, dozens at a time.
pub(super) fn contact_faces(dims: [usize; 3], labels: &Labels) -> BTreeMap<(u32, u32), Faces> {
    let [nx, ny, nz] = dims;
    let layer = nx * ny;
    let per_slab: Vec<BTreeMap<(u32, u32), Faces>> = (0..nz)
        .into_par_iter()
        .map(|z| {
            let mut found: BTreeMap<(u32, u32), Faces> = BTreeMap::new();
            for y in 0..ny {
                let row = z * layer + y * nx;
                labels.for_runs(row..row + nx, |voxels, a| {
                    if a <= OUTDOORS {
                        return;
                    }
                    for i in voxels {
                        let x = i - row;
                        // Of what touches the outdoors the other voxel looks back as well.
                        for (ahead, behind, step, axis) in [
                            (x + 1 < nx, x > 0, 1, 0),
                            (y + 1 < ny, y > 0, nx, 1),
                            (z + 1 < nz, z > 0, layer, 2),
                        ] {
                            let mut face = |b: u32, of: usize| {
                                let faces = found.entry((a.min(b), a.max(b))).or_default();
                                faces.push(of as u64 * 4 + axis);
                            };
                            if ahead {
                                match labels.get(i + step) {
                                    0 => {}
                                    b if b == a => {}
                                    b => face(b, i),
                                }
                            }
                            if behind && labels.get(i - step) == OUTDOORS {
                                face(OUTDOORS, i - step);
                            }
                        }
                    }
                });
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
    all.values_mut().for_each(|faces| faces.sort_unstable());
    all
}
