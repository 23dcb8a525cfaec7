//! Ids of things, their ties and motions.

use crate::space::Place;

/// Id of a thing. Never reused, even after the thing is removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ThingId {
    pub(super) index: u32,
    pub(super) generation: u32,
}

/// The frame with which a thing moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tie {
    /// The part that its origin is in, such as a boat for a person on deck: Dirkse's slave object.
    Carried,
    /// None, as for a bird in a tunnel of a ship: Dirkse's free object.
    Free,
    /// Another thing, with a pose relative to it.
    Child(ThingId),
    /// Nowhere, and seen in each frame, like a sun or an overlay.
    Global,
}

/// Reason why a thing cannot be added or moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ThingError {
    /// It was removed, or never existed.
    #[error("there is no such thing: it was removed, or belongs to another registry")]
    NoThing,
    /// A pose that is not finite, or whose rotation does not have unit length.
    #[error(
        "the pose is not a rigid motion: its numbers must be finite and its rotation of unit length"
    )]
    NotRigid,
    /// A frame that does not exist.
    #[error("there is no such part")]
    NoPart,
}

/// Movement of a thing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Moved {
    /// Place of its origin before; `None` in solid matter.
    pub from: Option<Place>,
    /// Place afterwards. While in solid matter it stays listed where it was last.
    pub to: Option<Place>,
}
