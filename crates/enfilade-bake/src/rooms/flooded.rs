//! The flooded volume, and the faces between its basins.

use std::collections::BTreeMap;

use enfilade_geom::Allowance;
use rayon::prelude::*;

use crate::voxel::{Grid, Labels, SparseVolume};

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
    pub(crate) closures: Option<&'a SparseVolume>,
    /// Heights at which basins were cut at slabs, ascending. [Units: wu]
    pub(crate) slabs: &'a [f64],
    /// Shared budget of all that works on the volume.
    pub(crate) allowance: &'a Allowance,
}

/// Collects the faces between air voxels of different labels, by pair, ascending.
///
/// Linear in voxels; 64 at a time within a basin.
pub(super) fn contact_faces(labels: &Labels) -> BTreeMap<(u32, u32), Faces> {
    type Contacts = BTreeMap<(u32, u32), Faces>;
    let of_layer = |layer: usize| {
        let mut found = Contacts::new();
        // Faces of the pair that was met last: most often, the next one is of it, too.
        let (mut last, mut faces) = ((0, 0), Faces::new());
        labels.for_faces(layer, |i, axis, [a, b]| {
            if a == 0 || b == 0 {
                return;
            }
            let pair = (a.min(b), a.max(b));
            if pair != last {
                found.entry(last).or_default().append(&mut faces);
                last = pair;
            }
            faces.push((4 * i + axis) as u64);
        });
        found.entry(last).or_default().append(&mut faces);
        found.values_mut().for_each(Faces::shrink_to_fit);
        found
    };
    let layers = (0..labels.n_layers()).into_par_iter();
    let of_layers: Vec<Contacts> = layers.map(of_layer).collect();
    // Lists that grow would take twice as much memory.
    let mut n_faces: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    for (&pair, faces) in of_layers.iter().flatten() {
        *n_faces.entry(pair).or_default() += faces.len();
    }
    let of_pair = |(pair, n)| (pair, Faces::with_capacity(n));
    let mut all: Contacts = n_faces.into_iter().map(of_pair).collect();
    for (pair, mut faces) in of_layers.into_iter().flatten() {
        all.entry(pair).or_default().append(&mut faces);
    }
    all.remove(&(0, 0)); // before the first pair of a layer
    all.par_iter_mut()
        .for_each(|(_, faces)| faces.sort_unstable());
    all
}
