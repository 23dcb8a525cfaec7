//! The bake as a WebAssembly module: files in memory in, a world, its plan and the facts of its rooms out.
//!
//! [`baked`] is all of it; on `wasm32-unknown-unknown`, `ffi.rs` exports it to JavaScript, where `src/bake.ts` of the package
//! calls it. A bake runs on the caller's thread, a worker of the page, and is ended by ending that. A panic ends the module:
//! its text goes to the page first, which then makes a new instance.

mod answer;
#[cfg(target_arch = "wasm32")]
pub mod ffi;
mod options;
mod steps;
#[cfg(all(target_arch = "wasm32", target_feature = "atomics"))]
pub mod threads;
mod work;

pub use answer::{Answer, Failure, Question};
pub use options::BakeRequest;
pub use steps::{Steps, Told};
pub use work::baked;
