//! Rounds of searches over all openings, with the same result for any number of threads.
//!
//! Openings that might see least come first, as in the Quake tools, because their results narrow the others. Searches
//! of one round use the results of earlier rounds and not each other's, so the order in which threads finish does not
//! matter.

use enfilade_geom::DVec3;
use rayon::prelude::*;

use crate::bits::{self, BitTable};
use crate::dirs::{Dirs, Next};
use crate::flow::{Effort, Flow, Found, Shared};
use crate::rays::{self, Blocker, Line};
use crate::rng::Rng;
use crate::tolerance::Tolerance;

/// Openings per round. With more, fewer results are shared; with fewer, threads wait at the end of each.
const ROUND: usize = 64;

/// Share of the far plane that lines keep to; a checker may compute other last digits.
const FAR_KEPT: f64 = 1.0 - 1e-9;

/// Work left in a search.
pub(crate) struct Rest {
    /// Openings left, each after the number of those it might see.
    pub(crate) order: Vec<(usize, usize)>,
    /// Work done and total work.
    pub(crate) done: u64,
    pub(crate) total: u64,
}

/// Proof that no line leads through one opening and a later one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Closed {
    pub(crate) from: u32,
    pub(crate) to: u32,
    /// Trees of beams, one for each two pieces of the openings that a line may join.
    pub(crate) tree: Vec<u8>,
}

/// The part of an answer that a search is asked for: pairs of a source and a target. Sets of cells, as bits.
#[derive(Clone, Debug)]
pub(crate) struct Scope {
    /// Cells whose rows are asked for; targets, too.
    pub(crate) sources: Vec<u64>,
    pub(crate) targets: Vec<u64>,
}

impl Scope {
    /// Returns the cells that are asked for with another one; `None` if there are none.
    fn asked(&self, cell: usize) -> Option<&[u64]> {
        if bits::get(&self.sources, cell) {
            return Some(&self.targets);
        }
        bits::get(&self.targets, cell).then_some(&self.sources)
    }
}

pub(crate) struct Search<'a> {
    pub(crate) dirs: &'a Dirs,
    /// `None` if everything is asked for.
    pub(crate) scope: Option<Scope>,
    pub(crate) might: BitTable,
    /// Pairs of cells proved visible.
    pub(crate) seen: BitTable,
    /// Pairs of cells given up on, a subset of `seen`.
    pub(crate) undecided: BitTable,
    /// For each opening, those hidden from it beyond the sides of planes.
    pub(crate) settled: BitTable,
    pub(crate) lines: Vec<Line>,
    /// Pairs of openings that walls hide from each other.
    pub(crate) closed: Vec<Closed>,
    pub(crate) tolerance: Tolerance,
    pub(crate) blocker: Option<Blocker<'a>>,
    far: Option<f64>,
    pub(crate) effort: Effort,
    /// Number of `lines` already grown.
    pub(crate) n_grown: usize,
}

impl<'a> Search<'a> {
    /// Starts from the sides of planes.
    pub(crate) fn new(
        dirs: &'a Dirs,
        clearance: f64,
        far: Option<f64>,
        blocker: Option<Blocker<'a>>,
    ) -> Self {
        let might = dirs.might_see(clearance, far);
        Self::within(dirs, might, None, clearance, far, blocker)
    }

    /// Starts from openings that each opening might see, for the part of the answer that is asked for.
    pub(crate) fn within(
        dirs: &'a Dirs,
        might: BitTable,
        scope: Option<Scope>,
        clearance: f64,
        far: Option<f64>,
        blocker: Option<Blocker<'a>>,
    ) -> Self {
        let n = dirs.n_cells;
        let mut seen = BitTable::new(n, n);
        if let Some(scope) = &scope {
            // Nothing looks for pairs that count as seen.
            let mut all = vec![0; n.div_ceil(64)];
            (0..n).for_each(|c| bits::set(&mut all, c));
            for cell in 0..n {
                let row = seen.row_mut(cell);
                row.copy_from_slice(&all);
                let asked = scope.asked(cell).into_iter().flatten();
                row.iter_mut()
                    .zip(asked)
                    .for_each(|(word, asked)| *word &= !asked);
            }
        }
        for c in 0..n {
            seen.set(c, c);
        }
        Self {
            dirs,
            scope,
            might,
            seen,
            undecided: BitTable::new(n, n),
            settled: BitTable::new(dirs.len(), dirs.len()),
            lines: Vec::new(),
            closed: Vec::new(),
            tolerance: Tolerance::new(dirs.scale, clearance),
            blocker,
            far,
            effort: Effort::default(),
            n_grown: 0,
        }
    }

    /// Casts random lines from every opening, some aimed at openings not seen yet.
    pub(crate) fn cast(&mut self, n_rays: usize) {
        let openings: Vec<usize> = (0..self.dirs.len())
            .filter(|&d| self.dirs.all[d].id.is_multiple_of(2))
            .collect();
        for round in openings.chunks(ROUND * 4) {
            let lines: Vec<Vec<Line>> = round
                .par_iter()
                .map(|&d| self.cast_from(d, n_rays))
                .collect();
            self.keep(lines.into_iter().flatten().collect());
        }
    }

    fn cast_from(&self, opening: usize, n_rays: usize) -> Vec<Line> {
        let dirs = self.dirs;
        let mut rng = Rng::new(u64::from(dirs.name(opening)));
        let mut lines = Vec::new();
        let mut wanted = [Vec::new(), Vec::new()];
        let both = [opening, dirs.reverse[opening] as usize];
        for (list, &d) in wanted.iter_mut().zip(&both) {
            let from = dirs.all[d].from as usize;
            let seen = self.seen.row(from);
            list.extend(
                bits::ones(self.might.row(d))
                    .filter(|&t| !bits::get(seen, dirs.all[t].to as usize)),
            );
        }
        let (mut ahead, mut behind) = (Vec::new(), Vec::new());
        let margin = self.tolerance.rounding * 16.0;
        for i in 0..n_rays {
            let side = i % 2;
            let d = both[side];
            let (origin, direction) = if i == 0 {
                // Straight through first: neighbors always see each other.
                let piece = dirs.pieces[dirs.all[d].pieces.start as usize].clone();
                let corners = &dirs.points[piece.start as usize..piece.end as usize];
                let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
                (middle, dirs.all[d].normal)
            } else if wanted[side].is_empty() {
                continue;
            } else {
                let target = wanted[side][rng.below(wanted[side].len())];
                let origin = dirs.random_point(d, &mut rng);
                (origin, dirs.random_point(target, &mut rng) - origin)
            };
            if direction.dot(dirs.all[d].normal) <= 0.0 || !dirs.is_inside(d, origin, margin) {
                continue;
            }
            ahead.clear();
            behind.clear();
            let blocker = self.blocker;
            rays::walk(dirs, d, origin, direction, margin, blocker, &mut ahead);
            let back = both[1 - side];
            rays::walk(dirs, back, origin, -direction, margin, blocker, &mut behind);
            let chain: Vec<u32> = behind
                .iter()
                .rev()
                .map(|&b| dirs.reverse[b as usize])
                .chain([d as u32])
                .chain(ahead.iter().copied())
                .collect();
            if self.proves_new(&chain) {
                lines.push(Line {
                    origin,
                    direction,
                    chain,
                });
            }
        }
        lines
    }

    pub(crate) fn proves_new(&self, chain: &[u32]) -> bool {
        let dirs = self.dirs;
        (0..chain.len()).any(|i| {
            let row = self.seen.row(dirs.all[chain[i] as usize].from as usize);
            chain[i..]
                .iter()
                .any(|&b| !bits::get(row, dirs.all[b as usize].to as usize))
        })
    }

    /// Marks the pairs of cells that lines prove, and keeps the lines that prove something new.
    pub(crate) fn keep(&mut self, lines: Vec<Line>) {
        let pieces: Vec<Vec<Line>> = lines
            .into_par_iter()
            .with_min_len(16)
            .map(|line| self.sure_pieces(line))
            .collect();
        for piece in pieces.into_iter().flatten() {
            self.mark(piece);
        }
    }

    /// Returns the parts of a line that a checker, with other rounding, also accepts as proofs.
    fn sure_pieces(&self, line: Line) -> Vec<Line> {
        let mut out = Vec::new();
        // Lines that graze an opening may have slipped through.
        if !self.dirs.is_crossed(&line, self.tolerance.rounding * 8.0) {
            return out;
        }
        if self.far.is_none() && self.blocker.is_none() {
            self.part(line, &mut out);
            return out;
        }
        // Solid parts and distances are judged as a checker does: between crossings computed from the line's origin.
        let dirs = self.dirs;
        let ts: Vec<f64> = line
            .chain
            .iter()
            .map(|&d| dirs.crossing(d as usize, line.origin, line.direction))
            .collect();
        let is_free: Vec<bool> = ts
            .windows(2)
            .map(|t| {
                let [a, b] = [t[0], t[1]].map(|t| line.origin + line.direction * t);
                self.blocker.is_none_or(|is_blocked| !is_blocked(a, b))
            })
            .collect();
        let most = self.far.unwrap_or(f64::INFINITY) * FAR_KEPT / line.direction.length();
        let mut covered = 0;
        for first in 0..ts.len() {
            let mut end = first + 1;
            while end < ts.len() && is_free[end - 1] && ts[end] - ts[first] <= most {
                end += 1;
            }
            if end > covered {
                covered = end;
                let piece = Line {
                    chain: line.chain[first..end].to_vec(),
                    ..line.clone()
                };
                self.part(piece, &mut out);
            }
        }
        out
    }

    /// Splits a line between openings that are known to be hidden from each other: a line that passes an edge nearer
    /// than the clearance may cross openings that no line with clearance does.
    fn part(&self, mut line: Line, out: &mut Vec<Line>) {
        loop {
            let chain = &line.chain;
            let might = |i: usize, j: usize| self.might.get(chain[i] as usize, chain[j] as usize);
            let end = (1..chain.len()).find(|&j| (0..j).any(|i| !might(i, j)));
            let Some(end) = end else { break };
            // The rest begins behind the last opening that is hidden from this one.
            let first = (0..end)
                .rev()
                .find(|&i| !might(i, end))
                .map_or(end, |i| i + 1);
            let rest = chain[first..].to_vec();
            line.chain.truncate(end);
            out.push(Line {
                chain: std::mem::replace(&mut line.chain, rest),
                ..line
            });
        }
        out.push(line);
    }

    fn mark(&mut self, line: Line) {
        let all = &self.dirs.all;
        let mut is_new = false;
        for i in 0..line.chain.len() {
            let a = all[line.chain[i] as usize].from as usize;
            for &b in &line.chain[i..] {
                let b = all[b as usize].to as usize;
                if !self.seen.get(a, b) || self.undecided.get(a, b) {
                    self.seen.set(a, b);
                    self.seen.set(b, a);
                    self.undecided.clear(a, b);
                    self.undecided.clear(b, a);
                    is_new = true;
                }
            }
        }
        if is_new {
            self.lines.push(line);
        }
    }

    /// Returns `true` if the row of a cell is asked for.
    pub(crate) fn is_source(&self, cell: usize) -> bool {
        (self.scope.as_ref()).is_none_or(|scope| bits::get(&scope.sources, cell))
    }

    /// Returns `true` for one of the two orders of a pair of cells, of which the first is a source.
    pub(crate) fn is_first(&self, a: usize, b: usize) -> bool {
        a < b || !self.is_source(b)
    }

    /// Returns all openings out of cells whose rows are asked for, those that might see least first.
    pub(crate) fn all_openings(&self) -> Rest {
        let mut order: Vec<(usize, usize)> = (0..self.dirs.len())
            .filter(|&d| self.is_source(self.dirs.all[d].from as usize))
            .map(|d| (bits::count(self.might.row(d)), d))
            .collect();
        order.sort_unstable();
        let total = order.iter().map(|&(n, _)| n as u64).sum();
        Rest {
            order,
            done: 0,
            total,
        }
    }

    /// Searches from the openings that are left. Calls `on_round` before each round and stops when it returns
    /// `false`; work is counted in openings that might be seen at the start.
    ///
    /// Returns `true` if the search is complete.
    pub(crate) fn run(
        &mut self,
        max_pieces: u32,
        mut rest: Rest,
        mut on_round: impl FnMut(&Self, &Rest) -> bool,
    ) -> bool {
        let mut next = Next::new(self.dirs, &self.might);
        while !rest.order.is_empty() {
            if !on_round(self, &rest) {
                return false;
            }
            let left = rest.order.split_off(rest.order.len().min(ROUND));
            let round = std::mem::replace(&mut rest.order, left);
            rest.done += round.iter().map(|&(n, _)| n as u64).sum::<u64>();
            let shared = Shared {
                dirs: self.dirs,
                might: &self.might,
                next: &next,
                seen: &self.seen,
                tolerance: self.tolerance,
                blocker: self.blocker,
                max_pieces,
            };
            // The longest first, so that no thread starts one when the others have ended.
            let found: Vec<Found> = round
                .par_iter()
                .rev()
                .with_max_len(1)
                .map_init(Flow::default, |flow, &(_, d)| flow.search(&shared, d))
                .collect();
            // Merge everything hidden before any line, so that no line is kept that contradicts it.
            for found in &found {
                self.merge(found, &mut next);
            }
            self.keep(found.into_iter().flat_map(|f| f.lines).collect());
            self.grow();
        }
        true
    }

    /// Returns all results of a search other than lines.
    pub(crate) fn tables(&self) -> [&BitTable; 4] {
        [&self.might, &self.settled, &self.seen, &self.undecided]
    }

    /// Restores the state of another search.
    pub(crate) fn restore(&mut self, tables: [BitTable; 4], lines: Vec<Line>, steps: u64) {
        [self.might, self.settled, self.seen, self.undecided] = tables;
        self.n_grown = lines.len();
        self.lines = lines;
        self.effort.steps = steps;
    }

    /// Returns `true` if a line proves that all cells on its way see each other: finite, through openings that follow
    /// each other, free of walls and not too long.
    pub(crate) fn is_proof(&self, line: &Line) -> bool {
        let all = &self.dirs.all;
        let is_chain = !line.chain.is_empty()
            && (line.chain.windows(2)).all(|d| all[d[0] as usize].to == all[d[1] as usize].from);
        is_chain
            && line.origin.is_finite()
            && line.direction.is_finite()
            && self.dirs.is_crossed(line, self.tolerance.rounding * 8.0)
            && self.is_free(line)
    }

    /// Returns `true` if nothing solid lies between the first and the last opening of a line, and they are near
    /// enough.
    fn is_free(&self, line: &Line) -> bool {
        let cross = |d: &u32| (self.dirs).crossing(*d as usize, line.origin, line.direction);
        let ts: Vec<f64> = line.chain.iter().map(cross).collect();
        let at = |t: f64| line.origin + line.direction * t;
        let most = self.far.unwrap_or(f64::INFINITY) * FAR_KEPT / line.direction.length();
        let is_near = ts.last().zip(ts.first()).is_none_or(|(b, a)| b - a <= most);
        is_near
            && self
                .blocker
                .is_none_or(|is_blocked| ts.windows(2).all(|t| !is_blocked(at(t[0]), at(t[1]))))
    }

    fn merge(&mut self, found: &Found, next: &mut Next) {
        next.hide(self.dirs, &mut self.might, found.source, &found.hidden);
        bits::unite(self.settled.row_mut(found.source), &found.hidden);
        let a = self.dirs.all[found.source].from as usize;
        for &b in &found.undecided {
            let b = b as usize;
            if !self.seen.get(a, b) {
                for (x, y) in [(a, b), (b, a)] {
                    self.seen.set(x, y);
                    self.undecided.set(x, y);
                }
            }
        }
        self.effort.add(&found.effort);
    }

    /// Returns the number of pairs that may see each other, in both orders. Of those that are asked for, pairs of two
    /// sources come up in both rows.
    pub(crate) fn n_pairs(&self) -> u64 {
        let visible = self.visible();
        let Some(scope) = &self.scope else {
            return visible.count_all();
        };
        let count = |a: usize| {
            let row = visible.row(a).iter().zip(&scope.sources);
            let twice = row.map(|(row, sources)| (row & !sources).count_ones() as usize);
            bits::count(visible.row(a)) + twice.sum::<usize>()
        };
        bits::ones(&scope.sources).map(|a| count(a) as u64).sum()
    }

    /// Returns the pairs of cells that may see each other, in the rows and of the pairs that are asked for.
    pub(crate) fn visible(&self) -> BitTable {
        let n = self.dirs.n_cells;
        let mut visible = BitTable::new(n, n);
        let n_words = visible.n_words().max(1);
        let rows = visible.words_mut().par_chunks_mut(n_words);
        rows.enumerate().with_min_len(16).for_each(|(cell, row)| {
            bits::set(row, cell);
            if !self.is_source(cell) {
                return;
            }
            for d in self.dirs.exits(cell as u32) {
                bits::set(row, self.dirs.all[d].to as usize);
                for t in bits::ones(self.might.row(d)) {
                    bits::set(row, self.dirs.all[t].to as usize);
                }
            }
            if let Some(scope) = &self.scope {
                let targets = row.iter_mut().zip(&scope.targets);
                targets.for_each(|(word, &targets)| *word &= targets);
            }
        });
        visible
    }
}
