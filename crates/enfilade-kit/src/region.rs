//! Convex pieces of space, cut by the planes of locators.

use enfilade_cpg::Locator;
use enfilade_geom::poly::{self, Poly, Side};
use enfilade_geom::{Aabb, DVec3, Plane, Winding};

/// Vertices this close to a plane lie on it: far below what files resolve. [Units: wu]
pub(crate) const EPS: f64 = 1e-7;

/// A convex polytope.
#[derive(Clone, Debug)]
pub(crate) struct Region {
    /// Planes that face inwards, each with its polygon.
    pub(crate) faces: Vec<(Plane, Poly)>,
}

impl Region {
    pub(crate) fn of_box(bounds: &Aabb) -> Self {
        let faces = bounds.faces().into_iter().map(|face| {
            let out = poly::area_normal(&face).normalize_or_zero();
            (Plane::through(face[0], -out), Poly::from_slice(&face))
        });
        Self {
            faces: faces.collect(),
        }
    }

    pub(crate) fn points(&self) -> impl Iterator<Item = DVec3> {
        self.faces.iter().flat_map(|f| f.1.iter().copied())
    }

    pub(crate) fn bounds(&self) -> Aabb {
        self.points().fold(Aabb::EMPTY, Aabb::including)
    }

    /// Returns the side of a plane on which it lies.
    pub(crate) fn side(&self, plane: &Plane) -> Side {
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for p in self.points() {
            let d = plane.signed_distance(p);
            (least, most) = (least.min(d), most.max(d));
        }
        match (most > EPS, least < -EPS) {
            (false, false) => Side::On,
            (true, false) => Side::Front,
            (false, true) => Side::Back,
            (true, true) => Side::Both,
        }
    }

    /// Returns the parts on the positive and negative side of a plane.
    pub(crate) fn split(&self, plane: &Plane) -> [Option<Self>; 2] {
        match self.side(plane) {
            Side::Front => [Some(self.clone()), None],
            Side::Back => [None, Some(self.clone())],
            Side::On => [None, None],
            Side::Both => [self.part(plane), self.part(&plane.flipped())],
        }
    }

    /// Returns the part on the positive side, if it has volume.
    fn part(&self, plane: &Plane) -> Option<Self> {
        let kept = self.faces.iter().filter_map(|(own, polygon)| {
            let part = poly::clip(polygon, plane, EPS)?;
            Some((*own, part))
        });
        let mut faces: Vec<(Plane, Poly)> = kept.collect();
        let cap = self.section(plane)?;
        faces.push((*plane, cap));
        (faces.len() >= 4).then_some(Self { faces })
    }

    /// Returns its section with a plane.
    fn section(&self, plane: &Plane) -> Option<Poly> {
        let bounds = self.bounds();
        let reach = bounds.size().length() + 1.0;
        let square = Winding::square(plane, bounds.center(), reach);
        let mut cap = Poly::from_vec(square.flipped().points);
        for (own, _) in &self.faces {
            if !poly::clip_in_place(&mut cap, own, 0.0) {
                return None;
            }
        }
        Some(cap)
    }

    /// Returns its volume. [Units: wu³]
    pub(crate) fn volume(&self) -> f64 {
        let Some(o) = self.points().next() else {
            return 0.0;
        };
        let cone = |(plane, polygon): &(Plane, Poly)| {
            plane.signed_distance(o).abs() * poly::area(polygon) / 3.0
        };
        self.faces.iter().map(cone).sum()
    }
}

/// Returns a plane of a locator.
pub(crate) fn plane_of(locator: &Locator, node: usize) -> Plane {
    let [x, y, z, d] = locator.planes[locator.nodes[node].plane as usize];
    Plane {
        normal: DVec3::new(x, y, z),
        d,
    }
}

/// Calls `visit` with each leaf of a locator, as [`Locator::leaf`] encodes it, and its part of `region`.
pub(crate) fn for_each_leaf(locator: &Locator, region: Region, visit: &mut dyn FnMut(i32, Region)) {
    let mut stack = vec![(locator.root, region)];
    while let Some((at, region)) = stack.pop() {
        let Ok(node) = usize::try_from(at) else {
            visit(at, region);
            continue;
        };
        let parts = region.split(&plane_of(locator, node));
        let children = locator.nodes[node].children;
        for (child, part) in children.into_iter().zip(parts) {
            stack.extend(part.map(|part| (child, part)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_box_add_up_to_it() {
        let whole = Region::of_box(&Aabb::new(DVec3::ZERO, DVec3::new(2.0, 3.0, 4.0)));
        assert!((whole.volume() - 24.0).abs() < 1e-9);
        let slanted = Plane::through(DVec3::ONE, DVec3::new(1.0, 2.0, -0.5).normalize());
        let parts = whole.split(&slanted);
        let volumes: Vec<f64> = parts.iter().flatten().map(Region::volume).collect();
        assert_eq!(volumes.len(), 2);
        assert!((volumes.iter().sum::<f64>() - 24.0).abs() < 1e-9);
        let [front, back] = parts.map(|p| p.unwrap().split(&slanted).map(|p| p.is_some()));
        assert_eq!([front, back], [[true, false], [false, true]]);
    }
}
