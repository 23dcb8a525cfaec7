//! Decisions of people about rooms.

use enfilade_geom::DVec3;

/// A decision of a person about a place.
#[derive(Clone, Debug, PartialEq)]
pub struct RoomDecision {
    /// A point of the opening, or of where one should be. [Units: wu]
    pub at: DVec3,
    /// The answer.
    pub is: RoomAnswer,
}

/// An answer to the question of where rooms end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum RoomAnswer {
    /// The cells on both sides are one.
    OneRoom,
    /// It parts two rooms.
    TwoRooms,
    /// It is a doorway with a door.
    Door,
}

impl RoomAnswer {
    /// All answers.
    pub const ALL: [Self; 3] = [Self::OneRoom, Self::TwoRooms, Self::Door];

    /// Returns the answer as settings have it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::OneRoom => "one room",
            Self::TwoRooms => "two rooms",
            Self::Door => "a door",
        }
    }
}

impl std::fmt::Display for RoomDecision {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let DVec3 { x, y, z } = self.at;
        write!(f, "{} at {x:.2},{y:.2},{z:.2}", self.is.name())
    }
}
