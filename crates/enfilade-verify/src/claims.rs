//! Numbers and names that a world stores about its cells: boxes, volumes, counts.

use enfilade_cpg::{CellId, DetailObject, Seals, World};

use crate::locator_cells::measure;
use crate::subject::to_dvec;

/// Largest relative error of a volume: builders add up the same leaves, but slivers may go to either side.
const VOLUME_SHARE: f64 = 1e-3;
/// Allowed error of a volume in any case, and per square meter of its box: planes may be snapped by a tolerance.
/// [Units: wu]
const VOLUME_SKIN: f64 = 1e-4;
/// Allowed error of a side of a box. [Units: wu]
const SIDE: f64 = 1e-3;

/// Returns problems, a line each.
pub(crate) fn check(world: &World) -> Vec<String> {
    let mut out = Vec::new();
    check_names(world, &mut out);
    check_counts(world, &mut out);
    check_extents(world, &mut out);
    check_mutual(world, &mut out);
    out
}

/// Checks that visibility is mutual. Special portals may show a cell that does not look back.
fn check_mutual(world: &World, out: &mut Vec<String>) {
    let Some(pvs) = &world.pvs else { return };
    if !world.graph.specials.is_empty() {
        return;
    }
    let mut one_way = pvs.pairs().filter(|&(a, b)| !pvs.sees(b, a));
    if let Some((a, b)) = one_way.next() {
        let n = 1 + one_way.count();
        let [a, b] = [a, b].map(|c| &world.graph[c].name);
        out.push(format!(
            "{a} sees {b} by the world's set, but {b} does not see {a}; {n} such pairs"
        ));
    }
}

/// Checks that a cell named by a number is named by its own.
fn check_names(world: &World, out: &mut Vec<String>) {
    for (i, cell) in world.graph.cells.iter().enumerate() {
        let number = cell.name.strip_prefix("cell-");
        let number = number.and_then(|n| n.parse::<usize>().ok());
        if number.is_some_and(|n| n != i) {
            out.push(format!("cell {i} is named {:?}", cell.name));
        }
    }
}

/// Checks triangle counts against the lists of cells, and that the seals of the bake still exist.
fn check_counts(world: &World, out: &mut Vec<String>) {
    let n_cells = world.graph.cells.len();
    let (mut structural, mut detail) = (vec![0; n_cells], vec![0; n_cells]);
    for batch in world.batches.iter().filter(|b| !b.is_seal) {
        add(&mut structural, &batch.cells, batch.primitive.indices.len());
    }
    for object in &world.details {
        add(&mut detail, &object.cells, n_indices(world, object));
    }
    for (i, cell) in world.graph.cells.iter().enumerate() {
        let pairs = [
            ("triangles", cell.n_triangles, structural[i]),
            ("triangles of details", cell.n_detail_triangles, detail[i]),
        ];
        for (what, said, found) in pairs {
            if said as usize != found / 3 {
                let found = found / 3;
                out.push(format!(
                    "{}: {said} {what} stored, but {found} list the cell",
                    cell.name
                ));
            }
        }
    }
    let total = |sums: &mut dyn Iterator<Item = usize>| sums.sum::<usize>() / 3;
    let of_batches = world.batches.iter().filter(|b| !b.is_seal);
    let structure = total(&mut of_batches.map(|b| b.primitive.indices.len()));
    let details = total(&mut world.details.iter().map(|d| n_indices(world, d)));
    let count = |name: &str| world.graph.statistics.counts.get(name);
    // Only a world with both counts records the number of triangles of details.
    if let (Some(&all), Some(&structural)) =
        (count("input_triangles"), count("structural_triangles"))
    {
        for (what, said, found) in [
            ("structural triangles", structural, structure),
            ("triangles of details", all - structural, details),
        ] {
            if said != found as f64 {
                out.push(format!(
                    "{said} {what} were baked, but the file has {found}"
                ));
            }
        }
    }
    // Later work may cut a seal in two, but never removes one.
    let said = world.graph.statistics.counts.get("seals");
    let found = Seals::of(world).count;
    if let Some(said) = said.filter(|&&said| said > found as f64) {
        out.push(format!("{said} seals were made, but the file has {found}"));
    }
}

fn n_indices(world: &World, object: &DetailObject) -> usize {
    let mesh = &world.detail_meshes[object.mesh as usize];
    mesh.primitives.iter().map(|p| p.indices.len()).sum()
}

fn add(sums: &mut [usize], cells: &[CellId], n: usize) {
    for c in cells {
        sums[c.0 as usize] += n;
    }
}

/// Checks boxes and volumes against the leaves of the locator.
fn check_extents(world: &World, out: &mut Vec<String>) {
    let bounds = world.graph.locator.bounds;
    if bounds.is_empty() {
        return;
    }
    let side = SIDE + 1e-6 * bounds.extent();
    for (cell, found) in world.graph.cells.iter().zip(measure(world)) {
        let [min, max] = cell.aabb.map(to_dvec);
        let name = &cell.name;
        let mut skin = found.bounds.surface_area().max(0.0) * VOLUME_SKIN + VOLUME_SKIN;
        if cell.outdoor {
            // The volume outdoors is a difference of numbers in `f32`.
            skin += 1e-6 * bounds.volume();
        }
        let off = (f64::from(cell.volume) - found.volume).abs();
        if off > VOLUME_SHARE * found.volume + skin {
            let (said, found) = (cell.volume, found.volume);
            out.push(format!(
                "{name}: the stored volume is {said} m³, that of the locator {found:.4} m³"
            ));
        }
        let is_off = if cell.outdoor {
            // The outdoors extends beyond the box.
            (min - bounds.min).max_element() > side || (bounds.max - max).max_element() > side
        } else {
            // The box contains everything but hairs, and is not larger than all leaves.
            let lacks = (min - found.thick.min).max(found.thick.max - max);
            let exceeds = (found.bounds.min - min).max(max - found.bounds.max);
            let is_small = !found.thick.is_empty() && lacks.max_element() > side;
            is_small || (!found.bounds.is_empty() && exceeds.max_element() > side)
        };
        if is_off {
            let b = if cell.outdoor { bounds } else { found.bounds };
            out.push(format!(
                "{name}: the stored box is {min:.4} to {max:.4}, that of the locator {:.4} to {:.4}",
                b.min, b.max
            ));
        }
    }
}
