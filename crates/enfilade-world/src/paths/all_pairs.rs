//! Least lengths between all pairs of few nodes, maintained while links open and close.
//!
//! A table of lengths and of the last link of each path, by source. A link that opens or closes changes only paths through it:
//! for each source, the nodes whose path used it, or that it brings nearer (after Ramalingam & Reps, "An incremental algorithm
//! for a generalization of the shortest-path problem", Journal of Algorithms 21, 1996). `O(n²)` memory; a change costs `O(n)`
//! and, for every pair whose path changes, its links times the logarithm of a heap.
//!
//! Lengths are integers: sums are exact in any order, so the table equals a new one, to the bit.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// No path.
pub(crate) const FAR: u32 = u32::MAX;
/// No link.
pub(crate) const NONE: u32 = u32::MAX;

/// A link between two nodes, both ways.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edge {
    pub(crate) ends: [u32; 2],
    pub(crate) length: u32,
    pub(crate) is_open: bool,
}

/// A link as left from one of its nodes.
#[derive(Clone, Copy, Debug)]
struct Leg {
    link: u32,
    to: u32,
    /// Its index among the links of the node that it leads to.
    place: u16,
}

/// Stands for no link's index.
const NOWHERE: u16 = u16::MAX;

/// The table and its graph.
#[derive(Clone, Debug)]
pub(crate) struct AllPairs {
    n: usize,
    links: Vec<Edge>,
    /// Per node its first link, and the number of all.
    first: Vec<u32>,
    /// Links of nodes, node by node.
    around: Vec<Leg>,
    /// Per source and node, the length of the path.
    length: Vec<u32>,
    /// Per source and node, its last link, as an index among those of the node. Apart from lengths and in 16 bits: next hops read
    /// nothing else, and a small table stays in cache.
    last: Vec<u16>,
    heap: BinaryHeap<Reverse<(u32, u32)>>,
    /// Nodes behind a closed link, and a mark for each.
    behind: Vec<u32>,
    is_behind: Vec<bool>,
}

impl AllPairs {
    /// Makes the table of `n` nodes. O(n · links · log n).
    ///
    /// # Panics
    ///
    /// If a node has more than 65,535 links.
    pub(crate) fn new(n: usize, links: Vec<Edge>) -> Self {
        let mut around: Vec<(u32, u32, u32)> = Vec::new();
        for (i, link) in (0..).zip(&links) {
            let [a, b] = link.ends;
            if a != b {
                around.extend([(a, i, b), (b, i, a)]);
            }
        }
        around.sort_unstable();
        let first = (0..=n as u32).map(|x| around.partition_point(|e| e.0 < x) as u32);
        let first: Vec<u32> = first.collect();
        let legs = around.iter().map(|&(from, link, to)| {
            let place =
                around.partition_point(|e| *e < (to, link, from)) as u32 - first[to as usize];
            assert!(
                place < u32::from(NOWHERE),
                "a node has 65,535 links at most"
            );
            Leg {
                link,
                to,
                place: place as u16,
            }
        });
        let around = legs.collect();
        let mut table = Self {
            n,
            links,
            first,
            around,
            length: vec![FAR; n * n],
            last: vec![NOWHERE; n * n],
            heap: BinaryHeap::new(),
            behind: Vec::new(),
            is_behind: vec![false; n],
        };
        for source in 0..n {
            table.length[source * n + source] = 0;
            table.heap.push(Reverse((0, source as u32)));
            table.spread(source);
        }
        table
    }

    pub(crate) fn n(&self) -> usize {
        self.n
    }

    /// Returns the length from one node to another; [`FAR`] if there is no path.
    #[inline]
    pub(crate) fn length(&self, from: u32, to: u32) -> u32 {
        self.length[to as usize * self.n + from as usize]
    }

    /// Returns the first link on the path from one node to another; [`NONE`] if there is no path, or none is needed.
    #[inline]
    pub(crate) fn first_link(&self, from: u32, to: u32) -> u32 {
        // Links are symmetric: it is the last one of the path back.
        match self.last[to as usize * self.n + from as usize] {
            NOWHERE => NONE,
            place => self.around[self.first[from as usize] as usize + usize::from(place)].link,
        }
    }

    /// Opens or closes a link. O(n + pairs whose path changes).
    pub(crate) fn set_open(&mut self, link: u32, is_open: bool) {
        let at = &mut self.links[link as usize];
        if at.is_open == is_open {
            return;
        }
        at.is_open = is_open;
        let Edge { ends, length, .. } = *at;
        if ends[0] == ends[1] {
            return;
        }
        let places = ends.map(|node| {
            let own = self.first[node as usize]..self.first[node as usize + 1];
            let place = own.clone().find(|&i| self.around[i as usize].link == link);
            place.map_or(NOWHERE, |i| (i - own.start) as u16)
        });
        for source in 0..self.n {
            let row = source * self.n;
            for (from, to, place) in [(ends[0], ends[1], places[1]), (ends[1], ends[0], places[0])]
            {
                let at = row + to as usize;
                if is_open {
                    let through = sum(self.length[row + from as usize], length);
                    if through < self.length[at] {
                        self.length[at] = through;
                        self.last[at] = place;
                        self.heap.push(Reverse((through, to)));
                        self.spread(source);
                    }
                } else if self.last[at] == place {
                    self.cut(source, to);
                    break;
                }
            }
        }
    }

    /// Settles all nodes in the heap, and all that they bring nearer.
    fn spread(&mut self, source: usize) {
        let row = source * self.n;
        while let Some(Reverse((length, node))) = self.heap.pop() {
            if length > self.length[row + node as usize] {
                continue;
            }
            for i in self.first[node as usize]..self.first[node as usize + 1] {
                let Leg { link, to, place } = self.around[i as usize];
                let Edge {
                    length: leg,
                    is_open,
                    ..
                } = self.links[link as usize];
                let (through, at) = (sum(length, leg), row + to as usize);
                if is_open && through < self.length[at] {
                    self.length[at] = through;
                    self.last[at] = place;
                    self.heap.push(Reverse((through, to)));
                }
            }
        }
    }

    /// Finds new paths from a source to a node and to all nodes reached through it.
    fn cut(&mut self, source: usize, node: u32) {
        let row = source * self.n;
        self.behind.clear();
        self.behind.push(node);
        self.is_behind[node as usize] = true;
        let mut next = 0;
        while next < self.behind.len() {
            let from = self.behind[next];
            next += 1;
            for i in self.first[from as usize]..self.first[from as usize + 1] {
                let Leg { to, place, .. } = self.around[i as usize];
                // Paths from a source form a tree: a link into `from` is the last one of no other.
                if self.last[row + to as usize] == place && !self.is_behind[to as usize] {
                    self.is_behind[to as usize] = true;
                    self.behind.push(to);
                }
            }
        }
        for k in 0..self.behind.len() {
            let to = self.behind[k];
            let (mut best, own) = ((FAR, NOWHERE), self.first[to as usize]);
            for i in own..self.first[to as usize + 1] {
                let Leg { link, to: from, .. } = self.around[i as usize];
                let Edge {
                    length, is_open, ..
                } = self.links[link as usize];
                if is_open && !self.is_behind[from as usize] {
                    let through = sum(self.length[row + from as usize], length);
                    best = best.min((through, (i - own) as u16));
                }
            }
            let at = row + to as usize;
            self.length[at] = best.0;
            self.last[at] = if best.0 == FAR { NOWHERE } else { best.1 };
            if best.0 != FAR {
                self.heap.push(Reverse((best.0, to)));
            }
        }
        for k in 0..self.behind.len() {
            self.is_behind[self.behind[k] as usize] = false;
        }
        self.spread(source);
    }
}

/// Returns the sum, or [`FAR`] if it exceeds the greatest length.
#[inline]
pub(crate) fn sum(a: u32, b: u32) -> u32 {
    a.saturating_add(b)
}
