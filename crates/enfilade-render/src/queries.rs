//! Culling by occlusion queries: a cell is visible if a pixel of its portal is not hidden.
//!
//! After the alternative in Luebke & Georges, "Portals and Mirrors" (I3D 1995), section 1.1: visibility by depth. Each
//! round draws the depths of the cells found last, then the outlines of their portals, each with an occlusion
//! query; the visible ones lead to the cells of the next round. Each round waits for the adapter, which clipping on
//! the processor avoids.
//!
//! **Errs to visible**, up to the size of a pixel: outlines are grown by one and a half pixels and drawn slightly
//! nearer than they are; openings thinner than the distance of samples may be missed.

use std::collections::BTreeSet;

use enfilade_cpg::{CellId, World};
use enfilade_runtime::{ChunkId, DetailId, View};
use glam::Vec3;

use crate::camera::Camera;
use crate::gpu::RenderError;
use crate::list::{DrawReason, RenderList};
use crate::resources::{depth_attachment, map_bytes};
use crate::scene::{Finish, Span};
use crate::shadings::set_buffers;
use crate::studio::Studio;

/// Work of a traversal by occlusion queries.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct QueryCounts {
    /// Waits for the adapter.
    pub n_rounds: u32,
    /// Portals queried.
    pub n_queries: u32,
    /// Cells found.
    pub n_cells: u32,
}

/// An eye this close to a portal's plane counts as seeing through it: the near plane cuts the outline. [Units: wu]
const AT_PORTAL: f32 = 0.05;
/// Factor by which outlines count as nearer, so that surfaces in the same plane, such as a door leaf, do not hide
/// them by rounding.
const NEARER: f32 = 0.998;
/// Most queries in a round; further portals count as visible.
const MAX_QUERIES: u32 = wgpu::QUERY_SET_MAX_QUERIES;

/// A query: the triangles of an outline, and the cell behind.
struct Asked {
    to: CellId,
    first: u32,
    n: u32,
}

impl Studio {
    /// Lists the draws of a view, with occlusion queries for portals, and their work. `world` is the studio's. An
    /// eye outside all cells sees everything in its view.
    ///
    /// Waits for the adapter once a round: as many times as there are doorways one behind the other.
    ///
    /// # Errors
    ///
    /// As [`Studio::picture`].
    #[doc(hidden)]
    pub fn list_by_queries(
        &mut self,
        world: &World,
        camera: &Camera,
        size: [u32; 2],
    ) -> Result<(RenderList, QueryCounts), RenderError> {
        let aspect = size[0] as f32 / size[1] as f32;
        let view = camera.view(aspect)?;
        self.follow_state();
        let mut counts = QueryCounts::default();
        let cells = match self.sight.locate(camera.eye) {
            None => None,
            Some(start) => {
                Some(self.cells_by_queries(world, camera, &view, start, size, &mut counts)?)
            }
        };
        counts.n_cells = cells.as_ref().map_or(0, |c| c.len() as u32);
        let is_in = |of: &[CellId]| {
            let Some(cells) = &cells else { return true };
            // Batches and objects without cells are drawn always.
            of.is_empty() || of.iter().any(|c| cells.contains(c))
        };
        let seen = self.viewer.see_through_walls(&self.sight, &view);
        let gpu_world = &self.world;
        let chunks: Vec<ChunkId> = seen.chunks().to_vec();
        let details: Vec<DetailId> = seen.details().to_vec();
        let chunks = chunks
            .into_iter()
            .filter(|c| is_in(&gpu_world.batch_cells[gpu_world.batch_of[c.0 as usize] as usize]));
        let details = details
            .into_iter()
            .filter(|d| is_in(&gpu_world.details[d.0 as usize].cells));
        let list = self
            .lister
            .chosen(
                gpu_world,
                &self.sight,
                &self.state,
                chunks,
                details,
                DrawReason::Seen,
            )
            .clone();
        Ok((list, counts))
    }

    fn cells_by_queries(
        &mut self,
        world: &World,
        camera: &Camera,
        view: &View,
        start: CellId,
        size: [u32; 2],
        counts: &mut QueryCounts,
    ) -> Result<BTreeSet<CellId>, RenderError> {
        let projection = camera.projection(size[0] as f32 / size[1] as f32)?;
        self.renderer.resize(&self.gpu, size)?;
        self.renderer.write_camera(&self.gpu, &projection, size);
        // Opaque chunks: transparent or masked ones do not hide.
        let in_view: Vec<u32> = self
            .viewer
            .see_through_walls(&self.sight, view)
            .chunks()
            .iter()
            .map(|c| c.0)
            .filter(|&c| {
                let hides = |s: &Span| !s.is_transparent && s.finish != Finish::Masked;
                self.world.spans_of(c).first().is_some_and(hides)
            })
            .collect();
        let mut is_drawn = vec![false; self.world.chunks.len()];
        let mut seen = BTreeSet::from([start]);
        let mut last = vec![start];
        while !last.is_empty() {
            let mut next = Vec::new();
            let mut corners: Vec<[f32; 3]> = Vec::new();
            let mut asked = Vec::new();
            for &cell in &last {
                for exit in world.graph.exits(cell) {
                    let (portal, p, to) = (exit.id, exit.portal, exit.to);
                    if seen.contains(&to) || !self.state.is_open(portal) || self.state.is_locked(to)
                    {
                        continue;
                    }
                    let is_near = is_at(camera.eye, &p.outline, p.normal);
                    if is_near || asked.len() as u32 == MAX_QUERIES {
                        next.push(to);
                        continue;
                    }
                    let first = corners.len() as u32;
                    grow(&mut corners, camera, &p.outline, size);
                    asked.push(Asked {
                        to,
                        first,
                        n: corners.len() as u32 - first,
                    });
                }
            }
            let new: Vec<u32> = in_view
                .iter()
                .copied()
                .filter(|&c| {
                    let cells = &self.world.batch_cells[self.world.batch_of[c as usize] as usize];
                    !is_drawn[c as usize] && cells.iter().any(|c| last.contains(c))
                })
                .collect();
            for &c in &new {
                is_drawn[c as usize] = true;
            }
            if !asked.is_empty() {
                let answers = self.ask(&new, &corners, &asked, counts.n_rounds == 0)?;
                counts.n_rounds += 1;
                counts.n_queries += asked.len() as u32;
                let found = asked.iter().zip(answers).filter(|(_, n)| *n > 0);
                next.extend(found.map(|(a, _)| a.to));
            }
            next.retain(|&c| seen.insert(c));
            last = next;
        }
        Ok(seen)
    }

    /// Returns for each outline the number of samples that no chunk drawn so far hides.
    fn ask(
        &mut self,
        new: &[u32],
        corners: &[[f32; 3]],
        asked: &[Asked],
        is_first: bool,
    ) -> Result<Vec<u64>, RenderError> {
        let (gpu, renderer) = (&self.gpu, &mut self.renderer);
        let n = asked.len() as u32;
        let structure = RenderList::of_structure();
        self.stage.write_instances(gpu, &self.world, &structure);
        renderer.marks.write(gpu, bytemuck::cast_slice(corners));
        let queries = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("portals"),
            ty: wgpu::QueryType::Occlusion,
            count: n,
        });
        let buffer = |usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("answers"),
                size: u64::from(n) * 8,
                usage,
                mapped_at_creation: false,
            })
        };
        let resolved = buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC);
        let back = buffer(wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ);
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let Some(targets) = &renderer.targets else {
            return Ok(vec![1; asked.len()]);
        };
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("portals"),
                depth_stencil_attachment: Some(depth_attachment(
                    &targets.depth,
                    is_first.then_some(0.0),
                )),
                occlusion_query_set: Some(&queries),
                ..wgpu::RenderPassDescriptor::default()
            });
            pass.set_bind_group(0, &renderer.camera.group, &[]);
            pass.set_pipeline(&renderer.pipelines.depth);
            set_buffers(&mut pass, &self.world, &self.stage.first().instances);
            for &c in new {
                for span in self.world.spans_of(c) {
                    pass.draw_indexed(span.first..span.first + span.n, 0, 0..1);
                }
            }
            pass.set_pipeline(&renderer.pipelines.outline);
            pass.set_vertex_buffer(0, renderer.marks.buffer.slice(..));
            for (i, a) in (0..).zip(asked) {
                pass.begin_occlusion_query(i);
                pass.draw(a.first..a.first + a.n, 0..1);
                pass.end_occlusion_query();
            }
        }
        encoder.resolve_query_set(&queries, 0..n, &resolved, 0);
        encoder.copy_buffer_to_buffer(&resolved, 0, &back, 0, u64::from(n) * 8);
        gpu.queue.submit([encoder.finish()]);
        let bytes = map_bytes(gpu, &back)?;
        Ok(bytemuck::pod_collect_to_vec(&bytes))
    }
}

/// Returns `true` if the eye is so close to an opening that the near plane may cut it.
fn is_at(eye: [f32; 3], outline: &[[f32; 3]], normal: [f32; 3]) -> bool {
    let Some(&through) = outline.first() else {
        return false;
    };
    let (eye, normal) = (Vec3::from(eye), Vec3::from(normal));
    let middle = outline.iter().copied().map(Vec3::from).sum::<Vec3>() / outline.len() as f32;
    let radius = outline
        .iter()
        .map(|&p| middle.distance(p.into()))
        .fold(0.0, f32::max);
    normal.dot(eye - Vec3::from(through)).abs() < AT_PORTAL
        && eye.distance(middle) < radius + AT_PORTAL
}

/// Adds an outline as triangles, a pixel and a half larger.
fn grow(corners: &mut Vec<[f32; 3]>, camera: &Camera, outline: &[[f32; 3]], size: [u32; 2]) {
    let eye = Vec3::from(camera.eye);
    let points: Vec<Vec3> = outline.iter().copied().map(Vec3::from).collect();
    let middle = points.iter().sum::<Vec3>() / points.len().max(1) as f32;
    let pixel = 2.0 * (camera.fov_y * 0.5).tan() / size[1] as f32;
    let grown: Vec<[f32; 3]> = points
        .iter()
        .map(|&p| {
            let by = 1.5 * pixel * p.distance(eye);
            let out = p + (p - middle).normalize_or_zero() * by;
            (eye + (out - eye) * NEARER).to_array()
        })
        .collect();
    for pair in grown.windows(2).skip(1) {
        corners.extend([grown[0], pair[0], pair[1]]);
    }
}
