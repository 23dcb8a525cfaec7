//! Queries on a living world of cells and portals: positions, contact, light, sound and paths.
//!
//! Sight, light, sound, paths and collision all walk over portals with different *carriers*: the data passed on through a
//! portal, and the condition that stops it. All of them read one [`Layout`], made once from a world, and one
//! [`SightState`](enfilade_runtime::SightState), which holds the state of doors. They do not depend on each other.
//!
//! # Guarantees
//!
//! - **Allocation-free**: a query allocates nothing once the buffers have grown.
//! - **No clock, no threads, no files**: equal queries in equal order give equal answers.

mod actors;
mod bodies;
mod layout;
mod lights;
mod paths;
mod pose;
mod saved;
mod shape;
mod sound;
mod space;
mod things;

pub use actors::{
    ActorEvent, ActorId, ActorPlace, Actors, AwakeCells, Cause, Chance, Errands, PlanDraft,
    WayPoint,
};
pub use bodies::{Agent, Body, Cast, CastCounts, Caster, Contact, Impact, Pairs, Walker};
pub use layout::{CellShape, Layout, LayoutExit, Opening};
pub use lights::{Lamp, LampError, LampId, Lights};
pub use paths::{
    Arrival, Blocked, Corner, Floors, Geodesics, Hop, Hops, KeptMapError, LengthSearch, NoPath,
    Obstacle, PassedPortal, Path, PathFollower, PathPoint, PathPortal, PathSearch, Sampling,
    WalkMap, WalkMapKey, WalkPatch, WalkProgress, Ways,
};
// Messages of the command and of Python.
#[doc(hidden)]
pub use paths::{AskedWalk, WalkWords};
pub use pose::Pose;
pub use saved::{
    SavedActor, SavedActors, SavedError, SavedPose, SavedSpace, SavedThing, SavedThings, SavedTie,
};
pub use shape::{Shape, ShapeError};
pub use sound::{
    AUDIO_BLOCK, Acoustics, Assumed, AudioBlock, Auralizer, DecayLaw, DiffuseFields, Heard,
    Listener, OCTAVES, Reverb, SPEED_OF_SOUND, TautString, Transmission, at_ears, test_sound,
};
pub use space::{
    Docking, Followed, PartId, Passing, Place, SeenContext, SeenVia, SightRay, Space, SpaceError,
    SpaceSeen, SpaceViewer, SpecialImage, SpecialOptions, StoppedSpecial, TraceEnd, Traced,
};
pub use things::{Flood, Moved, Posted, ThingError, ThingId, Things, Tie};
