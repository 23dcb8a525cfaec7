//! The same file in another order, as another program might have written it.
//!
//! Works on files, not on scenes, so that tests include all importers.

mod glb;
mod text;

pub use glb::shuffled_glb;
pub use text::{shuffled_map, shuffled_obj};
