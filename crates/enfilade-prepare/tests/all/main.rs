//! Tests of the crate, in one program: each file alone would be linked with all of it.

#[path = "../../../enfilade-import/tests/common/mod.rs"]
mod import_common;

mod clean;
mod repair;
