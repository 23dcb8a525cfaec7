//! The passes of a frame: opaque surfaces, effects on their image, transparent surfaces.

use std::ops::Range;

use enfilade_world::Pose;
use glam::{Mat4, Vec3};

use crate::camera::Projection;
use crate::context_targets::ContextTargets;
use crate::formats::DEPTH;
use crate::frame::{Paint, Style};
use crate::gpu::{Gpu, RenderError};
use crate::lamps::LampMaps;
use crate::light::Light;
use crate::list::Run;
use crate::marks::PictureMark;
use crate::picture::Picture;
use crate::pipelines::{Layouts, Pipelines};
use crate::props::{PropDraw, PropMeshes};
use crate::resources::{Grown, bound, color_attachment, depth_attachment, read_texture, texture};
use crate::shadings::{Shadings, draw_runs, set_buffers};
use crate::shown::{DrawnPart, PartView, Shown};
use crate::stage::{
    Exposed, Globals, GlobalsBuffer, RenderStage, StageView, Sunlight, lamp_buffer,
};
use crate::targets::Targets;

/// Side of the shadow map. [Units: texels]
const SHADOW_SIDE: u32 = 4096;

/// Draws worlds; one for each texture format.
pub(crate) struct Renderer {
    pub(crate) layouts: Layouts,
    pub(crate) pipelines: Pipelines,
    /// Parameters of a frame in the camera's own frame.
    pub(crate) camera: GlobalsBuffer,
    pub(crate) marks: Grown,
    pub(crate) props: PropMeshes,
    pub(crate) lamps: LampMaps,
    pub(crate) targets: Option<Targets>,
    pub(crate) contexts: ContextTargets,
    shadow_map: wgpu::TextureView,
    shadow_sampler: wgpu::Sampler,
    pub(crate) sun: Sunlight,
    format: wgpu::TextureFormat,
}

impl Renderer {
    /// Returns a renderer to targets of a format, such as a window's. `sun` points to the sun.
    pub(crate) fn new(gpu: &Gpu, format: wgpu::TextureFormat, sun: Vec3) -> Self {
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
            camera: GlobalsBuffer::new(gpu, &layouts),
            layouts,
            pipelines,
            marks: Grown::new(gpu, wgpu::BufferUsages::VERTEX),
            props: PropMeshes::new(gpu),
            lamps: LampMaps::none(gpu),
            targets: None,
            contexts: ContextTargets::new(gpu),
            shadow_map: shadow_map.create_view(&wgpu::TextureViewDescriptor::default()),
            shadow_sampler,
            sun: Sunlight {
                toward: sun,
                map_from_root: Mat4::IDENTITY,
                texel: 0.0,
            },
            format,
        }
    }

    pub(crate) fn format(&self) -> wgpu::TextureFormat {
        self.format
    }

    /// Prepares a world with its light for this renderer.
    pub(crate) fn stage(&self, gpu: &Gpu, light: Light) -> RenderStage {
        let view = self.stage_view(gpu, &light, None);
        RenderStage::new(view, light)
    }

    /// Makes the buffers for one more view of a world.
    pub(crate) fn stage_view(
        &self,
        gpu: &Gpu,
        light: &Light,
        explanation: Option<&wgpu::TextureView>,
    ) -> StageView {
        let globals = GlobalsBuffer::new(gpu, &self.layouts);
        let lamps = lamp_buffer(gpu);
        let group = self.world_group(gpu, [&globals.buffer, &lamps], light, explanation);
        StageView::new(gpu, group, globals, lamps)
    }

    fn world_group(
        &self,
        gpu: &Gpu,
        [globals, lamps]: [&wgpu::Buffer; 2],
        light: &Light,
        explanation: Option<&wgpu::TextureView>,
    ) -> wgpu::BindGroup {
        let view = |binding, view| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::TextureView(view),
        };
        let sampler = |binding, sampler| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::Sampler(sampler),
        };
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("world"),
            layout: &self.layouts.world,
            entries: &[
                bound(0, globals),
                view(1, &self.shadow_map),
                sampler(2, &self.shadow_sampler),
                view(3, &light.table),
                view(4, &light.starts),
                view(5, &light.probes),
                sampler(6, &light.sampler),
                // Without an explanation, bind a table of the same type that shaders ignore.
                view(7, explanation.unwrap_or(&light.table)),
                bound(8, lamps),
                view(9, &self.lamps.array),
                view(10, &light.lit.view()),
            ],
        })
    }

    /// Colors surfaces by why they are visible or not from now on; `None` ends that.
    pub(crate) fn explain(
        &self,
        gpu: &Gpu,
        stage: &mut RenderStage,
        explanation: Option<wgpu::TextureView>,
    ) {
        stage.explanation = explanation;
        self.bind(gpu, stage);
    }

    /// Binds the renderer's textures to a stage anew.
    pub(crate) fn bind(&self, gpu: &Gpu, stage: &mut RenderStage) {
        let explanation = stage.explanation.as_ref();
        for view in &mut stage.views {
            let buffers = [&view.globals.buffer, &view.lamps];
            view.group = self.world_group(gpu, buffers, &stage.light, explanation);
        }
    }

    /// Points the shadow map's view along the sun, parallel, over all worlds.
    fn aim_sun(&mut self, parts: &[DrawnPart<'_>]) {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for part in parts {
            let [a, b] = part.world.bounds;
            for i in 0..8 {
                let side = |k: usize| if i >> k & 1 == 0 { a[k] } else { b[k] };
                let p = Vec3::new(side(0), side(1), side(2)).as_dvec3();
                let p = part.stage.pose.point(p).as_vec3();
                (low, high) = (low.min(p), high.max(p));
            }
        }
        let toward = self.sun.toward;
        let center = (low + high) * 0.5;
        let radius = ((high - low).length() * 0.5).max(0.1);
        let back = Mat4::look_to_rh(center + toward * radius, -toward, Vec3::Z);
        let flat = Mat4::orthographic_rh(-radius, radius, -radius, radius, 0.0, 2.0 * radius);
        self.sun.map_from_root = flat * back;
        self.sun.texel = 2.0 * radius / SHADOW_SIDE as f32;
    }

    /// Draws the shadow map: `parts` are all worlds, each with the list of everything in it.
    pub(crate) fn draw_shadows(&mut self, gpu: &Gpu, parts: &mut [DrawnPart<'_>]) {
        self.aim_sun(parts);
        let projection = Projection::parallel([0.0; 3], [0.0, -1.0, 0.0], 1.0, 1.0, 1.0);
        let exposed = Exposed {
            style: &Style::default(),
            size: [1, 1],
            sun: self.sun,
            exposure: 1.0,
            day: 1.0,
            lamps: &[],
        };
        for part in &mut *parts {
            part.stage.write_globals(gpu, &projection, &exposed);
            part.stage.write_instances(gpu, part.world, part.list);
        }
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
            for part in parts {
                pass.set_bind_group(0, &part.stage.first().globals.group, &[]);
                set_buffers(&mut pass, part.world, &part.stage.first().instances);
                for run in &part.list.opaque {
                    pass.draw_indexed(run.first..run.first + run.n, 0, run.instances.clone());
                }
            }
        }
        gpu.queue.submit([encoder.finish()]);
    }

    /// Writes the parameters of a frame of the camera alone, in the frame of the first world.
    pub(crate) fn write_camera(&self, gpu: &Gpu, projection: &Projection, size: [u32; 2]) {
        let exposed = Exposed {
            style: &Style::default(),
            size,
            sun: self.sun,
            exposure: 1.0,
            day: 1.0,
            lamps: &[],
        };
        let globals = Globals::new(projection, &Pose::IDENTITY, &exposed);
        self.camera.write(gpu, &globals);
    }

    /// Makes the targets of a size unless they exist.
    pub(crate) fn resize(&mut self, gpu: &Gpu, size: [u32; 2]) -> Result<(), RenderError> {
        if self.targets.as_ref().is_none_or(|t| t.size != size) {
            self.targets = Some(Targets::new(gpu, &self.layouts, size)?);
        }
        Ok(())
    }

    /// Draws a frame to `output`, a texture of the renderer's format and of `size`.
    pub(crate) fn draw(
        &mut self,
        gpu: &Gpu,
        parts: &mut [DrawnPart<'_>],
        shown: &Shown<'_>,
        output: &wgpu::TextureView,
        size: [u32; 2],
    ) -> Result<(), RenderError> {
        self.resize(gpu, size)?;
        let exposed = Exposed {
            style: &shown.style,
            size,
            sun: self.sun,
            exposure: shown.exposure,
            day: shown.day,
            lamps: shown.lamps,
        };
        let globals = Globals::new(&shown.projection, &shown.pose, &exposed);
        self.camera.write(gpu, &globals);
        for part in &mut *parts {
            let projection = shown.projection_in(part.stage);
            part.stage.write_globals(gpu, &projection, &exposed);
            part.stage.write_instances(gpu, part.world, part.list);
            self.lamps
                .write_lit(gpu, part.id, shown.lamps, &mut part.stage.light);
        }
        let marks = self.write_marks(gpu, parts, shown, size);
        let shadings: Vec<Shadings> = (parts.iter())
            .map(|p| Shadings::of(&shown.style, p.list, p.stage, shown.lamps.len()))
            .collect();
        let ids = parts.iter().map(|p| p.id);
        let props = self.props.write(gpu, shown.props, ids);
        for ((part, shadings), props) in parts.iter().zip(&shadings).zip(&props) {
            shadings.prepare(gpu, &self.layouts, &mut self.pipelines, part.list);
            for prop in props {
                let variant = shadings.prop(prop.span.is_smooth);
                self.pipelines.prepare(gpu, &self.layouts, variant);
            }
        }
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let Some(targets) = &self.targets else {
            return Ok(());
        };
        // Ambient occlusion and counts need the whole image; otherwise one pass draws everything.
        let is_count = shown.style.paint == Paint::Overdraw;
        let in_two = is_count || shown.style.dark_corners;
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
        for ((part, shadings), props) in parts.iter().zip(&shadings).zip(&props) {
            self.draw_surfaces(&mut pass, part.as_view(), shadings, size);
            self.draw_props(&mut pass, part.as_view(), shadings, props, size);
        }
        if let (Some(doorways), Some(part)) = (shown.textures, parts.first()) {
            pass.set_scissor_rect(0, 0, size[0], size[1]);
            doorways.draw(&mut pass, &part.stage.first().globals.group);
        }
        if in_two {
            drop(pass);
            let post = match shown.textures {
                _ if is_count => &self.pipelines.heat_map,
                Some(_) => &self.pipelines.post_textured,
                None => &self.pipelines.post,
            };
            self.draw_picture(&mut encoder, targets, post, output);
            pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("glass"),
                color_attachments: &[Some(color_attachment(output, None))],
                depth_stencil_attachment: Some(depth_attachment(&targets.depth, None)),
                ..wgpu::RenderPassDescriptor::default()
            });
        } else {
            pass.set_scissor_rect(0, 0, size[0], size[1]);
            pass.set_pipeline(&self.pipelines.sky);
            pass.set_bind_group(0, &self.camera.group, &[]);
            pass.draw(0..3, 0..1);
        }
        if !is_count {
            self.draw_glass(&mut pass, parts, &shadings, size);
        }
        let pipelines = [&self.pipelines.marks, &self.pipelines.marks_on_top];
        self.draw_marks(&mut pass, &marks, size, pipelines);
        drop(pass);
        gpu.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Writes the vertices of marks, those hidden by surfaces first; returns both ranges.
    pub(crate) fn write_marks(
        &mut self,
        gpu: &Gpu,
        parts: &[DrawnPart<'_>],
        shown: &Shown<'_>,
        size: [u32; 2],
    ) -> [Range<u32>; 2] {
        let mut hidden = Vec::new();
        for part in parts.iter().filter(|p| !p.list.stand_ins.is_empty()) {
            let stand_ins: Vec<PictureMark> = (part.list.stand_ins.iter())
                .map(|&(portal, cell)| part.world.stand_in(portal, cell))
                .collect();
            let projection = shown.projection_in(part.stage);
            let [behind, _] = crate::marks::corners(&stand_ins, &projection, size);
            hidden.extend(behind);
        }
        let [below, on_top] = crate::marks::corners(shown.marks, &shown.projection, size);
        hidden.extend(below);
        let n_hidden = hidden.len() as u32;
        hidden.extend(on_top);
        self.marks.write(gpu, bytemuck::cast_slice(&hidden));
        [0..n_hidden, n_hidden..hidden.len() as u32]
    }

    pub(crate) fn draw_surfaces(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        part: PartView<'_>,
        shadings: &Shadings,
        size: [u32; 2],
    ) {
        pass.set_bind_group(0, &part.view.group, &[]);
        set_buffers(pass, part.world, &part.view.instances);
        let surface = |run: &Run| self.pipelines.surface(shadings.opaque(run));
        draw_runs(pass, part.world, part.list.opaque.iter(), size, surface);
        if shadings.is_count {
            let runs = part.list.transparent.iter();
            draw_runs(pass, part.world, runs, size, surface);
        }
    }

    pub(crate) fn draw_props(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        part: PartView<'_>,
        shadings: &Shadings,
        props: &[PropDraw],
        size: [u32; 2],
    ) {
        if props.is_empty() {
            return;
        }
        self.props.set_buffers(pass);
        pass.set_scissor_rect(0, 0, size[0], size[1]);
        pass.set_bind_group(0, &part.view.group, &[]);
        pass.set_bind_group(1, &part.world.textures[0], &[]);
        for draw in props {
            let span = &draw.span;
            if let Some(pipeline) = self.pipelines.surface(shadings.prop(span.is_smooth)) {
                pass.set_pipeline(pipeline);
                let range = span.first..span.first + span.n;
                pass.draw_indexed(range, 0, draw.instances.clone());
            }
        }
    }

    /// Draws the transparent surfaces of all worlds, far to near.
    fn draw_glass(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        parts: &[DrawnPart<'_>],
        shadings: &[Shadings],
        size: [u32; 2],
    ) {
        let of_part = |(i, p): (usize, &DrawnPart<'_>)| {
            let runs = p.list.transparent.iter().enumerate();
            runs.map(move |(k, run)| (run.distance, i, k))
                .collect::<Vec<_>>()
        };
        let mut order: Vec<_> = parts.iter().enumerate().flat_map(of_part).collect();
        if parts.len() > 1 {
            // Stable: each list is sorted already.
            order.sort_by(|a, b| b.0.total_cmp(&a.0));
        }
        for group in order.chunk_by(|a, b| a.1 == b.1) {
            let (part, shadings) = (&parts[group[0].1], &shadings[group[0].1]);
            let runs = group.iter().map(|g| g.2);
            self.draw_panes(pass, part.as_view(), shadings, runs, size);
        }
    }

    /// Draws transparent surfaces of one world.
    pub(crate) fn draw_panes(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        part: PartView<'_>,
        shadings: &Shadings,
        runs: impl Iterator<Item = usize>,
        size: [u32; 2],
    ) {
        pass.set_bind_group(0, &part.view.group, &[]);
        set_buffers(pass, part.world, &part.view.instances);
        let runs = runs.map(|i| &part.list.transparent[i]);
        draw_runs(pass, part.world, runs, size, |run| {
            self.pipelines.surface(shadings.glass(run))
        });
    }

    /// Draws the image of the surfaces to `output` by a pipeline: with ambient occlusion or as counts.
    fn draw_picture(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        targets: &Targets,
        post: &wgpu::RenderPipeline,
        output: &wgpu::TextureView,
    ) {
        let mut picture = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("picture"),
            color_attachments: &[Some(color_attachment(output, Some(wgpu::Color::BLACK)))],
            ..wgpu::RenderPassDescriptor::default()
        });
        picture.set_pipeline(post);
        picture.set_bind_group(0, &self.camera.group, &[]);
        picture.set_bind_group(1, &targets.post, &[]);
        picture.draw(0..3, 0..1);
    }

    /// Draws marks by the pipelines of those hidden by surfaces, and of those on top.
    pub(crate) fn draw_marks(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        [hidden, on_top]: &[Range<u32>; 2],
        size: [u32; 2],
        pipelines: [&wgpu::RenderPipeline; 2],
    ) {
        if on_top.end == 0 {
            return;
        }
        pass.set_scissor_rect(0, 0, size[0], size[1]);
        pass.set_bind_group(0, &self.camera.group, &[]);
        pass.set_vertex_buffer(0, self.marks.buffer.slice(..));
        pass.set_pipeline(pipelines[0]);
        pass.draw(hidden.clone(), 0..1);
        pass.set_pipeline(pipelines[1]);
        pass.draw(on_top.clone(), 0..1);
    }

    /// Draws a frame and reads it back. Panics unless [`Renderer::can_be_read`].
    pub(crate) fn picture(
        &mut self,
        gpu: &Gpu,
        parts: &mut [DrawnPart<'_>],
        shown: &Shown<'_>,
        size: [u32; 2],
    ) -> Result<Picture, RenderError> {
        let target = self.picture_target(gpu, size)?;
        let view = target.create_view(&wgpu::TextureViewDescriptor::default());
        self.draw(gpu, parts, shown, &view, size)?;
        read_picture(gpu, &target, size)
    }

    /// Returns `true` if pictures have four bytes a pixel, as those of nearly all windows do.
    pub(crate) fn can_be_read(&self) -> bool {
        use wgpu::TextureFormat::{Bgra8Unorm, Bgra8UnormSrgb, Rgba8Unorm, Rgba8UnormSrgb};
        matches!(
            self.format,
            Bgra8Unorm | Bgra8UnormSrgb | Rgba8Unorm | Rgba8UnormSrgb
        )
    }

    /// Makes a texture for a picture that is read back. Panics unless [`Renderer::can_be_read`].
    pub(crate) fn picture_target(
        &self,
        gpu: &Gpu,
        size: [u32; 2],
    ) -> Result<wgpu::Texture, RenderError> {
        assert!(self.can_be_read(), "pictures of {:?}", self.format);
        gpu.check_picture(size)?;
        Ok(texture(
            gpu,
            "picture",
            size,
            self.format,
            wgpu::TextureUsages::COPY_SRC,
        ))
    }
}

/// Reads a picture back.
pub(crate) fn read_picture(
    gpu: &Gpu,
    target: &wgpu::Texture,
    size: [u32; 2],
) -> Result<Picture, RenderError> {
    let [width, height] = size;
    let mut rgba = read_texture(gpu, target, size, 4)?;
    use wgpu::TextureFormat::{Bgra8Unorm, Bgra8UnormSrgb};
    if matches!(target.format(), Bgra8Unorm | Bgra8UnormSrgb) {
        rgba.chunks_exact_mut(4).for_each(|p| p.swap(0, 2));
    }
    Ok(Picture {
        width,
        height,
        rgba,
    })
}
