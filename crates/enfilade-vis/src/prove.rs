//! The search repeated with its result known, recorded so that others can check it.
//!
//! `docs/evidence.md` describes the bytes. The claims that openings are hidden from each other support each other: a
//! chain is left as soon as a later part of it is claimed to be impossible. That is not circular, because a part is
//! shorter than the whole: a shortest line against any claim would have to pass a chain that planes close.
//!
//! Openings hidden by sides of planes, or as a consequence of their neighbors, need no trace.

use rayon::prelude::*;

use crate::bits::{self, BitTable};
use crate::clip::Poly;
use crate::flow::{FEW_PIECES, Flow, Shared};
use crate::planes::is_admitted;
use crate::stabbing::Answer;

/// Symbols of the trace.
pub(crate) mod symbol {
    /// Nothing claimed to be hidden can lie behind this exit.
    pub(crate) const SKIP: u8 = 0;
    /// Planes leave nothing of the chain through this exit.
    pub(crate) const CUT: u8 = 1;
    /// The chain continues through this exit.
    pub(crate) const ENTER: u8 = 2;
    /// Planes leave nothing once the source is split.
    pub(crate) const SPLIT: u8 = 3;
    /// First symbol of a step: its exits follow.
    pub(crate) const EXITS: u8 = 4;
    /// First symbol of a step: planes leave nothing that is claimed to be hidden.
    pub(crate) const DONE: u8 = 5;
    /// In a split: this piece is closed.
    pub(crate) const CLOSED: u8 = 6;
    /// In a split: two halves follow.
    pub(crate) const HALVES: u8 = 7;
    /// No line passes the chain through this exit: weighted rows follow.
    pub(crate) const UNSTABBED: u8 = 8;
}

/// Returns for each opening those that its trace must show to be hidden: all that the search settled from it, less
/// those that follow from neighbors.
pub(crate) fn claims(shared: &Shared<'_>, settled: &BitTable) -> BitTable {
    let (dirs, might) = (shared.dirs, shared.might);
    let mut claims = settled.clone();
    for s in 0..dirs.len() {
        let after = dirs.after(s);
        for t in bits::ones(settled.row(s)) {
            let before = dirs.entries(dirs.all[t].from);
            let is_next = dirs.all[t].from == dirs.all[s].to;
            let first_fails = after
                .clone()
                .all(|q| q == dirs.reverse[s] as usize || !might.get(s, q) || !might.get(q, t));
            let last_fails = before
                .iter()
                .map(|&p| p as usize)
                .all(|p| p == dirs.reverse[t] as usize || !might.get(s, p) || !might.get(p, t));
            if !is_next && (first_fails || last_fails) {
                claims.clear(s, t);
            }
        }
    }
    claims
}

/// Returns the traces of all openings that have claims, ordered by direction in the graph's numbers.
///
/// `None` if a claim could not be proved again, which is a bug.
pub(crate) fn traces(shared: &Shared<'_>, claims: &BitTable) -> Option<Vec<u8>> {
    let dirs = shared.dirs;
    let mut order: Vec<usize> = (0..dirs.len())
        .filter(|&s| bits::count(claims.row(s)) > 0)
        .collect();
    order.sort_by_key(|&s| dirs.all[s].id);
    let parts: Vec<Option<Vec<u8>>> = order
        .par_iter()
        .map_init(Flow::default, |flow, &s| {
            flow.prove(shared, s, claims.row(s))
        })
        .collect();
    parts
        .into_iter()
        .collect::<Option<Vec<_>>>()
        .map(|p| p.concat())
}

impl Flow {
    fn prove(&mut self, shared: &Shared<'_>, source: usize, claims: &[u64]) -> Option<Vec<u8>> {
        self.begin(shared, source);
        self.wanted.clear();
        self.wanted.extend_from_slice(claims);
        let all = vec![u64::MAX; claims.len()];
        self.set_reach(0, &all);
        self.find_words();
        let mut trace = Vec::new();
        let poly = self.chain[0];
        self.write_step(shared, poly, &mut trace)?;
        Some(trace)
    }

    fn write_step(&mut self, shared: &Shared<'_>, source: Poly, trace: &mut Vec<u8>) -> Option<()> {
        let dirs = shared.dirs;
        let depth = self.chain.len() - 1;
        let pass = self.chain[depth];
        let back = dirs.reverse[pass.dir as usize] as usize;
        let first_plane = self.planes.len();
        if depth > 0 {
            self.add_planes(shared, source, pass);
            let is_left = if depth == 1 {
                self.flood_wanted(shared, first_plane)
            } else {
                self.check_wanted(shared, first_plane, depth)
            };
            if !is_left {
                trace.push(symbol::DONE);
                self.planes.truncate(first_plane);
                return Some(());
            }
        }
        trace.push(symbol::EXITS);
        if self.reach.len() <= depth + 1 {
            self.set_reach(depth + 1, &[]);
        }
        for q in dirs.after(pass.dir as usize) {
            if q == back || !bits::get(&self.reach[depth], q) {
                trace.push(symbol::SKIP);
                continue;
            }
            let (near, far) = self.reach.split_at_mut(depth + 1);
            far[0].resize(near[depth].len(), 0);
            let rows = (&near[depth][..], shared.might.row(q));
            let leads_on = bits::and_into(&self.words, &mut far[0], rows, &self.wanted)
                && shared.might.get(source.dir as usize, q);
            let is_wanted = bits::get(&self.wanted, q);
            if !leads_on && !is_wanted {
                trace.push(symbol::SKIP);
                continue;
            }
            let mark = self.arena.mark();
            let end = self.planes.len();
            let narrowed = self.narrow(shared, source, pass, q, first_plane);
            self.planes.truncate(end);
            match narrowed {
                None => trace.push(symbol::CUT),
                Some((source, target)) => {
                    self.chain.push(target);
                    let done = if is_wanted {
                        // Same order as in the search, so that the test that closed a chain there also closes it
                        // here.
                        let few = shared.max_pieces.min(FEW_PIECES);
                        self.write_split(shared, source, few, trace)
                            .or_else(|| self.write_weights(shared, trace))
                            .or_else(|| self.write_split(shared, source, shared.max_pieces, trace))
                    } else {
                        trace.push(symbol::ENTER);
                        self.write_step(shared, source, trace)
                    };
                    self.chain.pop();
                    done?;
                }
            }
            self.arena.release(mark);
        }
        self.planes.truncate(first_plane);
        Some(())
    }

    /// Records that planes leave nothing once the source is split; `None`, with `trace` unchanged, if they do.
    fn write_split(
        &mut self,
        shared: &Shared<'_>,
        source: Poly,
        mut pieces: u32,
        trace: &mut Vec<u8>,
    ) -> Option<()> {
        let before = trace.len();
        trace.push(symbol::SPLIT);
        let done = self.write_pieces(shared, source, &mut pieces, trace);
        if done.is_none() {
            trace.truncate(before);
        }
        done
    }

    fn write_pieces(
        &mut self,
        shared: &Shared<'_>,
        source: Poly,
        pieces: &mut u32,
        trace: &mut Vec<u8>,
    ) -> Option<()> {
        if *pieces == 0 {
            return None;
        }
        *pieces -= 1;
        let mark = self.arena.mark();
        let kept = self.chain.clone();
        let done = match self.tighten(shared, source) {
            None => {
                trace.push(symbol::CLOSED);
                Some(())
            }
            Some(source) => {
                trace.push(symbol::HALVES);
                self.halves(shared, source).and_then(|halves| {
                    for half in halves {
                        match half {
                            Some(half) => self.write_pieces(shared, half, pieces, trace)?,
                            None => trace.push(symbol::CLOSED),
                        }
                    }
                    Some(())
                })
            }
        };
        self.chain = kept;
        self.arena.release(mark);
        done
    }

    fn write_weights(&self, shared: &Shared<'_>, trace: &mut Vec<u8>) -> Option<()> {
        let Answer::Closed(weights) = self.stabbed(shared) else {
            return None;
        };
        trace.push(symbol::UNSTABBED);
        trace.push(u8::try_from(weights.len()).ok()?);
        for (row, weight) in weights {
            trace.extend(row.to_le_bytes());
            trace.extend(weight.to_le_bytes());
        }
        Some(())
    }

    /// Drops wanted openings behind a plane, and those reachable only through such openings.
    fn flood_wanted(&mut self, shared: &Shared<'_>, first_plane: usize) -> bool {
        let dirs = shared.dirs;
        let (first, pass) = (self.chain[0].dir as usize, self.chain[1].dir);
        let passable = shared.might.row(first);
        let mut reached = vec![0; self.wanted.len()];
        let mut stack = vec![pass];
        while let Some(at) = stack.pop() {
            let row = shared.might.row(at as usize);
            for q in dirs.after(at as usize) {
                let is_passable = bits::get(passable, q);
                if bits::get(&self.reach[1], q)
                    && bits::get(row, q)
                    && (is_passable || bits::get(&self.wanted, q))
                    && !bits::get(&reached, q)
                    && is_admitted(&self.planes[first_plane..], dirs, q, &shared.tolerance)
                {
                    bits::set(&mut reached, q);
                    if is_passable {
                        stack.push(q as u32);
                    }
                }
            }
        }
        for (word, &kept) in self.reach[1].iter_mut().zip(&reached) {
            *word &= kept;
        }
        bits::meets(&self.reach[1], &self.wanted)
    }
}
