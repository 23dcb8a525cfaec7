//! Joints: where walkers step from a part into another, through the doors between them.
//!
//! Floors end at a part's doors. A joint leads across: steps side by side, each from the last floor of one part to the first of
//! the other, free for the walker's body in the space of that instant. Both are at a drop, as far as their own part knows, so
//! walkers keep away from them, but not while a joint leads over it. A part that moves has its own joints found anew, and no others: O(steps) for each of its doors.

use std::sync::Arc;

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::{Aabb, DVec3};
use enfilade_runtime::DetailId;

use super::floors::{Floors, is_walked};
use super::pull::Bend;
use super::strides::Strides;
use super::walk_map::{PartMap, WalkMap};
use crate::bodies::{Caster, is_free_between};
use crate::layout::{Layout, LayoutExit};
use crate::shape::is_near;
use crate::space::{PartId, Space};

/// Widest gap between a door and the floor before or behind it. [Units: squares of the floors]
const GAP: usize = 2;
/// Most portals that a step passes.
const MOST_PORTALS: usize = 4;

/// A way from the floors of a part to those of another.
#[derive(Clone, Debug)]
pub(super) struct Joint {
    pub(super) parts: [PartId; 2],
    /// Steps across, side by side: a point of a floor of either part, in its own frame.
    pub(super) steps: Vec<[Bend; 2]>,
    /// Portals from the first part to the second, in order.
    pub(super) passed: Vec<PassedDoor>,
    /// Per part, lengths from the middle step to the points of its cell.
    pub(super) lengths: [Vec<f64>; 2],
    /// Per part, the floors beside the drop at the door.
    edges: [Vec<u32>; 2],
    /// Length of the middle step. [Units: wu]
    pub(super) length: f64,
}

/// A portal passed by a step: the cells before and behind it, and the share of the step passed there.
#[derive(Clone, Copy, Debug)]
pub(super) struct PassedDoor {
    pub(super) part: PartId,
    pub(super) portal: PortalId,
    pub(super) cells: [CellId; 2],
    pub(super) share: f64,
}

impl Joint {
    /// Returns the step in the middle.
    pub(super) fn middle(&self) -> [Bend; 2] {
        self.steps[self.steps.len() / 2]
    }
}

/// The joints of a space for a map.
#[derive(Clone, Debug, Default)]
pub(super) struct Joints {
    pub(super) all: Vec<Joint>,
    /// Per part, floors beside drops that joints lead over, ascending.
    edges: Vec<Vec<u32>>,
    /// The map for which they are.
    parts: Option<Arc<Vec<Arc<PartMap>>>>,
    /// The last change of the space that they know.
    known: Option<u64>,
    moved: Vec<bool>,
    caster: Caster,
    passed: Vec<PassedDoor>,
}

impl Joints {
    /// Finds the joints of parts that have moved.
    pub(super) fn update(&mut self, map: &WalkMap, space: &Space, strides: &mut Strides) {
        let known = self.parts.as_ref();
        if !known.is_some_and(|parts| Arc::ptr_eq(parts, &map.parts)) {
            (self.parts, self.known) = (Some(map.parts.clone()), None);
        }
        if !space.moved_since(&mut self.known, &mut self.moved) {
            return;
        }
        let moved = &self.moved;
        let has_moved = |part: PartId| moved.get(part.idx()).copied().unwrap_or(true);
        (self.all).retain(|joint| !joint.parts.map(has_moved).contains(&true));
        for part in (1..map.parts.len().min(space.n_parts()) as u32).map(PartId) {
            for door in 0..space.parts[part.idx()].doors.len() {
                if self.moved[part.idx()] {
                    self.add_door(map, space, part, door);
                }
            }
        }
        self.measure(map, space, strides);
    }

    /// Adds the joints of a door to its surroundings.
    fn add_door(&mut self, map: &WalkMap, space: &Space, part: PartId, door: usize) {
        let door = &space.parts[part.idx()].doors[door];
        let is_known = |other: PartId| other.idx() < map.parts.len();
        let hosts = door.leads_to.iter().map(|place| place.part);
        for (i, other) in hosts.enumerate() {
            let before = &door.leads_to[..i];
            if is_known(other) && before.iter().all(|place| place.part != other) {
                self.join(map, space, [part, other], [Some(door.portal), None]);
            }
        }
        for &(other, portal) in &door.meets {
            // If both have moved, once.
            if is_known(other) && (!self.moved[other.idx()] || part < other) {
                let doors = [door.portal, portal].map(Some);
                self.join(map, space, [part, other], doors);
            }
        }
    }

    /// Adds the joints through a door of a part to another, through a door of that if they meet.
    fn join(
        &mut self,
        map: &WalkMap,
        space: &Space,
        parts: [PartId; 2],
        doors: [Option<PortalId>; 2],
    ) {
        let all_walked = (parts.iter().zip(doors))
            .all(|(part, door)| door.is_none_or(|door| is_walked(space.world(*part), door)));
        let [Some(door), beyond] = doors else {
            return;
        };
        let own = &space.parts[parts[0].idx()];
        let opening = own.layout.opening(door);
        let is_first = own.border == Some(opening.cells()[1]);
        let out = if is_first { 1.0 } else { -1.0 } * opening.normal().with_y(0.0);
        // A hatch is not walked through.
        if !all_walked || out.length() < 0.5 {
            return;
        }
        let out = out.normalize();
        let along = DVec3::Y.cross(out);
        let sill = opening.center().with_y(opening.bounds().min.y);
        let range = opening.pieces().flatten().map(|p| along.dot(*p - sill));
        let low = range.clone().fold(f64::INFINITY, f64::min);
        let high = range.fold(f64::NEG_INFINITY, f64::max);
        let side = map.floors(parts[0]).side().min(map.floors(parts[1]).side());
        let n = ((high - low) / side).ceil().clamp(1.0, 4096.0) as usize;
        let first = self.all.len();
        let mut is_beside = false;
        for k in 0..=n {
            let at = sill + along * (low + (high - low) * k as f64 / n as f64);
            let Some(step) = self.step(map, space, parts, [Some(door), beyond], [at, out]) else {
                is_beside = false;
                continue;
            };
            let key = |p: &PassedDoor| (p.part, p.portal, p.cells);
            let last = self.all.last_mut().filter(|_| is_beside);
            let passed = &self.passed;
            match last.filter(|joint| joint.passed.iter().map(key).eq(passed.iter().map(key))) {
                Some(joint) => joint.steps.push(step),
                None => self.all.push(Joint {
                    parts,
                    steps: vec![step],
                    passed: passed.clone(),
                    lengths: [Vec::new(), Vec::new()],
                    edges: [Vec::new(), Vec::new()],
                    length: 0.0,
                }),
            }
            is_beside = true;
        }
        let (to_other, side) = (space.between(parts[0], parts[1]), 2.0 * side);
        let corners = opening.bounds().corners().map(|p| to_other.point(p));
        let bounds = [*opening.bounds(), Aabb::of_points(&corners)];
        for joint in &mut self.all[first..] {
            for k in 0..2 {
                let floors = map.floors(parts[k]);
                floors.add_edges(
                    &bounds[k],
                    floors.walker().radius + side,
                    &mut joint.edges[k],
                );
            }
        }
    }

    /// Gathers the edges that joints lead over, and measures the new joints.
    fn measure(&mut self, map: &WalkMap, space: &Space, strides: &mut Strides) {
        self.edges.iter_mut().for_each(Vec::clear);
        self.edges.resize(map.parts.len(), Vec::new());
        for joint in &self.all {
            for (part, edges) in joint.parts.iter().zip(&joint.edges) {
                self.edges[part.idx()].extend_from_slice(edges);
            }
        }
        for edges in &mut self.edges {
            edges.sort_unstable();
            edges.dedup();
        }
        for joint in self.all.iter_mut().filter(|joint| joint.length == 0.0) {
            let (parts, middle) = (joint.parts, joint.middle());
            let beyond = space.between(parts[1], parts[0]).point(middle[1].0);
            joint.length = middle[0].0.distance(beyond);
            for k in 0..2 {
                let (own, layout) = (&map.parts[parts[k].idx()], space.layout(parts[k]));
                let from = (middle[k].1, &self.edges[parts[k].idx()][..]);
                own.measure(strides, layout, from.0, from.1, &mut joint.lengths[k]);
            }
        }
    }

    /// Returns the floors of a part beside drops that joints lead over, ascending.
    pub(super) fn edges(&self, part: PartId) -> &[u32] {
        self.edges.get(part.idx()).map_or(&[], |edges| edges)
    }

    /// Returns a step outwards over a point of a sill, if a walker can take it; sets the portals passed.
    fn step(
        &mut self,
        map: &WalkMap,
        space: &Space,
        parts: [PartId; 2],
        [door, beyond]: [Option<PortalId>; 2],
        [at, out]: [DVec3; 2],
    ) -> Option<[Bend; 2]> {
        let floors = parts.map(|part| map.floors(part));
        let to_other = space.between(parts[0], parts[1]);
        let (at_other, out_other) = (to_other.point(at), to_other.direction(out));
        let ends = [
            floor_near(floors[0], at, -out)?,
            floor_near(floors[1], at_other, out_other)?,
        ];
        let agent = floors[0].walker();
        let line = [ends[0].0, to_other.inverse().point(ends[1].0)];
        if (line[1].y - line[0].y).abs() > agent.step {
            return None;
        }
        let cells = [0, 1].map(|k| floors[k].floor(ends[k].1).cell);
        let [own, other] = parts.map(|part| &space.parts[part.idx()]);
        self.passed.clear();
        let door = own.doors.iter().find(|d| Some(d.portal) == door)?;
        let share = out.dot(at - line[0]) / out.dot(line[1] - line[0]).max(1e-9);
        let share = share.clamp(0.0, 1.0);
        self.passed.push(PassedDoor {
            part: parts[0],
            portal: door.portal,
            cells: [door.inner, own.border?],
            share,
        });
        // At half the height of a walker, doors are open.
        let up = DVec3::Y * 0.5 * agent.height;
        let way = |t: f64| to_other.point(line[0].lerp(line[1], t) + up);
        let is_there = if let Some(portal) = beyond {
            let its = other.doors.iter().find(|d| d.portal == portal)?;
            self.passed.push(PassedDoor {
                part: parts[1],
                portal,
                cells: [other.border?, its.inner],
                share,
            });
            its.inner == cells[1]
        } else {
            // From where the walker is still at the door: inside, the host may be solid.
            let back = 2.0 * space.docking.gap / line[0].distance(line[1]).max(1e-9);
            let from = (share - back).max(0.0);
            let start = other.layout.locate(way(from));
            let start = start.filter(|c| other.border != Some(*c));
            let around = door.leads_to.iter().filter(|p| p.part == parts[1]);
            let mut starts = start.into_iter().chain(around.map(|p| p.cell));
            let passed = &mut self.passed;
            starts.any(|cell| {
                passed.truncate(1);
                follow(
                    &other.layout,
                    [cell, cells[1]],
                    [way(from), way(1.0)],
                    |portal, cells, t| {
                        passed.push(PassedDoor {
                            part: parts[1],
                            portal,
                            cells,
                            share: from + (1.0 - from) * t,
                        });
                    },
                )
            })
        };
        let is_walked = |p: &PassedDoor| is_walked(space.world(p.part), p.portal);
        // Not where a door's own leaf stands.
        let is_clear = |k: usize| {
            floors[k].leaves_at(ends[k].1).all(|leaf| {
                let mut own = self.passed.iter().filter(|p| p.part == parts[k]);
                own.all(|p| p.portal != leaf)
            })
        };
        let is_way = is_there
            && cells[0] == door.inner
            && self.passed.iter().all(is_walked)
            && is_clear(0)
            && is_clear(1);
        let stops = |part: PartId, detail: DetailId| {
            let stops = map.parts.get(part.idx()).map(|own| &own.stops);
            stops.is_none_or(|stops| stops[detail.0 as usize])
        };
        let is_free =
            is_way && is_free_between(&mut self.caster, space, agent, parts[0], line, stops);
        is_free.then_some(ends)
    }
}

/// Returns the first floor away from a point of a sill that is not cut off from all others of its cell, such as by a gate behind
/// it: the sills of a shaft's gates are in the shaft.
fn floor_near(floors: &Floors, sill: DVec3, away: DVec3) -> Option<Bend> {
    let away = away.with_y(0.0).normalize_or_zero();
    let most = floors.walker().radius / floors.side() + 3.0;
    let mut is_there = false;
    for k in 0..most as usize {
        let p = sill + away * ((k as f64 + 0.5) * floors.side());
        match floors.at(p) {
            Some(floor) if floors.leads_off_edge(floor) => {
                return Some((p.with_y(floors.point(floor).y), floor));
            }
            Some(_) => is_there = true,
            // Not over a hole.
            None if is_there || k >= GAP => return None,
            None => {}
        }
    }
    None
}

/// Follows a line from a cell to another; calls `visit` with each portal passed, the cells before and behind it, and the share
/// of the line passed there. Returns `true` if it leads there.
fn follow(
    layout: &Layout,
    [mut cell, goal]: [CellId; 2],
    [a, b]: [DVec3; 2],
    mut visit: impl FnMut(PortalId, [CellId; 2], f64),
) -> bool {
    let mut passed = f64::NEG_INFINITY;
    for _ in 0..MOST_PORTALS {
        if cell == goal {
            return true;
        }
        let crossing = |exit: &LayoutExit| {
            let opening = layout.opening(exit.portal);
            let heights = [a, b].map(|p| opening.height_of(p));
            let t = heights[0] / (heights[0] - heights[1]);
            let is_passed = (heights[0] > 0.0) != (heights[1] > 0.0) && t > passed;
            let p = a.lerp(b, t);
            let tolerance = layout.tolerance();
            let is_in = is_passed && opening.pieces().any(|c| is_near(&[p], c, tolerance));
            is_in.then_some((t, *exit))
        };
        let crossings = layout.exits(cell).iter().filter_map(crossing);
        let Some((t, exit)) = crossings.min_by(|x, y| x.0.total_cmp(&y.0)) else {
            return false;
        };
        visit(exit.portal, [cell, exit.to], t);
        (cell, passed) = (exit.to, t);
    }
    false
}
