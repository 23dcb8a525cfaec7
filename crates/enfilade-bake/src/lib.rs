//! Finds the rooms and doorways of a scene.
//!
//! Start with [`pipeline`]: one function lists the stages in order. The *watershed* decides where
//! rooms end, on voxels ([`voxel`], [`watershed`]); the *cell complex* makes it exact
//! ([`complex`]), so that the promises hold whatever the voxels missed.

mod assemble;
pub mod bound;
pub mod bsp;
pub use enfilade_complex as complex;
mod config;
mod context;
pub mod delaunay;
pub mod edit;
mod error;
mod join;
pub mod leak;
pub mod pipeline;
pub mod simplify;
pub use enfilade_voxel as voxel;
pub mod watershed;

pub use config::{BakeConfig, SmallestHole};
pub use context::{BakeContext, Progress, Silent};
pub use error::BakeError;
pub use pipeline::{BakeOutput, bake};
