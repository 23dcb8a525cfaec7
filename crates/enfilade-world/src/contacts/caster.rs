//! The flood of a body through cells, and what is asked of the triangles on its way.
//!
//! Cells are taken in the order in which the body reaches them: the first is its own, others when it first touches an opening to
//! them, and a cell's triangles count from then on. So the order of the list of portals does not matter, and no cell is looked
//! at that is reached only after the impact. With a queue that is searched straight through, since a body touches few
//! openings: O(log n) for each cell's tree, and O(k²) for k cells.

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::{Aabb, DMat3, DVec3, Ray, Triangle};
use enfilade_runtime::{DetailId, SightState, Target};

use super::body::{Body, BodyCore};
use super::kernel::{boxes_meet, depth, point_of_contact, sweep};
use super::walls::{Contacts, TriangleOf};

/// What approaches slower than this share of its motion goes no deeper: it passes along.
const ALONG: f64 = 1e-9;

/// A body that moves straight, without turning.
#[derive(Clone, Copy, Debug)]
pub struct Cast<'a> {
    /// Its shape.
    pub body: &'a Body,
    /// Where its center is. [Units: wu]
    pub from: DVec3,
    /// How far it moves. [Units: wu]
    pub by: DVec3,
    /// The cell of its center; where that is matter, the last one that it was in.
    pub cell: CellId,
}

/// What a moving body meets first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impact {
    /// When, as a share of the motion, 0 to 1.
    pub t: f64,
    /// Of unit length, from what was met to the body.
    pub normal: DVec3,
    /// Where. Of a box that meets with a face or an edge, the middle of what touches. [Units: wu]
    pub point: DVec3,
    /// What was met.
    pub target: Target,
    /// The cell through which it was met.
    pub cell: CellId,
}

/// Something that a resting body touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Of unit length: the shortest way out.
    pub normal: DVec3,
    /// How far that way. [Units: wu]
    pub depth: f64,
    /// Where. [Units: wu]
    pub point: DVec3,
    /// What is touched.
    pub target: Target,
    /// The cell through which it was met.
    pub cell: CellId,
}

/// What a question cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CastCounts {
    /// Cells whose trees were asked.
    pub cells: u32,
    /// Candidates: triangles tried one by one, openings' among them. All that the box around the body touches before the impact,
    /// and some of those behind it.
    pub triangles: u32,
}

/// Asks what bodies touch. Holds the buffers of the flood; one a thread.
///
/// Nothing is allocated once the buffers have grown.
#[derive(Clone, Debug)]
pub struct Caster {
    /// By cell.
    reached: Vec<Reached>,
    question: u32,
    waiting: Vec<CellId>,
    cells: Vec<CellId>,
    counts: CastCounts,
}

/// When a cell was reached, in which question.
#[derive(Clone, Copy, Debug, Default)]
struct Reached {
    question: u32,
    is_done: bool,
    since: f64,
}

/// A body made ready.
struct Moving {
    core: BodyCore,
    reach: DVec3,
    /// The same, grown by the tolerance of openings.
    grown: BodyCore,
    grown_reach: DVec3,
    from: DVec3,
    by: DVec3,
}

/// An obstacle on the way: in which cell, what it is, its corners relative to where the body is at `since`.
struct Candidate<'a> {
    cell: CellId,
    target: Target,
    corners: &'a Triangle,
    since: f64,
}

impl Caster {
    /// For one world.
    #[must_use]
    pub fn new(contacts: &Contacts) -> Self {
        Self {
            reached: vec![Reached::default(); contacts.n_cells()],
            question: 0,
            waiting: Vec::new(),
            cells: Vec::new(),
            counts: CastCounts::default(),
        }
    }

    /// What a moving body meets first: walls, seals, objects, leaves of doors as `state` has them, openings that it shuts.
    ///
    /// Never misses a triangle of a cell that the body reaches by openings, nor stops at one behind a wall that it does not
    /// pass: what it touches at its start stops it unless it moves away, or along. Keep a gap, a millimeter say, to
    /// what is slid along, or the seams of a floor stop the body. A body that does not move meets nothing, nor does one whose
    /// numbers are not finite. A microsecond or less in rooms.
    ///
    /// # Panics
    ///
    /// When there is no such cell.
    pub fn cast(
        &mut self,
        contacts: &Contacts,
        state: &SightState,
        cast: &Cast<'_>,
    ) -> Option<Impact> {
        self.cast_where(contacts, state, cast, |_| true)
    }

    /// The same, passing by objects for which `counts` is false: what the body carries, curtains.
    ///
    /// # Panics
    ///
    /// As [`Caster::cast`].
    pub fn cast_where(
        &mut self,
        contacts: &Contacts,
        state: &SightState,
        cast: &Cast<'_>,
        counts: impl FnMut(DetailId) -> bool,
    ) -> Option<Impact> {
        let moving = Moving::new(contacts, cast.body, cast.from, cast.by)?;
        let slowest = -ALONG * cast.by.length();
        let mut best: Option<Impact> = None;
        let by = cast.by;
        self.flood(contacts, state, &moving, cast.cell, counts, |it, t_max| {
            let touch = sweep(&moving.core, by, *t_max, it.corners);
            let Some(touch) = touch.filter(|touch| touch.normal.dot(by) < slowest) else {
                return;
            };
            let t = it.since + touch.t;
            if best.is_some_and(|b| t >= b.t) {
                return;
            }
            *t_max = touch.t;
            let passed = by * touch.t;
            let corners = it.corners.map(|p| p - passed);
            best = Some(Impact {
                t,
                normal: touch.normal,
                point: cast.from + by * t + point_of_contact(&moving.core, &corners),
                target: it.target,
                cell: it.cell,
            });
        });
        best
    }

    /// Calls `visit` with all that a resting body touches, in no order that means anything; what two cells see is told for each
    /// that the body reaches. Nothing for a body whose numbers are not finite.
    ///
    /// # Panics
    ///
    /// When there is no such cell.
    pub fn for_each_contact(
        &mut self,
        contacts: &Contacts,
        state: &SightState,
        body: &Body,
        at: DVec3,
        cell: CellId,
        mut visit: impl FnMut(&Contact),
    ) {
        let Some(resting) = Moving::new(contacts, body, at, DVec3::ZERO) else {
            return;
        };
        self.flood(
            contacts,
            state,
            &resting,
            cell,
            |_| true,
            |it, _| {
                let Some(found) = depth(&resting.core, it.corners) else {
                    return;
                };
                visit(&Contact {
                    normal: found.normal,
                    depth: found.depth,
                    point: at + point_of_contact(&resting.core, it.corners),
                    target: it.target,
                    cell: it.cell,
                });
            },
        );
    }

    /// Calls `visit` with the triangles that a resting body may touch, for whoever has a narrow phase of his own: all those of
    /// reached cells whose boxes the box around the body touches.
    ///
    /// # Panics
    ///
    /// When there is no such cell.
    pub fn for_each_candidate(
        &mut self,
        contacts: &Contacts,
        state: &SightState,
        body: &Body,
        at: DVec3,
        cell: CellId,
        mut visit: impl FnMut(Target, &Triangle),
    ) {
        if let Some(resting) = Moving::new(contacts, body, at, DVec3::ZERO) {
            let all = |_: DetailId| true;
            self.flood(contacts, state, &resting, cell, all, |it, _| {
                visit(it.target, &it.corners.map(|p| p + at));
            });
        }
    }

    /// The cells that the body of the last question reached, before its impact if there was one; its own first.
    #[must_use]
    pub fn cells(&self) -> &[CellId] {
        &self.cells
    }

    /// What the last question cost.
    #[must_use]
    pub fn counts(&self) -> CastCounts {
        self.counts
    }

    /// Calls `visit` with every obstacle whose box the moving body's box touches, and with the time left, which it may lower.
    fn flood(
        &mut self,
        contacts: &Contacts,
        state: &SightState,
        moving: &Moving,
        start: CellId,
        mut counts: impl FnMut(DetailId) -> bool,
        mut visit: impl FnMut(&Candidate<'_>, &mut f64),
    ) {
        self.begin();
        self.reach(start, 0.0);
        let mut limit = 1.0;
        while let Some((cell, since)) = self.next_cell(limit) {
            self.cells.push(cell);
            limit = self.walls(contacts, state, moving, (cell, since), limit, &mut visit);
            limit = self.objects(
                (contacts, state),
                moving,
                (cell, since),
                limit,
                &mut counts,
                &mut visit,
            );
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

    /// Notes that a cell is reached.
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

    /// The cell that is reached next, and when; none that is reached after `limit`.
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

    /// Structural triangles and openings of one cell, which the body is in from `since` on; the new limit.
    fn walls(
        &mut self,
        contacts: &Contacts,
        state: &SightState,
        moving: &Moving,
        (cell, since): (CellId, f64),
        limit: f64,
        visit: &mut impl FnMut(&Candidate<'_>, &mut f64),
    ) -> f64 {
        let walls = &contacts.cells[cell.idx()];
        let start = moving.from + moving.by * since;
        let ray = moving.ray(start, limit - since);
        let mut left = ray.t_max;
        walls
            .bvh
            .for_each_swept(&ray, moving.grown_reach, |i, t, t_max| {
                let corners = t.map(|p| p - start);
                let bounds = Aabb::of_points(&corners);
                let target = match walls.surfaces[i as usize] {
                    TriangleOf::Wall { batch, triangle } => Target::Wall { batch, triangle },
                    TriangleOf::Opening { portal, is_panel } => {
                        let [a, b] = contacts.portal_cells[portal as usize];
                        let to = if a == cell { b } else { a };
                        if !self.is_done(to)
                            && boxes_meet(moving.grown_reach, moving.by, left, &bounds)
                        {
                            self.counts.triangles += 1;
                            if let Some(touch) = sweep(&moving.grown, moving.by, left, &corners) {
                                self.reach(to, since + touch.t);
                            }
                        }
                        if !is_panel || state.is_open(PortalId(portal)) {
                            return;
                        }
                        Target::Portal(PortalId(portal))
                    }
                    TriangleOf::Panel { portal } if state.is_open(PortalId(portal)) => return,
                    TriangleOf::Panel { portal } => Target::Portal(PortalId(portal)),
                };
                if boxes_meet(moving.reach, moving.by, left, &bounds) {
                    self.counts.triangles += 1;
                    let candidate = Candidate {
                        cell,
                        target,
                        corners: &corners,
                        since,
                    };
                    visit(&candidate, &mut left);
                    *t_max = t_max.min(left);
                }
            });
        since + left
    }

    /// Objects of one cell, which the body is in from `since` on; the new limit.
    fn objects(
        &mut self,
        (contacts, state): (&Contacts, &SightState),
        moving: &Moving,
        (cell, since): (CellId, f64),
        limit: f64,
        counts: &mut impl FnMut(DetailId) -> bool,
        visit: &mut impl FnMut(&Candidate<'_>, &mut f64),
    ) -> f64 {
        let walls = &contacts.cells[cell.idx()];
        let start = moving.from + moving.by * since;
        let mut left = limit - since;
        let ends = Aabb::of_points(&[start, start + moving.by * left]);
        let way = Aabb::new(ends.min - moving.reach, ends.max + moving.reach);
        walls.tree.for_each_in_box(&way, |slot| {
            let detail = walls.details[slot as usize];
            let Some(placed) = &contacts.placed[detail as usize] else {
                return;
            };
            let bounds = Aabb::new(placed.bounds.min - start, placed.bounds.max - start);
            if !boxes_meet(moving.reach, moving.by, left, &bounds) || !counts(DetailId(detail)) {
                return;
            }
            let (mut to_world, mut to_mesh) = (placed.to_world, placed.to_mesh);
            if let Some(pose) = placed
                .is_leaf
                .then(|| state.pose(DetailId(detail)))
                .flatten()
            {
                to_world = pose * to_world;
                to_mesh *= pose.inverse();
            }
            let mesh = &contacts.meshes[placed.mesh as usize];
            let reach = moving.core.reach_in(&DMat3::from_mat4(to_mesh)) * (1.0 + 1e-9);
            let ray = Ray {
                origin: to_mesh.transform_point3(start),
                direction: to_mesh.transform_vector3(moving.by),
                t_max: left,
            };
            mesh.bvh.for_each_swept(&ray, reach, |i, t, t_max| {
                let corners = t.map(|p| to_world.transform_point3(p) - start);
                if !boxes_meet(moving.reach, moving.by, left, &Aabb::of_points(&corners)) {
                    return;
                }
                self.counts.triangles += 1;
                let (primitive, triangle) = mesh.named(i);
                let candidate = Candidate {
                    cell,
                    target: Target::Detail {
                        detail: DetailId(detail),
                        primitive,
                        triangle,
                    },
                    corners: &corners,
                    since,
                };
                visit(&candidate, &mut left);
                *t_max = t_max.min(left);
            });
        });
        since + left
    }
}

impl Moving {
    /// `None` where a number is not finite.
    fn new(contacts: &Contacts, body: &Body, from: DVec3, by: DVec3) -> Option<Self> {
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
