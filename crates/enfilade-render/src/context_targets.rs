//! Targets and pipelines of pictures with special portals.

use crate::formats::{COLOR, DEPTH_STENCIL};
use crate::gpu::Gpu;
use crate::panes::{PanePicture, PanePipelines};
use crate::pipelines::Layouts;
use crate::resources::{Grown, texture};
use crate::stage::GlobalsBuffer;

/// Most sizes of pictures, and most pictures beside those of the last frame, that are kept from frame to frame.
const MOST_KEPT: usize = 16;

/// Targets and buffers for pictures with special portals, kept from frame to frame.
pub(crate) struct ContextTargets {
    pub(crate) targets: Vec<ContextTarget>,
    pub(crate) pictures: Vec<PanePicture>,
    /// For each picture, whether the last frame showed it.
    is_used: Vec<bool>,
    /// One per context of a picture.
    pub(crate) skies: Vec<GlobalsBuffer>,
    pub(crate) corners: Grown,
    pipelines: Vec<(wgpu::TextureFormat, PanePipelines)>,
}

/// Intermediate targets of one size.
pub(crate) struct ContextTarget {
    pub(crate) size: [u32; 2],
    pub(crate) color: wgpu::TextureView,
    pub(crate) depth: wgpu::TextureView,
    pub(crate) post: wgpu::BindGroup,
    /// A whole picture, of which a part is kept or colors are rounded, if any was drawn yet.
    pub(crate) whole: Option<PanePicture>,
}

impl ContextTargets {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self {
            targets: Vec::new(),
            pictures: Vec::new(),
            is_used: Vec::new(),
            skies: Vec::new(),
            corners: Grown::new(gpu, wgpu::BufferUsages::VERTEX),
            pipelines: Vec::new(),
        }
    }

    /// Makes the targets of a size unless they exist, and moves them to the end.
    pub(crate) fn resize(&mut self, gpu: &Gpu, layouts: &Layouts, size: [u32; 2]) {
        if let Some(at) = self.targets.iter().position(|t| t.size == size) {
            let own = self.targets.remove(at);
            self.targets.push(own);
            return;
        }
        if self.targets.len() == MOST_KEPT {
            self.targets.remove(0);
        }
        let usage = wgpu::TextureUsages::TEXTURE_BINDING;
        let whole = wgpu::TextureViewDescriptor::default();
        let color = texture(gpu, "color", size, COLOR, usage).create_view(&whole);
        let depth = texture(gpu, "depth", size, DEPTH_STENCIL, usage);
        let read = depth.create_view(&wgpu::TextureViewDescriptor {
            aspect: wgpu::TextureAspect::DepthOnly,
            ..whole
        });
        let view = |binding, view| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::TextureView(view),
        };
        let post = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("post"),
            layout: &layouts.post,
            entries: &[view(0, &color), view(1, &read)],
        });
        self.targets.push(ContextTarget {
            size,
            color,
            depth: depth.create_view(&whole),
            post,
            whole: None,
        });
    }

    /// Makes the whole picture of the last size, unless it exists.
    pub(crate) fn add_whole(&mut self, gpu: &Gpu, layouts: &Layouts, format: wgpu::TextureFormat) {
        let target = self.targets.last_mut();
        if let Some(target) = target.filter(|t| t.whole.as_ref().is_none_or(|w| w.format != format))
        {
            target.whole = Some(PanePicture::new(gpu, layouts, format, target.size));
        }
    }

    /// Returns a picture for each size.
    pub(crate) fn place(
        &mut self,
        gpu: &Gpu,
        layouts: &Layouts,
        format: wgpu::TextureFormat,
        sizes: impl Iterator<Item = [u32; 2]>,
    ) -> Vec<usize> {
        if self.pictures.len() > MOST_KEPT {
            let mut is_used = self.is_used.drain(..);
            self.pictures.retain(|_| is_used.next().unwrap_or(false));
        }
        self.is_used.clear();
        self.is_used.resize(self.pictures.len(), false);
        let mut out = Vec::new();
        for size in sizes {
            let fits = |picture: &PanePicture| picture.size == size && picture.format == format;
            let is_free = |i: &usize| fits(&self.pictures[*i]) && !self.is_used[*i];
            let own = (0..self.pictures.len()).find(is_free);
            let own = own.unwrap_or_else(|| {
                self.pictures
                    .push(PanePicture::new(gpu, layouts, format, size));
                self.is_used.push(false);
                self.pictures.len() - 1
            });
            self.is_used[own] = true;
            out.push(own);
        }
        out
    }

    pub(crate) fn prepare(&mut self, gpu: &Gpu, layouts: &Layouts, format: wgpu::TextureFormat) {
        if !self.pipelines.iter().any(|p| p.0 == format) {
            let made = PanePipelines::new(gpu, layouts, format);
            self.pipelines.push((format, made));
        }
    }

    pub(crate) fn panes(&self, format: wgpu::TextureFormat) -> Option<&PanePipelines> {
        self.pipelines
            .iter()
            .find(|p| p.0 == format)
            .map(|(_, made)| made)
    }
}
