//! Frames: surfaces, then the picture of them, then what is seen through.

use glam::{Mat4, Vec3};

use crate::camera::Projection;
use crate::gpu::{Gpu, RenderError};
use crate::list::{DrawList, Run};
use crate::marks::Mark;
use crate::picture::Picture;
use crate::pipelines::{COLOR, DEPTH, Layouts, Pipelines, Shading, Variant};
use crate::scene::{Finish, GpuWorld, Instance};

/// Side of the sun's picture of the world, in texels.
const SHADOW_SIDE: u32 = 4096;

/// How surfaces are painted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Paint {
    /// As they look.
    #[default]
    Lit,
    /// In the color of a cell that sees them.
    Cells,
    /// By how many times each pixel is drawn.
    Overdraw,
}

/// How a frame looks, apart from what is in it.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    /// How surfaces are painted.
    pub paint: Paint,
    /// Whether corners are darkened; costs about as much as all else.
    pub dark_corners: bool,
    /// Whether the sun casts shadows; their picture is made with the first frame of a world.
    pub shadows: bool,
    /// What is higher is not drawn: a ceiling taken off. [Units: wu]
    pub cut_above: f32,
}

impl Default for Style {
    fn default() -> Self {
        Self {
            paint: Paint::Lit,
            dark_corners: true,
            shadows: true,
            cut_above: f32::INFINITY,
        }
    }
}

/// One frame.
#[derive(Clone, Copy)]
pub struct Frame<'a> {
    /// What takes points to the screen.
    pub projection: Projection,
    /// What is drawn.
    pub list: &'a DrawList,
    /// How it looks.
    pub style: Style,
    /// Lines and polygons over it.
    pub marks: &'a [Mark],
}

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
}

/// What frames of one size are drawn to on their way.
pub(crate) struct Targets {
    pub(crate) size: [u32; 2],
    pub(crate) color: wgpu::TextureView,
    pub(crate) depth: wgpu::TextureView,
    post: wgpu::BindGroup,
}

/// A buffer that grows.
pub(crate) struct Grown {
    pub(crate) buffer: wgpu::Buffer,
    usage: wgpu::BufferUsages,
}

impl Grown {
    pub(crate) fn new(gpu: &Gpu, usage: wgpu::BufferUsages) -> Self {
        let usage = usage | wgpu::BufferUsages::COPY_DST;
        Self {
            buffer: Self::make(gpu, usage, 1 << 16),
            usage,
        }
    }

    fn make(gpu: &Gpu, usage: wgpu::BufferUsages, size: u64) -> wgpu::Buffer {
        gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("frame"),
            size,
            usage,
            mapped_at_creation: false,
        })
    }

    pub(crate) fn write(&mut self, gpu: &Gpu, bytes: &[u8]) {
        if self.buffer.size() < bytes.len() as u64 {
            let size = (bytes.len() as u64).next_power_of_two();
            self.buffer = Self::make(gpu, self.usage, size);
        }
        gpu.queue.write_buffer(&self.buffer, 0, bytes);
    }
}

/// Draws worlds; one for each format of picture.
pub struct Renderer {
    pub(crate) layouts: Layouts,
    pub(crate) pipelines: Pipelines,
    pub(crate) globals: wgpu::Buffer,
    pub(crate) instances: Grown,
    /// What is written to it, kept from frame to frame.
    drawn: Vec<Instance>,
    pub(crate) marks: Grown,
    pub(crate) targets: Option<Targets>,
    shadow_map: wgpu::TextureView,
    shadow_sampler: wgpu::Sampler,
    /// Direction to the sun.
    sun: Vec3,
    format: wgpu::TextureFormat,
}

/// A world's bind groups and the sun's picture of it.
pub struct Stage {
    world: wgpu::BindGroup,
    shadow_from_world: Mat4,
    /// Of a texel of the shadow map. [Units: wu]
    texel: f32,
}

impl Renderer {
    /// A renderer of pictures that go to files.
    #[must_use]
    pub fn new(gpu: &Gpu) -> Self {
        Self::with_format(gpu, COLOR)
    }

    /// A renderer to targets of a format, such as a window's.
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
            format,
        }
    }

    pub(crate) fn format(&self) -> wgpu::TextureFormat {
        self.format
    }

    /// Makes a world ready to be drawn by this renderer: bind groups, and what the sun sees.
    /// `everything` is the list of all. One world at a time: the sun's picture is of the last.
    pub fn set_stage(&mut self, gpu: &Gpu, world: &GpuWorld, everything: &DrawList) -> Stage {
        let (shadow_from_world, texel) = self.sun_view(world);
        let stage = Stage {
            world: gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("world"),
                layout: &self.layouts.world,
                entries: &[
                    bound(0, &self.globals),
                    bound(1, &world.cell_colors),
                    wgpu::BindGroupEntry {
                        binding: 2,
                        resource: wgpu::BindingResource::TextureView(&self.shadow_map),
                    },
                    wgpu::BindGroupEntry {
                        binding: 3,
                        resource: wgpu::BindingResource::Sampler(&self.shadow_sampler),
                    },
                ],
            }),
            shadow_from_world,
            texel,
        };
        self.draw_shadows(gpu, world, &stage, everything);
        stage
    }

    /// Parallel light over the whole world.
    fn sun_view(&self, world: &GpuWorld) -> (Mat4, f32) {
        let [low, high] = world.bounds;
        let center = (low + high) * 0.5;
        let radius = ((high - low).length() * 0.5).max(0.1);
        let back = Mat4::look_to_rh(center + self.sun * radius, -self.sun, Vec3::Z);
        let flat = Mat4::orthographic_rh(-radius, radius, -radius, radius, 0.0, 2.0 * radius);
        (flat * back, 2.0 * radius / SHADOW_SIDE as f32)
    }

    fn draw_shadows(&mut self, gpu: &Gpu, world: &GpuWorld, stage: &Stage, all: &DrawList) {
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

    /// Where what a list draws stands, in its order.
    pub(crate) fn write_instances(&mut self, gpu: &Gpu, world: &GpuWorld, list: &DrawList) {
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
        stage: &Stage,
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
            style: [u32::from(style.paint == Paint::Cells), 0, 0, 0],
        };
        gpu.queue
            .write_buffer(&self.globals, 0, bytemuck::bytes_of(&globals));
    }

    /// Makes the targets of a size, unless they are there.
    pub(crate) fn resize(&mut self, gpu: &Gpu, size: [u32; 2]) -> Result<(), RenderError> {
        if self.targets.as_ref().is_some_and(|t| t.size == size) {
            return Ok(());
        }
        let side = u64::from(size[0].max(size[1]));
        Gpu::check(
            "a side of the picture",
            side,
            gpu.device.limits().max_texture_dimension_2d,
        )?;
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
        stage: &Stage,
        frame: &Frame<'_>,
        output: &wgpu::TextureView,
        size: [u32; 2],
    ) -> Result<(), RenderError> {
        self.resize(gpu, size)?;
        self.write_globals(gpu, stage, &frame.projection, &frame.style, size);
        let list = frame.list;
        self.write_instances(gpu, world, list);
        let stand_ins: Vec<Mark> = list
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
        let globals = self.globals_group(gpu);
        let shadings = Shadings::of(frame);
        shadings.prepare(self, gpu, list);
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let Some(targets) = &self.targets else {
            return Ok(());
        };
        // What darkens corners or counts needs the whole picture; else all is drawn in one go.
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
        pass.set_bind_group(0, &stage.world, &[]);
        set_buffers(&mut pass, world, &self.instances);
        draw_runs(&mut pass, world, &list.opaque, size, |run| {
            self.pipelines.surface(shadings.opaque(run))
        });
        if shadings.is_count {
            draw_runs(&mut pass, world, &list.transparent, size, |run| {
                self.pipelines.surface(shadings.opaque(run))
            });
        }
        if in_two {
            drop(pass);
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
            picture.set_bind_group(0, &globals, &[]);
            picture.set_bind_group(1, &targets.post, &[]);
            picture.draw(0..3, 0..1);
            drop(picture);
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
        if !marks.is_empty() {
            pass.set_scissor_rect(0, 0, size[0], size[1]);
            pass.set_bind_group(0, &globals, &[]);
            pass.set_vertex_buffer(0, self.marks.buffer.slice(..));
            pass.set_pipeline(&self.pipelines.marks);
            pass.draw(0..n_hidden, 0..1);
            pass.set_pipeline(&self.pipelines.marks_on_top);
            pass.draw(n_hidden..marks.len() as u32, 0..1);
        }
        drop(pass);
        gpu.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Draws a frame and brings it back.
    ///
    /// # Errors
    ///
    /// A size beyond the adapter's limit; a device that was lost.
    ///
    /// # Panics
    ///
    /// When the renderer was made for a window's format: those are not brought back.
    pub fn picture(
        &mut self,
        gpu: &Gpu,
        world: &GpuWorld,
        stage: &Stage,
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

pub(crate) fn bound(binding: u32, buffer: &wgpu::Buffer) -> wgpu::BindGroupEntry<'_> {
    wgpu::BindGroupEntry {
        binding,
        resource: buffer.as_entire_binding(),
    }
}

pub(crate) fn texture(
    gpu: &Gpu,
    label: &str,
    [width, height]: [u32; 2],
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d {
            width,
            height,
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: usage | wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    })
}

pub(crate) fn color_attachment(
    view: &wgpu::TextureView,
    clear: Option<wgpu::Color>,
) -> wgpu::RenderPassColorAttachment<'_> {
    wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations {
            load: clear.map_or(wgpu::LoadOp::Load, wgpu::LoadOp::Clear),
            store: wgpu::StoreOp::Store,
        },
    }
}

pub(crate) fn depth_attachment(
    view: &wgpu::TextureView,
    clear: Option<f32>,
) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(wgpu::Operations {
            load: clear.map_or(wgpu::LoadOp::Load, wgpu::LoadOp::Clear),
            store: wgpu::StoreOp::Store,
        }),
        stencil_ops: None,
    }
}

pub(crate) fn set_buffers(pass: &mut wgpu::RenderPass<'_>, world: &GpuWorld, instances: &Grown) {
    pass.set_index_buffer(world.indices.slice(..), wgpu::IndexFormat::Uint32);
    pass.set_vertex_buffer(0, world.corners.slice(..));
    pass.set_vertex_buffer(1, instances.buffer.slice(..));
}

/// Which pipelines a frame draws with.
struct Shadings {
    is_count: bool,
    is_last: bool,
    casts_shadows: bool,
    explains: bool,
    /// A cut makes holes in everything.
    has_cut: bool,
}

impl Shadings {
    fn of(frame: &Frame<'_>) -> Self {
        let style = &frame.style;
        let is_count = style.paint == Paint::Overdraw;
        let is_reasoned = |&key: &u32| key & !crate::list::INSTANCE_MASK != 0;
        Self {
            is_count,
            is_last: !is_count && !style.dark_corners,
            casts_shadows: style.shadows,
            explains: style.paint == Paint::Cells || frame.list.instances.iter().any(is_reasoned),
            has_cut: style.cut_above < f32::INFINITY,
        }
    }

    fn variant(&self, shading: Shading, is_smooth: bool, is_last: bool) -> Variant {
        if self.is_count {
            return Variant {
                shading: Shading::Count,
                is_smooth: false,
                casts_shadows: false,
                explains: false,
                is_last: false,
            };
        }
        Variant {
            shading,
            is_smooth,
            casts_shadows: self.casts_shadows,
            explains: self.explains,
            is_last,
        }
    }

    fn opaque(&self, run: &Run) -> Variant {
        let shading = match run.finish {
            Finish::Plain if !self.has_cut => Shading::Plain,
            Finish::Textured if !self.has_cut => Shading::Textured,
            _ => Shading::Masked,
        };
        self.variant(shading, run.is_smooth, self.is_last)
    }

    fn glass(&self, run: &Run) -> Variant {
        self.variant(Shading::Glass, run.is_smooth, true)
    }

    /// Makes those that a list needs.
    fn prepare(&self, renderer: &mut Renderer, gpu: &Gpu, list: &DrawList) {
        let mut prepare = |variant| {
            renderer.pipelines.prepare(gpu, &renderer.layouts, variant);
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

/// Draws runs, changing pipelines, textures and scissors only where they differ. `surface` by run.
fn draw_runs<'p>(
    pass: &mut wgpu::RenderPass<'_>,
    world: &GpuWorld,
    runs: &[Run],
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

/// The bytes of a texture, rows one after the other.
pub(crate) fn read_texture(
    gpu: &Gpu,
    texture: &wgpu::Texture,
    [width, height]: [u32; 2],
    bytes_per_pixel: u32,
) -> Result<Vec<u8>, RenderError> {
    let row = width * bytes_per_pixel;
    let stride = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("back"),
        size: u64::from(stride) * u64::from(height),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = gpu
        .device
        .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(stride),
                rows_per_image: None,
            },
        },
        wgpu::Extent3d {
            width,
            height,
            depth_or_array_layers: 1,
        },
    );
    gpu.queue.submit([encoder.finish()]);
    let mapped = map_bytes(gpu, &buffer)?;
    let mut out = Vec::with_capacity((row * height) as usize);
    for line in mapped.chunks_exact(stride as usize) {
        out.extend_from_slice(&line[..row as usize]);
    }
    Ok(out)
}

/// The bytes of a buffer, once all that was submitted is done.
pub(crate) fn map_bytes(gpu: &Gpu, buffer: &wgpu::Buffer) -> Result<Vec<u8>, RenderError> {
    let lost = |why: String| RenderError::Lost(why);
    let (sender, receiver) = std::sync::mpsc::channel();
    buffer.map_async(wgpu::MapMode::Read, .., move |result| {
        // Nobody listens any more where waiting failed.
        let _ = sender.send(result);
    });
    gpu.wait()?;
    receiver
        .recv()
        .map_err(|why| lost(why.to_string()))?
        .map_err(|why| lost(why.to_string()))?;
    let mapped = buffer
        .get_mapped_range(..)
        .map_err(|why| lost(why.to_string()))?;
    Ok(mapped.to_vec())
}
