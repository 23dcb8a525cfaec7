//! The manager of pieces: what to fetch, what to free, frame by frame.
//!
//! One interface for all policies (Dirkse 2002, §4.1). [`Streamer::update`] is the main flow. Its parts: [`Wanted`] chooses
//! among the pieces in view; [`Search`] finds when cells are due; [`Slots`] keeps the states, the budget and the order in which
//! pieces go; [`Sweep`] brings this order up to date and fetches ahead.
//!
//! - **Budget.** The memory of a piece is reserved when it is asked for, after room was made. So the sum over pieces in
//!   memory, on their way and not yet handed over never exceeds the budget. A reply larger than its piece is refused.
//! - **Progress.** The pieces in view are chosen anew in each frame, the largest first, and those in memory count as larger than
//!   they are; so the choice does not change while the view rests, and what is chosen is asked for before all else. A request made
//!   for the view is not canceled, even if the view turns away.
//! - **In time, not early.** What is due later is fetched once it could be late otherwise, at the [`Pace`] that the link has shown, with
//!   caution. So little is fetched for nothing over a fast link, and as much as possible over a slow one.
//! - **No thrash.** Nothing in memory goes unless room is needed (but for [`Policy::Minimal`]). For what is fetched ahead, only
//!   pieces go that are due later than it.

mod cells;
mod flow;
mod frame;
mod options;
mod pace;
mod slots;
mod state;
mod sweep;
mod wanted;

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::time::Duration;

use enfilade_cpg::{CellId, CellPortalGraph, Pvs};

use crate::deadlines::{Search, Ways};
use crate::{Catalog, PieceId, Reply, Source};
use pace::Pace;
use slots::Slots;
use state::State;
use sweep::Sweep;
use wanted::Wanted;

pub use frame::{Changes, Eye, Failed, InView, Loaded, StandIn, StandInCause, StreamFrame};
pub use options::{Policy, StreamOptions};

/// Work of a frame for searching and sweeping, in units of about a nanosecond.
const WORK_OF_FRAME: u32 = 4_000;
/// Cost of a piece met by the sweep, in the same units.
const COST_OF_PIECE: u32 = 12;
/// Failures in a row after which the source counts as out of reach: then nothing is fetched ahead for a while.
const MANY_FAILURES: u32 = 3;

/// A cell cannot be pinned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PinError {
    /// The catalog does not have it.
    #[error("{cell} is not in the catalog, which has {n_cells} cells")]
    NoCell {
        /// The cell.
        cell: CellId,
        /// Number of cells.
        n_cells: usize,
    },
    /// Pinned cells would take more memory than there is.
    #[error(
        "with {cell}, pinned cells would take {needed} bytes of {max}; unpin others or raise `max_resident`"
    )]
    NoRoom {
        /// The cell.
        cell: CellId,
        /// Memory of all pinned cells with it. [Units: bytes]
        needed: u64,
        /// The budget. [Units: bytes]
        max: u64,
    },
}

/// Numbers for people: bars on a screen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct StreamCounts {
    /// Memory of all pieces in memory, on their way or not handed over. [Units: bytes]
    pub n_kept: u64,
    /// The budget. [Units: bytes]
    pub max_kept: u64,
    /// Requests on their way.
    pub n_in_flight: usize,
    /// Their size as packed. [Units: bytes]
    pub bytes_in_flight: u64,
    /// Pieces in view that are absent, on their way, or not handed over, and fit: what is late.
    pub n_late: usize,
    /// Pieces asked for since the start.
    pub n_requests: u64,
    /// Pieces handed over since the start.
    pub n_loaded: u64,
    /// Size as packed of all pieces asked for since the start. [Units: bytes]
    pub bytes_requested: u64,
}

/// Keeps the pieces of a world in memory that its [`Policy`] asks for, within a budget.
///
/// Memory: 76 bytes per piece, 8 per piece and cell that needs it, 50 per portal, 84 per cell.
#[derive(Debug)]
pub struct Streamer {
    catalog: Catalog,
    options: StreamOptions,
    slots: Slots,
    wanted: Wanted,
    search: Search,
    sweep: Sweep,
    pace: Pace,
    /// Pins of each cell.
    pins: Vec<u32>,
    /// Pinned pieces that may be absent.
    to_pin: Vec<PieceId>,
    replies: Vec<Reply>,
    /// Arrived, not handed over, in order of arrival.
    arrived: Vec<Loaded>,
    /// Failed pieces by the time of the next request.
    retries: BinaryHeap<Reverse<(Duration, PieceId)>>,
    n_failures_in_row: u32,
    /// Until then, nothing is fetched ahead.
    hold: Duration,
    now: Duration,
    /// True if nothing in view lacked a piece in the last frame.
    is_whole: bool,
    /// Pieces to free; empty between steps.
    victims: Vec<PieceId>,
    /// Requests that the view takes over; empty between steps.
    taken_over: Vec<PieceId>,
    /// Size of the smallest piece. [Units: bytes]
    smallest: u64,
    n_requests: u64,
    n_loaded: u64,
    bytes_requested: u64,
}

impl Streamer {
    /// Makes a streamer with nothing in memory. `pvs` tells what may be seen from each cell; without it, or if it is of another
    /// graph, all cells within reach count as visible, nearest first. O(pieces + portals + cells).
    #[must_use]
    pub fn new(
        catalog: Catalog,
        graph: &CellPortalGraph,
        pvs: Option<Pvs>,
        options: StreamOptions,
    ) -> Self {
        let pvs = pvs.filter(|pvs| pvs.n_cells() == graph.cells.len());
        // All within reach may be seen through windows, too.
        let ways = Ways::of(graph, options.flies || pvs.is_none());
        let sizes = catalog.pieces().iter().map(|p| p.n_resident);
        Self {
            slots: Slots::new(&catalog, options.max_resident),
            wanted: Wanted::new(&catalog),
            search: Search::new(ways, pvs, &catalog),
            sweep: Sweep {
                is_over: true,
                ..Sweep::default()
            },
            pace: Pace::default(),
            pins: vec![0; catalog.n_cells()],
            to_pin: Vec::new(),
            replies: Vec::new(),
            arrived: Vec::new(),
            retries: BinaryHeap::new(),
            n_failures_in_row: 0,
            hold: Duration::ZERO,
            now: Duration::ZERO,
            smallest: sizes.min().unwrap_or(0),
            is_whole: false,
            victims: Vec::new(),
            taken_over: Vec::new(),
            n_requests: 0,
            n_loaded: 0,
            bytes_requested: 0,
            catalog,
            options,
        }
    }

    /// Runs a frame: takes what has arrived, hands over a slice of it, frees what has to go, and asks for what comes next.
    ///
    /// Call it once a frame, with the cells that are in view. Time grows with the cells in view, and with the pieces in view
    /// where these might not fit in memory; searching ahead is bounded by about 10 µs a frame. Allocates nothing in a frame in
    /// which nothing changes.
    pub fn update<S: Source + ?Sized>(
        &mut self,
        source: &mut S,
        frame: &StreamFrame<'_>,
        changes: &mut Changes,
    ) {
        changes.clear();
        let before = self.now;
        self.now = before.max(frame.now);
        if !self.slots.in_flight().is_empty() {
            self.pace.spend(self.now - before);
        }
        self.receive(source, changes);
        self.retry();
        let is_same = self.wanted.is_same(frame.in_view, &self.slots);
        if !is_same {
            self.look(frame.in_view);
        }
        self.follow(&frame.eye, is_same);
        self.drop_unseen(source, changes);
        self.fetch_for_view(source, changes);
        self.fetch_pinned(source, changes);
        self.run_sweep(source, frame.eye.speed, changes);
        // After all that frees pieces, so that none comes and goes in one frame.
        self.hand_over(changes);
        self.report(frame.in_view, is_same, changes);
    }

    /// Returns `true` if all is in memory that is in view and fits, and with [`Policy::Prefetch`], all that may be seen from the
    /// eye's cell and fits. Exact as of the last frame: nothing of it is on its way, waits, or is about to be asked for again;
    /// pieces that the source does not have do not count.
    #[must_use]
    pub fn settled(&self) -> bool {
        let is_ahead = match self.options.policy {
            Policy::Prefetch { .. } => {
                let sweep = &self.sweep;
                let is_met = sweep.is_past_visible && !sweep.may_regain;
                is_met && sweep.pending.is_empty() && sweep.again.is_empty()
            }
            _ => true,
        };
        self.view_settled() && is_ahead
    }

    /// Returns `true` if all that is in view and fits is in memory; as [`Streamer::settled`], for the last view alone.
    #[must_use]
    pub fn view_settled(&self) -> bool {
        !self.wanted.is_pending()
    }

    /// Returns `true` if a piece is in memory of the program.
    #[must_use]
    pub fn is_resident(&self, piece: PieceId) -> bool {
        let known = piece.idx() < self.catalog.pieces().len();
        known && self.slots.state(piece) == State::Resident
    }

    /// Returns `true` if all pieces of a cell are in memory. Linear in them.
    #[must_use]
    pub fn is_complete(&self, cell: CellId) -> bool {
        let mut pieces = self.catalog.pieces_of(cell).iter();
        pieces.all(|p| self.slots.state(*p) == State::Resident)
    }

    /// Returns the catalog.
    #[must_use]
    pub fn catalog(&self) -> &Catalog {
        &self.catalog
    }

    /// Returns the numbers as of the last frame. Linear in the pieces of cells in view that lack one.
    #[must_use]
    pub fn counts(&self) -> StreamCounts {
        StreamCounts {
            n_kept: self.slots.n_kept,
            max_kept: self.slots.max_kept,
            n_in_flight: self.slots.in_flight().len(),
            bytes_in_flight: self.slots.bytes_in_flight,
            n_late: self.wanted.n_pending(&self.catalog, &self.slots),
            n_requests: self.n_requests,
            n_loaded: self.n_loaded,
            bytes_requested: self.bytes_requested,
        }
    }

    /// Fetches a cell and keeps it, whatever is in view: things move in it (Dirkse 2002, §5.5.1.2). A cell may be pinned several
    /// times.
    ///
    /// # Errors
    ///
    /// If there is no such cell, or if pinned cells would take more memory than there is.
    pub fn pin(&mut self, cell: CellId) -> Result<(), PinError> {
        let n_cells = self.pins.len();
        let no_cell = PinError::NoCell { cell, n_cells };
        let n_pins = self.pins.get_mut(cell.idx()).ok_or(no_cell)?;
        if *n_pins == 0 {
            let own = self.catalog.pieces_of(cell).iter();
            let new = own.filter(|p| self.slots.of(**p).n_pins == 0);
            let sizes = new.map(|p| self.slots.of(*p).n_resident);
            let needed = self.slots.n_pinned.saturating_add(sizes.sum());
            let max = self.slots.max_kept;
            if needed > max {
                return Err(PinError::NoRoom { cell, needed, max });
            }
            for &piece in self.catalog.pieces_of(cell) {
                self.slots.of_mut(piece).n_pins += 1;
                self.to_pin.push(piece);
            }
            self.slots.n_pinned = needed;
            self.slots.version += 1;
        }
        *n_pins += 1;
        Ok(())
    }

    /// Takes back a pin of a cell. Without effect for cells that are not pinned.
    pub fn unpin(&mut self, cell: CellId) {
        let Some(n_pins) = self.pins.get_mut(cell.idx()).filter(|n| **n > 0) else {
            return;
        };
        *n_pins -= 1;
        if *n_pins > 0 {
            return;
        }
        for &piece in self.catalog.pieces_of(cell) {
            let slot = self.slots.of_mut(piece);
            slot.n_pins -= 1;
            if slot.n_pins == 0 {
                self.slots.n_pinned -= slot.n_resident;
            }
        }
        self.slots.version += 1;
    }

    /// Asks again for pieces that the source did not have: it may have them now.
    pub fn retry_missing(&mut self) {
        for piece in (0..self.catalog.pieces().len() as u32).map(PieceId) {
            if self.slots.state(piece) == State::Missing {
                self.slots.set_state(piece, State::Absent);
                self.sweep.again.push(piece);
                if self.slots.of(piece).n_pins > 0 {
                    self.to_pin.push(piece);
                }
            }
        }
    }
}
