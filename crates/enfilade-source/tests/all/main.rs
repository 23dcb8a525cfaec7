//! Tests of the crate, in one program: each file alone would be linked with all of it.

mod allowance;
mod freeform;
mod implicit;
mod scan;
mod volume;
