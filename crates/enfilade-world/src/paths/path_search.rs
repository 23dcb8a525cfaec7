//! The search for paths, from part to part.

use enfilade_geom::DVec3;

use super::joints::{Joint, Joints};
use super::legs::{Entrance, PartEntry, PartLeg, Tools, length_of};
use super::search::LengthSearch;
use super::walk_map::{Stand, WalkMap};
use super::{NoPath, Path, PathPortal};
use crate::layout::LayoutExit;
use crate::space::{PartId, Place, Space};
use enfilade_cpg::{CellId, PortalId};

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
    /// a lift that has stopped, and through [voids](enfilade_cpg::Cell::is_void) only if it begins or ends in one. Points are at
    /// the walker's feet, or any height up to its head. [Units: wu]
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
        let start = map
            .stand(space, from.0, from.1)
            .ok_or(NoPath::NoFloorAtStart)?;
        let goal = map.stand(space, to.0, to.1).ok_or(NoPath::NoFloorAtEnd)?;
        let crawls = crawls(map, space, [start, goal]);
        let mut may_pass = |part, portal| {
            let cells = space.layout(part).opening(portal).cells();
            may_pass(part, portal)
                && (crawls || !cells.into_iter().any(|c| is_void(space, part, c)))
        };
        let infinite = f64::INFINITY;
        let last = self.spread(map, space, start, Some(goal), infinite, &mut may_pass);
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
        part: PartId,
        from: DVec3,
        radius: f64,
        mut may_pass: impl FnMut(PartId, PortalId) -> bool,
    ) -> Result<&[(Place, f64)], NoPath> {
        let start = map.stand(space, part, from).ok_or(NoPath::NoFloorAtStart)?;
        self.spread(map, space, start, None, radius, &mut may_pass);
        self.near.clear();
        for entry in &self.entries[..self.n_entries] {
            let part = entry.at.start.part;
            let cells = entry.search.cells().iter();
            (self.near)
                .extend(cells.map(|&(cell, far)| (Place { part, cell }, entry.at.offset + far)));
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
    pub fn distance(
        &mut self,
        map: &WalkMap,
        space: &Space,
        part: PartId,
        to: DVec3,
    ) -> Option<f64> {
        let goal = map.stand(space, part, to)?;
        let mut least = f64::INFINITY;
        let own = self.entries[..self.n_entries].iter();
        for entry in own.filter(|e| e.at.start.part == goal.part) {
            let edges = self.joints.edges(goal.part);
            let length = self.tools.arrive(map, space, entry, goal, edges);
            least = least.min(entry.at.offset + length);
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
        goal: Option<Stand>,
        radius: f64,
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
        let mut next = Some(Entrance {
            start,
            offset: 0.0,
            via: None,
        });
        while let Some(entrance) = next {
            let Entrance { start, offset, .. } = entrance;
            let at = self.enter(map, space, entrance, radius, may_pass);
            self.reach_joints(map, at, goal, may_pass);
            if let Some(goal) = goal.filter(|goal| goal.part == start.part) {
                let entry = &self.entries[at];
                let edges = self.joints.edges(goal.part);
                let arrived = self.tools.arrive(map, space, entry, goal, edges);
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
                is_near.then_some(Entrance {
                    start,
                    offset: length,
                    via: Some((joint, side, before)),
                })
            });
        }
        best
    }

    /// Searches the part of a start; returns the index of the entry.
    fn enter(
        &mut self,
        map: &WalkMap,
        space: &Space,
        entrance: Entrance,
        radius: f64,
        may_pass: &mut impl FnMut(PartId, PortalId) -> bool,
    ) -> usize {
        let Entrance { start, offset, .. } = entrance;
        let (own, layout) = (&map.parts[start.part.idx()], space.layout(start.part));
        let Tools {
            strides, lengths, ..
        } = &mut self.tools;
        let edges = self.joints.edges(start.part);
        own.measure(strides, layout, start.floor, edges, lengths);
        let at = self.n_entries;
        self.n_entries += 1;
        if self.entries.len() == at {
            self.entries.push(PartEntry {
                at: entrance,
                search: LengthSearch::new(),
            });
        }
        let entry = &mut self.entries[at];
        entry.at = entrance;
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
        let part = entry.at.start.part;
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
            if cell == own.floors.floor(entry.at.start.floor).cell {
                // The search from the start of this entry.
                length = length.min(self.tools.strides.length(floor));
            }
            let length = entry.at.offset + length + joint.length;
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
                    part: entry.at.start.part,
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
            leg.via = entry.at.via.map(|(joint, side, _)| (joint, side));
            let middle = |joint: usize| self.joints.all[joint].steps.len() / 2;
            leg.first_step = leg.via.map_or(0, |(joint, _)| middle(joint));
            leg.step = out;
            out = leg.first_step;
            leg.edges.clear();
            leg.edges
                .extend_from_slice(self.joints.edges(entry.at.start.part));
            if !self.tools.lay_leg(map, space, entry, goal, may_pass, leg) {
                return Err(NoPath::NoWay);
            }
            let Some((joint, side, before)) = entry.at.via else {
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
                        let first = before.with_end(map, step, true, may_pass, near);
                        let step = joint.steps[b][side];
                        let second = behind.with_end(map, step, false, may_pass, far);
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

/// Returns `true` if a path from one place to another leads through [voids](enfilade_cpg::Cell::is_void).
pub(super) fn crawls(map: &WalkMap, space: &Space, ends: [Stand; 2]) -> bool {
    let cell = |s: &Stand| map.floors(s.part).floor(s.floor).cell;
    ends.iter().any(|s| is_void(space, s.part, cell(s)))
}

pub(super) fn is_void(space: &Space, part: PartId, cell: CellId) -> bool {
    space.layout(part).cell(cell).is_void
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
            exit: LayoutExit {
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
