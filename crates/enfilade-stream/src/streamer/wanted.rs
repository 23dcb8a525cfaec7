//! The pieces in view, and those of them that fit.

use super::frame::{Cause, InView, StandIn};
use super::slots::{Slots, State};
use crate::{Catalog, PieceId};

/// Factor by which a piece in memory counts as larger, so that two pieces that do not fit together are not fetched in turns while
/// their shares of the screen change a little.
const STAYS: f32 = 1.5;

#[derive(Clone, Copy, Debug, Default)]
struct Mark {
    /// The view in which it was last.
    seen: u32,
    /// The view in which it was last chosen.
    chosen: u32,
    share: f32,
}

/// The pieces in view by their share of the screen. Chosen are those that fit beside the pinned ones, the largest first: a
/// piece that does not fit any more is passed over, and smaller ones follow.
#[derive(Debug, Default)]
pub(crate) struct Wanted {
    /// Number of the current view.
    view: u32,
    marks: Vec<Mark>,
    pieces: Vec<PieceId>,
    /// Chosen pieces that are absent; the first of them, as many as may be asked for at once, by share, the largest first.
    pub(crate) absent: Vec<PieceId>,
    /// Chosen pieces that were not in memory when the view was looked at.
    lacking: Vec<PieceId>,
    /// Number of chosen pieces that are not in memory but may come.
    n_pending: usize,
    /// For each cell, one more than the losses of memory after which it was complete; so it still is, after no more.
    complete: Vec<u64>,
    /// True if all cells in view are complete: then pieces have no marks until they are [needed](Self::mark).
    is_complete: bool,
    is_marked: bool,
    last_view: Vec<InView>,
    last_version: u64,
}

impl Wanted {
    pub(crate) fn new(catalog: &Catalog) -> Self {
        Self {
            marks: vec![Mark::default(); catalog.pieces().len()],
            complete: vec![0; catalog.n_cells()],
            last_version: u64::MAX,
            ..Self::default()
        }
    }

    /// Returns `true` if a piece is in view and fits. For pieces in memory, only after [`Wanted::mark`].
    #[inline]
    pub(crate) fn has(&self, piece: PieceId) -> bool {
        self.marks[piece.idx()].chosen == self.view
    }

    /// Returns the share of the screen of a piece in view; 0 for others.
    #[inline]
    pub(crate) fn share(&self, piece: PieceId) -> f32 {
        let mark = self.marks[piece.idx()];
        if mark.seen == self.view {
            mark.share
        } else {
            0.0
        }
    }

    /// Returns `true` if nothing has changed since the last look at this view.
    pub(crate) fn is_same(&self, in_view: &[InView], slots: &Slots) -> bool {
        self.last_version == slots.version && self.last_view == in_view
    }

    /// Returns the number of chosen pieces that are not in memory but may come.
    pub(crate) fn n_pending(&self) -> usize {
        self.n_pending
    }

    /// Looks at a view: which pieces are in it, and which of them fit. Linear in the cells if all are complete and were so
    /// before, otherwise in the pieces, with a sort of the `n_first` absent ones that are asked for first, or of all if they do
    /// not fit.
    pub(crate) fn look(
        &mut self,
        in_view: &[InView],
        min_share: f32,
        n_first: usize,
        catalog: &Catalog,
        slots: &Slots,
    ) {
        self.view = self.view.wrapping_add(1);
        self.pieces.clear();
        self.absent.clear();
        self.lacking.clear();
        self.last_view.clear();
        self.last_view.extend_from_slice(in_view);
        let complete = slots.n_losses + 1;
        let is_complete = |seen: &InView| {
            let of_cell = self.complete.get(seen.cell.idx());
            of_cell.is_none_or(|c| *c == complete)
        };
        // Pinned pieces that are not there yet need their room.
        let has_room = slots.n_pinned == 0 || slots.n_kept + slots.n_pinned <= slots.max_kept;
        self.is_complete = has_room && in_view.iter().all(is_complete);
        self.is_marked = !self.is_complete;
        if self.is_complete {
            return;
        }
        let (mut n_bytes, view) = (0, self.view);
        for seen in in_view {
            let share = clean(seen.share);
            if share < min_share {
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
                self.lacking.push(piece);
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

    /// Marks the pieces in view if this was not needed yet. Call it before pieces in memory are chosen to go.
    pub(crate) fn mark(&mut self, catalog: &Catalog) {
        if std::mem::replace(&mut self.is_marked, true) {
            return;
        }
        for seen in &self.last_view {
            for piece in catalog.pieces_of(seen.cell) {
                self.marks[piece.idx()].chosen = self.view;
            }
        }
    }

    /// Returns `true` if a chosen piece of at least this share of the screen is on its way or about to be asked for.
    pub(crate) fn is_large_coming(&self, share: f32, slots: &Slots) -> bool {
        let is_coming = |p: &PieceId| {
            let state = slots.state(*p);
            let is_large = self.has(*p) && self.share(*p) >= share;
            is_large && matches!(state, State::Absent | State::InFlight | State::Arrived)
        };
        self.pieces.iter().any(is_coming)
    }

    /// Returns `true` if a chosen piece is on its way or about to be asked for: nothing else is asked for meanwhile.
    pub(crate) fn is_waiting(&self, slots: &Slots) -> bool {
        !self.absent.is_empty() || slots.in_flight().iter().any(|p| self.has(*p))
    }

    /// Ends a frame: counts the chosen pieces that are not in memory but may come, and remembers the state, so that an equal
    /// one is told apart. Linear in the pieces in view.
    pub(crate) fn end(&mut self, slots: &Slots) {
        let is_pending =
            |p: &&PieceId| !matches!(slots.state(**p), State::Resident | State::Missing);
        self.n_pending = self.lacking.iter().filter(is_pending).count();
        self.last_version = slots.version;
    }

    /// Lists the cells in view that are not complete.
    pub(crate) fn stand_ins(
        &mut self,
        in_view: &[InView],
        min_share: f32,
        catalog: &Catalog,
        slots: &Slots,
        out: &mut Vec<StandIn>,
    ) {
        if self.is_complete {
            return;
        }
        for &InView { cell, share } in in_view {
            let cause = |&piece: &PieceId| match slots.state(piece) {
                State::Resident => None,
                State::Missing => Some(Cause::Missing),
                _ if clean(share) < min_share => Some(Cause::Small),
                _ if !self.has(piece) => Some(Cause::NoRoom),
                State::Failing => Some(Cause::Failing),
                State::Absent | State::InFlight | State::Arrived => Some(Cause::Pending),
            };
            let causes = catalog.pieces_of(cell).iter().filter_map(cause);
            match causes.max() {
                Some(cause) => out.push(StandIn { cell, share, cause }),
                None => {
                    if let Some(complete) = self.complete.get_mut(cell.idx()) {
                        *complete = slots.n_losses + 1;
                    }
                }
            }
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
}

/// Returns a share of the screen, 0 for what is not a number.
fn clean(share: f32) -> f32 {
    if share > 0.0 { share } else { 0.0 }
}
