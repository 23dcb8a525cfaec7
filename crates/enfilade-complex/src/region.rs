//! Convex regions given by their faces: a box, cut by planes.

use enfilade_geom::poly::{self, Poly, Sides};
use enfilade_geom::{Aabb, DVec3, Plane};

/// A region's measures.
#[derive(Clone, Copy, Debug)]
pub struct RegionShape {
    /// Mean of its vertices.
    pub middle: DVec3,
    /// [Units: wu³]
    pub volume: f64,
}

/// A convex region, given by its faces, each with its inward plane.
pub type Region = Vec<(Plane, Poly)>;

/// Returns a box as a region.
#[must_use]
pub fn whole(b: &Aabb, eps: f64) -> Region {
    let mut region = Region::new();
    for n in [DVec3::X, DVec3::Y, DVec3::Z] {
        for plane in [Plane::through(b.min, n), Plane::through(b.max, -n)] {
            if let Some(face) = poly::section_of_box(&plane, &b.expanded(1e-6), eps) {
                region.push((plane, face));
            }
        }
    }
    region
}

/// Returns the parts in front of and behind a plane.
#[must_use]
pub fn halves(region: Region, plane: &Plane, bounds: &Aabb, eps: f64) -> [Region; 2] {
    let mut sides = [Region::new(), Region::new()];
    if let Some(mut cap) = poly::section_of_box(plane, bounds, eps) {
        let is_there = region
            .iter()
            .all(|(face, _)| match poly::clip(&cap, face, eps) {
                Some(rest) => {
                    cap = rest;
                    true
                }
                None => false,
            });
        if is_there {
            sides[0].push((*plane, cap.clone()));
            sides[1].push((plane.flipped(), cap));
        }
    }
    for (face, points) in region {
        match poly::split(&points, plane, eps) {
            Sides::Front => sides[0].push((face, points)),
            Sides::Back => sides[1].push((face, points)),
            Sides::On => {
                let side = usize::from(face.normal.dot(plane.normal) < 0.0);
                sides[side].push((face, points));
            }
            Sides::Both(f, b) => {
                sides[0].push((face, f));
                sides[1].push((face, b));
            }
        }
    }
    sides
}

/// Returns the measures of a region.
#[must_use]
pub fn shape_of(region: &[(Plane, Poly)]) -> Option<RegionShape> {
    let corners = || region.iter().flat_map(|(_, points)| points.iter().copied());
    let n = corners().count();
    if region.len() < 4 {
        return None;
    }
    let middle = corners().sum::<DVec3>() / n as f64;
    let volume: f64 = region
        .iter()
        .map(|(face, points)| poly::area(points) * face.signed_distance(middle) / 3.0)
        .sum();
    (volume > 0.0).then_some(RegionShape { middle, volume })
}
