//! A world on the adapter: corners, indices, materials, textures, placed objects.
//!
//! All triangles stand in one buffer, in the order in which chunks of [`Sight`] are ranges, and those of
//! detail meshes after them, each mesh once. What is drawn is a list of ranges, so that neighboring
//! chunks join to one draw whatever room they belong to.

mod color;
mod filling;
mod placed;
mod plug;
mod textures;

use enfilade_cpg::{CellId, PortalId, World};
use enfilade_runtime::{Sight, SightState};
use glam::Vec3;
use wgpu::util::DeviceExt;

use crate::gpu::{Gpu, RenderError};
use crate::marks::{Mark, Shape};
use crate::materials::{Look, looks_of};
use filling::{Filling, Level};
use placed::{Moving, Placed, bounds_of, placed};
use textures::load_textures;

pub use color::cell_color;
pub(crate) use color::packed_cell_color;
pub(crate) use filling::{CORNER_LAYOUT, Finish, Span};
pub(crate) use placed::{INSTANCE_LAYOUT, Instance};
pub(crate) use plug::plug;
pub(crate) use textures::texture_layout;

/// A world on the adapter, ready to be drawn.
pub struct GpuWorld {
    pub(crate) corners: wgpu::Buffer,
    pub(crate) indices: wgpu::Buffer,
    /// Where the corners of all triangles are, three to each: where shaders cannot fetch them.
    pub(crate) listed: Option<wgpu::Buffer>,
    /// By number of an instance: 0 for structure, then objects.
    pub(crate) instances: Vec<Instance>,
    /// Base color textures; the first is white.
    pub(crate) textures: Vec<wgpu::BindGroup>,
    /// By chunk of the sight.
    pub(crate) chunks: Vec<Span>,
    /// By chunk: its batch.
    pub(crate) batch_of: Vec<u32>,
    /// By batch: the cells that see it.
    pub(crate) batch_cells: Vec<Vec<CellId>>,
    /// By detail mesh: its levels, the finest first.
    pub(crate) meshes: Vec<Vec<Level>>,
    pub(crate) details: Vec<Placed>,
    moving: Vec<Moving>,
    /// By portal: what fills it when it is shut.
    pub(crate) plugs: Vec<Span>,
    /// By portal.
    pub(crate) portal_cells: Vec<[CellId; 2]>,
    /// Least and greatest corner of all that is drawn. [Units: wu]
    pub(crate) bounds: [Vec3; 2],
    /// By portal: its outline. [Units: wu]
    pub(crate) outlines: Vec<Vec<[f32; 3]>>,
    /// By cell: the color of what stands in for it far away, lit.
    pub(crate) cell_looks: Vec<[f32; 3]>,
    pub(crate) n_triangles: u64,
    n_missing_pictures: u32,
    n_large_pictures: u32,
}

impl GpuWorld {
    /// Puts a world on the adapter. `sight` was made of the same world.
    ///
    /// Pictures that are missing, damaged or too large are drawn as their material's color.
    ///
    /// # Errors
    ///
    /// A world larger than the adapter's buffers.
    pub fn load(gpu: &Gpu, world: &World, sight: &Sight) -> Result<Self, RenderError> {
        Self::load_with(gpu, world, sight, false)
    }

    /// The same with levels of detail for objects: see [`Sparing::lod`](crate::Sparing::lod). Takes about half a
    /// minute for each million triangles of meshes, nearly all of it to measure how far levels are off.
    ///
    /// # Errors
    ///
    /// As [`GpuWorld::load`].
    pub fn load_with_levels(gpu: &Gpu, world: &World, sight: &Sight) -> Result<Self, RenderError> {
        Self::load_with(gpu, world, sight, true)
    }

    fn load_with(
        gpu: &Gpu,
        world: &World,
        sight: &Sight,
        has_levels: bool,
    ) -> Result<Self, RenderError> {
        let mut looks: Vec<Look> = looks_of(world);
        looks.push(Look::default());
        let textures = load_textures(gpu, world, &looks)?;
        let mut filling = Filling {
            world,
            looks,
            texture_of: textures.of,
            corners: Vec::new(),
            indices: Vec::new(),
        };
        let batches = filling.add_batches(sight);
        let meshes = filling.add_meshes(has_levels);
        let (instances, details, moving) = placed(world, sight);
        let plugs = filling.add_plugs(sight);
        let chunks: Vec<Span> = sight
            .chunks()
            .iter()
            .map(|c| Span {
                first: batches[c.batch as usize].first + c.first_index,
                n: c.n_indices,
                ..batches[c.batch as usize]
            })
            .collect();
        let bounds = bounds_of(world, &details);
        // What draws ids fetches corners from these buffers.
        let fetched = if gpu.fetches() {
            wgpu::BufferUsages::STORAGE
        } else {
            wgpu::BufferUsages::empty()
        };
        let buffer = |what, bytes: &[u8], usage| make_buffer(gpu, what, bytes, usage);
        let corners = bytemuck::cast_slice(&filling.corners);
        let indices = bytemuck::cast_slice(&filling.indices);
        Ok(Self {
            corners: buffer(
                "the world's corners",
                corners,
                wgpu::BufferUsages::VERTEX | fetched,
            )?,
            indices: buffer(
                "the world's indices",
                indices,
                wgpu::BufferUsages::INDEX | fetched,
            )?,
            listed: if gpu.fetches() {
                None
            } else {
                let listed = filling.listed();
                let listed = bytemuck::cast_slice(&listed);
                Some(buffer(
                    "the triangles' corners",
                    listed,
                    wgpu::BufferUsages::VERTEX,
                )?)
            },
            instances,
            textures: textures.groups,
            chunks,
            batch_of: sight.chunks().iter().map(|c| c.batch).collect(),
            batch_cells: world.batches.iter().map(|b| b.cells.clone()).collect(),
            meshes,
            details,
            moving,
            plugs,
            portal_cells: world.graph.portals.iter().map(|p| p.cells).collect(),
            bounds,
            outlines: world
                .graph
                .portals
                .iter()
                .map(|p| p.outline.clone())
                .collect(),
            cell_looks: filling.cell_looks(),
            n_triangles: sight.n_triangles(),
            n_missing_pictures: textures.n_missing,
            n_large_pictures: textures.n_too_large,
        })
    }

    /// Moves leaves to where `state` has them.
    pub(crate) fn place(&mut self, state: &SightState) {
        for leaf in &self.moving {
            let at = leaf.detail.0 as usize;
            leaf.place(state, &mut self.instances[at + 1], &mut self.details[at]);
        }
    }

    /// The level that an object is drawn at, to be off by `lod` pixels at most. `pixels` tells how many a meter has.
    pub(crate) fn level(&self, placed: &Placed, lod: f32, pixels: impl FnOnce() -> f32) -> u32 {
        let levels = self.meshes.get(placed.mesh as usize).map_or(&[][..], |l| l);
        if lod <= 0.0 || levels.len() < 2 {
            return 0;
        }
        let scale = placed.stretch * pixels();
        // Not a number where the eye is in the object: the finest.
        let n = levels.partition_point(|l| l.error * scale <= lod);
        n.saturating_sub(1) as u32
    }

    /// What is drawn in a portal instead of what is behind it.
    pub(crate) fn stand_in(&self, portal: PortalId, cell: CellId) -> Mark {
        let [r, g, b] = self
            .cell_looks
            .get(cell.0 as usize)
            .copied()
            .unwrap_or_default();
        Mark {
            shape: Shape::Area(
                self.outlines
                    .get(portal.0 as usize)
                    .cloned()
                    .unwrap_or_default(),
            ),
            color: [r, g, b, 1.0],
            width: 0.0,
            on_top: false,
        }
    }

    /// Triangles of structure and placed objects.
    #[must_use]
    pub fn n_triangles(&self) -> u64 {
        self.n_triangles
    }

    /// Pictures of textures that are missing or damaged.
    #[must_use]
    pub fn n_missing_pictures(&self) -> u32 {
        self.n_missing_pictures
    }

    /// Pictures of textures that are larger than 8192 x 8192 pixels, or would come to more than 512 MiB together and 128 bytes for each
    /// byte of the file.
    #[must_use]
    pub fn n_large_pictures(&self) -> u32 {
        self.n_large_pictures
    }

    /// Least and greatest corner of all that is drawn; of an empty world, a box around its origin.
    /// [Units: wu]
    #[must_use]
    pub fn bounds(&self) -> [[f32; 3]; 2] {
        self.bounds.map(|p| p.to_array())
    }

    /// The chunk of a structural triangle, by its number in an id picture.
    #[must_use]
    pub fn chunk_of_triangle(&self, triangle: u32) -> Option<u32> {
        // Chunks come in ascending order of their ranges.
        let at = self
            .chunks
            .partition_point(|c| c.first + c.n <= triangle * 3);
        let chunk = self.chunks.get(at)?;
        (chunk.first <= triangle * 3).then_some(at as u32)
    }

    /// The portal that a triangle fills when it is shut.
    pub(crate) fn portal_of_plug(&self, triangle: u32) -> Option<PortalId> {
        let at = self
            .plugs
            .partition_point(|s| s.first + s.n <= triangle * 3);
        let plug = self.plugs.get(at)?;
        (plug.first <= triangle * 3).then_some(PortalId(at as u32))
    }

    /// The batch of a chunk, and the triangle's place in it as [`Sight::indices`] orders them.
    #[must_use]
    pub fn batch_of_chunk(&self, chunk: u32) -> Option<u32> {
        self.batch_of.get(chunk as usize).copied()
    }
}

fn make_buffer(
    gpu: &Gpu,
    what: &'static str,
    bytes: &[u8],
    usage: wgpu::BufferUsages,
) -> Result<wgpu::Buffer, RenderError> {
    let limits = gpu.device.limits();
    Gpu::check(what, bytes.len() as u64, limits.max_buffer_size)?;
    if usage.contains(wgpu::BufferUsages::STORAGE) {
        Gpu::check(
            what,
            bytes.len() as u64,
            limits.max_storage_buffer_binding_size,
        )?;
    }
    // A buffer must not be empty; 64 bytes are as large as the largest element.
    let empty = [0; 64];
    let contents = if bytes.is_empty() { &empty } else { bytes };
    Ok(gpu
        .device
        .create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(what),
            contents,
            usage,
        }))
}
