//! Joins cells that belong together: a shallow void and the room below it, although no opening connects
//! them, voids that open to each other, and regions that no plane separates.

use std::collections::BTreeMap;
use std::ops::Range;

use enfilade_cpg::{CellId, Locator};
use enfilade_geom::{DVec3, Sets};

use crate::complex::{Complex, Label, LeafCells, OpenContact, Partition, Vote};
use crate::proposal::BEYOND;
use crate::structure::OUTDOORS;

/// Merges each cell that opens to no other region with the largest cell of its region: shallow voids, the insides of
/// stairs.
pub(crate) fn join_enclosed(partition: &mut Partition) {
    let n = partition.label_of_cell.len();
    let mut home_of_label: BTreeMap<Label, u32> = BTreeMap::new();
    for (c, &label) in partition.label_of_cell.iter().enumerate() {
        let best = home_of_label.entry(label).or_insert(c as u32);
        if partition.volumes[c] > partition.volumes[*best as usize] {
            *best = c as u32;
        }
    }
    let region = |c: u32| partition.label_of_cell[c as usize].region();
    let mut sets = Sets::new(n);
    let mut opens_elsewhere = vec![false; n];
    for p in &partition.portals {
        let regions = p.cells.map(region);
        if regions[0] != regions[1] && !regions.contains(&Some(BEYOND)) {
            p.cells
                .iter()
                .for_each(|&c| opens_elsewhere[c as usize] = true);
        }
    }
    for c in 0..n as u32 {
        let label = partition.label_of_cell[c as usize];
        if !opens_elsewhere[c as usize]
            && label != Label::Region(OUTDOORS)
            && let Some(region) = label.region()
            && let Some(&home) = home_of_label.get(&Label::Region(region))
        {
            sets.join(home, c);
        }
    }
    join(partition, sets);
}

/// Merges voids that open to each other: beams, ribs and ducts divide what is one space to whoever crawls there. Returns the old
/// numbers of the cells that are left.
pub(crate) fn join_voids(partition: &mut Partition) -> Vec<usize> {
    let mut sets = Sets::new(partition.label_of_cell.len());
    let is_void = |c: &u32| matches!(partition.label_of_cell[*c as usize], Label::Void(_));
    for p in partition
        .portals
        .iter()
        .filter(|p| p.cells.iter().all(is_void))
    {
        sets.join(p.cells[0], p.cells[1]);
    }
    join(partition, sets)
}

/// Merges the cells of each set, and renumbers the rest. Returns the old numbers of the cells that are left.
fn join(partition: &mut Partition, sets: Sets) -> Vec<usize> {
    let n = partition.label_of_cell.len();
    let least = sets.into_least();
    // The largest cell of each set stands for all of it.
    let mut stands_for: BTreeMap<u32, u32> = BTreeMap::new();
    for (c, &set) in (0..).zip(&least) {
        let best = stands_for.entry(set).or_insert(c);
        if partition.volumes[c as usize] > partition.volumes[*best as usize] {
            *best = c;
        }
    }
    if stands_for.len() == n {
        return (0..n).collect();
    }
    let home = |c: usize| stands_for[&least[c]];
    let kept: Vec<usize> = (0..n).filter(|&c| home(c) == c as u32).collect();
    let mut number = vec![0_u32; n];
    for (i, &c) in kept.iter().enumerate() {
        number[c] = i as u32;
    }
    for c in 0..n {
        let h = home(c) as usize;
        if h != c {
            number[c] = number[h];
            partition.volumes[h] += partition.volumes[c];
            partition.aabbs[h] = partition.aabbs[h].union(partition.aabbs[c]);
        }
    }
    renumber(partition, &number, &kept);
    kept
}

/// Gives each cell its new `number`; `kept` are the cells that stay, in order. Portals within a cell vanish.
fn renumber(partition: &mut Partition, number: &[u32], kept: &[usize]) {
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
    partition.triangle_cells = partition.triangle_cells.renumbered(number);
    renumber_locator(&mut partition.locator, number);
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
/// meaningless portals. Such regions are one room. The outdoors and the `land` in it are never joined so.
pub(crate) fn join_unparted(
    complex: &Complex<'_>,
    cells: &LeafCells,
    votes: &mut [Vote],
    voids: &mut [(DVec3, u32)],
    land: &Range<u32>,
) -> bool {
    let mut between: BTreeMap<[u32; 2], OpenContact> = BTreeMap::new();
    for (pair, contact) in complex.contacts(cells) {
        let [a, b] = pair.map(|c| cells.label_of_cell[c as usize].region());
        if let (Some(a), Some(b)) = (a, b)
            && a != b
        {
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
        let is_open = |region: &u32| *region == OUTDOORS || land.contains(region);
        if !pair.iter().any(is_open) && is_unparted {
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
    for vote in votes {
        if let Label::Region(region) = &mut vote.label {
            relabel(region);
        }
    }
    voids.iter_mut().for_each(|(_, region)| relabel(region));
    (0..).zip(&stands_for).any(|(i, &least)| i != least)
}
