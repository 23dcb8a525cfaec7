//! The best few sequences of portals between two places, in order.
//!
//! A* (Hart, Nilsson & Raphael, "A formal basis for the heuristic determination of minimum cost paths", 1968) over sequences,
//! from the end back to the start of a [length search](LengthSearch). Its labels are the exact rest of each sequence, so
//! sequences leave the queue in the order of their lengths. Each has the lengths to all points of its last portal, which makes its
//! length the least through these points. None passes a portal twice. O(points² of a cell) for each step.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::DVec3;

use crate::paths::ends::{End, Limit};
use crate::paths::search::LengthSearch;
use crate::paths::ways::Ways;

#[derive(Clone, Copy, Debug)]
struct Partial {
    /// The portal passed last, and the cell behind it, towards the start; `None` for a whole sequence.
    last: Option<(PortalId, CellId)>,
    before: u32,
    /// Its first length.
    first: u32,
    /// The point of its portal on the shortest path.
    point: DVec3,
}

const NONE: u32 = u32::MAX;

/// The enumeration, with reusable buffers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sequences {
    partials: Vec<Partial>,
    /// Lengths from the end to the points of portals, without the cost of passing these.
    lengths: Vec<f64>,
    heap: BinaryHeap<Reverse<(u64, u32)>>,
    found: Vec<u32>,
    least: f64,
}

impl Sequences {
    /// Finds the sequences between the start of `search` and an end. Returns their number. `direct` is the length between both if
    /// they are in one cell.
    pub(crate) fn find(
        &mut self,
        search: &LengthSearch,
        ways: &Ways,
        [start, end]: [End<'_>; 2],
        direct: f64,
        limit: Limit,
    ) -> usize {
        self.partials.clear();
        self.lengths.clear();
        self.heap.clear();
        self.found.clear();
        self.least = f64::INFINITY;
        let mut most = f64::INFINITY;
        if start.cell == end.cell {
            self.complete(NONE, direct, end.at);
        }
        self.extend(search, ways, end.cell, end, NONE, most);
        for _ in 0..limit.steps {
            let Some(Reverse((bits, at))) = self.heap.pop() else {
                break;
            };
            let length = f64::from_bits(bits);
            if length > most {
                break;
            }
            let Some((portal, into)) = self.partials[at as usize].last else {
                if self.found.is_empty() {
                    self.least = length;
                    most = length * limit.longest[0] + limit.longest[1];
                }
                self.found.push(at);
                if self.found.len() == limit.n {
                    break;
                }
                continue;
            };
            if into == start.cell {
                let toll = search.toll_of(ways, portal, into);
                let first = self.partials[at as usize].first as usize;
                let own = &start.lengths[ways.places(portal, into)];
                let ends = own.iter().zip(&self.lengths[first..]);
                let ends = ends.map(|(a, b)| a + b);
                let least = ends.fold(f64::INFINITY, f64::min) + toll;
                let point = self.partials[at as usize].point;
                self.complete(at, least, point);
            }
            self.extend(search, ways, into, end, at, most);
        }
        self.found.len()
    }

    /// Returns the length of the shortest sequence.
    pub(crate) fn least(&self) -> f64 {
        self.least
    }

    fn complete(&mut self, before: u32, length: f64, point: DVec3) {
        if length == f64::INFINITY {
            return;
        }
        let whole = Partial {
            last: None,
            before,
            first: 0,
            point,
        };
        self.push(whole, length);
    }

    fn push(&mut self, partial: Partial, length: f64) {
        let at = self.partials.len() as u32;
        self.partials.push(partial);
        self.heap.push(Reverse((length.to_bits(), at)));
    }

    fn passes(&self, mut at: u32, portal: PortalId) -> bool {
        while at != NONE {
            let partial = &self.partials[at as usize];
            if partial.last.is_some_and(|l| l.0 == portal) {
                return true;
            }
            at = partial.before;
        }
        false
    }

    /// Adds a sequence's continuations through the portals of the cell reached.
    fn extend(
        &mut self,
        search: &LengthSearch,
        ways: &Ways,
        cell: CellId,
        end: End<'_>,
        before: u32,
        most: f64,
    ) {
        for exit in ways.exits_of(cell) {
            if self.passes(before, exit.portal) {
                continue;
            }
            let first = self.lengths.len();
            let range = ways.range(exit.portal);
            let points = ways.points(exit.portal);
            if before == NONE {
                let own = &end.lengths[ways.places(exit.portal, cell)];
                self.lengths.extend_from_slice(own);
            } else {
                self.add_lengths(search, ways, cell, before, exit.portal);
            }
            let (mut least, mut point) = (f64::INFINITY, end.at);
            for (i, k) in range.enumerate() {
                let rest = search.label(ways.node(k, cell));
                let length = self.lengths[first + i] + rest;
                if length < least {
                    (least, point) = (length, points[i]);
                }
            }
            if least == f64::INFINITY || least > most {
                self.lengths.truncate(first);
                continue;
            }
            let partial = Partial {
                last: Some((exit.portal, exit.to)),
                before,
                first: first as u32,
                point,
            };
            self.push(partial, least);
        }
    }

    fn add_lengths(
        &mut self,
        search: &LengthSearch,
        ways: &Ways,
        cell: CellId,
        before: u32,
        to: PortalId,
    ) {
        let partial = self.partials[before as usize];
        let Some((from, _)) = partial.last else {
            return;
        };
        // Passed towards the start from this cell: into the cell on its other side.
        let toll = search.toll_of(ways, from, cell);
        let first = self.lengths.len();
        self.lengths
            .resize(first + ways.points(to).len(), f64::INFINITY);
        for (i, k) in ways.range(from).enumerate() {
            let own = self.lengths[partial.first as usize + i] + toll;
            for (j, leg) in ways.lengths(cell, k, to).enumerate() {
                let length = &mut self.lengths[first + j];
                *length = length.min(own + leg);
            }
        }
    }

    /// Returns the portals of a sequence from the start to the end, each with a point near the crossing.
    pub(crate) fn portals(&self, found: usize) -> impl Iterator<Item = (PortalId, DVec3)> + Clone {
        let of = |at: u32| self.partials.get(at as usize);
        let first = of(self.partials[self.found[found] as usize].before);
        std::iter::successors(first, move |partial| of(partial.before))
            .map_while(|partial| Some((partial.last?.0, partial.point)))
    }
}
