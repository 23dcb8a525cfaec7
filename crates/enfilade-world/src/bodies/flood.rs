//! The flood of a body through cells: finds the triangles that it may touch on its way.
//!
//! Cells are taken in the order in which the body reaches them: its own first, others when it first touches an opening to
//! them, and a cell's triangles count from then on. So the order of portals does not matter, and a cell reached only after the
//! impact is never searched. The queue is searched linearly, since a body touches few openings: O(log n) for each cell's tree,
//! and O(k²) for k cells.
//!
//! In a cell, triangles are tested in the order in which the body's bounding box touches their boxes, so that those behind the
//! impact are not tested at all. They are gathered first, [`BATCH`] at a time, which bounds the work behind it.

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::{Aabb, DMat3, DVec3, Ray, Triangle};
use enfilade_runtime::{DetailId, SightState, Target};

use super::body::{Body, BodyCore};
use super::kernel::{boxes_meet, sweep};
use super::walls::{Contacts, TriangleOf};

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
    /// Per cell.
    reached: Vec<Reached>,
    question: u32,
    waiting: Vec<CellId>,
    cells: Vec<CellId>,
    gathered: Vec<Gathered>,
    counts: CastCounts,
}

/// The time at which a cell was reached, and the query.
#[derive(Clone, Copy, Debug, Default)]
struct Reached {
    question: u32,
    is_done: bool,
    since: f64,
}

/// A body prepared for the flood.
pub(super) struct Moving {
    pub(super) core: BodyCore,
    reach: DVec3,
    /// The same, grown by the tolerance of openings.
    grown: BodyCore,
    grown_reach: DVec3,
    from: DVec3,
    by: DVec3,
}

/// A triangle on the way: the time at which the boxes meet, and its vertices relative to the body's position on entering the
/// cell.
#[derive(Clone, Copy, Debug)]
struct Gathered {
    enter: f64,
    order: u32,
    /// The cell that it opens to.
    opens_to: Option<CellId>,
    /// The obstacle, if it is one.
    target: Option<Target>,
    corners: Triangle,
}

/// An obstacle on the way: its cell, its target, and its vertices relative to the body's position at `since`.
pub(super) struct Candidate<'a> {
    pub(super) cell: CellId,
    pub(super) target: Target,
    pub(super) corners: &'a Triangle,
    pub(super) since: f64,
}

/// Constant inputs of a query.
pub(super) struct Question<'a> {
    contacts: &'a Contacts,
    state: &'a SightState,
    moving: &'a Moving,
}

/// A cell that the body is in from `since` on, and the rest of its motion then.
struct Stay {
    cell: CellId,
    since: f64,
    start: DVec3,
    left: f64,
    /// True if an impact determines `left`.
    is_met: bool,
}

impl BodyFlood {
    pub(super) fn new(contacts: &Contacts) -> Self {
        Self {
            reached: vec![Reached::default(); contacts.n_cells()],
            question: 0,
            waiting: Vec::new(),
            cells: Vec::new(),
            gathered: Vec::with_capacity(BATCH),
            counts: CastCounts::default(),
        }
    }

    /// Returns the cells of the last query in the order in which they were reached.
    pub(super) fn cells(&self) -> &[CellId] {
        &self.cells
    }

    /// Returns its cost.
    pub(super) fn counts(&self) -> CastCounts {
        self.counts
    }

    /// Calls `visit` for each obstacle whose box the moving body's box touches, with the time left, which it may lower.
    pub(super) fn run(
        &mut self,
        question: &Question<'_>,
        start: CellId,
        mut counts: impl FnMut(DetailId) -> bool,
        mut visit: impl FnMut(&Candidate<'_>, &mut f64),
    ) {
        let moving = question.moving;
        self.begin();
        self.reach(start, 0.0);
        let (mut limit, mut is_met) = (1.0, false);
        while let Some((cell, since)) = self.next_cell(limit) {
            self.cells.push(cell);
            let mut stay = Stay {
                cell,
                since,
                start: moving.from + moving.by * since,
                left: limit - since,
                is_met,
            };
            self.gather_walls(question, &mut stay, &mut visit);
            self.gather_objects(question, &mut stay, &mut counts, &mut visit);
            self.try_gathered(moving, &mut stay, &mut visit);
            (limit, is_met) = (since + stay.left, stay.is_met);
        }
        self.counts.cells = self.cells.len() as u32;
    }

    fn begin(&mut self) {
        self.question = self.question.wrapping_add(1);
        if self.question == 0 {
            self.reached.fill(Reached::default());
            self.question = 1;
        }
        self.waiting.clear();
        self.cells.clear();
        self.counts = CastCounts::default();
    }

    /// Records that a cell is reached.
    fn reach(&mut self, cell: CellId, since: f64) {
        let known = &mut self.reached[cell.idx()];
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
        self.waiting.push(cell);
    }

    fn is_done(&self, cell: CellId) -> bool {
        let known = &self.reached[cell.idx()];
        known.question == self.question && known.is_done
    }

    /// Returns the cell reached next, with its time; none that is reached after `limit`.
    fn next_cell(&mut self, limit: f64) -> Option<(CellId, f64)> {
        let since = |c: &CellId| self.reached[c.idx()].since;
        let order = |&(_, a): &(usize, &CellId), &(_, b): &(usize, &CellId)| {
            since(a).total_cmp(&since(b)).then(a.cmp(b))
        };
        let (at, _) = self.waiting.iter().enumerate().min_by(order)?;
        let cell = self.waiting.swap_remove(at);
        let known = &mut self.reached[cell.idx()];
        known.is_done = true;
        (known.since <= limit).then_some((cell, known.since))
    }

    /// Gathers structural triangles and openings of one cell.
    fn gather_walls(
        &mut self,
        question: &Question<'_>,
        stay: &mut Stay,
        visit: &mut impl FnMut(&Candidate<'_>, &mut f64),
    ) {
        let Question {
            contacts,
            state,
            moving,
        } = *question;
        let walls = &contacts.cells[stay.cell.idx()];
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
                        let [a, b] = contacts.portal_cells[portal as usize];
                        opens_to = Some(if a == stay.cell { b } else { a });
                        reach = moving.grown_reach;
                        shut(portal).filter(|_| is_panel)
                    }
                    TriangleOf::Panel { portal } => shut(portal),
                };
                if target.is_some() || opens_to.is_some_and(|to| !self.is_done(to)) {
                    let corners = t.map(|p| p - stay.start);
                    self.gather((opens_to, target), &corners, reach, moving, stay, visit);
                    *t_max = t_max.min(stay.left);
                }
            });
    }

    /// Gathers the objects of one cell.
    fn gather_objects(
        &mut self,
        question: &Question<'_>,
        stay: &mut Stay,
        counts: &mut impl FnMut(DetailId) -> bool,
        visit: &mut impl FnMut(&Candidate<'_>, &mut f64),
    ) {
        let Question {
            contacts,
            state,
            moving,
        } = *question;
        let walls = &contacts.cells[stay.cell.idx()];
        let start = stay.start;
        let ends = Aabb::of_points(&[start, start + moving.by * stay.left]);
        let way = Aabb::new(ends.min - moving.reach, ends.max + moving.reach);
        walls.tree.for_each_in_box(&way, |slot| {
            let detail = walls.details[slot as usize];
            let Some(placed) = &contacts.placed[detail as usize] else {
                return;
            };
            let bounds = Aabb::new(placed.bounds.min - start, placed.bounds.max - start);
            let meet = boxes_meet(moving.reach, moving.by, stay.left, &bounds);
            if meet.is_none() || !counts(DetailId(detail)) {
                return;
            }
            let (mut to_world, mut to_mesh) = (placed.to_world, placed.to_mesh);
            let pose = placed.is_leaf.then(|| state.pose(DetailId(detail)));
            if let Some(pose) = pose.flatten() {
                to_world = pose * to_world;
                to_mesh *= pose.inverse();
            }
            let mesh = &contacts.meshes[placed.mesh as usize];
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
                self.gather(what, &corners, moving.reach, moving, stay, visit);
                *t_max = t_max.min(stay.left);
            });
        });
    }

    /// Gathers a triangle if the boxes meet; tests the gathered ones when there are enough.
    #[inline]
    fn gather(
        &mut self,
        (opens_to, target): (Option<CellId>, Option<Target>),
        corners: &Triangle,
        reach: DVec3,
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
            self.try_gathered(moving, stay, visit);
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
            if let Some(to) = it.opens_to.filter(|&to| !self.is_done(to)) {
                self.counts.openings += 1;
                if let Some(touch) = sweep(&moving.grown, moving.by, stay.left, &it.corners) {
                    self.reach(to, stay.since + touch.t);
                }
            }
            if let Some(target) = it.target {
                self.counts.triangles += 1;
                let candidate = Candidate {
                    cell: stay.cell,
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

impl<'a> Question<'a> {
    pub(super) fn new(contacts: &'a Contacts, state: &'a SightState, moving: &'a Moving) -> Self {
        Self {
            contacts,
            state,
            moving,
        }
    }
}

impl Moving {
    /// `None` if a number is not finite.
    pub(super) fn new(contacts: &Contacts, body: &Body, from: DVec3, by: DVec3) -> Option<Self> {
        if !(body.is_finite() && from.is_finite() && by.is_finite()) {
            return None;
        }
        let core = BodyCore::of(body);
        let grown = BodyCore::of(&body.grown(contacts.tolerance));
        Some(Self {
            core,
            reach: core.reach(),
            grown,
            grown_reach: grown.reach(),
            from,
            by,
        })
    }

    fn ray(&self, start: DVec3, t_max: f64) -> Ray {
        Ray {
            origin: start,
            direction: self.by,
            t_max,
        }
    }
}
