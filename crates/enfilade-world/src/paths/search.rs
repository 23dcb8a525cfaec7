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
use std::sync::Arc;

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::DVec3;

use crate::layout::{Exit, Layout};
use crate::paths::sampling::{Sampling, sample};
use crate::paths::sequences::{End, Limit};

/// The graph of a search: crossings, and the lengths between them within each cell. Made once, read by all searches.
#[derive(Clone, Debug)]
pub struct Ways {
    /// Per portal its first point, and the number of all.
    first_point: Vec<u32>,
    points: Vec<DVec3>,
    /// The portal of each point.
    portal: Vec<u32>,
    cells: Vec<[CellId; 2]>,
    /// Per cell its first exit, and the number of all.
    first_exit: Vec<u32>,
    exits: Vec<Exit>,
    /// Per portal, the index of its first point among the points of either of its cells.
    place: Vec<[u32; 2]>,
    /// Per cell the number of its points.
    n_points: Vec<u32>,
    /// Per cell, lengths between its points; empty if they are straight.
    bent: Vec<Bent>,
}

/// Lengths within a cell, row by row: shared ones between its first points, and those from each of the others to all.
#[derive(Clone, Debug, Default)]
struct Bent {
    n: usize,
    shared: Arc<Vec<f64>>,
    added: Vec<f64>,
}

impl Bent {
    fn is_empty(&self) -> bool {
        self.shared.is_empty() && self.added.is_empty()
    }

    /// Returns the length between two of `n_all` points.
    #[inline]
    fn length(&self, n_all: usize, from: usize, to: usize) -> f64 {
        if from < self.n && to < self.n {
            return self.shared[from * self.n + to];
        }
        let (later, other) = if from < self.n {
            (to, from)
        } else {
            (from, to)
        };
        self.added[(later - self.n) * n_all + other]
    }
}

impl Ways {
    /// Makes it from a layout: points of all openings, straight lines within cells.
    #[must_use]
    pub fn new(layout: &Layout, sampling: Sampling) -> Self {
        Self::with_points(layout, |portal, points| {
            for piece in layout.opening(portal).pieces() {
                sample(piece, sampling, points);
            }
        })
    }

    /// Makes it with the caller's points: `choose` adds those of a portal. A portal without any is never passed.
    #[must_use]
    pub fn with_points(layout: &Layout, mut choose: impl FnMut(PortalId, &mut Vec<DVec3>)) -> Self {
        let (mut first_point, mut points, mut portal) = (vec![0], Vec::new(), Vec::new());
        let mut cells = Vec::new();
        for id in (0..layout.n_portals() as u32).map(PortalId) {
            choose(id, &mut points);
            portal.resize(points.len(), id.0);
            first_point.push(points.len() as u32);
            cells.push(layout.opening(id).cells());
        }
        let mut place = vec![[0; 2]; cells.len()];
        let (mut first_exit, mut exits, mut n_points) = (vec![0], Vec::new(), Vec::new());
        for cell in (0..layout.n_cells() as u32).map(CellId) {
            let mut n = 0;
            for exit in layout.exits(cell) {
                let at = exit.portal.idx();
                place[at][side(cells[at], cell)] = n;
                n += first_point[at + 1] - first_point[at];
                exits.push(*exit);
            }
            first_exit.push(exits.len() as u32);
            n_points.push(n);
        }
        Self {
            bent: vec![Bent::default(); n_points.len()],
            first_point,
            points,
            portal,
            cells,
            first_exit,
            exits,
            place,
            n_points,
        }
    }

    /// Sets the lengths within a cell where straight lines are too short. `lengths` has a row for each of its
    /// [points](Self::points_of), with a length to each; infinite if there is no path within the cell. [Units: wu]
    ///
    /// # Panics
    ///
    /// If the number of lengths is not that of pairs of points.
    pub fn set_lengths(&mut self, cell: CellId, lengths: Vec<f64>) {
        let n = self.n_points[cell.idx()] as usize;
        assert_eq!(lengths.len(), n * n, "a length for each pair of points");
        self.bent[cell.idx()] = Bent {
            n,
            shared: Arc::new(lengths),
            added: Vec::new(),
        };
    }

    /// Sets the lengths within a cell to those of another world's, which has the first of its points; `added` has a row for each
    /// of the others, with a length to each of all. Copies nothing.
    pub(crate) fn share_lengths(
        &mut self,
        cell: CellId,
        (of, own): (&Self, CellId),
        added: Vec<f64>,
    ) {
        self.bent[cell.idx()] = Bent {
            n: of.n_points[own.idx()] as usize,
            shared: of.bent[own.idx()].shared.clone(),
            added,
        };
    }

    /// Returns the number of a cell's points.
    pub(crate) fn n_points(&self, cell: CellId) -> usize {
        self.n_points[cell.idx()] as usize
    }

    /// Returns the points of a cell's portals, in the order of its exits, each with its portal. [Units: wu]
    pub fn points_of(&self, cell: CellId) -> impl Iterator<Item = (PortalId, DVec3)> + Clone {
        self.exits_of(cell).iter().flat_map(|exit| {
            let points = self.range(exit.portal);
            points.map(|k| (exit.portal, self.points[k as usize]))
        })
    }

    /// Returns the points of a portal. [Units: wu]
    #[must_use]
    pub fn points(&self, portal: PortalId) -> &[DVec3] {
        let range = self.range(portal);
        &self.points[range.start as usize..range.end as usize]
    }

    /// Returns the indices of a portal's points among all points.
    pub(crate) fn range(&self, portal: PortalId) -> std::ops::Range<u32> {
        self.first_point[portal.idx()]..self.first_point[portal.idx() + 1]
    }

    /// Returns the indices of a portal's points among the [points of one of its cells](Self::points_of).
    pub(crate) fn places(&self, portal: PortalId, cell: CellId) -> std::ops::Range<usize> {
        let at = portal.idx();
        let first = self.place[at][side(self.cells[at], cell)] as usize;
        first..first + self.range(portal).len()
    }

    pub(crate) fn exits_of(&self, cell: CellId) -> &[Exit] {
        let first = &self.first_exit[cell.idx()..];
        &self.exits[first[0] as usize..first[1] as usize]
    }

    /// Returns the length between two points of a cell, by their indices among [those of the cell](Self::points_of). [Units: wu]
    ///
    /// # Panics
    ///
    /// If the cell has no such points.
    #[must_use]
    pub fn length(&self, cell: CellId, from: usize, to: usize) -> f64 {
        let n = self.n_points[cell.idx()] as usize;
        let point = |k: usize| self.points_of(cell).nth(k).expect("a point of the cell").1;
        let bent = &self.bent[cell.idx()];
        if bent.is_empty() {
            point(from).distance(point(to))
        } else {
            bent.length(n, from, to)
        }
    }

    /// Returns the lengths from one point of a cell to those of one of its portals, in order.
    pub(crate) fn lengths(
        &self,
        cell: CellId,
        from: u32,
        to: PortalId,
    ) -> impl Iterator<Item = f64> + '_ {
        let table = &self.bent[cell.idx()];
        let portal = self.portal[from as usize] as usize;
        let row =
            self.place[portal][side(self.cells[portal], cell)] + from - self.first_point[portal];
        let n = self.n_points[cell.idx()] as usize;
        let first = self.place[to.idx()][side(self.cells[to.idx()], cell)] as usize;
        let (at, is_straight) = (self.points[from as usize], table.is_empty());
        (self.range(to)).enumerate().map(move |(i, k)| {
            if is_straight {
                at.distance(self.points[k as usize])
            } else {
                table.length(n, row as usize, first + i)
            }
        })
    }

    pub(crate) fn node(&self, point: u32, into: CellId) -> u32 {
        let portal = self.portal[point as usize] as usize;
        2 * point + side(self.cells[portal], into) as u32
    }

    fn exit_of(&self, node: u32) -> Exit {
        let portal = self.portal[node as usize / 2];
        Exit {
            portal: PortalId(portal),
            to: self.cells[portal as usize][node as usize % 2],
        }
    }
}

fn side(cells: [CellId; 2], cell: CellId) -> usize {
    usize::from(cells[1] == cell)
}

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
pub struct PassedPortal {
    /// The portal, and the cell entered through it.
    pub exit: Exit,
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
        pass: impl FnMut(Exit) -> Option<f64>,
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
        mut pass: impl FnMut(Exit) -> Option<f64>,
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
        mut pass: impl FnMut(Exit) -> Option<f64>,
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
        mut pass: impl FnMut(Exit) -> Option<f64>,
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

    fn settle(&mut self, ways: &Ways, exit: Exit, length: f64) {
        let portal = exit.portal.idx();
        let toll = &mut self.tolls[2 * portal + side(ways.cells[portal], exit.to)];
        if !toll.is_reached {
            toll.is_reached = true;
            self.reached.push(PassedPortal { exit, length });
            self.enter(exit.to, length);
        }
    }

    fn toll(&mut self, ways: &Ways, exit: Exit, pass: &mut impl FnMut(Exit) -> Option<f64>) -> f64 {
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

    fn relax(&mut self, node: u32, before: u32, length: f64, exit: Exit) {
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
            sequence: mixed(sequence, exit),
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
    pub fn crossings(&self, ways: &Ways, arrival: &Arrival, crossings: &mut Vec<(Exit, DVec3)>) {
        crossings.clear();
        let back = self.back(ways, arrival);
        crossings.extend(back.map(|(exit, k)| (exit, ways.points[k as usize])));
        crossings.reverse();
    }

    /// Returns the portals of a path from its end to the start, each with the index of the point among all points.
    pub(crate) fn back(&self, ways: &Ways, arrival: &Arrival) -> impl Iterator<Item = (Exit, u32)> {
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
fn mixed(sequence: u64, exit: Exit) -> u64 {
    // The finalizer of SplitMix64.
    let mut x = sequence ^ (u64::from(exit.portal.0) << 32 | u64::from(exit.to.0));
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}
