//! Textures on the adapter: one layer of two arrays each, and the pipelines that fill and show them.

use std::collections::BTreeMap;

use super::texels::Texels;
use crate::formats::COLOR;
use crate::gpu::{Gpu, RenderError};
use crate::pipelines::{Kind, Layouts, NEARER, SKY, pipeline, shader};
use crate::resources::{Grown, color_attachment, read_layer};
use crate::targets::Targets;

/// Distance of a surface: depth of the texture's projection.
const STORED: wgpu::TextureFormat = wgpu::TextureFormat::R32Float;

/// One view for each layer.
struct LayerViews {
    texture: wgpu::Texture,
    all: wgpu::TextureView,
    each: Vec<wgpu::TextureView>,
}

impl LayerViews {
    fn new(gpu: &Gpu, label: &str, side: u32, n: u32, format: wgpu::TextureFormat) -> Self {
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d {
                width: side,
                height: side,
                depth_or_array_layers: n,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                | wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_SRC
                | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let array = wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..wgpu::TextureViewDescriptor::default()
        };
        let one = |layer| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2),
                base_array_layer: layer,
                array_layer_count: Some(1),
                ..wgpu::TextureViewDescriptor::default()
            })
        };
        Self {
            all: texture.create_view(&array),
            each: (0..n).map(one).collect(),
            texture,
        }
    }

    /// Writes the texels of a layer, 4 bytes each.
    fn write(&self, gpu: &Gpu, layer: usize, bytes: &[u8]) {
        let size = self.texture.size();
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                origin: wgpu::Origin3d {
                    z: layer as u32,
                    ..wgpu::Origin3d::ZERO
                },
                ..self.texture.as_image_copy()
            },
            bytes,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(4 * size.width),
                rows_per_image: None,
            },
            wgpu::Extent3d {
                depth_or_array_layers: 1,
                ..size
            },
        );
    }

    /// Returns the texels of a layer, 4 bytes each.
    fn read(&self, gpu: &Gpu, layer: usize) -> Result<Vec<u8>, RenderError> {
        let size = [self.texture.width(), self.texture.height()];
        read_layer(gpu, &self.texture, layer as u32, size, 4)
    }
}

/// The textures on the adapter.
pub(crate) struct TextureArrays {
    colors: LayerViews,
    depths: LayerViews,
    group: wgpu::BindGroup,
    /// Targets of a texture while it is made.
    pub(crate) targets: Option<Targets>,
    layout: wgpu::BindGroupLayout,
    module: wgpu::ShaderModule,
    stored: wgpu::RenderPipeline,
    shown: BTreeMap<DoorwayVariant, wgpu::RenderPipeline>,
    format: wgpu::TextureFormat,
    pub(crate) corners: Grown,
}

/// Differences between pipelines that show textures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct DoorwayVariant {
    /// True if textures are warped.
    pub(crate) warps: bool,
    /// True if the target is the intermediate one: its pixels from textures are marked.
    pub(crate) marks: bool,
}

impl TextureArrays {
    /// Makes `n` layers of the renderer's format.
    pub(crate) fn new(
        gpu: &Gpu,
        layouts: &Layouts,
        format: wgpu::TextureFormat,
        side: u32,
        n: u32,
    ) -> Self {
        let colors = LayerViews::new(gpu, "portal colors", side, n, format);
        let depths = LayerViews::new(gpu, "portal depths", side, n, STORED);
        let array = |binding, filterable| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty: wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Float { filterable },
                view_dimension: wgpu::TextureViewDimension::D2Array,
                multisampled: false,
            },
            count: None,
        };
        let layout = gpu
            .device
            .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some("portal textures"),
                entries: &[
                    array(0, true),
                    array(1, false),
                    wgpu::BindGroupLayoutEntry {
                        binding: 2,
                        visibility: wgpu::ShaderStages::FRAGMENT,
                        ty: wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
                        count: None,
                    },
                ],
            });
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        let view = |binding, view| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::TextureView(view),
        };
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("portal textures"),
            layout: &layout,
            entries: &[
                view(0, &colors.all),
                view(1, &depths.all),
                wgpu::BindGroupEntry {
                    binding: 2,
                    resource: wgpu::BindingResource::Sampler(&sampler),
                },
            ],
        });
        let depth = shader(
            gpu,
            "portal depth",
            &[SKY, include_str!("../shaders/portal_depth.wgsl")],
        );
        let stored = pipeline(
            gpu,
            &Kind {
                label: "portal depth",
                module: &depth,
                vertex: "whole",
                fragment: Some("stored"),
                layouts: &[&layouts.globals, &layouts.post],
                buffers: &[],
                target: Some((STORED, None)),
                depth: None,
                constants: &[],
                stencil: None,
                writes_color: true,
            },
        );
        let source = include_str!("../shaders/portal_textures.wgsl");
        Self {
            colors,
            depths,
            group,
            targets: None,
            layout,
            module: shader(gpu, "portal textures", &[source]),
            stored,
            shown: BTreeMap::new(),
            format,
            corners: Grown::new(gpu, wgpu::BufferUsages::VERTEX),
        }
    }

    /// Returns the number of layers.
    pub(crate) fn len(&self) -> usize {
        self.colors.each.len()
    }

    /// Returns the target of a texture's colors.
    pub(crate) fn color(&self, layer: usize) -> &wgpu::TextureView {
        &self.colors.each[layer]
    }

    /// Copies the depths of the targets to a layer. `globals` is any.
    pub(crate) fn store_depth(&self, gpu: &Gpu, globals: &wgpu::BindGroup, layer: usize) {
        let Some(targets) = &self.targets else { return };
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let to = &self.depths.each[layer];
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("portal depth"),
                color_attachments: &[Some(color_attachment(to, Some(wgpu::Color::BLACK)))],
                ..wgpu::RenderPassDescriptor::default()
            });
            pass.set_pipeline(&self.stored);
            pass.set_bind_group(0, globals, &[]);
            pass.set_bind_group(1, &targets.post, &[]);
            pass.draw(0..3, 0..1);
        }
        gpu.queue.submit([encoder.finish()]);
    }

    /// Writes a layer.
    pub(crate) fn write(&self, gpu: &Gpu, layer: usize, texels: &Texels) {
        self.colors.write(gpu, layer, &texels.colors);
        self.depths.write(gpu, layer, &texels.depths);
    }

    /// Returns a layer.
    pub(crate) fn read(&self, gpu: &Gpu, layer: usize) -> Result<Texels, RenderError> {
        Ok(Texels {
            colors: self.colors.read(gpu, layer)?,
            depths: self.depths.read(gpu, layer)?,
        })
    }

    /// Returns `true` if blue is the first of the four bytes of a color.
    pub(crate) fn is_blue_first(&self) -> bool {
        use wgpu::TextureFormat::{Bgra8Unorm, Bgra8UnormSrgb};
        matches!(self.format, Bgra8Unorm | Bgra8UnormSrgb)
    }

    /// Makes a pipeline unless it exists.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, layouts: &Layouts, variant: DoorwayVariant) {
        if self.shown.contains_key(&variant) {
            return;
        }
        let number = |b: bool| f64::from(u8::from(b));
        let made = pipeline(
            gpu,
            &Kind {
                label: "portal textures",
                module: &self.module,
                vertex: "doorway",
                fragment: Some("filled"),
                layouts: &[&layouts.globals, &self.layout],
                buffers: &[super::draw::DOORWAY_LAYOUT],
                target: Some((if variant.marks { COLOR } else { self.format }, None)),
                depth: Some((true, NEARER)),
                constants: &[
                    ("WARPS", number(variant.warps)),
                    ("MARKS", number(variant.marks)),
                ],
                stencil: None,
                writes_color: true,
            },
        );
        self.shown.insert(variant, made);
    }

    /// Draws the vertices written before; `globals` is that of the world's frame.
    pub(crate) fn draw(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        globals: &wgpu::BindGroup,
        variant: DoorwayVariant,
        n_corners: u32,
    ) {
        if let Some(pipeline) = self.shown.get(&variant) {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, globals, &[]);
            pass.set_bind_group(1, &self.group, &[]);
            pass.set_vertex_buffer(0, self.corners.buffer.slice(..));
            pass.draw(0..n_corners, 0..1);
        }
    }
}

/// Doorways that are ready to be drawn.
#[derive(Clone, Copy)]
pub(crate) struct DoorwayDraw<'a> {
    pub(super) arrays: &'a TextureArrays,
    pub(super) variant: DoorwayVariant,
    pub(super) n_corners: u32,
}

impl DoorwayDraw<'_> {
    /// Draws them; `globals` is that of the world's frame.
    pub(crate) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, globals: &wgpu::BindGroup) {
        if self.n_corners > 0 {
            self.arrays
                .draw(pass, globals, self.variant, self.n_corners);
        }
    }
}
