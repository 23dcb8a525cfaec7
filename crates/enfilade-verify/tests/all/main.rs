//! Tests of the crate, in one program: each file alone would be linked with all of it.

#[path = "../common/mod.rs"]
mod common;
#[path = "../houses/mod.rs"]
mod houses;

mod decisions;
mod drawn;
mod sources;
mod specials;
mod tampered;
mod worlds;
