//! Which cells to merge: smallest cell first, its worst portal removed (Lefebvre & Hornus 2003, §3).
//!
//! Knows cells only as sets of weighted items, so that what two cells both see is not paid twice, and
//! pairs of cells only by what the metric says of them.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// A graph as the simplifier sees it.
#[derive(Clone, Debug, Default)]
pub(super) struct CostGraph {
    /// What drawing each item costs; not negative.
    pub(super) weights: Vec<f64>,
    /// The items of each cell, ascending.
    pub(super) items: Vec<Vec<u32>>,
    /// Cells that have a portal between them.
    pub(super) pairs: Vec<[u32; 2]>,
    /// Cells that merge with others only if nothing else is left to them: the outdoors.
    pub(super) aloof: Vec<bool>,
}

/// What is asked of the result.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// Of [`CostGraph::shares`]; the upper one is of all items.
    pub(super) min_cost: f64,
    pub(super) max_cost: f64,
    pub(super) max_cells: usize,
    pub(super) max_portals: usize,
}

/// How good the portals between two cells are. Higher is worse: removed first.
pub(super) trait Badness {
    /// Of the portals between two cells, named by cells that live.
    fn of(&mut self, graph: &CostGraph, a: u32, b: u32) -> f64;
    /// `gone` is now part of `kept`.
    fn merged(&mut self, kept: u32, gone: u32);
}

impl CostGraph {
    pub(super) fn cost(&self, cell: u32) -> f64 {
        self.sum(self.items[cell as usize].iter().copied())
    }

    /// What each cell has of the whole: an item that reaches through several cells counts in each in part,
    /// as in the paper, where polygons are cut to pieces that lie in one cell each.
    ///
    /// What all cells of a room see alike is hidden by none of their portals, and is no reason to keep
    /// them.
    pub(super) fn shares(&self) -> Vec<f64> {
        let mut n_cells = vec![0_u32; self.weights.len()];
        for &i in self.items.iter().flatten() {
            n_cells[i as usize] += 1;
        }
        let share = |&i: &u32| self.weights[i as usize] / f64::from(n_cells[i as usize]);
        // The sum of nothing is -0, whose bits compare as the greatest; adding 0 makes it 0.
        (self.items.iter())
            .map(|items| items.iter().map(share).sum::<f64>() + 0.0)
            .collect()
    }

    pub(super) fn cost_of_both(&self, a: u32, b: u32) -> f64 {
        self.sum(union(&self.items[a as usize], &self.items[b as usize]))
    }

    /// The items of both cells, ascending.
    pub(super) fn union(&self, a: u32, b: u32) -> Vec<u32> {
        union(&self.items[a as usize], &self.items[b as usize]).collect()
    }

    /// The same graph with cells as parts of others; those that are gone have no items.
    pub(super) fn contracted(&self, into: &[u32]) -> Self {
        let mut items = vec![Vec::new(); self.items.len()];
        let mut aloof = vec![false; self.items.len()];
        for (c, &host) in into.iter().enumerate() {
            items[host as usize].extend_from_slice(&self.items[c]);
            aloof[host as usize] |= self.aloof[c];
        }
        for list in &mut items {
            list.sort_unstable();
            list.dedup();
        }
        Self {
            weights: self.weights.clone(),
            items,
            pairs: (self.pairs.iter())
                .map(|pair| pair.map(|c| into[c as usize]))
                .collect(),
            aloof,
        }
    }

    fn sum(&self, items: impl Iterator<Item = u32>) -> f64 {
        items.map(|i| self.weights[i as usize]).sum()
    }
}

/// Both lists, ascending, none twice.
fn union<'a>(a: &'a [u32], b: &'a [u32]) -> impl Iterator<Item = u32> + 'a {
    let (mut i, mut j) = (0, 0);
    std::iter::from_fn(move || {
        let (x, y) = (a.get(i).copied(), b.get(j).copied());
        let next = match (x, y) {
            (None, None) => return None,
            (Some(x), Some(y)) => x.min(y),
            (x, y) => x.or(y)?,
        };
        i += usize::from(x == Some(next));
        j += usize::from(y == Some(next));
        Some(next)
    })
}

/// The cell that each cell becomes part of: itself, or a lesser one of its group.
///
/// No merged cell costs more than `max_cost` (one that did so alone stays alone). Every merge lowers
/// the number of cells, so it ends; time `O(m log n)` merges times the items and neighbors of a cell.
pub(super) fn merge(mut graph: CostGraph, bounds: &Bounds, badness: &mut dyn Badness) -> Vec<u32> {
    let n = graph.items.len();
    let mut into: Vec<u32> = (0..n as u32).collect();
    // How many portals lead from one cell to another.
    let mut neighbors: Vec<BTreeMap<u32, usize>> = vec![BTreeMap::new(); n];
    let mut n_portals = 0;
    for &[a, b] in &graph.pairs {
        if a != b {
            *neighbors[a as usize].entry(b).or_default() += 1;
            *neighbors[b as usize].entry(a).or_default() += 1;
            n_portals += 1;
        }
    }
    let mut shares = graph.shares();
    let mut n_alive = n;
    // They are not negative, so their bits compare like the numbers.
    let mut queue: BinaryHeap<Reverse<(u64, u32)>> = (0..n as u32)
        .map(|c| Reverse((shares[c as usize].to_bits(), c)))
        .collect();
    while let Some(Reverse((bits, cell))) = queue.pop() {
        let is_current = into[cell as usize] == cell && shares[cell as usize].to_bits() == bits;
        if !is_current {
            continue;
        }
        let is_few = n_alive <= bounds.max_cells && n_portals <= bounds.max_portals;
        if is_few && shares[cell as usize] >= bounds.min_cost {
            break;
        }
        let mut best: Option<((bool, f64), u32)> = None;
        for &other in neighbors[cell as usize].keys() {
            let both = graph.cost_of_both(cell, other);
            if both > bounds.max_cost {
                continue;
            }
            let is_near = !graph.aloof[cell as usize] && !graph.aloof[other as usize];
            let key = (is_near, badness.of(&graph, cell, other));
            let is_worse = best
                .as_ref()
                .is_none_or(|(k, ..)| key.0.cmp(&k.0).then(key.1.total_cmp(&k.1)).is_gt());
            if is_worse {
                best = Some((key, other));
            }
        }
        // One that fits nowhere never will: its neighbors only grow.
        let Some((_, other)) = best else {
            continue;
        };
        let (kept, gone) = (cell.min(other), cell.max(other));
        into[gone as usize] = kept;
        let items = graph.union(kept, gone);
        graph.items[kept as usize] = items;
        graph.items[gone as usize] = Vec::new();
        graph.aloof[kept as usize] |= graph.aloof[gone as usize];
        shares[kept as usize] += shares[gone as usize];
        for (next, n) in std::mem::take(&mut neighbors[gone as usize]) {
            neighbors[next as usize].remove(&gone);
            if next == kept {
                n_portals -= n;
            } else {
                *neighbors[next as usize].entry(kept).or_default() += n;
                *neighbors[kept as usize].entry(next).or_default() += n;
            }
        }
        badness.merged(kept, gone);
        n_alive -= 1;
        queue.push(Reverse((shares[kept as usize].to_bits(), kept)));
    }
    for c in 0..n {
        // A cell's host has a lesser number, so it is settled already.
        into[c] = into[into[c] as usize];
    }
    into
}

/// A score a pair that does not change but by adding up: what portals have by themselves.
pub(super) struct PairScores(pub(super) BTreeMap<[u32; 2], f64>);

impl PairScores {
    fn key(a: u32, b: u32) -> [u32; 2] {
        [a.min(b), a.max(b)]
    }
}

/// Visible volume times balance: the paper's metric.
impl Badness for PairScores {
    fn of(&mut self, graph: &CostGraph, a: u32, b: u32) -> f64 {
        let volume = self.0.get(&Self::key(a, b)).copied().unwrap_or(0.0);
        volume * (graph.cost(a) - graph.cost(b)).abs()
    }

    fn merged(&mut self, kept: u32, gone: u32) {
        let of_gone: Vec<([u32; 2], f64)> = self
            .0
            .iter()
            .filter(|(k, _)| k.contains(&gone))
            .map(|(k, v)| (*k, *v))
            .collect();
        for (key, volume) in of_gone {
            self.0.remove(&key);
            let other = if key[0] == gone { key[1] } else { key[0] };
            if other != kept {
                // Of several portals the one that is seen most counts.
                let slot = self.0.entry(Self::key(kept, other)).or_default();
                *slot = slot.max(volume);
            }
        }
    }
}

/// For each cell the sampled eyes that see it, as bits.
pub(super) struct Eyes(pub(super) Vec<Vec<u64>>);

/// Minus the triangles that a view draws more, on the mean, once the portals are gone.
impl Badness for Eyes {
    fn of(&mut self, graph: &CostGraph, a: u32, b: u32) -> f64 {
        let (ea, eb) = (&self.0[a as usize], &self.0[b as usize]);
        let only = |x: &[u64], y: &[u64]| -> f64 {
            x.iter()
                .zip(y)
                .map(|(x, y)| f64::from((x & !y).count_ones()))
                .sum()
        };
        let both = graph.cost_of_both(a, b);
        let (more_a, more_b) = (both - graph.cost(b), both - graph.cost(a));
        -(only(ea, eb) * more_b + only(eb, ea) * more_a)
    }

    fn merged(&mut self, kept: u32, gone: u32) {
        let from = std::mem::take(&mut self.0[gone as usize]);
        for (to, from) in self.0[kept as usize].iter_mut().zip(from) {
            *to |= from;
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::collections::BTreeSet;

    use super::super::views;
    use super::*;
    use proptest::prelude::*;

    /// Cells of whole weights, some far from connected.
    pub(in super::super) fn graphs() -> impl Strategy<Value = CostGraph> {
        (1_usize..24, 1_usize..40).prop_flat_map(|(n_cells, n_items)| {
            let cell = 0..n_cells as u32;
            (
                prop::collection::vec(0_u32..100, n_items),
                prop::collection::vec(
                    prop::collection::btree_set(0..n_items as u32, 0..6),
                    n_cells,
                ),
                prop::collection::vec([cell.clone(), cell], 0..60),
                prop::collection::vec(prop::bool::weighted(0.1), n_cells),
            )
                .prop_map(|(weights, items, pairs, aloof)| CostGraph {
                    weights: weights.into_iter().map(f64::from).collect(),
                    items: items.into_iter().map(|s| s.into_iter().collect()).collect(),
                    pairs,
                    aloof,
                })
        })
    }

    /// Costs of the groups, by looking at every item anew.
    fn group_costs(graph: &CostGraph, into: &[u32]) -> BTreeMap<u32, (f64, usize)> {
        let mut groups: BTreeMap<u32, (BTreeSet<u32>, usize)> = BTreeMap::new();
        for (c, &to) in into.iter().enumerate() {
            let g = groups.entry(to).or_default();
            g.0.extend(&graph.items[c]);
            g.1 += 1;
        }
        let cost = |s: &BTreeSet<u32>| s.iter().map(|&i| graph.weights[i as usize]).sum();
        groups
            .into_iter()
            .map(|(k, (s, n))| (k, (cost(&s), n)))
            .collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        #[test]
        fn bounds_are_kept_and_groups_are_connected(
            graph in graphs(), min in 0_u32..200, extra in 0_u32..300, max_cells in 1_usize..30,
            max_portals in 0_usize..60,
            by_eyes in any::<bool>(), seed in any::<u64>(),
        ) {
            let max_cost = f64::from(min + extra);
            let bounds = Bounds { min_cost: min.into(), max_cost, max_cells, max_portals };
            let n = graph.items.len();
            let mut state = seed;
            let mut bits = || { state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1); state };
            let into = if by_eyes {
                views::merge(&graph, &bounds, Eyes((0..n).map(|_| vec![bits(), bits()]).collect()))
            } else {
                let scores = graph.pairs.iter().map(|&[a, b]| (PairScores::key(a, b), (bits() >> 40) as f64));
                merge(graph.clone(), &bounds, &mut PairScores(scores.collect()))
            };
            let groups = group_costs(&graph, &into);
            // The upper bound holds for whatever was merged, never mind how.
            for (&g, &(cost, n)) in &groups {
                prop_assert!(n == 1 || cost <= bounds.max_cost, "group {g} costs {cost}");
            }
            // Groups are joined by portals: each member reaches its host within the group.
            for c in 0..n {
                let mut seen = BTreeSet::from([c as u32]);
                let mut stack = vec![c as u32];
                while let Some(x) = stack.pop() {
                    for p in &graph.pairs {
                        for (a, b) in [(p[0], p[1]), (p[1], p[0])] {
                            if a == x && into[b as usize] == into[c] && seen.insert(b) {
                                stack.push(b);
                            }
                        }
                    }
                }
                prop_assert!(seen.contains(&into[c]));
            }
            // The lower bound is missed, or the number, only where nothing more fits.
            let n_left = graph.pairs.iter().filter(|p| into[p[0] as usize] != into[p[1] as usize]).count();
            let wants_more = groups.len() > bounds.max_cells || n_left > bounds.max_portals;
            let share = |g: u32| -> f64 {
                let n_of = |i: &u32, is_in: &dyn Fn(usize) -> bool| {
                    (0..n).filter(|&c| is_in(c) && graph.items[c].contains(i)).count() as f64
                };
                let part = |i: u32| n_of(&i, &|c| into[c] == g) / n_of(&i, &|_| true).max(1.0);
                let whole: f64 = (0..graph.weights.len())
                    .map(|i| graph.weights[i] * part(i as u32))
                    .sum();
                // Sums of thirds may miss the whole number that they are.
                whole + 1e-9
            };
            for &[a, b] in &graph.pairs {
                let (ga, gb) = (into[a as usize], into[b as usize]);
                if ga == gb { continue; }
                let is_small = share(ga) < bounds.min_cost || share(gb) < bounds.min_cost;
                if wants_more || is_small {
                    let items: BTreeSet<u32> = (0..n)
                        .filter(|&c| into[c] == ga || into[c] == gb)
                        .flat_map(|c| graph.items[c].iter().copied())
                        .collect();
                    let both: f64 = items.iter().map(|&i| graph.weights[i as usize]).sum();
                    prop_assert!(both > bounds.max_cost, "{ga} and {gb} fit at {both}");
                }
            }
        }
    }
}
