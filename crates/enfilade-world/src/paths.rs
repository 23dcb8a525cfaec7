//! Paths for walkers: from point to point at any angle, and walking distances.
//!
//! Two levels, as in Botea, Müller & Schaeffer ("Near optimal hierarchical path-finding", 2004), but with cells and portals for
//! clusters and entrances. Lengths between the portals of each cell are found once, over its [floors](Floors), so that paths go
//! around walls within a cell. A query takes the best sequences of portals from the [length search](LengthSearch), finds the
//! path over the floors of their cells only, and pulls it taut: each bend moves straight towards the line between its neighbors
//! as far as the floors allow, until none moves. The shortest of the best few sequences wins.
//!
//! The path keeps the walker's radius from walls as [floors](Floors) do, and is never shorter than the shortest such path. It
//! may be longer if it is caught on the other side of a free-standing obstacle in a cell, or if two sequences are nearly equally
//! short. O(floors of the cells passed), at most milliseconds for a storey.

use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::DVec3;
use enfilade_runtime::DetailId;

use crate::bodies::Agent;
use crate::layout::{Exit, Layout};
use floors::Hindrance;
use pull::{Bend, pull_taut};
use strides::{Strides, walk_straight};

pub use edges::Corner;
pub use floors::Floors;
pub use geodesics::Geodesics;
pub(crate) use geodesics::{Seen, into_cell};
pub use hops::Hops;
pub use kept::{KeptMapError, WalkMapKey};
pub use path_follower::{PathFollower, Progress};
pub use sampling::Sampling;
pub use search::{Arrival, LengthSearch, PassedPortal, Ways};
pub(crate) use sequences::{End, Limit, Sequences};

mod all_pairs;
mod columns;
mod edges;
mod floors;
mod geodesics;
mod hops;
mod kept;
mod path_follower;
mod pull;
mod sampling;
mod search;
mod sequences;
mod strides;
mod trees;

/// Walkable paths of one kind of walker in a world. Made once, read by all searches.
#[derive(Clone, Debug)]
pub struct WalkMap {
    floors: Floors,
    ways: Ways,
    /// Per point of the ways, the floors on either side of the portal: in its first cell, in its second.
    sides: Vec<[u32; 2]>,
}

/// Distance between the points at which walkers cross a portal. [Units: wu]
///
/// Doorways have two or three; taut paths through a gate of 10 m bend by less than a hundredth more for it.
const SPACING: f64 = 1.0;

impl WalkMap {
    /// Prepares a world with its objects, except leaves of doors, which walkers open. Takes seconds for a large building: floors
    /// are laid out in squares of a quarter of the walker's radius, and searched in each cell from each of its portals.
    #[must_use]
    pub fn new(layout: &Layout, world: &World, walker: Agent) -> Self {
        Self::with_objects(layout, world, walker, |_| true)
    }

    /// As [`WalkMap::new`], with those objects only for which `counts` returns `true`.
    #[must_use]
    pub fn with_objects(
        layout: &Layout,
        world: &World,
        walker: Agent,
        counts: impl FnMut(DetailId) -> bool,
    ) -> Self {
        let floors = Floors::new(layout, world, walker, counts);
        let mut chosen: Vec<(PortalId, [u32; 2])> = Vec::new();
        let mut by_portal: Vec<(PortalId, u32, u32)> = Vec::new();
        for c in floors.crossings().iter().filter(|c| c.direction < 2) {
            let to = floors.floor(c.from).steps[c.direction as usize];
            // Not where its own leaf stands.
            let is_free = |floor| floors.leaves_at(floor).all(|p| p != c.portal);
            if is_free(c.from) && is_free(to) {
                by_portal.push((c.portal, c.from, to));
            }
        }
        by_portal.sort_unstable();
        for all in by_portal.chunk_by(|a, b| a.0 == b.0) {
            choose_points(&floors, all, |from, to| {
                let first = layout.opening(all[0].0).cells()[0];
                let is_turned = floors.floor(from).cell != first;
                let pair = if is_turned { [to, from] } else { [from, to] };
                chosen.push((all[0].0, pair));
            });
        }
        let mut ways = Ways::with_points(layout, |portal, points| {
            let first = chosen.partition_point(|c| c.0 < portal);
            let own = chosen[first..].iter().take_while(|c| c.0 == portal);
            points.extend(own.map(|(_, [a, b])| (floors.point(*a) + floors.point(*b)) * 0.5));
        });
        let sides = chosen.iter().map(|c| c.1).collect();
        let mut map = Self {
            floors,
            ways: ways.clone(),
            sides,
        };
        let mut strides = Strides::default();
        for cell in (0..layout.n_cells() as u32).map(CellId) {
            let mut lengths = Vec::new();
            map.each_point(layout, cell, |portal, from| {
                strides.spread(&map.floors, from, None, &[portal]);
                map.each_point(layout, cell, |_, to| {
                    lengths.push(strides.length(to) + map.floors.squares().side);
                });
            });
            // The leaves at both ends may be in the way.
            let n = lengths.len().isqrt();
            for (i, j) in (0..n).flat_map(|i| (0..i).map(move |j| (i, j))) {
                let longest = lengths[i * n + j].max(lengths[j * n + i]);
                (lengths[i * n + j], lengths[j * n + i]) = (longest, longest);
            }
            ways.set_lengths(cell, lengths);
        }
        map.ways = ways;
        map
    }

    /// Calls `visit` with each point of a cell: its portal, and the floor on the cell's side, in the order of its ways.
    fn each_point(&self, layout: &Layout, cell: CellId, mut visit: impl FnMut(PortalId, u32)) {
        for exit in layout.exits(cell) {
            let side = usize::from(layout.opening(exit.portal).cells()[1] == cell);
            for k in self.ways.range(exit.portal) {
                visit(exit.portal, self.sides[k as usize][side]);
            }
        }
    }

    /// Returns its floors.
    #[must_use]
    pub fn floors(&self) -> &Floors {
        &self.floors
    }

    /// Returns its points and lengths, for custom searches.
    #[must_use]
    pub fn ways(&self) -> &Ways {
        &self.ways
    }

    /// Returns `true` if the walker fits through a portal: wide and high enough, not a window or crack, with floors on both
    /// sides.
    #[must_use]
    pub fn is_walkable(&self, portal: PortalId) -> bool {
        !self.ways.points(portal).is_empty()
    }
}

/// Calls `choose` with some of all steps through a portal.
fn choose_points(floors: &Floors, all: &[(PortalId, u32, u32)], mut choose: impl FnMut(u32, u32)) {
    let mut points: Vec<(DVec3, u32, u32)> = (all.iter())
        .map(|&(_, a, b)| ((floors.point(a) + floors.point(b)) * 0.5, a, b))
        .collect();
    let low = points.iter().fold(DVec3::INFINITY, |m, p| m.min(p.0));
    let high = points.iter().fold(DVec3::NEG_INFINITY, |m, p| m.max(p.0));
    let axis = if (high - low).x > (high - low).z {
        0
    } else {
        2
    };
    // Storey by storey, along the portal.
    let key = |p: &(DVec3, u32, u32)| ((p.0.y / floors.walker().height).round(), p.0[axis]);
    points.sort_by(|a, b| {
        key(a)
            .partial_cmp(&key(b))
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    let gap = 4.0 * floors.squares().side + floors.walker().step;
    for group in points.chunk_by(|a, b| a.0.distance(b.0) < gap) {
        let length = group[0].0.distance(group[group.len() - 1].0);
        let n = ((length / SPACING).ceil() as usize).clamp(1, group.len());
        // At the middle of each part, and at both ends.
        for i in 0..=2 * n {
            let is_wanted = i % 2 == 1 || (length > 0.2 && (i == 0 || i == 2 * n));
            if is_wanted {
                let (_, a, b) = group[i * (group.len() - 1) / (2 * n)];
                choose(a, b);
            }
        }
    }
}

/// A path found. Reuse it, so that a search need not allocate.
#[derive(Clone, Debug, Default)]
pub struct Path {
    /// Points where it bends, in plan or in height: on the floor, from the start to the end. [Units: wu]
    pub points: Vec<DVec3>,
    /// The portals that it passes, each with the cell entered.
    pub portals: Vec<Exit>,
    /// Where it passes each of them: on the floor. [Units: wu]
    pub passages: Vec<DVec3>,
    /// Length of the line through the points. [Units: wu]
    pub length: f64,
    /// Its length in plan. [Units: wu]
    pub length_in_plan: f64,
}

/// Reason why there is no path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoPath {
    /// The walker cannot stand at the start.
    #[error("no floor for a walker within its height and diameter of the start")]
    NoFloorAtStart,
    /// The walker cannot stand at the end.
    #[error("no floor for a walker within its height and diameter of the end")]
    NoFloorAtEnd,
    /// Walls, steps, gaps or closed portals separate them.
    #[error("no way that a walker can go")]
    NoWay,
}

/// Searches for paths, with reusable buffers: allocates nothing once they have grown.
#[derive(Clone, Debug, Default)]
pub struct PathSearch {
    search: LengthSearch,
    strides: Strides,
    arrivals: Vec<Arrival>,
    /// Per point of a cell.
    lengths: Vec<f64>,
    legs: Vec<(u32, u32)>,
    /// Portals of the path, and those of them whose leaves are in the way.
    sequence: Vec<PortalId>,
    opened: Vec<PortalId>,
    floors: Vec<u32>,
    bends: Vec<Bend>,
    best: Vec<Bend>,
    profile: Vec<DVec3>,
    kept: Vec<(usize, usize)>,
}

/// Maximum number of sequences of portals pulled taut.
const N_SEQUENCES: usize = 4;
/// Greatest length of these, found square by square, relative to the best.
const MOST: f64 = 1.06;

impl PathSearch {
    /// Makes it without buffers.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Finds the path from one point to another through the portals for which `may_pass` returns `true`, such as open doors.
    /// Points are at the walker's feet, or any height up to its head. [Units: wu]
    ///
    /// # Errors
    ///
    /// If the walker cannot stand at an end, or there is no path; `path` is then empty.
    pub fn find(
        &mut self,
        map: &WalkMap,
        layout: &Layout,
        [from, to]: [DVec3; 2],
        mut may_pass: impl FnMut(PortalId) -> bool,
        path: &mut Path,
    ) -> Result<(), NoPath> {
        path.points.clear();
        path.portals.clear();
        path.passages.clear();
        (path.length, path.length_in_plan) = (0.0, 0.0);
        let floors = &map.floors;
        let start = self.within(map, layout, from, f64::INFINITY, &mut may_pass)?;
        let goal = floors.below(to).ok_or(NoPath::NoFloorAtEnd)?;
        self.arrive(map, layout, start, goal);
        let mut least = f64::INFINITY;
        for i in 0..self.arrivals.len() {
            let arrival = self.arrivals[i];
            if !self.lay_out(map, layout, start, goal, &arrival) {
                continue;
            }
            self.set_bends(floors, [(from, start), (to, goal)]);
            let (sequence, opened) = (&self.sequence, &self.opened);
            let mut may = |hindrance| match hindrance {
                // The leaf of a door beside would be in the way, too.
                Hindrance::Portal(portal) => {
                    may_pass(portal) && (sequence.contains(&portal) || !floors.has_leaves(portal))
                }
                Hindrance::Leaf(portal) => !opened.contains(&portal),
            };
            pull_taut(floors, &mut self.bends, &mut may);
            let legs = self.bends.windows(2);
            let length: f64 = legs.map(|w| w[0].0.distance(w[1].0)).sum();
            if length < least {
                least = length;
                std::mem::swap(&mut self.best, &mut self.bends);
            }
        }
        if least == f64::INFINITY {
            return Err(NoPath::NoWay);
        }
        self.write(floors, path);
        Ok(())
    }

    /// Searches from a point up to `radius`; returns the floor that it is on.
    fn within(
        &mut self,
        map: &WalkMap,
        layout: &Layout,
        from: DVec3,
        radius: f64,
        may_pass: &mut impl FnMut(PortalId) -> bool,
    ) -> Result<u32, NoPath> {
        let start = map.floors.below(from).ok_or(NoPath::NoFloorAtStart)?;
        let cell = map.floors.floor(start).cell;
        self.measure(map, layout, start);
        let lengths = &self.lengths;
        self.search.run_from(
            &map.ways,
            cell,
            map.floors.point(start),
            |place, _| lengths[place],
            radius,
            |exit| may_pass(exit.portal).then_some(0.0),
        );
        Ok(start)
    }

    /// Finds the cells within walking distance `radius` of a point, for maps and radars, ascending by the length to the nearest
    /// portal that leads in, the point's own first. Then query the [distances](Self::distance) of things. [Units: wu]
    ///
    /// # Errors
    ///
    /// If the walker cannot stand there.
    pub fn cells_within(
        &mut self,
        map: &WalkMap,
        layout: &Layout,
        from: DVec3,
        radius: f64,
        mut may_pass: impl FnMut(PortalId) -> bool,
    ) -> Result<&[(CellId, f64)], NoPath> {
        self.within(map, layout, from, radius, &mut may_pass)?;
        Ok(self.search.cells())
    }

    /// Returns the walking distance of a point from the start of [`PathSearch::cells_within`]; `None` if the walker cannot stand
    /// there or did not reach it. Square by square, so up to 2.8 % too long within a cell, and more through
    /// portals, which it passes at fixed points: 7.8 % is the most measured. [Units: wu]
    pub fn distance(&mut self, map: &WalkMap, layout: &Layout, to: DVec3) -> Option<f64> {
        let goal = map.floors.below(to)?;
        let (cell, from) = self.search.start()?;
        let start = map
            .floors
            .below(from)
            .filter(|_| cell == map.floors.floor(goal).cell);
        self.arrive(map, layout, start.unwrap_or(goal), goal);
        self.arrivals.first().map(|a| a.length)
    }

    /// Computes lengths from a floor to the points of its cell.
    fn measure(&mut self, map: &WalkMap, layout: &Layout, from: u32) {
        let half = 0.5 * map.floors.squares().side;
        self.strides.spread(&map.floors, from, None, &[]);
        self.lengths.clear();
        map.each_point(layout, map.floors.floor(from).cell, |_, floor| {
            self.lengths.push(self.strides.length(floor) + half);
        });
    }

    /// Finds the best sequences to a floor.
    fn arrive(&mut self, map: &WalkMap, layout: &Layout, start: u32, goal: u32) {
        self.measure(map, layout, goal);
        let cell = map.floors.floor(goal).cell;
        // For the start, if it is in the same cell.
        self.lengths.push(self.strides.length(start));
        let lengths = &self.lengths;
        self.search.arrivals_by(
            &map.ways,
            cell,
            map.floors.point(goal),
            |place, _| lengths[place],
            MOST,
            N_SEQUENCES,
            &mut self.arrivals,
        );
    }

    /// Finds the floors of a path, square by square; returns `false` if leaves of its own doors are in its way.
    fn lay_out(
        &mut self,
        map: &WalkMap,
        layout: &Layout,
        start: u32,
        goal: u32,
        arrival: &Arrival,
    ) -> bool {
        self.legs.clear();
        self.sequence.clear();
        self.opened.clear();
        for (exit, k) in self.search.back(&map.ways, arrival) {
            let into = usize::from(layout.opening(exit.portal).cells()[1] == exit.to);
            let sides = map.sides[k as usize];
            self.legs.push((sides[1 - into], sides[into]));
            self.sequence.push(exit.portal);
            // A walker that ends behind a door shuts it.
            if map.floors.leaves_at(goal).all(|p| p != exit.portal) {
                self.opened.push(exit.portal);
            }
        }
        self.legs.reverse();
        self.floors.clear();
        self.floors.push(start);
        let mut at = start;
        for i in 0..=self.legs.len() {
            let (end, next) = self.legs.get(i).copied().unwrap_or((goal, goal));
            self.strides
                .spread(&map.floors, at, Some(end), &self.opened);
            if self.strides.length(end) == f64::INFINITY {
                return false;
            }
            let first = self.floors.len();
            self.floors.extend(self.strides.back(end));
            self.floors[first..].reverse();
            if next != end {
                self.floors.push(next);
            }
            at = next;
        }
        true
    }

    /// Sets the bends of the path: all of its floors, except those that straight lines can skip.
    fn set_bends(&mut self, floors: &Floors, [first, last]: [Bend; 2]) {
        self.bends.clear();
        let point = |i: usize| (floors.point(self.floors[i]), self.floors[i]);
        self.bends.extend((0..self.floors.len()).map(point));
        // The ends are at the given points, if these are on the floor at all.
        for (bend, wanted) in [(0, first), (self.bends.len() - 1, last)] {
            let at = floors.squares().at(wanted.0);
            let is_on = at.is_some_and(|at| {
                floors.squares().number(at) == floors.floor(wanted.1).square as usize
            });
            if is_on {
                self.bends[bend].0 = wanted.0.with_y(self.bends[bend].0.y);
            }
        }
    }

    /// Writes the best path with its portals, and with bends where the floor rises or falls.
    fn write(&mut self, floors: &Floors, path: &mut Path) {
        let up = |p: DVec3, floor: u32| p.with_y(f64::from(floors.floor(floor).y));
        path.points.push(self.best[0].0);
        for i in 1..self.best.len() {
            let [start, (b, _)] = [self.best[i - 1], self.best[i]];
            let a = start.0;
            let along = (b - a).with_y(0.0);
            self.profile.clear();
            self.profile.push(a);
            let end = walk_straight(floors, start, b, &mut |_| true, |from, direction, to| {
                let middle = (floors.point(from) + floors.point(to)) * 0.5 - a;
                let t = middle.with_y(0.0).dot(along) / along.length_squared();
                self.profile.push(up(a + along * t.clamp(0.0, 1.0), to));
                let cell = floors.floor(to).cell;
                if let Some(portal) = floors.portal_of(from, direction) {
                    path.portals.push(Exit { portal, to: cell });
                    path.passages.extend(self.profile.last());
                }
            });
            debug_assert!(end.is_some(), "{a} {b}");
            self.profile.push(b);
            self.keep_profile(0.5 * floors.walker().step, &mut path.points);
        }
        let legs = || path.points.windows(2).map(|w| w[1] - w[0]);
        path.length = legs().map(DVec3::length).sum();
        path.length_in_plan = legs().map(|v| v.with_y(0.0).length()).sum();
    }

    /// Adds the points of the profile, except the first, needed for heights exact to `most` (Douglas & Peucker 1973).
    fn keep_profile(&mut self, most: f64, points: &mut Vec<DVec3>) {
        self.kept.clear();
        self.kept.push((0, self.profile.len() - 1));
        while let Some((a, b)) = self.kept.pop() {
            let (p, q) = (self.profile[a], self.profile[b]);
            let length = (q - p).with_y(0.0).length();
            let off = |i: usize| {
                let t = (self.profile[i] - p).with_y(0.0).length() / length.max(1e-9);
                (self.profile[i].y - (p.y + (q.y - p.y) * t)).abs()
            };
            let worst = (a + 1..b).max_by(|&i, &j| off(i).total_cmp(&off(j)));
            match worst.filter(|&i| off(i) > most) {
                Some(i) => self.kept.extend([(i, b), (a, i)]),
                None => points.push(q),
            }
        }
    }
}
