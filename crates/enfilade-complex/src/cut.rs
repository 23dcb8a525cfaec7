//! Moves borders to where they are smallest.
//!
//! Growing leaves together along their widest openings finds *a* border between two cells that leak into each other,
//! but it consists of whatever planes the tree has there: over a flight of stairs that can be a hundred small
//! portals. Here each such border is moved to the minimum of
//!
//! > open area on no candidate + [`PER_FACET`] for each piece + [`VOTE`] × volume of votes overruled
//!
//! by a minimum cut among the leaves around the border (Boykov, Veksler & Zabih 2001 move labels in the same way).
//! Candidates cost next to nothing, so a border moves into its candidate if it can.
//!
//! Time: `O(V²E)` at worst and near-linear in practice for each pair of cells that leak; at most [`MAX_LEAVES`]
//! leaves take part.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use enfilade_geom::Sets;
use rayon::prelude::*;

use super::Label;
use super::flow::Flow;
use super::graph::{LeafGraph, NO_CANDIDATE, OpenFacet};
use super::leaf_cells::{LeafCells, SOLID, Tally};

/// Cost of a piece of a border besides its area. [Units: wu²]
const PER_FACET: f64 = 0.002;
/// Cost of overruling votes. [Units: 1/wu]
const VOTE: f64 = 0.5;
/// Borders that leak less than this stay as they are. [Units: wu²]
const MIN_LEAK: f64 = 0.01;
/// Most leaves that take part in one cut.
const MAX_LEAVES: usize = 20_000;
/// Unit of capacities. [Units: wu²]
const UNIT: f64 = 1e-7;
const INFINITE: u64 = 1 << 60;

/// Moves the borders between cells that leak into each other.
pub(super) fn move_borders(graph: &LeafGraph<'_>, cells: &mut LeafCells, tally: &Tally) {
    if !graph.spend_pass() {
        return;
    }
    let mut leaks: BTreeMap<[u32; 2], (f64, Vec<u32>)> = BTreeMap::new();
    for (i, f) in graph.facets.iter().enumerate() {
        let [a, b] = f.leaves.map(|l| cells.cell_of_leaf[l as usize]);
        if f.candidate == NO_CANDIDATE && !f.is_narrow && a != b && a != SOLID && b != SOLID {
            let (area, facets) = leaks.entry([a.min(b), a.max(b)]).or_default();
            *area += f64::from(f.area);
            facets.push(i as u32);
        }
    }
    leaks.retain(|_, (area, facets)| *area >= MIN_LEAK && facets.len() > 1);
    if leaks.is_empty() {
        return;
    }
    let adjacency = Adjacency::of_leaking_cells(graph, &cells.cell_of_leaf, &leaks);
    let n_leaves = graph.volumes.len();
    let node_of: Vec<AtomicU32> = (0..n_leaves).map(|_| AtomicU32::new(NO_NODE)).collect();
    let votes = LeafVotes::of(tally, n_leaves);
    for round in rounds(leaks.keys().copied(), cells.label_of_cell.len()) {
        // Earlier moves may have changed the leaf's cell.
        let moves: Vec<(u32, u32)> = round
            .into_par_iter()
            .flat_map_iter(|pair| {
                let labels = pair.map(|c| cells.label_of_cell[c as usize]);
                let votes = |leaf| labels.map(|label| votes.weight(leaf, label));
                let leaves = &cells.cell_of_leaf;
                let border = (pair, &leaks[&pair].1[..]);
                cut(
                    graph, leaves, &adjacency, &node_of, border.0, border.1, &votes,
                )
            })
            .collect();
        for (leaf, to) in moves {
            cells.cell_of_leaf[leaf as usize] = to;
        }
    }
    cells.drop_empty(&graph.volumes);
}

/// Divides pairs of cells into rounds: no cell is twice in a round, and pairs with a common cell keep their order. So
/// the pairs of a round, in any order, come out as if all had their turn one by one.
fn rounds(pairs: impl Iterator<Item = [u32; 2]>, n_cells: usize) -> Vec<Vec<[u32; 2]>> {
    let mut rounds: Vec<Vec<[u32; 2]>> = Vec::new();
    let mut next = vec![0; n_cells];
    for pair in pairs {
        let [a, b] = pair.map(|c| c as usize);
        let round = next[a].max(next[b]);
        [next[a], next[b]] = [round + 1; 2];
        rounds.resize_with(rounds.len().max(round + 1), Vec::new);
        rounds[round].push(pair);
    }
    rounds
}

/// The votes of each leaf.
struct LeafVotes {
    start: Vec<u32>,
    votes: Vec<(Label, f64)>,
}

impl LeafVotes {
    fn of(tally: &Tally, n_leaves: usize) -> Self {
        let mut start = vec![0_u32; n_leaves + 1];
        for (leaf, _) in tally.keys() {
            start[*leaf as usize + 1] += 1;
        }
        for i in 1..start.len() {
            start[i] += start[i - 1];
        }
        let votes = tally.iter().map(|(&(_, label), &w)| (label, w)).collect();
        Self { start, votes }
    }

    fn weight(&self, leaf: u32, label: Label) -> f64 {
        let [from, to] = [0, 1].map(|k| self.start[leaf as usize + k] as usize);
        let mut votes = self.votes[from..to].iter();
        votes.find(|v| v.0 == label).map_or(0.0, |v| v.1)
    }
}

/// Gives chips of a cell, which are disconnected from the rest of it and smaller than `min_volume`, to the cell that
/// they open to most. [Units: wu³]
///
/// A moved border can cut a chip off, and a chip has portals all around. O(leaves + facets).
pub(super) fn absorb_chips(graph: &LeafGraph<'_>, cells: &mut LeafCells, min_volume: f64) {
    if !graph.spend_pass() {
        return;
    }
    let n = cells.cell_of_leaf.len();
    let mut sets = Sets::new(n);
    for f in &graph.facets {
        let [a, b] = f.leaves;
        let cell = cells.cell_of_leaf[a as usize];
        if cell != SOLID && cell == cells.cell_of_leaf[b as usize] {
            sets.join(a, b);
        }
    }
    let mut volume = vec![0.0; n];
    for leaf in 0..n as u32 {
        volume[sets.find(leaf) as usize] += graph.volumes[leaf as usize];
    }
    let mut largest: BTreeMap<u32, (f64, u32)> = BTreeMap::new();
    for leaf in (0..n as u32).filter(|&l| cells.cell_of_leaf[l as usize] != SOLID) {
        let root = sets.find(leaf);
        let part = (volume[root as usize], root);
        let best = largest
            .entry(cells.cell_of_leaf[leaf as usize])
            .or_insert(part);
        // For equal volumes, the least leaf.
        if part.0 > best.0 || part.0 == best.0 && root < best.1 {
            *best = part;
        }
    }
    let mut opens_to: BTreeMap<u32, BTreeMap<u32, f64>> = BTreeMap::new();
    for f in &graph.facets {
        let [a, b] = f.leaves;
        for (chip, other) in [(a, b), (b, a)] {
            let [cell, to] = [chip, other].map(|l| cells.cell_of_leaf[l as usize]);
            let root = sets.find(chip);
            if cell != to
                && cell != SOLID
                && to != SOLID
                && largest[&cell].1 != root
                && volume[root as usize] < min_volume
            {
                *opens_to.entry(root).or_default().entry(to).or_default() += f.cost();
            }
        }
    }
    if opens_to.is_empty() {
        return;
    }
    let to: BTreeMap<u32, u32> = opens_to
        .into_iter()
        .filter_map(|(root, areas)| {
            let most = areas
                .into_iter()
                .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))?;
            Some((root, most.0))
        })
        .collect();
    for leaf in 0..n as u32 {
        if let Some(&cell) = to.get(&sets.find(leaf)) {
            cells.cell_of_leaf[leaf as usize] = cell;
        }
    }
    cells.drop_empty(&graph.volumes);
}

/// Smaller cells are left by rounding between surfaces that all but touch: not rooms, however small, and too thin for
/// a portal. [Units: wu³]
const SLIVER: f64 = 1e-4;

/// Gives the leaves of slivers to the cells that they open to most; slivers without openings become solid.
///
/// O(leaves + facets), except for chains of slivers.
pub(super) fn dissolve_slivers(graph: &LeafGraph<'_>, cells: &mut LeafCells) {
    let is_sliver: Vec<bool> = (0..)
        .zip(&cells.volumes)
        .map(|(c, &volume)| volume < SLIVER && cells.outside != Some(c))
        .collect();
    if !is_sliver.contains(&true) {
        return;
    }
    let is_in = |c: u32| c != SOLID && is_sliver[c as usize];
    let mut around: BTreeMap<u32, Vec<(u32, f64)>> = BTreeMap::new();
    for f in &graph.facets {
        let [a, b] = f.leaves;
        for (leaf, other) in [(a, b), (b, a)] {
            if is_in(cells.cell_of_leaf[leaf as usize]) {
                let facets = around.entry(leaf).or_default();
                facets.push((other, f64::from(f.area)));
            }
        }
    }
    loop {
        let n = around.len();
        if !graph.purse.spend(n as u64) {
            return;
        }
        around.retain(|&leaf, facets| {
            let mut areas: BTreeMap<u32, f64> = BTreeMap::new();
            for &(other, area) in facets.iter() {
                let c = cells.cell_of_leaf[other as usize];
                if c != SOLID && !is_in(c) {
                    *areas.entry(c).or_default() += area;
                }
            }
            let most = areas
                .into_iter()
                .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
            if let Some((to, _)) = most {
                cells.cell_of_leaf[leaf as usize] = to;
            }
            most.is_none()
        });
        if around.len() == n {
            break;
        }
    }
    for c in &mut cells.cell_of_leaf {
        if is_in(*c) {
            *c = SOLID;
        }
    }
    cells.drop_empty(&graph.volumes);
}

/// An opening from one leaf to another.
#[derive(Clone, Copy, Default)]
struct Way {
    to: u32,
    /// Cost of a border there, see [`UNIT`].
    cost: u64,
}

impl Way {
    /// Returns the ways through an opening, each with the leaf where it begins.
    fn both(f: &OpenFacet) -> [(u32, Self); 2] {
        // A gap makes no portal, so a border of many gaps is better than one that makes a portal.
        let shows = f.candidate == NO_CANDIDATE && !f.is_gap;
        let each = if shows { PER_FACET } else { 0.0 };
        let (cost, [a, b]) = (units(f.cost() + each), f.leaves);
        [(a, Self { to: b, cost }), (b, Self { to: a, cost })]
    }
}

fn units(cost: f64) -> u64 {
    (cost / UNIT).round() as u64
}

/// The ways from each leaf, for leaves of cells that leak.
struct Adjacency {
    start: Vec<u32>,
    ways: Vec<Way>,
}

impl Adjacency {
    fn of_leaking_cells(
        graph: &LeafGraph<'_>,
        cell_of_leaf: &[u32],
        leaks: &BTreeMap<[u32; 2], (f64, Vec<u32>)>,
    ) -> Self {
        let n_cells = cell_of_leaf.iter().filter(|&&c| c != SOLID).max();
        let mut takes_part = vec![false; n_cells.map_or(0, |&c| c as usize + 1)];
        for c in leaks.keys().flatten() {
            takes_part[*c as usize] = true;
        }
        let is_in = |leaf: u32| {
            let c = cell_of_leaf[leaf as usize];
            c != SOLID && takes_part[c as usize]
        };
        let mut start = vec![0_u32; cell_of_leaf.len() + 1];
        for f in &graph.facets {
            for l in f.leaves.into_iter().filter(|&l| is_in(l)) {
                start[l as usize + 1] += 1;
            }
        }
        for i in 1..start.len() {
            start[i] += start[i - 1];
        }
        let mut at = start.clone();
        let mut ways = vec![Way::default(); start.last().map_or(0, |&n| n as usize)];
        for f in &graph.facets {
            for (l, way) in Way::both(f).into_iter().filter(|&(l, _)| is_in(l)) {
                ways[at[l as usize] as usize] = way;
                at[l as usize] += 1;
            }
        }
        Self { start, ways }
    }

    fn of_leaf(&self, leaf: u32) -> &[Way] {
        let [from, to] = [0, 1].map(|k| self.start[leaf as usize + k] as usize);
        &self.ways[from..to]
    }
}

/// Node of a leaf that takes no part in a cut.
const NO_NODE: u32 = u32::MAX;

/// Returns the leaves that change sides, each with its new cell. `node_of` is [`NO_NODE`] for every leaf, before and
/// after; only entries of the two cells change. `votes` returns the weights of a leaf's votes for them.
fn cut(
    graph: &LeafGraph<'_>,
    cell_of_leaf: &[u32],
    adjacency: &Adjacency,
    node_of: &[AtomicU32],
    pair: [u32; 2],
    border: &[u32],
    votes: &impl Fn(u32) -> [f64; 2],
) -> Vec<(u32, u32)> {
    let node = |leaf: u32| node_of[leaf as usize].load(Relaxed);
    let set_node = |leaf: u32, node: u32| node_of[leaf as usize].store(node, Relaxed);
    let cell = |leaf: u32| cell_of_leaf[leaf as usize];
    let is_ours = |leaf: u32| pair.contains(&cell(leaf));
    // The leaves around the border, nearest first.
    let mut leaves: Vec<u32> = Vec::new();
    let take = |leaf: u32, leaves: &mut Vec<u32>| {
        if is_ours(leaf) && leaves.len() < MAX_LEAVES && node(leaf) == NO_NODE {
            set_node(leaf, leaves.len() as u32);
            leaves.push(leaf);
        }
    };
    for &f in border {
        for l in graph.facets[f as usize].leaves {
            take(l, &mut leaves);
        }
    }
    let mut at = 0;
    while at < leaves.len() {
        for way in adjacency.of_leaf(leaves[at]) {
            take(way.to, &mut leaves);
        }
        at += 1;
    }
    if !graph.purse.spend(5 * leaves.len() as u64) {
        leaves.iter().for_each(|&leaf| set_node(leaf, NO_NODE));
        return Vec::new();
    }
    let n = leaves.len();
    let mut flow = Flow::new(n);
    let mut before = 0;
    for (i, &leaf) in leaves.iter().enumerate() {
        let [mut to_a, mut to_b] = votes(leaf).map(|weight| units(VOTE * weight));
        let mut add = |c: u32, cost: u64| {
            if c == pair[0] {
                to_a = to_a.saturating_add(cost).min(INFINITE);
            } else {
                to_b = to_b.saturating_add(cost).min(INFINITE);
            }
        };
        for &Way { to: other, cost } in adjacency.of_leaf(leaf) {
            let is_other_ours = is_ours(other);
            // The nodes of third cells may be those of another cut.
            match if is_other_ours { node(other) } else { NO_NODE } {
                // A leaf outside the cut keeps its side.
                NO_NODE if is_other_ours => add(cell(other), cost),
                // A border to a third cell stays a border either way.
                NO_NODE => {}
                j if (j as usize) > i => {
                    flow.add(i, j as usize, cost, cost);
                    if cell(leaf) != cell(other) {
                        before += cost;
                    }
                }
                _ => {}
            }
        }
        before += if cell(leaf) == pair[0] { to_b } else { to_a };
        flow.tie(i, to_a, to_b);
    }
    leaves.iter().for_each(|&leaf| set_node(leaf, NO_NODE));
    let (after, is_a) = flow.cut(graph.purse);
    if after >= before {
        return Vec::new();
    }
    let moved: Vec<(u32, u32)> = leaves
        .iter()
        .enumerate()
        .map(|(i, &leaf)| (leaf, if is_a[i] { pair[0] } else { pair[1] }))
        .filter(|&(leaf, to)| cell(leaf) != to)
        .collect();
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Known;
    use enfilade_geom::Purse;

    #[test]
    fn pairs_of_a_round_share_no_cell_and_others_keep_their_order() {
        let pairs = [[0, 1], [0, 2], [1, 2], [3, 4], [2, 4]];
        let found = rounds(pairs.into_iter(), 5);
        let expected = [
            vec![[0, 1], [3, 4]],
            vec![[0, 2]],
            vec![[1, 2]],
            vec![[2, 4]],
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn slivers_go_where_they_open_to_most_and_closed_ones_are_solid() {
        // Rooms 0 and 2; cell 1 consists of three slivers: one beside both rooms, one behind that, and a closed one.
        let facet = |a, b, area| OpenFacet {
            leaves: [a, b],
            width: area,
            area,
            candidate: NO_CANDIDATE,
            is_narrow: false,
            is_gap: false,
            is_clear: true,
        };
        let mut graph = LeafGraph {
            facets: vec![facet(0, 1, 0.1), facet(1, 2, 0.2), facet(4, 1, 0.05)],
            volumes: vec![5.0, 1e-6, 5.0, 1e-6, 1e-6],
            boxes: Vec::new(),
            at_border: vec![false; 5],
            faces: vec![1.0; 5],
            hole: 0.01,
            rounding: 1e-5,
            purse: Purse::endless(),
            known: Known::default(),
        };
        let cells = || LeafCells {
            cell_of_leaf: vec![0, 1, 2, 1, 1],
            label_of_cell: [7, 8, 9].map(Label::Region).to_vec(),
            volumes: vec![5.0, 3e-6, 5.0],
            outside: Some(2),
        };
        let mut found = cells();
        dissolve_slivers(&graph, &mut found);
        assert_eq!(found.cell_of_leaf, [0, 1, 1, SOLID, 1]);
        assert_eq!(found.label_of_cell, [7, 9].map(Label::Region));
        assert_eq!(found.volumes, [5.0, 5.0 + 2e-6]);
        assert_eq!(found.outside, Some(1));
        // A closet of a liter is a cell.
        graph.volumes[1] = 1e-3;
        let mut found = cells();
        found.volumes[1] = 1e-3 + 2e-6;
        dissolve_slivers(&graph, &mut found);
        assert_eq!(found.cell_of_leaf, cells().cell_of_leaf);
    }
}
