//! Joins cells that belong together: a shallow void and the room below it, although no opening connects
//! them, and voids that open to each other.

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, Locator};
use enfilade_geom::Sets;

use crate::complex::{Label, Partition};
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
    let label = |c: u32| partition.label_of_cell[c as usize];
    let mut sets = Sets::new(n);
    let mut opens_elsewhere = vec![false; n];
    for p in &partition.portals {
        let labels = p.cells.map(label);
        let [a, b] = labels.map(Label::region);
        if a != b && !labels.contains(&Label::Beyond) {
            p.cells
                .iter()
                .for_each(|&c| opens_elsewhere[c as usize] = true);
        }
    }
    for c in 0..n as u32 {
        let label = label(c);
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
