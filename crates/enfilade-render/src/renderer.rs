//! The passes of a frame: opaque surfaces, effects on their image, transparent surfaces.

use std::ops::Range;

use glam::{Mat4, Vec3};

use crate::camera::Projection;
use crate::formats::{COLOR, DEPTH};
use crate::frame::{Frame, Paint, Style};
use crate::gpu::{Gpu, RenderError};
use crate::light::{Light, LightGlobals};
use crate::list::{RenderList, Run};
use crate::marks::Mark;
use crate::picture::Picture;
use crate::pipelines::{Layouts, Pipelines};
use crate::resources::{Grown, bound, color_attachment, depth_attachment, read_texture, texture};
use crate::scene::{GpuWorld, Instance};
use crate::shadings::{Shadings, draw_runs, set_buffers};

/// Side of the shadow map. [Units: texels]
const SHADOW_SIDE: u32 = 4096;

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Globals {
    clip_from_relative: [[f32; 4]; 4],
    relative_from_clip: [[f32; 4]; 4],
    shadow_from_world: [[f32; 4]; 4],
    origin: [f32; 4],
    eye: [f32; 4],
    sun: [f32; 4],
    size: [f32; 4],
    style: [u32; 4],
    light: LightGlobals,
}

/// Intermediate targets of frames of one size.
pub(crate) struct Targets {
    pub(crate) size: [u32; 2],
    pub(crate) color: wgpu::TextureView,
    pub(crate) depth: wgpu::TextureView,
    post: wgpu::BindGroup,
}

/// Draws worlds; one for each texture format.
pub struct Renderer {
    pub(crate) layouts: Layouts,
    pub(crate) pipelines: Pipelines,
    pub(crate) globals: wgpu::Buffer,
    pub(crate) instances: Grown,
    /// Instances of the last list, reused from frame to frame.
    drawn: Vec<Instance>,
    pub(crate) marks: Grown,
    pub(crate) targets: Option<Targets>,
    shadow_map: wgpu::TextureView,
    shadow_sampler: wgpu::Sampler,
    /// Direction to the sun.
    pub(crate) sun: Vec3,
    /// The explanation of visibility, if requested.
    explanation: Option<wgpu::TextureView>,
    format: wgpu::TextureFormat,
}

/// A world's bind groups and shadow map.
pub struct RenderStage {
    world: wgpu::BindGroup,
    pub(crate) light: Light,
    shadow_from_world: Mat4,
    /// Size of a texel of the shadow map. [Units: wu]
    texel: f32,
}

impl Renderer {
    /// Returns a renderer of pictures for files.
    #[must_use]
    pub fn new(gpu: &Gpu) -> Self {
        Self::with_format(gpu, COLOR)
    }

    /// Returns a renderer to targets of a format, such as a window's.
    #[must_use]
    pub fn with_format(gpu: &Gpu, format: wgpu::TextureFormat) -> Self {
        let layouts = Layouts::new(gpu);
        let pipelines = Pipelines::new(gpu, &layouts, format);
        let side = SHADOW_SIDE.min(gpu.device.limits().max_texture_dimension_2d);
        let shadow_map = texture(
            gpu,
            "shadow",
            [side, side],
            DEPTH,
            wgpu::TextureUsages::TEXTURE_BINDING,
        );
        let shadow_sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            compare: Some(wgpu::CompareFunction::LessEqual),
            ..wgpu::SamplerDescriptor::default()
        });
        Self {
            layouts,
            pipelines,
            globals: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("globals"),
                size: size_of::<Globals>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            instances: Grown::new(gpu, wgpu::BufferUsages::VERTEX),
            drawn: Vec::new(),
            marks: Grown::new(gpu, wgpu::BufferUsages::VERTEX),
            targets: None,
            shadow_map: shadow_map.create_view(&wgpu::TextureViewDescriptor::default()),
            shadow_sampler,
            sun: Vec3::new(0.45, 0.75, 0.32).normalize(),
            explanation: None,
            format,
        }
    }

    pub(crate) fn format(&self) -> wgpu::TextureFormat {
        self.format
    }

    /// Prepares a world for this renderer: bind groups and shadow map. `everything` is the list of the whole
    /// world, `light` its light. One world at a time: the shadow map is that of the last.
    pub(crate) fn set_stage(
        &mut self,
        gpu: &Gpu,
        world: &GpuWorld,
        light: Light,
        everything: &RenderList,
    ) -> RenderStage {
        let (shadow_from_world, texel) = self.sun_view(world);
        let stage = RenderStage {
            world: self.world_group(gpu, &light),
            light,
            shadow_from_world,
            texel,
        };
        self.draw_shadows(gpu, world, &stage, everything);
        stage
    }

    fn world_group(&self, gpu: &Gpu, light: &Light) -> wgpu::BindGroup {
        let view = |binding, view| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::TextureView(view),
        };
        let sampler = |binding, sampler| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::Sampler(sampler),
        };
        // Without an explanation, bind a table of the same type that shaders ignore.
        let explanation = self.explanation.as_ref().unwrap_or(&light.table);
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("world"),
            layout: &self.layouts.world,
            entries: &[
                bound(0, &self.globals),
                view(1, &self.shadow_map),
                sampler(2, &self.shadow_sampler),
                view(3, &light.table),
                view(4, &light.starts),
                view(5, &light.probes),
                sampler(6, &light.sampler),
                view(7, explanation),
            ],
        })
    }

    /// Colors surfaces by why they are visible or not from now on; `None` ends that.
    pub(crate) fn explain(
        &mut self,
        gpu: &Gpu,
        stage: &mut RenderStage,
        explanation: Option<wgpu::TextureView>,
    ) {
        self.explanation = explanation;
        stage.world = self.world_group(gpu, &stage.light);
    }

    /// Returns the view of the sun: parallel, over the whole world.
    fn sun_view(&self, world: &GpuWorld) -> (Mat4, f32) {
        let [low, high] = world.bounds;
        let center = (low + high) * 0.5;
        let radius = ((high - low).length() * 0.5).max(0.1);
        let back = Mat4::look_to_rh(center + self.sun * radius, -self.sun, Vec3::Z);
        let flat = Mat4::orthographic_rh(-radius, radius, -radius, radius, 0.0, 2.0 * radius);
        (flat * back, 2.0 * radius / SHADOW_SIDE as f32)
    }

    /// Draws the shadow map.
    pub(crate) fn draw_shadows(
        &mut self,
        gpu: &Gpu,
        world: &GpuWorld,
        stage: &RenderStage,
        all: &RenderList,
    ) {
        let projection = Projection::parallel([0.0; 3], [0.0, -1.0, 0.0], 1.0, 1.0, 1.0);
        self.write_globals(gpu, stage, &projection, &Style::default(), [1, 1]);
        self.write_instances(gpu, world, all);
        let group = self.globals_group(gpu);
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("shadow"),
                depth_stencil_attachment: Some(depth_attachment(&self.shadow_map, Some(1.0))),
                ..wgpu::RenderPassDescriptor::default()
            });
            pass.set_pipeline(&self.pipelines.shadow);
            pass.set_bind_group(0, &group, &[]);
            set_buffers(&mut pass, world, &self.instances);
            for run in &all.opaque {
                pass.draw_indexed(run.first..run.first + run.n, 0, run.instances.clone());
            }
        }
        gpu.queue.submit([encoder.finish()]);
    }

    pub(crate) fn globals_group(&self, gpu: &Gpu) -> wgpu::BindGroup {
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("globals"),
            layout: &self.layouts.globals,
            entries: &[bound(0, &self.globals)],
        })
    }

    /// Writes the instances of a list in its order.
    pub(crate) fn write_instances(&mut self, gpu: &Gpu, world: &GpuWorld, list: &RenderList) {
        self.drawn.clear();
        self.drawn.extend(list.instances.iter().map(|&key| {
            let number = (key & crate::list::INSTANCE_MASK) as usize;
            world.instances[number].drawn(key)
        }));
        self.instances.write(gpu, bytemuck::cast_slice(&self.drawn));
    }

    pub(crate) fn write_globals(
        &self,
        gpu: &Gpu,
        stage: &RenderStage,
        projection: &Projection,
        style: &Style,
        size: [u32; 2],
    ) {
        let [w, h] = size.map(|n| n as f32);
        let globals = Globals {
            clip_from_relative: projection.clip_from_relative.to_cols_array_2d(),
            relative_from_clip: projection.clip_from_relative.inverse().to_cols_array_2d(),
            shadow_from_world: stage.shadow_from_world.to_cols_array_2d(),
            origin: projection.origin.extend(style.cut_above).to_array(),
            eye: projection
                .eye
                .extend(f32::from(u8::from(projection.is_parallel)))
                .to_array(),
            sun: self.sun.extend(stage.texel).to_array(),
            size: [w, h, 1.0 / w, 1.0 / h],
            style: [
                u32::from(style.paint == Paint::Cells),
                u32::from(self.explanation.is_some()),
                0,
                0,
            ],
            light: {
                // Parallel pictures have one exposure for all rooms.
                let is_eye = !projection.is_parallel && style.daylight;
                stage.light.globals(projection.origin, is_eye)
            },
        };
        gpu.queue
            .write_buffer(&self.globals, 0, bytemuck::bytes_of(&globals));
    }

    /// Makes the targets of a size unless they exist.
    pub(crate) fn resize(&mut self, gpu: &Gpu, size: [u32; 2]) -> Result<(), RenderError> {
        if self.targets.as_ref().is_some_and(|t| t.size == size) {
            return Ok(());
        }
        gpu.check_picture(size)?;
        let usage = wgpu::TextureUsages::TEXTURE_BINDING;
        let view = |label, format| {
            texture(gpu, label, size, format, usage)
                .create_view(&wgpu::TextureViewDescriptor::default())
        };
        let (color, depth) = (view("color", COLOR), view("depth", DEPTH));
        let post = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("post"),
            layout: &self.layouts.post,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::TextureView(&color),
                },
                wgpu::BindGroupEntry {
                    binding: 1,
                    resource: wgpu::BindingResource::TextureView(&depth),
                },
            ],
        });
        self.targets = Some(Targets {
            size,
            color,
            depth,
            post,
        });
        Ok(())
    }

    /// Draws a frame to `output`, a texture of the renderer's format and of `size`.
    ///
    /// # Errors
    ///
    /// A size beyond the adapter's limit.
    pub fn draw(
        &mut self,
        gpu: &Gpu,
        world: &GpuWorld,
        stage: &RenderStage,
        frame: &Frame<'_>,
        output: &wgpu::TextureView,
        size: [u32; 2],
    ) -> Result<(), RenderError> {
        self.resize(gpu, size)?;
        self.write_globals(gpu, stage, &frame.projection, &frame.style, size);
        let list = frame.list;
        self.write_instances(gpu, world, list);
        let marks = self.write_marks(gpu, world, frame, size);
        let globals = self.globals_group(gpu);
        let shadings = Shadings::of(frame, stage.light.is_known(), self.explanation.is_some());
        shadings.prepare(gpu, &self.layouts, &mut self.pipelines, list);
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let Some(targets) = &self.targets else {
            return Ok(());
        };
        // Ambient occlusion and counts need the whole image; otherwise one pass draws everything.
        let in_two = !shadings.is_last;
        let first = if in_two { &targets.color } else { output };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("surfaces"),
            color_attachments: &[Some(color_attachment(
                first,
                Some(wgpu::Color::TRANSPARENT),
            ))],
            depth_stencil_attachment: Some(depth_attachment(&targets.depth, Some(0.0))),
            ..wgpu::RenderPassDescriptor::default()
        });
        self.draw_surfaces(&mut pass, world, stage, &shadings, list, size);
        if in_two {
            drop(pass);
            self.draw_picture(&mut encoder, &globals, targets, &shadings, output);
            pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("glass"),
                color_attachments: &[Some(color_attachment(output, None))],
                depth_stencil_attachment: Some(depth_attachment(&targets.depth, None)),
                ..wgpu::RenderPassDescriptor::default()
            });
        } else {
            pass.set_scissor_rect(0, 0, size[0], size[1]);
            pass.set_pipeline(&self.pipelines.sky);
            pass.set_bind_group(0, &globals, &[]);
            pass.draw(0..3, 0..1);
        }
        if !list.transparent.is_empty() && !shadings.is_count {
            pass.set_bind_group(0, &stage.world, &[]);
            set_buffers(&mut pass, world, &self.instances);
            draw_runs(&mut pass, world, &list.transparent, size, |run| {
                self.pipelines.surface(shadings.glass(run))
            });
        }
        self.draw_marks(&mut pass, &globals, &marks, size);
        drop(pass);
        gpu.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Writes the vertices of marks, those hidden by surfaces first; returns both ranges.
    fn write_marks(
        &mut self,
        gpu: &Gpu,
        world: &GpuWorld,
        frame: &Frame<'_>,
        size: [u32; 2],
    ) -> [Range<u32>; 2] {
        let stand_ins: Vec<Mark> = frame
            .list
            .stand_ins
            .iter()
            .map(|&(portal, cell)| world.stand_in(portal, cell))
            .collect();
        let [behind, _] = crate::marks::corners(&stand_ins, &frame.projection, size);
        let [hidden, on_top] = crate::marks::corners(frame.marks, &frame.projection, size);
        let hidden = [behind, hidden].concat();
        let n_hidden = hidden.len() as u32;
        let marks = [hidden, on_top].concat();
        self.marks.write(gpu, bytemuck::cast_slice(&marks));
        [0..n_hidden, n_hidden..marks.len() as u32]
    }

    fn draw_surfaces(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        world: &GpuWorld,
        stage: &RenderStage,
        shadings: &Shadings,
        list: &RenderList,
        size: [u32; 2],
    ) {
        pass.set_bind_group(0, &stage.world, &[]);
        set_buffers(pass, world, &self.instances);
        let surface = |run: &Run| self.pipelines.surface(shadings.opaque(run));
        draw_runs(pass, world, &list.opaque, size, surface);
        if shadings.is_count {
            draw_runs(pass, world, &list.transparent, size, surface);
        }
    }

    /// Draws the image of the surfaces to `output`, with ambient occlusion or as counts.
    fn draw_picture(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        globals: &wgpu::BindGroup,
        targets: &Targets,
        shadings: &Shadings,
        output: &wgpu::TextureView,
    ) {
        let mut picture = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("picture"),
            color_attachments: &[Some(color_attachment(output, Some(wgpu::Color::BLACK)))],
            ..wgpu::RenderPassDescriptor::default()
        });
        picture.set_pipeline(if shadings.is_count {
            &self.pipelines.heat_map
        } else {
            &self.pipelines.post
        });
        picture.set_bind_group(0, globals, &[]);
        picture.set_bind_group(1, &targets.post, &[]);
        picture.draw(0..3, 0..1);
    }

    fn draw_marks(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        globals: &wgpu::BindGroup,
        [hidden, on_top]: &[Range<u32>; 2],
        size: [u32; 2],
    ) {
        if on_top.end == 0 {
            return;
        }
        pass.set_scissor_rect(0, 0, size[0], size[1]);
        pass.set_bind_group(0, globals, &[]);
        pass.set_vertex_buffer(0, self.marks.buffer.slice(..));
        pass.set_pipeline(&self.pipelines.marks);
        pass.draw(hidden.clone(), 0..1);
        pass.set_pipeline(&self.pipelines.marks_on_top);
        pass.draw(on_top.clone(), 0..1);
    }

    /// Draws a frame and reads it back.
    ///
    /// # Errors
    ///
    /// A size beyond the adapter's limit; a device that was lost.
    ///
    /// # Panics
    ///
    /// If the renderer was made for a window's format, which cannot be read back.
    pub fn picture(
        &mut self,
        gpu: &Gpu,
        world: &GpuWorld,
        stage: &RenderStage,
        frame: &Frame<'_>,
        size: [u32; 2],
    ) -> Result<Picture, RenderError> {
        assert_eq!(self.format, COLOR, "pictures are {COLOR:?}");
        self.resize(gpu, size)?;
        let target = texture(gpu, "picture", size, COLOR, wgpu::TextureUsages::COPY_SRC);
        let view = target.create_view(&wgpu::TextureViewDescriptor::default());
        self.draw(gpu, world, stage, frame, &view, size)?;
        let [width, height] = size;
        let rgba = read_texture(gpu, &target, size, 4)?;
        Ok(Picture {
            width,
            height,
            rgba,
        })
    }
}
