//! Tests of the crate, in one program: each file alone would be linked with all of it.

#[path = "../common/mod.rs"]
mod common;

mod hostile;
mod invariants;
mod khronos;
mod reader;
mod schema;
mod specials;
mod wire;
