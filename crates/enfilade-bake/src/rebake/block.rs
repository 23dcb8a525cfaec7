//! The box in which a world is replaced, and what of a polygon lies in it.

use enfilade_geom::{Aabb, DVec3, Plane, Winding};

use crate::complex::poly::{self, Poly};
use crate::complex::region::{Region, halves, whole};
use crate::structure::Frame;

/// Distance from a plane within which vertices are on it when regions are cut; planes are exact. [Units: wu]
pub(super) const CUT: f64 = 1e-9;

/// A box along the axes of a frame.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Its faces' planes in scene coordinates; normals point inward.
    pub(super) planes: [Plane; 6],
    /// In scene coordinates.
    pub(super) region: Region,
    /// Box around it in scene coordinates.
    pub(super) around: Aabb,
}

impl Block {
    /// Makes the block of a box in frame coordinates; `within` is the box that locators divide.
    pub(super) fn new(bounds: Aabb, frame: Frame, within: &Aabb) -> Self {
        let plane = |k: usize| {
            let mut normal = DVec3::ZERO;
            normal[k / 2] = [1.0, -1.0][k % 2];
            let at = [bounds.min, bounds.max][k % 2];
            Plane::through(frame.to_scene(at), frame.to_scene(normal))
        };
        let planes: [Plane; 6] = std::array::from_fn(plane);
        let region = planes.iter().fold(whole(within, CUT), |region, plane| {
            let [inside, _] = halves(region, plane, within, CUT);
            inside
        });
        Self {
            around: frame.aabb_to_scene(&bounds),
            planes,
            region,
        }
    }

    /// Returns `true` if all points are in it or within `slack` of it.
    pub(super) fn contains<'a>(
        &self,
        points: impl IntoIterator<Item = &'a DVec3>,
        slack: f64,
    ) -> bool {
        let mut points = points.into_iter();
        points.all(|&p| self.planes.iter().all(|f| f.signed_distance(p) >= -slack))
    }

    /// Returns the part of a convex polygon in it.
    pub(super) fn inside(&self, points: &[DVec3]) -> Option<Poly> {
        let mut rest = Poly::from_slice(points);
        for plane in &self.planes {
            rest = poly::clip(&rest, plane, CUT)?;
        }
        Some(rest)
    }

    /// Calls `take` with convex parts of a convex polygon that together are all of it outside.
    pub(super) fn outside(&self, points: &[DVec3], take: &mut dyn FnMut(&[DVec3])) {
        let mut rest = Poly::from_slice(points);
        for plane in &self.planes {
            match poly::split(&rest, plane, CUT) {
                poly::Sides::Front | poly::Sides::On => {}
                poly::Sides::Back => {
                    take(&rest);
                    return;
                }
                poly::Sides::Both(inner, outer) => {
                    take(&outer);
                    rest = inner;
                }
            }
        }
    }

    /// Returns the area of the parts of convex polygons in it.
    pub(super) fn area_inside<'a>(&self, pieces: impl IntoIterator<Item = &'a Winding>) -> f64 {
        let inside = pieces.into_iter().filter_map(|w| self.inside(&w.points));
        inside.map(|part| poly::area(&part)).sum()
    }
}
