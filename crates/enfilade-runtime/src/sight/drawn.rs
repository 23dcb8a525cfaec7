//! The drawn parts of a world, in pieces small enough to be culled one by one.

use enfilade_cpg::{Batch, CellId, DetailObject, VisibleParts, World};
use enfilade_geom::Aabb;
use enfilade_geom::scene::Primitive;
use glam::Vec3;

use crate::chunks::{Chunk, chunks_of};
use crate::doors::Doors;
use crate::options::SightOptions;
use crate::point::point;
use crate::sight_error::SightError;

/// A placed detail object.
#[derive(Clone, Debug)]
pub(crate) struct Detail {
    /// In the model's pose. [Units: wu]
    pub(crate) bounds: Aabb,
    pub(crate) n_triangles: u32,
}

/// Chunks of batches and placed details.
pub(super) struct Drawn {
    pub(super) chunks: Vec<Chunk>,
    pub(super) details: Vec<Detail>,
    /// Per batch: the area of its triangles. [Units: wu²]
    pub(super) areas: Vec<f32>,
    /// Per batch: its triangles as index triples, sorted so that chunks are ranges.
    pub(super) indices: Vec<Vec<u32>>,
    /// Number of vertices and of indices of all batches and meshes, each mesh once.
    pub(super) sizes: [u64; 2],
    /// Chunk of each triangle, over all batches in order.
    chunk_of: Vec<u32>,
    /// Largest absolute coordinate, or 1. [Units: wu]
    pub(super) extent: f64,
}

impl Drawn {
    pub(super) fn of(world: &World, options: &SightOptions) -> Result<Self, SightError> {
        let mut drawn = Self {
            chunks: Vec::new(),
            details: Vec::new(),
            areas: Vec::new(),
            indices: Vec::new(),
            sizes: [0; 2],
            chunk_of: Vec::new(),
            extent: 1.0,
        };
        let batches = world.batches.iter().map(|b| &b.primitive);
        let meshes = world.detail_meshes.iter().flat_map(|m| &m.primitives);
        for primitive in batches.chain(meshes) {
            drawn.sizes[0] += primitive.positions.len() as u64;
            drawn.sizes[1] += primitive.indices.len() as u64;
        }
        for (index, batch) in world.batches.iter().enumerate() {
            let index = index as u32;
            drawn
                .add_batch(world, index, batch, options)
                .ok_or(SightError::Geometry {
                    what: "batch",
                    index,
                })?;
        }
        for (index, detail) in world.details.iter().enumerate() {
            let index = index as u32;
            drawn
                .add_detail(world, detail)
                .ok_or(SightError::Geometry {
                    what: "detail",
                    index,
                })?;
        }
        Ok(drawn)
    }

    /// `None` if it refers to a missing index, or a vertex is not finite.
    fn add_batch(
        &mut self,
        world: &World,
        index: u32,
        batch: &Batch,
        options: &SightOptions,
    ) -> Option<()> {
        let positions = &batch.primitive.positions;
        if !exist(world, &batch.cells) || !is_drawable(&batch.primitive) {
            return None;
        }
        for p in positions {
            self.extent = self.extent.max(point(*p).abs().max_element());
        }
        let size = options.chunk_triangles.max(1);
        let first = self.chunks.len();
        let sorted = chunks_of(index, &batch.primitive, size, &mut self.chunks);
        let base = self.chunk_of.len();
        self.chunk_of.resize(base + sorted.numbers.len(), 0);
        for (chunk, item) in self.chunks[first..].iter().zip(first as u32..) {
            let place = chunk.first_index as usize / 3;
            for &number in &sorted.numbers[place..place + chunk.n_triangles() as usize] {
                self.chunk_of[base + number as usize] = item;
            }
        }
        self.areas.push(area_of(&batch.primitive));
        self.indices.push(sorted.indices);
        Some(())
    }

    /// `None` if it refers to a missing index, or a vertex is not finite.
    fn add_detail(&mut self, world: &World, detail: &DetailObject) -> Option<()> {
        let mesh = world.detail_meshes.get(detail.mesh as usize);
        let mesh = mesh.filter(|_| exist(world, &detail.cells))?;
        let transform = detail.placement();
        let mut bounds = Aabb::EMPTY;
        let mut n_triangles = 0;
        for primitive in &mesh.primitives {
            n_triangles += primitive.indices.len() as u32 / 3;
            for p in &primitive.positions {
                let p = transform.transform_point3(point(*p));
                if !p.is_finite() {
                    return None;
                }
                bounds = bounds.including(p);
                self.extent = self.extent.max(p.abs().max_element());
            }
        }
        self.details.push(Detail {
            bounds,
            n_triangles,
        });
        Some(())
    }

    /// Per cell, the chunks and details (from `chunks.len()` on) that may be seen from it, if the world has that information.
    /// Time: pairs of cells that see each other, times the contents of the second.
    pub(super) fn seen_from(&self, world: &World, doors: &Doors) -> Option<VisibleParts> {
        let pvs = world.pvs.as_ref()?;
        let is_whole = pvs.n_cells() == world.graph.cells.len();
        let parts = (pvs.parts.as_ref()).filter(|p| is_whole && p.n_pairs() == pvs.n_pairs())?;
        let n_chunks = self.chunks.len();
        let item_of = |part: u32| {
            let detail = || n_chunks + (part as usize - self.chunk_of.len());
            let chunk = self.chunk_of.get(part as usize);
            chunk.map_or_else(detail, |&chunk| chunk as usize)
        };
        // Cell by cell; an item is seen if any part of it is, in any cell.
        let mut last_seen_by = vec![u32::MAX; n_chunks + self.details.len()];
        let mut rows = vec![Vec::new(); pvs.n_cells()];
        for (pair, (from, _)) in pvs.pairs().enumerate() {
            for part in parts.runs_of(pair).iter().flat_map(|&[a, b]| a..b) {
                let item = item_of(part);
                let by = last_seen_by.get_mut(item)?;
                if *by != from.0 {
                    *by = from.0;
                    rows[from.idx()].push(item as u32);
                }
            }
        }
        // The precomputed visibility of leaves is for the model's pose; they move, so never leave them out.
        let leaves = (0..self.details.len()).filter(|&d| doors.way(d as u32).is_some());
        let leaves: Vec<u32> = leaves.map(|d| (n_chunks + d) as u32).collect();
        for row in &mut rows {
            row.extend_from_slice(&leaves);
            row.sort_unstable();
            row.dedup();
        }
        Some(VisibleParts::of_ascending(rows))
    }
}

fn exist(world: &World, cells: &[CellId]) -> bool {
    let n_cells = world.graph.cells.len();
    cells.iter().all(|c| (c.0 as usize) < n_cells)
}

/// Returns `true` if all indices exist and all positions are finite.
pub(crate) fn is_drawable(primitive: &Primitive) -> bool {
    let n = primitive.positions.len();
    primitive.indices.iter().all(|&i| (i as usize) < n)
        && primitive.positions.iter().flatten().all(|x| x.is_finite())
}

fn area_of(primitive: &Primitive) -> f32 {
    let corner = |i: u32| Vec3::from(primitive.positions[i as usize]);
    let areas = primitive.triples().iter().map(|t| {
        let [a, b, c] = t.map(corner);
        (b - a).cross(c - a).length() * 0.5
    });
    areas.sum()
}
