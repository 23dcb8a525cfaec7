//! Intermediate targets of frames.

use crate::formats::{COLOR, DEPTH};
use crate::gpu::{Gpu, RenderError};
use crate::pipelines::Layouts;
use crate::resources::texture;

/// Intermediate targets of frames of one size.
pub(crate) struct Targets {
    pub(crate) size: [u32; 2],
    pub(crate) color: wgpu::TextureView,
    pub(crate) depth: wgpu::TextureView,
    pub(crate) post: wgpu::BindGroup,
}

impl Targets {
    /// Makes targets.
    pub(crate) fn new(gpu: &Gpu, layouts: &Layouts, size: [u32; 2]) -> Result<Self, RenderError> {
        gpu.check_picture(size)?;
        let usage = wgpu::TextureUsages::TEXTURE_BINDING;
        let view = |label, format| {
            texture(gpu, label, size, format, usage)
                .create_view(&wgpu::TextureViewDescriptor::default())
        };
        let (color, depth) = (view("color", COLOR), view("depth", DEPTH));
        let post = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("post"),
            layout: &layouts.post,
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
        Ok(Self {
            size,
            color,
            depth,
            post,
        })
    }
}
