//! Cuts thin leaves where one of their faces turns from closed to open.
//!
//! Two triangles of one wall whose vertices are not identical to the last bit lie in two planes A and B that are
//! nearly parallel. Across the first triangle the order is room, A closed, sliver, B open, wall; across the other it
//! is room, A open, sliver, B closed, wall. So one convex leaf, a hair thick, is wide open to both sides, and none of
//! its facets is narrow. A plane across the sliver, through the edge where A turns from closed to open, divides it
//! into a leaf of the room and one of the wall. The facet between these is as narrow as the gap, so the seal that
//! closes the gap is as small. The grouping of leaves does not depend on these cuts, see
//! [`Clearance`](super::graph::Clearance).
//!
//! **Which edges:** those between the closed and the open part of a facet, where the leaf behind the facet is thinner
//! than a gap somewhere. Not walls that end in open air, and not edges shorter than a gap, which leave nothing wider
//! uncut. An edge that two triangles share appears twice, slightly apart: edges within a quarter of a gap of a cut
//! are not cut again, and seals may be that much larger.
//!
//! **Complexity:** one visit of all facets, one clip for each such edge and side; `k` edges in one leaf make up to
//! `k²` leaves of it, with at most [`MAX_CUTS`] cuts. **What can go wrong:** cuts within rounding of each other leave
//! columns narrower than an opening; these are crumbs, which the grouping merges.

use std::ops::Range;

use enfilade_geom::poly::{self, Poly, Sides};
use enfilade_geom::{DVec3, Plane, Purse};

use rayon::prelude::*;

use super::facet::{Cover, Covers, CutBox, FacetSink, OpenPieces, RawFacet, Visitor};
use super::surface::{Source, Tolerance};
use super::tree::{Node, Tree, leaf_index};

/// Most cuts through one leaf; the longest come first.
const MAX_CUTS: usize = 256;

/// Subtrees with more edges are examined in parallel.
const PARALLEL_EDGES: usize = 2048;

/// Edges within this share of a gap of a cut are not cut again. A larger share makes fewer leaves and larger seals:
/// at a half, seals have two fifths more area; at a tenth, there are a seventh more leaves.
const ALIKE: f64 = 0.25;

/// An edge where a facet turns from closed to open, seen from one of its leaves.
struct Edge {
    leaf: u32,
    from: DVec3,
    to: DVec3,
    /// Into the leaf, along the facet's normal.
    inward: DVec3,
}

/// A strip across a leaf.
struct Strip {
    plane: u32,
    points: Poly,
}

/// Returns the tree with its thin leaves cut. The result does not depend on the order of the surfaces.
pub(super) fn cut_thin_leaves(visitor: &Visitor<'_>, gap: f64) -> Tree {
    let mut sink = Edges {
        visitor,
        gap,
        found: Vec::new(),
    };
    visitor.visit(&mut sink);
    let edges = sink.found;
    // Sorted by leaf, then in the order of the tree.
    let mut by_leaf: Vec<LeafEdge> = (0..).zip(&edges).map(|(i, e)| (e.leaf, i)).collect();
    by_leaf.par_sort_unstable();
    let tree = visitor.tree;
    let finder = StripFinder {
        tree,
        edges: &edges,
        gap,
        tolerance: visitor.tolerance,
    };
    let region = CutBox::all(tree.bounds);
    let mut cuts = finder.find(tree.root, &by_leaf, region).into_iter();
    let mut cutter = LeafCutter {
        tree,
        gap,
        purse: visitor.purse,
        next: cuts.next(),
        cuts,
        planes: tree.planes.clone(),
        nodes: Vec::with_capacity(tree.nodes.len()),
        on_plane: Vec::with_capacity(tree.on_plane.len()),
        n_leaves: 0,
    };
    let root = cutter.copy(tree.root, 0..tree.n_leaves);
    let LeafCutter {
        planes,
        nodes,
        on_plane,
        n_leaves,
        ..
    } = cutter;
    Tree {
        bounds: tree.bounds,
        planes,
        nodes,
        on_plane,
        root,
        n_leaves,
    }
}

/// Collects the edges between the closed and the open parts of facets.
struct Edges<'a> {
    visitor: &'a Visitor<'a>,
    /// Shorter edges are ignored. [Units: wu]
    gap: f64,
    found: Vec<Edge>,
}

impl FacetSink for Edges<'_> {
    fn enter(&mut self, node: i32) -> bool {
        let on_plane = self.visitor.tree.surfaces_on(node as usize);
        let is_candidate = |&s: &u32| {
            let source = self.visitor.surfaces[s as usize].source;
            matches!(source, Source::Candidate(_))
        };
        !on_plane.iter().all(is_candidate)
    }

    fn wants_under(&self, covers: Covers<'_>) -> bool {
        covers.has_triangles()
    }

    fn take(&mut self, facet: &RawFacet<'_>) {
        let tolerance = &self.visitor.tolerance;
        let normal = self.visitor.tree.planes[facet.plane as usize].normal;
        let pieces = OpenPieces::of(facet, normal, tolerance).pieces;
        if pieces.is_empty() {
            return;
        }
        let covers = facet.covers.iter();
        let closed: Vec<&Cover> = covers.filter(|c| c.candidate.is_none()).collect();
        for (piece, _) in pieces {
            for (k, &a) in piece.iter().enumerate() {
                let b = piece[(k + 1) % piece.len()];
                // Shorter edges leave nothing uncut that is wider than a gap.
                if (b - a).length() <= self.gap {
                    continue;
                }
                let Some(outward) = (b - a).cross(normal).try_normalize() else {
                    continue;
                };
                // Test points beyond the facet too: behind its other leaf, a plane of the tree may end it right
                // there.
                let is_closed = |t: f64| {
                    let beyond = a.lerp(b, t) + outward * tolerance.width;
                    let mut near = closed.iter().filter(|c| c.is_near(beyond, tolerance.width));
                    near.any(|c| is_within(&c.points, normal, beyond))
                };
                if [1.0 / 6.0, 0.5, 5.0 / 6.0].into_iter().any(is_closed) {
                    for (leaf, inward) in [(facet.leaves[0], normal), (facet.leaves[1], -normal)] {
                        self.found.push(Edge {
                            leaf,
                            from: a,
                            to: b,
                            inward,
                        });
                    }
                }
            }
        }
    }

    fn fork(&self, _: Range<u32>) -> Self {
        Self {
            visitor: self.visitor,
            gap: self.gap,
            found: Vec::new(),
        }
    }

    fn join(&mut self, front: Self, back: Self) {
        for part in [front, back] {
            if self.found.is_empty() {
                self.found = part.found;
            } else {
                self.found.extend(part.found);
            }
        }
    }
}

/// Returns `true` if a point in the plane of a convex polygon, counter-clockwise about `normal`, is inside.
fn is_within(points: &[DVec3], normal: DVec3, p: DVec3) -> bool {
    (0..points.len()).all(|i| {
        let (a, b) = (points[i], points[(i + 1) % points.len()]);
        normal
            .cross(b - a)
            .try_normalize()
            .is_none_or(|inward| inward.dot(p - a) >= 0.0)
    })
}

/// A leaf, and the index of an edge seen from it.
type LeafEdge = (u32, u32);

/// Strips across one leaf with their planes.
type LeafCuts = (u32, Vec<(Plane, Poly)>);

struct StripFinder<'a> {
    tree: &'a Tree,
    edges: &'a [Edge],
    /// Leaves are cut where they are thinner than this. [Units: wu]
    gap: f64,
    tolerance: Tolerance,
}

impl StripFinder<'_> {
    /// Returns the strips across the leaves of a subtree, by leaf. `edges` are those of these leaves, each after its leaf.
    fn find(&self, child: i32, edges: &[LeafEdge], mut region: CutBox) -> Vec<LeafCuts> {
        if edges.len() < PARALLEL_EDGES || child < 0 {
            let mut out = Vec::new();
            self.find_in_turn(child, edges, &mut region, &mut out);
            return out;
        }
        let (plane, children, edges) = self.halves(child, edges);
        let find = |side: usize| {
            let mut region = region.clone();
            region.on_side(&plane, side, |part| {
                self.find(children[side], edges[side], part.clone())
            })
        };
        let (mut front, back) = rayon::join(|| find(0), || find(1));
        front.extend(back);
        front
    }

    fn find_in_turn(
        &self,
        child: i32,
        edges: &[LeafEdge],
        region: &mut CutBox,
        out: &mut Vec<LeafCuts>,
    ) {
        if edges.is_empty() {
            return;
        }
        if child < 0 {
            let strips = self.strips(edges, region);
            if !strips.is_empty() {
                out.push((leaf_index(child), strips));
            }
            return;
        }
        let (plane, children, edges) = self.halves(child, edges);
        for side in 0..2 {
            region.on_side(&plane, side, |part| {
                self.find_in_turn(children[side], edges[side], part, out);
            });
        }
    }

    /// Returns the plane of a node, its children, and the edges of each.
    fn halves<'b>(
        &self,
        node: i32,
        edges: &'b [LeafEdge],
    ) -> (Plane, [i32; 2], [&'b [LeafEdge]; 2]) {
        let node = &self.tree.nodes[node as usize];
        let first_back = self.tree.leaf_range(node.children[1]).start;
        let (front, back) = edges.split_at(edges.partition_point(|e| e.0 < first_back));
        let plane = self.tree.planes[node.plane as usize];
        (plane, node.children, [front, back])
    }

    /// Returns the strips that will cut a leaf.
    fn strips(&self, edges: &[LeafEdge], region: &CutBox) -> Vec<(Plane, Poly)> {
        let edges = edges.iter().map(|&(_, i)| &self.edges[i as usize]);
        let mut found: Vec<(f64, Plane, Poly)> = edges
            .filter_map(|e| {
                let depth = e.inward * self.gap;
                let quad = [e.from, e.to, e.to + depth, e.from + depth];
                let points = region.clip(&quad, self.tolerance.cut)?;
                let length = e.from.distance(e.to);
                // A whole strip means a thick leaf; smaller ones are parts near the ends of leaves.
                let is_thin = poly::area(&points) < 0.99 * length * self.gap;
                let normal = (e.to - e.from).cross(e.inward).try_normalize()?;
                let is_there = poly::width(&points) > 2.0 * self.tolerance.cut;
                // Skip strips along a side of the leaf.
                let middle = points.iter().sum::<DVec3>() / points.len() as f64;
                let beside = normal * (2.0 * self.tolerance.width);
                let is_across =
                    region.contains(middle + beside) && region.contains(middle - beside);
                (is_thin && is_there && is_across)
                    .then(|| (length, Plane::through(e.from, normal), points))
            })
            .collect();
        // Longest first. Equal lengths come from both sides of one edge.
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        found.truncate(MAX_CUTS);
        let strips = found.into_iter();
        strips.map(|(_, plane, points)| (plane, points)).collect()
    }
}

struct LeafCutter<'a> {
    tree: &'a Tree,
    gap: f64,
    purse: Purse<'a>,
    /// Those of the next leaf that is cut.
    next: Option<LeafCuts>,
    /// Those of the leaves after it, ascending.
    cuts: std::vec::IntoIter<LeafCuts>,
    planes: Vec<Plane>,
    nodes: Vec<Node>,
    on_plane: Vec<u32>,
    n_leaves: u32,
}

impl LeafCutter<'_> {
    /// Copies a subtree with these leaves and cuts them; returns its new root.
    fn copy(&mut self, child: i32, leaves: Range<u32>) -> i32 {
        if self.next.as_ref().is_none_or(|n| n.0 >= leaves.end) {
            return self.copy_uncut(child, leaves);
        }
        if child < 0 {
            let strips = self.next.take().map(|n| n.1).unwrap_or_default();
            self.next = self.cuts.next();
            let first = self.planes.len() as u32;
            self.planes.extend(strips.iter().map(|s| s.0));
            let strips = (first..).zip(strips);
            let strips = strips.map(|(plane, (_, points))| Strip { plane, points });
            return self.split(strips.collect());
        }
        let node = self.tree.nodes[child as usize];
        let at = self.push(node.plane);
        self.on_plane
            .extend_from_slice(self.tree.surfaces_on(child as usize));
        let [front, back] = node.children;
        let middle = self.tree.leaf_range(back).start;
        let children = [
            self.copy(front, leaves.start..middle),
            self.copy(back, middle..leaves.end),
        ];
        self.nodes[at].children = children;
        at as i32
    }

    /// Copies a subtree whose leaves are not cut: its nodes are in a row, one fewer than its leaves.
    fn copy_uncut(&mut self, child: i32, leaves: Range<u32>) -> i32 {
        let by_leaf = self.n_leaves as i32 - leaves.start as i32;
        self.n_leaves += leaves.len() as u32;
        if child < 0 {
            return child - by_leaf;
        }
        let (nodes, rest) = self.tree.nodes[child as usize..].split_at(leaves.len() - 1);
        let on_start = nodes[0].on_start;
        let on_end = rest
            .first()
            .map_or(self.tree.on_plane.len(), |n| n.on_start as usize);
        let (by_node, new_on) = (self.nodes.len() as i32 - child, self.on_plane.len() as u32);
        self.nodes.extend(nodes.iter().map(|n| {
            Node {
                plane: n.plane,
                on_start: n.on_start - on_start + new_on,
                children: n
                    .children
                    .map(|c| if c >= 0 { c + by_node } else { c - by_leaf }),
            }
        }));
        let on_plane = &self.tree.on_plane[on_start as usize..on_end];
        self.on_plane.extend_from_slice(on_plane);
        child + by_node
    }

    fn push(&mut self, plane: u32) -> usize {
        self.nodes.push(Node {
            plane,
            on_start: self.on_plane.len() as u32,
            children: [0; 2],
        });
        self.nodes.len() - 1
    }

    /// Splits a leaf by the planes of strips, each only where the strip lies.
    fn split(&mut self, mut strips: Vec<Strip>) -> i32 {
        if strips.is_empty() || !self.purse.spend(2 * strips.len() as u64) {
            self.n_leaves += 1;
            return -(self.n_leaves as i32);
        }
        let first = strips.remove(0);
        let plane = self.planes[first.plane as usize];
        let at = self.push(first.plane);
        let mut sides = [Vec::new(), Vec::new()];
        for s in strips {
            match poly::split(&s.points, &plane, ALIKE * self.gap) {
                Sides::On => {}
                Sides::Front => sides[0].push(s),
                Sides::Back => sides[1].push(s),
                Sides::Both(front, back) => {
                    for (side, points) in sides.iter_mut().zip([front, back]) {
                        let plane = s.plane;
                        side.push(Strip { plane, points });
                    }
                }
            }
        }
        let [front, back] = sides;
        let children = [self.split(front), self.split(back)];
        self.nodes[at].children = children;
        at as i32
    }
}

impl CutBox {
    fn contains(&self, p: DVec3) -> bool {
        self.bounds.contains(p) && self.cuts.iter().all(|c| c.signed_distance(p) >= 0.0)
    }

    /// Returns the part of a polygon inside.
    fn clip(&self, points: &[DVec3], eps: f64) -> Option<Poly> {
        let mut points = poly::clip_to_box(points, &self.bounds, eps)?;
        let mut cuts = self.cuts.iter();
        let is_left = cuts.all(|cut| poly::clip_in_place(&mut points, cut, eps));
        is_left.then_some(points)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ComplexInput, build_complex};
    use super::*;
    use enfilade_geom::Aabb;

    /// A wall whose triangles miss each other by a millimeter: a sliver between two of them is cut once at the edge
    /// that they share, not at both copies of it.
    #[test]
    fn edges_nearer_to_each_other_than_a_gap_are_cut_once() {
        // Any numbers without a pattern: fractions of multiples of the golden section.
        let mut n = 0.0;
        let mut next = || {
            n += 1.0;
            (n * 0.618_033_988_749_895_f64).fract() - 0.5
        };
        let mut triangles = Vec::new();
        for i in 0..6 {
            for j in 0..6 {
                let corner = |y: i32, z: i32| DVec3::new(0.0, f64::from(i + y), f64::from(j + z));
                for t in [[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]] {
                    let mut moved = |(y, z)| {
                        let by = DVec3::new(next(), next(), next());
                        (corner(y, z) + by * 2e-3).as_vec3().as_dvec3()
                    };
                    triangles.push(t.map(&mut moved));
                }
            }
        }
        let complex = build_complex(&ComplexInput {
            triangles: &triangles,
            candidates: &[],
            missing: &[],
            bounds: Aabb::new(DVec3::splat(-1.0), DVec3::splat(7.0)),
            gap: 0.01,
            has_seals: true,
        });
        // 17 leaves per triangle; 25 if both copies were cut.
        let n = complex.n_leaves();
        assert!(n < 20 * triangles.len(), "{n}");
    }
}
