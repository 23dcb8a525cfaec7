//! The buffers of a world's triangles.

use std::ops::Range;

use wgpu::util::DeviceExt;

use super::filling::{Corner, listed};
use crate::gpu::{Gpu, RenderError};

/// Vertices and indices.
#[derive(Clone)]
pub(crate) struct TriangleBuffers {
    pub(crate) corners: wgpu::Buffer,
    pub(crate) indices: wgpu::Buffer,
    /// Positions of the vertices of all triangles, three each, for adapters whose shaders cannot fetch them.
    pub(crate) listed: Option<wgpu::Buffer>,
}

const CORNERS: &str = "the world's vertices";
const INDICES: &str = "the world's indices";
const LISTED: &str = "the triangles' vertices";

/// Returns the usage of a buffer of vertices or indices: id shaders fetch vertices from them.
fn fetched(gpu: &Gpu, usage: wgpu::BufferUsages) -> wgpu::BufferUsages {
    if gpu.fetches() {
        usage | wgpu::BufferUsages::STORAGE
    } else {
        usage
    }
}

impl TriangleBuffers {
    /// Uploads triangles.
    pub(super) fn filled(
        gpu: &Gpu,
        corners: &[Corner],
        indices: &[u32],
    ) -> Result<Self, RenderError> {
        let make = |what, bytes: &[u8], usage| -> Result<wgpu::Buffer, RenderError> {
            check(gpu, what, bytes.len() as u64, usage)?;
            // A buffer must not be empty; the largest element has 64 bytes.
            let empty = [0; 64];
            let contents = if bytes.is_empty() { &empty } else { bytes };
            let buffer = wgpu::util::BufferInitDescriptor {
                label: Some(what),
                contents,
                usage,
            };
            Ok(gpu.device.create_buffer_init(&buffer))
        };
        let listed = match gpu.fetches() {
            true => None,
            false => Some(listed(corners, indices)),
        };
        let listed = listed.map(|l| make(LISTED, bytemuck::cast_slice(&l), VERTEX));
        Ok(Self {
            corners: make(CORNERS, bytemuck::cast_slice(corners), fetched(gpu, VERTEX))?,
            indices: make(INDICES, bytemuck::cast_slice(indices), fetched(gpu, INDEX))?,
            listed: listed.transpose()?,
        })
    }

    /// Makes room for triangles.
    pub(super) fn empty(gpu: &Gpu, n_corners: u32, n_indices: u32) -> Result<Self, RenderError> {
        let make = |what, n: u32, size: u64, usage| -> Result<wgpu::Buffer, RenderError> {
            let bytes = u64::from(n) * size;
            check(gpu, what, bytes, usage)?;
            Ok(gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(what),
                size: bytes.max(64),
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }))
        };
        let listed = (!gpu.fetches()).then(|| make(LISTED, n_indices, PER_LISTED, VERTEX));
        Ok(Self {
            corners: make(CORNERS, n_corners, PER_CORNER, fetched(gpu, VERTEX))?,
            indices: make(INDICES, n_indices, PER_INDEX, fetched(gpu, INDEX))?,
            listed: listed.transpose()?,
        })
    }

    /// Writes a piece into ranges of vertices and of indices, which it fills in order. `indices` are those of its own vertices.
    pub(super) fn write_scattered(
        &self,
        gpu: &Gpu,
        [at, ranges]: [&[Range<u32>]; 2],
        corners: &[Corner],
        indices: &[u32],
    ) {
        let mut rest = corners;
        for range in at {
            let (own, others) = rest.split_at(range.len());
            self.write_corners(gpu, range.start, own);
            rest = others;
        }
        let placed: Vec<u32> = match at {
            [one] => indices.iter().map(|i| one.start + i).collect(),
            _ => {
                let places: Vec<u32> = at.iter().cloned().flatten().collect();
                indices.iter().map(|&i| places[i as usize]).collect()
            }
        };
        let mut first = 0;
        for range in ranges {
            let own = first..first + range.len();
            first = own.end;
            let positions = || listed(corners, &indices[own.clone()]);
            self.write_indices(gpu, range.start, &placed[own.clone()], positions);
        }
    }

    /// Writes vertices from `first` on.
    pub(super) fn write_corners(&self, gpu: &Gpu, first: u32, corners: &[Corner]) {
        let bytes = bytemuck::cast_slice(corners);
        let at = u64::from(first) * PER_CORNER;
        gpu.queue.write_buffer(&self.corners, at, bytes);
    }

    /// Writes indices from `first` on, and if adapters need them the positions of their vertices.
    pub(super) fn write_indices(
        &self,
        gpu: &Gpu,
        first: u32,
        indices: &[u32],
        positions: impl FnOnce() -> Vec<[f32; 3]>,
    ) {
        let at = u64::from(first) * PER_INDEX;
        let bytes = bytemuck::cast_slice(indices);
        gpu.queue.write_buffer(&self.indices, at, bytes);
        if let Some(listed) = &self.listed {
            let at = u64::from(first) * PER_LISTED;
            gpu.queue
                .write_buffer(listed, at, bytemuck::cast_slice(&positions()));
        }
    }
}

const VERTEX: wgpu::BufferUsages = wgpu::BufferUsages::VERTEX;
const INDEX: wgpu::BufferUsages = wgpu::BufferUsages::INDEX;

/// [Units: bytes]
pub(super) const PER_CORNER: u64 = size_of::<Corner>() as u64;
/// [Units: bytes]
pub(super) const PER_INDEX: u64 = size_of::<u32>() as u64;
/// [Units: bytes]
pub(super) const PER_LISTED: u64 = size_of::<[f32; 3]>() as u64;

fn check(
    gpu: &Gpu,
    what: &'static str,
    n_bytes: u64,
    usage: wgpu::BufferUsages,
) -> Result<(), RenderError> {
    let limits = gpu.device.limits();
    Gpu::check(what, n_bytes, limits.max_buffer_size)?;
    if usage.contains(wgpu::BufferUsages::STORAGE) {
        Gpu::check(what, n_bytes, limits.max_storage_buffer_binding_size)?;
    }
    Ok(())
}
