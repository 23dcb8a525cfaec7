//! Lines grown from lines: where one just misses, a neighbor may hit.
//!
//! A random line rarely slips through five doorways. One that did is turned a little, about a point where it crosses
//! an opening, towards an exit beside the place where it ends. After Wonka and others, *Guided Visibility Sampling*
//! (SIGGRAPH 2006), section 4; exits of cells take the place of their triangle borders.

use enfilade_geom::{DVec3, closest_point_on_segment};
use rayon::prelude::*;

use crate::bits;
use crate::dirs::Dirs;
use crate::rays::{Line, walk};
use crate::rng::Rng;
use crate::search::Search;

/// Lines per round. Lines of one round do not see each other's results.
const ROUND: usize = 512;

impl Search<'_> {
    /// Grows all lines, and those grown from them, until they find nothing new.
    pub(crate) fn grow(&mut self) {
        let mut first = self.n_grown;
        while first < self.lines.len() {
            let end = self.lines.len().min(first + ROUND);
            let grown: Vec<Vec<Line>> = self.lines[first..end]
                .par_iter()
                .with_max_len(8)
                .map(|line| self.grown_from(line))
                .collect();
            self.keep(grown.into_iter().flatten().collect());
            first = end;
        }
        self.n_grown = first;
    }

    /// Tries more random lines between cells that count as seen only because nothing is proved, `n_lines` for each
    /// pair and round.
    ///
    /// Openings alone leave few such pairs. Walls inside cells leave more: planes between openings ignore walls, but
    /// lines that pass beside them can still be found. Stops when `on_round` returns `false`.
    pub(crate) fn insist(
        &mut self,
        n_lines: usize,
        n_rounds: u64,
        on_round: &mut dyn FnMut(u64, u64) -> bool,
    ) {
        let dirs = self.dirs;
        let n = dirs.n_cells;
        for a in 0..n {
            let undecided: Vec<usize> = bits::ones(self.undecided.row(a)).collect();
            for b in undecided {
                self.seen.clear(a, b);
                self.undecided.clear(a, b);
            }
        }
        for round in 0..n_rounds {
            if !on_round(1, 1) {
                return;
            }
            let visible = self.visible();
            let found: Vec<Vec<Line>> = (0..n)
                .into_par_iter()
                .with_max_len(1)
                .map(|a| {
                    let unseen = bits::ones(visible.row(a)).filter(|&b| self.is_first(a, b));
                    let unseen = unseen.filter(|&b| !self.seen.get(a, b));
                    let mut rng =
                        Rng::new(round * dirs.n_all_cells as u64 + u64::from(dirs.cells[a]));
                    unseen
                        .filter_map(|b| self.line_between(a, b, n_lines, &mut rng))
                        .collect()
                })
                .collect();
            self.keep(found.into_iter().flatten().collect());
            self.grow();
        }
    }

    /// Returns the first of some random lines that leads from one cell into another.
    fn line_between(&self, a: usize, b: usize, n_lines: usize, rng: &mut Rng) -> Option<Line> {
        let dirs = self.dirs;
        let entries = dirs.entries(b as u32).iter();
        let pairs: Vec<(usize, usize)> = dirs
            .exits(a as u32)
            .flat_map(|s| entries.clone().map(move |&t| (s, t as usize)))
            .filter(|&(s, t)| s == t || self.might.get(s, t))
            .collect();
        let margin = self.tolerance.rounding * 16.0;
        let mut chain = Vec::new();
        for _ in 0..if pairs.is_empty() { 0 } else { n_lines } {
            let (s, t) = pairs[rng.below(pairs.len())];
            let origin = dirs.random_point(s, rng);
            let direction = dirs.random_point(t, rng) - origin;
            if direction.dot(dirs.all[s].normal) <= 0.0 || !dirs.is_inside(s, origin, margin) {
                continue;
            }
            chain.clear();
            chain.push(s as u32);
            walk(dirs, s, origin, direction, margin, self.blocker, &mut chain);
            if chain.contains(&(t as u32)) {
                return Some(Line {
                    origin,
                    direction,
                    chain,
                });
            }
        }
        None
    }

    fn grown_from(&self, line: &Line) -> Vec<Line> {
        let mut out = Vec::new();
        let mut walked = [Vec::new(), Vec::new()];
        self.grow_end(line, &mut walked, &mut out);
        let chain = line.chain.iter().rev();
        let reversed = Line {
            origin: line.origin,
            direction: -line.direction,
            chain: chain.map(|&d| self.dirs.reverse[d as usize]).collect(),
        };
        self.grow_end(&reversed, &mut walked, &mut out);
        out
    }

    /// Turns a line towards the exits of the cell where it ends.
    fn grow_end(&self, line: &Line, walked: &mut [Vec<u32>; 2], out: &mut Vec<Line>) {
        let dirs = self.dirs;
        let Some(&last) = line.chain.last() else {
            return;
        };
        for exit in dirs.after(last as usize) {
            if exit == dirs.reverse[last as usize] as usize {
                continue;
            }
            let to = dirs.all[exit].to as usize;
            let is_wanted = |&d: &u32| {
                !bits::get(self.seen.row(dirs.all[d as usize].from as usize), to)
                    && self.might.get(d as usize, exit)
            };
            let Some(first) = line.chain.iter().position(is_wanted) else {
                continue;
            };
            self.turn(line, first, exit as u32, walked, out);
        }
    }

    fn turn(
        &self,
        line: &Line,
        first: usize,
        exit: u32,
        [ahead, behind]: &mut [Vec<u32>; 2],
        out: &mut Vec<Line>,
    ) {
        let dirs = self.dirs;
        let margin = self.tolerance.rounding * 16.0;
        let last = line.chain.len() - 1;
        for at in [first, last, (first + last) / 2] {
            let t = dirs.crossing(line.chain[at] as usize, line.origin, line.direction);
            let pivot = line.origin + line.direction * t;
            for share in [0.05, 0.5] {
                let aim = dirs.toward(exit as usize, line, share);
                let direction = aim - pivot;
                let d = line.chain[at] as usize;
                if direction.dot(dirs.all[d].normal) <= 0.0 {
                    continue;
                }
                ahead.clear();
                walk(dirs, d, pivot, direction, margin, self.blocker, ahead);
                if !ahead.contains(&exit) {
                    continue;
                }
                behind.clear();
                let back = dirs.reverse[d] as usize;
                walk(dirs, back, pivot, -direction, margin, self.blocker, behind);
                let chain: Vec<u32> = behind
                    .iter()
                    .rev()
                    .map(|&b| dirs.reverse[b as usize])
                    .chain([d as u32])
                    .chain(ahead.iter().copied())
                    .collect();
                if self.proves_new(&chain) {
                    let found = chain.contains(&line.chain[first]);
                    out.push(Line {
                        origin: pivot,
                        direction,
                        chain,
                    });
                    if found {
                        return;
                    }
                }
            }
        }
    }
}

impl Dirs {
    /// Returns the place where a line meets the plane of an opening, in lengths of `direction`.
    pub(crate) fn crossing(&self, d: usize, origin: DVec3, direction: DVec3) -> f64 {
        let dir = &self.all[d];
        ((dir.low + dir.high) * 0.5 - dir.normal.dot(origin)) / dir.normal.dot(direction)
    }

    /// Returns a point of an opening that a line misses: `share` of the way from its nearest point to its center.
    fn toward(&self, d: usize, line: &Line, share: f64) -> DVec3 {
        let dir = &self.all[d];
        let winding = self.winding(d);
        if dir.normal.dot(line.direction) <= 1e-9 * line.direction.length() {
            return dir.center;
        }
        let p = line.origin + line.direction * self.crossing(d, line.origin, line.direction);
        let n = winding.len();
        let mut best = (f64::INFINITY, dir.center);
        for i in 0..n {
            let (a, b) = (winding[i], winding[if i + 1 == n { 0 } else { i + 1 }]);
            let q = closest_point_on_segment(p, a, b);
            let distance = q.distance_squared(p);
            if distance < best.0 {
                best = (distance, q);
            }
        }
        best.1 + (dir.center - best.1) * share
    }
}
