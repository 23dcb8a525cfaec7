//! enfilade-bake

pub mod voxel;
