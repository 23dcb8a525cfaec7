//! What a set of visible cells means for who made the scene: numbers by cell, and pairs that see each other.
//!
//! After Dirkse, section 7.6.3 (statistics for the modeller) and 7.6.2 (objects by cell), and Gjørup,
//! section 3.2.2 (pairs for radiosity).

use std::cmp::Reverse;
use std::fmt::Write;

use enfilade::cpg::{CellId, Pvs, SightGraph, World};
use enfilade::geom::DVec3;

/// What can be seen from each cell.
#[derive(serde::Serialize)]
pub(super) struct Statistics {
    /// By cell.
    cells: Vec<FromCell>,
    /// The ten viewpoints from which most can be seen, the worst first: by triangles, then by cells.
    worst: Vec<Viewpoint>,
}

#[derive(serde::Serialize)]
struct FromCell {
    name: String,
    /// Cells that can be seen, itself among them.
    cells: usize,
    /// Detail objects that can be seen, and their numbers in the world.
    objects: usize,
    visible_objects: Vec<u32>,
    /// Triangles of walls and objects that can be seen.
    triangles: usize,
}

#[derive(serde::Serialize)]
struct Viewpoint {
    cell: usize,
    name: String,
    /// A point among the cell's doorways, or its middle where it has none. [Units: wu]
    point: [f64; 3],
    cells: usize,
    triangles: usize,
}

impl Statistics {
    /// Time: cells times batches and objects.
    pub(super) fn new(visible: &Pvs, world: Option<&World>, graph: &SightGraph) -> Self {
        let cells: Vec<FromCell> = (0..visible.n_cells())
            .map(|c| from_cell(c, visible, world))
            .collect();
        let mut order: Vec<usize> = (0..cells.len()).collect();
        order.sort_by_key(|&c| (Reverse((cells[c].triangles, cells[c].cells)), c));
        order.truncate(10);
        let worst = order
            .into_iter()
            .map(|c| Viewpoint {
                cell: c,
                name: cells[c].name.clone(),
                point: viewpoint(c, world, graph).to_array(),
                cells: cells[c].cells,
                triangles: cells[c].triangles,
            })
            .collect();
        Self { cells, worst }
    }
}

fn from_cell(c: usize, visible: &Pvs, world: Option<&World>) -> FromCell {
    let mut from = FromCell {
        name: String::new(),
        cells: visible.n_visible_from(CellId(c as u32)),
        objects: 0,
        visible_objects: Vec::new(),
        triangles: 0,
    };
    let Some(world) = world else { return from };
    let is_seen = |cells: &[CellId]| {
        cells
            .iter()
            .any(|&cell| visible.sees(CellId(c as u32), cell))
    };
    from.name.clone_from(&world.graph.cells[c].name);
    let batches = world.batches.iter().filter(|batch| is_seen(&batch.cells));
    from.triangles = batches.map(|batch| batch.primitive.indices.len() / 3).sum();
    for (i, object) in world.details.iter().enumerate() {
        if is_seen(&object.cells) {
            from.visible_objects.push(i as u32);
            let mesh = &world.detail_meshes[object.mesh as usize];
            let indices = mesh.primitives.iter().map(|p| p.indices.len());
            from.triangles += indices.sum::<usize>() / 3;
        }
    }
    from.objects = from.visible_objects.len();
    from
}

fn viewpoint(c: usize, world: Option<&World>, graph: &SightGraph) -> DVec3 {
    let of_cell = |cells: &[u32; 2]| cells.contains(&(c as u32));
    let portals = graph.portals.iter().filter(|p| of_cell(&p.cells));
    let (sum, n) = portals.fold((DVec3::ZERO, 0.0), |(sum, n), p| {
        let middle = p.winding.iter().sum::<DVec3>() / p.winding.len() as f64;
        (sum + middle, n + 1.0)
    });
    match world {
        _ if n > 0.0 => sum / n,
        Some(world) => {
            let [low, high] = world.graph.cells[c].aabb.map(|p| p.map(f64::from));
            (DVec3::from_array(low) + DVec3::from_array(high)) * 0.5
        }
        None => DVec3::ZERO,
    }
}

/// Pairs that may see each other, each once, as text: `MUT1`, then a line a cell with the greater numbers that it
/// sees, as ranges; with a world, the same for its batches of structural triangles.
///
/// Two surfaces may see each other where a cell of one sees a cell of the other.
pub(super) fn mutual(visible: &Pvs, world: Option<&World>) -> String {
    let mut out = String::from("MUT1\n");
    let _ = writeln!(out, "cells {}", visible.n_cells());
    for a in 0..visible.n_cells() {
        let set = visible.visible_from(CellId(a as u32));
        put_greater(&mut out, a, set.map(|b| b.0));
    }
    let Some(world) = world else { return out };
    let n = world.batches.len();
    let mut by_cell = vec![Vec::new(); visible.n_cells()];
    for (i, batch) in world.batches.iter().enumerate() {
        for cell in &batch.cells {
            by_cell[cell.0 as usize].push(i as u32);
        }
    }
    let _ = writeln!(out, "surfaces {n}");
    for (i, batch) in world.batches.iter().enumerate() {
        let cells = batch.cells.iter().flat_map(|&c| visible.visible_from(c));
        let mut seen: Vec<u32> = cells
            .flat_map(|c| by_cell[c.0 as usize].iter().copied())
            .collect();
        seen.sort_unstable();
        seen.dedup();
        put_greater(&mut out, i, seen.into_iter());
    }
    out
}

/// `a: 3-5 9`, of ascending numbers those greater than `a`.
fn put_greater(out: &mut String, a: usize, seen: impl Iterator<Item = u32>) {
    let mut ranges: Vec<(u32, u32)> = Vec::new();
    for b in seen.filter(|&b| b as usize > a) {
        match ranges.last_mut() {
            Some((_, last)) if *last + 1 == b => *last = b,
            _ => ranges.push((b, b)),
        }
    }
    let _ = write!(out, "{a}:");
    for (first, last) in ranges {
        let _ = if first == last {
            write!(out, " {first}")
        } else {
            write!(out, " {first}-{last}")
        };
    }
    out.push('\n');
}

#[cfg(test)]
mod tests {
    use enfilade::cpg::CellSet;

    use super::*;

    #[test]
    fn pairs_are_listed_once_as_ranges() {
        let mut sets = vec![CellSet::new(5); 5];
        for (a, b) in [(0, 1), (0, 2), (0, 4), (1, 2)] {
            sets[a].insert(CellId(b as u32));
            sets[b].insert(CellId(a as u32));
        }
        for (c, set) in sets.iter_mut().enumerate() {
            set.insert(CellId(c as u32));
        }
        assert_eq!(
            mutual(&Pvs::of_rows(&sets), None),
            "MUT1\ncells 5\n0: 1-2 4\n1: 2\n2:\n3:\n4:\n"
        );
    }
}
