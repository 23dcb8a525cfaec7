//! Choice of cells to merge: smallest cell first, its worst portal removed (Lefebvre & Hornus 2003, §3).
//!
//! Sees a cell only as a set of weighted items, so that an item seen by both cells counts once, and a
//! pair of cells only through its score in the metric.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use super::doorways::Doorways;

/// A graph as the simplifier sees it.
#[derive(Clone, Debug, Default)]
pub(super) struct CostGraph {
    /// Drawing cost of each item; not negative.
    pub(super) weights: Vec<f64>,
    /// The items of each cell, ascending.
    pub(super) items: Vec<Vec<u32>>,
    /// Pairs of cells with a portal between them, once per portal.
    pub(super) pairs: Vec<[u32; 2]>,
    /// The outdoors: cells that merge with others only on request.
    pub(super) aloof: Vec<bool>,
    /// Cells that merge with none, ascending: one of their doorways shows something else than the cell behind it.
    pub(super) alone: Vec<u32>,
    /// Doorways that the lower bound of costs may not take; `None` to let it take all.
    pub(super) doorways: Option<Doorways>,
}

/// Limits that the result should meet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// Lower bound on [`CostGraph::shares`]; the upper bound applies to the cost of all items.
    pub(super) min_cost: f64,
    pub(super) max_cost: f64,
    pub(super) max_cells: usize,
    pub(super) max_portals: usize,
    /// Lets rooms and the outdoors merge.
    pub(super) joins_outdoors: bool,
}

/// Scores the portals between two cells. Higher is worse: removed first.
pub(super) trait Badness {
    /// Returns the score of the portals between two cells that still exist.
    fn of(&mut self, graph: &CostGraph, a: u32, b: u32) -> f64;
    /// Notes that `gone` is now part of `kept`.
    fn merged(&mut self, kept: u32, gone: u32);
}

impl CostGraph {
    /// Returns `true` if the outdoors, special portals and the cost allow two cells to merge.
    pub(super) fn may_join(&self, [a, b]: [u32; 2], both: f64, bounds: &Bounds) -> bool {
        let is_alike = self.aloof[a as usize] == self.aloof[b as usize];
        let is_alone = |c: u32| self.alone.binary_search(&c).is_ok();
        if is_alone(a) || is_alone(b) {
            return false;
        }
        both <= bounds.max_cost && (is_alike || bounds.joins_outdoors)
    }

    pub(super) fn cost(&self, cell: u32) -> f64 {
        self.sum(self.items[cell as usize].iter().copied())
    }

    /// Returns each cell's share of the total cost: an item that reaches through several cells counts in each in part,
    /// as in the paper, where polygons are cut into pieces that lie in one cell each.
    ///
    /// Something that all cells of a room see is hidden by none of their portals, so it does not justify any.
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

    /// Returns the items of both cells, ascending.
    pub(super) fn union(&self, a: u32, b: u32) -> Vec<u32> {
        union(&self.items[a as usize], &self.items[b as usize]).collect()
    }

    /// Returns the same graph with cells merged into others; merged cells have no items.
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
            // They keep their numbers.
            alone: self.alone.clone(),
            doorways: None,
        }
    }

    fn sum(&self, items: impl Iterator<Item = u32>) -> f64 {
        items.map(|i| self.weights[i as usize]).sum()
    }
}

/// Returns the union of two ascending lists, ascending and without duplicates.
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

/// Returns the cell that each cell becomes part of: itself, or a lower one of its group.
///
/// No merged cell costs more than `max_cost` (a cell that already does stays alone). A merge made only for the number
/// of portals removes no more than the excess, as long as such a merge exists. Every merge lowers the number of cells,
/// so it ends; time `O(m log n)` for `m` merges, times the items and neighbors of a cell.
pub(super) fn merge(graph: CostGraph, bounds: &Bounds, badness: &mut dyn Badness) -> Vec<u32> {
    let mut merger = Merger::new(graph, bounds);
    // Shares are not negative, so their bits compare like the numbers.
    let key = |merger: &Merger<'_>, c: u32| Reverse((merger.shares[c as usize].to_bits(), c));
    let mut queue: BinaryHeap<_> = (0..merger.into.len() as u32)
        .map(|c| key(&merger, c))
        .collect();
    // Cells all of whose merges remove too many portals. They stay such: pairs of cells only gain portals.
    let mut waiting: Vec<u32> = Vec::new();
    loop {
        let merge = match queue.pop() {
            Some(Reverse((bits, cell))) => {
                let share = merger.shares[cell as usize];
                if merger.into[cell as usize] != cell || share.to_bits() != bits {
                    continue;
                }
                let is_small = share < bounds.min_cost;
                if merger.is_few() && !is_small {
                    break;
                }
                let is_for_portals = !is_small && merger.n_alive <= bounds.max_cells;
                let most = if is_for_portals {
                    merger.n_too_many()
                } else {
                    usize::MAX
                };
                let worst = merger.worst(cell, most, is_small, badness);
                if worst.is_none() && is_for_portals {
                    waiting.push(cell);
                }
                // A cell that fits nowhere never will: its neighbors only grow.
                worst.map(|other| (cell, other))
            }
            None if merger.is_few() => break,
            None => match merger.least_beyond(&waiting, badness) {
                None => break,
                pair => pair,
            },
        };
        if let Some((a, b)) = merge {
            merger.join(a.min(b), a.max(b));
            badness.merged(a.min(b), a.max(b));
            queue.push(key(&merger, a.min(b)));
        }
    }
    let mut into = merger.into;
    for c in 0..into.len() {
        // A cell's host has a lower number, so it is settled already.
        into[c] = into[into[c] as usize];
    }
    into
}

struct Merger<'a> {
    graph: CostGraph,
    bounds: &'a Bounds,
    into: Vec<u32>,
    shares: Vec<f64>,
    /// Number of portals to each neighbor.
    neighbors: Vec<BTreeMap<u32, usize>>,
    n_portals: usize,
    n_alive: usize,
    /// Merges rooms with each other first. Off where the bound is below the number of portals that lead outdoors, since
    /// all rooms would become one.
    prefers_rooms: bool,
}

impl<'a> Merger<'a> {
    fn new(graph: CostGraph, bounds: &'a Bounds) -> Self {
        let n = graph.items.len();
        let mut neighbors: Vec<BTreeMap<u32, usize>> = vec![BTreeMap::new(); n];
        let (mut n_portals, mut n_outward) = (0, 0);
        for &[a, b] in &graph.pairs {
            n_outward += usize::from(graph.aloof[a as usize] != graph.aloof[b as usize]);
            if a != b {
                *neighbors[a as usize].entry(b).or_default() += 1;
                *neighbors[b as usize].entry(a).or_default() += 1;
                n_portals += 1;
            }
        }
        Self {
            shares: graph.shares(),
            graph,
            bounds,
            into: (0..n as u32).collect(),
            neighbors,
            n_portals,
            n_alive: n,
            prefers_rooms: n_outward <= bounds.max_portals,
        }
    }

    /// Returns the number of portals above the bound.
    fn n_too_many(&self) -> usize {
        self.n_portals.saturating_sub(self.bounds.max_portals)
    }

    fn is_few(&self) -> bool {
        self.n_alive <= self.bounds.max_cells && self.n_too_many() == 0
    }

    /// Returns the neighbors that a cell may merge with, and the number of portals each merge removes.
    fn partners(&self, cell: u32) -> impl Iterator<Item = (u32, usize)> {
        let all = self.neighbors[cell as usize].iter();
        all.map(|(&other, &n)| (other, n))
            .filter(move |&(other, _)| {
                let both = self.graph.cost_of_both(cell, other);
                self.graph.may_join([cell, other], both, self.bounds)
            })
    }

    /// Returns the neighbor with the worst portals, among merges that remove at most `most` portals, and no doorway if these
    /// are kept from merges of small cells.
    fn worst(
        &self,
        cell: u32,
        most: usize,
        is_small: bool,
        badness: &mut dyn Badness,
    ) -> Option<u32> {
        let aloof = &self.graph.aloof;
        let kept = self.graph.doorways.as_ref().filter(|_| is_small);
        let is_kept = |other| kept.is_some_and(|d| d.part(cell, other));
        let mut best: Option<((bool, f64), u32)> = None;
        let partners = self.partners(cell);
        for (other, _) in partners.filter(|p| p.1 <= most && !is_kept(p.0)) {
            let is_room = !aloof[cell as usize] && !aloof[other as usize];
            let is_first = is_room || !self.prefers_rooms;
            let key = (is_first, badness.of(&self.graph, cell, other));
            let is_worse =
                best.is_none_or(|(k, _)| key.0.cmp(&k.0).then(key.1.total_cmp(&k.1)).is_gt());
            if is_worse {
                best = Some((key, other));
            }
        }
        best.map(|(_, other)| other)
    }

    /// Returns the merge of one of `cells` that removes the fewest portals; ties go to the worst portals.
    fn least_beyond(&self, cells: &[u32], badness: &mut dyn Badness) -> Option<(u32, u32)> {
        let alive = cells.iter().filter(|&&c| self.into[c as usize] == c);
        let pairs = alive.flat_map(|&c| self.partners(c).map(move |(other, n)| (n, c, other)));
        let keyed =
            pairs.map(|(n, c, other)| ((n, -badness.of(&self.graph, c, other)), (c, other)));
        let least = keyed.min_by(|(a, _), (b, _)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        least.map(|(_, pair)| pair)
    }

    fn join(&mut self, kept: u32, gone: u32) {
        self.into[gone as usize] = kept;
        if let Some(doorways) = &mut self.graph.doorways {
            doorways.merged(kept, gone);
        }
        self.graph.items[kept as usize] = self.graph.union(kept, gone);
        self.graph.items[gone as usize] = Vec::new();
        self.graph.aloof[kept as usize] |= self.graph.aloof[gone as usize];
        self.shares[kept as usize] += self.shares[gone as usize];
        for (next, n) in std::mem::take(&mut self.neighbors[gone as usize]) {
            self.neighbors[next as usize].remove(&gone);
            if next == kept {
                self.n_portals -= n;
            } else {
                *self.neighbors[next as usize].entry(kept).or_default() += n;
                *self.neighbors[kept as usize].entry(next).or_default() += n;
            }
        }
        self.n_alive -= 1;
    }
}

/// A score for each pair, from its portals alone: merges only combine scores.
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
                // Among several portals, the most visible counts.
                let slot = self.0.entry(Self::key(kept, other)).or_default();
                *slot = slot.max(volume);
            }
        }
    }
}

/// For each cell, the sampled eyes that see it, as bits.
pub(super) struct Eyes(pub(super) Vec<Vec<u64>>);

/// Minus the mean number of triangles that a view additionally draws without the portals.
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

    /// Cells with integer weights, often far from connected.
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
                    alone: Vec::new(),
                    doorways: None,
                })
        })
    }

    /// Computes the costs of the groups anew from every item.
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

    #[test]
    fn merges_for_the_number_of_portals_stop_at_it() {
        // Cells of equal cost in a row; the cheapest opens to the next by five portals, the worst of all.
        let pairs = [[0, 1]; 5].into_iter().chain((1..6).map(|i| [i, i + 1]));
        let graph = CostGraph {
            weights: (1..=7).map(f64::from).collect(),
            items: (0..7).map(|c| vec![c]).collect(),
            pairs: pairs.collect(),
            aloof: vec![false; 7],
            alone: Vec::new(),
            doorways: None,
        };
        let scores = |[a, b]: [u32; 2]| ([a, b], if a == 0 { 9.0 } else { 1.0 });
        let n_left = |max_portals| {
            let bounds = Bounds {
                min_cost: 0.0,
                max_cost: f64::INFINITY,
                max_cells: usize::MAX,
                max_portals,
                joins_outdoors: false,
            };
            let mut badness = PairScores(graph.pairs.iter().map(|&pair| scores(pair)).collect());
            let into = merge(graph.clone(), &bounds, &mut badness);
            let left = graph
                .pairs
                .iter()
                .filter(|p| into[p[0] as usize] != into[p[1] as usize]);
            left.count()
        };
        for most in 0..10 {
            assert_eq!(n_left(most), most);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        #[test]
        fn bounds_are_kept_and_groups_are_connected(
            graph in graphs(), min in 0_u32..200, extra in 0_u32..300, max_cells in 1_usize..30,
            max_portals in 0_usize..60,
            by_eyes in any::<bool>(), joins_outdoors in any::<bool>(), seed in any::<u64>(),
        ) {
            let max_cost = f64::from(min + extra);
            let bounds = Bounds { min_cost: min.into(), max_cost, max_cells, max_portals, joins_outdoors };
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
            // The upper bound holds for everything that was merged.
            for (&g, &(cost, n)) in &groups {
                prop_assert!(n == 1 || cost <= bounds.max_cost, "group {g} costs {cost}");
            }
            // The outdoors stays separate unless requested.
            for (c, &host) in into.iter().enumerate() {
                let is_alike = graph.aloof[c] == graph.aloof[host as usize];
                prop_assert!(joins_outdoors || is_alike, "{c} and {host}");
            }
            // Portals connect each group: each member reaches its host within the group.
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
            // The lower bound or the number is missed only where nothing more fits.
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
                // Sums of thirds may differ from the exact integer.
                whole + 1e-9
            };
            for &[a, b] in &graph.pairs {
                let (ga, gb) = (into[a as usize], into[b as usize]);
                if ga == gb { continue; }
                let is_small = share(ga) < bounds.min_cost || share(gb) < bounds.min_cost;
                let is_apart = !joins_outdoors && graph.aloof[a as usize] != graph.aloof[b as usize];
                if (wants_more || is_small) && !is_apart {
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
