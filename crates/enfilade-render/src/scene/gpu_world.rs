//! A world on the adapter, and its upload as a whole.

use std::ops::Range;

use enfilade_cpg::{CellId, PortalId, World};
use enfilade_runtime::{Sight, SightState};
use glam::Vec3;

use super::buffers::TriangleBuffers;
use super::filling::{Dress, Filling, Level, Span};
use super::placed::{Instance, Moving, Placed, bounds_of, placed};
use super::streamed::Streamed;
use super::textures::load_textures;
use crate::gpu::{Gpu, RenderError};
use crate::marks::{MarkShape, PictureMark};
use crate::materials::looks_of;

/// A world on the adapter, ready to be drawn.
#[derive(Clone)]
pub struct GpuWorld {
    pub(crate) triangles: TriangleBuffers,
    /// Instances: structure first, then objects.
    pub(crate) instances: Vec<Instance>,
    /// Base color textures; the first is white.
    pub(crate) textures: Vec<wgpu::BindGroup>,
    /// One entry per chunk of the sight.
    pub(crate) chunks: Vec<Span>,
    /// For each chunk, its batch.
    pub(crate) batch_of: Vec<u32>,
    /// For each batch, the cells that see it.
    pub(crate) batch_cells: Vec<Vec<CellId>>,
    /// For each detail mesh, its levels, the finest first.
    pub(crate) meshes: Vec<Vec<Level>>,
    pub(crate) details: Vec<Placed>,
    moving: Vec<Moving>,
    /// For each portal, its plug.
    pub(crate) plugs: Vec<Span>,
    /// One entry per portal.
    pub(crate) portal_cells: Vec<[CellId; 2]>,
    /// Minimum and maximum of everything drawn. [Units: wu]
    pub(crate) bounds: [Vec3; 2],
    /// For each portal, its outline. [Units: wu]
    pub(crate) outlines: Vec<Vec<[f32; 3]>>,
    /// For each cell, the lit color of its stand-in far away.
    pub(crate) cell_looks: Vec<[f32; 3]>,
    pub(crate) n_triangles: u64,
    n_missing_pictures: u32,
    n_large_pictures: u32,
    /// Pieces that come and go, in a hollow world.
    pub(super) streamed: Option<Box<Streamed>>,
}

impl GpuWorld {
    /// Uploads a world. `sight` must be built from the same world.
    ///
    /// Images that are missing, damaged or too large are replaced by their material's color.
    ///
    /// # Errors
    ///
    /// A world larger than the adapter's buffers.
    pub fn load(gpu: &Gpu, world: &World, sight: &Sight) -> Result<Self, RenderError> {
        Self::load_with(gpu, world, sight, false)
    }

    /// Uploads a world with levels of detail for objects: see [`Sparing::lod`](crate::Sparing::lod). Takes about
    /// half a minute per million triangles of meshes, nearly all of it to measure the error of levels.
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
        let looks = looks_of(world);
        let textures = load_textures(gpu, world, &looks)?;
        let dress = Dress {
            looks,
            texture_of: textures.of,
        };
        let mut filling = Filling::new(&dress);
        let batches = filling.add_batches(world, sight);
        let meshes = filling.add_meshes(world, has_levels);
        let plugs = filling.add_plugs(world, sight);
        let chunks = sight.chunks().iter().map(|c| Span {
            first: batches[c.batch as usize].first + c.first_index,
            n: c.n_indices,
            ..batches[c.batch as usize]
        });
        let triangles = TriangleBuffers::filled(gpu, &filling.corners, &filling.indices)?;
        Ok(Self {
            chunks: chunks.collect(),
            meshes,
            textures: textures.groups,
            n_missing_pictures: textures.n_missing,
            n_large_pictures: textures.n_too_large,
            ..Self::of_triangles(world, sight, &dress, triangles, plugs)
        })
    }

    /// Returns a world of which only the plugs are listed.
    pub(super) fn of_triangles(
        world: &World,
        sight: &Sight,
        dress: &Dress,
        triangles: TriangleBuffers,
        plugs: Vec<Span>,
    ) -> Self {
        let (instances, details, moving) = placed(world, sight);
        let portals = &world.graph.portals;
        Self {
            triangles,
            instances,
            textures: Vec::new(),
            chunks: Vec::new(),
            batch_of: sight.chunks().iter().map(|c| c.batch).collect(),
            batch_cells: world.batches.iter().map(|b| b.cells.clone()).collect(),
            meshes: Vec::new(),
            bounds: bounds_of(sight, &details),
            details,
            moving,
            plugs,
            portal_cells: portals.iter().map(|p| p.cells).collect(),
            outlines: portals.iter().map(|p| p.outline.clone()).collect(),
            cell_looks: dress.cell_looks(world, sight),
            n_triangles: sight.n_triangles(),
            n_missing_pictures: 0,
            n_large_pictures: 0,
            streamed: None,
        }
    }

    /// Moves leaves as `state` has them.
    pub(crate) fn place(&mut self, state: &SightState) {
        for leaf in &self.moving {
            let at = leaf.detail.0 as usize;
            leaf.place(state, &mut self.instances[at + 1], &mut self.details[at]);
        }
    }

    /// Returns the cells that a leaf stands in, by its position in [`SightState::shares`].
    pub(crate) fn cells_of_leaf(&self, leaf: usize) -> &[CellId] {
        let detail = self.moving.get(leaf).map(|m| m.detail.0 as usize);
        detail.map_or(&[], |d| &self.details[d].cells)
    }

    /// Returns the level at which an object is drawn to be off by at most `lod` pixels. `pixels` returns the
    /// pixels per meter.
    pub(crate) fn level(&self, placed: &Placed, lod: f32, pixels: impl FnOnce() -> f32) -> u32 {
        let levels = self.meshes.get(placed.mesh as usize).map_or(&[][..], |l| l);
        if lod <= 0.0 || levels.len() < 2 {
            return 0;
        }
        let scale = placed.stretch * pixels();
        // Not a number if the eye is in the object: the finest level.
        let n = levels.partition_point(|l| l.error * scale <= lod);
        n.saturating_sub(1) as u32
    }

    /// Returns the polygon drawn in a portal instead of the cell behind it.
    pub(crate) fn stand_in(&self, portal: PortalId, cell: CellId) -> PictureMark {
        let [r, g, b] = self
            .cell_looks
            .get(cell.0 as usize)
            .copied()
            .unwrap_or_default();
        PictureMark {
            shape: MarkShape::Area(
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

    /// Returns the number of triangles of structure and placed objects.
    #[must_use]
    pub fn n_triangles(&self) -> u64 {
        self.n_triangles
    }

    /// Returns the number of missing or damaged texture images.
    #[must_use]
    pub fn n_missing_pictures(&self) -> u32 {
        self.n_missing_pictures
    }

    /// Returns the number of texture images beyond the limits: 8192 × 8192 pixels each; 512 MiB plus 128 bytes
    /// per byte of the file together.
    #[must_use]
    pub fn n_large_pictures(&self) -> u32 {
        self.n_large_pictures
    }

    /// Returns minimum and maximum of everything drawn; of an empty world, a box around its origin. [Units: wu]
    #[must_use]
    pub fn bounds(&self) -> [[f32; 3]; 2] {
        self.bounds.map(|p| p.to_array())
    }

    /// Returns the chunk of a structural triangle, given its index in an id picture.
    #[must_use]
    pub fn chunk_of_triangle(&self, triangle: u32) -> Option<u32> {
        if let Some(streamed) = &self.streamed {
            return self.streamed_chunk(streamed, triangle);
        }
        // Chunks are in ascending order of their ranges.
        let at = self
            .chunks
            .partition_point(|c| c.first + c.n <= triangle * 3);
        let chunk = self.chunks.get(at)?;
        (chunk.first <= triangle * 3).then_some(at as u32)
    }

    /// Returns the portal whose plug contains a triangle.
    pub(crate) fn portal_of_plug(&self, triangle: u32) -> Option<PortalId> {
        let at = self
            .plugs
            .partition_point(|s| s.first + s.n <= triangle * 3);
        let plug = self.plugs.get(at)?;
        (plug.first <= triangle * 3).then_some(PortalId(at as u32))
    }

    /// Returns the batch of a chunk.
    #[must_use]
    pub fn batch_of_chunk(&self, chunk: u32) -> Option<u32> {
        self.batch_of.get(chunk as usize).copied()
    }

    /// Returns the chunk of a structural triangle of a hollow world.
    fn streamed_chunk(&self, streamed: &Streamed, triangle: u32) -> Option<u32> {
        let index = triangle.checked_mul(3)?;
        let (_, &batch) = streamed.batch_at.range(..=index).next_back()?;
        let holds = |s: &Span| (s.first..s.first + s.n).contains(&index);
        let mut own = self.chunks_of(batch).map(|c| c as u32);
        own.find(|c| self.spans_of(*c).iter().any(holds))
    }

    /// Returns the triangles of a chunk: one span in a world loaded whole, none of an absent chunk.
    pub(crate) fn spans_of(&self, chunk: u32) -> &[Span] {
        let one = std::slice::from_ref(&self.chunks[chunk as usize]);
        match &self.streamed {
            Some(streamed) if one[0].n == 0 => {
                let several = streamed.scattered.get(&chunk);
                several.map_or(&[], Vec::as_slice)
            }
            _ => one,
        }
    }

    /// Returns the chunks of a batch.
    pub(super) fn chunks_of(&self, batch: u32) -> Range<usize> {
        let first = self.batch_of.partition_point(|b| *b < batch);
        first..first + self.batch_of[first..].partition_point(|b| *b == batch)
    }
}
