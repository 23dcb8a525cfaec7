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
mod contacts;
mod flood;
mod layout;
mod lights;
mod look;
mod pose;
mod shape;
mod space;
mod sweep;
mod things;
mod walker;

pub use actors::{
    ActorEvent, ActorId, ActorPlace, Actors, AwakeCells, Cause, Chance, Errands, PlanDraft,
    WayPoint,
};
pub use contacts::{Body, Cast, CastCounts, Caster, Contact, Contacts, Impact, Pairs};
pub use flood::{Flood, Posted};
pub use layout::{CellShape, Exit, Layout, Opening};
pub use lights::{Lamp, LampError, LampId, Lights};
pub use look::{SpaceSeen, SpaceViewer};
pub use pose::Pose;
pub use shape::{Shape, ShapeError};
pub use space::{PartId, Place, Space, SpaceError};
pub use sweep::Passing;
pub use things::{Moved, ThingError, ThingId, Things, Tie};
pub use walker::{Build, Walker};
