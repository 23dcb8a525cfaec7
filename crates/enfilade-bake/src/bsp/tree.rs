//! The tree: space cut by the planes of its surfaces until no leaf contains any.

use enfilade_geom::{Aabb, DVec3, Plane, Purse};
use rayon::prelude::*;

use crate::complex::poly::{self, Poly, Sides};
use crate::config::{Guide, Heuristic};

use super::tolerance::Tolerance;

/// A convex piece of a surface.
#[derive(Clone, Debug)]
pub(super) struct Fragment {
    /// Vertices, counter-clockwise about the plane's normal unless `is_flipped`.
    pub(super) points: Poly,
    /// Index into [`Tree::planes`].
    pub(super) plane: u32,
    /// It faces against its plane's normal.
    pub(super) is_flipped: bool,
}

/// Content of a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Content {
    /// Surfaces around it face into it.
    Empty,
    /// Surfaces around it face away.
    Solid,
    /// No surface bounds it, or as many face in as away.
    Unknown,
}

/// An inner node. Children: a node's index (`>= 0`) or `-1 - leaf`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) plane: u32,
    pub(super) children: [i32; 2],
    /// Start of its fragments in [`Tree::on_plane`]; they end where the next node's begin.
    pub(super) on_start: u32,
}

/// A binary space partition. Nodes are in preorder.
pub(super) struct Tree {
    pub(super) bounds: Aabb,
    pub(super) planes: Vec<Plane>,
    pub(super) nodes: Vec<Node>,
    pub(super) on_plane: Vec<Fragment>,
    pub(super) root: i32,
    /// Content of each leaf.
    pub(super) contents: Vec<Content>,
    /// Number of cuts of a fragment in two.
    pub(super) n_splits: usize,
}

impl Tree {
    /// Returns the leaf that contains `p`; points in a plane belong to its front.
    pub(super) fn leaf_of(&self, p: DVec3) -> u32 {
        leaf_index(self.around(self.root, p, 0.0))
    }

    /// Returns the least of the nodes below and at a child that holds all of a ball within that child, as a child.
    pub(super) fn around(&self, child: i32, center: DVec3, radius: f64) -> i32 {
        let mut at = child;
        while at >= 0 {
            let node = &self.nodes[at as usize];
            let distance = self.planes[node.plane as usize].signed_distance(center);
            if distance.abs() < radius {
                break;
            }
            at = node.children[usize::from(distance < 0.0)];
        }
        at
    }

    /// Returns the fragments that lie in a node's plane within its region.
    pub(super) fn fragments_on(&self, node: usize) -> &[Fragment] {
        let end = self
            .nodes
            .get(node + 1)
            .map_or(self.on_plane.len(), |n| n.on_start as usize);
        &self.on_plane[self.nodes[node].on_start as usize..end]
    }

    /// Calls `take` for each leaf on the side that a fragment faces.
    pub(super) fn leaves_before(&self, f: &Fragment, eps: f64, take: &mut impl FnMut(u32)) {
        self.descend(self.root, &f.points, f, eps, take);
    }

    fn descend(
        &self,
        child: i32,
        points: &[DVec3],
        f: &Fragment,
        eps: f64,
        take: &mut impl FnMut(u32),
    ) {
        if child < 0 {
            return take(leaf_index(child));
        }
        let node = &self.nodes[child as usize];
        if node.plane == f.plane {
            return self.descend(
                node.children[usize::from(f.is_flipped)],
                points,
                f,
                eps,
                take,
            );
        }
        let plane = &self.planes[node.plane as usize];
        match poly::split(points, plane, eps) {
            Sides::Front => self.descend(node.children[0], points, f, eps, take),
            Sides::Back => self.descend(node.children[1], points, f, eps, take),
            Sides::On => {
                let own = self.planes[f.plane as usize].normal;
                let looks_along = (own.dot(plane.normal) > 0.0) != f.is_flipped;
                self.descend(
                    node.children[usize::from(!looks_along)],
                    points,
                    f,
                    eps,
                    take,
                );
            }
            Sides::Both(a, b) => {
                self.descend(node.children[0], &a, f, eps, take);
                self.descend(node.children[1], &b, f, eps, take);
            }
        }
    }
}

/// Returns the leaf that a child value encodes.
pub(super) fn leaf_index(child: i32) -> u32 {
    (-1 - child) as u32
}

/// Builds the tree of all fragments.
pub(super) fn build(
    planes: Vec<Plane>,
    fragments: Vec<Fragment>,
    bounds: Aabb,
    heuristic: Heuristic,
    guide: &Guide,
    tolerance: &Tolerance,
    purse: Purse<'_>,
) -> Tree {
    let mut builder = Builder {
        tree: Tree {
            bounds,
            planes,
            nodes: Vec::new(),
            on_plane: Vec::new(),
            root: 0,
            contents: Vec::new(),
            n_splits: 0,
        },
        heuristic,
        tolerance: *tolerance,
        n_own_planes: 0,
        guide_ids: Vec::new(),
        purse,
    };
    builder.n_own_planes = builder.tree.planes.len() as u32;
    for plane in guide.planes(&bounds) {
        // A guide that coincides with a surface uses that surface's plane.
        let same = builder.tree.planes.iter().position(|p| {
            p.normal.dot(plane.normal).abs() > 1.0 - 1e-9
                && (p.d * p.normal.dot(plane.normal).signum() - plane.d).abs() < tolerance.plane
        });
        builder.guide_ids.push(same.map_or_else(
            || {
                builder.tree.planes.push(plane);
                builder.tree.planes.len() as u32 - 1
            },
            |i| i as u32,
        ));
    }
    let all: Vec<u32> = builder.guide_ids.clone();
    let root = builder.split_guided(fragments, &all, &bounds, Content::Unknown);
    let mut tree = builder.tree;
    tree.root = root;
    tree
}

struct Builder<'a> {
    tree: Tree,
    heuristic: Heuristic,
    tolerance: Tolerance,
    n_own_planes: u32,
    guide_ids: Vec<u32>,
    purse: Purse<'a>,
}

/// Measures of a splitter.
#[derive(Clone, Copy, Default)]
struct Count {
    front: u32,
    back: u32,
    cut: u32,
    on_area: f64,
    /// Sum over cut fragments of their deviation from orthogonal.
    skew: f64,
}

/// Candidates tried if a region contains many planes; the largest surfaces come first.
const CANDIDATES: usize = 160;
/// Fragments on which a candidate is tried.
const SAMPLE: usize = 2048;
/// Trials of a fragment above which candidates are tried in parallel.
const PARALLEL: usize = 20_000;

impl Builder<'_> {
    fn leaf(&mut self, content: Content) -> i32 {
        self.tree.contents.push(content);
        -(self.tree.contents.len() as i32)
    }

    /// Cuts first by the guides that pass through the region.
    fn split_guided(
        &mut self,
        fragments: Vec<Fragment>,
        guides: &[u32],
        bounds: &Aabb,
        content: Content,
    ) -> i32 {
        let crosses = |id: u32| {
            let p = &self.tree.planes[id as usize];
            let reach = p.normal.abs().dot(bounds.size()) * 0.5;
            p.signed_distance(bounds.center()).abs() < reach - self.tolerance.plane
        };
        let inside: Vec<u32> = guides.iter().copied().filter(|&g| crosses(g)).collect();
        let work = 1 + fragments.len() as u64;
        if inside.is_empty() || fragments.is_empty() || !self.purse.spend(work) {
            return self.split(fragments, content);
        }
        // The middle one, so that a grid makes a balanced tree.
        let center = bounds.center();
        let nearness = |id: u32| self.tree.planes[id as usize].signed_distance(center).abs();
        let plane = inside
            .iter()
            .copied()
            .min_by(|&a, &b| nearness(a).total_cmp(&nearness(b)).then(a.cmp(&b)))
            .unwrap_or(inside[0]);
        let rest: Vec<u32> = inside.into_iter().filter(|&g| g != plane).collect();
        let (node, front, back, contents) = self.cut(fragments, plane);
        let n = self.tree.planes[plane as usize];
        let (mut above, mut below) = (*bounds, *bounds);
        if let Some(axis) = (0..3).find(|&a| n.normal[a].abs() == 1.0) {
            let at = -n.d * n.normal[axis];
            let (up, down) = if n.normal[axis] > 0.0 {
                (&mut above, &mut below)
            } else {
                (&mut below, &mut above)
            };
            up.min[axis] = at;
            down.max[axis] = at;
        }
        let f = self.split_guided(front, &rest, &above, contents[0]);
        let b = self.split_guided(back, &rest, &below, contents[1]);
        self.tree.nodes[node].children = [f, b];
        node as i32
    }

    fn split(&mut self, fragments: Vec<Fragment>, content: Content) -> i32 {
        if fragments.is_empty() || !self.purse.spend(2 * fragments.len() as u64) {
            return self.leaf(content);
        }
        let plane = self.choose(&fragments);
        let (node, front, back, contents) = self.cut(fragments, plane);
        let f = self.split(front, contents[0]);
        let b = self.split(back, contents[1]);
        self.tree.nodes[node].children = [f, b];
        node as i32
    }

    /// Makes a node. Returns it, the fragments on either side, and the contents that surfaces in its plane imply.
    fn cut(
        &mut self,
        fragments: Vec<Fragment>,
        plane: u32,
    ) -> (usize, Vec<Fragment>, Vec<Fragment>, [Content; 2]) {
        let node = self.tree.nodes.len();
        self.tree.nodes.push(Node {
            plane,
            children: [0; 2],
            on_start: self.tree.on_plane.len() as u32,
        });
        let cut = self.tree.planes[plane as usize];
        let (mut front, mut back) = (
            Vec::with_capacity(fragments.len()),
            Vec::with_capacity(fragments.len()),
        );
        let mut looks = 0.0;
        for f in fragments {
            if f.plane == plane {
                looks += poly::area(&f.points) * if f.is_flipped { -1.0 } else { 1.0 };
                self.tree.on_plane.push(f);
                continue;
            }
            match poly::split(&f.points, &cut, self.tolerance.plane) {
                Sides::Front => front.push(f),
                Sides::Back => back.push(f),
                Sides::On => {
                    let along = self.tree.planes[f.plane as usize].normal.dot(cut.normal) > 0.0;
                    let is_flipped = f.is_flipped == along;
                    looks += poly::area(&f.points) * if is_flipped { -1.0 } else { 1.0 };
                    self.tree.on_plane.push(Fragment {
                        plane,
                        is_flipped,
                        ..f
                    });
                }
                Sides::Both(a, b) => {
                    self.tree.n_splits += 1;
                    back.push(Fragment { points: b, ..f });
                    front.push(Fragment { points: a, ..f });
                }
            }
        }
        let contents = if looks > 0.0 {
            [Content::Empty, Content::Solid]
        } else if looks < 0.0 {
            [Content::Solid, Content::Empty]
        } else {
            [Content::Unknown; 2]
        };
        (node, front, back, contents)
    }

    fn choose(&self, fragments: &[Fragment]) -> u32 {
        // Planes by the area of their surfaces, largest first.
        let mut areas: Vec<(u32, f64)> = fragments
            .iter()
            .map(|f| (f.plane, poly::area(&f.points)))
            .collect();
        areas.sort_unstable_by_key(|a| a.0);
        let mut by_plane: Vec<(u32, f64)> = areas
            .chunk_by(|a, b| a.0 == b.0)
            .map(|g| (g[0].0, g.iter().map(|a| a.1).sum()))
            .collect();
        by_plane.sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        if by_plane.len() == 1 || self.heuristic == Heuristic::MaxArea {
            return by_plane[0].0;
        }
        if self.heuristic == Heuristic::Default && by_plane.len() > CANDIDATES {
            // The largest, and some of the others: if all surfaces are small, any may be best.
            let step = (by_plane.len() - CANDIDATES / 2).div_ceil(CANDIDATES / 2);
            let others: Vec<(u32, f64)> = by_plane[CANDIDATES / 2..]
                .iter()
                .copied()
                .step_by(step)
                .collect();
            by_plane.truncate(CANDIDATES / 2);
            by_plane.extend(others);
        }
        let stride = match self.heuristic {
            Heuristic::Default => fragments.len().div_ceil(SAMPLE),
            _ => 1,
        };
        // Two trials take as long as a cut.
        let n_trials = by_plane.len() * fragments.len().div_ceil(stride);
        self.purse.spend(n_trials as u64 / 2);
        let score = |id: u32, area: f64| {
            let c = self.count(fragments, stride, id, area);
            match self.heuristic {
                Heuristic::MinCut => (f64::from(c.cut), -c.on_area),
                Heuristic::MaxOrtho => (c.skew / f64::from(c.cut.max(1)), f64::from(c.cut)),
                _ => {
                    // A cut fragment counts twice from here on, an unbalanced tree is deep, and deep regions are cut by
                    // more planes.
                    let lean = f64::from(c.front.abs_diff(c.back));
                    let n = f64::from(c.front + c.back + 1);
                    let is_axial = self.tree.planes[id as usize].normal.abs().max_element() == 1.0;
                    let oblique = if is_axial { 0.0 } else { 0.02 * n };
                    (
                        CUT_COST * f64::from(c.cut) + lean * LEAN_COST + oblique,
                        -c.on_area,
                    )
                }
            }
        };
        let order = |a: &((f64, f64), u32), b: &((f64, f64), u32)| {
            a.0.0
                .total_cmp(&b.0.0)
                .then(a.0.1.total_cmp(&b.0.1))
                .then(a.1.cmp(&b.1))
        };
        let scored = |&(id, area): &(u32, f64)| (score(id, area), id);
        let best = if by_plane.len() * fragments.len() / stride > PARALLEL {
            by_plane.par_iter().map(scored).min_by(order)
        } else {
            by_plane.iter().map(scored).min_by(order)
        };
        best.map_or(by_plane[0].0, |b| b.1)
    }

    fn count(&self, fragments: &[Fragment], stride: usize, id: u32, on_area: f64) -> Count {
        let plane = &self.tree.planes[id as usize];
        let eps = self.tolerance.plane;
        let mut c = Count {
            on_area,
            ..Count::default()
        };
        for f in fragments.iter().step_by(stride) {
            if f.plane == id {
                continue;
            }
            let (mut front, mut back) = (false, false);
            for &p in &f.points {
                let d = plane.signed_distance(p);
                front |= d > eps;
                back |= d < -eps;
            }
            if front && back {
                c.cut += 1;
                c.skew += self.tree.planes[f.plane as usize]
                    .normal
                    .dot(plane.normal)
                    .abs();
            }
            c.front += u32::from(front);
            c.back += u32::from(back);
        }
        c
    }
}

/// Cost of a cut, in fragments that lie on the wrong side of a perfect halving.
const CUT_COST: f64 = 40.0;
/// Cost of each surplus fragment on one side.
const LEAN_COST: f64 = 0.25;
