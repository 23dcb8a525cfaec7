//! Statistics of visible cells for the author of a scene: numbers for each cell, and pairs that see each other.
//!
//! After Dirkse, section 7.6.3 (statistics for the modeler) and 7.6.2 (objects by cell), and Gjørup, section 3.2.2
//! (pairs for radiosity).

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::ops::Range;

use enfilade::cpg::{CellId, PartNumbers, Pvs, SightGraph, World};
use enfilade::geom::DVec3;

/// Statistics of all cells.
#[derive(serde::Serialize)]
pub(super) struct Statistics {
    /// Indexed by cell.
    cells: Vec<FromCell>,
    /// The ten viewpoints with most visible, the worst first: by triangles, then by cells.
    worst: Vec<Viewpoint>,
    /// Triangles of walls and objects in the world.
    #[serde(rename = "triangles")]
    pub(super) n_triangles: usize,
}

#[derive(serde::Serialize)]
struct FromCell {
    name: String,
    /// Number of visible cells, including itself.
    cells: usize,
    /// Number of visible detail objects, and their indices in the world.
    objects: usize,
    visible_objects: Vec<u32>,
    /// Number of visible triangles of walls and objects.
    triangles: usize,
    /// Numbers of detail objects and triangles of the visible cells, including those not visible themselves.
    objects_of_cells: usize,
    triangles_of_cells: usize,
    /// The visible part of each cell. The sum of these numbers may exceed the total, because things that two cells
    /// share count for both.
    destinations: Vec<Destination>,
}

#[derive(serde::Serialize)]
struct Destination {
    cell: u32,
    objects: usize,
    triangles: usize,
}

#[derive(serde::Serialize)]
struct Viewpoint {
    cell: usize,
    name: String,
    /// A point among the cell's doorways, or its middle if it has none. [Units: wu]
    point: [f64; 3],
    cells: usize,
    triangles: usize,
}

impl Statistics {
    /// Counts the parts in `visible`, or whole cells if it has none. Time: pairs of cells times the contents of the
    /// second.
    pub(super) fn new(visible: &Pvs, world: Option<&World>, graph: &SightGraph) -> Self {
        let contents = world.map(Contents::new);
        let mut first_pair = 0;
        let cells: Vec<FromCell> = (0..visible.n_cells() as u32)
            .map(|c| {
                let mut from = FromCell::new(visible, CellId(c));
                if let (Some(world), Some(contents)) = (world, &contents) {
                    from.name.clone_from(&world.graph.cells[c as usize].name);
                    contents.count(visible, CellId(c), first_pair, &mut from);
                }
                first_pair += from.cells;
                from
            })
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
        let n_triangles = contents.map_or(0, |c| c.triangles_of(0..c.numbers.n_parts()));
        Self {
            cells,
            worst,
            n_triangles,
        }
    }

    /// Means over all cells: triangles visible from a cell, and triangles of its visible cells.
    pub(super) fn mean_triangles(&self) -> [f64; 2] {
        let n = self.cells.len().max(1) as f64;
        let sums = self.cells.iter().fold([0, 0], |[a, b], cell| {
            [a + cell.triangles, b + cell.triangles_of_cells]
        });
        sums.map(|sum| sum as f64 / n)
    }
}

impl FromCell {
    fn new(visible: &Pvs, cell: CellId) -> Self {
        Self {
            name: String::new(),
            cells: visible.n_visible_from(cell),
            objects: 0,
            visible_objects: Vec::new(),
            triangles: 0,
            objects_of_cells: 0,
            triangles_of_cells: 0,
            destinations: Vec::new(),
        }
    }
}

/// The contents of each cell, as [`PartNumbers`].
struct Contents {
    numbers: PartNumbers,
    /// For each detail object, the number of triangles of those before it; then of all.
    of_details: Vec<usize>,
    by_cell: Vec<Vec<Range<u32>>>,
    /// For each cell, the batches visible without passing a portal.
    batches: Vec<Vec<u32>>,
}

impl Contents {
    fn new(world: &World) -> Self {
        let numbers = PartNumbers::new(world);
        let mut by_cell = vec![Vec::new(); world.graph.cells.len()];
        let mut batches = vec![Vec::new(); world.graph.cells.len()];
        for (i, batch) in world.batches.iter().enumerate() {
            for cell in &batch.cells {
                batches[cell.idx()].push(i as u32);
                by_cell[cell.idx()].push(numbers.of_batch(i));
            }
        }
        let mut of_details = vec![0];
        for (i, object) in (0..).zip(&world.details) {
            for cell in &object.cells {
                let part = numbers.of_detail(i);
                by_cell[cell.idx()].push(part..part + 1);
            }
            let mesh = &world.detail_meshes[object.mesh as usize];
            let n: usize = mesh.primitives.iter().map(|p| p.indices.len() / 3).sum();
            of_details.push(of_details[i as usize] + n);
        }
        Self {
            numbers,
            of_details,
            by_cell,
            batches,
        }
    }

    /// The triangles of walls and objects in a range of parts.
    fn triangles_of(&self, parts: Range<u32>) -> usize {
        let split = self.numbers.n_triangles();
        let walls = parts.end.min(split).saturating_sub(parts.start) as usize;
        let detail = |part: u32| self.of_details[part.saturating_sub(split) as usize];
        walls + detail(parts.end) - detail(parts.start)
    }

    fn count(&self, visible: &Pvs, cell: CellId, first_pair: usize, from: &mut FromCell) {
        let n_parts = self.numbers.n_parts() as usize;
        let (mut seen, mut held) = (vec![false; n_parts], vec![false; n_parts]);
        for (pair, to) in (first_pair..).zip(visible.visible_from(cell)) {
            let all = &self.by_cell[to.idx()];
            for parts in all {
                held[parts.start as usize..parts.end as usize].fill(true);
            }
            let runs: Vec<Range<u32>> = match &visible.parts {
                Some(parts) => parts.runs_of(pair).iter().map(|&[a, b]| a..b).collect(),
                None => all.clone(),
            };
            let split = self.numbers.n_triangles();
            let objects = runs
                .iter()
                .map(|r| r.end.saturating_sub(r.start.max(split)));
            from.destinations.push(Destination {
                cell: to.0,
                objects: objects.sum::<u32>() as usize,
                triangles: runs.iter().map(|r| self.triangles_of(r.clone())).sum(),
            });
            for parts in runs {
                seen[parts.start as usize..parts.end as usize].fill(true);
            }
        }
        let ones = |bits: &[bool]| {
            let numbers = (0..).zip(bits.to_vec());
            numbers.filter(|b| b.1).map(|b| b.0).collect::<Vec<u32>>()
        };
        let split = self.numbers.n_triangles();
        let is_object = |&part: &u32| part >= split;
        let sum = |parts: &[u32]| parts.iter().map(|&p| self.triangles_of(p..p + 1)).sum();
        let (seen, held) = (ones(&seen), ones(&held));
        from.triangles = sum(&seen);
        from.triangles_of_cells = sum(&held);
        let objects = seen.iter().copied().filter(is_object);
        from.visible_objects = objects.map(|part| part - split).collect();
        from.objects = from.visible_objects.len();
        from.objects_of_cells = held.iter().copied().filter(is_object).count();
    }
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

/// The pairs that may see each other, each once, as text: `MUT1`, then one line per cell with the visible cells of
/// greater number, as ranges; for a world, the same for its surfaces, which are its batches of structural triangles.
///
/// Two surfaces may see each other if there is a cell of each such that a part of either surface is visible from the
/// other's cell: by the parts in `visible`, or by whole cells if it has none.
pub(super) fn mutual(visible: &Pvs, world: Option<&World>) -> String {
    let mut out = String::from("MUT1\n");
    let _ = writeln!(out, "cells {}", visible.n_cells());
    for a in 0..visible.n_cells() {
        let set = visible.visible_from(CellId(a as u32));
        put_greater(&mut out, a, set.map(|b| b.0));
    }
    let Some(world) = world else { return out };
    let _ = writeln!(out, "surfaces {}", world.batches.len());
    for (i, seen) in mutual_surfaces(visible, world).into_iter().enumerate() {
        put_greater(&mut out, i, seen.into_iter());
    }
    out
}

/// For each surface, those that it may see and that may see it, ascending.
fn mutual_surfaces(visible: &Pvs, world: &World) -> Vec<BTreeSet<u32>> {
    let contents = Contents::new(world);
    // For each pair of cells, the surfaces of the second that the first may see.
    let mut seen: BTreeMap<(u32, u32), Vec<u32>> = BTreeMap::new();
    for (pair, (a, b)) in visible.pairs().enumerate() {
        let in_sight = |batch: u32| {
            let triangles = contents.numbers.of_batch(batch as usize);
            let meets = |run: &[u32; 2]| run[0] < triangles.end && triangles.start < run[1];
            let parts = visible.parts.as_ref();
            parts.is_none_or(|parts| parts.runs_of(pair).iter().any(meets))
        };
        let batches = contents.batches[b.idx()].iter().copied();
        seen.insert((a.0, b.0), batches.filter(|&i| in_sight(i)).collect());
    }
    let mut out = vec![BTreeSet::new(); world.batches.len()];
    for (&(a, b), of_b) in &seen {
        let Some(of_a) = seen.get(&(b, a)).filter(|_| a <= b) else {
            continue;
        };
        for &i in of_a {
            for &j in of_b {
                out[i as usize].insert(j);
                out[j as usize].insert(i);
            }
        }
    }
    out
}

/// Writes `a: 3-5 9`: of ascending numbers, those greater than `a`, as ranges.
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
