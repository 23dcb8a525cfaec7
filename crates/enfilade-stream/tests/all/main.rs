//! Tests of the crate, in one program: each file alone would be linked with all of it.

#[path = "../common/mod.rs"]
mod common;

mod begin;
mod link;
mod packed;
mod pieces;
mod policies;
mod random;
