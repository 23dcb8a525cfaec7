//! Merges cells down to a number of cells or portals: the merge that adds least to the cost of sampled views
//! comes first.
//!
//! Lefebvre & Hornus 2003, §3, take the smallest cell first. That is right for a bound on cell costs, but blind
//! if only a number is requested: the smallest cell may be a closet that no view sees. Here any two
//! neighbors may be next, and the added cost is counted exactly: an eye that sees one of the two additionally
//! draws what it did not draw before, whichever cell lists it.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use super::merge::{self, Bounds, CostGraph, Eyes};

/// An order of merges.
#[derive(Clone, Copy, Debug)]
struct Order {
    /// Rooms merge with the outdoors, where allowed, only when no other merge is left.
    is_outdoors_last: bool,
    /// While there are too many portals, divides the added cost by the number of portals removed.
    by_portal: bool,
}

/// The orders that are tried; none is best on all worlds.
const ORDERS: [Order; 4] = {
    const fn order(is_outdoors_last: bool, by_portal: bool) -> Order {
        Order {
            is_outdoors_last,
            by_portal,
        }
    }
    [
        order(true, true),
        order(false, true),
        order(true, false),
        order(false, false),
    ]
};

/// Most groups that are reopened and merged anew; fewer in worlds of many cells.
const MAX_RETRIES: usize = 64;
const MAX_CELLS_RETRIED: usize = 8192;

/// Returns the cell that each cell becomes part of: itself, or a lower one of its group.
///
/// Cells below the lower bound come first, as in [`merge::merge`]. Then merges down to the numbers, in several orders,
/// and keeps the result with the cheapest views. Then reopens one group at a time and merges anew, and keeps
/// improvements. No merged cell costs more than `max_cost`.
///
/// Each merge costs the eyes and items of the pairs whose score it changes, and one pass over all pairs.
pub(super) fn merge(graph: &CostGraph, bounds: &Bounds, mut eyes: Eyes) -> Vec<u32> {
    let any_number = Bounds {
        max_cells: usize::MAX,
        max_portals: usize::MAX,
        ..*bounds
    };
    let into = merge::merge(graph.clone(), &any_number, &mut eyes);
    let mut start = ViewMerger::new(graph.contracted(&into), eyes.0, into);
    if start.n_too_many(bounds) == 0 {
        return start.into;
    }
    let mut best = start.merged(bounds);
    let hosts = start.hosts();
    let mut n_left = MAX_RETRIES.min(MAX_CELLS_RETRIED / hosts.len());
    let mut is_better = true;
    while is_better {
        is_better = false;
        let groups: BTreeSet<u32> = best.1.iter().copied().collect();
        for open in groups.into_iter().take(n_left) {
            n_left -= 1;
            let mut reopened = start.clone();
            for &cell in &hosts {
                let host = best.1[cell as usize];
                if host != cell && host != open {
                    reopened.merge(host, cell);
                }
            }
            let closed = reopened.merged(bounds);
            if closed.0 < best.0 {
                best = closed;
                is_better = true;
            }
        }
    }
    best.1
}

/// Number of excess cells and portals, then the total cost of all views.
type Excess = (usize, f64);

#[derive(Clone)]
struct ViewMerger {
    graph: CostGraph,
    /// For each cell, the eyes that see it, as bits.
    sees: Vec<Vec<u64>>,
    /// For each eye, the items that it draws, as bits.
    drawn: Vec<Vec<u64>>,
    /// Pairs of neighbors, the lower first.
    pairs: BTreeMap<(u32, u32), CellPair>,
    n_portals: usize,
    n_cells: usize,
    /// The cell that each cell is part of.
    into: Vec<u32>,
}

#[derive(Clone, Copy)]
struct CellPair {
    n_portals: usize,
    /// Added cost of all views if the two merge; stale if NaN.
    added: f64,
    /// Cost of drawing both.
    both: f64,
}

/// One of the two is the outdoors; the added cost; the cost of drawing both.
type MergeKey = (bool, f64, f64);

impl ViewMerger {
    /// Starts with a graph that was contracted to the hosts of `into`.
    fn new(graph: CostGraph, sees: Vec<Vec<u64>>, into: Vec<u32>) -> Self {
        let n_eyes = 64 * sees.first().map_or(0, Vec::len);
        let mut drawn = vec![vec![0; graph.weights.len().div_ceil(64)]; n_eyes];
        for (cell, sees) in sees.iter().enumerate() {
            for eye in bits(sees.iter().copied()) {
                draw(&mut drawn[eye], &graph.items[cell]);
            }
        }
        let mut out = Self {
            sees,
            drawn,
            pairs: BTreeMap::new(),
            n_portals: 0,
            n_cells: 0,
            graph,
            into,
        };
        out.n_cells = out.hosts().len();
        for &[a, b] in &out.graph.pairs.clone() {
            if a != b {
                out.join(a, b, 1);
                out.n_portals += 1;
            }
        }
        out
    }

    /// Returns the cells that are not part of others.
    fn hosts(&self) -> Vec<u32> {
        let hosts = (0..).zip(&self.into).filter(|&(c, &host)| c == host);
        hosts.map(|(c, _)| c).collect()
    }

    fn n_too_many(&self, bounds: &Bounds) -> usize {
        self.n_cells.saturating_sub(bounds.max_cells)
            + self.n_portals.saturating_sub(bounds.max_portals)
    }

    /// Returns the best result of all orders: its excess, and the cell that each cell becomes part of.
    fn merged(&mut self, bounds: &Bounds) -> (Excess, Vec<u32>) {
        // Once for all orders.
        self.weigh();
        let start = &*self;
        let tries: Vec<(Excess, Vec<u32>)> = ORDERS
            .into_par_iter()
            .with_max_len(1)
            .map(|order| {
                let mut tried = start.clone();
                tried.merge_in(order, bounds);
                let drawn = tried.drawn.iter().map(|items| {
                    let items = bits(items.iter().copied());
                    items.map(|i| tried.graph.weights[i]).sum::<f64>()
                });
                ((tried.n_too_many(bounds), drawn.sum()), tried.into)
            })
            .collect();
        let by_excess =
            |a: &(Excess, _), b: &(Excess, _)| a.0.0.cmp(&b.0.0).then(a.0.1.total_cmp(&b.0.1));
        tries.into_iter().min_by(by_excess).unwrap_or_default()
    }

    /// Merges until the numbers are within bounds or no merge is possible.
    fn merge_in(&mut self, order: Order, bounds: &Bounds) {
        while self.n_too_many(bounds) > 0 {
            let by_portal = order.by_portal && self.n_portals > bounds.max_portals;
            let Some((kept, gone)) = self.best(by_portal, order.is_outdoors_last, bounds) else {
                break;
            };
            self.merge(kept, gone);
        }
    }

    fn join(&mut self, a: u32, b: u32, n_portals: usize) {
        let stale = CellPair {
            n_portals: 0,
            added: f64::NAN,
            both: 0.0,
        };
        let pair = self.pairs.entry((a.min(b), a.max(b))).or_insert(stale);
        pair.n_portals += n_portals;
        pair.added = f64::NAN;
    }

    /// Recomputes the stale pairs.
    fn weigh(&mut self) {
        for (&(a, b), pair) in &mut self.pairs {
            if pair.added.is_nan() {
                // Sums of nothing are -0, which orders before 0: ties must go by cell number.
                pair.both = self.graph.cost_of_both(a, b) + 0.0;
                pair.added = added(&self.graph, &self.drawn, &self.sees, a, b) + 0.0;
            }
        }
    }

    /// Returns the pair that adds least, per portal or in total; ties go to the cheapest.
    fn best(
        &mut self,
        by_portal: bool,
        is_outdoors_last: bool,
        bounds: &Bounds,
    ) -> Option<(u32, u32)> {
        self.weigh();
        let mut best: Option<(MergeKey, (u32, u32))> = None;
        for (&(a, b), pair) in &self.pairs {
            if !self.graph.may_join([a, b], pair.both, bounds) {
                continue;
            }
            let is_outdoors = self.graph.aloof[a as usize] || self.graph.aloof[b as usize];
            let is_aloof = is_outdoors_last && is_outdoors;
            let share = if by_portal { pair.n_portals } else { 1 } as f64;
            let key = (is_aloof, pair.added / share, pair.both / share);
            let is_better = best.is_none_or(|(k, _)| {
                let order = key.0.cmp(&k.0).then(key.1.total_cmp(&k.1));
                order.then(key.2.total_cmp(&k.2)).is_lt()
            });
            if is_better {
                best = Some((key, (a, b)));
            }
        }
        best.map(|(_, pair)| pair)
    }

    fn merge(&mut self, kept: u32, gone: u32) {
        for host in &mut self.into {
            if *host == gone {
                *host = kept;
            }
        }
        self.n_cells -= 1;
        let [k, g] = [kept, gone].map(|c| c as usize);
        // Eyes that draw more from now on.
        let changed: Vec<u64> = (self.sees[k].iter().zip(&self.sees[g]))
            .map(|(a, b)| a ^ b)
            .collect();
        let items = self.graph.union(kept, gone);
        for eye in bits(changed.iter().copied()) {
            draw(&mut self.drawn[eye], &items);
        }
        self.graph.items[k] = items;
        self.graph.items[g] = Vec::new();
        self.graph.aloof[k] |= self.graph.aloof[g];
        let of_gone = std::mem::take(&mut self.sees[g]);
        for (to, from) in self.sees[k].iter_mut().zip(of_gone) {
            *to |= from;
        }
        let moved: Vec<((u32, u32), CellPair)> = (self.pairs.iter())
            .filter(|((a, b), _)| *a == gone || *b == gone)
            .map(|(names, pair)| (*names, *pair))
            .collect();
        for ((a, b), pair) in moved {
            self.pairs.remove(&(a, b));
            let other = if a == gone { b } else { a };
            if other == kept {
                self.n_portals -= pair.n_portals;
            } else {
                self.join(kept, other, pair.n_portals);
            }
        }
        for (&(a, b), pair) in &mut self.pairs {
            let (x, y) = (&self.sees[a as usize], &self.sees[b as usize]);
            let is_stale = a == kept
                || b == kept
                || (x.iter().zip(y).zip(&changed)).any(|((x, y), c)| (x ^ y) & c != 0);
            if is_stale {
                pair.added = f64::NAN;
            }
        }
    }
}

/// Returns the added cost of all views when two cells become one.
fn added(graph: &CostGraph, drawn: &[Vec<u64>], sees: &[Vec<u64>], a: u32, b: u32) -> f64 {
    let of = |seen: u32, new: u32| -> f64 {
        let (x, y) = (&sees[seen as usize], &sees[new as usize]);
        bits(x.iter().zip(y).map(|(x, y)| x & !y))
            .map(|eye| {
                let is_new = |i: &&u32| drawn[eye][**i as usize / 64] >> (**i % 64) & 1 == 0;
                let new = graph.items[new as usize].iter().filter(is_new);
                new.map(|&i| graph.weights[i as usize]).sum::<f64>()
            })
            .sum()
    };
    of(a, b) + of(b, a)
}

fn draw(drawn: &mut [u64], items: &[u32]) {
    for &i in items {
        drawn[i as usize / 64] |= 1 << (i % 64);
    }
}

/// Returns the positions of set bits, ascending.
fn bits(words: impl Iterator<Item = u64>) -> impl Iterator<Item = usize> {
    words.enumerate().flat_map(|(i, mut word)| {
        std::iter::from_fn(move || {
            let bit = word.trailing_zeros() as usize;
            (word != 0).then(|| {
                word &= word - 1;
                64 * i + bit
            })
        })
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::merge::tests::graphs;
    use super::*;
    use proptest::prelude::*;

    /// The key of a pair, and the cells after its merge.
    type Found = ((MergeKey, [u32; 2]), Vec<u32>);

    fn items(graph: &CostGraph, into: &[u32], group: u32) -> BTreeSet<u32> {
        let of_group = (0..into.len()).filter(|&c| into[c] == group);
        of_group.flat_map(|c| graph.items[c].clone()).collect()
    }

    fn cost(graph: &CostGraph, items: &BTreeSet<u32>) -> f64 {
        items.iter().map(|&i| graph.weights[i as usize]).sum()
    }

    /// Returns the total cost of all views.
    fn drawn(graph: &CostGraph, sees: &[BTreeSet<usize>], into: &[u32]) -> f64 {
        let of_eye = |eye| {
            let groups: BTreeSet<u32> = (0..into.len())
                .filter(|&c| sees[c].contains(&eye))
                .map(|c| into[c])
                .collect();
            let all = groups.iter().flat_map(|&g| items(graph, into, g));
            cost(graph, &all.collect())
        };
        (0..128).map(of_eye).sum()
    }

    /// Merges by recounting every eye, cell and item for each pair.
    fn by_looking(
        graph: &CostGraph,
        bounds: &Bounds,
        sees: &[BTreeSet<usize>],
        order: Order,
    ) -> Vec<u32> {
        let n = graph.items.len();
        let mut into: Vec<u32> = (0..n as u32).collect();
        loop {
            let between: Vec<[u32; 2]> = (graph.pairs.iter())
                .map(|p| p.map(|c| into[c as usize]))
                .filter(|p| p[0] != p[1])
                .map(|[a, b]| [a.min(b), a.max(b)])
                .collect();
            let n_alive = into.iter().collect::<BTreeSet<_>>().len();
            let is_many = between.len() > bounds.max_portals;
            if !is_many && n_alive <= bounds.max_cells {
                return into;
            }
            let by_portal = is_many && order.by_portal;
            let is_outdoors = |g: u32| (0..n).any(|c| into[c] == g && graph.aloof[c]);
            let is_aloof = |g: u32| order.is_outdoors_last && is_outdoors(g);
            let mut best: Option<Found> = None;
            for pair @ [a, b] in between.iter().copied().collect::<BTreeSet<_>>() {
                let joined: Vec<u32> = into.iter().map(|&g| if g == b { a } else { g }).collect();
                let both = cost(graph, &items(graph, &joined, a));
                let is_apart = !bounds.joins_outdoors && is_outdoors(a) != is_outdoors(b);
                let n_same = between.iter().filter(|p| **p == pair).count();
                let share = if by_portal { n_same } else { 1 } as f64;
                let more = drawn(graph, sees, &joined) - drawn(graph, sees, &into);
                let key = (
                    (is_aloof(a) || is_aloof(b), more / share, both / share),
                    pair,
                );
                if both <= bounds.max_cost
                    && !is_apart
                    && best.as_ref().is_none_or(|(k, _)| key < *k)
                {
                    best = Some((key, joined));
                }
            }
            match best {
                Some((_, joined)) => into = joined,
                None => return into,
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(100))]

        #[test]
        fn the_pair_that_adds_least_to_all_views_is_next_in_each_order(
            graph in graphs(), max_cost in prop_oneof![50_u32..400, Just(u32::MAX)], max_cells in 1_usize..20,
            max_portals in 0_usize..40, joins_outdoors in any::<bool>(), seeds in prop::collection::vec((any::<u64>(), any::<u64>()), 24),
        ) {
            // Combines two random words, so that an eye sees a quarter of the cells.
            let eyes: Vec<Vec<u64>> = (0..graph.items.len())
                .map(|c| vec![seeds[c].0 & seeds[c].1, seeds[c].0 & seeds[23 - c].1.rotate_left(7)])
                .collect();
            let sees: Vec<BTreeSet<usize>> = (eyes.iter())
                .map(|e| (0..128).filter(|i| e[i / 64] >> (i % 64) & 1 == 1).collect())
                .collect();
            // Integer weights: sums do not depend on their order.
            let bounds = Bounds { min_cost: 0.0, max_cost: max_cost.into(), max_cells, max_portals, joins_outdoors };
            let start = ViewMerger::new(graph.clone(), eyes.clone(), (0..graph.items.len() as u32).collect());
            let mut least = f64::INFINITY;
            for order in ORDERS {
                let mut found = start.clone();
                found.merge_in(order, &bounds);
                prop_assert_eq!(&found.into, &by_looking(&graph, &bounds, &sees, order));
                if found.n_too_many(&bounds) == 0 {
                    least = least.min(drawn(&graph, &sees, &found.into));
                }
            }
            // At least as good as the best of these.
            let found = merge(&graph, &bounds, Eyes(eyes));
            prop_assert!(least.is_infinite() || drawn(&graph, &sees, &found) <= least);
        }
    }
}
