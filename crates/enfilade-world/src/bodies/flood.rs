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
//! Special portals: a body that touches one from its front is also on its far side, as another *image*, in a frame of its own.
//! Each image meets the obstacles on its side of the plane (`carve.rs`). Up to 32 follow each other.
//!
//! In a cell, triangles are tested in the order in which the body's bounding box touches their boxes, so that those behind the
//! impact are not tested at all. They are gathered first, [`BATCH`] at a time, which bounds the work behind it.

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::{Aabb, DMat3, DVec3, Ray, Similarity, Triangle};
use enfilade_runtime::{DetailId, Target};

use super::body::BodyCore;
use super::images::{Image, ImagePlace, Images};
use super::kernel::{boxes_meet, sweep};
use super::moving::{Motion, Moving};
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
    /// Images of the body: itself, and one beyond each special portal that it touches.
    pub images: u32,
}

/// Follows a body from cell to cell. Holds the buffers.
#[derive(Clone, Debug)]
pub(super) struct BodyFlood {
    /// Per cell of all parts.
    reached: Vec<Reached>,
    question: u32,
    waiting: Vec<ImagePlace>,
    places: Vec<Place>,
    images: Images,
    carved: Vec<Triangle>,
    gathered: Vec<Gathered>,
    /// Doors to the surroundings of the current part that the body touches, with the times.
    left_by: Vec<(PortalId, f64)>,
    /// The body in the frames of the parts that it has met.
    moving: Vec<((usize, PartId), Moving)>,
    counts: CastCounts,
}

/// The time at which a cell was reached, and the query.
#[derive(Clone, Copy, Debug, Default)]
struct Reached {
    question: u32,
    is_done: bool,
    since: f64,
}

/// A triangle that a body may meet, in the frame of the part.
#[derive(Clone, Copy)]
struct Found<'t> {
    /// The portal that it is an opening of, and the cell behind.
    opens_to: Option<(PortalId, CellId)>,
    target: Option<Target>,
    corners: &'t Triangle,
    /// Half extents of the body's box, for this triangle.
    reach: DVec3,
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

/// A place that the body is in from `since` on, and the rest of its motion then.
struct Stay {
    image: usize,
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
            images: Images::default(),
            carved: Vec::new(),
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
        self.images.begin(motion.frame);
        self.reach(space, ImagePlace { image: 0, place }, 0.0);
        let (mut limit, mut is_met) = (1.0, false);
        while let Some((ImagePlace { image, place }, since)) = self.next_place(space, limit) {
            if image == 0 || !self.places.contains(&place) {
                self.places.push(place);
            }
            let moving = self.moving_in(motion, image, place.part);
            let mut stay = Stay {
                image,
                place,
                border: space.parts[place.part.idx()].border,
                since,
                start: moving.from + moving.by * since,
                left: limit - since,
                is_met,
            };
            let mut images = std::mem::take(&mut self.images);
            let spot = ImagePlace { image, place };
            images.meet(space, &moving, spot, [since, stay.left], |spot, since| {
                self.reach(space, spot, since);
            });
            images.set_cuts(space, image, place.part);
            self.images = images;
            self.gather_walls(space, &moving, &mut stay, &mut visit);
            self.gather_objects(space, &moving, &mut stay, &mut counts, &mut visit);
            self.try_gathered(space, &moving, &mut stay, &mut visit);
            self.leave(motion, &stay);
            self.meet_guests(motion, &stay);
            (limit, is_met) = (since + stay.left, stay.is_met);
        }
        self.counts.cells = self.places.len() as u32;
        self.counts.images = self.images.all.len() as u32;
    }

    fn begin(&mut self, space: &Space) {
        self.question = self.question.wrapping_add(1);
        if self.question == 0 {
            self.reached.fill(Reached::default());
            self.question = 1;
        }
        if self.reached.len() < space.n_cells() {
            self.reached.resize(space.n_cells(), Reached::default());
        }
        self.waiting.clear();
        self.places.clear();
        self.moving.clear();
        self.counts = CastCounts::default();
    }

    /// Returns an image of the body in the frame of a part.
    fn moving_in(&mut self, motion: &Motion<'_>, image: usize, part: PartId) -> Moving {
        let key = (image, part);
        if let Some((_, known)) = self.moving.iter().find(|(k, _)| *k == key) {
            return *known;
        }
        let Image { frame, map, .. } = self.images.all[image];
        let map = if part == frame {
            map
        } else {
            Similarity::from(motion.space.between(frame, part)).after(&map)
        };
        let moving = Moving::new(motion, part, map);
        self.moving.push((key, moving));
        moving
    }

    fn index(space: &Space, spot: ImagePlace) -> usize {
        let ImagePlace { image, place } = spot;
        let first = space.parts[place.part.idx()].first_cell as usize;
        image * space.n_cells() + first + place.cell.idx()
    }

    /// Records that a place is reached.
    fn reach(&mut self, space: &Space, spot: ImagePlace, since: f64) {
        let at = Self::index(space, spot);
        if at >= self.reached.len() {
            let n = space.n_cells() * (spot.image + 1);
            self.reached.resize(n, Reached::default());
        }
        let known = &mut self.reached[at];
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
        self.waiting.push(spot);
    }

    fn is_done(&self, space: &Space, spot: ImagePlace) -> bool {
        let known = self.reached.get(Self::index(space, spot));
        known.is_some_and(|known| known.question == self.question && known.is_done)
    }

    /// Returns `true` if the cell behind an opening is searched already, and nothing beyond it remains to be found.
    fn is_behind_done(&self, space: &Space, stay: &Stay, cell: CellId) -> bool {
        let (image, part) = (stay.image, stay.place.part);
        let place = Place { part, cell };
        stay.border != Some(cell) && self.is_done(space, ImagePlace { image, place })
    }

    /// Returns the place reached next, with its time; none that is reached after `limit`.
    fn next_place(&mut self, space: &Space, limit: f64) -> Option<(ImagePlace, f64)> {
        let since = |p: &ImagePlace| self.reached[Self::index(space, *p)].since;
        let order = |&(_, a): &(usize, &ImagePlace), &(_, b): &(usize, &ImagePlace)| {
            since(a).total_cmp(&since(b)).then(a.cmp(b))
        };
        let (at, _) = self.waiting.iter().enumerate().min_by(order)?;
        let spot = self.waiting.swap_remove(at);
        let known = &mut self.reached[Self::index(space, spot)];
        known.is_done = true;
        (known.since <= limit).then_some((spot, known.since))
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
            let image = stay.image;
            for &place in &door.leads_to {
                self.reach(space, ImagePlace { image, place }, since);
            }
            for &(other, portal) in &door.meets {
                self.dock(motion, image, other, portal, since);
            }
        }
        self.left_by = left_by;
    }

    /// Continues behind a door of another part, from `since` on: through the prism between both doors.
    fn dock(
        &mut self,
        motion: &Motion<'_>,
        image: usize,
        other: PartId,
        portal: PortalId,
        since: f64,
    ) {
        let space = motion.space;
        let its = &space.parts[other.idx()];
        let Some(door) = its.doors.iter().find(|d| d.portal == portal) else {
            return;
        };
        let moving = self.moving_in(motion, image, other);
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
            for cell in std::iter::once(door.inner).chain(its.border) {
                let place = Place { part, cell };
                self.reach(space, ImagePlace { image, place }, since + after);
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
            let moving = self.moving_in(motion, stay.image, part);
            let start = moving.from + moving.by * stay.since;
            let hull = its.hull.expanded(its.layout.tolerance());
            let bounds = Aabb::new(hull.min - start, hull.max - start);
            if let Some(after) = boxes_meet(moving.grown_reach, moving.by, stay.left, &bounds) {
                let (image, place) = (stay.image, Place { part, cell });
                self.reach(
                    space,
                    ImagePlace { image, place },
                    stay.since + after.max(0.0),
                );
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
                        let [a, b] = all.ways[portal as usize];
                        let way = if a.from == cell { a } else { b };
                        opens_to = way.to.map(|to| (PortalId(portal), to));
                        reach = moving.grown_reach;
                        let solid = Some(Target::Portal(PortalId(portal)));
                        let shut = shut(portal).filter(|_| is_panel);
                        if way.is_solid { solid } else { shut }
                    }
                    TriangleOf::Panel { portal } => shut(portal),
                };
                let is_way = |(_, to)| !self.is_behind_done(space, stay, to);
                if target.is_some() || opens_to.is_some_and(is_way) {
                    let found = Found {
                        opens_to,
                        target,
                        corners: t,
                        reach,
                    };
                    self.gather(space, found, moving, stay, visit);
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
                let corners = t.map(|p| to_world.transform_point3(p));
                let (primitive, triangle) = mesh.named(i);
                let target = Target::Detail {
                    detail: DetailId(detail),
                    primitive,
                    triangle,
                };
                let found = Found {
                    opens_to: None,
                    target: Some(target),
                    corners: &corners,
                    reach: moving.reach,
                };
                self.gather(space, found, moving, stay, visit);
                *t_max = t_max.min(stay.left);
            });
        });
    }

    /// Gathers what counts of a triangle, in the frame of the part.
    #[inline]
    fn gather(
        &mut self,
        space: &Space,
        found: Found<'_>,
        moving: &Moving,
        stay: &mut Stay,
        visit: &mut impl FnMut(&Candidate<'_>, &mut f64),
    ) {
        if self.images.carver.is_empty() {
            let corners = &found.corners.map(|p| p - stay.start);
            let found = Found { corners, ..found };
            return self.gather_whole(space, found, moving, stay, visit);
        }
        let mut carved = std::mem::take(&mut self.carved);
        carved.clear();
        self.images.carver.carve(found.corners, |t| carved.push(t));
        for t in &carved {
            let corners = &t.map(|p| p - stay.start);
            let found = Found { corners, ..found };
            self.gather_whole(space, found, moving, stay, visit);
        }
        self.carved = carved;
    }

    /// Gathers a triangle, given relative to the body, if the boxes meet; tests the gathered ones when there are enough.
    #[inline]
    fn gather_whole(
        &mut self,
        space: &Space,
        Found {
            opens_to,
            target,
            corners,
            reach,
        }: Found<'_>,
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
                    let (image, place) = (stay.image, Place { part, cell });
                    self.reach(space, ImagePlace { image, place }, since);
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
