//! The pass over cells in the order of their deadlines.

use super::slots::Slots;
use super::state::State;
use crate::PieceId;

/// The state of a sweep over the cells in the order in which they are due. It brings the list of kept pieces into this order,
/// and asks for absent ones.
///
/// It ends where nothing more can be kept. It begins anew with each search, and where a piece that it has met may
/// now be had.
#[derive(Debug, Default)]
pub(crate) struct Sweep {
    /// Its number: pieces met have it.
    pub(crate) stamp: u32,
    /// The cell at which it goes on, in the order of the search, and the piece of this cell.
    pub(crate) cell: usize,
    pub(crate) piece: usize,
    pub(crate) is_over: bool,
    /// Memory of the kept pieces met. [Units: bytes]
    pub(crate) n_bytes: u64,
    /// True if all cells that may be seen now are passed.
    pub(crate) is_past_visible: bool,
    /// Pieces met that may be seen now and are not in memory but may come.
    pub(crate) pending: Vec<PieceId>,
    /// A deadline and a size for which there was no room: nor is there for larger pieces that are due no earlier.
    pub(crate) no_room: Option<(f32, u64)>,
    /// Size in transit of what is due later, was met and is not there. [Units: bytes]
    pub(crate) n_ahead: u64,
    /// Latest deadline met that needs that fetching goes on now. [Units: wu]
    pub(crate) must: f32,
    /// All that is due by then is fetched: the result of the last pass. [Units: wu]
    pub(crate) limit: f32,
    /// True if all that is due within the horizon was met.
    pub(crate) is_past_horizon: bool,
    /// Pieces met that failed or were canceled, and may now be asked for again.
    pub(crate) again: Vec<PieceId>,
    /// True if it has to wait for requests to end.
    pub(crate) is_waiting: bool,
    /// True if there was no room for a piece met.
    pub(crate) has_lost: bool,
    /// True if anything has changed since: there may be room now.
    pub(crate) may_regain: bool,
}

impl Sweep {
    /// Begins anew.
    pub(crate) fn begin(&mut self) {
        self.stamp = self.stamp.wrapping_add(1);
        (self.cell, self.piece) = (0, 0);
        self.is_over = false;
        self.n_bytes = 0;
        self.is_past_visible = false;
        self.pending.clear();
        if !self.is_past_horizon {
            // It got no farther: what it found holds.
            self.limit = self.limit.max(self.must);
        }
        (self.n_ahead, self.must, self.is_past_horizon) = (0, 0.0, false);
        self.no_room = None;
        self.again.clear();
        self.is_waiting = false;
        (self.has_lost, self.may_regain) = (false, false);
    }

    /// Ends: nothing more can be kept, or all cells are passed.
    pub(crate) fn end(&mut self) {
        (self.is_over, self.is_past_visible) = (true, true);
    }

    /// Meets a piece: if it is kept, it goes on where it belongs in the list.
    pub(crate) fn meet(&mut self, piece: PieceId, due: f32, slots: &mut Slots) {
        slots.rest_mut(piece).swept = self.stamp;
        let (slot, n_packed) = (slots.of(piece), slots.rest(piece).n_packed);
        let (state, size) = (slot.state, slot.n_resident);
        let is_there = matches!(state, State::Arrived | State::Resident | State::Missing);
        if due > 0.0 && !is_there {
            self.n_ahead += n_packed;
        }
        if state.is_kept() {
            self.n_bytes += size;
            slots.move_to_mark(piece);
        }
        let is_coming = matches!(state, State::InFlight | State::Arrived | State::Failing);
        if due == 0.0 && is_coming {
            self.pending.push(piece);
        }
    }

    /// Forgets pieces that are no longer pending.
    pub(crate) fn trim(&mut self, slots: &Slots) {
        let is_coming = |p: &PieceId| {
            let state = slots.state(*p);
            matches!(state, State::InFlight | State::Arrived | State::Failing)
        };
        self.pending.retain(is_coming);
    }

    /// Returns `true` if a piece of this size, due then, is known to have no room.
    pub(crate) fn knows_no_room(&self, due: f32, size: u64) -> bool {
        self.no_room.is_some_and(|(d, s)| due >= d && size >= s)
    }
}
