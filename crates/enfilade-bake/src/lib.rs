//! enfilade-bake

pub mod complex;
pub mod voxel;
pub mod watershed;
