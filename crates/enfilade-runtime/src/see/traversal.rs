//! Traversal from cell to cell, clipping the view to portals.

use std::cmp::Reverse;

use enfilade_cpg::{CellId, PortalId};
use glam::DVec3;

use super::viewer::{Pending, Stage, Viewer};
use super::window::{NONE, Window};
use crate::boxes::Planes;
use crate::exits::{Exit, Group};
use crate::point::point;
use crate::region::{Clipped, Region};
use crate::sight::Sight;
use crate::state::SightState;
use crate::view::{Face, View};

/// One face of one query.
pub(super) struct Traversal<'v, 'a> {
    pub(super) viewer: &'v mut Viewer,
    pub(super) sight: &'a Sight,
    pub(super) state: &'a SightState,
    pub(super) view: &'a View,
    pub(super) face: &'a Face,
    pub(super) face_index: u8,
    pub(super) planes: Planes,
    /// Effect of the tolerance in clip space.
    pub(super) slack: f64,
}

impl Traversal<'_, '_> {
    pub(super) fn begin_face(&mut self) {
        let viewer = &mut *self.viewer;
        viewer.pending.clear();
        viewer.queue.clear();
        if viewer.face_stamp == u32::MAX {
            viewer.marks.iter_mut().for_each(|m| m.stamp = 0);
            viewer.face_stamp = 0;
        }
        viewer.face_stamp += 1;
    }

    /// Queues the eye's cell, and those within tolerance of the eye.
    pub(super) fn start(&mut self, cell: Option<u32>) {
        self.begin_face();
        self.add_eye(cell);
    }

    pub(super) fn add_eye(&mut self, cell: Option<u32>) {
        let Some(cell) = cell else {
            self.viewer.out.counts.is_eye_lost = true;
            self.enter_all_in_view();
            return;
        };
        self.push_start(cell);
        // An eye in a doorway is in both cells: rounding decides which one is reported. Where several
        // portals meet, this may repeat.
        let mut i = 0;
        while i < self.viewer.pending.len() {
            let cell = self.viewer.pending[i].cell;
            i += 1;
            let sight = self.sight;
            // Or between the plane of a portal and the leaves that shut it.
            let near = 4.0 * sight.tolerance + sight.doors.most_depth();
            let (low, high) = (self.view.eye - near, self.view.eye + near);
            let mut runs = sight.runs_of(cell);
            while let Some(run) = runs.next(|group| group.is_apart_from(low, high)) {
                for exit in run {
                    if !self.may_be_beyond(exit) {
                        continue;
                    }
                    if let Some(special) = exit.special() {
                        self.add_special(special, Window::screen(), true);
                    } else if !self.viewer.pending.iter().any(|p| p.cell == exit.to) {
                        self.add_portal(exit.portal);
                        self.push_start(exit.to);
                    }
                }
            }
        }
        // An eye in two cells sees the union of both. This is rare, so the precomputed bound is left out.
        // All faces of a view begin alike.
        if self.viewer.pending.len() == 1 && !self.viewer.is_bounded {
            self.viewer.bound_by(self.sight, cell);
        }
    }

    fn push_start(&mut self, cell: u32) {
        if self.viewer.stepping.is_border(cell) {
            self.viewer.stepping.note(cell, NONE, Window::screen());
        }
        let entry = self.viewer.stepping.entry();
        self.push(cell, NONE, Region::screen(), entry, 0.0);
    }

    /// Returns `true` if the eye may be in the cell behind an exit: within a few tolerances of the outline of an open
    /// portal, or between a shut one and its leaves.
    fn may_be_beyond(&self, exit: &Exit) -> bool {
        let near = 4.0 * self.sight.tolerance;
        let depth = if self.state.is_open(PortalId(exit.portal)) {
            0.0
        } else {
            let along_portal = self.state.depth(exit.portal);
            if exit.is_turned {
                along_portal
            } else {
                -along_portal
            }
        };
        let is_way = self.state.lets_through(exit.portal, exit.to)
            || depth != 0.0 && !self.state.is_locked(CellId(exit.to));
        let from_center = self.view.eye - point(exit.center);
        let off = point(exit.normal).dot(from_center);
        let reach = f64::from(exit.radius) + near;
        is_way
            && off >= depth.min(0.0) - near
            && off <= depth.max(0.0) + near
            && from_center.length_squared() <= reach.powi(2) + depth * depth
            && self.sight.is_in_outline(exit, self.view.eye, near)
    }

    pub(super) fn run(&mut self) {
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

    /// Makes everything visible that can be reached from the waiting visits.
    fn flood(&mut self) {
        self.viewer.queue.clear();
        let sight = self.sight;
        let mut at = 0;
        // Visits already entered lead on, too: some of their exits may not have been tested.
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
                    if let Some(special) = exit.special() {
                        self.add_special(special, Window::screen(), false);
                        continue;
                    }
                    self.add_portal(exit.portal);
                    let mark = self.mark(exit.to);
                    if mark.n_entered != u8::MAX {
                        self.viewer.pending.push(Pending {
                            cell: exit.to,
                            via: exit.portal,
                            region: Region::screen(),
                            entry: self.viewer.stepping.entry(),
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

    pub(super) fn enter_all_in_view(&mut self) {
        self.set_planes(&Region::screen(), self.viewer.stepping.entry());
        let planes = self.planes.clone();
        let sight = self.sight;
        sight
            .trees
            .for_each_inside(sight.world_root, &planes, |cell, _| {
                self.cull_whole(cell, NONE);
            });
        // If no cell is in the view, the shadows are still those of the last query.
        self.viewer.shadows.clear();
        self.set_planes(&Region::screen(), self.viewer.stepping.entry());
        self.cull(sight.unlisted_root);
    }

    /// Adds the items of a cell that are in the view, as if nothing hid them.
    fn cull_whole(&mut self, cell: u32, via: u32) {
        self.set_planes(&Region::screen(), self.viewer.stepping.entry());
        self.viewer.shadows.clear();
        self.add_visit(cell, via, &Region::screen(), 0.0);
        let stepping = &mut self.viewer.stepping;
        if stepping.is_border(cell) || stepping.is_watched(cell) {
            stepping.note(cell, via, Window::screen());
        }
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
            let occluders = &sight.drawn.occluders;
            // Beside its plane, a ray may run along a special portal for long before it passes.
            let gate = self.viewer.stepping.gate.is_some();
            if !gate || entry.is_some() {
                let beyond = entry.filter(|_| gate);
                self.viewer
                    .shadows
                    .cast(occluders, cell, self.view.eye, margin, beyond);
            }
        }
        self.add_visit(cell, via, &region, near);
        if self.viewer.stepping.is_watched(cell) {
            let window = Window {
                region,
                entry,
                near,
            };
            self.viewer.stepping.note(cell, via, window);
        }
        self.cull(self.sight.cell_roots[cell as usize]);
        let entry_in_clip = entry.map(|(n, h)| (self.face.normals * n, h - 2.0 * sight.tolerance));
        let mut runs = sight.runs_of(cell);
        while let Some(run) = runs.next(|group| self.is_skipped(group)) {
            for exit in run {
                self.try_exit(exit, &region, entry, entry_in_clip, near);
            }
        }
    }

    /// Returns `true` if [`Traversal::try_exit`] would reject all exits of a group. The planes are those of
    /// the visit to which it clips.
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
        // A plane this near bounds nothing, and its orientation may be noise.
        let beyond = (ahead > 16.0 * tolerance).then_some((normal, ahead));
        if let Some(special) = exit.special() {
            let window = Window {
                region: narrowed,
                entry: beyond,
                near: near.max(nearest),
            };
            self.add_special(special, window, false);
            return;
        }
        let is_small = narrowed.share() < f64::from(self.viewer.options.min_share);
        if is_small || self.viewer.stops.has(exit, to_center.length()) {
            self.add_stop(exit);
            return;
        }
        let beyond = beyond.or(self.viewer.stepping.entry());
        self.add_portal(exit.portal);
        // Along every ray it lies beyond the portal entered by; less is due to rounding or joining.
        let near = near.max(nearest);
        if self.viewer.stepping.is_border(exit.to) {
            let window = Window {
                region: narrowed,
                entry: beyond,
                near,
            };
            self.viewer.stepping.note(exit.to, exit.portal, window);
            return;
        }
        self.push(exit.to, exit.portal, narrowed, beyond, near);
    }
}
