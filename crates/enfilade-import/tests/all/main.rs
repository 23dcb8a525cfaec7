//! Tests of the crate, in one program: each file alone would be linked with all of it.

#[path = "../common/mod.rs"]
mod common;

mod compressed;
mod energy;
mod formats;
mod gltf;
mod ifc;
mod ifc_packages;
mod left_out;
mod map;
mod marks;
mod order;
mod origins;
mod patches;
mod references;
mod scenes;
mod sources;
mod vox;
