//! Input and output of a frame.

use std::time::Duration;

use enfilade_cpg::CellId;

use crate::{FetchError, PieceId};

/// The eye.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Eye {
    /// Its cell; `None` in solid matter, where the last one counts.
    pub cell: Option<CellId>,
    /// Its position. [Units: wu]
    pub position: [f32; 3],
    /// The greatest speed that it can soon have, even if it stands. [Units: wu/s]
    pub speed: f32,
}

/// A cell in view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InView {
    /// The cell.
    pub cell: CellId,
    /// Its share of the screen. [Limit: 0 to 1]
    pub share: f32,
}

/// Input of a frame.
#[derive(Clone, Copy, Debug)]
pub struct StreamFrame<'a> {
    /// Time since any fixed point; never less than in the frame before.
    pub now: Duration,
    /// The eye.
    pub eye: Eye,
    /// The cells in view, each once.
    pub in_view: &'a [InView],
}

/// Output of a frame. Reuse it, so that a frame need not allocate.
#[derive(Debug, Default)]
#[non_exhaustive]
pub struct Changes {
    /// Pieces to free. The memory of those in `added` counts on it.
    pub removed: Vec<PieceId>,
    /// Pieces that are now in memory, to integrate after `removed` is freed.
    pub added: Vec<Loaded>,
    /// Requests that failed.
    pub failed: Vec<Failed>,
    /// Cells in view of which a piece is not in memory.
    pub stand_ins: Vec<StandIn>,
}

/// A piece that arrived.
#[derive(Debug)]
#[non_exhaustive]
pub struct Loaded {
    /// The piece.
    pub piece: PieceId,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

/// A request that failed.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Failed {
    /// The piece.
    pub piece: PieceId,
    /// The reason.
    pub error: FetchError,
    /// Time at which it may be asked for again; `None` if the source does not have it.
    pub retry: Option<Duration>,
}

/// A cell in view that is not complete: draw its mean color, or the last picture of the portal.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct StandIn {
    /// The cell.
    pub cell: CellId,
    /// Its share of the screen.
    pub share: f32,
    /// The reason.
    pub cause: StandInCause,
}

/// The reason why a cell in view is not complete: the last of these that holds for one of its pieces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum StandInCause {
    /// It covers less of the screen than [`StreamOptions::min_share`](crate::StreamOptions::min_share).
    Small,
    /// It does not fit in memory together with larger cells in view and pinned ones.
    NoRoom,
    /// It is on its way, or waits for its turn.
    Pending,
    /// Its request failed, and will be made again.
    Failing,
    /// The source does not have it.
    Missing,
}

impl Changes {
    pub(crate) fn clear(&mut self) {
        self.removed.clear();
        self.added.clear();
        self.failed.clear();
        self.stand_ins.clear();
    }
}
