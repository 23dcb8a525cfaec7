//! What lives in a world of cells and portals: what is where, what is touched, lit, heard and reached.
//!
//! Sight, light, sound, paths and collision are one walk over portals with different *carriers*: what is handed on through a
//! portal, and when it stops. All of them read one [`Layout`], made once from a world, and one
//! [`SightState`](enfilade_runtime::SightState), which says how doors stand. None knows another.
//!
//! # What is promised
//!
//! - **Nothing is allocated** in a question once the buffers have grown.
//! - **No clock, no threads, no files**: the same questions in the same order have the same answers.

mod all_pairs;
mod blocks;
mod columns;
mod ears;
mod edges;
mod floors;
mod geodesics;
mod hops;
mod layout;
mod paths;
mod reverb;
mod search;
mod sound;
mod strides;
mod taut;

pub use ears::at_ears;
pub use edges::Corner;
pub use floors::{Agent, Floors};
pub use geodesics::Geodesics;
pub use hops::Hops;
pub use layout::{CellShape, Exit, Layout, Opening};
pub use paths::{NoPath, Path, PathSearch, WalkMap};
pub use reverb::{DecayLaw, DiffuseFields, Reverb, SPEED_OF_SOUND, absorption_of_name};
pub use search::{Arrival, LengthSearch, PassedPortal, Sampling, Ways};
pub use sound::{Acoustics, Heard, Listener, Transmission};
pub use taut::TautString;
