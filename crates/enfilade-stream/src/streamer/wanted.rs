//! The pieces in view, and those of them that fit.

use enfilade_cpg::CellId;

use super::frame::{InView, StandIn, StandInCause};
use super::slots::Slots;
use super::state::State;
use crate::{Catalog, PieceId};

/// Factor by which a piece in memory counts as larger, so that two pieces that do not fit together are not fetched in turns while
/// their shares of the screen change a little.
const STAYS: f32 = 1.5;
/// Cells in view that are read in the time in which one of a piece's cells is.
const CELLS_AT_ONCE: usize = 4;

#[derive(Clone, Copy, Debug, Default)]
struct Mark {
    /// The view in which it was last.
    seen: u32,
    /// The view in which it was last chosen.
    chosen: u32,
    share: f32,
}

/// How much of a view fits in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Fit {
    /// All of it is there: pieces have no marks until they are [needed](Wanted::mark).
    #[default]
    Complete,
    /// All of it fits, even if what cells share counts for each of them. So what cells lack is all that has to be known, and pieces
    /// have no marks either.
    All,
    /// Some of it may not: pieces are chosen one by one.
    Some,
}

/// The pieces in view by their share of the screen. Chosen are those that fit beside the pinned ones, the largest first: a
/// piece that does not fit any more is passed over, and smaller ones follow.
#[derive(Debug, Default)]
pub(crate) struct Wanted {
    /// Number of the current view.
    view: u32,
    fit: Fit,
    min_share: f32,
    /// For each cell, the view in which it was last, large enough, and its share there.
    shares: Vec<(u32, f32)>,
    /// Cells in view that lacked something when the view was looked at, and may have absent pieces.
    lacking: Vec<InView>,
    marks: Vec<Mark>,
    is_marked: bool,
    pieces: Vec<PieceId>,
    /// If some do not fit, chosen pieces that are absent; the first of them, as many as may be asked for at once, by share, the
    /// largest first.
    absent: Vec<PieceId>,
    /// How many of these have been asked for.
    n_asked: usize,
    /// True if a chosen piece may be absent.
    has_absent: bool,
    /// If some do not fit, chosen pieces that were not in memory when the view was looked at.
    chosen: Vec<PieceId>,
    /// True if a chosen piece is not in memory but may come.
    is_pending: bool,
    last_view: Vec<InView>,
    last_version: u64,
}

/// Questions about a view.
impl Wanted {
    pub(crate) fn new(catalog: &Catalog) -> Self {
        Self {
            marks: vec![Mark::default(); catalog.pieces().len()],
            shares: vec![(0, 0.0); catalog.n_cells()],
            last_version: u64::MAX,
            ..Self::default()
        }
    }

    /// Returns `true` if a piece is in view and fits. For pieces in memory, only after [`Wanted::mark`].
    pub(crate) fn has(&self, piece: PieceId, catalog: &Catalog, slots: &Slots) -> bool {
        if self.fit == Fit::All && !self.is_marked {
            return self.shares_of(piece, catalog, slots).next().is_some();
        }
        self.marks[piece.idx()].chosen == self.view
    }

    /// Returns the share of the screen of a piece in view; 0 for others.
    pub(crate) fn share(&self, piece: PieceId, catalog: &Catalog, slots: &Slots) -> f32 {
        let mark = self.marks[piece.idx()];
        if self.fit == Fit::All {
            let shares = self.shares_of(piece, catalog, slots);
            shares.fold(0.0, f32::max)
        } else if mark.seen == self.view {
            mark.share
        } else {
            0.0
        }
    }

    /// Returns the share of a cell that is in view, large enough.
    fn share_of(&self, cell: CellId) -> Option<f32> {
        let (view, share) = *self.shares.get(cell.idx())?;
        (view == self.view).then_some(share)
    }

    /// Returns the shares of the cells in view that need a piece. O(its cells, or cells in view).
    fn shares_of<'a>(
        &'a self,
        piece: PieceId,
        catalog: &'a Catalog,
        slots: &'a Slots,
    ) -> impl Iterator<Item = f32> + 'a {
        let own = slots.cells.of(piece);
        let has_few = own.len() <= CELLS_AT_ONCE * self.last_view.len();
        let own = has_few.then_some(own).into_iter().flatten();
        let seen = if has_few { &[] } else { &self.last_view[..] };
        let needs = move |v: &&InView| catalog.pieces_of(v.cell).binary_search(&piece).is_ok();
        let seen = seen.iter().filter(needs).map(|v| v.cell);
        own.chain(seen).filter_map(|cell| self.share_of(cell))
    }

    /// Returns `true` if nothing has changed since the last look at this view.
    pub(crate) fn is_same(&self, in_view: &[InView], slots: &Slots) -> bool {
        self.last_version == slots.version && self.last_view == in_view
    }

    /// Returns `true` if a chosen piece is not in memory but may come.
    pub(crate) fn is_pending(&self) -> bool {
        self.is_pending
    }

    /// Returns the number of chosen pieces that are not in memory but may come. Linear in the pieces of cells that lack one.
    pub(crate) fn n_pending(&self, catalog: &Catalog, slots: &Slots) -> usize {
        let is_pending = |p: &&PieceId| is_coming(slots.state(**p));
        match self.fit {
            Fit::Complete => 0,
            Fit::Some => self.chosen.iter().filter(is_pending).count(),
            Fit::All => {
                let seen = |cell: &CellId| self.share_of(*cell).is_some();
                let of_cell = |v: &InView| {
                    // Each piece with the first of its cells.
                    let is_first = |p: &&PieceId| slots.cells.of(**p).find(seen) == Some(v.cell);
                    let pieces = catalog.pieces_of(v.cell).iter();
                    pieces.filter(is_pending).filter(is_first).count()
                };
                let lacks = |v: &&InView| slots.cells.lacks(v.cell).n_coming > 0;
                self.last_view.iter().filter(lacks).map(of_cell).sum()
            }
        }
    }

    /// Returns `true` if a chosen piece of at least this share of the screen is on its way or about to be asked for.
    pub(crate) fn is_large_coming(&self, share: f32, catalog: &Catalog, slots: &Slots) -> bool {
        if self.fit == Fit::All {
            return self.last_view.iter().any(|v| {
                let lacks = slots.cells.lacks(v.cell);
                let is_large = self.share_of(v.cell).is_some_and(|s| s >= share);
                is_large && lacks.n_coming > lacks.n_failing
            });
        }
        let is_coming = |p: &PieceId| {
            let state = slots.state(*p);
            let is_large = self.has(*p, catalog, slots) && self.share(*p, catalog, slots) >= share;
            is_large && matches!(state, State::Absent | State::InFlight | State::Arrived)
        };
        self.pieces.iter().any(is_coming)
    }

    /// Returns `true` if a chosen piece is on its way or about to be asked for: nothing else is asked for meanwhile.
    pub(crate) fn is_waiting(&self, catalog: &Catalog, slots: &Slots) -> bool {
        let mut in_flight = slots.in_flight().iter();
        self.has_absent || in_flight.any(|p| self.has(*p, catalog, slots))
    }
}

/// Choice.
impl Wanted {
    /// Looks at a view: which pieces are in it, and which of them fit. Linear in the cells if all fits, otherwise in the pieces, with
    /// a sort of the `n_first` absent ones that are asked for first, or of all if they do not fit.
    pub(crate) fn look(
        &mut self,
        in_view: &[InView],
        min_share: f32,
        n_first: usize,
        catalog: &Catalog,
        slots: &Slots,
    ) {
        self.view = self.view.wrapping_add(1);
        self.min_share = min_share;
        self.pieces.clear();
        self.absent.clear();
        self.chosen.clear();
        self.lacking.clear();
        self.last_view.clear();
        self.last_view.extend_from_slice(in_view);
        let (mut n_bytes, mut is_complete) = (0_u64, true);
        for &InView { cell, share } in in_view {
            let lacks = slots.cells.lacks(cell);
            is_complete &= lacks.is_nothing();
            let share = clean(share);
            let Some(seen) = self.shares.get_mut(cell.idx()) else {
                continue;
            };
            if share < min_share {
                continue;
            }
            let before = if seen.0 == self.view { seen.1 } else { 0.0 };
            *seen = (self.view, share.max(before));
            n_bytes = n_bytes.saturating_add(slots.cells.n_bytes(cell));
            if lacks.n_coming > 0 {
                self.lacking.push(InView { cell, share });
            }
        }
        // Pinned pieces that are not there yet need their room.
        let has_room = slots.n_pinned == 0 || slots.n_kept + slots.n_pinned <= slots.max_kept;
        self.fit = if is_complete && has_room {
            Fit::Complete
        } else if n_bytes <= slots.max_kept - slots.n_pinned {
            Fit::All
        } else {
            Fit::Some
        };
        self.is_marked = self.fit == Fit::Some;
        self.has_absent = self.fit != Fit::Complete;
        self.n_asked = 0;
        if self.fit == Fit::Some {
            self.choose(n_first, catalog, slots);
        }
    }

    /// Chooses among the pieces in view those that fit.
    fn choose(&mut self, n_first: usize, catalog: &Catalog, slots: &Slots) {
        let (mut n_bytes, view) = (0, self.view);
        for seen in &self.last_view {
            let share = clean(seen.share);
            if share < self.min_share {
                continue;
            }
            for &piece in catalog.pieces_of(seen.cell) {
                let mark = &mut self.marks[piece.idx()];
                if mark.seen != view {
                    (mark.seen, mark.share) = (view, share);
                    self.pieces.push(piece);
                    let slot = slots.of(piece);
                    // Pinned ones have their room already.
                    n_bytes += if slot.n_pins == 0 { slot.n_resident } else { 0 };
                }
                mark.share = mark.share.max(share);
            }
        }
        let mut room = slots.max_kept - slots.n_pinned;
        if n_bytes > room {
            self.sort_for_choice(slots);
        }
        for &piece in &self.pieces {
            let slot = slots.of(piece);
            if slot.state == State::Missing {
                continue;
            }
            if slot.n_pins == 0 {
                if slot.n_resident > room {
                    continue;
                }
                room -= slot.n_resident;
            }
            self.marks[piece.idx()].chosen = view;
            if slot.state != State::Resident {
                self.chosen.push(piece);
            }
            if slot.state == State::Absent {
                self.absent.push(piece);
            }
        }
        let marks = &self.marks;
        let larger = |a: &PieceId, b: &PieceId| {
            let share = |p: &PieceId| marks[p.idx()].share;
            share(b).total_cmp(&share(a)).then(a.cmp(b))
        };
        let n = self.absent.len().min(n_first);
        if n > 0 {
            self.absent.select_nth_unstable_by(n - 1, larger);
            self.absent[..n].sort_unstable_by(larger);
        }
    }

    fn sort_for_choice(&mut self, slots: &Slots) {
        let marks = &self.marks;
        let key = |&piece: &PieceId| {
            let stays = if slots.state(piece).is_kept() {
                STAYS
            } else {
                1.0
            };
            marks[piece.idx()].share * stays
        };
        self.pieces
            .sort_unstable_by(|a, b| key(b).total_cmp(&key(a)).then(a.cmp(b)));
    }

    /// Marks the pieces in view if this was not needed yet. Call it before pieces in memory are chosen to go.
    pub(crate) fn mark(&mut self, catalog: &Catalog) {
        if std::mem::replace(&mut self.is_marked, true) {
            return;
        }
        for seen in &self.last_view {
            if self.fit == Fit::All && clean(seen.share) < self.min_share {
                continue;
            }
            for piece in catalog.pieces_of(seen.cell) {
                self.marks[piece.idx()].chosen = self.view;
            }
        }
    }

    /// Returns the absent piece to ask for next: the first of the cell with the largest share.
    pub(crate) fn next_absent(&mut self, catalog: &Catalog, slots: &mut Slots) -> Option<PieceId> {
        if !self.has_absent {
            return None;
        }
        if self.fit == Fit::Some {
            let rest = self.absent.get(self.n_asked..).unwrap_or_default();
            // It may have been asked for as a pinned one.
            let is_absent = |p: &&PieceId| slots.state(**p) == State::Absent;
            let n = rest.iter().take_while(|p| !is_absent(p)).count();
            self.n_asked += n;
            self.has_absent = n < rest.len();
            return rest.get(n).copied();
        }
        let larger = |a: &InView, b: &InView| a.share.total_cmp(&b.share).then(b.cell.cmp(&a.cell));
        let all = |lacking: &[InView]| {
            let cells = (0..).zip(lacking);
            cells
                .max_by(|a, b| larger(a.1, b.1))
                .map(|(i, v)| (i, v.cell))
        };
        while let Some((i, cell)) = all(&self.lacking) {
            if let Some(piece) = slots.first_absent(cell, catalog) {
                return Some(piece);
            }
            self.lacking.swap_remove(i);
        }
        self.has_absent = false;
        None
    }
}

/// Result.
impl Wanted {
    /// Ends a frame: finds whether chosen pieces are not in memory but may come, and remembers the state, so that an equal one is
    /// told apart. Linear in the cells in view if all fits, otherwise in the pieces.
    pub(crate) fn end(&mut self, slots: &Slots) {
        let is_pending = |p: &PieceId| is_coming(slots.state(*p));
        let lacks = |v: &InView| {
            let is_in = self.share_of(v.cell).is_some();
            is_in && slots.cells.lacks(v.cell).n_coming > 0
        };
        self.is_pending = match self.fit {
            Fit::Complete => false,
            Fit::All => self.last_view.iter().any(lacks),
            Fit::Some => self.chosen.iter().any(is_pending),
        };
        self.last_version = slots.version;
    }

    /// Lists the cells in view that are not complete.
    pub(crate) fn stand_ins(
        &self,
        in_view: &[InView],
        catalog: &Catalog,
        slots: &Slots,
        out: &mut Vec<StandIn>,
    ) {
        for &InView { cell, share } in in_view {
            let lacks = slots.cells.lacks(cell);
            if lacks.is_nothing() {
                continue;
            }
            let is_small = clean(share) < self.min_share;
            let cause = if lacks.n_missing > 0 {
                Some(StandInCause::Missing)
            } else if is_small {
                Some(StandInCause::Small)
            } else if self.fit == Fit::Some {
                self.cause_of(cell, catalog, slots)
            } else if lacks.n_failing > 0 {
                Some(StandInCause::Failing)
            } else {
                Some(StandInCause::Pending)
            };
            out.extend(cause.map(|cause| StandIn { cell, share, cause }));
        }
    }

    /// Returns the cause why a large cell is not complete of which no piece is missing, if some of the view does not fit.
    fn cause_of(&self, cell: CellId, catalog: &Catalog, slots: &Slots) -> Option<StandInCause> {
        let cause = |&piece: &PieceId| match slots.state(piece) {
            State::Resident => None,
            _ if !self.has(piece, catalog, slots) => Some(StandInCause::NoRoom),
            State::Failing => Some(StandInCause::Failing),
            _ => Some(StandInCause::Pending),
        };
        let causes = catalog.pieces_of(cell).iter().filter_map(cause);
        causes.max()
    }
}

/// Returns `true` for pieces that are not in memory of the program but may come.
fn is_coming(state: State) -> bool {
    !matches!(state, State::Resident | State::Missing)
}

/// Returns a share of the screen, 0 for what is not a number.
fn clean(share: f32) -> f32 {
    if share > 0.0 { share } else { 0.0 }
}
