//! The search for paths, from part to part.

use enfilade_geom::DVec3;

use super::floors::Hindrance;
use super::joints::{Joint, Joints};
use super::pull::{Bend, pull_taut, straight};
use super::search::{Arrival, LengthSearch};
use super::strides::{Strides, walk_straight};
use super::walk_map::{PartMap, Stand, WalkMap};
use super::{NoPath, Path, PathPoint, PathPortal};
use crate::layout::{Exit, Layout};
use crate::space::{PartId, Place, Space};
use enfilade_cpg::PortalId;

/// Searches for paths, with reusable buffers: allocates nothing once they have grown, while parts rest.
#[derive(Clone, Debug, Default)]
pub struct PathSearch {
    joints: Joints,
    /// Per joint and side to which it leads.
    gates: Vec<JointGate>,
    /// The parts entered by the last search; the first `n_entries` count.
    entries: Vec<PartEntry>,
    n_entries: usize,
    near: Vec<(Place, f64)>,
    /// The first `n_legs` count.
    legs: Vec<PartLeg>,
    n_legs: usize,
    tools: Tools,
}

/// A joint in a search: the length up to it, and the entry from which it was reached.
#[derive(Clone, Copy, Debug)]
struct JointGate {
    length: f64,
    before: usize,
    is_done: bool,
}

/// A part entered by a search.
#[derive(Clone, Debug)]
struct PartEntry {
    start: Stand,
    /// Length up to its start. [Units: wu]
    offset: f64,
    /// The joint that leads in, the side to which it leads, and the entry before; `None` at the start of the search.
    via: Option<(usize, usize, usize)>,
    search: LengthSearch,
}

/// The part of a path in one part.
#[derive(Clone, Debug)]
struct PartLeg {
    part: PartId,
    bends: Vec<Bend>,
    /// Portals that it passes, and those of them whose leaves are in the way.
    sequence: Vec<PortalId>,
    opened: Vec<PortalId>,
    /// Floors beside drops that joints lead over, ascending.
    edges: Vec<u32>,
    /// The joint that leads in, and the side to which it leads.
    via: Option<(usize, usize)>,
    /// Its step of that joint, and of the one that leads out.
    first_step: usize,
    step: usize,
}

/// Buffers of searches within a part.
#[derive(Clone, Debug, Default)]
struct Tools {
    strides: Strides,
    arrivals: Vec<Arrival>,
    /// Per point of a cell.
    lengths: Vec<f64>,
    crossings: Vec<(u32, u32)>,
    /// Portals of the path, and those of them whose leaves are in the way.
    sequence: Vec<PortalId>,
    opened: Vec<PortalId>,
    floors: Vec<u32>,
    bends: Vec<Bend>,
    profile: Vec<DVec3>,
    kept: Vec<(usize, usize)>,
    /// Bends of the legs before and behind a joint, tried with another step.
    tried: [Vec<Bend>; 2],
}

/// Maximum number of sequences of portals pulled taut.
const N_SEQUENCES: usize = 4;
/// Greatest length of these, found square by square, relative to the best.
const MOST: f64 = 1.06;
/// Rounds of moving the steps across joints, and the directions in which the near and the far end of a step move.
const ROUNDS: usize = 2;
const MOVES: [[isize; 2]; 6] = [[1, 1], [-1, -1], [1, 0], [-1, 0], [0, 1], [0, -1]];

impl PathSearch {
    /// Makes it without buffers.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Finds the path from one point to another, each in the frame of a part, through the portals for which `may_pass` returns
    /// `true`, such as open doors. Leads from part to part through doors that currently lead from floor to floor, such as those of
    /// a lift that has stopped. Points are at the walker's feet, or any height up to its head. [Units: wu]
    ///
    /// # Errors
    ///
    /// If the walker cannot stand at an end, or there is no path; `path` is then empty.
    pub fn find(
        &mut self,
        map: &WalkMap,
        space: &Space,
        [from, to]: [(PartId, DVec3); 2],
        mut may_pass: impl FnMut(PartId, PortalId) -> bool,
        path: &mut Path,
    ) -> Result<(), NoPath> {
        path.clear();
        let start = map.stand(space, from).ok_or(NoPath::NoFloorAtStart)?;
        let goal = map.stand(space, to).ok_or(NoPath::NoFloorAtEnd)?;
        let infinite = f64::INFINITY;
        let last = self.spread(map, space, start, (Some(goal), infinite), &mut may_pass);
        self.lay_legs(map, space, last.ok_or(NoPath::NoWay)?, goal, &mut may_pass)?;
        self.tighten(map, space, &mut may_pass);
        self.write(map, space, path);
        Ok(())
    }

    /// Finds the places within walking distance `radius` of a point in the frame of a part, for maps and radars, ascending by the
    /// length to the nearest portal that leads in, the point's own first. Then query the [distances](Self::distance) of things.
    /// [Units: wu]
    ///
    /// # Errors
    ///
    /// If the walker cannot stand there.
    pub fn cells_within(
        &mut self,
        map: &WalkMap,
        space: &Space,
        from: (PartId, DVec3),
        radius: f64,
        mut may_pass: impl FnMut(PartId, PortalId) -> bool,
    ) -> Result<&[(Place, f64)], NoPath> {
        let start = map.stand(space, from).ok_or(NoPath::NoFloorAtStart)?;
        self.spread(map, space, start, (None, radius), &mut may_pass);
        self.near.clear();
        for entry in &self.entries[..self.n_entries] {
            let part = entry.start.part;
            let cells = entry.search.cells().iter();
            (self.near)
                .extend(cells.map(|&(cell, far)| (Place { part, cell }, entry.offset + far)));
        }
        self.near
            .sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        self.near.dedup_by_key(|near| near.0);
        self.near
            .sort_unstable_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
        Ok(&self.near)
    }

    /// Returns the walking distance of a point in the frame of a part from the start of [`PathSearch::cells_within`]; `None` if the
    /// walker cannot stand there or did not reach it. Square by square, so up to 2.8 % too long within a cell, and more through
    /// portals, which it passes at fixed points: 7.8 % is the most measured. [Units: wu]
    pub fn distance(&mut self, map: &WalkMap, space: &Space, to: (PartId, DVec3)) -> Option<f64> {
        let goal = map.stand(space, to)?;
        let mut least = f64::INFINITY;
        let own = self.entries[..self.n_entries].iter();
        for entry in own.filter(|e| e.start.part == goal.part) {
            let edges = self.joints.edges(goal.part);
            let length = self.tools.arrive(map, space, entry, (goal, edges));
            least = least.min(entry.offset + length);
        }
        (least < f64::INFINITY).then_some(least)
    }

    /// Searches from part to part, up to `radius`, and if there is a goal, no farther than that; returns the entry from which the
    /// goal is reached by the shortest way.
    fn spread(
        &mut self,
        map: &WalkMap,
        space: &Space,
        start: Stand,
        (goal, radius): (Option<Stand>, f64),
        may_pass: &mut impl FnMut(PartId, PortalId) -> bool,
    ) -> Option<usize> {
        self.joints.update(map, space, &mut self.tools.strides);
        self.gates.clear();
        let far = JointGate {
            length: f64::INFINITY,
            before: 0,
            is_done: false,
        };
        self.gates.resize(2 * self.joints.all.len(), far);
        self.n_entries = 0;
        let (mut least, mut best) = (f64::INFINITY, None);
        let mut next = Some((start, 0.0, None));
        while let Some((start, offset, via)) = next {
            let at = self.enter(map, space, (start, offset, via), radius, may_pass);
            self.reach_joints(map, at, goal, may_pass);
            if let Some(goal) = goal.filter(|goal| goal.part == start.part) {
                let entry = &self.entries[at];
                let edges = self.joints.edges(goal.part);
                let arrived = self.tools.arrive(map, space, entry, (goal, edges));
                let length = offset + arrived;
                if length < least {
                    (least, best) = (length, Some(at));
                }
            }
            let open = (0..self.gates.len()).filter(|i| !self.gates[*i].is_done);
            let nearest =
                open.min_by(|a, b| self.gates[*a].length.total_cmp(&self.gates[*b].length));
            next = nearest.and_then(|i| {
                let JointGate { length, before, .. } = self.gates[i];
                self.gates[i].is_done = true;
                let (joint, side) = (i / 2, i % 2);
                let (at, floor) = self.joints.all[joint].middle()[side];
                let part = self.joints.all[joint].parts[side];
                let start = Stand { part, at, floor };
                let is_near = length < least && length <= radius;
                is_near.then_some((start, length, Some((joint, side, before))))
            });
        }
        best
    }

    /// Searches the part of a start; returns the index of the entry.
    fn enter(
        &mut self,
        map: &WalkMap,
        space: &Space,
        (start, offset, via): (Stand, f64, Option<(usize, usize, usize)>),
        radius: f64,
        may_pass: &mut impl FnMut(PartId, PortalId) -> bool,
    ) -> usize {
        let (own, layout) = (&map.parts[start.part.idx()], space.layout(start.part));
        let Tools {
            strides, lengths, ..
        } = &mut self.tools;
        let edges = self.joints.edges(start.part);
        own.measure(strides, layout, (start.floor, edges), lengths);
        let at = self.n_entries;
        self.n_entries += 1;
        if self.entries.len() == at {
            self.entries.push(PartEntry {
                start,
                offset,
                via,
                search: LengthSearch::new(),
            });
        }
        let entry = &mut self.entries[at];
        (entry.start, entry.offset, entry.via) = (start, offset, via);
        entry.search.run_from(
            &own.ways,
            own.floors.floor(start.floor).cell,
            own.floors.point(start.floor),
            |place, _| lengths[place],
            radius - offset,
            |exit| may_pass(start.part, exit.portal).then_some(0.0),
        );
        at
    }

    /// Updates the lengths up to the joints of the part just entered.
    fn reach_joints(
        &mut self,
        map: &WalkMap,
        at: usize,
        goal: Option<Stand>,
        may_pass: &mut impl FnMut(PartId, PortalId) -> bool,
    ) {
        let entry = &self.entries[at];
        let part = entry.start.part;
        let own = &map.parts[part.idx()];
        let all = &self.joints.all;
        for (i, joint) in all.iter().enumerate() {
            let Some(side) = joint.parts.iter().position(|p| *p == part) else {
                continue;
            };
            let to = 1 - side;
            // A part with one way in is not a way through.
            let leads_on = |goal: Stand| {
                let is_other =
                    |(k, other): (usize, &Joint)| k != i && other.parts.contains(&joint.parts[to]);
                joint.parts[to] == goal.part || all.iter().enumerate().any(is_other)
            };
            let gate = &mut self.gates[2 * i + to];
            if gate.is_done || !goal.is_none_or(leads_on) {
                continue;
            }
            let floor = joint.middle()[side].1;
            let cell = own.floors.floor(floor).cell;
            let mut length = entry.search.least(&own.ways, cell, &joint.lengths[side]);
            if cell == own.floors.floor(entry.start.floor).cell {
                // The search from the start of this entry.
                length = length.min(self.tools.strides.length(floor));
            }
            let length = entry.offset + length + joint.length;
            if length < gate.length && joint.passed.iter().all(|p| may_pass(p.part, p.portal)) {
                (gate.length, gate.before) = (length, at);
            }
        }
    }

    /// Pulls the legs of the path to a goal, part by part, between the middles of joints.
    fn lay_legs(
        &mut self,
        map: &WalkMap,
        space: &Space,
        last: usize,
        goal: Stand,
        may_pass: &mut impl FnMut(PartId, PortalId) -> bool,
    ) -> Result<(), NoPath> {
        self.n_legs = 0;
        let (mut at, mut goal, mut out) = (last, goal, 0);
        loop {
            let entry = &self.entries[at];
            if self.legs.len() == self.n_legs {
                self.legs.push(PartLeg {
                    part: entry.start.part,
                    bends: Vec::new(),
                    sequence: Vec::new(),
                    opened: Vec::new(),
                    edges: Vec::new(),
                    via: None,
                    first_step: 0,
                    step: 0,
                });
            }
            let leg = &mut self.legs[self.n_legs];
            self.n_legs += 1;
            leg.via = entry.via.map(|(joint, side, _)| (joint, side));
            let middle = |joint: usize| self.joints.all[joint].steps.len() / 2;
            leg.first_step = leg.via.map_or(0, |(joint, _)| middle(joint));
            leg.step = out;
            out = leg.first_step;
            leg.edges.clear();
            leg.edges
                .extend_from_slice(self.joints.edges(entry.start.part));
            if !self.tools.lay_leg(map, space, entry, goal, may_pass, leg) {
                return Err(NoPath::NoWay);
            }
            let Some((joint, side, before)) = entry.via else {
                break;
            };
            let joint = &self.joints.all[joint];
            let (point, floor) = joint.middle()[1 - side];
            goal = Stand {
                part: joint.parts[1 - side],
                at: point,
                floor,
            };
            at = before;
        }
        self.legs[..self.n_legs].reverse();
        Ok(())
    }

    /// Moves the steps across joints sideways, by halving, as long as that makes the path shorter.
    fn tighten(
        &mut self,
        map: &WalkMap,
        space: &Space,
        may_pass: &mut impl FnMut(PartId, PortalId) -> bool,
    ) {
        for _ in 0..ROUNDS.min(self.n_legs - 1) {
            for i in 1..self.n_legs {
                let (before, behind) = self.legs.split_at_mut(i);
                let (before, behind) = (&mut before[i - 1], &mut behind[0]);
                let Some((joint, side)) = behind.via else {
                    continue;
                };
                let joint = &self.joints.all[joint];
                let between = space.between(behind.part, before.part);
                let across = |a: usize, b: usize| {
                    let beyond = between.point(joint.steps[b][side].0);
                    joint.steps[a][1 - side].0.distance(beyond)
                };
                let [mut from, mut to] = [before.step, behind.first_step];
                let ends = [length_of(&before.bends), length_of(&behind.bends)];
                let mut least = ends[0] + across(from, to) + ends[1];
                let mut by = joint.steps.len() / 2;
                while by > 0 {
                    let mut is_shorter = false;
                    for [x, y] in MOVES {
                        let last = joint.steps.len() as isize - 1;
                        let moved = |at: usize, sign: isize| {
                            (at as isize + sign * by as isize).clamp(0, last) as usize
                        };
                        let (a, b) = (moved(from, x), moved(to, y));
                        if (a, b) == (from, to) {
                            continue;
                        }
                        let [near, far] = &mut self.tools.tried;
                        let step = joint.steps[a][1 - side];
                        let first = before.with_end(map, (step, true), may_pass, near);
                        let step = joint.steps[b][side];
                        let second = behind.with_end(map, (step, false), may_pass, far);
                        let length = first + across(a, b) + second;
                        if length < least - 1e-6 {
                            (least, from, to, is_shorter) = (length, a, b, true);
                            std::mem::swap(&mut before.bends, near);
                            std::mem::swap(&mut behind.bends, far);
                        }
                    }
                    if !is_shorter {
                        by /= 2;
                    }
                }
                (before.step, behind.first_step) = (from, to);
            }
        }
    }

    /// Writes the legs with their portals, and with bends where the floor rises or falls.
    fn write(&mut self, map: &WalkMap, space: &Space, path: &mut Path) {
        for i in 0..self.n_legs {
            let leg = &self.legs[i];
            if let Some((joint, side)) = leg.via {
                let joint = &self.joints.all[joint];
                write_step(space, joint, side, leg.bends[0].0, path);
            }
            let own = &map.parts[leg.part.idx()];
            self.tools.write(own, leg, path);
        }
        for w in path.points.windows(2) {
            let way = space.between(w[1].part, w[0].part).point(w[1].at) - w[0].at;
            path.length += way.length();
            path.length_in_plan += way.with_y(0.0).length();
        }
    }
}

fn length_of(bends: &[Bend]) -> f64 {
    bends.windows(2).map(|w| w[0].0.distance(w[1].0)).sum()
}

/// Adds the portals of a step across a joint, from the last point of a path to a point of the next part.
fn write_step(space: &Space, joint: &Joint, side: usize, to: DVec3, path: &mut Path) {
    let Some(from) = path.points.last().copied() else {
        return;
    };
    let to = space.between(joint.parts[side], from.part).point(to);
    let mut add = |i: usize| {
        let passed = &joint.passed[i];
        let share = if side == 1 {
            passed.share
        } else {
            1.0 - passed.share
        };
        path.portals.push(PathPortal {
            part: passed.part,
            exit: Exit {
                portal: passed.portal,
                to: passed.cells[side],
            },
            at: space
                .between(from.part, passed.part)
                .point(from.at.lerp(to, share)),
        });
    };
    if side == 1 {
        (0..joint.passed.len()).for_each(&mut add);
    } else {
        (0..joint.passed.len()).rev().for_each(&mut add);
    }
}

impl PartLeg {
    /// Writes its bends with another end, its last or its first, pulled taut; returns their length, infinite if there is none.
    fn with_end(
        &self,
        map: &WalkMap,
        (step, is_last): (Bend, bool),
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
    fn rule<'a>(
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
    fn arrive(
        &mut self,
        map: &WalkMap,
        space: &Space,
        entry: &PartEntry,
        (goal, edges): (Stand, &[u32]),
    ) -> f64 {
        let (own, layout) = (&map.parts[goal.part.idx()], space.layout(goal.part));
        own.measure(
            &mut self.strides,
            layout,
            (goal.floor, edges),
            &mut self.lengths,
        );
        // For the start, if it is in the same cell.
        self.lengths.push(self.strides.length(entry.start.floor));
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
    fn lay_leg(
        &mut self,
        map: &WalkMap,
        space: &Space,
        entry: &PartEntry,
        goal: Stand,
        may_pass: &mut impl FnMut(PartId, PortalId) -> bool,
        leg: &mut PartLeg,
    ) -> bool {
        let (own, layout) = (&map.parts[goal.part.idx()], space.layout(goal.part));
        let start = entry.start;
        self.arrive(map, space, entry, (goal, &leg.edges));
        leg.part = goal.part;
        let mut least = f64::INFINITY;
        for i in 0..self.arrivals.len() {
            let arrival = self.arrivals[i];
            if !self.lay_out(own, layout, entry, (goal.floor, &leg.edges), &arrival) {
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
    fn lay_out(
        &mut self,
        own: &PartMap,
        layout: &Layout,
        entry: &PartEntry,
        (goal, edges): (u32, &[u32]),
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
        self.floors.push(entry.start.floor);
        let mut at = entry.start.floor;
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
    fn set_bends(&mut self, own: &PartMap, [first, last]: [Bend; 2]) {
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
    fn write(&mut self, own: &PartMap, leg: &PartLeg, path: &mut Path) {
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
            let end = walk_straight(floors, start, b, &mut |_| true, |from, direction, to| {
                let middle = (floors.point(from) + floors.point(to)) * 0.5 - a;
                let t = middle.with_y(0.0).dot(along) / along.length_squared();
                let at = up(a + along * t.clamp(0.0, 1.0), to);
                self.profile.push(at);
                if let Some(portal) = floors.portal_of(from, direction) {
                    let to = floors.floor(to).cell;
                    let exit = Exit { portal, to };
                    path.portals.push(PathPortal { part, exit, at });
                }
            });
            debug_assert!(end.is_some(), "{a} {b}");
            self.profile.push(b);
            self.keep_profile(0.5 * floors.walker().step, part, &mut path.points);
        }
    }

    /// Adds the points of the profile, except the first, needed for heights exact to `most` (Douglas & Peucker 1973).
    fn keep_profile(&mut self, most: f64, part: PartId, points: &mut Vec<PathPoint>) {
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
