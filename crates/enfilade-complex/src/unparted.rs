//! Cells that are one, as no plane separates their labels.
//!
//! A portal is planar. Where two labels meet in the open, outside their candidates (over a flight of stairs, say), the border
//! between them would follow arbitrary planes of the complex: dozens of meaningless portals.

use std::collections::BTreeMap;

use enfilade_geom::Sets;

use super::Label;
use super::graph::{LeafGraph, NO_CANDIDATE};
use super::leaf_cells::{LeafCells, SOLID};

/// Labels that meet beside their candidates over more than this area, and over more than on them, are one. [Units: wu²]
const MAX_LEAK: f64 = 1.0;

/// Joins cells whose labels no plane separates, and the labels of all other cells and voids with them. The labels of regions that
/// `may_join` rejects stay.
pub(super) fn join_unparted(
    graph: &LeafGraph<'_>,
    cells: &mut LeafCells,
    may_join: &(dyn Fn(u32) -> bool + Sync),
) {
    let same = unparted(graph, cells, may_join);
    if same.is_empty() {
        return;
    }
    let joined = |label: Label| same.get(&label).copied().unwrap_or(label);
    for label in &mut cells.label_of_cell {
        *label = match *label {
            Label::Void(region) => {
                let of = joined(Label::Region(region)).region();
                Label::Void(of.unwrap_or(region))
            }
            other => joined(other),
        };
    }
    let mut sets = Sets::new(cells.label_of_cell.len());
    for f in &graph.facets {
        let [a, b] = f.leaves.map(|l| cells.cell_of_leaf[l as usize]);
        let label = |c: u32| cells.label_of_cell.get(c as usize);
        if a != b && label(a).is_some() && label(a) == label(b) {
            sets.join(a, b);
        }
    }
    let least = sets.into_least();
    let home = |c: u32| least.get(c as usize).copied().unwrap_or(SOLID);
    cells.cell_of_leaf.iter_mut().for_each(|c| *c = home(*c));
    cells.outside = cells.outside.map(home);
    cells.drop_empty(&graph.volumes);
}

/// Returns the label that stands for each of those that no plane separates from another, the least of them.
fn unparted(
    graph: &LeafGraph<'_>,
    cells: &LeafCells,
    may_join: &(dyn Fn(u32) -> bool + Sync),
) -> BTreeMap<Label, Label> {
    graph.spend_pass();
    let label = |leaf: u32| {
        let cell = cells.cell_of_leaf[leaf as usize] as usize;
        match cells.label_of_cell.get(cell)? {
            label @ Label::Region(region) if may_join(*region) => Some(*label),
            _ => None,
        }
    };
    // Area beside candidates, and on them, between two labels.
    let mut between: BTreeMap<[Label; 2], [f64; 2]> = BTreeMap::new();
    for f in graph.facets.iter().filter(|f| !f.is_narrow) {
        if let [Some(a), Some(b)] = f.leaves.map(label)
            && a != b
        {
            let areas = between.entry([a.min(b), a.max(b)]).or_default();
            areas[usize::from(f.candidate != NO_CANDIDATE)] += f64::from(f.area);
        }
    }
    let mut same = BTreeMap::new();
    // Two labels may be parted, and not any more once one of them is joined to a third.
    while let Some(([a, b], _)) = between
        .iter()
        .find(|(_, [beside, on])| *beside > MAX_LEAK && beside > on)
    {
        let (a, b) = (*a, *b);
        same.values_mut().filter(|l| **l == b).for_each(|l| *l = a);
        same.insert(b, a);
        let renamed = |label: Label| if label == b { a } else { label };
        let old = std::mem::take(&mut between).into_iter();
        for (pair, areas) in old {
            let [p, q] = pair.map(renamed);
            if p != q {
                let sum = between.entry([p.min(q), p.max(q)]).or_default();
                *sum = [sum[0] + areas[0], sum[1] + areas[1]];
            }
        }
    }
    same
}
