//! Results of a visit: cells, portals, and the items whose boxes are in the view.

use enfilade_cpg::{CellId, PortalId, SpecialId};
use glam::{DVec3, Vec3};

use super::traversal::Traversal;
use super::window::{NONE, SpecialView, Window};
use crate::boxes::Root;
use crate::exits::Exit;
use crate::region::Region;
use crate::seen::{ChunkId, DetailId, Visit};

impl Traversal<'_, '_> {
    #[inline]
    pub(super) fn add_portal(&mut self, portal: u32) {
        let stamp = &mut self.viewer.portal_stamps[portal as usize];
        if *stamp != self.viewer.frame_stamp {
            *stamp = self.viewer.frame_stamp;
            self.viewer.out.portals.push(PortalId(portal));
        }
    }

    pub(super) fn add_stop(&mut self, exit: &Exit) {
        let stamp = &mut self.viewer.stop_stamps[exit.portal as usize];
        if *stamp != self.viewer.frame_stamp {
            *stamp = self.viewer.frame_stamp;
            let stop = (PortalId(exit.portal), CellId(exit.to));
            self.viewer.out.stopped.push(stop);
        }
    }

    /// Lists a special portal, and records its view.
    pub(super) fn add_special(&mut self, special: u32, window: Window, is_at_eye: bool) {
        let viewer = &mut *self.viewer;
        if viewer
            .stepping
            .gate
            .is_some_and(|g| g.back == Some(SpecialId(special)))
        {
            return;
        }
        let stamp = &mut viewer.special_stamps[special as usize];
        if *stamp != viewer.frame_stamp {
            *stamp = viewer.frame_stamp;
            viewer.out.specials.push(SpecialId(special));
        }
        if viewer.stepping.is_on {
            viewer.stepping.specials.push(SpecialView {
                special: SpecialId(special),
                window,
                is_at_eye,
            });
        }
    }

    pub(super) fn set_planes(&mut self, region: &Region, entry: Option<(DVec3, f64)>) {
        // Normals go from clip space to world space by the transposed map.
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

    pub(super) fn add_visit(&mut self, cell: u32, via: u32, region: &Region, near: f64) {
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

    /// Adds the items of a tree that are inside the planes and not in a shadow.
    pub(super) fn cull(&mut self, root: Root) {
        let sight = self.sight;
        let n_chunks = sight.drawn.chunks.len() as u32;
        let viewer = &mut *self.viewer;
        let (out, stamps, shadows) = (&mut viewer.out, &mut viewer.item_stamps, &viewer.shadows);
        let frame = viewer.frame_stamp;
        let (is_bounded, allowed) = (viewer.is_bounded, &viewer.allowed);
        sight
            .trees
            .for_each_inside(root, &self.planes, |item, [min, max]| {
                let stamp = &mut stamps[item as usize];
                let is_out = is_bounded && allowed[item as usize / 64] >> (item % 64) & 1 == 0;
                if *stamp == frame || is_out {
                    return;
                }
                let (min, max): (Vec3, Vec3) = (min.truncate(), max.truncate());
                if shadows.hide_box(min, max) {
                    out.counts.shadowed += 1;
                    return;
                }
                *stamp = frame;
                if item < n_chunks {
                    out.n_triangles += u64::from(sight.drawn.chunks[item as usize].n_triangles());
                    out.chunks.push(ChunkId(item));
                } else {
                    let detail = item - n_chunks;
                    out.n_triangles += u64::from(sight.drawn.details[detail as usize].n_triangles);
                    out.details.push(DetailId(detail));
                }
            });
    }
}
