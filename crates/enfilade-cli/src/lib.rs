//! Code shared by the command `enfilade` and the benchmarks: files, cameras and values of arguments.
//!
//! An internal library without promises to others; programs use the crate `enfilade`.

pub mod adapter;
pub mod answers;
pub mod cameras;
pub mod doors;
pub mod input;
pub mod memory;
pub mod streamed;
pub mod values;
pub mod world;
