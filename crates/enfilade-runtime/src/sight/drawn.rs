//! The drawn parts of a world, in pieces small enough to be culled one by one, and the trees over their boxes.

use enfilade_cpg::{Batch, CellId, DetailObject, VisibleParts, World};
use enfilade_geom::Aabb;

use crate::boxes::{BoxTrees, Boxed, Root};
use crate::chunks::{Chunk, chunks_of};
use crate::doors::Doors;
use crate::options::SightOptions;
use crate::point::point;
use crate::sight_error::SightError;

/// A placed detail object.
#[derive(Clone, Debug)]
pub(crate) struct Detail {
    pub(crate) bounds: Aabb,
    pub(crate) n_triangles: u32,
}

/// Chunks of batches and placed details.
pub(super) struct Drawn {
    pub(super) chunks: Vec<Chunk>,
    pub(super) details: Vec<Detail>,
    /// Per batch: its triangles as index triples, sorted so that chunks are ranges.
    pub(super) indices: Vec<Vec<u32>>,
    /// Chunk of each triangle, over all batches in order.
    chunk_of: Vec<u32>,
    /// Largest absolute coordinate, or 1. [Units: wu]
    pub(super) extent: f64,
}

impl Drawn {
    pub(super) fn of(
        world: &World,
        options: &SightOptions,
        doors: &Doors,
    ) -> Result<Self, SightError> {
        let mut drawn = Self {
            chunks: Vec::new(),
            details: Vec::new(),
            indices: Vec::new(),
            chunk_of: Vec::new(),
            extent: 1.0,
        };
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
        for (i, detail) in (0..).zip(&mut drawn.details) {
            if let Some((swept, _)) = doors.way(i) {
                detail.bounds = detail.bounds.union(swept);
            }
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
        let used = &batch.primitive.indices;
        let is_good = exist(world, &batch.cells)
            && used.iter().all(|&i| (i as usize) < positions.len())
            && positions.iter().flatten().all(|x| x.is_finite());
        if !is_good {
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

    pub(super) fn n_triangles(&self) -> u64 {
        let chunks = self.chunks.iter().map(|c| u64::from(c.n_triangles()));
        let details = self.details.iter().map(|d| u64::from(d.n_triangles));
        chunks.sum::<u64>() + details.sum::<u64>()
    }
}

fn exist(world: &World, cells: &[CellId]) -> bool {
    let n_cells = world.graph.cells.len();
    cells.iter().all(|c| (c.0 as usize) < n_cells)
}

/// Trees over the boxes of what is drawn, by cell, and of the cells.
pub(super) struct Boxes {
    pub(super) trees: BoxTrees,
    pub(super) cell_roots: Vec<Root>,
    pub(super) unlisted_root: Root,
    pub(super) world_root: Root,
    /// Largest absolute coordinate of a cell's box. [Units: wu]
    pub(super) extent: f64,
}

impl Boxes {
    pub(super) fn of(world: &World, drawn: &Drawn, doors: &Doors, tolerance: f64) -> Self {
        let (mut listed, mut unlisted) = listed(world, drawn, doors);
        let mut trees = BoxTrees::default();
        let mut boxes = Vec::new();
        let mut cell_roots = Vec::new();
        let mut extent = 0.0_f64;
        for (c, items) in listed.iter_mut().enumerate() {
            let [low, high] = world.graph.cells[c].aabb.map(point);
            let mut bounds = Aabb::EMPTY;
            if low.is_finite() && high.is_finite() {
                bounds = bounds.union(Aabb::new(low, high));
            }
            let bounds = items.iter().fold(bounds, |b, i| b.union(i.bounds));
            if !bounds.is_empty() {
                extent = extent.max(bounds.min.abs().max(bounds.max.abs()).max_element());
                boxes.push(Boxed {
                    bounds,
                    item: c as u32,
                });
            }
            cell_roots.push(trees.add(items, tolerance));
        }
        let world_root = trees.add(&mut boxes, tolerance);
        let unlisted_root = trees.add(&mut unlisted, tolerance);
        Self {
            trees,
            cell_roots,
            unlisted_root,
            world_root,
            extent,
        }
    }
}

/// Per cell, the chunks and details that it sees; and those that no cell sees.
fn listed(world: &World, drawn: &Drawn, doors: &Doors) -> (Vec<Vec<Boxed>>, Vec<Boxed>) {
    let mut listed: Vec<Vec<Boxed>> = world.graph.cells.iter().map(|_| Vec::new()).collect();
    let mut unlisted = Vec::new();
    let mut list = |cells: &[CellId], bounds: Aabb, item: u32| {
        if cells.is_empty() {
            unlisted.push(Boxed { bounds, item });
        }
        for c in cells {
            listed[c.0 as usize].push(Boxed { bounds, item });
        }
    };
    let n_chunks = drawn.chunks.len() as u32;
    for (item, chunk) in (0..).zip(&drawn.chunks) {
        let batch = &world.batches[chunk.batch as usize];
        list(&batch.cells, chunk.bounds(), item);
    }
    for (item, (placed, detail)) in (n_chunks..).zip(world.details.iter().zip(&drawn.details)) {
        match doors.way(item - n_chunks) {
            None => list(&placed.cells, detail.bounds, item),
            Some((_, way)) => {
                let mut cells = [&placed.cells, way].concat();
                cells.sort_unstable();
                cells.dedup();
                list(&cells, detail.bounds, item);
            }
        }
    }
    (listed, unlisted)
}
