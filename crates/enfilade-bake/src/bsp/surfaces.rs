//! Surfaces of the input as polygons that share one list of planes.

use enfilade_geom::solid::exposed_faces;
use enfilade_geom::{Aabb, ConvexSolid, DVec3, Plane, Purse, Triangle};

use crate::complex::planes::{PlaneList, faces_ahead};
use crate::complex::poly::{self, Poly};
use crate::structure::in_own_order;

use super::input::BspInput;
use super::tolerance::Tolerance;
use super::tree::Fragment;

/// The polygons from which a tree is built, and their planes.
pub(super) struct Gathered {
    pub(super) planes: Vec<Plane>,
    pub(super) fragments: Vec<Fragment>,
    /// For each fragment, its triangle or its face of a solid.
    pub(super) faces: Vec<u32>,
    pub(super) bounds: Aabb,
    pub(super) tolerance: Tolerance,
}

/// Returns planes, polygons, the box around them and the tolerance.
pub(super) fn gather(input: &BspInput<'_>, purse: Purse<'_>) -> Gathered {
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
    let mut polygons = Polygons {
        planes: PlaneList::new(bounds.center(), tolerance.plane),
        tolerance,
        fragments: Vec::new(),
    };
    let mut faces = Vec::new();
    let mut face = 0;
    if input.solids.is_empty() {
        for t in &in_own_order(input.triangles) {
            let before = polygons.planes.n_looked();
            polygons.add_triangle(t);
            if !purse.spend(10 + (polygons.planes.n_looked() - before) / 4) {
                break;
            }
            faces.resize(polygons.fragments.len(), face);
            face += 1;
        }
    } else {
        let solids: Vec<&ConvexSolid> = input.solids.iter().collect();
        for (solid, exposed) in solids
            .iter()
            .zip(exposed_faces(&solids, tolerance.plane, purse))
        {
            for (plane, parts) in solid.planes.iter().zip(exposed) {
                for part in parts {
                    polygons.add(plane, part.points.into());
                }
                faces.resize(polygons.fragments.len(), face);
                face += 1;
            }
        }
    }
    Gathered {
        planes: polygons.planes.into_planes(),
        fragments: polygons.fragments,
        faces,
        bounds,
        tolerance,
    }
}

/// Polygons of the input, each with its plane in the list.
struct Polygons {
    planes: PlaneList,
    tolerance: Tolerance,
    fragments: Vec<Fragment>,
}

impl Polygons {
    fn add_triangle(&mut self, t: &Triangle) {
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
        self.add(&plane, points);
    }

    fn add(&mut self, plane: &Plane, points: Poly) {
        if poly::width(&points) < self.tolerance.plane {
            return;
        }
        let is_flipped = !faces_ahead(plane.normal);
        let listed = if is_flipped { plane.flipped() } else { *plane };
        let plane = self.planes.find_or_add(&listed, &points);
        self.fragments.push(Fragment {
            points,
            plane,
            is_flipped,
        });
    }
}
