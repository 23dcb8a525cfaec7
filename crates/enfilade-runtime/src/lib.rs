//! What can be seen, frame by frame, in a world of cells and portals.
//!
//! A [`Sight`] is made once from a world; a [`Viewer`] asks it what one eye sees, every frame, and
//! gets cells, portals, chunks of triangles and detail objects, near to far. What moves between frames,
//! doors above all, is a [`SightState`]. [`Sightlines`] answers from point to point, and a [`Follower`]
//! knows which cell something is in as it moves.
//!
//! ```
//! use enfilade_runtime::{DrawList, Sight, SightState, View, Viewer};
//! use enfilade_testkit::{GridParams, room_grid};
//!
//! // Once. A program reads its world with `enfilade_cpg::wire::decode_glb`.
//! let world = room_grid(&GridParams::offices(100, 1));
//! let sight = Sight::build(&world)?;
//! let mut state = SightState::new(&sight);
//! let mut viewer = Viewer::new(&sight); // one a camera
//! let mut list = DrawList::new();
//!
//! // Every frame.
//! let eye = [6.0, 1.6, 6.0];
//! let view = View::perspective(eye, [1.0, 0.0, 0.2], [0.0, 1.0, 0.0], 1.0, 16.0 / 9.0)?;
//! let seen = viewer.see(&sight, &state, &view);
//! list.fill(&sight, &seen);
//! for draw in &list {
//!     let (_triangles, _positions) = (draw.indices(&sight), &draw.batch(&world).primitive.positions);
//! }
//! for &detail in seen.details() {
//!     let _object = &world[detail]; // a mesh and a transform
//! }
//! assert!(seen.cells().len() < world.graph.cells.len() / 2);
//!
//! // A door falls shut: what is behind it is gone from the next frame on.
//! let &door = seen.portals().first().expect("a doorway in view");
//! let before = seen.cells().len();
//! state.close(door);
//! assert!(viewer.see(&sight, &state, &view).cells().len() < before);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # What is promised
//!
//! - **Conservative**: whatever a ray from the eye within the view meets first is in the answer, with
//!   the tolerance of the world's own promises ([`Sight::tolerance`]). Every shortcut errs to visible.
//! - **Bounded**: a cell is entered at most 16 times a face of the view, however its portals lie; and
//!   [`SeeOptions::max_clips`] bounds the work of a frame, after which all within reach is visible.
//! - **Nothing is allocated** in a question once the buffers have grown.
//!
//! # Eyes at odd places
//!
//! | the eye is | the answer |
//! | --- | --- |
//! | on a portal's plane, in the opening | both cells, neither narrowed |
//! | on the plane, beside the opening | the portal edge-on: next to nothing |
//! | with its near plane beyond a portal | as ever: near planes are not used |
//! | in a wall, in a gap, outside a world without outdoors | everything in the view frustum |
//! | in a locked cell | that cell, and what is seen through its portals |
//!
//! # What is not promised
//!
//! Answers are supersets, not exact; triangles that a wall of their own cell hides are in them unless
//! a large polygon hides a whole chunk. Where one chunk ends up drawn twice by two faces of a view that
//! looks all around is for the caller to sort out; each is listed once. Mirrors are not followed yet.

mod boxes;
mod chunks;
mod details;
mod doors;
mod draw;
mod exits;
mod follow;
mod occluder;
mod options;
mod pick;
mod point;
mod region;
mod see;
mod seen;
mod sight;
mod sight_error;
mod sightline;
mod state;
mod view;

pub use chunks::Chunk;
pub use doors::Leaf;
pub use draw::{Draw, DrawList};
pub use follow::{Follower, Step};
pub use options::SightOptions;
pub use pick::{Hit, NotFinite, Target};
pub use region::Narrowing;
pub use see::{Crossing, SeeOptions, StepQuestion, Viewer, Window};
pub use seen::{ChunkId, DetailId, SeeCounts, Seen, Visit};
pub use sight::Sight;
pub use sight_error::SightError;
pub use sightline::{SightHit, Sightlines};
pub use state::SightState;
pub use view::{View, ViewError};
