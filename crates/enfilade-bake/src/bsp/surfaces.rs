//! Surfaces of the input as polygons that share one list of planes.

use std::collections::HashMap;

use enfilade_geom::solid::exposed_faces;
use enfilade_geom::{Aabb, ConvexSolid, DVec3, Plane, Triangle};

use crate::complex::poly::{self, Poly};
use crate::structure::in_own_order;

use super::tree::Fragment;
use super::{BspInput, Tolerance};

/// What a tree is built from.
pub(super) struct Gathered {
    pub(super) planes: Vec<Plane>,
    pub(super) fragments: Vec<Fragment>,
    /// The face of a solid, or the triangle, that each fragment is of.
    pub(super) faces: Vec<u32>,
    pub(super) bounds: Aabb,
    pub(super) tolerance: Tolerance,
}

/// Planes, polygons, the box around them and what counts as touching.
pub(super) fn gather(input: &BspInput<'_>) -> Gathered {
    let points = input.triangles.iter().flatten().copied().chain(
        input
            .solids
            .iter()
            .flat_map(|s| s.faces.iter().flat_map(|f| f.points.iter().copied())),
    );
    let mut bounds = points.fold(Aabb::EMPTY, Aabb::including);
    for &p in input.inside {
        bounds = bounds.including(p);
    }
    if bounds.is_empty() {
        bounds = Aabb::new(DVec3::splat(-1.0), DVec3::splat(1.0));
    }
    let tolerance = Tolerance::for_bounds(&bounds);
    let bounds = bounds.expanded(0.5 + 0.01 * bounds.size().max_element());
    let mut planes = PlaneList::new(&tolerance, &bounds);
    let mut fragments = Vec::new();
    let mut faces = Vec::new();
    let mut face = 0;
    if input.solids.is_empty() {
        for t in &in_own_order(input.triangles) {
            planes.add_triangle(t, &mut fragments);
            faces.resize(fragments.len(), face);
            face += 1;
        }
    } else {
        let solids: Vec<&ConvexSolid> = input.solids.iter().collect();
        for (solid, exposed) in solids.iter().zip(exposed_faces(&solids, tolerance.plane)) {
            for (plane, parts) in solid.planes.iter().zip(exposed) {
                for part in parts {
                    planes.add(plane, part.points.into(), &mut fragments);
                }
                faces.resize(fragments.len(), face);
                face += 1;
            }
        }
    }
    Gathered {
        planes: planes.planes,
        fragments,
        faces,
        bounds,
        tolerance,
    }
}

/// Distinct planes, found by rounded normal and offset.
struct PlaneList {
    planes: Vec<Plane>,
    buckets: HashMap<[i32; 4], Vec<u32>>,
    tolerance: Tolerance,
    center: DVec3,
}

impl PlaneList {
    fn new(tolerance: &Tolerance, bounds: &Aabb) -> Self {
        Self {
            planes: Vec::new(),
            buckets: HashMap::new(),
            tolerance: *tolerance,
            center: bounds.center(),
        }
    }

    fn add_triangle(&mut self, t: &Triangle, out: &mut Vec<Fragment>) {
        let points = Poly::from_slice(t);
        let axial = (0..3).find(|&a| t[0][a] == t[1][a] && t[0][a] == t[2][a]);
        let Some(mut plane) = Plane::of_triangle(t) else {
            return;
        };
        if let Some(axis) = axial {
            let mut normal = DVec3::ZERO;
            normal[axis] = plane.normal[axis].signum();
            plane = Plane::through(t[0], normal);
        }
        self.add(&plane, points, out);
    }

    fn add(&mut self, plane: &Plane, points: Poly, out: &mut Vec<Fragment>) {
        if poly::width(&points) < self.tolerance.plane {
            return;
        }
        // An odd direction: the largest component would tie on every 45 degree wall.
        let is_flipped = plane.normal.dot(DVec3::new(1.0, 0.618_034, 0.324_718)) < 0.0;
        let canonical = if is_flipped { plane.flipped() } else { *plane };
        let id = self.find(&canonical, &points);
        out.push(Fragment {
            points,
            plane: id,
            is_flipped,
        });
    }

    fn find(&mut self, plane: &Plane, points: &[DVec3]) -> u32 {
        let at = [
            plane.normal.x * 256.0,
            plane.normal.y * 256.0,
            plane.normal.z * 256.0,
            plane.signed_distance(self.center) * 100.0,
        ];
        let mut best: Option<(f64, u32)> = None;
        for choice in 0..16_u32 {
            let key: [i32; 4] =
                std::array::from_fn(|i| (at[i] - 0.5).floor() as i32 + (choice >> i & 1) as i32);
            for &id in self.buckets.get(&key).into_iter().flatten() {
                let p = &self.planes[id as usize];
                let stray = points
                    .iter()
                    .map(|&q| p.signed_distance(q).abs())
                    .fold(0.0, f64::max);
                if stray <= self.tolerance.plane && best.is_none_or(|b| (stray, id) < b) {
                    best = Some((stray, id));
                }
            }
        }
        best.map_or_else(
            || {
                let id = self.planes.len() as u32;
                self.planes.push(*plane);
                self.buckets
                    .entry(at.map(|x| x.floor() as i32))
                    .or_default()
                    .push(id);
                id
            },
            |b| b.1,
        )
    }
}
