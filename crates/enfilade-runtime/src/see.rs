//! Portal traversal: what an eye sees, frame by frame.
//!
//! From the eye's cell, cross each portal whose outline survives clipping to what is left of the
//! view, and narrow the view to what survived (Luebke & Georges, "Portals and Mirrors", I3D 1995;
//! Dirkse 2002, chapter 3; Gjørup 1999, section 2.3.4). We depart from them in that the ways are not
//! followed depth first but nearest first, from a queue:
//!
//! - A visit is a cell, a [`Region`] of the screen and the plane of the portal entered by, beyond which
//!   it begins. It holds nothing of the way that led there, so two visits of a cell can be compared: one
//!   within another adds nothing and is not entered. That also is Dirkse's lock against endless loops.
//! - While visits of a cell wait, they can be joined where that wastes little (his section 8.4).
//! - After 12 visits, the next joins all regions so far, and at last takes the whole screen. So a cell
//!   is entered at most 16 times, an exit clipped at most 16 times, however the portals lie: linear in
//!   the exits within reach.
//!
//! **Errs to visible**, everywhere: see `region.rs` for roundings; a budget that runs out makes visible
//! all that is left within reach; an eye in no cell sees every cell in its view.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use enfilade_cpg::{CellId, PortalId};
use glam::{DVec3, Vec3};

use crate::boxes::{Planes, Root};
use crate::exits::Exit;
use crate::exits::Group;
use crate::occluder::Shadows;
use crate::point::point;
use crate::region::{Clipped, Clipper, Narrowing, Region};
use crate::seen::{ChunkId, DetailId, Lists, SeeCounts, Seen, Visit};
use crate::sight::Sight;
use crate::state::SightState;
use crate::view::{Face, View};

/// Visits of one cell that wait at the same time; more are joined.
const MAX_QUEUED: u8 = 4;
/// Visits of one cell entered as they come.
const MAX_ENTERED: u8 = 12;
/// Further visits that join all regions so far; the one after takes the whole screen.
const MAX_JOINED: u8 = 3;
/// Waiting visits are joined where the rectangle around both is larger than they are by less than
/// this share. Below 0.1 doors side by side stay apart; above 0.5 rooms behind walls appear.
const WASTE: f64 = 0.25;
const NONE: u32 = u32::MAX;

/// How a view is followed.
#[derive(Clone, Copy, Debug)]
pub struct SeeOptions {
    /// How portals narrow the view.
    pub narrowing: Narrowing,
    /// Whether large polygons inside cells hide what is behind them.
    pub occlusion: bool,
    /// Portals clipped at most; after that, all cells within reach count as visible.
    pub max_clips: u32,
    /// A portal whose rectangle is less than this share of the screen is not followed but listed in
    /// [`Seen::stopped`], for something cheaper to stand in for what is behind it (Gjørup 1999, section
    /// 2.3.2; Dirkse 2002, section 4.1.1). [Limit: 0 to 1; only at 0 are answers supersets]
    pub min_share: f32,
}

impl Default for SeeOptions {
    fn default() -> Self {
        Self {
            narrowing: Narrowing::PolygonOf(8),
            occlusion: true,
            max_clips: 20_000,
            min_share: 0.0,
        }
    }
}

struct Pending {
    cell: u32,
    via: u32,
    region: Region,
    /// World normal of the portal entered by and its distance from the eye; what is seen lies beyond.
    entry: Option<(DVec3, f64)>,
    near: f64,
    /// Next visit of the same cell.
    next: u32,
    state: Stage,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    Waiting,
    Entered,
    /// Joined to another.
    Gone,
}

/// Per cell and face, valid while `stamp` is current.
#[derive(Clone, Copy)]
struct Mark {
    stamp: u32,
    head: u32,
    n_waiting: u8,
    n_entered: u8,
}

/// Asks what one eye sees, frame by frame; keeps its buffers, so that nothing is allocated once they
/// have grown to what the world's views need.
///
/// Memory: 16 bytes a cell, 8 bytes a portal, 4 bytes a chunk and detail.
pub struct Viewer {
    options: SeeOptions,
    marks: Vec<Mark>,
    cell_stamps: Vec<u32>,
    portal_stamps: Vec<u32>,
    stop_stamps: Vec<u32>,
    item_stamps: Vec<u32>,
    face_stamp: u32,
    frame_stamp: u32,
    pending: Vec<Pending>,
    queue: BinaryHeap<Reverse<(u64, u32)>>,
    clipper: Clipper,
    shadows: Shadows,
    out: Lists,
}

impl Viewer {
    /// A viewer of `sight`, with default options.
    #[must_use]
    pub fn new(sight: &Sight) -> Self {
        Self::with_options(sight, SeeOptions::default())
    }

    /// A viewer of `sight`.
    #[must_use]
    pub fn with_options(sight: &Sight, options: SeeOptions) -> Self {
        let mark = Mark {
            stamp: 0,
            head: NONE,
            n_waiting: 0,
            n_entered: 0,
        };
        Self {
            options,
            marks: vec![mark; sight.n_cells()],
            cell_stamps: vec![0; sight.n_cells()],
            portal_stamps: vec![0; sight.n_portals()],
            stop_stamps: vec![0; sight.n_portals()],
            item_stamps: vec![0; sight.chunks.len() + sight.details.len()],
            face_stamp: 0,
            frame_stamp: 0,
            pending: Vec::new(),
            queue: BinaryHeap::new(),
            clipper: Clipper::new(),
            shadows: Shadows::new(),
            out: Lists::default(),
        }
    }

    /// How views are followed; may be changed between questions.
    pub fn options_mut(&mut self) -> &mut SeeOptions {
        &mut self.options
    }

    /// What `view` sees of `sight` in `state`. `sight` is the one the viewer was made for, or one of a
    /// world with as many cells, portals, chunks and details.
    ///
    /// Time grows with what is seen, not with the world: a few microseconds for rooms. Allocates only
    /// while buffers grow.
    ///
    /// # Panics
    ///
    /// When `sight` is of a larger world than the viewer was made for.
    pub fn see<'a>(&'a mut self, sight: &Sight, state: &SightState, view: &View) -> Seen<'a> {
        let start = sight.locator.locate(view.eye).map(|c| c.0);
        self.see_in(sight, state, view, start)
    }

    /// The same for an eye whose cell is known, from a [`Follower`](crate::Follower) or because there is
    /// no locator. Wrong where the eye is not in it.
    ///
    /// # Panics
    ///
    /// As [`Viewer::see`], and when there is no such cell.
    pub fn see_from<'a>(
        &'a mut self,
        sight: &Sight,
        state: &SightState,
        view: &View,
        cell: CellId,
    ) -> Seen<'a> {
        self.see_in(sight, state, view, Some(cell.0))
    }

    fn see_in<'a>(
        &'a mut self,
        sight: &Sight,
        state: &SightState,
        view: &View,
        start: Option<u32>,
    ) -> Seen<'a> {
        self.begin();
        for face in 0..view.n_faces {
            let mut asking = Asking {
                viewer: self,
                sight,
                state,
                view,
                face: &view.faces[face],
                face_index: face as u8,
                planes: Planes::new(view.eye, sight.extent),
                slack: sight.tolerance * view.faces[face].stretch,
            };
            asking.start(start);
            asking.run();
        }
        Seen { lists: &self.out }
    }

    /// What `view` sees when nothing hides anything: every cell, chunk and detail whose box meets it.
    /// For comparison, and for programs that want to draw through walls.
    ///
    /// # Panics
    ///
    /// As [`Viewer::see`].
    pub fn see_through_walls<'a>(&'a mut self, sight: &Sight, view: &View) -> Seen<'a> {
        self.begin();
        let state = SightState::new_empty();
        let occlusion = std::mem::replace(&mut self.options.occlusion, false);
        for face in 0..view.n_faces {
            let mut asking = Asking {
                viewer: self,
                sight,
                state: &state,
                view,
                face: &view.faces[face],
                face_index: face as u8,
                planes: Planes::new(view.eye, sight.extent),
                slack: sight.tolerance * view.faces[face].stretch,
            };
            asking.begin_face();
            asking.enter_all_in_view();
        }
        self.options.occlusion = occlusion;
        Seen { lists: &self.out }
    }

    fn begin(&mut self) {
        let out = &mut self.out;
        out.visits.clear();
        out.planes.clear();
        out.cells.clear();
        out.portals.clear();
        out.stopped.clear();
        out.chunks.clear();
        out.details.clear();
        out.n_triangles = 0;
        out.counts = SeeCounts::default();
        if self.frame_stamp == u32::MAX {
            self.cell_stamps.fill(0);
            self.portal_stamps.fill(0);
            self.stop_stamps.fill(0);
            self.item_stamps.fill(0);
            self.frame_stamp = 0;
        }
        self.frame_stamp += 1;
    }
}

/// One face of one question.
struct Asking<'v, 'a> {
    viewer: &'v mut Viewer,
    sight: &'a Sight,
    state: &'a SightState,
    view: &'a View,
    face: &'a Face,
    face_index: u8,
    planes: Planes,
    /// What the tolerance changes in clip space.
    slack: f64,
}

impl Asking<'_, '_> {
    fn begin_face(&mut self) {
        let viewer = &mut *self.viewer;
        viewer.pending.clear();
        viewer.queue.clear();
        if viewer.face_stamp == u32::MAX {
            viewer.marks.iter_mut().for_each(|m| m.stamp = 0);
            viewer.face_stamp = 0;
        }
        viewer.face_stamp += 1;
    }

    /// Queues the eye's cell, and those that it may as well be in.
    fn start(&mut self, cell: Option<u32>) {
        self.begin_face();
        let Some(cell) = cell else {
            self.viewer.out.counts.is_eye_lost = true;
            self.enter_all_in_view();
            return;
        };
        self.push_start(cell);
        // An eye in a doorway is in both cells: which one it is said to be in is a rounding. At the
        // corner of several portals that may go on.
        let mut i = 0;
        while i < self.viewer.pending.len() {
            let cell = self.viewer.pending[i].cell;
            i += 1;
            let sight = self.sight;
            let near = 4.0 * sight.tolerance;
            let (low, high) = (self.view.eye - near, self.view.eye + near);
            let mut runs = sight.runs_of(cell);
            while let Some(run) = runs.next(|group| group.is_apart_from(low, high)) {
                for exit in run {
                    if self.state.lets_through(exit.portal, exit.to)
                        && self.is_at_portal(exit)
                        && !self.viewer.pending.iter().any(|p| p.cell == exit.to)
                    {
                        self.add_portal(exit.portal);
                        self.push_start(exit.to);
                    }
                }
            }
        }
    }

    fn push_start(&mut self, cell: u32) {
        self.push(cell, NONE, Region::screen(), None, 0.0);
    }

    /// Whether the eye is within a few tolerances of the portal's outline.
    fn is_at_portal(&self, exit: &Exit) -> bool {
        let near = 4.0 * self.sight.tolerance;
        let normal = point(exit.normal);
        let from_center = self.view.eye - point(exit.center);
        if normal.dot(from_center).abs() > near
            || from_center.length_squared() > (f64::from(exit.radius) + near).powi(2)
        {
            return false;
        }
        self.sight.is_in_outline(exit, self.view.eye, near)
    }

    fn run(&mut self) {
        while let Some(Reverse((_, at))) = self.viewer.queue.pop() {
            if self.viewer.pending[at as usize].state != Stage::Waiting {
                continue;
            }
            self.enter(at);
            if self.viewer.out.counts.clips >= self.viewer.options.max_clips {
                self.viewer.out.counts.is_capped = true;
                self.flood();
                return;
            }
        }
    }

    /// Everything that can be reached from what waits counts as visible.
    fn flood(&mut self) {
        self.viewer.queue.clear();
        let sight = self.sight;
        let mut at = 0;
        // Visits that were entered lead on as well: their exits may not all have been looked at.
        let mut n = self.viewer.pending.len();
        while at < n {
            let cell = self.viewer.pending[at].cell;
            let via = self.viewer.pending[at].via;
            at += 1;
            let mark = &mut self.viewer.marks[cell as usize];
            if mark.n_entered == u8::MAX {
                continue;
            }
            mark.n_entered = u8::MAX;
            self.cull_whole(cell, via);
            for exit in sight.exits_of(cell) {
                if self.state.lets_through(exit.portal, exit.to) {
                    self.add_portal(exit.portal);
                    let mark = self.mark(exit.to);
                    if mark.n_entered != u8::MAX {
                        self.viewer.pending.push(Pending {
                            cell: exit.to,
                            via: exit.portal,
                            region: Region::screen(),
                            entry: None,
                            near: 0.0,
                            next: NONE,
                            state: Stage::Entered,
                        });
                        n += 1;
                    }
                }
            }
        }
    }

    fn enter_all_in_view(&mut self) {
        self.set_planes(&Region::screen(), None);
        let planes = self.planes.clone();
        let sight = self.sight;
        sight
            .trees
            .for_each_inside(sight.world_root, &planes, |cell, _| {
                self.cull_whole(cell, NONE);
            });
        // Where no cell is in the view, the shadows are still those of the last question.
        self.viewer.shadows.clear();
        self.set_planes(&Region::screen(), None);
        self.cull(sight.unlisted_root);
    }

    /// Adds what of a cell is in the view, as if nothing hid it.
    fn cull_whole(&mut self, cell: u32, via: u32) {
        self.set_planes(&Region::screen(), None);
        self.viewer.shadows.clear();
        self.add_visit(cell, via, &Region::screen(), 0.0);
        self.cull(self.sight.cell_roots[cell as usize]);
    }

    fn enter(&mut self, at: u32) {
        let sight = self.sight;
        let visit = &mut self.viewer.pending[at as usize];
        visit.state = Stage::Entered;
        let (cell, via, entry, near) = (visit.cell, visit.via, visit.entry, visit.near);
        let region = visit.region;
        let mark = &mut self.viewer.marks[cell as usize];
        mark.n_waiting -= 1;
        mark.n_entered += 1;

        self.set_planes(&region, entry);
        self.viewer.shadows.clear();
        if self.viewer.options.occlusion {
            let margin = self.planes.margin();
            self.viewer
                .shadows
                .cast(&sight.occluders, cell, self.view.eye, margin);
        }
        self.add_visit(cell, via, &region, near);
        self.cull(self.sight.cell_roots[cell as usize]);
        let entry_in_clip = entry.map(|(n, h)| (self.face.normals * n, h - 2.0 * sight.tolerance));
        let mut runs = sight.runs_of(cell);
        while let Some(run) = runs.next(|group| self.is_skipped(group)) {
            for exit in run {
                self.try_exit(exit, &region, entry, entry_in_clip, near);
            }
        }
    }

    /// Whether [`Asking::try_exit`] would come to nothing for all exits of a group: the planes are those
    /// of the visit, to which it clips.
    #[inline]
    fn is_skipped(&self, group: &Group) -> bool {
        let [min, max] = group.bounds();
        group.faces_away(self.view.eye, self.sight.tolerance)
            || self.planes.leave_out(min, max)
            || self.viewer.shadows.hide_box(min, max)
    }

    #[inline]
    fn try_exit(
        &mut self,
        exit: &Exit,
        region: &Region,
        entry: Option<(DVec3, f64)>,
        entry_in_clip: Option<(DVec3, f64)>,
        nearest: f64,
    ) {
        let tolerance = self.sight.tolerance;
        let to_center = point(exit.center) - self.view.eye;
        let normal = point(exit.normal);
        // Distance of the plane ahead of the eye. The normal is rounded, too.
        let ahead = normal.dot(to_center);
        let radius = f64::from(exit.radius);
        if ahead < -2.0 * tolerance - 1e-6 * (to_center.abs().max_element() + radius) {
            return;
        }
        let reach = radius + 2.0 * tolerance;
        if entry.is_some_and(|(n, h)| n.dot(to_center) + reach < h) {
            return;
        }
        let q = self.face.map * to_center;
        let reach = reach * self.face.stretch;
        if q.z + reach < 0.0 || q.z - reach > self.view.far {
            return;
        }
        if region.sides().iter().any(|side| side.dot(q) < -reach) {
            return;
        }
        if !self.state.lets_through(exit.portal, exit.to) {
            return;
        }
        let corners = self.sight.corners_of(exit);
        if self.viewer.shadows.hide_points(corners, tolerance as f32) {
            self.viewer.out.counts.shadowed += 1;
            return;
        }
        self.viewer.out.counts.clips += 1;
        let clipper = &mut self.viewer.clipper;
        clipper.clear();
        for &p in corners {
            clipper.push(self.face.map * (point(p) - self.view.eye));
        }
        for &[x, y, z, d] in self.state.cuts(exit.portal) {
            let n = DVec3::new(x.into(), y.into(), z.into());
            let at_eye = n.dot(self.view.eye) + f64::from(d);
            if !clipper.cut(self.face.normals * n, -at_eye - tolerance) {
                return;
            }
        }
        let (narrowed, near) = match region.clip(clipper, entry_in_clip, self.slack) {
            Clipped::Out => return,
            Clipped::Near => (*region, 0.0),
            Clipped::Part { w_min } => {
                if w_min - tolerance > self.view.far {
                    return;
                }
                let narrowing = self.viewer.options.narrowing;
                let outline = clipper.as_slice();
                (
                    region.narrowed(outline, w_min, self.slack, narrowing),
                    w_min,
                )
            }
        };
        if narrowed.share() < f64::from(self.viewer.options.min_share) {
            self.add_stop(exit);
            return;
        }
        // A plane so near says nothing, and its turning sense may be noise.
        let beyond = (ahead > 16.0 * tolerance).then_some((normal, ahead));
        self.add_portal(exit.portal);
        // Along every ray it lies beyond the portal entered by; less is rounding, or comes of joining.
        self.push(exit.to, exit.portal, narrowed, beyond, near.max(nearest));
    }

    fn mark(&mut self, cell: u32) -> Mark {
        let stamp = self.viewer.face_stamp;
        let mark = &mut self.viewer.marks[cell as usize];
        if mark.stamp != stamp {
            *mark = Mark {
                stamp,
                head: NONE,
                n_waiting: 0,
                n_entered: 0,
            };
        }
        *mark
    }

    /// Queues a visit, unless it adds nothing; joins it to others where that is cheaper.
    fn push(
        &mut self,
        cell: u32,
        via: u32,
        mut region: Region,
        mut entry: Option<(DVec3, f64)>,
        mut near: f64,
    ) {
        let mark = self.mark(cell);
        let narrowing = self.viewer.options.narrowing;
        let (mut best, mut least_waste) = (NONE, f64::INFINITY);
        let mut at = mark.head;
        let mut n_waiting = mark.n_waiting;
        while at != NONE {
            let other = &self.viewer.pending[at as usize];
            let next = other.next;
            if other.state != Stage::Gone {
                if self.covers((&other.region, other.entry), (&region, entry)) {
                    // What waits and is nearer now is entered by the same queue entry; only the order
                    // of what is drawn may differ a little.
                    self.viewer.out.counts.spared += 1;
                    self.viewer.marks[cell as usize].n_waiting = n_waiting;
                    return;
                }
                if other.state == Stage::Waiting {
                    let waste = other.region.waste_of_joining(&region);
                    if self.covers((&region, entry), (&other.region, other.entry)) {
                        near = near.min(other.near);
                        self.viewer.pending[at as usize].state = Stage::Gone;
                        self.viewer.out.counts.spared += 1;
                        n_waiting -= 1;
                    } else if waste < least_waste {
                        (best, least_waste) = (at, waste);
                    }
                }
            }
            at = next;
        }
        if mark.n_entered >= MAX_ENTERED {
            // Joins everything so far, at last the whole screen.
            let mut at = mark.head;
            while at != NONE {
                let other = &mut self.viewer.pending[at as usize];
                region = region.rectangle_around(&other.region);
                if other.state == Stage::Waiting {
                    near = near.min(other.near);
                    other.state = Stage::Gone;
                    self.viewer.out.counts.spared += 1;
                }
                at = other.next;
            }
            if mark.n_entered >= MAX_ENTERED + MAX_JOINED {
                region = Region::screen();
            }
            entry = None;
            n_waiting = 0;
        } else if best != NONE && (least_waste < WASTE || n_waiting >= MAX_QUEUED) {
            let other = &mut self.viewer.pending[best as usize];
            other.region = other.region.joined(&region, narrowing);
            // Beyond either plane, as both are seen along: the same plane, or none.
            other.entry = match (other.entry, entry) {
                (Some((n, h)), Some((m, k))) if n.dot(m) > 1.0 - 1e-9 => Some((n, h.min(k))),
                _ => None,
            };
            self.viewer.out.counts.spared += 1;
            if near < other.near {
                other.near = near;
                self.viewer
                    .queue
                    .push(Reverse((near.max(0.0).to_bits(), best)));
            }
            self.viewer.marks[cell as usize].n_waiting = n_waiting;
            return;
        }
        let index = self.viewer.pending.len() as u32;
        self.viewer.pending.push(Pending {
            cell,
            via,
            region,
            entry,
            near,
            next: mark.head,
            state: Stage::Waiting,
        });
        let mark = &mut self.viewer.marks[cell as usize];
        mark.head = index;
        mark.n_waiting = n_waiting + 1;
        // Positive floats are ordered as their bits are.
        self.viewer
            .queue
            .push(Reverse((near.max(0.0).to_bits(), index)));
    }

    /// Whether one visit of a cell holds all that another sees.
    fn covers(
        &self,
        (region, entry): (&Region, Option<(DVec3, f64)>),
        (other, other_entry): (&Region, Option<(DVec3, f64)>),
    ) -> bool {
        if !other.is_within(region) {
            return false;
        }
        let Some((n, h)) = entry else { return true };
        let Some((m, k)) = other_entry else {
            return false;
        };
        if n == m && h <= k {
            return true;
        }
        // The depth along a ray r is h / (n · r): the entry must not be farther along any ray of the
        // other's region, nor of its widened rim.
        let (n, m) = (self.face.normals * n, self.face.normals * m);
        let difference = n * k - m * h;
        let rim = other.widened() * difference.truncate().length();
        other.corners().iter().all(|c| {
            let ray = c.extend(1.0);
            n.dot(ray) > 0.0 && m.dot(ray) > 0.0 && difference.dot(ray) >= rim
        })
    }

    fn add_portal(&mut self, portal: u32) {
        let stamp = &mut self.viewer.portal_stamps[portal as usize];
        if *stamp != self.viewer.frame_stamp {
            *stamp = self.viewer.frame_stamp;
            self.viewer.out.portals.push(PortalId(portal));
        }
    }

    fn add_stop(&mut self, exit: &Exit) {
        let stamp = &mut self.viewer.stop_stamps[exit.portal as usize];
        if *stamp != self.viewer.frame_stamp {
            *stamp = self.viewer.frame_stamp;
            let stop = (PortalId(exit.portal), CellId(exit.to));
            self.viewer.out.stopped.push(stop);
        }
    }

    fn set_planes(&mut self, region: &Region, entry: Option<(DVec3, f64)>) {
        // Normals of clip space to normals of the world: by the map transposed.
        let to_world = self.face.map.transpose();
        self.planes.clear();
        if let Some((n, h)) = entry {
            self.planes.add(n, h - 2.0 * self.sight.tolerance);
        }
        for side in region.sides() {
            self.planes.add(to_world * side, -self.slack);
        }
        for &edge in region.edges() {
            self.planes.add(to_world * edge, -self.slack);
        }
        if self.view.far < f64::INFINITY {
            self.planes.add(-to_world.z_axis, -self.view.far);
        }
    }

    fn add_visit(&mut self, cell: u32, via: u32, region: &Region, near: f64) {
        let out = &mut self.viewer.out;
        let first_plane = out.planes.len() as u32;
        out.planes
            .extend(self.planes.as_slice().iter().map(glam::Vec4::to_array));
        let outwards = |low: f64, high: f64| ((low as f32).next_down(), (high as f32).next_up());
        let (left, right) = outwards(region.min.x, region.max.x);
        let (bottom, top) = outwards(region.min.y, region.max.y);
        out.visits.push(Visit {
            cell: CellId(cell),
            via: (via != NONE).then_some(PortalId(via)),
            rectangle: [
                left.max(-1.0),
                bottom.max(-1.0),
                right.min(1.0),
                top.min(1.0),
            ],
            face: self.face_index,
            depth: near.max(0.0) as f32,
            first_plane,
            n_planes: out.planes.len() as u32 - first_plane,
        });
        let stamp = &mut self.viewer.cell_stamps[cell as usize];
        if *stamp != self.viewer.frame_stamp {
            *stamp = self.viewer.frame_stamp;
            out.cells.push(CellId(cell));
        }
    }

    /// Adds what of a tree's things is inside the planes and not in a shadow.
    fn cull(&mut self, root: Root) {
        let sight = self.sight;
        let n_chunks = sight.chunks.len() as u32;
        let viewer = &mut *self.viewer;
        let (out, stamps, shadows) = (&mut viewer.out, &mut viewer.item_stamps, &viewer.shadows);
        let frame = viewer.frame_stamp;
        sight
            .trees
            .for_each_inside(root, &self.planes, |item, [min, max]| {
                let stamp = &mut stamps[item as usize];
                if *stamp == frame {
                    return;
                }
                let (min, max): (Vec3, Vec3) = (min.truncate(), max.truncate());
                if shadows.hide_box(min, max) {
                    out.counts.shadowed += 1;
                    return;
                }
                *stamp = frame;
                if item < n_chunks {
                    out.n_triangles += u64::from(sight.chunks[item as usize].n_triangles());
                    out.chunks.push(ChunkId(item));
                } else {
                    let detail = item - n_chunks;
                    out.n_triangles += u64::from(sight.details[detail as usize].n_triangles);
                    out.details.push(DetailId(detail));
                }
            });
    }
}
