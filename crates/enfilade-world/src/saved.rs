//! States of a living world as plain values, to be saved with any format of `serde` and played on from.
//!
//! Each holds what cannot be derived: poses, doors, shapes, plans. Cells, lists and due times are found anew. Numbers keep all their
//! digits, so a world that is saved and restored plays on to the bit like the one that was not.

use enfilade_geom::{DQuat, DVec3};
use enfilade_runtime::{SavedDoors, SavedDoorsError};
use serde::{Deserialize, Serialize};

use crate::pose::Pose;

/// Reason why a saved state cannot be restored.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SavedError {
    /// A space of another number of parts.
    #[error("the saved state has {saved} parts, and the space {own}")]
    Parts {
        /// Parts in the saved state.
        saved: usize,
        /// Parts of the space.
        own: usize,
    },
    /// Doors of another world.
    #[error("part {part}: {source}")]
    Doors {
        /// Index of the part.
        part: u32,
        /// The reason.
        source: SavedDoorsError,
    },
    /// A number that is not finite, or a rotation that does not have unit length.
    #[error(
        "{what} {index} has a number that is not finite or a rotation that is not of unit length"
    )]
    NotFinite {
        /// Kind of the item.
        what: &'static str,
        /// Its index.
        index: usize,
    },
    /// A reference to an item that does not exist.
    #[error("{what} {index} refers to something that does not exist")]
    NoSuch {
        /// Kind of the item.
        what: &'static str,
        /// Its index.
        index: usize,
    },
}

/// A pose as numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedPose {
    /// Rotation as a quaternion: x, y, z, w.
    pub turn: [f64; 4],
    /// Position. [Units: wu]
    pub at: [f64; 3],
}

impl SavedPose {
    pub(crate) fn new(pose: &Pose) -> Self {
        Self {
            turn: pose.turn.to_array(),
            at: pose.at.to_array(),
        }
    }

    pub(crate) fn pose(&self) -> Pose {
        Pose {
            turn: DQuat::from_array(self.turn),
            at: DVec3::from_array(self.at),
        }
    }
}

/// State of a [`Space`](crate::Space): poses and doors of all parts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedSpace {
    /// Per part its pose in its host, and its doors.
    pub parts: Vec<(SavedPose, SavedDoors)>,
}

/// State of [`Actors`](crate::Actors).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedActors {
    /// Seed of their random numbers.
    pub seed: u64,
    /// [Units: s]
    pub now: f64,
    /// In order of addition.
    pub members: Vec<SavedActor>,
    /// Messages under way: time, order of sending, actor, content.
    pub told: Vec<(f64, u64, u32, u32)>,
    /// Number of messages ever sent.
    pub n_told: u64,
}

/// State of an actor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedActor {
    /// True once removed.
    pub is_removed: bool,
    /// Number of its events so far.
    pub n_events: u32,
    /// Points of its plan: time (`None` for never), cell, position. [Units: s, wu]
    pub plan: Vec<(Option<f64>, u32, [f64; 3])>,
}

/// State of [`Things`](crate::Things).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedThings {
    /// Per slot: its generation, and the thing in it.
    pub slots: Vec<(u32, Option<SavedThing>)>,
    /// Free slots; the last is taken next.
    pub free: Vec<u32>,
}

/// State of a thing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedThing {
    /// Points of its shape. [Units: wu]
    pub points: Vec<[f64; 3]>,
    /// Radius of its shape. [Units: wu]
    pub radius: f64,
    /// The frame with which it moves.
    pub tie: SavedTie,
    /// The part in whose frame it stands.
    pub frame: u32,
    /// Its pose there, or relative to its parent.
    pub pose: SavedPose,
}

/// A [`Tie`](crate::Tie) as numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SavedTie {
    /// To the part that it is in.
    Carried,
    /// To none.
    Free,
    /// To the thing in a slot.
    Child(u32),
    /// To none, seen in each frame.
    Global,
}
