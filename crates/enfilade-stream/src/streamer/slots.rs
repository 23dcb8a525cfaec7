//! States of pieces and the memory that they take.

use std::time::Duration;

use crate::{Catalog, PieceId};

/// The state of a piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum State {
    Absent,
    /// On its way. Its memory is reserved.
    InFlight,
    /// Arrived, not handed over.
    Arrived,
    /// In memory of the program.
    Resident,
    /// Failed; to be asked for again later.
    Failing,
    /// The source does not have it.
    Missing,
}

impl State {
    /// Returns `true` if its memory is reserved.
    #[inline]
    pub(crate) fn is_kept(self) -> bool {
        matches!(self, Self::InFlight | Self::Arrived | Self::Resident)
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Slot {
    pub(crate) n_resident: u64,
    pub(crate) n_packed: u64,
    /// Time of the last request.
    pub(crate) asked: Duration,
    /// Neighbors in the list of kept pieces.
    before: u32,
    after: u32,
    /// Number of pinned cells that need it.
    pub(crate) n_pins: u32,
    /// The sweep that last met it.
    pub(crate) swept: u32,
    pub(crate) n_failures: u8,
    pub(crate) state: State,
    /// Its request was made, or is now wanted, for the view: it is not canceled.
    pub(crate) for_view: bool,
}

/// States of all pieces, and the kept ones in a list: those met by the current sweep in its order, up to the mark, and then the
/// others, which are due later, in the order of earlier sweeps. The end of the list goes first when room is needed.
#[derive(Debug)]
pub(crate) struct Slots {
    slots: Vec<Slot>,
    /// The piece after which the sweep goes on; the number of pieces for the head of the list.
    mark: u32,
    /// Memory of kept pieces. [Units: bytes]
    pub(crate) n_kept: u64,
    pub(crate) max_kept: u64,
    /// Memory of pinned pieces, kept or not. [Units: bytes]
    pub(crate) n_pinned: u64,
    in_flight: Vec<PieceId>,
    pub(crate) bytes_in_flight: u64,
    /// Goes up when a piece is no longer in memory of the program.
    pub(crate) n_losses: u64,
    /// Goes up with each change of a state.
    pub(crate) version: u64,
}

impl Slots {
    pub(crate) fn new(catalog: &Catalog, max_kept: u64) -> Self {
        let n = catalog.pieces().len() as u32;
        let empty = Slot {
            n_resident: 0,
            n_packed: 0,
            asked: Duration::ZERO,
            before: n,
            after: n,
            n_pins: 0,
            swept: 0,
            n_failures: 0,
            state: State::Absent,
            for_view: false,
        };
        let pieces = catalog.pieces().iter().map(|piece| Slot {
            n_resident: piece.n_resident,
            n_packed: piece.n_packed,
            ..empty
        });
        let mut slots = Vec::with_capacity(n as usize + 1);
        slots.extend(pieces);
        slots.push(empty); // the head of the list
        Self {
            slots,
            mark: n,
            n_kept: 0,
            max_kept,
            n_pinned: 0,
            in_flight: Vec::new(),
            bytes_in_flight: 0,
            n_losses: 0,
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
    pub(crate) fn state(&self, piece: PieceId) -> State {
        self.slots[piece.idx()].state
    }

    /// Returns the pieces on their way, in the order of their requests.
    #[inline]
    pub(crate) fn in_flight(&self) -> &[PieceId] {
        &self.in_flight
    }

    fn head(&self) -> u32 {
        self.slots.len() as u32 - 1
    }

    /// Returns the kept pieces, last first; with `all`, to the head of the list, otherwise to the mark.
    pub(crate) fn last_first(&self, all: bool) -> impl Iterator<Item = PieceId> + '_ {
        let stop = if all { self.head() } else { self.mark };
        let mut at = self.slots[self.head() as usize].before;
        std::iter::from_fn(move || {
            let piece = (at != stop && at != self.head()).then_some(PieceId(at))?;
            at = self.slots[at as usize].before;
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
        (slot.state, slot.for_view) = (State::InFlight, for_view);
        self.n_kept += slot.n_resident;
        self.in_flight.push(piece);
        self.bytes_in_flight += slot.n_packed;
        self.version += 1;
        debug_assert!(self.n_kept <= self.max_kept, "no room was made");
        self.link(piece.0, self.mark);
    }

    /// Ends the request of a piece: it arrived.
    pub(crate) fn arrive(&mut self, piece: PieceId) {
        self.land(piece);
        let slot = &mut self.slots[piece.idx()];
        (slot.state, slot.n_failures) = (State::Arrived, 0);
    }

    /// Hands a piece over.
    pub(crate) fn hand_over(&mut self, piece: PieceId) {
        self.version += 1;
        self.slots[piece.idx()].state = State::Resident;
    }

    /// Frees the memory of a kept piece, whose state becomes `state`.
    pub(crate) fn release(&mut self, piece: PieceId, state: State) {
        if self.state(piece) == State::InFlight {
            self.land(piece);
        }
        self.n_losses += u64::from(self.state(piece) == State::Resident);
        self.version += 1;
        self.unlink(piece.0);
        let slot = &mut self.slots[piece.idx()];
        debug_assert!(slot.state.is_kept(), "{piece:?} has no memory");
        self.n_kept -= slot.n_resident;
        slot.state = state;
    }

    /// Sets the state of a piece without memory.
    pub(crate) fn set_state(&mut self, piece: PieceId, state: State) {
        self.version += 1;
        self.slots[piece.idx()].state = state;
    }

    /// Counts a failure. Returns the time until the next request.
    pub(crate) fn back_off(&mut self, piece: PieceId, first: Duration, last: Duration) -> Duration {
        let slot = &mut self.slots[piece.idx()];
        let wait = first.saturating_mul(1 << u32::from(slot.n_failures).min(30));
        slot.n_failures = slot.n_failures.saturating_add(1);
        wait.min(last)
    }

    fn land(&mut self, piece: PieceId) {
        self.version += 1;
        self.in_flight.retain(|p| *p != piece);
        self.bytes_in_flight -= self.slots[piece.idx()].n_packed;
    }

    fn link(&mut self, piece: u32, after: u32) {
        let next = self.slots[after as usize].after;
        let slot = &mut self.slots[piece as usize];
        (slot.before, slot.after) = (after, next);
        self.slots[after as usize].after = piece;
        self.slots[next as usize].before = piece;
    }

    fn unlink(&mut self, piece: u32) {
        let Slot { before, after, .. } = self.slots[piece as usize];
        if self.mark == piece {
            self.mark = before;
        }
        self.slots[before as usize].after = after;
        self.slots[after as usize].before = before;
    }
}
