//! States of pieces and the memory that they take.

use std::time::Duration;

use enfilade_cpg::CellId;

use super::cells::Cells;
use super::state::State;
use crate::{Catalog, PieceId};

/// The part of a piece's state that is read most: small.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slot {
    pub(crate) n_resident: u64,
    /// Number of pinned cells that need it.
    pub(crate) n_pins: u32,
    pub(crate) state: State,
    /// Its request was made, or is now wanted, for the view: it is not canceled.
    pub(crate) for_view: bool,
}

/// The other part.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rest {
    pub(crate) n_packed: u64,
    /// Time of the last request.
    pub(crate) asked: Duration,
    /// Neighbors in the list of kept pieces.
    before: u32,
    after: u32,
    /// The sweep that last met it.
    pub(crate) swept: u32,
    n_failures: u8,
}

/// States of all pieces, and the kept ones in a list: those met by the current sweep in its order, up to the mark, and then the
/// others, which are due later, in the order of earlier sweeps. The end of the list goes first when room is needed.
#[derive(Debug)]
pub(crate) struct Slots {
    slots: Vec<Slot>,
    /// One more than pieces: the last is the head of the list.
    rest: Vec<Rest>,
    pub(crate) cells: Cells,
    /// The piece after which the sweep goes on; the number of pieces for the head of the list.
    mark: u32,
    /// Memory of kept pieces. [Units: bytes]
    pub(crate) n_kept: u64,
    pub(crate) max_kept: u64,
    /// Memory of pinned pieces, kept or not. [Units: bytes]
    pub(crate) n_pinned: u64,
    in_flight: Vec<PieceId>,
    pub(crate) bytes_in_flight: u64,
    /// Goes up with each change of a state.
    pub(crate) version: u64,
}

impl Slots {
    pub(crate) fn new(catalog: &Catalog, max_kept: u64) -> Self {
        let n = catalog.pieces().len() as u32;
        let pieces = catalog.pieces().iter();
        let slots = pieces.clone().map(|piece| Slot {
            n_resident: piece.n_resident,
            n_pins: 0,
            state: State::Absent,
            for_view: false,
        });
        let sizes = pieces.map(|piece| piece.n_packed).chain([0]);
        let rest = sizes.map(|n_packed| Rest {
            n_packed,
            asked: Duration::ZERO,
            before: n,
            after: n,
            swept: 0,
            n_failures: 0,
        });
        let (slots, rest) = (slots.collect(), rest.collect());
        Self {
            slots,
            rest,
            cells: Cells::new(catalog),
            mark: n,
            n_kept: 0,
            max_kept,
            n_pinned: 0,
            in_flight: Vec::new(),
            bytes_in_flight: 0,
            version: 0,
        }
    }

    #[inline]
    pub(crate) fn of(&self, piece: PieceId) -> &Slot {
        &self.slots[piece.idx()]
    }

    #[inline]
    pub(crate) fn of_mut(&mut self, piece: PieceId) -> &mut Slot {
        &mut self.slots[piece.idx()]
    }

    #[inline]
    pub(crate) fn rest(&self, piece: PieceId) -> &Rest {
        &self.rest[piece.idx()]
    }

    #[inline]
    pub(crate) fn rest_mut(&mut self, piece: PieceId) -> &mut Rest {
        &mut self.rest[piece.idx()]
    }

    #[inline]
    pub(crate) fn state(&self, piece: PieceId) -> State {
        self.slots[piece.idx()].state
    }

    /// Returns the pieces on their way, in the order of their requests.
    #[inline]
    pub(crate) fn in_flight(&self) -> &[PieceId] {
        &self.in_flight
    }

    fn head(&self) -> u32 {
        self.slots.len() as u32
    }

    /// Returns the kept pieces, last first; with `all`, to the head of the list, otherwise to the mark.
    pub(crate) fn last_first(&self, all: bool) -> impl Iterator<Item = PieceId> + '_ {
        let stop = if all { self.head() } else { self.mark };
        let mut at = self.rest[self.head() as usize].before;
        std::iter::from_fn(move || {
            let piece = (at != stop && at != self.head()).then_some(PieceId(at))?;
            at = self.rest[at as usize].before;
            Some(piece)
        })
    }

    /// Begins a sweep: all kept pieces are after the mark.
    pub(crate) fn begin_sweep(&mut self) {
        self.mark = self.head();
    }

    /// Moves a kept piece behind the mark, which moves to it.
    pub(crate) fn move_to_mark(&mut self, piece: PieceId) {
        self.unlink(piece.0);
        self.link(piece.0, self.mark);
        self.mark = piece.0;
    }

    /// Reserves the memory of a piece that is asked for, and puts it behind the mark, which stays. The caller has made room.
    pub(crate) fn reserve(&mut self, piece: PieceId, for_view: bool) {
        let slot = &mut self.slots[piece.idx()];
        debug_assert!(!slot.state.is_kept(), "{piece:?} is kept twice");
        slot.for_view = for_view;
        self.n_kept += slot.n_resident;
        self.in_flight.push(piece);
        self.bytes_in_flight += self.rest[piece.idx()].n_packed;
        self.set_state(piece, State::InFlight);
        debug_assert!(self.n_kept <= self.max_kept, "no room was made");
        self.link(piece.0, self.mark);
    }

    /// Ends the request of a piece: it arrived.
    pub(crate) fn arrive(&mut self, piece: PieceId) {
        self.land(piece);
        self.set_state(piece, State::Arrived);
        self.rest[piece.idx()].n_failures = 0;
    }

    /// Hands a piece over.
    pub(crate) fn hand_over(&mut self, piece: PieceId) {
        self.set_state(piece, State::Resident);
    }

    /// Frees the memory of a kept piece, whose state becomes `state`.
    pub(crate) fn release(&mut self, piece: PieceId, state: State) {
        if self.state(piece) == State::InFlight {
            self.land(piece);
        }
        self.unlink(piece.0);
        let slot = &self.slots[piece.idx()];
        debug_assert!(slot.state.is_kept(), "{piece:?} has no memory");
        self.n_kept -= slot.n_resident;
        self.set_state(piece, state);
    }

    /// Sets the state of a piece, whose memory stays as it is.
    pub(crate) fn set_state(&mut self, piece: PieceId, state: State) {
        self.version += 1;
        let before = std::mem::replace(&mut self.slots[piece.idx()].state, state);
        self.cells.change(piece, before, state);
    }

    /// Returns the first absent piece of a cell.
    pub(crate) fn first_absent(&mut self, cell: CellId, catalog: &Catalog) -> Option<PieceId> {
        let slots = &self.slots;
        let is_absent = |p: PieceId| slots[p.idx()].state == State::Absent;
        self.cells.first_absent(cell, catalog, is_absent)
    }

    /// Counts a failure. Returns the time until the next request.
    pub(crate) fn back_off(&mut self, piece: PieceId, first: Duration, last: Duration) -> Duration {
        let n_failures = &mut self.rest[piece.idx()].n_failures;
        let wait = first.saturating_mul(1 << u32::from(*n_failures).min(30));
        *n_failures = n_failures.saturating_add(1);
        wait.min(last)
    }

    fn land(&mut self, piece: PieceId) {
        self.version += 1;
        self.in_flight.retain(|p| *p != piece);
        self.bytes_in_flight -= self.rest[piece.idx()].n_packed;
    }

    fn link(&mut self, piece: u32, after: u32) {
        let next = self.rest[after as usize].after;
        let slot = &mut self.rest[piece as usize];
        (slot.before, slot.after) = (after, next);
        self.rest[after as usize].after = piece;
        self.rest[next as usize].before = piece;
    }

    fn unlink(&mut self, piece: u32) {
        let Rest { before, after, .. } = self.rest[piece as usize];
        if self.mark == piece {
            self.mark = before;
        }
        self.rest[before as usize].after = after;
        self.rest[after as usize].before = before;
    }
}
