//! Nodes of the tree over triangles, and its construction.

use glam::{Vec3, Vec4};

use crate::{Aabb, DVec3, Triangle};

/// Maximum number of triangles in a leaf; four `f64` triangles cost about as much as one more node.
const LEAF_SIZE: usize = 4;
/// Number of candidate planes per axis.
const N_BINS: usize = 16;
/// Depth from which nodes are split by count, so that hostile input cannot make the tree deep.
const MAX_SAH_DEPTH: usize = 40;
/// Number of triangles from which the children of a node are built apart from each other: fewer take less time than that.
const LEAST_FORKED: usize = 1 << 12;
/// Largest coordinate; beyond it `f32` products overflow, and triangles are ignored.
const MAX_COORDINATE: f64 = 1e15;

/// Four children: their boxes as `[min, max][axis]`, and their references.
#[derive(Clone, Debug)]
#[repr(align(128))]
pub(super) struct Node {
    pub(super) bounds: [[Vec4; 3]; 2],
    /// Index of a node, or of the first triangle of a leaf.
    pub(super) children: [u32; 4],
    /// Number of triangles of a leaf; 0 for a node. Unused children have an empty box.
    pub(super) counts: [u32; 4],
}

const UNUSED: Node = Node {
    bounds: [[Vec4::INFINITY; 3], [Vec4::NEG_INFINITY; 3]],
    children: [0; 4],
    counts: [0; 4],
};

impl Node {
    /// Returns the node for a list that begins `by` nodes before the one it was in.
    fn moved_by(mut self, by: u32) -> Self {
        for (child, &count) in self.children.iter_mut().zip(&self.counts) {
            // Neither unused children nor leaves count; nothing has the first node as a child.
            if count == 0 && *child != 0 {
                *child += by;
            }
        }
        self
    }
}

/// A triangle during the construction.
struct Entry {
    bounds: Aabb,
    center: DVec3,
    id: u32,
}

/// Nodes, and the leaf order of the triangles.
pub(super) struct Built {
    pub(super) nodes: Vec<Node>,
    /// Index of each triangle in the caller's list.
    pub(super) ids: Vec<u32>,
    pub(super) bounds: Aabb,
}

/// Builds the nodes over all triangles whose vertices are finite and not too far away.
pub(super) fn build_nodes(triangles: &[Triangle]) -> Built {
    let mut entries: Vec<Entry> = triangles
        .iter()
        .enumerate()
        .filter(|(_, t)| {
            t.iter()
                .all(|p| p.abs().max_element() <= MAX_COORDINATE && p.is_finite())
        })
        .map(|(i, t)| {
            let bounds = Aabb::of_points(t);
            Entry {
                bounds,
                center: bounds.center(),
                id: i as u32,
            }
        })
        .collect();
    let bounds = entries.iter().fold(Aabb::EMPTY, |b, e| b.union(e.bounds));
    let mut nodes = Vec::with_capacity(entries.len() / 2 + 1);
    build_node(&mut nodes, &mut entries, 0, 0);
    let ids: Vec<u32> = entries.iter().map(|e| e.id).collect();
    Built { nodes, ids, bounds }
}

#[inline]
pub(super) fn round_down(p: DVec3) -> Vec3 {
    Vec3::from_array(p.to_array().map(|x| {
        let rounded = x as f32;
        if f64::from(rounded) > x {
            rounded.next_down()
        } else {
            rounded
        }
    }))
}

#[inline]
pub(super) fn round_up(p: DVec3) -> Vec3 {
    -round_down(-p)
}

/// A range of the entries that becomes one child.
struct Part {
    first: usize,
    count: usize,
    bounds: Aabb,
}

/// Appends the node over `entries`, which start at `offset` in leaf order, and all nodes below it.
fn build_node(nodes: &mut Vec<Node>, entries: &mut [Entry], offset: usize, depth: usize) {
    if entries.is_empty() {
        return;
    }
    let by_count = depth >= MAX_SAH_DEPTH;
    let whole = entries.iter().fold(Aabb::EMPTY, |b, e| b.union(e.bounds));
    let mut parts = vec![Part {
        first: 0,
        count: entries.len(),
        bounds: whole,
    }];
    while parts.len() < 4 {
        // Split the part that a ray most likely enters; by count, the largest.
        let weight = |p: &Part| {
            if by_count {
                p.count as f64
            } else {
                p.bounds.surface_area()
            }
        };
        let Some(widest) = (0..parts.len())
            .filter(|&i| parts[i].count > LEAF_SIZE)
            .max_by(|&a, &b| {
                weight(&parts[a])
                    .total_cmp(&weight(&parts[b]))
                    .then(b.cmp(&a))
            })
        else {
            break;
        };
        let part = &parts[widest];
        let slice = &mut entries[part.first..part.first + part.count];
        let left = if by_count {
            slice.len() / 2
        } else {
            split(slice)
        };
        let bounds_of = |s: &[Entry]| s.iter().fold(Aabb::EMPTY, |b, e| b.union(e.bounds));
        let halves = [
            Part {
                first: part.first,
                count: left,
                bounds: bounds_of(&slice[..left]),
            },
            Part {
                first: part.first + left,
                count: part.count - left,
                bounds: bounds_of(&slice[left..]),
            },
        ];
        parts.splice(widest..=widest, halves);
    }
    let this = nodes.len();
    nodes.push(UNUSED);
    let mut below: Vec<Subtree<'_>> = Vec::new();
    let (mut rest, mut taken) = (entries, 0);
    for (k, part) in parts.iter().enumerate() {
        let (min, max) = (round_down(part.bounds.min), round_up(part.bounds.max));
        for axis in 0..3 {
            nodes[this].bounds[0][axis][k] = min[axis];
            nodes[this].bounds[1][axis][k] = max[axis];
        }
        let (own, after) = rest.split_at_mut(part.first + part.count - taken);
        let entries = &mut own[part.first - taken..];
        (rest, taken) = (after, part.first + part.count);
        if part.count <= LEAF_SIZE {
            nodes[this].children[k] = (offset + part.first) as u32;
            nodes[this].counts[k] = part.count as u32;
        } else {
            below.push(Subtree {
                child: k,
                entries,
                offset: offset + part.first,
                depth: depth + 1,
                nodes: Vec::new(),
            });
        }
    }
    let is_forked = taken >= LEAST_FORKED;
    if is_forked {
        build_all(&mut below);
    }
    for subtree in below {
        let start = nodes.len() as u32;
        nodes[this].children[subtree.child] = start;
        if is_forked {
            nodes.extend(subtree.nodes.into_iter().map(|n| n.moved_by(start)));
        } else {
            build_node(nodes, subtree.entries, subtree.offset, subtree.depth);
        }
    }
}

/// A child of a node with nodes of its own.
struct Subtree<'a> {
    /// Its place among the children.
    child: usize,
    entries: &'a mut [Entry],
    offset: usize,
    depth: usize,
    /// Its nodes, if it was built apart from the others.
    nodes: Vec<Node>,
}

/// Builds subtrees apart from each other, so that threads can share the work.
fn build_all(subtrees: &mut [Subtree<'_>]) {
    match subtrees {
        [] => {}
        [s] => build_node(&mut s.nodes, s.entries, s.offset, s.depth),
        _ => {
            let (a, b) = subtrees.split_at_mut(subtrees.len() / 2);
            join(|| build_all(a), || build_all(b));
        }
    }
}

/// Does both, at the same time with the feature `rayon`.
#[cfg(feature = "rayon")]
fn join(a: impl FnOnce() + Send, b: impl FnOnce() + Send) {
    rayon::join(a, b);
}

#[cfg(not(feature = "rayon"))]
fn join(a: impl FnOnce(), b: impl FnOnce()) {
    a();
    b();
}

/// Reorders `entries` into two parts, neither empty, and returns the size of the first.
fn split(entries: &mut [Entry]) -> usize {
    let centers = entries
        .iter()
        .fold(Aabb::EMPTY, |b, e| b.including(e.center));
    let size = centers.size();
    let mut best: Option<(f64, usize, usize)> = None;
    for axis in 0..3 {
        if size[axis] <= 0.0 {
            continue;
        }
        let mut bins = [(Aabb::EMPTY, 0_usize); N_BINS];
        for e in entries.iter() {
            let bin = &mut bins[bin_of(e.center[axis], centers.min[axis], size[axis])];
            bin.0 = bin.0.union(e.bounds);
            bin.1 += 1;
        }
        let mut right_cost = [0.0; N_BINS];
        let mut right = (Aabb::EMPTY, 0);
        for k in (1..N_BINS).rev() {
            right = (right.0.union(bins[k].0), right.1 + bins[k].1);
            right_cost[k] = right.0.surface_area() * right.1 as f64;
        }
        let mut left = (Aabb::EMPTY, 0);
        for k in 1..N_BINS {
            left = (left.0.union(bins[k - 1].0), left.1 + bins[k - 1].1);
            if left.1 == 0 || left.1 == entries.len() {
                continue;
            }
            let cost = left.0.surface_area() * left.1 as f64 + right_cost[k];
            if best.is_none_or(|b| cost < b.0) {
                best = Some((cost, axis, k));
            }
        }
    }
    let Some((_, axis, bin)) = best else {
        // All centers coincide: any split is as good.
        return entries.len() / 2;
    };
    let mut left = 0;
    for i in 0..entries.len() {
        if bin_of(entries[i].center[axis], centers.min[axis], size[axis]) < bin {
            entries.swap(left, i);
            left += 1;
        }
    }
    left
}

fn bin_of(center: f64, min: f64, size: f64) -> usize {
    // A tiny size can make the quotient infinite or NaN; the cast and `min` handle both.
    (((center - min) / size * N_BINS as f64) as usize).min(N_BINS - 1)
}
