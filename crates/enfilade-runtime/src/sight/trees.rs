//! Trees over the boxes of what is drawn, by cell, and of the cells.

use enfilade_cpg::{CellId, World};
use enfilade_geom::Aabb;

use super::skeleton::SightSkeleton;
use crate::boxes::{BoxTrees, Boxed, Root};
use crate::doors::Doors;
use crate::point::point;

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
    pub(super) fn of(world: &World, drawn: &SightSkeleton, doors: &Doors, tolerance: f64) -> Self {
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
fn listed(world: &World, drawn: &SightSkeleton, doors: &Doors) -> (Vec<Vec<Boxed>>, Vec<Boxed>) {
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
            Some((swept, way)) => {
                let mut cells = [&placed.cells, way].concat();
                cells.sort_unstable();
                cells.dedup();
                list(&cells, detail.bounds.union(swept), item);
            }
        }
    }
    (listed, unlisted)
}
