//! Return values below 0, and the numbers that stand for kinds.

/// Nothing: the point is in solid matter, the file has no such data.
pub const ENF_NONE: i32 = -1;
/// An argument is null, out of range or not finite.
pub const ENF_BAD_ARGUMENT: i32 = -2;
/// A file or a skeleton cannot be used.
pub const ENF_BAD_WORLD: i32 = -3;
/// A defect of this library; the handle must be closed.
pub const ENF_DEFECT: i32 = -4;

/// Stands for the absence of an id in structs.
pub const ENF_NO_ID: u32 = u32::MAX;

/// Counts of `enf_count`: cells.
pub const ENF_CELLS: u32 = 0;
/// Counts: portals.
pub const ENF_PORTALS: u32 = 1;
/// Counts: batches, the triangles of one material that exactly the same cells see.
pub const ENF_BATCHES: u32 = 2;
/// Counts: details, placed objects such as furniture and door leaves.
pub const ENF_DETAILS: u32 = 3;
/// Counts: chunks, ranges of the indices of batches that are culled as units.
pub const ENF_CHUNKS: u32 = 4;
/// Counts: special portals, such as mirrors.
pub const ENF_SPECIALS: u32 = 5;
/// Counts: places within a cell or without one about which something was decided.
pub const ENF_PLACES: u32 = 6;

/// Kind of a cell: a room.
pub const ENF_ROOM: u32 = 0;
/// Kind of a cell: the space around the building.
pub const ENF_OUTDOORS: u32 = 1;
/// Kind of a cell: a space in which nobody can stand, such as a shaft.
pub const ENF_VOID: u32 = 2;

/// Kind of a portal: an opening without a leaf.
pub const ENF_OPENING: u32 = 0;
/// Kind of a portal: an opening with a door leaf.
pub const ENF_DOOR: u32 = 1;
/// Kind of a portal: an opening with glass, or above a parapet.
pub const ENF_WINDOW: u32 = 2;
/// Kind of a portal: a gap of the model that is too narrow to be intended.
pub const ENF_CRACK: u32 = 3;

/// Motion of a leaf: about a hinge, in radians.
pub const ENF_TURN: u32 = 0;
/// Motion of a leaf: along a line, in meters.
pub const ENF_SLIDE: u32 = 1;

/// Target of a pick: a wall; `index` is its batch.
pub const ENF_WALL: u32 = 0;
/// Target of a pick: an object; `index` is its detail.
pub const ENF_DETAIL: u32 = 1;
/// Target of a pick: a portal that is closed there; `index` is the portal.
pub const ENF_CLOSED_PORTAL: u32 = 2;

/// The reason why a function fails.
#[derive(Debug)]
pub struct Failure {
    /// The status that it returns.
    pub status: i32,
    /// The reason for people.
    pub why: String,
}

impl Failure {
    /// Makes the failure of an argument.
    #[expect(clippy::needless_pass_by_value, reason = "for map_err")]
    pub fn argument(why: impl ToString) -> Self {
        Self::of(ENF_BAD_ARGUMENT, &why)
    }

    /// Makes the failure of a file or a skeleton.
    #[expect(clippy::needless_pass_by_value, reason = "for map_err")]
    pub fn world(why: impl ToString) -> Self {
        Self::of(ENF_BAD_WORLD, &why)
    }

    fn of(status: i32, why: &impl ToString) -> Self {
        Self {
            status,
            why: why.to_string(),
        }
    }
}
