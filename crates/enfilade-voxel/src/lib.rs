//! Kernels on voxel grids: surface voxelization, exact distances, connected components, the
//! watershed of the distance field and the widest path in it.
//!
//! **Layout, everywhere:** x runs fastest, then y, then z: voxel `(i, j, k)` of a box of
//! `[nx, ny, nz]` voxels has the index `i + nx * (j + ny * k)`. Voxel `(i, j, k)` is the closed
//! cube from `(i, j, k)` to `(i + 1, j + 1, k + 1)` in voxel coordinates; its center is at
//! `+ 0.5`. Distances are between voxel centers, in voxel edges. [Units: vx]
//!
//! Every kernel gives the same answer for any number of threads. It uses the current thread pool
//! ([`rayon::ThreadPool::install`]).

mod components;
mod edt;
mod enclosure;
mod far;
mod grid;
mod labels;
mod sparse;
mod voxelize;
mod watershed;
mod widest;

pub use components::{Components, Connectivity, components, connected_labels, flood};
pub use edt::{distance, distance_squared, distance_squared_near};
pub use enclosure::{ENCLOSED, ascend, deepest_enclosed, enclosure};
pub use far::far_outdoors;
pub use grid::{BitVolume, Grid, for_runs, set_bits};
pub use labels::{Labels, Reader};
pub use sparse::{SparseVolume, VoxelRows};
pub use voxelize::{add_voxels, voxelize};
pub use watershed::{
    Basin, DistanceField, Saddle, Touching, Watershed, WatershedOptions, WidestOfBlocks,
    bytes_of_slabs, mark_dams, watershed,
};
pub use widest::{WidestPath, border, widest_path};
