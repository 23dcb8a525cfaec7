//! enfilade-bake

pub mod complex;
