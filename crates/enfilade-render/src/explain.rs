//! A table for shaders that explains why points of a world are visible or not.
//!
//! It holds the narrowed views of each cell as planes, so that the answer depends on the point, not on the triangle: a
//! floor that many cells share is explained point by point.

use enfilade_runtime::{Seen, Sight, SightState, View, Viewer};
use glam::{DVec3, Vec3};

use crate::gpu::{Gpu, RenderError};
use crate::light::table;

/// The answer for one view. Order of the texels: a header with the frustum's planes; by cell, the position of its
/// visits, with occlusion and without; visits, each with the position of its planes; planes, relative to the field's
/// origin.
pub(crate) struct Explanation {
    texels: Vec<[u32; 4]>,
}

impl Explanation {
    /// Queries one view and builds its table.
    pub(crate) fn new(
        viewer: &mut Viewer,
        sight: &Sight,
        state: &SightState,
        view: &View,
        origin: DVec3,
    ) -> Self {
        let n_cells = sight.n_cells();
        let mut out = Self {
            texels: vec![[0; 4]; 1 + n_cells],
        };
        // A query through walls is not narrowed, so its planes are those of the whole view.
        let seen = viewer.see_through_walls(sight, view);
        let whole: Vec<[f32; 4]> = (seen.visits().first())
            .map(|v| seen.planes(v).to_vec())
            .unwrap_or_default();
        out.texels[0] = out.add_planes(&whole, origin);
        let before = viewer.options_mut().occlusion;
        for (slot, occlusion) in [(0, true), (2, false)] {
            viewer.options_mut().occlusion = occlusion;
            let seen = viewer.see(sight, state, view);
            out.add_visits(&seen, slot, origin, n_cells);
        }
        viewer.options_mut().occlusion = before;
        out
    }

    /// Adds planes; returns a texel with their position and number.
    fn add_planes(&mut self, planes: &[[f32; 4]], origin: DVec3) -> [u32; 4] {
        let first = self.texels.len() as u32;
        for &[x, y, z, d] in planes {
            let shift = Vec3::new(x, y, z).as_dvec3().dot(origin);
            let d = (f64::from(d) + shift) as f32;
            self.texels.push([x, y, z, d].map(f32::to_bits));
        }
        [first, planes.len() as u32, 0, 0]
    }

    fn add_visits(&mut self, seen: &Seen<'_>, slot: usize, origin: DVec3, n_cells: usize) {
        let counts = seen.counts();
        if counts.is_eye_lost || counts.is_capped {
            // Everything in view counts as seen: a visit without planes for every cell.
            let first = self.texels.len() as u32;
            self.texels.push([0; 4]);
            for cell in 1..=n_cells {
                self.texels[cell][slot..slot + 2].copy_from_slice(&[first, 1]);
            }
            return;
        }
        let mut visits: Vec<_> = seen.visits().iter().collect();
        visits.sort_by_key(|v| v.cell);
        for group in visits.chunk_by(|a, b| a.cell == b.cell) {
            let entries: Vec<_> = (group.iter())
                .map(|v| self.add_planes(seen.planes(v), origin))
                .collect();
            let first = self.texels.len() as u32;
            self.texels.extend(entries);
            let cell = &mut self.texels[1 + group[0].cell.idx()];
            cell[slot..slot + 2].copy_from_slice(&[first, group.len() as u32]);
        }
    }

    pub(crate) fn table(&self, gpu: &Gpu) -> Result<wgpu::TextureView, RenderError> {
        table(gpu, "what is seen and why", &self.texels)
    }
}
