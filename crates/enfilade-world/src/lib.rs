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

mod actors;
mod all_pairs;
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
pub use sound::{Acoustics, Heard, Listener, Transmission};
pub use space::{PartId, Place, Space, SpaceError};
pub use sweep::Passing;
pub use taut::TautString;
pub use things::{Moved, ThingError, ThingId, Things, Tie};
pub use walker::{Build, Walker};
