//! Draw lists: the visible chunks of a frame as few ranges of triangles.

use std::ops::Index;

use enfilade_cpg::{Batch, DetailObject, World};

use crate::chunks::Chunk;
use crate::seen::{ChunkId, DetailId, Seen};
use crate::sight::Sight;

/// A range of one batch's triangles for one draw call.
///
/// With a vertex buffer of `draw.batch(&world).primitive.positions` and an index buffer of
/// [`Sight::indices`] per batch, it is one indexed draw of `n_indices` from `first_index` on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Draw {
    /// Index into `World::batches`.
    pub batch: u32,
    /// First index (three per triangle) in [`Sight::indices`] of the batch.
    pub first_index: u32,
    /// Number of indices.
    pub n_indices: u32,
}

impl Draw {
    /// Returns the batch that it draws a part of: positions, attributes, material. O(1).
    ///
    /// # Panics
    ///
    /// If `world` is not the one that the [`Sight`] was built from.
    #[must_use]
    pub fn batch<'a>(&self, world: &'a World) -> &'a Batch {
        &world.batches[self.batch as usize]
    }

    /// Returns its triangles as triples of indices into the batch's positions; none in a hollow world. O(1).
    #[must_use]
    pub fn indices<'a>(&self, sight: &'a Sight) -> &'a [u32] {
        let first = self.first_index as usize;
        let indices = sight.indices(self.batch);
        (indices.get(first..first + self.n_indices as usize)).unwrap_or_default()
    }
}

/// The draws of one frame. Keep it between frames: it allocates nothing once its buffers have grown.
#[derive(Clone, Debug, Default)]
pub struct DrawList {
    draws: Vec<Draw>,
    /// Per batch: one more than its rank in order of first appearance, or 0 if it is not seen.
    ranks: Vec<u32>,
    /// Rank and chunk.
    sorted: Vec<(u32, u32)>,
}

impl DrawList {
    /// An empty list.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Replaces the list by the draws of `seen`, an answer of `sight`: batches near to far, each in as few ranges as its
    /// visible chunks allow. O(n log n) in these chunks, and O(batches).
    ///
    /// Detail objects are placed meshes, drawn with their transforms: `for id in seen.details() { &world[*id] … }`.
    pub fn fill(&mut self, sight: &Sight, seen: &Seen<'_>) {
        self.draws.clear();
        self.sorted.clear();
        self.ranks.clear();
        self.ranks.resize(sight.n_batches(), 0);
        let mut n_ranks = 0;
        for &id in seen.chunks() {
            let rank = &mut self.ranks[sight[id].batch as usize];
            if *rank == 0 {
                n_ranks += 1;
                *rank = n_ranks;
            }
            self.sorted.push((*rank, id.0));
        }
        // Chunks of a batch are numbered in the order of its indices.
        self.sorted.sort_unstable();
        for &(_, id) in &self.sorted {
            let chunk = &sight[ChunkId(id)];
            match self.draws.last_mut() {
                Some(last)
                    if last.batch == chunk.batch
                        && last.first_index + last.n_indices == chunk.first_index =>
                {
                    last.n_indices += chunk.n_indices;
                }
                _ => self.draws.push(Draw {
                    batch: chunk.batch,
                    first_index: chunk.first_index,
                    n_indices: chunk.n_indices,
                }),
            }
        }
    }

    /// Returns the draws, batches near to far.
    #[must_use]
    pub fn draws(&self) -> &[Draw] {
        &self.draws
    }

    /// Returns the number of triangles drawn.
    #[must_use]
    pub fn n_triangles(&self) -> u64 {
        self.draws.iter().map(|d| u64::from(d.n_indices / 3)).sum()
    }
}

impl<'a> IntoIterator for &'a DrawList {
    type Item = &'a Draw;
    type IntoIter = std::slice::Iter<'a, Draw>;

    fn into_iter(self) -> Self::IntoIter {
        self.draws.iter()
    }
}

/// # Panics
///
/// If there is no such chunk.
impl Index<ChunkId> for Sight {
    type Output = Chunk;

    #[inline]
    fn index(&self, chunk: ChunkId) -> &Chunk {
        &self.drawn.chunks[chunk.0 as usize]
    }
}

/// # Panics
///
/// If there is no such detail object.
impl Index<DetailId> for World {
    type Output = DetailObject;

    #[inline]
    fn index(&self, detail: DetailId) -> &DetailObject {
        &self.details[detail.0 as usize]
    }
}
