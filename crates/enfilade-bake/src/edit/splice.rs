//! A locator with the leaves of one cell divided.

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, Locator, LocatorNode};
use enfilade_geom::{Aabb, DVec3, Plane};

use crate::complex::poly::{self, Sides};
use crate::complex::region::{Region, halves, shape_of, whole};

/// Distance from a plane within which vertices are on it when regions are cut; planes are exact. [Units: wu]
const CUT: f64 = 1e-9;

/// Marks a leaf on neither side: matter, or another cell.
const NONE: i32 = -1;

/// A tree that separates the two sides of a cut cell; for points beyond the cell, its answer is arbitrary.
pub(super) struct SideTree {
    planes: Vec<Plane>,
    /// Plane and children: a node, or `-2 - side`.
    nodes: Vec<(u32, [i32; 2])>,
    root: i32,
}

impl SideTree {
    /// Makes the tree of a locator whose cells are the sides; leaves on neither side join the space across their
    /// planes.
    pub(super) fn of(locator: &Locator) -> Self {
        let plane = |&[x, y, z, d]: &[f64; 4]| Plane {
            normal: DVec3::new(x, y, z),
            d,
        };
        let mut out = Self {
            planes: locator.planes.iter().map(plane).collect(),
            nodes: locator
                .nodes
                .iter()
                .map(|n| (n.plane, n.children))
                .collect(),
            root: locator.root,
        };
        // Children come after their parents.
        let mut becomes = vec![NONE; out.nodes.len()];
        let resolve = |becomes: &[i32], c: i32| if c >= 0 { becomes[c as usize] } else { c };
        for i in (0..out.nodes.len()).rev() {
            let children = out.nodes[i].1.map(|c| resolve(&becomes, c));
            out.nodes[i].1 = children;
            becomes[i] = match children {
                [NONE, c] | [c, NONE] => c,
                [f, b] if f == b && f < 0 => f,
                _ => i as i32,
            };
        }
        out.root = resolve(&becomes, out.root);
        out
    }

    /// Calls `take` with the parts of a convex polygon on the border of the cell, each with the side on which it
    /// borders; `inward` points from the border into the cell. Parts nearer to a plane than `eps` lie in it.
    pub(super) fn divide(
        &self,
        points: &[DVec3],
        inward: DVec3,
        eps: f64,
        take: &mut dyn FnMut(u32, &[DVec3]),
    ) {
        self.push_down(self.root, points, inward, eps, take);
    }

    fn push_down(
        &self,
        child: i32,
        points: &[DVec3],
        inward: DVec3,
        eps: f64,
        take: &mut dyn FnMut(u32, &[DVec3]),
    ) {
        if child < 0 {
            if child != NONE {
                take((-2 - child) as u32, points);
            }
            return;
        }
        let (plane, children) = self.nodes[child as usize];
        let plane = &self.planes[plane as usize];
        match poly::split(points, plane, eps) {
            Sides::Front => self.push_down(children[0], points, inward, eps, take),
            Sides::Back => self.push_down(children[1], points, inward, eps, take),
            Sides::On => {
                let behind = usize::from(inward.dot(plane.normal) < 0.0);
                self.push_down(children[behind], points, inward, eps, take);
            }
            Sides::Both(f, b) => {
                self.push_down(children[0], &f, inward, eps, take);
                self.push_down(children[1], &b, inward, eps, take);
            }
        }
    }
}

/// Returns `old` with the leaves of `cell` replaced by those of `ids` that `sides` selects.
pub(super) fn spliced(old: &Locator, cell: CellId, sides: &SideTree, ids: [CellId; 2]) -> Locator {
    let leaf = Locator::leaf(Some(cell));
    let mut has_cell = vec![false; old.nodes.len()];
    for i in (0..old.nodes.len()).rev() {
        has_cell[i] = old.nodes[i]
            .children
            .iter()
            .any(|&c| c == leaf || (c >= 0 && has_cell[c as usize]));
    }
    let mut splice = Splice {
        old,
        leaf,
        has_cell,
        sides,
        ids,
        plane_of: BTreeMap::new(),
        out: Locator {
            nodes: Vec::with_capacity(old.nodes.len()),
            bounds: old.bounds,
            outside: old.outside,
            planes: old.planes.clone(),
            root: old.root,
        },
    };
    let region = whole(&old.bounds, CUT);
    splice.out.root = splice.copy(old.root, region);
    splice.out
}

struct Splice<'a> {
    old: &'a Locator,
    /// The value of the cell's leaves.
    leaf: i32,
    /// `true` for each node with such a leaf below it.
    has_cell: Vec<bool>,
    sides: &'a SideTree,
    ids: [CellId; 2],
    /// Planes of `sides` in `out`.
    plane_of: BTreeMap<u32, u32>,
    out: Locator,
}

impl Splice<'_> {
    /// Appends a subtree of the old locator; `region` is valid as long as the cell is in the subtree.
    fn copy(&mut self, child: i32, region: Region) -> i32 {
        if child < 0 {
            return if child == self.leaf {
                self.insert(self.sides.root, region)
            } else {
                child
            };
        }
        let node = self.old.nodes[child as usize];
        let at = self.out.nodes.len();
        self.out.nodes.push(node);
        let parts = if self.has_cell[child as usize] {
            let [x, y, z, d] = self.old.planes[node.plane as usize];
            let plane = Plane {
                normal: DVec3::new(x, y, z),
                d,
            };
            self.halves(region, &plane)
        } else {
            [Region::new(), Region::new()]
        };
        let [front, back] = parts;
        let children = [
            self.copy(node.children[0], front),
            self.copy(node.children[1], back),
        ];
        self.out.nodes[at].children = children;
        at as i32
    }

    /// Appends the part of the side tree within a region.
    fn insert(&mut self, child: i32, region: Region) -> i32 {
        if child < 0 {
            // If neither side occurs anywhere, the cell is unchanged.
            let side = usize::from(child == -3);
            return Locator::leaf(Some(self.ids[side]));
        }
        let (plane, children) = self.sides.nodes[child as usize];
        let parts = self.halves(region.clone(), &self.sides.planes[plane as usize]);
        let volume = parts
            .each_ref()
            .map(|r| shape_of(r).map_or(0.0, |s| s.volume));
        if volume.contains(&0.0) {
            let into = usize::from(volume[1] > volume[0]);
            return self.insert(children[into], region);
        }
        let at = self.out.nodes.len();
        let planes = &mut self.out.planes;
        let id = *self.plane_of.entry(plane).or_insert_with(|| {
            let p = self.sides.planes[plane as usize];
            planes.push([p.normal.x, p.normal.y, p.normal.z, p.d]);
            planes.len() as u32 - 1
        });
        self.out.nodes.push(LocatorNode {
            plane: id,
            children: [0; 2],
        });
        let [front, back] = parts;
        let new = [
            self.insert(children[0], front),
            self.insert(children[1], back),
        ];
        if new[0] == new[1] && new[0] < 0 {
            self.out.nodes.truncate(at);
            return new[0];
        }
        self.out.nodes[at].children = new;
        at as i32
    }

    fn halves(&self, region: Region, plane: &Plane) -> [Region; 2] {
        let bounds: Aabb = self.old.bounds;
        halves(region, plane, &bounds, CUT)
    }
}
