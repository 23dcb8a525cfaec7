//! Tests of the crate, in one program: each file alone would be linked with all of it.

mod common;

mod closing;
mod files;
mod hbjson;
mod maps;
