//! Oriented planes.

use crate::{DVec3, Triangle, triangle_area_normal};

/// An oriented plane `normal · p + d = 0`; its positive side is where the sum is greater.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Unit normal.
    pub normal: DVec3,
    /// Offset. [Units: wu]
    pub d: f64,
}

impl Plane {
    /// Makes the plane through `point` with unit `normal`.
    #[must_use]
    pub fn through(point: DVec3, normal: DVec3) -> Self {
        Self {
            normal,
            d: -normal.dot(point),
        }
    }

    /// Returns the plane of a triangle, facing its counter-clockwise side; `None` if the triangle has no area.
    #[must_use]
    #[doc(hidden)]
    pub fn of_triangle(t: &Triangle) -> Option<Self> {
        let n = triangle_area_normal(t).try_normalize()?;
        // The centroid keeps the rounding of the offset small for distant vertices.
        Some(Self::through((t[0] + t[1] + t[2]) / 3.0, n))
    }

    /// Returns the distance of `p`, positive on the side of the normal.
    #[must_use]
    pub fn signed_distance(&self, p: DVec3) -> f64 {
        self.normal.dot(p) + self.d
    }

    /// Returns the plane facing the other way.
    #[must_use]
    pub fn flipped(self) -> Self {
        Self {
            normal: -self.normal,
            d: -self.d,
        }
    }

    /// Projects `p` onto the plane along its normal.
    #[must_use]
    #[doc(hidden)]
    pub fn project(&self, p: DVec3) -> DVec3 {
        p - self.normal * self.signed_distance(p)
    }

    /// Returns two unit vectors that span the plane, with `u × v = normal`.
    #[must_use]
    #[doc(hidden)]
    pub fn basis(&self) -> (DVec3, DVec3) {
        let n = self.normal;
        // Cross with the axis least aligned to the normal, so that the product is far from zero.
        let axis = if n.x.abs() <= n.y.abs() && n.x.abs() <= n.z.abs() {
            DVec3::X
        } else if n.y.abs() <= n.z.abs() {
            DVec3::Y
        } else {
            DVec3::Z
        };
        let u = axis.cross(n).normalize();
        (u, n.cross(u))
    }
}
