//! Pieces of a hollow world, made ready for the adapter.

use std::sync::Arc;

use enfilade_cpg::World;
use enfilade_geom::scene::Primitive;
use enfilade_runtime::Sight;

use super::buffers::{PER_CORNER, PER_INDEX, PER_LISTED};
use super::color::color_of;
use super::filling::{Corner, Dress, Filling, Span};
use crate::gpu::{Gpu, RenderError};
use crate::materials::{MAX_PICTURE, decode};
use crate::piece_of::PieceOf;

/// A piece as it lies on the adapter, to be [put](super::GpuWorld::put) there.
pub struct GpuPiece {
    pub(super) of: PieceOf,
    pub(super) content: PieceContent,
    n_bytes: u64,
}

/// The contents of a piece.
pub(super) enum PieceContent {
    Triangles {
        corners: Vec<Corner>,
        indices: Vec<u32>,
        /// Ranges of `indices`: one for each chunk of a batch, one for each part of a mesh.
        spans: Vec<Span>,
    },
    /// A picture with its mipmaps; without any if it is damaged or too large.
    Picture(Vec<image::RgbaImage>),
}

impl GpuPiece {
    /// Returns what it is.
    #[must_use]
    pub fn of(&self) -> PieceOf {
        self.of
    }

    /// Returns its size on the adapter: 40 bytes per vertex and 4 per index (16 on adapters that cannot fetch vertices), 4
    /// per texel of a picture and its mipmaps, whose sides are at most 2048 texels. [Units: bytes]
    #[must_use]
    pub fn n_bytes(&self) -> u64 {
        self.n_bytes
    }
}

/// Makes pieces of one hollow world ready for the adapter: the slow half of an arrival, for any thread. Clones are cheap.
#[derive(Clone)]
pub struct PieceMaker(pub(super) Arc<Making>);

pub(super) struct Making {
    pub(super) dress: Dress,
    /// Per batch: the color of its first cell.
    colors: Vec<u32>,
    /// Per mesh: its number of triangles, if an object shows it.
    mesh_triangles: Vec<Option<u32>>,
    n_images: usize,
    per_index: u64,
}

impl PieceMaker {
    pub(super) fn new(gpu: &Gpu, world: &World, sight: &Sight, dress: Dress) -> Self {
        let mut mesh_triangles = vec![None; world.detail_meshes.len()];
        for (i, object) in (0..).zip(&world.details) {
            if let Some(n) = mesh_triangles.get_mut(object.mesh as usize) {
                *n = Some(sight.detail_triangles(i));
            }
        }
        let listed = if gpu.fetches() { 0 } else { PER_LISTED };
        Self(Arc::new(Making {
            dress,
            colors: (world.batches.iter())
                .map(|b| color_of(&world.graph, &b.cells))
                .collect(),
            mesh_triangles,
            n_images: world.images.len(),
            per_index: PER_INDEX + listed,
        }))
    }

    /// Makes the triangles of a batch ready. `sight` is that of the world. O(n log n) in them.
    ///
    /// # Errors
    ///
    /// If `primitive` is not the batch's.
    pub fn batch(
        &self,
        sight: &Sight,
        batch: u32,
        primitive: &Primitive,
    ) -> Result<GpuPiece, RenderError> {
        let of = PieceOf::Batch(batch);
        let color = (self.0.colors.get(batch as usize)).ok_or(RenderError::OtherPiece { of })?;
        let order = sight.chunk_order(batch, primitive)?;
        let mut filling = Filling::new(&self.0.dress);
        let whole = filling.add(primitive, &order, *color);
        let chunks = sight.chunks_of(batch);
        let chunks = &sight.chunks()[chunks.start as usize..chunks.end as usize];
        let spans = chunks.iter().map(|c| Span {
            first: c.first_index,
            n: c.n_indices,
            ..whole
        });
        let spans = spans.collect();
        Ok(self.triangles(of, filling, spans))
    }

    /// Makes the triangles of a mesh ready. O(n) in them.
    ///
    /// # Errors
    ///
    /// If `primitives` are not the mesh's.
    pub fn mesh(&self, mesh: u32, primitives: &[Primitive]) -> Result<GpuPiece, RenderError> {
        let of = PieceOf::Mesh(mesh);
        let other = || RenderError::OtherPiece { of };
        let known = self.0.mesh_triangles.get(mesh as usize).ok_or_else(other)?;
        let mut n = 0;
        for p in primitives {
            n += p.triples().len();
            let is_whole = p.indices.len().is_multiple_of(3)
                && p.indices.iter().all(|&i| (i as usize) < p.positions.len());
            if !is_whole {
                return Err(other());
            }
        }
        if known.is_some_and(|known| known as usize != n) {
            return Err(other());
        }
        let mut filling = Filling::new(&self.0.dress);
        let spans = filling.add_mesh(primitives.iter());
        Ok(self.triangles(of, filling, spans))
    }

    /// Makes a picture ready: decodes it and makes its mipmaps. One that is damaged or too large shows as the color of its
    /// materials.
    ///
    /// # Errors
    ///
    /// If the world has no such image.
    pub fn image(&self, image: u32, bytes: &[u8]) -> Result<GpuPiece, RenderError> {
        let of = PieceOf::Image(image);
        if image as usize >= self.0.n_images {
            return Err(RenderError::OtherPiece { of });
        }
        let decoded = decode(bytes, &mut MAX_PICTURE.clone());
        let levels = decoded.map_or(Vec::new(), |d| d.levels);
        Ok(GpuPiece {
            of,
            n_bytes: levels.iter().map(|l| l.as_raw().len() as u64).sum(),
            content: PieceContent::Picture(levels),
        })
    }

    fn triangles(&self, of: PieceOf, filling: Filling<'_>, spans: Vec<Span>) -> GpuPiece {
        let (n, n_indices) = (filling.corners.len() as u64, filling.indices.len() as u64);
        GpuPiece {
            of,
            n_bytes: n * PER_CORNER + n_indices * self.0.per_index,
            content: PieceContent::Triangles {
                corners: filling.corners,
                indices: filling.indices,
                spans,
            },
        }
    }
}
