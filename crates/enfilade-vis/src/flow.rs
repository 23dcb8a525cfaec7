//! The search from one opening: a walk over all chains of portals that a line might pass.
//!
//! After Dirkse, section 7.4, and the level-4 flow of the Quake tools, with four departures that make it fast and
//! exact:
//!
//! - *Lines first.* A line that passes a chain proves everything on it visible without a search. A step continues
//!   only while something undecided might lie behind it, by the openings' own bounds and by the current planes. Most
//!   chains that exist are never walked.
//! - *Openings, not cells.* The sets of what might be seen are kept per directed portal, so that a result also serves
//!   the opposite direction, and an unreachable opening is not even clipped.
//! - *Splitting.* Where planes leave a chain open and no line passes, the source is halved and each half is tested
//!   again: the smaller the source, the tighter the planes.
//! - *Plücker coordinates* (`stabbing`) for chains that a few halves leave open: no amount of splitting closes a
//!   chain that only lines along an edge or in a plane pass.
//!
//! Errs to visible: a chain that neither a plane nor a line settles counts as seen.

mod lines;

use enfilade_geom::DVec3;
use fearless_simd::{Level, Simd, dispatch};

use crate::bits::{self, BitTable};
use crate::clip::{Arena, Poly};
use crate::dirs::{Dirs, Next};
use crate::planes::{FacedOutline, Facing, Four, Side, admits, hide, separators};
use crate::rays::{Blocker, Line};
use crate::tolerance::{HalfSpace, Tolerance};

/// Longest chain followed; everything that might lie beyond counts as seen. Bounds the stack.
const MAX_CHAIN: usize = 512;

/// Pieces that a source is split into before the linear program runs; more are tried only if that does not decide.
pub(crate) const FEW_PIECES: u32 = 4;

/// Data that does not change during a round.
pub(crate) struct Shared<'a> {
    pub(crate) dirs: &'a Dirs,
    pub(crate) might: &'a BitTable,
    pub(crate) next: &'a Next,
    /// Pairs of cells already decided to be visible.
    pub(crate) seen: &'a BitTable,
    pub(crate) tolerance: Tolerance,
    pub(crate) blocker: Option<Blocker<'a>>,
    /// Most pieces that a source is split into to settle one chain.
    pub(crate) max_pieces: u32,
}

/// Results of the search from one opening.
#[derive(Default)]
pub(crate) struct Found {
    pub(crate) source: usize,
    /// Openings proved to be hidden, as bits.
    pub(crate) hidden: Vec<u64>,
    pub(crate) lines: Vec<Line>,
    /// Cells that could not be decided and count as seen.
    pub(crate) undecided: Vec<u32>,
    pub(crate) effort: Effort,
}

/// Counts of the work done.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Effort {
    pub(crate) steps: u64,
    pub(crate) clips: u64,
    pub(crate) stabs: u64,
    pub(crate) splits: u64,
    pub(crate) rays: u64,
}

impl Effort {
    pub(crate) fn add(&mut self, other: &Self) {
        self.steps += other.steps;
        self.clips += other.clips;
        self.stabs += other.stabs;
        self.splits += other.splits;
        self.rays += other.rays;
    }
}

/// Buffers and state of a search, reused by the next.
#[derive(Default)]
pub(crate) struct Flow {
    pub(crate) arena: Arena,
    /// For each depth, the openings that all openings of the chain might see.
    pub(crate) reach: Vec<Vec<u64>>,
    /// Indices of the nonzero words of the first row of `reach`. The rows of other depths are valid only there.
    pub(crate) words: Vec<u32>,
    /// The openings still to be settled from this source.
    pub(crate) wanted: Vec<u64>,
    /// For each depth, the chain's opening as clipped.
    pub(crate) chain: Vec<Poly>,
    pub(crate) planes: Vec<Four>,
    walked: Vec<u32>,
    unreached: Vec<u64>,
    stack: Vec<u32>,
    found: Found,
}

/// Result of the test whether a line passes a chain.
#[derive(PartialEq)]
enum Stab {
    Line(DVec3, DVec3),
    None,
    Unknown,
}

impl Flow {
    /// Settles every opening that `source` might see.
    pub(crate) fn search(&mut self, shared: &Shared<'_>, source: usize) -> Found {
        let dirs = shared.dirs;
        let dir = &dirs.all[source];
        let n_words = shared.might.n_words();
        self.found = Found {
            source,
            ..Found::default()
        };
        self.wanted.clear();
        self.wanted.resize(n_words, 0);
        let seen = shared.seen.row(dir.from as usize);
        let might = bits::ones(shared.might.row(source));
        might
            .filter(|&q| !bits::get(seen, dirs.all[q].to as usize))
            .for_each(|q| bits::set(&mut self.wanted, q));
        let poly = self.begin(shared, source);
        self.set_reach(0, shared.might.row(source));
        if self.wanted.iter().any(|&w| w != 0) {
            self.drop_unreached(shared, source);
            self.find_words();
            self.visit(shared, poly);
        }
        self.found.hidden = self.wanted.clone();
        std::mem::take(&mut self.found)
    }

    /// Drops from `reach` the openings that no chain of openings that might see each other leads to any more; other
    /// searches may have hidden some.
    fn drop_unreached(&mut self, shared: &Shared<'_>, source: usize) {
        let dirs = shared.dirs;
        let row = shared.might.row(source);
        self.unreached.clear();
        self.unreached.extend_from_slice(row);
        self.stack.push(source as u32);
        while let Some(at) = self.stack.pop() {
            let at = at as usize;
            let exits = dirs.after(at);
            for start in exits.clone().step_by(64) {
                let window = shared.next.window(shared.might, at, &exits, start)
                    & bits::window(&self.unreached, start);
                bits::clear_window(&mut self.unreached, start, window);
                self.stack
                    .extend(bits::ones_from(start, window).map(|q| q as u32));
            }
        }
        for (word, &unreached) in self.reach[0].iter_mut().zip(&self.unreached) {
            *word &= !unreached;
        }
    }

    /// Starts a chain with a whole opening.
    pub(crate) fn begin(&mut self, shared: &Shared<'_>, source: usize) -> Poly {
        self.arena.release(0);
        self.planes.clear();
        self.chain.clear();
        let poly = self.arena.push(shared.dirs.winding(source), source as u32);
        self.chain.push(poly);
        poly
    }

    pub(crate) fn set_reach(&mut self, depth: usize, row: &[u64]) {
        if self.reach.len() <= depth {
            self.reach.resize(depth + 1, Vec::new());
        }
        self.reach[depth].clear();
        self.reach[depth].extend_from_slice(row);
    }

    /// Fills [`Flow::words`].
    pub(crate) fn find_words(&mut self) {
        self.words.clear();
        let row = self.reach[0].iter().enumerate();
        self.words
            .extend(row.filter(|&(_, &word)| word != 0).map(|(i, _)| i as u32));
    }

    /// Continues from the end of the chain; `source` is the part left of its first opening.
    fn visit(&mut self, shared: &Shared<'_>, source: Poly) {
        let dirs = shared.dirs;
        let depth = self.chain.len() - 1;
        let pass = self.chain[depth];
        let back = dirs.reverse[pass.dir as usize] as usize;
        let first_plane = self.planes.len();
        if depth > 0 {
            self.add_planes(shared, source, pass);
            if !self.check_wanted(shared, first_plane, depth) {
                self.planes.truncate(first_plane);
                return;
            }
        }
        self.found.effort.steps += 1;
        if depth >= MAX_CHAIN {
            return self.give_up(shared, depth);
        }
        if self.reach.len() <= depth + 1 {
            self.reach.push(vec![0; self.wanted.len()]);
        }
        for q in dirs.after(pass.dir as usize) {
            let is_near = bits::get(&self.reach[0], q) && bits::get(&self.reach[depth], q);
            if q == back || !is_near {
                continue;
            }
            let (near, far) = self.reach.split_at_mut(depth + 1);
            let rows = (&near[depth][..], shared.might.row(q));
            let leads_on = bits::and_into(&self.words, &mut far[0], rows, &self.wanted);
            if !leads_on && !bits::get(&self.wanted, q) {
                continue;
            }
            let mark = self.arena.mark();
            let end = self.planes.len();
            if let Some((source, target)) = self.narrow(shared, source, pass, q, first_plane) {
                self.chain.push(target);
                self.enter(shared, source, target, leads_on);
                self.chain.pop();
            }
            self.planes.truncate(end);
            self.arena.release(mark);
        }
        self.planes.truncate(first_plane);
    }

    fn is_any_wanted(&self, depth: usize) -> bool {
        let row = &self.reach[depth];
        let at = |&i: &u32| row[i as usize] & self.wanted[i as usize] != 0;
        self.words.iter().any(at)
    }

    /// Counts everything that might lie beyond the chain as seen.
    fn give_up(&mut self, shared: &Shared<'_>, depth: usize) {
        let mut beyond = vec![0; self.wanted.len()];
        let rows = (&self.reach[depth][..], &self.wanted[..]);
        bits::and_into(&self.words, &mut beyond, rows, &self.wanted);
        for q in bits::ones(&beyond) {
            let cell = shared.dirs.all[q].to;
            self.found.undecided.push(cell);
            self.settle_cell(shared.dirs, cell);
        }
    }

    /// Settles the chain's end if it is wanted, then continues behind it while that can matter.
    fn enter(&mut self, shared: &Shared<'_>, source: Poly, target: Poly, leads_on: bool) {
        let q = target.dir as usize;
        if bits::get(&self.wanted, q) {
            match self.decide(shared, source, target) {
                Stab::None => return,
                Stab::Line(from, to) => self.shoot(shared, from, to),
                Stab::Unknown => {}
            }
            if bits::get(&self.wanted, q) {
                let cell = shared.dirs.all[q].to;
                self.found.undecided.push(cell);
                self.settle_cell(shared.dirs, cell);
            }
        }
        if leads_on && self.is_any_wanted(self.chain.len() - 1) {
            self.visit(shared, source);
        }
    }

    /// Decides whether a line passes the chain, by the cheapest test that can.
    fn decide(&mut self, shared: &Shared<'_>, source: Poly, target: Poly) -> Stab {
        let mut answer = self.stab(shared, source, target);
        if answer == Stab::Unknown {
            answer = self.settle(shared, source, &mut shared.max_pieces.min(FEW_PIECES));
        }
        if answer == Stab::Unknown {
            answer = self.stab_at_all(shared, source);
        }
        if answer == Stab::Unknown && shared.max_pieces > FEW_PIECES {
            answer = self.settle(shared, source, &mut shared.max_pieces.clone());
        }
        answer
    }

    /// Decides a chain by halving its source until planes close it or a line is found.
    fn settle(&mut self, shared: &Shared<'_>, source: Poly, pieces: &mut u32) -> Stab {
        if *pieces == 0 {
            return Stab::Unknown;
        }
        *pieces -= 1;
        self.found.effort.splits += 1;
        let arena_mark = self.arena.mark();
        let kept: Vec<Poly> = self.chain.clone();
        let answer = match self.tighten(shared, source) {
            None => Stab::None,
            Some(source) => {
                let target = self.chain[self.chain.len() - 1];
                match self.stab(shared, source, target) {
                    Stab::Unknown => self.halve(shared, source, pieces),
                    other => other,
                }
            }
        };
        self.chain = kept;
        self.arena.release(arena_mark);
        answer
    }

    fn halve(&mut self, shared: &Shared<'_>, source: Poly, pieces: &mut u32) -> Stab {
        let Some(halves) = self.halves(shared, source) else {
            return Stab::Unknown;
        };
        let mut answer = Stab::None;
        for half in halves.into_iter().flatten() {
            match self.settle(shared, half, pieces) {
                Stab::None => {}
                Stab::Unknown => answer = Stab::Unknown,
                line @ Stab::Line(..) => return line,
            }
        }
        answer
    }

    /// Returns the two halves of the source across its longest axis; `None` if it is too small to split.
    pub(crate) fn halves(
        &mut self,
        shared: &Shared<'_>,
        source: Poly,
    ) -> Option<[Option<Poly>; 2]> {
        let points = self.arena.get(source);
        let low = points.iter().copied().fold(DVec3::MAX, DVec3::min);
        let high = points.iter().copied().fold(DVec3::MIN, DVec3::max);
        let size = high - low;
        let axis = if size.x >= size.y && size.x >= size.z {
            DVec3::X
        } else if size.y >= size.z {
            DVec3::Y
        } else {
            DVec3::Z
        };
        if axis.dot(size) < 1e3 * shared.tolerance.outward {
            return None;
        }
        let middle = axis.dot(low + high) * 0.5;
        let turn = shared.dirs.all[source.dir as usize].turn;
        // The halves together must make the whole, so neither is dropped for being thin.
        let whole = Tolerance {
            clearance: 0.0,
            ..shared.tolerance
        };
        Some([1.0, -1.0].map(|sign| {
            let half = HalfSpace {
                normal: axis * sign,
                offset: middle * sign,
            };
            self.arena.clip(source, half, turn, &whole)
        }))
    }

    /// Clips the whole chain by all planes between it and the source; `None` if nothing is left.
    pub(crate) fn tighten(&mut self, shared: &Shared<'_>, source: Poly) -> Option<Poly> {
        let first_plane = self.planes.len();
        let source = self.tighten_by(shared, source, first_plane);
        self.planes.truncate(first_plane);
        source
    }

    fn tighten_by(
        &mut self,
        shared: &Shared<'_>,
        source: Poly,
        first_plane: usize,
    ) -> Option<Poly> {
        let dirs = shared.dirs;
        let tolerance = &shared.tolerance;
        let last = self.chain.len() - 1;
        let clip = |arena: &mut Arena, poly: Poly, planes: &[Four], side: Side| {
            let dir = poly.dir as usize;
            let turn = dirs.all[dir].turn;
            arena.clip_all(poly, planes, side, dirs.balls[dir], turn, tolerance)
        };
        // Clip the last opening by each set of planes at once: that closes most chains.
        for k in 1..last {
            let planes = &self.planes[first_plane..];
            self.chain[k] = clip(&mut self.arena, self.chain[k], planes, Side::After)?;
            let end = self.planes.len();
            self.add_planes(shared, source, self.chain[k]);
            let planes = &self.planes[end..];
            self.chain[last] = clip(&mut self.arena, self.chain[last], planes, Side::After)?;
        }
        self.planes.truncate(first_plane);
        for k in 1..last {
            self.add_planes(shared, self.chain[k], self.chain[last]);
        }
        let planes = &self.planes[first_plane..];
        clip(&mut self.arena, source, planes, Side::Before)
    }

    /// Drops wanted openings behind a plane; returns `true` if any is left.
    pub(crate) fn check_wanted(
        &mut self,
        shared: &Shared<'_>,
        first_plane: usize,
        depth: usize,
    ) -> bool {
        dispatch!(Level::new(), simd => self.check_wanted_by(simd, shared, first_plane, depth))
    }

    #[inline(always)]
    fn check_wanted_by<S: Simd>(
        &mut self,
        simd: S,
        shared: &Shared<'_>,
        first_plane: usize,
        depth: usize,
    ) -> bool {
        let planes = &self.planes[first_plane..];
        let mut is_left = false;
        for &i in &self.words {
            let i = i as usize;
            let word = &mut self.reach[depth][i];
            let mut rest = *word & self.wanted[i];
            while rest != 0 {
                let q = i * 64 + rest.trailing_zeros() as usize;
                if admits(simd, planes, shared.dirs, q, &shared.tolerance) {
                    is_left = true;
                } else {
                    *word &= !(1 << (q % 64));
                }
                rest &= rest - 1;
            }
        }
        is_left
    }

    pub(crate) fn add_planes(&mut self, shared: &Shared<'_>, source: Poly, pass: Poly) {
        separators(
            FacedOutline::new(self.arena.get(source), facing(shared.dirs, source.dir)),
            FacedOutline::new(self.arena.get(pass), facing(shared.dirs, pass.dir)),
            &shared.tolerance,
            &mut self.planes,
        );
    }

    /// Returns the parts left of the source and of the opening `q` when the chain continues through it.
    pub(crate) fn narrow(
        &mut self,
        shared: &Shared<'_>,
        source: Poly,
        pass: Poly,
        q: usize,
        first_plane: usize,
    ) -> Option<(Poly, Poly)> {
        let dirs = shared.dirs;
        let tolerance = &shared.tolerance;
        self.found.effort.clips += 1;
        // A ball around the opening decides most cases without its vertices.
        let ball = dirs.balls[q];
        if hide(&self.planes[first_plane..], ball) {
            return None;
        }
        let next = &dirs.all[q];
        let mut target = self.arena.push(dirs.winding(q), q as u32);
        let source_front = front_of(dirs, source.dir);
        if !source_front.holds(ball) {
            target = self
                .arena
                .clip(target, source_front, next.turn, tolerance)?;
        }
        let pass_front = front_of(dirs, pass.dir);
        if pass.dir != source.dir && !pass_front.holds(ball) {
            target = self.arena.clip(target, pass_front, next.turn, tolerance)?;
        }
        let source_turn = dirs.all[source.dir as usize].turn;
        let mut source = source;
        let back = back_of(dirs, q);
        if !back.holds(dirs.balls[source.dir as usize]) {
            source = self.arena.clip(source, back, source_turn, tolerance)?;
        }
        let planes = (&self.planes[first_plane..], Side::After);
        target = self
            .arena
            .clip_all(target, planes.0, planes.1, ball, next.turn, tolerance)?;
        if pass.dir != source.dir {
            let end = self.planes.len();
            separators(
                FacedOutline::new(self.arena.get(pass), facing(dirs, pass.dir)),
                FacedOutline::new(self.arena.get(target), facing(dirs, target.dir)),
                tolerance,
                &mut self.planes,
            );
            let ball = dirs.balls[source.dir as usize];
            let planes = (&self.planes[end..], Side::Before);
            source =
                self.arena
                    .clip_all(source, planes.0, planes.1, ball, source_turn, tolerance)?;
            self.planes.truncate(end);
        }
        Some((source, target))
    }

    /// Removes all openings into a cell from `wanted`; returns `true` if any was there.
    fn settle_cell(&mut self, dirs: &Dirs, cell: u32) -> bool {
        let mut any = false;
        for &d in dirs.entries(cell) {
            any |= bits::get(&self.wanted, d as usize);
            bits::clear(&mut self.wanted, d as usize);
        }
        any
    }
}

#[inline]
pub(crate) fn facing(dirs: &Dirs, dir: u32) -> Facing {
    let dir = &dirs.all[dir as usize];
    Facing {
        turn: dir.turn,
        normal: dir.normal,
    }
}

/// Returns the half-space into which a line goes after crossing an opening.
#[inline]
pub(crate) fn front_of(dirs: &Dirs, dir: u32) -> HalfSpace {
    let dir = &dirs.all[dir as usize];
    HalfSpace {
        normal: dir.normal,
        offset: dir.low,
    }
}

/// Returns the half-space from which a line comes before crossing an opening.
#[inline]
pub(crate) fn back_of(dirs: &Dirs, dir: usize) -> HalfSpace {
    let dir = &dirs.all[dir];
    HalfSpace {
        normal: -dir.normal,
        offset: -dir.high,
    }
}
