//! Code shared by the command `enfilade` and the benchmarks: files, cameras and values of arguments.
//!
//! An internal library without promises to others; programs use the crate `enfilade`.

#[cfg(feature = "render")]
pub mod adapter;
pub mod answers;
#[cfg(feature = "render")]
pub mod cameras;
#[cfg(feature = "render")]
pub mod doors;
pub mod input;
pub mod memory;
#[cfg(feature = "render")]
pub mod streamed;
pub mod values;
pub mod world;
