//! Facts of rooms that people ask for, as kept in worlds.

use crate::CellId;

/// Facts of a room that people ask for. [Units: wu, wu²]
#[derive(Clone, Debug, PartialEq)]
pub struct RoomFacts {
    /// The room.
    pub cell: CellId,
    /// Names of the storeys that it stands on, from below.
    pub storeys: Vec<String>,
    /// Area of its floors as seen from above, without the recesses of doors and windows.
    pub floor_area: f64,
    /// The part of that area where the room is 1.5 m high or more: half of what lies between this and 2.3 m counts as living
    /// space, under sloped ceilings.
    pub area_above_1_5: f64,
    /// The part where it is 2.3 m high or more.
    pub area_above_2_3: f64,
    /// Clear height over half of that area or more.
    pub height: f64,
    /// Number of its doors.
    pub n_doors: usize,
    /// Number of its windows.
    pub n_windows: usize,
}
