//! A locator of which a box is replaced by that of another locator.
//!
//! Both trees divide the same space. The old one is kept down to the smallest node that contains the box; below it, six planes
//! separate the box from what is around it, with a copy of what either tree has there. Nodes that no face of the box cuts are
//! copied as they are, so the time beside that is by the nodes at the faces.

use std::collections::BTreeSet;

use enfilade_cpg::{CellId, Locator, LocatorNode};
use enfilade_geom::{Aabb, DVec3, Plane};

use super::block::{Block, CUT};
use crate::complex::poly::{self, Sides};
use crate::complex::region::{Region, RegionShape, halves, shape_of, whole};

/// Smaller parts of a cell beyond the box do not make the cell reach there. [Units: wu³]
const CRUMB: f64 = 1e-7;

/// A locator with its planes as such.
pub(super) struct PlaneTree<'a> {
    locator: &'a Locator,
    planes: Vec<Plane>,
}

impl<'a> PlaneTree<'a> {
    pub(super) fn of(locator: &'a Locator) -> Self {
        let plane = |&[x, y, z, d]: &[f64; 4]| Plane {
            normal: DVec3::new(x, y, z),
            d,
        };
        Self {
            planes: locator.planes.iter().map(plane).collect(),
            locator,
        }
    }

    fn node(&self, at: i32) -> (&Plane, [i32; 2]) {
        let node = &self.locator.nodes[at as usize];
        (&self.planes[node.plane as usize], node.children)
    }

    /// Calls `take` with each part of a convex polygon, and the leaf on the side to which `toward` points.
    pub(super) fn divide(
        &self,
        points: &[DVec3],
        toward: DVec3,
        take: &mut dyn FnMut(i32, &[DVec3]),
    ) {
        self.push_down(self.locator.root, points, toward, take);
    }

    fn push_down(
        &self,
        at: i32,
        points: &[DVec3],
        toward: DVec3,
        take: &mut dyn FnMut(i32, &[DVec3]),
    ) {
        if at < 0 {
            return take(at, points);
        }
        let (plane, children) = self.node(at);
        match poly::split(points, plane, CUT) {
            Sides::Front => self.push_down(children[0], points, toward, take),
            Sides::Back => self.push_down(children[1], points, toward, take),
            Sides::On => {
                let side = usize::from(toward.dot(plane.normal) < 0.0);
                self.push_down(children[side], points, toward, take);
            }
            Sides::Both(f, b) => {
                self.push_down(children[0], &f, toward, take);
                self.push_down(children[1], &b, toward, take);
            }
        }
    }

    /// Adds the cells on either side of a convex polygon; parts nearer to a plane than `eps` lie in it, and narrower ones are the
    /// result of rounding.
    pub(super) fn beside(&self, points: &[DVec3], eps: f64, cells: &mut BTreeSet<CellId>) {
        let least = eps.min(0.25 * poly::width(points));
        let mut stack = vec![(self.locator.root, poly::Poly::from_slice(points))];
        while let Some((at, points)) = stack.pop() {
            if at < 0 {
                cells.extend(cell_of(at));
                continue;
            }
            let (plane, children) = self.node(at);
            match poly::split(&points, plane, eps) {
                Sides::Front => stack.push((children[0], points)),
                Sides::Back => stack.push((children[1], points)),
                Sides::On => stack.extend(children.map(|c| (c, points.clone()))),
                Sides::Both(f, b) => {
                    let parts = children.into_iter().zip([f, b]);
                    stack.extend(parts.filter(|(_, part)| poly::is_larger(part, 0.0, least)));
                }
            }
        }
    }

    /// Calls `take` with the leaf, the shape and the box of each part of a region, of those leaves that `wants` accepts.
    pub(super) fn parts(
        &self,
        region: Region,
        wants: &dyn Fn(i32) -> bool,
        take: &mut dyn FnMut(i32, RegionShape, Aabb),
    ) {
        let n = self.locator.nodes.len();
        let mut is_above = vec![false; n];
        for i in (0..n).rev() {
            let mut children = self.locator.nodes[i].children.into_iter();
            is_above[i] = children.any(|c| {
                if c < 0 {
                    wants(c)
                } else {
                    is_above[c as usize]
                }
            });
        }
        let is_wanted = |c: i32| {
            if c < 0 {
                wants(c)
            } else {
                is_above[c as usize]
            }
        };
        let mut stack = vec![(self.locator.root, region)];
        while let Some((at, region)) = stack.pop() {
            if !is_wanted(at) {
                continue;
            }
            if at < 0 {
                if let Some(shape) = shape_of(&region) {
                    let points = region.iter().flat_map(|(_, points)| points);
                    take(at, shape, Aabb::of_points(points));
                }
                continue;
            }
            let (plane, children) = self.node(at);
            let parts = halves(region, plane, &self.locator.bounds, CUT);
            stack.extend(children.into_iter().zip(parts).filter(|c| c.1.len() >= 4));
        }
    }
}

/// The cell of a leaf.
pub(super) fn cell_of(leaf: i32) -> Option<CellId> {
    (leaf <= -2).then(|| CellId((-2 - leaf) as u32))
}

/// An old locator that is being copied with another one in a box.
pub(super) struct LocatorSplice<'a> {
    bounds: Aabb,
    block: &'a Block,
    out: Locator,
    /// The node, and the child of it, that is to become what is in the box; the root if none.
    hole: Option<(usize, usize)>,
    /// For each old cell, `true` if it reaches beyond the box.
    pub(super) is_beyond: Vec<bool>,
}

impl<'a> LocatorSplice<'a> {
    /// Copies the nodes of the old tree outside the box, and leaves a hole for those inside.
    pub(super) fn around(old: &PlaneTree<'_>, block: &'a Block, n_cells: usize) -> Self {
        let bounds = old.locator.bounds;
        let mut splice = Self {
            bounds,
            block,
            out: Locator {
                bounds,
                outside: old.locator.outside,
                planes: old.locator.planes.clone(),
                nodes: Vec::with_capacity(old.locator.nodes.len() + 64),
                root: old.locator.root,
            },
            hole: None,
            is_beyond: vec![false; n_cells],
        };
        let same: Vec<u32> = (0..old.planes.len() as u32).collect();
        let mut copy = Copying {
            tree: old,
            plane_of: same,
            leaf_of: &|leaf| leaf,
        };
        splice.descend(&mut copy, whole(&bounds, CUT));
        splice
    }

    /// Copies what is in the box: from `new`, whose leaves become those that `leaf_of` returns.
    pub(super) fn filled(mut self, new: &PlaneTree<'_>, leaf_of: &dyn Fn(i32) -> i32) -> Locator {
        let mut copy = Copying {
            tree: new,
            plane_of: vec![u32::MAX; new.planes.len()],
            leaf_of,
        };
        let region = self.block.region.clone();
        let inner = self.copy(&mut copy, new.locator.root, region, None);
        self.fill(inner);
        self.out
    }

    fn fill(&mut self, child: i32) {
        match self.hole {
            Some((node, side)) => self.out.nodes[node].children[side] = child,
            None => self.out.root = child,
        }
    }

    /// Pushes a node into the hole; the hole is then its child `side`.
    fn push(&mut self, plane: u32, side: usize) -> usize {
        let at = self.out.nodes.len();
        self.out.nodes.push(LocatorNode {
            plane,
            children: [Locator::leaf(None); 2],
        });
        self.fill(at as i32);
        self.hole = Some((at, side));
        at
    }

    /// Copies the old tree down to the box, then all around it.
    fn descend(&mut self, copy: &mut Copying<'_>, mut region: Region) {
        let mut at = copy.tree.locator.root;
        while at >= 0 {
            let (plane, children) = copy.tree.node(at);
            let plane = *plane;
            let corners = self.block.region.iter().flat_map(|(_, points)| points);
            let (low, high) = corners.fold((f64::MAX, f64::MIN), |(low, high), &p| {
                let d = plane.signed_distance(p);
                (low.min(d), high.max(d))
            });
            let side = match (low >= 0.0, high < 0.0) {
                (true, _) => 0,
                (_, true) => 1,
                _ => break,
            };
            let id = copy.tree.locator.nodes[at as usize].plane;
            let node = self.push(id, side);
            let [front, back] = halves(region, &plane, &self.bounds, CUT);
            let other = self.copy_whole(copy, children[1 - side], true);
            self.out.nodes[node].children[1 - side] = other;
            region = if side == 0 { front } else { back };
            at = children[side];
        }
        for (k, plane) in self.block.planes.iter().enumerate() {
            let [inside, outside] = halves(region, plane, &self.bounds, CUT);
            region = inside;
            if shape_of(&outside).is_none() {
                continue;
            }
            let id = self.out.planes.len() as u32;
            let Plane { normal: n, d } = *plane;
            self.out.planes.push([n.x, n.y, n.z, d]);
            let node = self.push(id, 0);
            let other = self.copy(copy, at, outside, Some(k));
            self.out.nodes[node].children[1] = other;
        }
    }

    /// Copies the part of a subtree in a region, which is bounded by faces of the box: by those up to one, for what is
    /// beyond that one, or by all.
    fn copy(
        &mut self,
        copy: &mut Copying<'_>,
        at: i32,
        region: Region,
        beyond: Option<usize>,
    ) -> i32 {
        let is_limit = |plane: &Plane| {
            let faces = self.block.planes.iter();
            let mut faces = faces.take(beyond.map_or(6, |k| k + 1));
            faces.any(|f| f == plane || f.flipped() == *plane)
        };
        if at < 0 || !region.iter().any(|(plane, _)| is_limit(plane)) {
            let is_old = beyond.is_some();
            let crumb = at < 0 && shape_of(&region).is_none_or(|s| s.volume < CRUMB);
            return self.copy_whole(copy, at, is_old && !crumb);
        }
        let (plane, children) = copy.tree.node(at);
        let id = copy.tree.locator.nodes[at as usize].plane;
        let parts = halves(region, plane, &self.bounds, CUT);
        let is_there = parts.each_ref().map(|part| shape_of(part).is_some());
        let [front, back] = parts;
        match is_there {
            [true, false] => return self.copy(copy, children[0], front, beyond),
            [false, true] => return self.copy(copy, children[1], back, beyond),
            _ => {}
        }
        let node = self.out.nodes.len();
        let plane = copy.plane(id, &mut self.out);
        self.out.nodes.push(LocatorNode {
            plane,
            children: [0; 2],
        });
        let children = [
            self.copy(copy, children[0], front, beyond),
            self.copy(copy, children[1], back, beyond),
        ];
        // One leaf again where the other side of a plane is cut off.
        if children[0] == children[1] && children[0] < 0 {
            self.out.nodes.truncate(node);
            return children[0];
        }
        self.out.nodes[node].children = children;
        node as i32
    }

    /// Copies a subtree as it is; its cells are beyond the box if `is_beyond`.
    fn copy_whole(&mut self, copy: &mut Copying<'_>, at: i32, is_beyond: bool) -> i32 {
        if at < 0 {
            if is_beyond && let Some(cell) = cell_of(at) {
                self.is_beyond[cell.0 as usize] = true;
            }
            return (copy.leaf_of)(at);
        }
        let old = copy.tree.locator.nodes[at as usize];
        let node = self.out.nodes.len();
        let plane = copy.plane(old.plane, &mut self.out);
        self.out.nodes.push(LocatorNode {
            plane,
            children: [0; 2],
        });
        let children = old.children.map(|c| self.copy_whole(copy, c, is_beyond));
        self.out.nodes[node].children = children;
        node as i32
    }
}

/// The tree that is copied from.
struct Copying<'a> {
    tree: &'a PlaneTree<'a>,
    /// Number of each of its planes in the copy, if known.
    plane_of: Vec<u32>,
    leaf_of: &'a dyn Fn(i32) -> i32,
}

impl Copying<'_> {
    fn plane(&mut self, plane: u32, out: &mut Locator) -> u32 {
        let known = &mut self.plane_of[plane as usize];
        if *known == u32::MAX {
            *known = out.planes.len() as u32;
            out.planes.push(self.tree.locator.planes[plane as usize]);
        }
        *known
    }
}
