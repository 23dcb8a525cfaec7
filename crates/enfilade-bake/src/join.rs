//! Joins cells that belong together: a shallow void and the room below it, although no opening connects
//! them, and regions that no plane separates.

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, Locator};
use enfilade_geom::{DVec3, Sets};

use crate::complex::{Complex, LeafCells, OpenContact, Partition, Vote};
use crate::structure::OUTDOORS;

/// Bit that marks the label of a void; the other bits are the region that the void belongs to.
pub(crate) const VOID: u32 = 1 << 31;

/// Merges each cell that opens to no other region into the largest cell of its region, and renumbers the cells: shallow
/// voids, the insides of stairs.
pub(crate) fn join_enclosed(partition: &mut Partition) {
    let n = partition.label_of_cell.len();
    let mut home_of_label: BTreeMap<u32, u32> = BTreeMap::new();
    for (c, &label) in partition.label_of_cell.iter().enumerate() {
        let best = home_of_label.entry(label).or_insert(c as u32);
        if partition.volumes[c] > partition.volumes[*best as usize] {
            *best = c as u32;
        }
    }
    let region = |c: u32| partition.label_of_cell[c as usize] & !VOID;
    let mut opens_elsewhere = vec![false; n];
    for p in &partition.portals {
        if region(p.cells[0]) != region(p.cells[1]) {
            p.cells
                .iter()
                .for_each(|&c| opens_elsewhere[c as usize] = true);
        }
    }
    let home = |c: usize| {
        let label = partition.label_of_cell[c];
        if opens_elsewhere[c] || [OUTDOORS, u32::MAX].contains(&label) {
            return None;
        }
        let of_region = home_of_label.get(&(label & !VOID));
        of_region.copied().filter(|&h| h != c as u32)
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
    for s in &mut partition.seals {
        s.cells = s
            .cells
            .map(|c| number.get(c as usize).copied().unwrap_or(c));
    }
    for l in &mut partition.leaks {
        l.cells = l.cells.map(|c| number[c as usize]);
    }
    let parts = |cells: [u32; 2]| cells[0] != cells[1];
    partition.portals.retain(|p| parts(p.cells));
    partition.hairlines.retain(|p| parts(p.cells));
    partition.leaks.retain(|l| parts(l.cells));
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

/// Regions that touch outside their candidates over more than this area, and over more than the
/// candidates cover, have no opening between them. [Units: wu²]
const MAX_LEAK: f64 = 1.0;

/// Gives regions that no plane separates one label, in the votes and the voids. Returns `true` if there were any.
///
/// A portal is planar. Where two regions meet in the open, outside their candidates (over a flight of
/// stairs, say), the border between them would follow arbitrary planes of the cell complex: dozens of
/// meaningless portals. Such regions are one room.
pub(crate) fn join_unparted(
    complex: &Complex<'_>,
    cells: &LeafCells,
    votes: &mut [Vote],
    voids: &mut [(DVec3, u32)],
) -> bool {
    let mut between: BTreeMap<[u32; 2], OpenContact> = BTreeMap::new();
    for (pair, contact) in complex.contacts(cells) {
        let [a, b] = pair.map(|c| cells.label_of_cell[c as usize]);
        if a != b && ![a, b].contains(&u32::MAX) {
            let sum = between.entry([a.min(b), a.max(b)]).or_default();
            sum.on_candidates += contact.on_candidates;
            sum.beside += contact.beside;
        }
    }
    // The least label stands for all of a set.
    let mut labels: Vec<u32> = between.keys().flatten().copied().collect();
    labels.sort_unstable();
    labels.dedup();
    let mut sets = Sets::new(labels.len());
    for (pair, contact) in between {
        // A model full of holes must not lose its rooms to the outdoors.
        let is_unparted = contact.beside > MAX_LEAK && contact.beside > contact.on_candidates;
        if pair[0] != OUTDOORS && is_unparted {
            let [a, b] = pair.map(|l| labels.partition_point(|&m| m < l) as u32);
            sets.join(a, b);
        }
    }
    let stands_for = sets.into_least();
    let relabel = |label: &mut u32| {
        if let Ok(i) = labels.binary_search(label) {
            *label = labels[stands_for[i] as usize];
        }
    };
    votes.iter_mut().for_each(|v| relabel(&mut v.label));
    voids.iter_mut().for_each(|(_, region)| relabel(region));
    (0..).zip(&stands_for).any(|(i, &least)| i != least)
}
