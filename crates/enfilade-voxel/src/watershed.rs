//! Watershed of the distance field: rooms as the basins around its maxima.
//!
//! Each peak of the distance starts a basin, and a voxel belongs to the basin that its ascent ends in: to the highest
//! neighbor, again and again. This is the drop of water of Cousty, Bertrand, Najman & Couprie ("Watershed cuts: minimum
//! spanning forests and the drop of water principle", 2009), upside down; it cuts where a flood from deep to shallow would
//! (Meyer, "Topographic distance and watershed lines", 1994; Haumont, Debeir and Sillion, "Volumetric Cell-and-Portal
//! Generation", 2003), because the first of a voxel's neighbors that a flood reaches is the highest. The saddle of two basins
//! is their highest contact. A basin whose dynamics (peak minus saddle; Grimaud, "A new measure of contrast", 1992) are below
//! `h` joins the deeper one, contacts in order of falling level.
//!
//! **Order:** on a plateau the ascent takes the shortest way to a voxel with a higher neighbor, so that influence zones divide
//! plateaus; of neighbors alike in that, the last. So each ascent depends on the field around it alone, never on the order
//! in which voxels are visited, and the box can be worked in slabs side by side.
//!
//! **Levels** are distances in steps of 1/64 voxel, rounded down. Consecutive squares of distances below 32
//! voxels are further apart than that, so only wider spaces lose any order.
//!
//! **Memory:** a [`DistanceField`] is packed layer by layer as it is measured, and read slab by slab; what comes of a slab is
//! its contacts and its bricks of [`Labels`].
//!
//! | stage | file |
//! | --- | --- |
//! | distances as levels, packed | `levels` |
//! | crests and peaks | `crests` |
//! | ascents and contacts, by slabs | `slabs` |
//! | shallow basins joined, labels | `join` |
//! | the widest places, in blocks | `blocks` |
//! | the widest places where basins touch | `touching` |

mod basins;
mod blocks;
mod crests;
mod join;
mod levels;
mod shape;
mod slabs;
mod touching;

use enfilade_geom::Allowance;
use rayon::prelude::*;

use super::grid::BitVolume;
use super::labels::Labels;
use super::sparse::SparseVolume;
use crests::Crests;
use levels::{Levels, Outdoors};
use shape::Shape;

pub use basins::{Basin, Saddle, Watershed};
pub use blocks::WidestOfBlocks;
pub use touching::Touching;

/// Returns the memory that the slabs of a flood take, on so many threads, beside what is kept of all voxels. [Units: bytes]
#[must_use]
pub fn bytes_of_slabs(dims: [usize; 3], n_threads: usize) -> usize {
    let shape = Shape { dims };
    if dims.contains(&0) {
        return 0;
    }
    let n_slabs = dims[2].div_ceil(slabs::thickness(shape));
    n_threads.min(n_slabs) * slabs::bytes_of_slab(shape)
}

/// Options of [`watershed`].
#[derive(Clone, Debug, Default)]
pub struct WatershedOptions {
    /// Basins with dynamics (peak minus highest saddle) below this join a deeper one. [Units: vx]
    /// [Limit: 0 and above]
    pub h: f64,
    /// The free voxels set here form one basin, infinitely deep, with label 1.
    pub outdoors: Option<BitVolume>,
}

/// Divides a field of squared distances among the basins around its peaks.
///
/// `squared` is the result of [`distance_squared`](super::distance_squared) for a box of `dims`; 0 is
/// occupied, and distances of 256 voxels and more count as one level.
///
/// Linear in the voxels. In addition to the 2 bytes per voxel it takes an eighth of a byte per voxel, 9 bytes for each
/// voxel that no neighbor exceeds, and 24 MiB per thread; and [`Labels`] take what their surfaces need.
///
/// # Panics
/// If `squared` or `outdoors` is not of size `dims`, there are 2³² voxels or more, or `h` is negative or
/// NaN.
#[must_use]
pub fn watershed(
    dims: [usize; 3],
    squared: Vec<u16>,
    options: &WatershedOptions,
    allowance: &Allowance,
) -> Watershed {
    let is_empty = squared.is_empty();
    let thick = if is_empty {
        1
    } else {
        slabs::thickness(Shape { dims })
    };
    watershed_by(thick, dims, squared, options, allowance)
}

/// Does [`watershed`] in slabs of `thick` layers, of whole bricks of labels.
fn watershed_by(
    thick: usize,
    dims: [usize; 3],
    squared: Vec<u16>,
    options: &WatershedOptions,
    allowance: &Allowance,
) -> Watershed {
    let n: usize = dims.iter().product();
    assert_eq!(squared.len(), n, "a distance for each of {dims:?} voxels");
    assert!(u32::try_from(n).is_ok(), "fewer than 2^32 voxels");
    let outdoors = options.outdoors.as_ref();
    assert!(
        outdoors.is_none_or(|o| o.dims() == dims),
        "outdoors of the same size"
    );
    assert!(
        options.h >= 0.0,
        "h must not be negative, got {}",
        options.h
    );
    if n == 0 {
        return Watershed::unflooded(dims);
    }
    let shape = Shape { dims };
    let first_outdoors = outdoors.map(|o| first_outdoors_of(o, &squared));
    let outdoors = outdoors.map_or(Outdoors::Nothing, Outdoors::Only);
    let levels = Levels::of(shape, squared, &outdoors);
    flood(shape, &levels, thick, first_outdoors, options.h, allowance)
}

/// Divides a field of levels among the basins around its peaks, in slabs of `thick` layers.
fn flood(
    shape: Shape,
    levels: &Levels,
    thick: usize,
    first_outdoors: Option<usize>,
    h: f64,
    allowance: &Allowance,
) -> Watershed {
    let crests = Crests::of(shape, levels, thick, allowance);
    let Some((roots, contacts)) = slabs::label(shape, levels, &crests, thick, allowance) else {
        return Watershed::unflooded(shape.dims);
    };
    let tree = join::Merged::of(&crests.peaks, contacts, h, first_outdoors);
    drop(crests);
    tree.finish(roots)
}

/// The distance of each voxel of a box to the nearest occupied one, packed: about a third of a byte a voxel.
#[derive(Clone, Debug)]
pub struct DistanceField {
    shape: Shape,
    levels: Levels,
    /// The first free voxel of the border or far from everything.
    first_outdoors: usize,
}

impl DistanceField {
    /// Measures the distances to `blocked` voxels; those in `far` are outdoors, and their distances do not matter.
    ///
    /// Works slab by slab: besides the answer, the layers in memory are those of a slab and those within reach of it.
    ///
    /// # Panics
    /// If the two boxes differ in size, or have 2³² voxels or more.
    #[must_use]
    pub fn of(blocked: &SparseVolume, far: &SparseVolume, allowance: &Allowance) -> Self {
        let dims = blocked.dims();
        assert_eq!(dims, far.dims(), "boxes of one size");
        let n: usize = dims.iter().product();
        assert!(u32::try_from(n).is_ok(), "fewer than 2^32 voxels");
        let shape = Shape { dims };
        Self {
            shape,
            levels: Levels::measured(blocked, far, allowance),
            first_outdoors: first_free(blocked, &Outdoors::AtBorder(far)),
        }
    }

    /// Takes squared distances, as [`distance_squared`](super::distance_squared) measures them; the free voxels of `outdoors`
    /// are there.
    ///
    /// # Panics
    /// If one of them is not of size `dims`.
    #[must_use]
    pub fn of_squared(dims: [usize; 3], squared: Vec<u16>, outdoors: &BitVolume) -> Self {
        assert_eq!(dims, outdoors.dims(), "boxes of one size");
        let n: usize = dims.iter().product();
        assert_eq!(squared.len(), n, "a distance for each of {dims:?} voxels");
        let shape = Shape { dims };
        Self {
            shape,
            first_outdoors: first_outdoors_of(outdoors, &squared),
            levels: Levels::of(shape, squared, &Outdoors::Only(outdoors)),
        }
    }

    /// Divides the field among the basins around its peaks, as [`watershed`] does, with what is known to be outdoors as one
    /// basin. Basins with dynamics below `h` join a deeper one. [Units: vx]
    #[must_use]
    pub fn watershed(&self, h: f64, allowance: &Allowance) -> Watershed {
        if self.shape.layer() * self.shape.dims[2] == 0 || allowance.is_over() {
            return Watershed::unflooded(self.shape.dims);
        }
        let thick = slabs::thickness(self.shape);
        let first = Some(self.first_outdoors);
        flood(self.shape, &self.levels, thick, first, h, allowance)
    }
}

/// Returns the first voxel of `outdoors` that is free, 0 if there is none.
fn first_outdoors_of(outdoors: &BitVolume, squared: &[u16]) -> usize {
    outdoors.iter_set().find(|&v| squared[v] != 0).unwrap_or(0)
}

/// Returns the first voxel outdoors that is not blocked, 0 if there is none.
fn first_free(blocked: &SparseVolume, outdoors: &Outdoors<'_>) -> usize {
    let shape = Shape {
        dims: blocked.dims(),
    };
    let [nx, ny, nz] = shape.dims;
    if nx == 0 {
        return 0;
    }
    let first_of = |row: usize| {
        let mut first: Option<usize> = None;
        outdoors.for_runs(shape, row, |from, to| {
            let free = (from..to).find(|&x| !blocked.get(x, row % ny, row / ny));
            first = [first, free].into_iter().flatten().min();
        });
        first.map(|x| row * nx + x)
    };
    (0..ny * nz).find_map(first_of).unwrap_or(0)
}

/// Marks the dams between basins, one voxel thick: each voxel that shares a face with one of a lesser
/// label other than 0. The remaining voxels of different basins do not touch.
///
/// # Panics
/// If `labels` is not of size `dims`.
#[must_use]
pub fn mark_dams(dims: [usize; 3], labels: &Labels) -> BitVolume {
    assert_eq!(labels.dims(), dims, "a label for each voxel");
    let dams_of = |layer: usize| {
        let mut dams: Vec<usize> = Vec::new();
        labels.for_faces(layer, |voxel, axis, [a, b]| {
            if a != 0 && b != 0 {
                let next = [1, dims[0], dims[0] * dims[1]][axis];
                dams.push(if a > b { voxel } else { voxel + next });
            }
        });
        dams
    };
    let layers = (0..labels.n_layers()).into_par_iter();
    let dams: Vec<Vec<usize>> = layers.map(dams_of).collect();
    let mut out = BitVolume::new(dims);
    let shape = Shape { dims };
    for voxel in dams.into_iter().flatten() {
        let [x, y, z] = shape.coords(voxel);
        out.set(x, y, z, true);
    }
    out
}

#[cfg(test)]
mod tests;
