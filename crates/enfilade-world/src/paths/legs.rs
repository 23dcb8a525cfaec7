//! The part of a path in one part.

use enfilade_geom::DVec3;

use super::floors::Hindrance;
use super::pull::{Bend, pull_taut, straight};
use super::search::{Arrival, LengthSearch};
use super::strides::{Strides, walk_straight};
use super::walk_map::{PartMap, Stand, WalkMap};
use super::{Path, PathPoint, PathPortal};
use crate::layout::{Layout, LayoutExit};
use crate::space::{PartId, Space};
use enfilade_cpg::PortalId;

/// Maximum number of sequences of portals pulled taut.
const N_SEQUENCES: usize = 4;
/// Greatest length of these, found square by square, relative to the best.
const MOST: f64 = 1.06;

/// The place where a search enters a part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entrance {
    pub(super) start: Stand,
    /// Length up to its start. [Units: wu]
    pub(super) offset: f64,
    /// The joint that leads in, the side to which it leads, and the entry before; `None` at the start of the search.
    pub(super) via: Option<(usize, usize, usize)>,
}

/// A part entered by a search.
#[derive(Clone, Debug)]
pub(super) struct PartEntry {
    pub(super) at: Entrance,
    pub(super) search: LengthSearch,
}

/// The part of a path in one part.
#[derive(Clone, Debug)]
pub(super) struct PartLeg {
    pub(super) part: PartId,
    pub(super) bends: Vec<Bend>,
    /// Portals that it passes, and those of them whose leaves are in the way.
    pub(super) sequence: Vec<PortalId>,
    pub(super) opened: Vec<PortalId>,
    /// Floors beside drops that joints lead over, ascending.
    pub(super) edges: Vec<u32>,
    /// The joint that leads in, and the side to which it leads.
    pub(super) via: Option<(usize, usize)>,
    /// Its step of that joint, and of the one that leads out.
    pub(super) first_step: usize,
    pub(super) step: usize,
}

/// Buffers of searches within a part.
#[derive(Clone, Debug, Default)]
pub(super) struct Tools {
    pub(super) strides: Strides,
    pub(super) arrivals: Vec<Arrival>,
    /// Per point of a cell.
    pub(super) lengths: Vec<f64>,
    pub(super) crossings: Vec<(u32, u32)>,
    /// Portals of the path, and those of them whose leaves are in the way.
    pub(super) sequence: Vec<PortalId>,
    pub(super) opened: Vec<PortalId>,
    pub(super) floors: Vec<u32>,
    pub(super) bends: Vec<Bend>,
    pub(super) profile: Vec<DVec3>,
    pub(super) kept: Vec<(usize, usize)>,
    /// Bends of the legs before and behind a joint, tried with another step.
    pub(super) tried: [Vec<Bend>; 2],
}

impl PartLeg {
    /// Writes its bends with another end, its last or its first, pulled taut; returns their length, infinite if there is none.
    pub(super) fn with_end(
        &self,
        map: &WalkMap,
        step: Bend,
        is_last: bool,
        may_pass: &mut impl FnMut(PartId, PortalId) -> bool,
        bends: &mut Vec<Bend>,
    ) -> f64 {
        let own = &map.parts[self.part.idx()];
        bends.clone_from(&self.bends);
        let at = if is_last { bends.len() - 1 } else { 0 };
        if bends[at] == step {
            return length_of(bends);
        }
        let mut may = self.rule(own, may_pass);
        let [(from, floor), (to, end)] = if is_last {
            [bends[at], step]
        } else {
            [step, bends[at]]
        };
        if straight(&own.floors, (from, floor), to, &mut may) != Some(end) {
            return f64::INFINITY;
        }
        bends.insert(if is_last { at + 1 } else { 0 }, step);
        pull_taut(&own.floors, bends, &mut may);
        length_of(bends)
    }

    /// Returns the condition of its steps.
    pub(super) fn rule<'a>(
        &'a self,
        own: &'a PartMap,
        may_pass: &'a mut impl FnMut(PartId, PortalId) -> bool,
    ) -> impl FnMut(Hindrance) -> bool {
        let Self {
            part,
            sequence,
            opened,
            edges,
            ..
        } = self;
        move |hindrance| match hindrance {
            // The leaf of a door beside would be in the way, too.
            Hindrance::Portal(portal) => {
                may_pass(*part, portal)
                    && (sequence.contains(&portal) || !own.floors.has_leaves(portal))
            }
            Hindrance::Leaf(portal) => !opened.contains(&portal),
            Hindrance::Edge(floor) => edges.binary_search(&floor).is_ok(),
        }
    }
}

impl Tools {
    /// Finds the best sequences of portals from an entry to a floor of its part; returns the least length.
    pub(super) fn arrive(
        &mut self,
        map: &WalkMap,
        space: &Space,
        entry: &PartEntry,
        goal: Stand,
        edges: &[u32],
    ) -> f64 {
        let (own, layout) = (&map.parts[goal.part.idx()], space.layout(goal.part));
        own.measure(
            &mut self.strides,
            layout,
            goal.floor,
            edges,
            &mut self.lengths,
        );
        // For the start, if it is in the same cell.
        self.lengths.push(self.strides.length(entry.at.start.floor));
        let lengths = &self.lengths;
        entry.search.arrivals_by(
            &own.ways,
            own.floors.floor(goal.floor).cell,
            own.floors.point(goal.floor),
            |place, _| lengths[place],
            MOST,
            N_SEQUENCES,
            &mut self.arrivals,
        );
        self.arrivals.first().map_or(f64::INFINITY, |a| a.length)
    }

    /// Finds the shortest path from an entry to a floor of its part; `false` if leaves of doors are in the way of all.
    pub(super) fn lay_leg(
        &mut self,
        map: &WalkMap,
        space: &Space,
        entry: &PartEntry,
        goal: Stand,
        may_pass: &mut impl FnMut(PartId, PortalId) -> bool,
        leg: &mut PartLeg,
    ) -> bool {
        let (own, layout) = (&map.parts[goal.part.idx()], space.layout(goal.part));
        let start = entry.at.start;
        self.arrive(map, space, entry, goal, &leg.edges);
        leg.part = goal.part;
        let mut least = f64::INFINITY;
        for i in 0..self.arrivals.len() {
            let arrival = self.arrivals[i];
            if !self.lay_out(own, layout, entry, goal.floor, &leg.edges, &arrival) {
                continue;
            }
            self.set_bends(own, [(start.at, start.floor), (goal.at, goal.floor)]);
            std::mem::swap(&mut leg.sequence, &mut self.sequence);
            std::mem::swap(&mut leg.opened, &mut self.opened);
            pull_taut(&own.floors, &mut self.bends, &mut leg.rule(own, may_pass));
            let lines = self.bends.windows(2);
            let length: f64 = lines.map(|w| w[0].0.distance(w[1].0)).sum();
            if length < least {
                least = length;
                std::mem::swap(&mut leg.bends, &mut self.bends);
            } else {
                std::mem::swap(&mut leg.sequence, &mut self.sequence);
                std::mem::swap(&mut leg.opened, &mut self.opened);
            }
        }
        least < f64::INFINITY
    }

    /// Finds the floors of a path, square by square; returns `false` if leaves of its own doors are in its way.
    pub(super) fn lay_out(
        &mut self,
        own: &PartMap,
        layout: &Layout,
        entry: &PartEntry,
        goal: u32,
        edges: &[u32],
        arrival: &Arrival,
    ) -> bool {
        self.crossings.clear();
        self.sequence.clear();
        self.opened.clear();
        for (exit, k) in entry.search.back(&own.ways, arrival) {
            let into = usize::from(layout.opening(exit.portal).cells()[1] == exit.to);
            let sides = own.sides[k as usize];
            self.crossings.push((sides[1 - into], sides[into]));
            self.sequence.push(exit.portal);
            // A walker that ends behind a door shuts it.
            if own.floors.leaves_at(goal).all(|p| p != exit.portal) {
                self.opened.push(exit.portal);
            }
        }
        self.crossings.reverse();
        self.floors.clear();
        self.floors.push(entry.at.start.floor);
        let mut at = entry.at.start.floor;
        for i in 0..=self.crossings.len() {
            let (end, next) = self.crossings.get(i).copied().unwrap_or((goal, goal));
            let opened = &self.opened;
            (self.strides).spread(&own.floors, at, Some(end), opened, edges);
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
    pub(super) fn set_bends(&mut self, own: &PartMap, [first, last]: [Bend; 2]) {
        let floors = &own.floors;
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

    /// Adds a leg to a path.
    pub(super) fn write(&mut self, own: &PartMap, leg: &PartLeg, path: &mut Path) {
        let floors = &own.floors;
        let part = leg.part;
        let up = |p: DVec3, floor: u32| p.with_y(f64::from(floors.floor(floor).y));
        path.points.push(PathPoint {
            part,
            at: leg.bends[0].0,
        });
        for w in leg.bends.windows(2) {
            let [start, (b, _)] = [w[0], w[1]];
            let a = start.0;
            let along = (b - a).with_y(0.0);
            self.profile.clear();
            self.profile.push(a);
            let end = walk_straight(
                floors,
                start.0,
                start.1,
                b,
                &mut |_| true,
                |from, direction, to| {
                    let middle = (floors.point(from) + floors.point(to)) * 0.5 - a;
                    let t = middle.with_y(0.0).dot(along) / along.length_squared();
                    let at = up(a + along * t.clamp(0.0, 1.0), to);
                    self.profile.push(at);
                    if let Some(portal) = floors.portal_of(from, direction) {
                        let to = floors.floor(to).cell;
                        let exit = LayoutExit { portal, to };
                        path.portals.push(PathPortal { part, exit, at });
                    }
                },
            );
            debug_assert!(end.is_some(), "{a} {b}");
            self.profile.push(b);
            self.keep_profile(0.5 * floors.walker().step, part, &mut path.points);
        }
    }

    /// Adds the points of the profile, except the first, needed for heights exact to `most` (Douglas & Peucker 1973).
    pub(super) fn keep_profile(&mut self, most: f64, part: PartId, points: &mut Vec<PathPoint>) {
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
                None => points.push(PathPoint { part, at: q }),
            }
        }
    }
}

pub(super) fn length_of(bends: &[Bend]) -> f64 {
    bends.windows(2).map(|w| w[0].0.distance(w[1].0)).sum()
}
