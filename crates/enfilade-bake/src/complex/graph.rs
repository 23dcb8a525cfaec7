//! The first visit: which leaves are open to each other, how widely, and how large they are.

use std::ops::Range;

use enfilade_geom::{Aabb, DVec3};

use super::facet::{FacetSink, OpenPieces, RawFacet, Visitor};
use super::poly::{self, Poly, Sides};
use super::tree::{Tree, leaf_index};

/// No screen.
pub(super) const NO_SCREEN: u32 = u32::MAX;

/// An opening between two leaves, on one screen or on none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OpenFacet {
    /// Leaves on the positive and on the negative side of its plane.
    pub(super) leaves: [u32; 2],
    /// Width of its widest piece.
    pub(super) width: f32,
    /// Area of all its pieces.
    pub(super) area: f32,
    /// The screen that it lies on, or [`NO_SCREEN`].
    pub(super) screen: u32,
}

/// What the first visit finds out.
pub(super) struct LeafGraph {
    /// Openings, in the order of the tree.
    pub(super) facets: Vec<OpenFacet>,
    /// Volume of each leaf.
    pub(super) volumes: Vec<f64>,
    /// Whether each leaf touches the border of the box.
    pub(super) at_border: Vec<bool>,
    /// Openings narrower than this make no portal.
    pub(super) hairline: f32,
}

impl LeafGraph {
    /// Visits the whole tree.
    pub(super) fn of(visitor: &Visitor<'_>) -> Self {
        let tree = visitor.tree;
        let origin = tree.bounds.center();
        let mut sink = Sink {
            visitor,
            origin,
            first_leaf: 0,
            facets: Vec::new(),
            volumes: vec![0.0; tree.n_leaves as usize],
        };
        visitor.visit(&mut sink);
        let Sink {
            facets,
            mut volumes,
            ..
        } = sink;
        let mut at_border = vec![false; tree.n_leaves as usize];
        for (face, outward) in box_faces(&tree.bounds) {
            sides_of_border(
                tree,
                tree.root,
                &face,
                visitor.tolerance.cut,
                &mut |leaf, piece| {
                    at_border[leaf as usize] = true;
                    volumes[leaf as usize] += cone_volume(piece, outward, origin);
                },
            );
        }
        // Degenerate leaves come out as noise about zero.
        for v in &mut volumes {
            *v = v.max(0.0);
        }
        Self {
            facets,
            volumes,
            at_border,
            hairline: visitor.tolerance.width as f32,
        }
    }
}

/// Signed volume of the cone from `origin` over a polygon: what divergence sums up.
fn cone_volume(points: &[DVec3], normal: DVec3, origin: DVec3) -> f64 {
    poly::area(points) * normal.dot(points[0] - origin) / 3.0
}

/// The six faces of a box with their outward normals.
pub(super) fn box_faces(b: &Aabb) -> [(Poly, DVec3); 6] {
    std::array::from_fn(|i| {
        let (axis, high) = (i % 3, i >= 3);
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let face = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(pu, pv)| {
            let mut p = if high { b.max } else { b.min };
            p[u] = [b.min[u], b.max[u]][pu];
            p[v] = [b.min[v], b.max[v]][pv];
            p
        });
        let mut normal = DVec3::ZERO;
        normal[axis] = if high { 1.0 } else { -1.0 };
        (Poly::from_slice(&face), normal)
    })
}

/// Pushes a polygon down the tree and hands out its piece of every leaf.
pub(super) fn sides_of_border(
    tree: &Tree,
    child: i32,
    points: &[DVec3],
    eps: f64,
    take: &mut impl FnMut(u32, &[DVec3]),
) {
    if child < 0 {
        return take(leaf_index(child), points);
    }
    let node = &tree.nodes[child as usize];
    match poly::split(points, &tree.planes[node.plane as usize], eps) {
        Sides::Front | Sides::On => sides_of_border(tree, node.children[0], points, eps, take),
        Sides::Back => sides_of_border(tree, node.children[1], points, eps, take),
        Sides::Both(f, b) => {
            sides_of_border(tree, node.children[0], &f, eps, take);
            sides_of_border(tree, node.children[1], &b, eps, take);
        }
    }
}

struct Sink<'a> {
    visitor: &'a Visitor<'a>,
    origin: DVec3,
    first_leaf: u32,
    facets: Vec<OpenFacet>,
    /// Of the leaves from `first_leaf` on.
    volumes: Vec<f64>,
}

impl FacetSink for Sink<'_> {
    fn take(&mut self, facet: &RawFacet<'_>) {
        let normal = self.visitor.tree.planes[facet.plane as usize].normal;
        let cone = cone_volume(facet.points, normal, self.origin);
        let [front, back] = facet.leaves.map(|l| (l - self.first_leaf) as usize);
        self.volumes[front] -= cone;
        self.volumes[back] += cone;
        let first = self.facets.len();
        for (piece, screen) in OpenPieces::of(facet, normal, &self.visitor.tolerance).pieces {
            let screen = screen.unwrap_or(NO_SCREEN);
            let (width, area) = (poly::width(&piece) as f32, poly::area(&piece) as f32);
            match self.facets[first..].iter_mut().find(|f| f.screen == screen) {
                Some(f) => {
                    f.width = f.width.max(width);
                    f.area += area;
                }
                None => {
                    self.facets.push(OpenFacet {
                        leaves: facet.leaves,
                        width,
                        area,
                        screen,
                    });
                }
            }
        }
    }

    fn fork(&self, leaves: Range<u32>) -> Self {
        Self {
            visitor: self.visitor,
            origin: self.origin,
            first_leaf: leaves.start,
            facets: Vec::new(),
            volumes: vec![0.0; leaves.len()],
        }
    }

    fn join(&mut self, front: Self, back: Self) {
        for part in [front, back] {
            if self.facets.is_empty() {
                self.facets = part.facets;
            } else {
                self.facets.extend_from_slice(&part.facets);
            }
            let at = (part.first_leaf - self.first_leaf) as usize;
            for (sum, v) in self.volumes[at..].iter_mut().zip(&part.volumes) {
                *sum += v;
            }
        }
    }
}
