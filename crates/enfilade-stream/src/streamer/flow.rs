//! The steps of a frame.

use std::cmp::Reverse;

use super::frame::{Changes, Eye, Failed, InView, Loaded};
use super::options::Policy;
use super::state::State;
use super::sweep::Sweep;
use super::{COST_OF_PIECE, MANY_FAILURES, Streamer, WORK_OF_FRAME};
use crate::deadlines::{Planned, Search};
use crate::{FetchError, PieceId, Source};

/// Time to hand pieces over, and for a sweep to pass. [Units: s]
const MARGIN: f64 = 0.5;

/// The outcome of an attempt to fetch a piece ahead.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Attempt {
    Asked,
    /// There is no room for it, and nothing to wait for.
    NoRoom,
    /// Not now: something has to end first.
    Later,
}

/// How far a sweep fetches ahead.
struct Reach {
    /// Latest deadline within the horizon. [Units: wu]
    limit: f32,
    /// Speed of the eye, if what need not be fetched yet waits. [Units: wu/s]
    speed: Option<f32>,
}

impl Reach {
    /// Returns the latest deadline that is fetched now. [Units: wu]
    fn of(&self, sweep: &Sweep) -> f32 {
        match self.speed {
            Some(_) => self.limit.min(sweep.limit),
            None => self.limit,
        }
    }
}

/// Replies, failures and hand-over.
impl Streamer {
    /// Takes the replies that have come.
    pub(super) fn receive<S: Source + ?Sized>(&mut self, source: &mut S, changes: &mut Changes) {
        source.poll(&mut self.replies);
        if self.replies.is_empty() {
            return;
        }
        let mut replies = std::mem::take(&mut self.replies);
        for reply in replies.drain(..) {
            let piece = reply.piece;
            let known = piece.idx() < self.catalog.pieces().len();
            if !known || self.slots.state(piece) != State::InFlight {
                continue; // canceled
            }
            let most = self.slots.of(piece).n_resident;
            match reply.bytes {
                Ok(bytes) if bytes.len() as u64 <= most => {
                    self.n_failures_in_row = 0;
                    // All that was not fetched ahead before the first reply is looked at again.
                    self.sweep.may_regain |= self.pace.is_unknown();
                    let request = self.slots.rest(piece);
                    self.pace
                        .receive(request.n_packed, self.now - request.asked);
                    self.slots.arrive(piece);
                    self.arrived.push(Loaded { piece, bytes });
                }
                Ok(bytes) => {
                    let problem = format!("{} bytes instead of {most}", bytes.len());
                    let place = "the source".to_owned();
                    let error = FetchError::Damaged {
                        piece,
                        place,
                        problem,
                    };
                    self.fail(piece, error, changes);
                }
                Err(error) => self.fail(piece, error, changes),
            }
        }
        self.replies = replies;
    }

    fn fail(&mut self, piece: PieceId, error: FetchError, changes: &mut Changes) {
        let [first, last] = [self.options.first_retry, self.options.last_retry];
        let retry = if matches!(error, FetchError::Missing { .. }) {
            self.lose(piece, State::Missing);
            None
        } else {
            let wait = self.slots.back_off(piece, first, last);
            self.lose(piece, State::Failing);
            self.retries.push(Reverse((self.now + wait, piece)));
            self.n_failures_in_row += 1;
            let beyond = self.n_failures_in_row.saturating_sub(MANY_FAILURES);
            if self.n_failures_in_row >= MANY_FAILURES {
                self.hold = self.now + first.saturating_mul(1 << beyond.min(30)).min(last);
            }
            Some(self.now + wait)
        };
        changes.failed.push(Failed {
            piece,
            error,
            retry,
        });
    }

    /// Makes failed pieces absent whose time has come.
    pub(super) fn retry(&mut self) {
        while let Some(&Reverse((time, piece))) = self.retries.peek() {
            if time > self.now {
                return;
            }
            self.retries.pop();
            if self.slots.state(piece) == State::Failing {
                self.slots.set_state(piece, State::Absent);
                if self.slots.of(piece).n_pins > 0 {
                    self.to_pin.push(piece);
                }
                if self.slots.rest(piece).swept == self.sweep.stamp {
                    self.sweep.again.push(piece);
                }
            }
        }
    }

    /// Chooses among the pieces in view.
    pub(super) fn look(&mut self, in_view: &[InView]) {
        let (min_share, n_first) = (self.options.min_share, self.options.max_in_flight.max(1));
        self.wanted
            .look(in_view, min_share, n_first, &self.catalog, &self.slots);
        for &piece in self.slots.in_flight() {
            if self.wanted.has(piece, &self.catalog, &self.slots) {
                self.taken_over.push(piece);
            }
        }
        for piece in self.taken_over.drain(..) {
            self.slots.of_mut(piece).for_view = true;
        }
    }

    /// Hands over a slice of what has arrived: first what is in view, then the rest in order of arrival.
    pub(super) fn hand_over(&mut self, changes: &mut Changes) {
        let mut left = self.options.max_bytes_a_frame;
        for is_for_view in [true, false] {
            let mut i = 0;
            while let Some(loaded) = self.arrived.get(i) {
                let piece = loaded.piece;
                let size = self.slots.of(piece).n_resident;
                if self.is_wanted(piece) != is_for_view {
                    i += 1;
                    continue;
                }
                if size > left && !changes.added.is_empty() {
                    return;
                }
                left = left.saturating_sub(size);
                self.slots.hand_over(piece);
                changes.added.push(self.arrived.remove(i));
                self.n_loaded += 1;
            }
        }
    }

    /// Counts what is in view and not in memory, and lists the cells.
    pub(super) fn report(&mut self, in_view: &[InView], is_same: bool, changes: &mut Changes) {
        if is_same && self.wanted.is_same(in_view, &self.slots) && self.is_whole {
            return;
        }
        self.wanted.end(&self.slots);
        let out = &mut changes.stand_ins;
        self.wanted
            .stand_ins(in_view, &self.catalog, &self.slots, out);
        self.is_whole = out.is_empty();
    }
}

/// Requests for the view and for pinned cells.
impl Streamer {
    /// Frees what is not in view, if the policy keeps nothing else.
    pub(super) fn drop_unseen<S: Source + ?Sized>(
        &mut self,
        source: &mut S,
        changes: &mut Changes,
    ) {
        if self.options.policy != Policy::Minimal {
            return;
        }
        self.wanted.mark(&self.catalog);
        for piece in self.slots.last_first(true) {
            if self.may_go(piece) {
                self.victims.push(piece);
            }
        }
        self.evict_victims(source, changes);
    }

    /// Asks for chosen pieces, the largest share of the screen first.
    pub(super) fn fetch_for_view<S: Source + ?Sized>(
        &mut self,
        source: &mut S,
        changes: &mut Changes,
    ) {
        let is_full = self.slots.in_flight().len() >= self.options.max_in_flight.max(1);
        if is_full && self.slots.in_flight().iter().all(|p| self.is_wanted(*p)) {
            return;
        }
        while let Some(piece) = self.wanted.next_absent(&self.catalog, &mut self.slots) {
            if let Policy::Delayed { first_share } = self.options.policy {
                let (catalog, slots) = (&self.catalog, &self.slots);
                let is_small = self.wanted.share(piece, catalog, slots) < first_share;
                if is_small && self.wanted.is_large_coming(first_share, catalog, slots) {
                    break;
                }
            }
            if !self.fetch_now(source, piece, changes) {
                break;
            }
        }
    }

    /// Returns `true` if something in view is on its way or about to be asked for.
    fn is_waiting(&self) -> bool {
        self.wanted.is_waiting(&self.catalog, &self.slots)
    }

    /// Returns `true` if a piece is in view and fits. For pieces in memory, only after [`super::Wanted::mark`].
    fn is_wanted(&self, piece: PieceId) -> bool {
        self.wanted.has(piece, &self.catalog, &self.slots)
    }

    /// Asks for pieces of pinned cells.
    pub(super) fn fetch_pinned<S: Source + ?Sized>(
        &mut self,
        source: &mut S,
        changes: &mut Changes,
    ) {
        while let Some(&piece) = self.to_pin.last() {
            let slot = self.slots.of(piece);
            let is_due = slot.n_pins > 0 && slot.state == State::Absent;
            if is_due && !self.fetch_now(source, piece, changes) {
                return;
            }
            self.to_pin.pop();
        }
    }

    /// Asks for a piece that is wanted now; frees others, and cancels requests made ahead, if need be. Returns `false` if it
    /// has to wait for requests to end.
    fn fetch_now<S: Source + ?Sized>(
        &mut self,
        source: &mut S,
        piece: PieceId,
        changes: &mut Changes,
    ) -> bool {
        let slot = self.slots.of(piece);
        let (size, n_packed) = (slot.n_resident, self.slots.rest(piece).n_packed);
        if !self.choose_victims(size) {
            return false;
        }
        self.evict_victims(source, changes);
        while !self.may_ask(n_packed) {
            // Made ahead, the last due.
            let due = |p: &PieceId| self.search.due_of(p.idx()).unwrap_or(f32::INFINITY);
            let ahead = self.slots.in_flight().iter().filter(|p| self.may_go(**p));
            let Some(&last) = ahead.max_by(|a, b| due(a).total_cmp(&due(b)).then(a.cmp(b))) else {
                return false;
            };
            self.victims.push(last);
            self.evict_victims(source, changes);
        }
        self.ask(source, piece, true);
        true
    }

    /// Chooses pieces to free until a piece has room that is wanted now: the last due first, and what may be seen now only if all
    /// else is not enough. Chooses none if there is not enough.
    fn choose_victims(&mut self, size: u64) -> bool {
        let mut room = self.slots.max_kept - self.slots.n_kept;
        if room < size {
            self.wanted.mark(&self.catalog);
        }
        for is_visible in [false, true] {
            for victim in self.slots.last_first(true) {
                if room >= size {
                    break;
                }
                let is_due = self.search.due_of(victim.idx()) == Some(0.0);
                if is_due == is_visible && self.may_go(victim) {
                    room += self.slots.of(victim).n_resident;
                    self.victims.push(victim);
                }
            }
        }
        if room < size {
            self.victims.clear();
            return false;
        }
        self.spare_victims(room - size);
        true
    }

    /// Spares chosen victims while there is room to spare, the first due first.
    fn spare_victims(&mut self, mut room: u64) {
        for i in (0..self.victims.len()).rev() {
            let size = self.slots.of(self.victims[i]).n_resident;
            if size <= room {
                room -= size;
                self.victims.remove(i);
            }
        }
    }

    /// Returns `true` if a kept piece may go for one that is wanted now: it is neither in view, nor pinned, nor on its way for a
    /// view. What was asked for by a view is shown once, or else two views in turns might keep each other from it for ever.
    fn may_go(&self, piece: PieceId) -> bool {
        let slot = self.slots.of(piece);
        let is_coming = slot.state != State::Resident && slot.for_view;
        slot.n_pins == 0 && !is_coming && !self.is_wanted(piece)
    }

    /// Returns `true` if a request of this size is within the limits.
    fn may_ask(&self, n_packed: u64) -> bool {
        let bytes = self.slots.bytes_in_flight.saturating_add(n_packed);
        let n = self.slots.in_flight().len();
        n == 0 || (n < self.options.max_in_flight && bytes <= self.options.max_bytes_in_flight)
    }

    fn ask<S: Source + ?Sized>(&mut self, source: &mut S, piece: PieceId, for_view: bool) {
        self.slots.reserve(piece, for_view);
        self.slots.rest_mut(piece).asked = self.now;
        self.n_requests += 1;
        self.bytes_requested += self.slots.rest(piece).n_packed;
        source.request(piece);
    }

    fn evict_victims<S: Source + ?Sized>(&mut self, source: &mut S, changes: &mut Changes) {
        while let Some(piece) = self.victims.pop() {
            match self.slots.state(piece) {
                State::InFlight => {
                    source.cancel(piece);
                    if self.slots.rest(piece).swept == self.sweep.stamp {
                        self.sweep.again.push(piece);
                    }
                }
                State::Arrived => self.arrived.retain(|loaded| loaded.piece != piece),
                _ => changes.removed.push(piece),
            }
            self.lose(piece, State::Absent);
        }
    }

    /// Counts a piece in memory as freed: the program needed the room. It is asked for again when it is in view or due soon, so
    /// leave the view alone. Without effect for other pieces.
    pub fn forget(&mut self, piece: PieceId) {
        if self.is_resident(piece) {
            self.lose(piece, State::Absent);
        }
    }

    /// Frees the memory of a piece.
    fn lose(&mut self, piece: PieceId, state: State) {
        let slot = self.slots.of(piece);
        if self.slots.rest(piece).swept == self.sweep.stamp {
            self.sweep.n_bytes = self.sweep.n_bytes.saturating_sub(slot.n_resident);
            self.sweep.has_lost |= state == State::Absent;
        }
        self.sweep.no_room = None;
        self.slots.release(piece, state);
    }
}

/// Deadlines.
impl Streamer {
    /// Follows the eye: finds deadlines anew where it has moved.
    pub(super) fn follow(&mut self, eye: &Eye, is_same: bool) {
        if self.options.policy == Policy::Minimal {
            return;
        }
        let step = self.options.step.max(0.0);
        let is_free = self.sweep.is_over || self.sweep.is_waiting;
        self.sweep.may_regain |= self.sweep.has_lost && !is_same;
        if self.search.follow(eye.cell, eye.position, step, is_free)
            || (self.sweep.may_regain && is_free)
        {
            self.sweep.begin();
            self.slots.begin_sweep();
        }
        if self.search.order.is_empty() {
            // So that what may be seen now does not go for what is in view.
            self.search.find(&self.catalog, &mut WORK_OF_FRAME.clone());
        }
    }

    /// Goes on with the sweep, as far as the work of a frame allows.
    pub(super) fn run_sweep<S: Source + ?Sized>(
        &mut self,
        source: &mut S,
        speed: f32,
        changes: &mut Changes,
    ) {
        let limit = match self.options.policy {
            Policy::Minimal => return,
            Policy::Cache => -1.0,
            Policy::Delayed { .. } => f32::INFINITY,
            Policy::Prefetch { horizon } => horizon.as_secs_f32() * speed.max(0.0),
        };
        let is_paced = matches!(self.options.policy, Policy::Prefetch { .. });
        let reach = Reach {
            limit,
            speed: is_paced.then_some(speed.max(0.0)),
        };
        self.sweep.is_waiting = false;
        self.fetch_again(source, reach.of(&self.sweep), changes);
        let mut work = WORK_OF_FRAME;
        while work > 0 && !self.sweep.is_over && !self.sweep.is_waiting {
            if let Some(&planned) = self.search.order.get(self.sweep.cell) {
                self.sweep_cell(source, planned, &reach, &mut work, changes);
            } else if self.search.is_over() {
                self.end_sweep(&reach);
            } else {
                self.search.find(&self.catalog, &mut work);
            }
        }
        self.sweep.trim(&self.slots);
    }

    /// Asks for pieces that the sweep has met and that failed or were canceled, the first due first.
    fn fetch_again<S: Source + ?Sized>(
        &mut self,
        source: &mut S,
        limit: f32,
        changes: &mut Changes,
    ) {
        let due = |search: &Search, p: PieceId| search.due_of(p.idx()).unwrap_or(f32::INFINITY);
        let first = |again: &[PieceId], search: &Search| {
            let pieces = (0..).zip(again).map(|(i, &p)| (due(search, p), p, i));
            pieces.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
        };
        while let Some((due, piece, i)) = first(&self.sweep.again, &self.search) {
            if due <= limit && self.slots.state(piece) == State::Absent {
                match self.fetch_ahead(source, piece, due, true, changes) {
                    Attempt::Later => return,
                    Attempt::Asked if due == 0.0 => self.sweep.pending.push(piece),
                    Attempt::Asked | Attempt::NoRoom => {}
                }
            }
            self.sweep.again.swap_remove(i);
        }
    }

    /// Meets the pieces of a cell.
    fn sweep_cell<S: Source + ?Sized>(
        &mut self,
        source: &mut S,
        planned: Planned,
        reach: &Reach,
        work: &mut u32,
        changes: &mut Changes,
    ) {
        let Planned { cell, due } = planned;
        self.sweep.is_past_visible |= due > 0.0;
        if due > reach.limit && self.pass_horizon(reach) {
            return;
        }
        *work = work.saturating_sub(COST_OF_PIECE);
        while let Some(&piece) = self.catalog.pieces_of(cell).get(self.sweep.piece) {
            if *work == 0 {
                return;
            }
            *work = work.saturating_sub(COST_OF_PIECE);
            let slot = self.slots.of(piece);
            if self.slots.rest(piece).swept != self.sweep.stamp {
                if slot.state == State::Absent
                    && due <= reach.of(&self.sweep)
                    && self.fetch_ahead(source, piece, due, false, changes) == Attempt::Later
                {
                    self.sweep.is_waiting = true;
                    return;
                }
                self.sweep.meet(piece, due, &mut self.slots);
                self.watch(due, reach);
            }
            self.sweep.piece += 1;
        }
        (self.sweep.cell, self.sweep.piece) = (self.sweep.cell + 1, 0);
        if self.slots.max_kept.saturating_sub(self.sweep.n_bytes) < self.smallest {
            self.end_sweep(reach);
        }
    }

    /// Watches whether all that was met so far can come in time if nothing is fetched until the eye has gone a step.
    fn watch(&mut self, due: f32, reach: &Reach) {
        let Some(speed) = reach.speed.filter(|_| due > 0.0 && due <= reach.limit) else {
            return;
        };
        if self.pace.is_unknown() && !self.slots.in_flight().is_empty() {
            return; // a reply will tell
        }
        let time = self.pace.time_of(self.sweep.n_ahead) + MARGIN;
        if f64::from(due - self.options.step) <= time * f64::from(speed) {
            self.sweep.must = due;
        }
    }

    /// Ends the part of a sweep that fetches: sets how far the next one does. Returns `true` if it begins anew, because more has to
    /// be fetched now.
    fn pass_horizon(&mut self, reach: &Reach) -> bool {
        if reach.speed.is_none() || std::mem::replace(&mut self.sweep.is_past_horizon, true) {
            return false;
        }
        let is_more = self.sweep.must > self.sweep.limit;
        self.sweep.limit = self.sweep.must;
        if is_more {
            self.sweep.begin();
            self.slots.begin_sweep();
        }
        is_more
    }

    fn end_sweep(&mut self, reach: &Reach) {
        if !self.pass_horizon(reach) {
            self.sweep.end();
        }
    }

    /// Asks for a piece that is due later than now, if there is room beside what is due no later than it. `is_passed` if the
    /// sweep has gone on, past pieces that are due later.
    fn fetch_ahead<S: Source + ?Sized>(
        &mut self,
        source: &mut S,
        piece: PieceId,
        due: f32,
        is_passed: bool,
        changes: &mut Changes,
    ) -> Attempt {
        let slot = self.slots.of(piece);
        let (size, n_packed) = (slot.n_resident, self.slots.rest(piece).n_packed);
        if self.sweep.knows_no_room(due, size) {
            self.sweep.has_lost = true;
            return Attempt::NoRoom;
        }
        if self.now < self.hold || self.is_waiting() || !self.may_ask(n_packed) {
            return Attempt::Later;
        }
        let mut room = self.slots.max_kept - self.slots.n_kept;
        let mut soon = 0;
        if room < size {
            self.wanted.mark(&self.catalog);
        }
        for victim in self.slots.last_first(is_passed) {
            if room >= size {
                break;
            }
            let is_later = self.search.due_of(victim.idx()).is_none_or(|d| d > due);
            let slot = self.slots.of(victim);
            if is_later && slot.n_pins == 0 && !self.is_wanted(victim) {
                if slot.state == State::InFlight || !self.may_go(victim) {
                    soon += slot.n_resident; // it may go once it is there
                } else {
                    room += slot.n_resident;
                    self.victims.push(victim);
                }
            }
        }
        if room < size {
            self.victims.clear();
            if room + soon >= size {
                return Attempt::Later;
            }
            self.sweep.no_room = Some((due, size));
            self.sweep.has_lost = true;
            return Attempt::NoRoom;
        }
        self.spare_victims(room - size);
        self.evict_victims(source, changes);
        self.ask(source, piece, false);
        Attempt::Asked
    }
}
