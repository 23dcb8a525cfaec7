//! Result of a watershed: the basin of each voxel, the basins, and their contacts.

use super::super::labels::Labels;

/// Levels per voxel of distance.
pub(super) const STEPS: u32 = 64;

/// A basin of the distance field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Basin {
    /// Greatest distance in it, rounded down to 1/64; infinite outdoors. [Units: vx]
    pub peak: f64,
    /// Index of a voxel at that distance; outdoors, of its first voxel.
    pub peak_voxel: usize,
    /// Number of voxels.
    pub n_voxels: u64,
}

/// Contact between two basins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Saddle {
    /// Label of the first basin; less than `b`.
    pub a: u32,
    /// Label of the second.
    pub b: u32,
    /// Greatest distance at which they touch, rounded down to 1/64. [Units: vx]
    pub distance: f64,
    /// Index of a voxel at that distance that has a neighbor in the other basin.
    pub voxel: usize,
    /// Number of voxel faces that they share.
    pub n_faces: u64,
}

/// Basins of the distance field and their contacts.
#[derive(Clone, Debug, PartialEq)]
pub struct Watershed {
    /// Basin of each voxel, 0 if occupied. Every basin except outdoors is 6-connected.
    pub labels: Labels,
    /// The basin with label `i + 1` is at `i`: outdoors first if requested, then deepest first, then by index
    /// of the peak.
    pub basins: Vec<Basin>,
    /// Touching pairs, by distance from great to small, then by labels.
    pub saddles: Vec<Saddle>,
}

impl Watershed {
    /// A box whose voxels no basin has.
    pub(super) fn unflooded(dims: [usize; 3]) -> Self {
        Self {
            labels: Labels::zero(dims),
            basins: Vec::new(),
            saddles: Vec::new(),
        }
    }
}
