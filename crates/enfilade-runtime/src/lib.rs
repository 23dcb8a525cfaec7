//! What can be seen, frame by frame, in a world of cells and portals.
//!
//! # What is not promised
//!
//! Answers are supersets.

mod boxes;
mod chunks;
mod occluder;
mod region;
mod see;
mod seen;
mod sight;
mod state;
mod view;

pub use chunks::Chunk;
pub use region::Narrowing;
pub use see::{SeeOptions, Viewer};
pub use seen::{ChunkId, DetailId, SeeCounts, Seen, Visit};
pub use sight::{Sight, SightError, SightOptions};
pub use state::SightState;
pub use view::{View, ViewError};
