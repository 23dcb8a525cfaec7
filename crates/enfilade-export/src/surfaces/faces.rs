//! The exact faces between cells, from the tree that locates points.
//!
//! The leaves of the tree are convex, so a cell's boundary is made of the parts of the tree's planes that have the cell on one
//! side only. As in Thibault & Naylor, "Set operations on polyhedra using binary space partitioning trees" (SIGGRAPH 1987, §5):
//! the section of each node's plane with the node's region is passed down both subtrees. **Complexity:** O(faces × depth).
//! **Numerics:** splits have no tolerance, so that the faces of a leaf close up to the rounding of `f64`.

use enfilade_cpg::{CellId, Locator};
use enfilade_geom::poly::{self, Poly, Sides};
use enfilade_geom::{DVec3, Plane};

/// Faces that are smaller are left by rounding. [Units: wu²]
const SPECK: f64 = 1e-10;

/// A convex polygon between two spaces.
pub(crate) struct Face {
    /// Counter-clockwise seen from the space in front. [Units: wu]
    pub(crate) points: Poly,
    /// Unit normal into the space in front.
    pub(crate) normal: DVec3,
    /// The spaces in front and behind; `None` is matter.
    pub(crate) sides: [Option<CellId>; 2],
}

/// Returns all faces between different cells, and between cells and matter, in the order of the tree.
pub(crate) fn faces_between_cells(locator: &Locator) -> Vec<Face> {
    let mut walk = Walk {
        locator,
        path: Vec::new(),
        faces: Vec::new(),
    };
    walk.visit(locator.root);
    walk.border();
    walk.faces
}

struct Walk<'l> {
    locator: &'l Locator,
    /// Planes around the region of the current node, facing inwards.
    path: Vec<Plane>,
    faces: Vec<Face>,
}

impl Walk<'_> {
    fn plane_of(&self, node: i32) -> (Plane, [i32; 2]) {
        let node = &self.locator.nodes[node as usize];
        let [x, y, z, d] = self.locator.planes[node.plane as usize];
        let normal = DVec3::new(x, y, z);
        (Plane { normal, d }, node.children)
    }

    fn visit(&mut self, at: i32) {
        if at < 0 {
            return;
        }
        let (plane, children) = self.plane_of(at);
        if let Some(section) = self.section(&plane) {
            self.divide(section, plane.normal, children.map(Some));
        }
        for (child, inward) in children.into_iter().zip([plane, plane.flipped()]) {
            self.path.push(inward);
            self.visit(child);
            self.path.pop();
        }
    }

    /// Returns the section of a plane with the current region; `None` on its border, where the node of that plane has it, or the box.
    fn section(&self, plane: &Plane) -> Option<Poly> {
        let bounds = &self.locator.bounds;
        let mut sides = bounds
            .corners()
            .map(|p| plane.signed_distance(p))
            .into_iter();
        if sides.clone().all(|d| d >= 0.0) || sides.all(|d| d <= 0.0) {
            return None;
        }
        let mut section = poly::section_of_box(plane, bounds, 0.0).filter(|s| s.len() > 2)?;
        for side in &self.path {
            match poly::split(&section, side, 0.0) {
                Sides::Front => {}
                Sides::Both(front, _) => section = front,
                Sides::On | Sides::Back => return None,
            }
        }
        Some(section)
    }

    /// Adds the faces in the sides of the box.
    fn border(&mut self) {
        let bounds = self.locator.bounds;
        if bounds.is_empty() {
            return;
        }
        let center = bounds.center();
        for corners in bounds.faces() {
            let mut points: Poly = corners.as_slice().into();
            let normal = poly::area_normal(&points).normalize_or_zero();
            let inward = if normal.dot(center - corners[0]) < 0.0 {
                points.reverse();
                -normal
            } else {
                normal
            };
            self.divide(points, inward, [Some(self.locator.root), None]);
        }
    }

    /// Divides a polygon by the leaves on both sides, the one in front first; `None` is beyond the box.
    fn divide(&mut self, polygon: Poly, normal: DVec3, roots: [Option<i32>; 2]) {
        let mut in_front = Vec::new();
        self.descend(roots[0], polygon, normal, &mut in_front);
        let mut both = Vec::new();
        for (front, part) in in_front {
            both.clear();
            self.descend(roots[1], part, -normal, &mut both);
            for (back, points) in both.drain(..) {
                if front != back && poly::area(&points) > SPECK {
                    self.faces.push(Face {
                        points,
                        normal,
                        sides: [front, back],
                    });
                }
            }
        }
    }

    /// Divides a polygon on the border of a subtree's region, which lies in the direction of `inward`.
    fn descend(
        &self,
        root: Option<i32>,
        polygon: Poly,
        inward: DVec3,
        parts: &mut Vec<(Option<CellId>, Poly)>,
    ) {
        let Some(root) = root else {
            return parts.push((self.locator.outside, polygon));
        };
        let mut stack = vec![(root, polygon)];
        while let Some((at, polygon)) = stack.pop() {
            if at < 0 {
                parts.push(((at <= -2).then(|| CellId((-2 - at) as u32)), polygon));
                continue;
            }
            let (plane, children) = self.plane_of(at);
            match poly::split(&polygon, &plane, 0.0) {
                Sides::On => {
                    let is_front = plane.normal.dot(inward) > 0.0;
                    stack.push((children[usize::from(!is_front)], polygon));
                }
                Sides::Front => stack.push((children[0], polygon)),
                Sides::Back => stack.push((children[1], polygon)),
                Sides::Both(front, back) => {
                    stack.push((children[1], back));
                    stack.push((children[0], front));
                }
            }
        }
    }
}
