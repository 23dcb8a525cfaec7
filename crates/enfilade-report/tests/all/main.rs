//! Tests of the crate, in one program: each file alone would be linked with all of it.

#[path = "../../../enfilade-verify/tests/common/mod.rs"]
mod verify_common;

mod drawn;
mod plans;
mod storeys;
