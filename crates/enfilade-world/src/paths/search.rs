//! Least lengths through portals: the search shared by paths, sound and maps.
//!
//! Dijkstra's algorithm ("A note on two problems in connexion with graphs", 1959) over *crossings*: points of a portal's opening,
//! each once per side from which it may be entered. Portals are areas, and no single point can represent one: lengths through
//! middles are too long at wide portals, lengths between nearest points too short. So each opening has several points
//! ([`Sampling`]), and every length is that of a true walk from point to point: never less than the shortest. `O(e log e)` for
//! `e` pairs of points of one cell that are reached.
//!
//! **Accuracy.** Let the shortest walk cross each portal at most `d` from one of its points. Moving the crossings there makes it
//! longer by about `d² / l` per portal, for legs of length `l` between portals. The route found is no longer than that, and
//! shorter once pulled taut. `d` is at most `0.71 · spacing`, and 0 where the walk bends about vertices. If two routes are
//! nearly equally short, [`LengthSearch::arrivals`] has both: pull each taut and take the shorter.
//!
//! Sums of lengths round. Of two routes to a crossing that are equally long, to the last bit, the one found first is kept: equal
//! queries have equal answers.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::DVec3;

use crate::layout::LayoutExit;
use crate::paths::ends::{End, Limit};
use crate::paths::ways::{Ways, side};

/// A path to a place, found by a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Length from the start, through points of portals, extra costs included. [Units: wu]
    pub length: f64,
    /// The last crossing; `None` if no portal is passed.
    node: Option<u32>,
    /// Hash of the sequence of portals.
    sequence: u64,
}

impl Arrival {
    /// Returns `true` if no portal is passed: start and end are in one cell.
    #[must_use]
    pub fn is_direct(&self) -> bool {
        self.node.is_none()
    }
}

/// A portal passed by a search.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct PassedPortal {
    /// The portal, and the cell entered through it.
    pub exit: LayoutExit,
    /// Least length to a point of it, extra costs included, its own too. [Units: wu]
    pub length: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Label {
    length: f64,
    sequence: u64,
    before: u32,
    /// The search to which it belongs.
    stamp: u32,
    is_settled: bool,
}

#[derive(Clone, Copy, Debug, Default)]
struct Toll {
    cost: f64,
    stamp: u32,
    is_reached: bool,
}

const START: u32 = u32::MAX;

/// The search, with reusable buffers: allocates nothing once they have grown.
#[derive(Clone, Debug, Default)]
pub struct LengthSearch {
    labels: Vec<Label>,
    /// Per portal and side.
    tolls: Vec<Toll>,
    /// Per cell, the last search that entered it.
    entered: Vec<u32>,
    stamp: u32,
    heap: BinaryHeap<Reverse<(u64, u32)>>,
    reached: Vec<PassedPortal>,
    cells: Vec<(CellId, f64)>,
    start: Option<(CellId, DVec3)>,
    /// All up to this length is found.
    radius: f64,
}

impl LengthSearch {
    /// Makes it without buffers.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Finds least lengths from a point in `cell` to all portals that can be passed, up to `radius` (infinite: all). [Units: wu]
    ///
    /// `pass` returns the extra cost (`Some(0.0)`: none) of passing a portal into the cell behind it, `None` if it cannot be
    /// passed. It is called at most once per search for each portal and side. Costs below 0 count as 0.
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    pub fn run(
        &mut self,
        ways: &Ways,
        cell: CellId,
        from: DVec3,
        radius: f64,
        pass: impl FnMut(LayoutExit) -> Option<f64>,
    ) {
        let straight = |_: usize, p: DVec3| from.distance(p);
        self.run_from(ways, cell, from, straight, radius, pass);
    }

    /// As [`LengthSearch::run`], with given lengths from the start to the points of its cell: `first` is called with each one's
    /// index among [those of the cell](Ways::points_of). For cells where straight lines are too short.
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    pub fn run_from(
        &mut self,
        ways: &Ways,
        cell: CellId,
        from: DVec3,
        mut first: impl FnMut(usize, DVec3) -> f64,
        radius: f64,
        mut pass: impl FnMut(LayoutExit) -> Option<f64>,
    ) {
        self.begin(ways);
        self.start = Some((cell, from));
        self.enter(cell, 0.0);
        let mut place = 0;
        for &exit in ways.exits_of(cell) {
            let toll = self.toll(ways, exit, &mut pass);
            for k in ways.range(exit.portal) {
                let length = first(place, ways.points[k as usize]) + toll;
                place += 1;
                self.relax(ways.node(k, exit.to), START, length, exit);
            }
        }
        self.run_on(ways, radius, pass);
    }

    /// Goes on with a search, up to a larger radius. `pass` must be that of before.
    pub(crate) fn run_on(
        &mut self,
        ways: &Ways,
        radius: f64,
        mut pass: impl FnMut(LayoutExit) -> Option<f64>,
    ) {
        self.radius = radius;
        while let Some(Reverse((bits, node))) = self.heap.peek().copied() {
            let length = f64::from_bits(bits);
            if length > radius {
                break;
            }
            self.heap.pop();
            let label = &mut self.labels[node as usize];
            if label.is_settled {
                continue;
            }
            label.is_settled = true;
            let here = ways.exit_of(node);
            self.settle(ways, here, length);
            for &exit in ways.exits_of(here.to) {
                if exit.portal == here.portal {
                    continue;
                }
                let toll = self.toll(ways, exit, &mut pass);
                if toll == f64::INFINITY {
                    continue;
                }
                let lengths = ways.lengths(here.to, node / 2, exit.portal);
                for (k, leg) in ways.range(exit.portal).zip(lengths) {
                    self.relax(ways.node(k, exit.to), node, length + leg + toll, exit);
                }
            }
        }
    }

    /// Goes on with a search until all within the limit of lengths around the shortest path to an end is found. `direct` is the
    /// length from the start, if that is in the same cell; `pass` must be that of before.
    pub(crate) fn reach(
        &mut self,
        ways: &Ways,
        end: End<'_>,
        direct: f64,
        limit: Limit,
        mut pass: impl FnMut(LayoutExit) -> Option<f64>,
    ) {
        loop {
            let mut least = direct;
            for exit in ways.exits_of(end.cell) {
                let last = &end.lengths[ways.places(exit.portal, end.cell)];
                for (k, last) in ways.range(exit.portal).zip(last) {
                    least = least.min(self.label(ways.node(k, end.cell)) + last);
                }
            }
            let most = least * limit.longest[0] + limit.longest[1];
            if self.radius >= most || self.heap.is_empty() {
                return;
            }
            let radius = if most < f64::INFINITY {
                most
            } else {
                2.0 * self.radius
            };
            self.run_on(ways, radius, &mut pass);
        }
    }

    fn begin(&mut self, ways: &Ways) {
        self.stamp = self.stamp.wrapping_add(1);
        if self.stamp == 0 {
            self.labels.clear();
            self.tolls.clear();
            self.entered.clear();
            self.stamp = 1;
        }
        // Stamps of another layout's searches are older than this one's.
        grow(&mut self.labels, 2 * ways.points.len());
        grow(&mut self.tolls, 2 * ways.cells.len());
        grow(&mut self.entered, ways.n_points.len());
        self.heap.clear();
        self.reached.clear();
        self.cells.clear();
    }

    fn enter(&mut self, cell: CellId, length: f64) {
        if self.entered[cell.idx()] != self.stamp {
            self.entered[cell.idx()] = self.stamp;
            self.cells.push((cell, length));
        }
    }

    fn settle(&mut self, ways: &Ways, exit: LayoutExit, length: f64) {
        let portal = exit.portal.idx();
        let toll = &mut self.tolls[2 * portal + side(ways.cells[portal], exit.to)];
        if !toll.is_reached {
            toll.is_reached = true;
            self.reached.push(PassedPortal { exit, length });
            self.enter(exit.to, length);
        }
    }

    fn toll(
        &mut self,
        ways: &Ways,
        exit: LayoutExit,
        pass: &mut impl FnMut(LayoutExit) -> Option<f64>,
    ) -> f64 {
        let portal = exit.portal.idx();
        let toll = &mut self.tolls[2 * portal + side(ways.cells[portal], exit.to)];
        if toll.stamp != self.stamp {
            *toll = Toll {
                cost: pass(exit).map_or(f64::INFINITY, |cost| cost.max(0.0)),
                stamp: self.stamp,
                is_reached: false,
            };
        }
        toll.cost
    }

    fn relax(&mut self, node: u32, before: u32, length: f64, exit: LayoutExit) {
        let sequence = match before {
            START => 0,
            _ => self.labels[before as usize].sequence,
        };
        let label = &mut self.labels[node as usize];
        if length.is_nan()
            || length == f64::INFINITY
            || label.stamp == self.stamp && label.length <= length
        {
            return;
        }
        *label = Label {
            length,
            sequence: hash_extended(sequence, exit),
            before,
            stamp: self.stamp,
            is_settled: false,
        };
        self.heap.push(Reverse((length.to_bits(), node)));
    }

    /// Returns the length to a crossing; infinite if it was not reached.
    pub(crate) fn label(&self, node: u32) -> f64 {
        let label = &self.labels[node as usize];
        if label.stamp == self.stamp && label.is_settled {
            label.length
        } else {
            f64::INFINITY
        }
    }

    /// Returns the least length to a point in a cell, whose lengths to the points of that cell are given; infinite if there is no
    /// path.
    pub(crate) fn least(&self, ways: &Ways, cell: CellId, lengths: &[f64]) -> f64 {
        let exits = ways.exits_of(cell).iter();
        let nodes = exits.flat_map(|e| ways.range(e.portal).map(|k| ways.node(k, cell)));
        let through = nodes.zip(lengths).map(|(node, leg)| self.label(node) + leg);
        through.fold(f64::INFINITY, f64::min)
    }

    /// Returns the extra cost of a portal, the same from both sides, where the search has come `from` behind it.
    pub(crate) fn toll_of(&self, ways: &Ways, portal: PortalId, from: CellId) -> f64 {
        let other = 1 - side(ways.cells[portal.idx()], from);
        let toll = &self.tolls[2 * portal.idx() + other];
        if toll.stamp == self.stamp {
            toll.cost
        } else {
            f64::INFINITY
        }
    }

    /// Returns the portals passed, ascending by length.
    #[must_use]
    pub fn reached(&self) -> &[PassedPortal] {
        &self.reached
    }

    /// Returns the cells entered, ascending by the length to the nearest portal that leads in; the start's cell first, at 0.
    /// [Units: wu]
    #[must_use]
    pub fn cells(&self) -> &[(CellId, f64)] {
        &self.cells
    }

    /// Returns the start; `None` before the first search. [Units: wu]
    #[must_use]
    pub fn start(&self) -> Option<(CellId, DVec3)> {
        self.start
    }

    /// Writes the paths to a point in `cell`, the shortest first: each with its own sequence of portals, none longer than `most`
    /// times the shortest, at most `n`. Straight lines from the last portal to the point. Clears `arrivals` first. [Units: wu]
    ///
    /// These are not all sequences: of several to one point of a portal the search keeps the shortest.
    pub fn arrivals(
        &self,
        ways: &Ways,
        cell: CellId,
        to: DVec3,
        most: f64,
        n: usize,
        arrivals: &mut Vec<Arrival>,
    ) {
        let straight = |_: usize, p: DVec3| p.distance(to);
        self.arrivals_by(ways, cell, to, straight, most, n, arrivals);
    }

    /// As [`LengthSearch::arrivals`], with given lengths from the points of the cell to the end, as for
    /// [`LengthSearch::run_from`]; `direct` is called for the length to the start if that is in the same cell, with an index
    /// after those of all points.
    #[expect(
        clippy::too_many_arguments,
        reason = "two limits and a buffer more than a way has ends"
    )]
    pub fn arrivals_by(
        &self,
        ways: &Ways,
        cell: CellId,
        to: DVec3,
        mut last: impl FnMut(usize, DVec3) -> f64,
        most: f64,
        n: usize,
        arrivals: &mut Vec<Arrival>,
    ) {
        arrivals.clear();
        let mut place = 0;
        for exit in ways.exits_of(cell) {
            for k in ways.range(exit.portal) {
                let node = ways.node(k, cell);
                let leg = place;
                place += 1;
                let label = &self.labels[node as usize];
                if label.stamp == self.stamp && label.is_settled {
                    arrivals.push(Arrival {
                        length: label.length + last(leg, ways.points[k as usize]),
                        node: Some(node),
                        sequence: label.sequence,
                    });
                }
            }
        }
        if let Some((_, from)) = self.start.filter(|s| s.0 == cell) {
            let length = if from == to { 0.0 } else { last(place, from) };
            arrivals.push(Arrival {
                length,
                node: None,
                sequence: 0,
            });
        }
        let key = |a: &Arrival| (a.length, a.sequence, a.node);
        arrivals.retain(|a| a.length < f64::INFINITY);
        arrivals.sort_unstable_by(|a, b| key(a).partial_cmp(&key(b)).expect("lengths are numbers"));
        let mut n_kept = 0;
        for i in 0..arrivals.len() {
            let a = arrivals[i];
            let is_known = arrivals[..n_kept].iter().any(|b| b.sequence == a.sequence);
            if n_kept == n || a.length > most * arrivals[0].length {
                break;
            }
            if !is_known {
                arrivals[n_kept] = a;
                n_kept += 1;
            }
        }
        arrivals.truncate(n_kept);
    }

    /// Writes the portals of a path, from the start on, each with the cell entered through it and the point of crossing. Clears
    /// `crossings` first. [Units: wu]
    pub fn crossings(
        &self,
        ways: &Ways,
        arrival: &Arrival,
        crossings: &mut Vec<(LayoutExit, DVec3)>,
    ) {
        crossings.clear();
        let back = self.back(ways, arrival);
        crossings.extend(back.map(|(exit, k)| (exit, ways.points[k as usize])));
        crossings.reverse();
    }

    /// Returns the portals of a path from its end to the start, each with the index of the point among all points.
    pub(crate) fn back(
        &self,
        ways: &Ways,
        arrival: &Arrival,
    ) -> impl Iterator<Item = (LayoutExit, u32)> {
        let mut at = arrival.node.unwrap_or(START);
        std::iter::from_fn(move || {
            let node = Some(at).filter(|&node| node != START)?;
            at = self.labels[node as usize].before;
            Some((ways.exit_of(node), node / 2))
        })
    }
}

fn grow<T: Clone + Default>(buffer: &mut Vec<T>, n: usize) {
    if buffer.len() < n {
        buffer.resize(n, T::default());
    }
}

/// Returns the hash of a sequence extended by one portal; two sequences collide with probability 2⁻⁶⁴.
fn hash_extended(sequence: u64, exit: LayoutExit) -> u64 {
    // The finalizer of SplitMix64.
    let mut x = sequence ^ (u64::from(exit.portal.0) << 32 | u64::from(exit.to.0));
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}
