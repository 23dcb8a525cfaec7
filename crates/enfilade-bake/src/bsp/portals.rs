//! Portals between leaves: each node's plane, clipped to its region and cut by both subtrees
//! (Lefebvre & Hornus 2003, notes after §3.0.2).

use enfilade_geom::{DVec3, Plane, Purse};
use smallvec::SmallVec;

use crate::complex::poly::{self, Poly, Sides};

use super::tolerance::Tolerance;
use super::tree::{Content, Fragment, Tree, leaf_index};

/// A convex opening between two leaves.
#[derive(Clone, Debug)]
pub(super) struct LeafPortal {
    /// Leaves on the positive and on the negative side of its plane.
    pub(super) leaves: [u32; 2],
    /// Index into [`Tree::planes`].
    pub(super) plane: u32,
    /// Vertices, counter-clockwise about the plane's normal.
    pub(super) points: Poly,
}

/// Returns all openings between leaves that are not solid, without the surfaces in their planes.
pub(super) fn leaf_portals(
    tree: &Tree,
    tolerance: &Tolerance,
    purse: Purse<'_>,
) -> Vec<LeafPortal> {
    let mut visitor = Visitor {
        tree,
        tolerance: *tolerance,
        purse,
        all_solid: vec![false; tree.nodes.len()],
        out: Vec::new(),
    };
    // Children come after their parents.
    for i in (0..tree.nodes.len()).rev() {
        visitor.all_solid[i] = tree.nodes[i].children.iter().all(|&c| visitor.is_solid(c));
    }
    visitor.node(tree.root, &mut SmallVec::new());
    visitor.out
}

struct Visitor<'a> {
    tree: &'a Tree,
    tolerance: Tolerance,
    purse: Purse<'a>,
    all_solid: Vec<bool>,
    out: Vec<LeafPortal>,
}

type Cuts = SmallVec<[Plane; 32]>;

impl Visitor<'_> {
    fn is_solid(&self, child: i32) -> bool {
        if child >= 0 {
            self.all_solid[child as usize]
        } else {
            self.tree.contents[leaf_index(child) as usize] == Content::Solid
        }
    }

    fn node(&mut self, child: i32, cuts: &mut Cuts) {
        if child < 0 || self.is_solid(child) || !self.purse.spend(2 + cuts.len() as u64) {
            return;
        }
        let node = self.tree.nodes[child as usize];
        let plane = self.tree.planes[node.plane as usize];
        for (side, cut) in [plane, plane.flipped()].into_iter().enumerate() {
            cuts.push(cut);
            self.node(node.children[side], cuts);
            cuts.pop();
        }
        if node.children.iter().any(|&c| self.is_solid(c)) {
            return;
        }
        let Some(mut points) = poly::section_of_box(&plane, &self.tree.bounds, self.tolerance.cut)
        else {
            return;
        };
        // Nearest cuts first: they leave the least for the others.
        for cut in cuts.iter().rev() {
            match poly::clip(&points, cut, self.tolerance.cut) {
                Some(p) => points = p,
                None => return,
            }
        }
        let covers = self.tree.fragments_on(child as usize);
        self.push_down(node.plane, &points, covers, node.children);
    }

    fn push_down(&mut self, plane: u32, points: &[DVec3], covers: &[Fragment], children: [i32; 2]) {
        if children.iter().any(|&c| self.is_solid(c)) || !self.purse.spend(2) {
            return;
        }
        let Some(at) = (0..2).find(|&i| children[i] >= 0) else {
            return self.take(plane, points, covers, children.map(leaf_index));
        };
        let node = &self.tree.nodes[children[at] as usize];
        let with = |child: usize| {
            let mut next = children;
            next[at] = node.children[child];
            next
        };
        let cut = &self.tree.planes[node.plane as usize];
        match poly::split(points, cut, self.tolerance.cut) {
            Sides::Front => self.push_down(plane, points, covers, with(0)),
            Sides::Back => self.push_down(plane, points, covers, with(1)),
            Sides::On => {
                let sum: f64 = points.iter().map(|&p| cut.signed_distance(p)).sum();
                self.push_down(plane, points, covers, with(usize::from(sum < 0.0)));
            }
            Sides::Both(a, b) => {
                self.push_down(plane, &a, covers, with(0));
                self.push_down(plane, &b, covers, with(1));
            }
        }
    }

    fn take(&mut self, plane: u32, points: &[DVec3], covers: &[Fragment], leaves: [u32; 2]) {
        let normal = self.tree.planes[plane as usize].normal;
        let mut rest: Vec<Poly> = vec![points.into()];
        for c in covers {
            if !self.purse.spend(1 + rest.len() as u64) {
                return;
            }
            let mut cover = c.points.clone();
            if poly::area_normal(&cover).dot(normal) < 0.0 {
                cover.reverse();
            }
            let mut outside = Vec::with_capacity(rest.len());
            for p in &rest {
                let _ = poly::cut_out(p, &cover, normal, self.tolerance.cut, 0.0, &mut outside);
            }
            rest = outside;
        }
        rest.retain(|p| poly::width(p) > self.tolerance.width);
        self.out.extend(rest.into_iter().map(|points| LeafPortal {
            leaves,
            plane,
            points,
        }));
    }
}
