//! Buffers, textures and attachments, and the reading of their bytes.

use crate::gpu::{Gpu, RenderError};

/// A buffer that grows.
pub(crate) struct Grown {
    pub(crate) buffer: wgpu::Buffer,
    usage: wgpu::BufferUsages,
}

impl Grown {
    pub(crate) fn new(gpu: &Gpu, usage: wgpu::BufferUsages) -> Self {
        let usage = usage | wgpu::BufferUsages::COPY_DST;
        Self {
            // A level of thousands of rooms has one for each.
            buffer: Self::make(gpu, usage, 1 << 12),
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

/// Returns the bytes of a texture, row by row.
pub(crate) fn read_texture(
    gpu: &Gpu,
    texture: &wgpu::Texture,
    size: [u32; 2],
    bytes_per_pixel: u32,
) -> Result<Vec<u8>, RenderError> {
    read_layer(gpu, texture, 0, size, bytes_per_pixel)
}

/// As [`read_texture`], of one layer of an array.
pub(crate) fn read_layer(
    gpu: &Gpu,
    texture: &wgpu::Texture,
    layer: u32,
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
        wgpu::TexelCopyTextureInfo {
            origin: wgpu::Origin3d {
                z: layer,
                ..wgpu::Origin3d::ZERO
            },
            ..texture.as_image_copy()
        },
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
    with_bytes(gpu, &buffer, |mapped| {
        let mut out = Vec::with_capacity(row as usize * height as usize);
        for line in mapped.chunks_exact(stride as usize) {
            out.extend_from_slice(&line[..row as usize]);
        }
        out
    })
}

/// Returns the bytes of a buffer after all submitted work.
pub(crate) fn map_bytes(gpu: &Gpu, buffer: &wgpu::Buffer) -> Result<Vec<u8>, RenderError> {
    with_bytes(gpu, buffer, <[u8]>::to_vec)
}

/// Returns the result of `read` on the bytes of a buffer after all submitted work.
fn with_bytes<T>(
    gpu: &Gpu,
    buffer: &wgpu::Buffer,
    read: impl FnOnce(&[u8]) -> T,
) -> Result<T, RenderError> {
    let lost = |why: String| RenderError::Lost(why);
    // A buffer whose allocation failed is not mapped.
    gpu.check_failed()?;
    let (sender, receiver) = std::sync::mpsc::channel();
    buffer.map_async(wgpu::MapMode::Read, .., move |result| {
        // If waiting failed, the receiver is gone.
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
    Ok(read(&mapped))
}
