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
mod all_pairs;
mod auralize;
mod blocks;
mod columns;
mod contacts;
mod ears;

mod edges;
mod flood;
mod floors;
mod geodesics;
mod hops;
mod layout;
mod lights;
mod look;
mod paths;
mod pose;
mod pull;
mod reverb;
mod sampling;
mod search;
mod sequences;
mod shape;
mod sound;
mod space;
mod strides;
mod sweep;
mod taut;
mod things;
mod trees;
mod walker;

pub use actors::{
    ActorEvent, ActorId, ActorPlace, Actors, AwakeCells, Cause, Chance, Errands, PlanDraft,
    WayPoint,
};
pub use auralize::{AUDIO_BLOCK, AudioBlock, Auralizer, test_sound};
pub use contacts::{Body, Cast, CastCounts, Caster, Contact, Contacts, Impact, Pairs};
pub use ears::at_ears;
pub use edges::Corner;
pub use flood::{Flood, Posted};
pub use floors::{Agent, Floors};
pub use geodesics::Geodesics;
pub use hops::Hops;
pub use layout::{CellShape, Exit, Layout, Opening};
pub use lights::{Lamp, LampError, LampId, Lights};
pub use look::{SpaceSeen, SpaceViewer};
pub use paths::{NoPath, Path, PathSearch, WalkMap};

pub use pose::Pose;
pub use reverb::{DecayLaw, DiffuseFields, Reverb, SPEED_OF_SOUND, absorption_of_name};
pub use sampling::Sampling;
pub use search::{Arrival, LengthSearch, PassedPortal, Ways};
pub use shape::{Shape, ShapeError};
pub use sound::{Acoustics, Heard, Listener, OCTAVES, Transmission};
pub use space::{Docking, PartId, Place, Space, SpaceError};
pub use sweep::Passing;
pub use taut::TautString;
pub use things::{Moved, ThingError, ThingId, Things, Tie};
pub use walker::{Build, Walker};
