//! The flood of a body through cells: finds the triangles that it may touch on its way.
//!
//! Cells are taken in the order in which the body reaches them: its own first, others when it first touches an opening to
//! them, and a cell's triangles count from then on. So the order of portals does not matter, and a cell reached only after the
//! impact is never searched. The queue is searched linearly, since a body touches few openings: O(log n) for each cell's tree,
//! and O(k²) for k cells.
//!
//! Rooms that move: the body is followed in the frame of each part that it reaches. In a cell in which parts stand, it may meet
//! them from outside: their outdoor cells are reached when it meets their boxes. It leaves a part through a door into the places to
//! which the door leads, and into the cells behind the doors that it meets, as far as these are within the docking tolerance.
//!
//! In a cell, triangles are tested in the order in which the body's bounding box touches their boxes, so that those behind the
//! impact are not tested at all. They are gathered first, [`BATCH`] at a time, which bounds the work behind it.

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::{Aabb, DMat3, DVec3, Ray, Triangle};
use enfilade_runtime::{DetailId, Target};

use super::body::{Body, BodyCore};
use super::kernel::{boxes_meet, sweep};
use crate::space::walls::TriangleOf;
use crate::space::{PartId, Place, Space};

/// Impacts within this fraction of the motion are simultaneous.
const SAME: f64 = 1e-12;
/// Triangles gathered before they are tested. 32 is more than most rooms have on a body's way.
const BATCH: usize = 32;

/// Cost of a query.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CastCounts {
    /// Cells whose trees were queried.
    pub cells: u32,
    /// Candidates: triangles of obstacles that were tried one by one. All whose boxes the box around the body touches before the
    /// impact, and a few behind it.
    pub triangles: u32,
    /// Triangles of openings tested.
    pub openings: u32,
}

/// Follows a body from cell to cell. Holds the buffers.
#[derive(Clone, Debug)]
pub(super) struct BodyFlood {
    /// Per cell of all parts.
    reached: Vec<Reached>,
    question: u32,
    waiting: Vec<Place>,
    places: Vec<Place>,
    gathered: Vec<Gathered>,
    /// Doors to the surroundings of the current part that the body touches, with the times.
    left_by: Vec<(PortalId, f64)>,
    /// The body in the frames of the parts that it has met.
    moving: Vec<(PartId, Moving)>,
    counts: CastCounts,
}

/// The time at which a cell was reached, and the query.
#[derive(Clone, Copy, Debug, Default)]
struct Reached {
    question: u32,
    is_done: bool,
    since: f64,
}

/// A body in the frame of a part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moving {
    body: Body,
    pub(super) core: BodyCore,
    reach: DVec3,
    /// The same, grown by the tolerance of openings.
    grown: BodyCore,
    grown_reach: DVec3,
    from: DVec3,
    pub(super) by: DVec3,
}

/// A triangle on the way: the time at which the boxes meet, and its vertices relative to the body's position on entering the
/// cell.
#[derive(Clone, Copy, Debug)]
struct Gathered {
    enter: f64,
    order: u32,
    /// The portal whose opening it is part of, and the cell behind.
    opens_to: Option<(PortalId, CellId)>,
    /// The obstacle, if it is one.
    target: Option<Target>,
    corners: Triangle,
}

/// An obstacle on the way: its place, its target, its vertices relative to the body's position at `since`, and the body, both in
/// the frame of the place's part.
pub(super) struct Candidate<'a> {
    pub(super) place: Place,
    pub(super) moving: &'a Moving,
    pub(super) target: Target,
    pub(super) corners: &'a Triangle,
    pub(super) since: f64,
}

/// A motion of a body in the frame of a part.
pub(super) struct Motion<'a> {
    pub(super) space: &'a Space,
    pub(super) body: &'a Body,
    pub(super) frame: PartId,
    pub(super) from: DVec3,
    pub(super) by: DVec3,
    pub(super) place: Place,
}

/// A place that the body is in from `since` on, and the rest of its motion then.
struct Stay {
    place: Place,
    /// The cell that stands for the surroundings of the part.
    border: Option<CellId>,
    since: f64,
    start: DVec3,
    left: f64,
    /// True if an impact determines `left`.
    is_met: bool,
}

impl BodyFlood {
    pub(super) fn new() -> Self {
        Self {
            reached: Vec::new(),
            question: 0,
            waiting: Vec::new(),
            places: Vec::new(),
            gathered: Vec::with_capacity(BATCH),
            left_by: Vec::new(),
            moving: Vec::new(),
            counts: CastCounts::default(),
        }
    }

    /// Returns the places of the last query in the order in which they were reached.
    pub(super) fn places(&self) -> &[Place] {
        &self.places
    }

    /// Returns its cost.
    pub(super) fn counts(&self) -> CastCounts {
        self.counts
    }

    /// Calls `visit` for each obstacle whose box the moving body's box touches, with the time left, which it may lower. A motion
    /// that is not finite meets nothing.
    pub(super) fn run(
        &mut self,
        motion: &Motion<'_>,
        mut counts: impl FnMut(PartId, DetailId) -> bool,
        mut visit: impl FnMut(&Candidate<'_>, &mut f64),
    ) {
        let Motion { space, place, .. } = *motion;
        self.begin(space);
        if !motion.is_finite() {
            return;
        }
        self.reach(space, place, 0.0);
        let (mut limit, mut is_met) = (1.0, false);
        while let Some((place, since)) = self.next_place(space, limit) {
            self.places.push(place);
            let moving = self.moving_in(motion, place.part);
            let mut stay = Stay {
                place,
                border: space.parts[place.part.idx()].border,
                since,
                start: moving.from + moving.by * since,
                left: limit - since,
                is_met,
            };
            self.gather_walls(space, &moving, &mut stay, &mut visit);
            self.gather_objects(space, &moving, &mut stay, &mut counts, &mut visit);
            self.try_gathered(space, &moving, &mut stay, &mut visit);
            self.leave(motion, &stay);
            self.meet_guests(motion, &stay);
            (limit, is_met) = (since + stay.left, stay.is_met);
        }
        self.counts.cells = self.places.len() as u32;
    }

    fn begin(&mut self, space: &Space) {
        self.question = self.question.wrapping_add(1);
        if self.question == 0 {
            self.reached.fill(Reached::default());
            self.question = 1;
        }
        self.reached.resize(space.n_cells(), Reached::default());
        self.waiting.clear();
        self.places.clear();
        self.moving.clear();
        self.counts = CastCounts::default();
    }

    /// Returns the body in the frame of a part.
    fn moving_in(&mut self, motion: &Motion<'_>, part: PartId) -> Moving {
        if let Some((_, known)) = self.moving.iter().find(|(p, _)| *p == part) {
            return *known;
        }
        let moving = Moving::new(motion, part);
        self.moving.push((part, moving));
        moving
    }

    fn index(space: &Space, place: Place) -> usize {
        space.parts[place.part.idx()].first_cell as usize + place.cell.idx()
    }

    /// Records that a place is reached.
    fn reach(&mut self, space: &Space, place: Place, since: f64) {
        let known = &mut self.reached[Self::index(space, place)];
        if known.question == self.question {
            if !known.is_done {
                known.since = known.since.min(since);
            }
            return;
        }
        *known = Reached {
            question: self.question,
            is_done: false,
            since,
        };
        self.waiting.push(place);
    }

    fn is_done(&self, space: &Space, place: Place) -> bool {
        let known = &self.reached[Self::index(space, place)];
        known.question == self.question && known.is_done
    }

    /// Returns `true` if the cell behind an opening is searched already, and nothing beyond it remains to be found.
    fn is_behind_done(&self, space: &Space, stay: &Stay, cell: CellId) -> bool {
        let part = stay.place.part;
        stay.border != Some(cell) && self.is_done(space, Place { part, cell })
    }

    /// Returns the place reached next, with its time; none that is reached after `limit`.
    fn next_place(&mut self, space: &Space, limit: f64) -> Option<(Place, f64)> {
        let since = |p: &Place| self.reached[Self::index(space, *p)].since;
        let order = |&(_, a): &(usize, &Place), &(_, b): &(usize, &Place)| {
            since(a).total_cmp(&since(b)).then(a.cmp(b))
        };
        let (at, _) = self.waiting.iter().enumerate().min_by(order)?;
        let place = self.waiting.swap_remove(at);
        let known = &mut self.reached[Self::index(space, place)];
        known.is_done = true;
        (known.since <= limit).then_some((place, known.since))
    }

    /// Continues beyond the doors by which the body leaves its part.
    fn leave(&mut self, motion: &Motion<'_>, stay: &Stay) {
        let space = motion.space;
        let own = &space.parts[stay.place.part.idx()];
        let mut left_by = std::mem::take(&mut self.left_by);
        for (portal, since) in left_by.drain(..) {
            let Some(door) = own.doors.iter().find(|d| d.portal == portal) else {
                continue;
            };
            for &place in &door.leads_to {
                self.reach(space, place, since);
            }
            for &(other, portal) in &door.meets {
                self.dock(motion, other, portal, since);
            }
        }
        self.left_by = left_by;
    }

    /// Continues behind a door of another part, from `since` on: through the prism between both doors.
    fn dock(&mut self, motion: &Motion<'_>, other: PartId, portal: PortalId, since: f64) {
        let space = motion.space;
        let its = &space.parts[other.idx()];
        let Some(door) = its.doors.iter().find(|d| d.portal == portal) else {
            return;
        };
        let moving = self.moving_in(motion, other);
        let opening = its.layout.opening(portal);
        let grown = BodyCore::of(&moving.body.grown(space.docking.depth(opening.radius())));
        let start = moving.from + moving.by * since;
        let triangles = opening.pieces().flat_map(|piece| {
            (2..piece.len()).map(move |k| [0, k - 1, k].map(|i| piece[i] - start))
        });
        let touches = triangles.filter_map(|t| sweep(&grown, moving.by, 1.0 - since, &t));
        let first = touches.map(|touch| touch.t).min_by(f64::total_cmp);
        if let Some(after) = first {
            let part = other;
            let inner = Place {
                part,
                cell: door.inner,
            };
            self.reach(space, inner, since + after);
            if let Some(cell) = its.border {
                self.reach(space, Place { part, cell }, since + after);
            }
        }
    }

    /// Reaches the parts that stand in a place, from outside, when the body meets their boxes.
    fn meet_guests(&mut self, motion: &Motion<'_>, stay: &Stay) {
        let space = motion.space;
        let own = &space.parts[stay.place.part.idx()];
        for &part in &own.guests[stay.place.cell.idx()] {
            let its = &space.parts[part.idx()];
            let Some(cell) = its.border else { continue };
            let moving = self.moving_in(motion, part);
            let start = moving.from + moving.by * stay.since;
            let hull = its.hull.expanded(its.layout.tolerance());
            let bounds = Aabb::new(hull.min - start, hull.max - start);
            if let Some(after) = boxes_meet(moving.grown_reach, moving.by, stay.left, &bounds) {
                self.reach(space, Place { part, cell }, stay.since + after.max(0.0));
            }
        }
    }

    /// Gathers structural triangles and openings of one cell.
    fn gather_walls(
        &mut self,
        space: &Space,
        moving: &Moving,
        stay: &mut Stay,
        visit: &mut impl FnMut(&Candidate<'_>, &mut f64),
    ) {
        let Place { part, cell } = stay.place;
        let (all, state) = (space.walls(part), space.state(part));
        let walls = &all.cells[cell.idx()];
        let ray = moving.ray(stay.start, stay.left);
        walls
            .bvh
            .for_each_swept(&ray, moving.grown_reach, |i, t, t_max| {
                let shut = |portal: u32| {
                    let portal = PortalId(portal);
                    (!state.is_open(portal)).then_some(Target::Portal(portal))
                };
                let (mut opens_to, mut reach) = (None, moving.reach);
                let target = match walls.surfaces[i as usize] {
                    TriangleOf::Wall { batch, triangle } => Some(Target::Wall { batch, triangle }),
                    TriangleOf::Opening { portal, is_panel } => {
                        let [a, b] = all.portal_cells[portal as usize];
                        opens_to = Some((PortalId(portal), if a == cell { b } else { a }));
                        reach = moving.grown_reach;
                        shut(portal).filter(|_| is_panel)
                    }
                    TriangleOf::Panel { portal } => shut(portal),
                };
                let is_way = |(_, to)| !self.is_behind_done(space, stay, to);
                if target.is_some() || opens_to.is_some_and(is_way) {
                    let corners = t.map(|p| p - stay.start);
                    let what = (opens_to, target);
                    self.gather(space, what, (&corners, reach), moving, stay, visit);
                    *t_max = t_max.min(stay.left);
                }
            });
    }

    /// Gathers the objects of one cell.
    fn gather_objects(
        &mut self,
        space: &Space,
        moving: &Moving,
        stay: &mut Stay,
        counts: &mut impl FnMut(PartId, DetailId) -> bool,
        visit: &mut impl FnMut(&Candidate<'_>, &mut f64),
    ) {
        let Place { part, cell } = stay.place;
        let (all, state) = (space.walls(part), space.state(part));
        let walls = &all.cells[cell.idx()];
        let start = stay.start;
        let ends = Aabb::of_points(&[start, start + moving.by * stay.left]);
        let way = Aabb::new(ends.min - moving.reach, ends.max + moving.reach);
        walls.tree.for_each_in_box(&way, |slot| {
            let detail = walls.details[slot as usize];
            let Some(placed) = &all.placed[detail as usize] else {
                return;
            };
            let bounds = Aabb::new(placed.bounds.min - start, placed.bounds.max - start);
            let meet = boxes_meet(moving.reach, moving.by, stay.left, &bounds);
            if meet.is_none() || !counts(part, DetailId(detail)) {
                return;
            }
            let (mut to_world, mut to_mesh) = (placed.to_world, placed.to_mesh);
            let pose = placed.is_leaf.then(|| state.pose(DetailId(detail)));
            if let Some(pose) = pose.flatten() {
                to_world = pose * to_world;
                to_mesh *= pose.inverse();
            }
            let mesh = &all.meshes[placed.mesh as usize];
            let reach = moving.core.reach_in(&DMat3::from_mat4(to_mesh)) * (1.0 + 1e-9);
            let ray = Ray {
                origin: to_mesh.transform_point3(start),
                direction: to_mesh.transform_vector3(moving.by),
                t_max: stay.left,
            };
            mesh.bvh.for_each_swept(&ray, reach, |i, t, t_max| {
                let corners = t.map(|p| to_world.transform_point3(p) - start);
                let (primitive, triangle) = mesh.named(i);
                let target = Target::Detail {
                    detail: DetailId(detail),
                    primitive,
                    triangle,
                };
                let what = (None, Some(target));
                self.gather(space, what, (&corners, moving.reach), moving, stay, visit);
                *t_max = t_max.min(stay.left);
            });
        });
    }

    /// Gathers a triangle if the boxes meet; tests the gathered ones when there are enough.
    #[inline]
    fn gather(
        &mut self,
        space: &Space,
        (opens_to, target): (Option<(PortalId, CellId)>, Option<Target>),
        (corners, reach): (&Triangle, DVec3),
        moving: &Moving,
        stay: &mut Stay,
        visit: &mut impl FnMut(&Candidate<'_>, &mut f64),
    ) {
        let bounds = Aabb::of_points(corners);
        let meet = |reach| boxes_meet(reach, moving.by, stay.left, &bounds);
        let Some(mut enter) = meet(reach) else {
            return;
        };
        // The growth of an opening matters for passing along it, not for stopping right there.
        if opens_to.is_some() {
            enter = meet(moving.reach).unwrap_or(enter);
        }
        if self.gathered.len() == BATCH {
            self.try_gathered(space, moving, stay, visit);
        }
        self.gathered.push(Gathered {
            enter,
            order: self.gathered.len() as u32,
            opens_to,
            target,
            corners: *corners,
        });
    }

    /// Tests the gathered triangles, near to far, while any of the motion is left.
    fn try_gathered(
        &mut self,
        space: &Space,
        moving: &Moving,
        stay: &mut Stay,
        visit: &mut impl FnMut(&Candidate<'_>, &mut f64),
    ) {
        // Obstacles first: they may make the openings beside them unnecessary.
        let rank = |a: &Gathered| (a.target.is_none(), a.order);
        self.gathered
            .sort_unstable_by(|a, b| a.enter.total_cmp(&b.enter).then(rank(a).cmp(&rank(b))));
        for i in 0..self.gathered.len() {
            let it = self.gathered[i];
            // One of several coplanar walls is enough, though rounding may separate them.
            let rounding = if stay.is_met { SAME } else { 0.0 };
            if it.enter > stay.left - rounding {
                break;
            }
            let is_way = |to: &(PortalId, CellId)| !self.is_behind_done(space, stay, to.1);
            if let Some((portal, cell)) = it.opens_to.filter(is_way) {
                self.counts.openings += 1;
                if let Some(touch) = sweep(&moving.grown, moving.by, stay.left, &it.corners) {
                    let (part, since) = (stay.place.part, stay.since + touch.t);
                    self.reach(space, Place { part, cell }, since);
                    if stay.border == Some(cell) {
                        self.left_by.push((portal, since));
                    }
                }
            }
            if let Some(target) = it.target {
                self.counts.triangles += 1;
                let candidate = Candidate {
                    place: stay.place,
                    moving,
                    target,
                    corners: &it.corners,
                    since: stay.since,
                };
                let before = stay.left;
                visit(&candidate, &mut stay.left);
                stay.is_met |= stay.left < before;
            }
        }
        self.gathered.clear();
    }
}

impl<'a> Motion<'a> {
    /// Makes a body at rest.
    pub(super) fn rest(
        space: &'a Space,
        body: &'a Body,
        (frame, at): (PartId, DVec3),
        place: Place,
    ) -> Self {
        Self {
            space,
            body,
            frame,
            from: at,
            by: DVec3::ZERO,
            place,
        }
    }

    fn is_finite(&self) -> bool {
        self.body.is_finite() && self.from.is_finite() && self.by.is_finite()
    }
}

impl Moving {
    fn new(motion: &Motion<'_>, part: PartId) -> Self {
        let (mut body, mut from, mut by) = (*motion.body, motion.from, motion.by);
        if part != motion.frame {
            let to = motion.space.between(motion.frame, part);
            (body, from, by) = (body.turned(&to), to.point(from), to.direction(by));
        }
        let core = BodyCore::of(&body);
        let tolerance = motion.space.layout(part).tolerance();
        let grown = BodyCore::of(&body.grown(tolerance));
        Self {
            body,
            core,
            reach: core.reach(),
            grown,
            grown_reach: grown.reach(),
            from,
            by,
        }
    }

    fn ray(&self, start: DVec3, t_max: f64) -> Ray {
        Ray {
            origin: start,
            direction: self.by,
            t_max,
        }
    }
}
