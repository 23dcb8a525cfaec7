//! Tests of the crate, in one program: each file alone would be linked with all of it.

#[path = "../common/mod.rs"]
mod common;

mod parts;
mod specials;
mod visibility;
mod walls;
