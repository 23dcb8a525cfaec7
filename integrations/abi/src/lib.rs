//! The run-time of enfilade behind a flat C ABI.
//!
//! One set of functions for programs in C, C++ and what they are embedded in, and for browsers, which load the same
//! library as WebAssembly. A world is an opaque handle. Every function returns a count, an id or 1 when it succeeds, and a
//! negative [status](status) otherwise; [`enf_last_error`](ffi::enf_last_error) has the reason as text. Answers are
//! written into structs of the caller, whose pointers lead into buffers of the handle: these stay as they are until the
//! next call with the same handle that fills the same kind of struct. Queries allocate nothing once the buffers have grown.
//!
//! # Rules of callers
//!
//! - Pointers are null, which is an error and nothing worse, or lead to as many values as the function says.
//! - A handle is used by one thread at a time, and not after it was closed.
//! - Numbers may be anything: ids that do not exist, NaN and damaged files are errors.
//!
//! All coordinates are in meters, right-handed, y up, as in the file. Matrices are column-major.

pub mod answers;
pub mod ffi;
pub mod handle;
mod last_error;
pub mod status;

pub use handle::EnfWorld;
