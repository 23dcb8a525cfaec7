//! Convex solids: intersections of half-spaces, such as brushes.

use crate::{Aabb, DMat3, DVec3, Plane, Purse, Winding};

/// A bounded convex solid.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvexSolid {
    /// Planes of its faces, facing outwards; planes that bound no face are left out.
    pub planes: Vec<Plane>,
    /// One face per plane, counter-clockwise seen from outside; vertices are shared exactly.
    pub faces: Vec<Winding>,
    /// Per face, the index of its plane among those given.
    pub sources: Vec<u32>,
}

/// Reason why planes bound no solid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SolidError {
    /// No point is behind all planes: the solid is empty, flat, or its planes face inwards.
    Empty,
    /// The solid is unbounded: a side is missing.
    Unbounded,
}

impl ConvexSolid {
    /// Makes the solid behind all of `planes`.
    ///
    /// Finds faces by clipping, then solves each vertex anew from the three planes that meet there and uses
    /// that one point in all faces around it, so that the surface is closed to the last bit. Merges vertices
    /// closer than `eps`. `reach` is the largest coordinate of a bounded solid. `O(n²)` for `n` planes.
    ///
    /// # Errors
    /// If the planes bound nothing, or leave the solid unbounded.
    pub fn from_planes(planes: &[Plane], reach: f64, eps: f64) -> Result<Self, SolidError> {
        /// Vertices of a face, each with the plane that made its edge.
        type Edged = Vec<(DVec3, u32)>;
        let mut corners: Vec<DVec3> = Vec::new();
        let mut solid = Self {
            planes: Vec::new(),
            faces: Vec::new(),
            sources: Vec::new(),
        };
        for (i, plane) in planes.iter().enumerate() {
            // A repeated plane bounds the same face once.
            let is_same =
                |o: &Plane| plane.normal.dot(o.normal) > 1.0 - 1e-12 && (plane.d - o.d).abs() < eps;
            if planes[..i].iter().any(is_same) {
                continue;
            }
            let mut face: Edged = Winding::square(plane, DVec3::ZERO, 4.0 * reach)
                .points
                .into_iter()
                .map(|p| (p, u32::MAX))
                .collect();
            for (j, other) in planes.iter().enumerate() {
                if j == i || is_same(other) {
                    continue;
                }
                face = clip_behind(&face, other, j as u32, 0.1 * eps);
                if face.len() < 3 {
                    break;
                }
            }
            if face.len() < 3 {
                continue;
            }
            if face
                .iter()
                .any(|(p, edge)| *edge == u32::MAX || p.abs().max_element() > reach)
            {
                // A vertex of the initial square is left.
                if !area_is_flat(&face, eps) {
                    return Err(SolidError::Unbounded);
                }
                continue;
            }
            let n = face.len();
            let mut points: Vec<DVec3> = Vec::with_capacity(n);
            for k in 0..n {
                // At each vertex, the edge before ends and its own begins.
                let edges = [face[(k + n - 1) % n].1, face[k].1];
                let solved = meet(
                    plane,
                    &planes[edges[0] as usize],
                    &planes[edges[1] as usize],
                );
                let p = solved
                    .filter(|s| s.distance(face[k].0) < eps)
                    .unwrap_or(face[k].0);
                let p = match corners.iter().find(|c| c.distance(p) < eps) {
                    Some(&c) => c,
                    None => {
                        corners.push(p);
                        p
                    }
                };
                if points.last() != Some(&p) {
                    points.push(p);
                }
            }
            while points.len() > 1 && points.first() == points.last() {
                points.pop();
            }
            if points.len() >= 3 {
                solid.planes.push(*plane);
                solid.faces.push(Winding::new(points));
                solid.sources.push(i as u32);
            }
        }
        if solid.faces.len() < 4 || solid.volume() <= eps * eps * eps {
            return Err(SolidError::Empty);
        }
        Ok(solid)
    }

    /// Returns the smallest box around it.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        self.faces
            .iter()
            .fold(Aabb::EMPTY, |b, f| b.union(f.aabb()))
    }

    /// Returns the volume. [Units: wu³]
    #[must_use]
    #[doc(hidden)]
    pub fn volume(&self) -> f64 {
        let Some(&o) = self.faces.first().and_then(|f| f.points.first()) else {
            return 0.0;
        };
        self.faces
            .iter()
            .map(|f| f.area_normal().dot(f.points[0] - o) / 6.0)
            .sum()
    }

    /// Returns `true` if `p` is more than `eps` inside.
    #[must_use]
    #[doc(hidden)]
    pub fn contains(&self, p: DVec3, eps: f64) -> bool {
        self.planes
            .iter()
            .all(|plane| plane.signed_distance(p) < -eps)
    }

    /// Returns the solid scaled by `scale` (above 0), then rotated by `rotation`, then moved by `offset`.
    #[must_use]
    #[doc(hidden)]
    pub fn placed(&self, scale: f64, rotation: &DMat3, offset: DVec3) -> Self {
        let moved = |p: &DVec3| *rotation * *p * scale + offset;
        Self {
            planes: self
                .planes
                .iter()
                .map(|p| {
                    let normal = *rotation * p.normal;
                    Plane {
                        normal,
                        d: p.d * scale - normal.dot(offset),
                    }
                })
                .collect(),
            faces: self
                .faces
                .iter()
                .map(|f| Winding::new(f.points.iter().map(moved).collect()))
                .collect(),
            sources: self.sources.clone(),
        }
    }

    /// Subtracts the solid from `polygon`, a part of the plane with normal `normal`; appends the rest to
    /// `outside`.
    ///
    /// A part in a face that faces the other way counts as inside; a part in a face that faces the same way
    /// counts as inside if `takes_shared`.
    #[doc(hidden)]
    pub fn cut_from(
        &self,
        polygon: Winding,
        normal: DVec3,
        takes_shared: bool,
        eps: f64,
        outside: &mut Vec<Winding>,
    ) {
        // First test that any of it is inside, to avoid needless cuts.
        let mut inside = Some(polygon.clone());
        for plane in &self.planes {
            let Some(rest) = inside else { break };
            inside = match rest.split(plane, eps) {
                (None, None) => {
                    let same = plane.normal.dot(normal) > 0.0;
                    (!same || takes_shared).then_some(rest)
                }
                (_, back) => back,
            };
        }
        if inside.is_none() {
            outside.push(polygon);
            return;
        }
        let mut rest = polygon;
        for plane in &self.planes {
            match rest.split(plane, eps) {
                (Some(front), Some(back)) => {
                    outside.push(front);
                    rest = back;
                }
                (Some(front), None) => {
                    outside.push(front);
                    return;
                }
                (None, Some(_) | None) => {}
            }
        }
    }
}

fn area_is_flat(face: &[(DVec3, u32)], eps: f64) -> bool {
    let w = Winding::new(face.iter().map(|f| f.0).collect());
    w.area() < eps * eps
}

/// Returns the part behind `plane`; marks its new edge with `mark`.
fn clip_behind(face: &[(DVec3, u32)], plane: &Plane, mark: u32, eps: f64) -> Vec<(DVec3, u32)> {
    let n = face.len();
    let dist: Vec<f64> = face.iter().map(|f| plane.signed_distance(f.0)).collect();
    if dist.iter().all(|&d| d <= eps) {
        return face.to_vec();
    }
    if dist.iter().all(|&d| d >= -eps) {
        return Vec::new();
    }
    let mut out = Vec::with_capacity(n + 1);
    for i in 0..n {
        let j = (i + 1) % n;
        let ((p, edge), q) = (face[i], face[j].0);
        let (dp, dq) = (dist[i], dist[j]);
        if dp <= eps {
            // At a vertex in the plane, the new edge begins if the old one leaves to the front.
            out.push((p, if dp >= -eps && dq > eps { mark } else { edge }));
        }
        if dp < -eps && dq > eps {
            out.push((p + (q - p) * (dp / (dp - dq)), mark));
        } else if dp > eps && dq < -eps {
            out.push((p + (q - p) * (dp / (dp - dq)), edge));
        }
    }
    out
}

/// Returns the common point of three planes.
fn meet(a: &Plane, b: &Plane, c: &Plane) -> Option<DVec3> {
    let bc = b.normal.cross(c.normal);
    let det = a.normal.dot(bc);
    if det.abs() < 1e-6 {
        return None;
    }
    let sum = bc * -a.d + c.normal.cross(a.normal) * -b.d + a.normal.cross(b.normal) * -c.d;
    Some(sum / det)
}

/// Returns, per solid and face in order, the parts that no other solid hides.
///
/// If two faces coincide and face the same way, the later solid's stays. Time about linear in the solids
/// if each meets few others.
#[must_use]
pub fn exposed_faces(
    solids: &[&ConvexSolid],
    eps: f64,
    purse: Purse<'_>,
) -> Vec<Vec<Vec<Winding>>> {
    let boxes: Vec<Aabb> = solids.iter().map(|s| s.aabb()).collect();
    let tree = BoxTree::new(&boxes);
    let mut near = Vec::new();
    solids
        .iter()
        .enumerate()
        .map(|(i, solid)| {
            near.clear();
            tree.for_each_in_box(&boxes[i].expanded(eps), |j| {
                if j as usize != i {
                    near.push(j);
                }
            });
            near.sort_unstable();
            let of_face = |face: &Winding, plane: &Plane| {
                let bounds = face.aabb().expanded(eps);
                let mut parts = vec![face.clone()];
                for &j in &near {
                    if !bounds.overlaps(&boxes[j as usize]) {
                        continue;
                    }
                    if !purse.spend(10 * parts.len() as u64) {
                        return Vec::new();
                    }
                    let mut rest = Vec::with_capacity(parts.len());
                    for part in parts {
                        solids[j as usize].cut_from(
                            part,
                            plane.normal,
                            j as usize > i,
                            eps,
                            &mut rest,
                        );
                    }
                    parts = rest;
                    if parts.is_empty() {
                        break;
                    }
                }
                parts
            };
            solid
                .faces
                .iter()
                .zip(&solid.planes)
                .map(|(f, p)| of_face(f, p))
                .collect()
        })
        .collect()
}

/// Boxes in a balanced tree, for overlap queries.
#[derive(Clone, Debug, Default)]
pub struct BoxTree {
    /// In preorder; each with the index of the node after its subtree and, for leaves, the box's index.
    nodes: Vec<(Aabb, u32, u32)>,
}

const INNER: u32 = u32::MAX;

impl BoxTree {
    /// Builds the tree. `O(n log n)`.
    #[must_use]
    pub fn new(boxes: &[Aabb]) -> Self {
        let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
        let mut tree = Self::default();
        tree.add(boxes, &mut order);
        tree
    }

    fn add(&mut self, boxes: &[Aabb], ids: &mut [u32]) {
        let bounds = ids
            .iter()
            .fold(Aabb::EMPTY, |b, &i| b.union(boxes[i as usize]));
        match ids {
            [] => {}
            [one] => {
                let next = self.nodes.len() as u32 + 1;
                self.nodes.push((bounds, next, *one));
            }
            _ => {
                let at = self.nodes.len();
                self.nodes.push((bounds, 0, INNER));
                let size = bounds.size();
                let axis = (0..3)
                    .max_by(|&a, &b| size[a].total_cmp(&size[b]))
                    .unwrap_or(0);
                let key = |i: u32| {
                    let b = &boxes[i as usize];
                    b.min[axis] + b.max[axis]
                };
                let middle = ids.len() / 2;
                ids.select_nth_unstable_by(middle, |&a, &b| {
                    key(a).total_cmp(&key(b)).then(a.cmp(&b))
                });
                let (low, high) = ids.split_at_mut(middle);
                self.add(boxes, low);
                self.add(boxes, high);
                self.nodes[at].1 = self.nodes.len() as u32;
            }
        }
    }

    /// Calls `take` for each box that overlaps `bounds`, borders included.
    pub fn for_each_in_box(&self, bounds: &Aabb, mut take: impl FnMut(u32)) {
        let mut at = 0;
        while at < self.nodes.len() {
            let (b, next, id) = &self.nodes[at];
            if !b.overlaps(bounds) {
                at = *next as usize;
                continue;
            }
            if *id != INNER {
                take(*id);
            }
            at += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxed(min: [f64; 3], max: [f64; 3]) -> ConvexSolid {
        let mut planes = Vec::new();
        for (axis, n) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
            planes.push(Plane {
                normal: n,
                d: -max[axis],
            });
            planes.push(Plane {
                normal: -n,
                d: min[axis],
            });
        }
        ConvexSolid::from_planes(&planes, 1e4, 1e-4).unwrap()
    }

    fn area(faces: &[Vec<Vec<Winding>>]) -> f64 {
        faces.iter().flatten().flatten().map(Winding::area).sum()
    }

    #[test]
    fn a_box_has_six_faces_that_look_outwards() {
        let b = boxed([0.0; 3], [2.0, 3.0, 4.0]);
        assert_eq!(b.faces.len(), 6);
        assert!((b.volume() - 24.0).abs() < 1e-9);
        for (f, p) in b.faces.iter().zip(&b.planes) {
            assert!(f.area_normal().dot(p.normal) > 0.0);
        }
        // Eight vertices, not twenty-four: shared to the last bit.
        let mut corners: Vec<[u64; 3]> = b
            .faces
            .iter()
            .flat_map(|f| &f.points)
            .map(|p| p.to_array().map(f64::to_bits))
            .collect();
        corners.sort_unstable();
        corners.dedup();
        assert_eq!(corners.len(), 8);
    }

    #[test]
    fn planes_that_bound_nothing_are_errors() {
        let b = boxed([0.0; 3], [1.0; 3]);
        let from = |planes: &[Plane]| ConvexSolid::from_planes(planes, 1e4, 1e-4).unwrap_err();
        assert_eq!(from(&b.planes[..5]), SolidError::Unbounded);
        let inward: Vec<Plane> = b.planes.iter().map(|p| p.flipped()).collect();
        assert_eq!(from(&inward), SolidError::Empty);
        let mut flat = b.planes.clone();
        flat[0].d = 0.0;
        assert_eq!(from(&flat), SolidError::Empty);
    }

    #[test]
    fn solids_that_overlap_show_the_surface_of_their_union() {
        // Two unit cubes that overlap by half: the union is 1.5 × 1 × 1.
        let (a, b) = (
            boxed([0.0; 3], [1.0; 3]),
            boxed([0.5, 0.0, 0.0], [1.5, 1.0, 1.0]),
        );
        assert!((area(&exposed_faces(&[&a, &b], 1e-6, Purse::endless())) - 8.0).abs() < 1e-9);
        // The same cube twice shows once.
        assert!((area(&exposed_faces(&[&a, &a], 1e-6, Purse::endless())) - 6.0).abs() < 1e-9);
        // Two that touch hide the faces between them.
        let c = boxed([1.0, 0.0, 0.0], [2.0, 1.0, 1.0]);
        assert!((area(&exposed_faces(&[&a, &c], 1e-6, Purse::endless())) - 10.0).abs() < 1e-9);
    }

    #[test]
    fn the_box_tree_equals_a_loop() {
        let boxes: Vec<Aabb> = (0..300_u32)
            .map(|i| {
                let at = |k: u32| f64::from((i * 7919 + k * 104_729) % 97);
                let min = DVec3::new(at(1), at(2), at(3));
                Aabb::new(min, min + DVec3::new(at(4), at(5), at(6)) * 0.1)
            })
            .collect();
        let tree = BoxTree::new(&boxes);
        for q in boxes.iter().step_by(7) {
            let mut found = Vec::new();
            tree.for_each_in_box(q, |i| found.push(i));
            found.sort_unstable();
            let expected: Vec<u32> = (0..300)
                .filter(|&i| boxes[i as usize].overlaps(q))
                .collect();
            assert_eq!(found, expected);
        }
        BoxTree::new(&[]).for_each_in_box(&boxes[0], |_| unreachable!());
    }
}
