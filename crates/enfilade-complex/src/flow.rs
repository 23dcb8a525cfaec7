//! The minimum cut of a graph between two terminals.
//!
//! Two trees grow toward each other, from the source and from the sink, along arcs with capacity left. Where they
//! meet, flow is pushed, and the nodes that this cuts off find new parents in their tree (Boykov & Kolmogorov, "An
//! Experimental Comparison of Min-Cut/Max-Flow Algorithms for Energy Minimization in Vision", 2004). Trees are kept
//! from one path to the next: on graphs of neighbors in space, each tied to both terminals, that is several times as
//! fast as a flow by levels.
//!
//! Capacities are integers, so rounding cannot cause loops. The cut does not depend on the path of the flow: among
//! all minimum cuts it is the one with the fewest nodes on the source's side.
//!
//! Time: `O(V²EC)` at worst, with the cut's cost `C`, and about linear in practice. Memory: 24 bytes per edge, 33 per
//! node.

use std::collections::VecDeque;

use enfilade_geom::Purse;

const NONE: u32 = u32::MAX;
/// Parent of a node attached to its terminal.
const ROOT: u32 = u32::MAX - 1;
/// Parent of a node that has lost its own and waits for another.
const LOST: u32 = u32::MAX - 2;

/// The root of a tree. A node with a parent belongs to one of the two trees.
#[derive(Clone, Copy, PartialEq)]
enum Terminal {
    Source,
    Sink,
}

/// Half of an edge; [`Arc::twin`] is the other half.
#[derive(Clone, Copy)]
struct Arc {
    to: u32,
    twin: u32,
    capacity: u64,
}

/// A graph under construction.
pub(super) struct Flow {
    edges: Vec<([u32; 2], [u64; 2])>,
    /// Remaining capacity from the source, or, if negative, to the sink.
    terminal: Vec<i64>,
    /// Flow straight from source to sink through a node.
    total: u64,
}

impl Flow {
    /// Makes a graph of `n` nodes without edges.
    pub(super) fn new(n: usize) -> Self {
        Self {
            edges: Vec::new(),
            terminal: vec![0; n],
            total: 0,
        }
    }

    /// Adds an edge with capacities for both directions.
    pub(super) fn add(&mut self, a: usize, b: usize, forward: u64, backward: u64) {
        if forward > 0 || backward > 0 {
            self.edges.push(([a as u32, b as u32], [forward, backward]));
        }
    }

    /// Sets the capacities from the source to a node and from there to the sink; once per node. [Limit: below 2⁶³]
    pub(super) fn tie(&mut self, node: usize, from_source: u64, to_sink: u64) {
        self.total = self.total.saturating_add(from_source.min(to_sink));
        self.terminal[node] = from_source as i64 - to_sink as i64;
    }

    /// Returns the cost of the minimum cut, and for each node `true` if it is on the source's side. The cut is not
    /// minimal if the purse runs out.
    pub(super) fn cut(self, purse: Purse<'_>) -> (u64, Vec<bool>) {
        let total = self.total;
        let mut search = Search::of(self);
        let pushed = search.run(purse);
        let sides = search.parent.iter().zip(&search.tree);
        let is_source = sides.map(|(&p, &tree)| p != NONE && tree == Terminal::Source);
        (total.saturating_add(pushed), is_source.collect())
    }
}

struct Search {
    arcs: Vec<Arc>,
    /// First arc of each node, then the number of arcs.
    start: Vec<u32>,
    terminal: Vec<i64>,
    tree: Vec<Terminal>,
    /// The arc to the parent; [`ROOT`], [`LOST`], or [`NONE`] outside the trees.
    parent: Vec<u32>,
    /// Time at which the distance was last known to be right, and the distance to the terminal.
    stamp: Vec<u32>,
    distance: Vec<u32>,
    active: VecDeque<u32>,
    is_active: Vec<bool>,
    orphans: VecDeque<u32>,
    time: u32,
}

impl Search {
    fn of(graph: Flow) -> Self {
        let n = graph.terminal.len();
        let mut start = vec![0_u32; n + 1];
        for node in graph.edges.iter().flat_map(|e| e.0) {
            start[node as usize + 1] += 1;
        }
        for i in 1..start.len() {
            start[i] += start[i - 1];
        }
        let mut at = start.clone();
        let nothing = Arc {
            to: NONE,
            twin: NONE,
            capacity: 0,
        };
        let mut arcs = vec![nothing; 2 * graph.edges.len()];
        for ([a, b], [forward, backward]) in graph.edges {
            let [i, j] = [a, b].map(|node| {
                at[node as usize] += 1;
                at[node as usize] - 1
            });
            arcs[i as usize] = Arc {
                to: b,
                twin: j,
                capacity: forward,
            };
            arcs[j as usize] = Arc {
                to: a,
                twin: i,
                capacity: backward,
            };
        }
        let mut search = Self {
            arcs,
            start,
            tree: vec![Terminal::Source; n],
            parent: vec![NONE; n],
            stamp: vec![0; n],
            distance: vec![0; n],
            active: VecDeque::new(),
            is_active: vec![false; n],
            orphans: VecDeque::new(),
            time: 0,
            terminal: graph.terminal,
        };
        for node in 0..n {
            let left = search.terminal[node];
            if left != 0 {
                search.tree[node] = if left > 0 {
                    Terminal::Source
                } else {
                    Terminal::Sink
                };
                search.parent[node] = ROOT;
                search.distance[node] = 1;
                search.activate(node as u32);
            }
        }
        search
    }

    fn activate(&mut self, node: u32) {
        if !std::mem::replace(&mut self.is_active[node as usize], true) {
            self.active.push_back(node);
        }
    }

    fn arcs_of(&self, node: u32) -> std::ops::Range<u32> {
        self.start[node as usize]..self.start[node as usize + 1]
    }

    /// Returns `true` if flow can pass from the parent's end of an arc to the child's: along the arc, or, in the
    /// sink's tree, against it.
    fn is_open(&self, arc: u32, tree: Terminal) -> bool {
        let arc = self.arcs[arc as usize];
        match tree {
            Terminal::Source => arc.capacity > 0,
            Terminal::Sink => self.arcs[arc.twin as usize].capacity > 0,
        }
    }

    fn run(&mut self, purse: Purse<'_>) -> u64 {
        let mut total = 0_u64;
        while let Some(&node) = self.active.front() {
            if !purse.spend(1) {
                break;
            }
            let meeting = if self.parent[node as usize] == NONE {
                None
            } else {
                self.grow(node)
            };
            let Some(arc) = meeting else {
                // Nothing is left to do here until the node is reached again.
                self.active.pop_front();
                self.is_active[node as usize] = false;
                continue;
            };
            self.time += 1;
            total = total.saturating_add(self.augment(arc));
            while let Some(orphan) = self.orphans.pop_front() {
                purse.spend(1);
                self.adopt(orphan);
            }
        }
        total
    }

    /// Takes free neighbors into the tree. Returns an arc from the source's tree to the sink's once one exists.
    fn grow(&mut self, node: u32) -> Option<u32> {
        let tree = self.tree[node as usize];
        for arc in self.arcs_of(node) {
            if !self.is_open(arc, tree) {
                continue;
            }
            let Arc { to, twin, .. } = self.arcs[arc as usize];
            let [n, t] = [node, to].map(|v| v as usize);
            if self.parent[t] == NONE {
                self.tree[t] = tree;
                self.hang(to, twin, node);
                self.activate(to);
            } else if self.tree[t] != tree {
                return Some(if tree == Terminal::Source { arc } else { twin });
            } else if self.stamp[t] <= self.stamp[n] && self.distance[t] > self.distance[n] {
                // That way is shorter.
                self.hang(to, twin, node);
            }
        }
        None
    }

    /// Makes the node at the other end of `arc` the parent.
    fn hang(&mut self, node: u32, arc: u32, parent: u32) {
        self.parent[node as usize] = arc;
        self.stamp[node as usize] = self.stamp[parent as usize];
        self.distance[node as usize] = self.distance[parent as usize] + 1;
    }

    /// Pushes the most flow possible along the path through `middle`; nodes that hung on full arcs become orphans.
    fn augment(&mut self, middle: u32) -> u64 {
        let twin = self.arcs[middle as usize].twin;
        let ends = [
            (self.arcs[twin as usize].to, Terminal::Source),
            (self.arcs[middle as usize].to, Terminal::Sink),
        ];
        let mut least = self.arcs[middle as usize].capacity;
        for (end, tree) in ends {
            let mut node = end as usize;
            while self.parent[node] != ROOT {
                let arc = self.arcs[self.parent[node] as usize];
                least = least.min(match tree {
                    Terminal::Source => self.arcs[arc.twin as usize].capacity,
                    Terminal::Sink => arc.capacity,
                });
                node = arc.to as usize;
            }
            least = least.min(self.terminal[node].unsigned_abs());
        }
        self.arcs[middle as usize].capacity -= least;
        self.arcs[twin as usize].capacity += least;
        for (end, tree) in ends {
            let mut node = end as usize;
            while self.parent[node] != ROOT {
                let up = self.parent[node] as usize;
                let down = self.arcs[up].twin as usize;
                // Flow runs toward the node in the source's tree, and away from it in the sink's.
                let (with, against) = match tree {
                    Terminal::Source => (down, up),
                    Terminal::Sink => (up, down),
                };
                self.arcs[with].capacity -= least;
                self.arcs[against].capacity += least;
                if self.arcs[with].capacity == 0 {
                    self.orphan(node as u32);
                }
                node = self.arcs[up].to as usize;
            }
            match tree {
                Terminal::Source => self.terminal[node] -= least as i64,
                Terminal::Sink => self.terminal[node] += least as i64,
            }
            if self.terminal[node] == 0 {
                self.orphan(node as u32);
            }
        }
        least
    }

    fn orphan(&mut self, node: u32) {
        self.parent[node as usize] = LOST;
        self.orphans.push_back(node);
    }

    /// Gives an orphan the parent nearest to the terminal; without one, frees it and orphans its children.
    fn adopt(&mut self, node: u32) {
        let tree = self.tree[node as usize];
        self.parent[node as usize] = NONE;
        let mut best: Option<(u32, u32)> = None;
        for arc in self.arcs_of(node) {
            let Arc { to, twin, .. } = self.arcs[arc as usize];
            if self.is_open(twin, tree)
                && self.tree[to as usize] == tree
                && let Some(distance) = self.distance_to_terminal(to)
                && best.is_none_or(|b| distance < b.0)
            {
                best = Some((distance, arc));
            }
        }
        if let Some((distance, arc)) = best {
            self.parent[node as usize] = arc;
            self.stamp[node as usize] = self.time;
            self.distance[node as usize] = distance + 1;
            return;
        }
        for arc in self.arcs_of(node) {
            let Arc { to, twin, .. } = self.arcs[arc as usize];
            let parent = self.parent[to as usize];
            if self.tree[to as usize] != tree || parent == NONE {
                continue;
            }
            if self.is_open(twin, tree) {
                self.activate(to);
            }
            if parent == twin {
                self.orphan(to);
            }
        }
    }

    /// Returns the distance of a node from its terminal, if the way there is intact. Marks that way.
    fn distance_to_terminal(&mut self, from: u32) -> Option<u32> {
        let (mut node, mut steps) = (from as usize, 0);
        loop {
            if self.stamp[node] == self.time {
                steps += self.distance[node];
                break;
            }
            match self.parent[node] {
                NONE | LOST => return None,
                ROOT => {
                    self.stamp[node] = self.time;
                    self.distance[node] = 1;
                    steps += 1;
                    break;
                }
                arc => {
                    steps += 1;
                    node = self.arcs[arc as usize].to as usize;
                }
            }
        }
        let (mut node, mut left) = (from as usize, steps);
        while self.stamp[node] != self.time {
            self.stamp[node] = self.time;
            self.distance[node] = left;
            left -= 1;
            node = self.arcs[self.parent[node] as usize].to as usize;
        }
        Some(steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn the_cut_is_the_least_and_of_those_the_one_with_the_least_side(
            ties in prop::collection::vec((0_u64..40, 0_u64..40), 1..9),
            edges in prop::collection::vec((0_usize..9, 0_usize..9, 0_u64..30, 0_u64..30), 0..24),
        ) {
            let n = ties.len();
            let edges: Vec<_> = edges.into_iter().filter(|e| e.0 != e.1 && e.0.max(e.1) < n).collect();
            let cost = |side: &dyn Fn(usize) -> bool| -> u64 {
                let tied = (0..n).map(|v| if side(v) { ties[v].1 } else { ties[v].0 });
                let cut = edges.iter().map(|&(a, b, forward, backward)| match (side(a), side(b)) {
                    (true, false) => forward,
                    (false, true) => backward,
                    _ => 0,
                });
                tied.sum::<u64>() + cut.sum::<u64>()
            };
            // Try every cut.
            let all = (0..1_u32 << n).map(|set| (cost(&|v| set >> v & 1 == 1), set));
            let least = all.clone().map(|(cost, _)| cost).min().unwrap();
            let common = all.filter(|c| c.0 == least).fold(u32::MAX, |common, c| common & c.1);

            let mut flow = Flow::new(n);
            for &(a, b, forward, backward) in &edges {
                flow.add(a, b, forward, backward);
            }
            for (v, &(from_source, to_sink)) in ties.iter().enumerate() {
                flow.tie(v, from_source, to_sink);
            }
            let (found, side) = flow.cut(Purse::endless());
            prop_assert_eq!(found, least);
            prop_assert_eq!(cost(&|v| side[v]), least);
            prop_assert!((0..n).all(|v| side[v] == (common >> v & 1 == 1)));
        }
    }
}
