//! Per-frame visibility in a world of cells and portals.
//!
//! Build a [`Sight`] once from a world. Every frame, query a [`Viewer`] for one eye's view; it returns
//! cells, portals, chunks of triangles and detail objects, near to far. A [`SightState`] holds what
//! changes between frames, doors above all. [`Sightlines`] answers point-to-point queries, and a
//! [`Follower`] tracks the cell of something that moves.
//!
//! ```
//! use enfilade_runtime::{DrawList, Sight, SightState, View, Viewer};
//! use enfilade_testkit::{GridParams, room_grid};
//!
//! // Once. A program loads its world with `enfilade_cpg::wire::decode_glb`.
//! let world = room_grid(&GridParams::offices(100, 1));
//! let sight = Sight::build(&world)?;
//! let mut state = SightState::new(&sight);
//! let mut viewer = Viewer::new(&sight); // one per camera
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
//! // Close a door: the cells behind it are gone from the next frame on.
//! let &door = seen.portals().first().expect("a doorway in view");
//! let before = seen.cells().len();
//! state.close(door);
//! assert!(viewer.see(&sight, &state, &view).cells().len() < before);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Guarantees
//!
//! - **Conservative**: the answer contains the first hit of every ray from the eye within the view, up
//!   to the tolerance of the world's own promises ([`Sight::tolerance`]). Every shortcut errs to visible.
//! - **Bounded**: a cell is entered at most 16 times per face of the view, however its portals lie; and
//!   [`SeeOptions::max_clips`] bounds the work of a frame, after which all within reach is visible.
//! - **Allocation-free**: a query allocates nothing once the buffers have grown.
//!
//! # Eyes at odd places
//!
//! | the eye is | the answer |
//! | --- | --- |
//! | on a portal's plane, in the opening | both cells, neither narrowed |
//! | on the plane, beside the opening | the portal edge-on: next to nothing |
//! | with its near plane beyond a portal | unaffected: near planes are not used |
//! | in a wall, in a gap, outside a world without outdoors | everything in the view frustum |
//! | in a locked cell | that cell, and what is seen through its portals |
//!
//! # Limits
//!
//! Answers are supersets, not exact: triangles hidden by a wall of their own cell are included unless a
//! large polygon hides the whole chunk. A chunk that two faces of an all-around view show is listed once;
//! drawing it for both is the caller's task. [Special portals](enfilade_cpg::SpecialPortal) in view are listed, not followed:
//! what is seen in them is a matter of `enfilade_world::SpaceViewer`.

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
mod start;
mod state;
mod view;

pub use chunks::Chunk;
pub use doors::Leaf;
pub use draw::{Draw, DrawList};
pub use follow::{Follower, Step};
pub use options::SightOptions;
pub use pick::{Hit, NotFinite, Target};
pub use region::Narrowing;
pub use see::{Crossing, Gate, SeeOptions, SpecialView, StepQuestion, Stops, Viewer, Window};
pub use seen::{ChunkId, DetailId, SeeCounts, Seen, Visit};
pub use sight::{Sight, SightSkeleton, SkeletonError};
pub use sight_error::SightError;
pub use sightline::{SightHit, Sightlines};
pub use start::Start;
pub use state::{SavedDoors, SavedDoorsError, SightState};
pub use view::{View, ViewError};
