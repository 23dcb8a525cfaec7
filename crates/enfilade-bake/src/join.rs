//! Joins cells of a partition that belong together although no opening joins them: a shallow void
//! becomes part of the room below it.

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, Locator};

use crate::complex::Partition;

/// Marks the label of a void; the rest of the label is the region that the void belongs to.
pub(crate) const VOID: u32 = 1 << 31;

/// Gives every cell that goes by a void's label to the largest cell of its region, and numbers the
/// cells anew. Voids that have grown into something with portals stay as they are.
pub(crate) fn join_voids(partition: &mut Partition) {
    let n = partition.label_of_cell.len();
    let mut home_of_label: BTreeMap<u32, u32> = BTreeMap::new();
    for (c, &label) in partition.label_of_cell.iter().enumerate() {
        let best = home_of_label.entry(label).or_insert(c as u32);
        if partition.volumes[c] > partition.volumes[*best as usize] {
            *best = c as u32;
        }
    }
    let mut has_portal = vec![false; n];
    for p in &partition.portals {
        p.cells.iter().for_each(|&c| has_portal[c as usize] = true);
    }
    let home = |c: usize| {
        let label = partition.label_of_cell[c];
        let is_void = label & VOID != 0 && label != u32::MAX && !has_portal[c];
        is_void
            .then(|| home_of_label.get(&(label & !VOID)).copied())
            .flatten()
    };
    let homes: Vec<Option<u32>> = (0..n).map(home).collect();
    if homes.iter().all(Option::is_none) {
        return;
    }
    let mut number = vec![0_u32; n];
    let mut kept = Vec::new();
    for c in 0..n {
        if homes[c].is_none() {
            number[c] = kept.len() as u32;
            kept.push(c);
        }
    }
    for c in 0..n {
        if let Some(h) = homes[c] {
            number[c] = number[h as usize];
            partition.volumes[h as usize] += partition.volumes[c];
            partition.aabbs[h as usize] = partition.aabbs[h as usize].union(partition.aabbs[c]);
        }
    }
    partition.label_of_cell = kept.iter().map(|&c| partition.label_of_cell[c]).collect();
    partition.volumes = kept.iter().map(|&c| partition.volumes[c]).collect();
    partition.aabbs = kept.iter().map(|&c| partition.aabbs[c]).collect();
    partition.outside = partition.outside.map(|c| number[c as usize]);
    for p in partition.portals.iter_mut().chain(&mut partition.hairlines) {
        p.cells = p.cells.map(|c| number[c as usize]);
    }
    for l in &mut partition.leaks {
        l.cells = l.cells.map(|c| number[c as usize]);
    }
    partition.triangle_cells = partition.triangle_cells.renumbered(&number);
    renumber_locator(&mut partition.locator, &number);
}

fn renumbered(child: i32, number: &[u32]) -> i32 {
    match child {
        c if c <= -2 => Locator::leaf(Some(CellId(number[(-2 - c) as usize]))),
        c => c,
    }
}

fn renumber_locator(locator: &mut Locator, number: &[u32]) {
    locator.root = renumbered(locator.root, number);
    locator.outside = locator.outside.map(|c| CellId(number[c.0 as usize]));
    for node in &mut locator.nodes {
        node.children = node.children.map(|c| renumbered(c, number));
    }
}
