//! The choice of pipelines for the runs of a frame.

use crate::frame::{Paint, Style};
use crate::gpu::Gpu;
use crate::list::{RenderList, Run};
use crate::pipelines::{Canvas, Layouts, Pipelines, Shading, Variant};
use crate::resources::Grown;
use crate::scene::{Finish, GpuWorld};
use crate::stage::RenderStage;

pub(crate) fn set_buffers(pass: &mut wgpu::RenderPass<'_>, world: &GpuWorld, instances: &Grown) {
    pass.set_index_buffer(world.triangles.indices.slice(..), wgpu::IndexFormat::Uint32);
    pass.set_vertex_buffer(0, world.triangles.corners.slice(..));
    pass.set_vertex_buffer(1, instances.buffer.slice(..));
}

/// The pipelines of a frame.
pub(crate) struct Shadings {
    pub(crate) is_count: bool,
    /// The target of opaque surfaces, and that of transparent ones.
    canvases: [Canvas; 2],
    casts_shadows: bool,
    /// True if light is known by place.
    has_light: bool,
    explains: bool,
    has_lamps: bool,
    /// True if a cut makes holes in everything.
    has_cut: bool,
    /// True for pictures with special portals.
    is_in_context: bool,
}

impl Shadings {
    pub(crate) fn of(
        style: &Style,
        list: &RenderList,
        stage: &RenderStage,
        n_lamps: usize,
    ) -> Self {
        let is_count = style.paint == Paint::Overdraw;
        let is_reasoned = |&key: &u32| key & !crate::list::INSTANCE_MASK != 0;
        Self {
            is_count,
            canvases: if is_count || style.dark_corners {
                [Canvas::Surfaces, Canvas::Output]
            } else {
                [Canvas::Output; 2]
            },
            casts_shadows: style.shadows,
            has_light: style.daylight && stage.light.is_known(),
            explains: stage.explanation.is_some()
                || style.paint == Paint::Cells
                || list.instances.iter().any(is_reasoned),
            has_lamps: n_lamps > 0,
            has_cut: style.cut_above < f32::INFINITY,
            is_in_context: false,
        }
    }

    /// Returns the same pipelines, drawing in the region of one context, of a picture of finer colors if it `blends`.
    pub(crate) fn in_context(self, blends: bool) -> Self {
        let finer = |canvas| match canvas {
            Canvas::Output if blends => Canvas::Blended,
            canvas => canvas,
        };
        Self {
            is_in_context: true,
            canvases: self.canvases.map(finer),
            ..self
        }
    }

    fn variant(&self, shading: Shading, is_smooth: bool, canvas: Canvas) -> Variant {
        if self.is_count {
            return Variant {
                shading: Shading::Count,
                is_smooth: false,
                casts_shadows: false,
                has_light: false,
                explains: false,
                is_prop: false,
                has_lamps: false,
                canvas: Canvas::Surfaces,
                is_in_context: self.is_in_context,
            };
        }
        Variant {
            shading,
            is_smooth,
            casts_shadows: self.casts_shadows,
            has_light: self.has_light,
            explains: self.explains,
            is_prop: false,
            has_lamps: self.has_lamps,
            canvas,
            is_in_context: self.is_in_context,
        }
    }

    /// Returns the pipeline of props, smooth or flat.
    pub(crate) fn prop(&self, is_smooth: bool) -> Variant {
        let shading = if self.has_cut {
            Shading::Masked
        } else {
            Shading::Plain
        };
        Variant {
            is_prop: !self.is_count,
            ..self.variant(shading, is_smooth, self.canvases[0])
        }
    }

    pub(crate) fn opaque(&self, run: &Run) -> Variant {
        let shading = match run.finish {
            Finish::Plain if !self.has_cut => Shading::Plain,
            Finish::Textured if !self.has_cut => Shading::Textured,
            _ => Shading::Masked,
        };
        self.variant(shading, run.is_smooth, self.canvases[0])
    }

    pub(crate) fn glass(&self, run: &Run) -> Variant {
        // A transparent texture is a leaf of a plant or a curtain, not a pane.
        let shading = if run.finish == Finish::Plain {
            Shading::Glass
        } else {
            Shading::Sheer
        };
        self.variant(shading, run.is_smooth, self.canvases[1])
    }

    /// Makes the pipelines that a list needs.
    pub(crate) fn prepare(
        &self,
        gpu: &Gpu,
        layouts: &Layouts,
        pipelines: &mut Pipelines,
        list: &RenderList,
    ) {
        let mut prepare = |variant| {
            pipelines.prepare(gpu, layouts, variant);
        };
        let mut last = None;
        for run in &list.opaque {
            if last != Some((run.finish, run.is_smooth)) {
                last = Some((run.finish, run.is_smooth));
                prepare(self.opaque(run));
            }
        }
        for run in &list.transparent {
            prepare(self.glass(run));
        }
    }
}

/// Draws runs; changes pipelines, textures and scissors only where they differ. `surface` by run.
pub(crate) fn draw_runs<'p, 'r>(
    pass: &mut wgpu::RenderPass<'_>,
    world: &GpuWorld,
    runs: impl Iterator<Item = &'r Run>,
    size: [u32; 2],
    surface: impl Fn(&Run) -> Option<&'p wgpu::RenderPipeline>,
) {
    let (mut texture, mut scissor, mut kind) = (u32::MAX, None, None);
    pass.set_scissor_rect(0, 0, size[0], size[1]);
    for run in runs {
        if kind != Some((run.finish, run.is_smooth)) {
            kind = Some((run.finish, run.is_smooth));
            if let Some(pipeline) = surface(run) {
                pass.set_pipeline(pipeline);
            }
        }
        if run.texture != texture {
            texture = run.texture;
            pass.set_bind_group(1, &world.textures[texture as usize], &[]);
        }
        if run.scissor != scissor {
            scissor = run.scissor;
            let [x, y, w, h] = scissor.unwrap_or([0, 0, size[0], size[1]]);
            pass.set_scissor_rect(x, y, w, h);
        }
        pass.draw_indexed(run.first..run.first + run.n, 0, run.instances.clone());
    }
}
