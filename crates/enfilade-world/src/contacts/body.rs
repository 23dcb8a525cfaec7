//! The shapes that bodies have.

use enfilade_geom::{Aabb, DMat3, DQuat, DVec3};

/// The shape of a body about its center. Sizes are not negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Body {
    /// A ball; with radius 0 a point.
    Sphere {
        /// [Units: wu] [Limit: >= 0]
        radius: f64,
    },
    /// All within `radius` of a segment.
    Capsule {
        /// From the center to one end of the segment; the other is opposite. [Units: wu]
        half: DVec3,
        /// [Units: wu] [Limit: >= 0]
        radius: f64,
    },
    /// An oriented box.
    Box {
        /// Half of its sizes, along its own axes. [Units: wu] [Limit: >= 0]
        half: DVec3,
        /// From its own axes to the world's.
        turn: DQuat,
    },
}

impl Body {
    /// An upright capsule of a whole height and a radius. [Units: wu]
    #[must_use]
    pub fn upright(height: f64, radius: f64) -> Self {
        Self::Capsule {
            half: DVec3::Y * (0.5 * height - radius).max(0.0),
            radius,
        }
    }

    /// The box around it when its center is at `center`. [Units: wu]
    #[must_use]
    pub fn bounds(&self, center: DVec3) -> Aabb {
        let half = BodyCore::of(self).reach();
        Aabb::new(center - half, center + half)
    }

    /// Of the sphere about its center that holds it. [Units: wu]
    #[must_use]
    pub fn bounding_radius(&self) -> f64 {
        match *self {
            Self::Sphere { radius } => radius,
            Self::Capsule { half, radius } => half.length() + radius,
            Self::Box { half, .. } => half.length(),
        }
    }

    /// Grown by `margin` on every side; boxes keep their corners.
    pub(super) fn grown(&self, margin: f64) -> Self {
        match *self {
            Self::Sphere { radius } => Self::Sphere {
                radius: radius + margin,
            },
            Self::Capsule { half, radius } => Self::Capsule {
                half,
                radius: radius + margin,
            },
            Self::Box { half, turn } => Self::Box {
                half: half + margin,
                turn,
            },
        }
    }

    /// Whether all its numbers are finite.
    pub(super) fn is_finite(&self) -> bool {
        match *self {
            Self::Sphere { radius } => radius.is_finite(),
            Self::Capsule { half, radius } => half.is_finite() && radius.is_finite(),
            Self::Box { half, turn } => half.is_finite() && turn.is_finite(),
        }
    }
}

/// A body as sums tell it: all points `s0 · axes[0] + s1 · axes[1] + s2 · axes[2]` with shares from -1 to 1, and what is within
/// a radius of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct BodyCore {
    pub(super) axes: [DVec3; 3],
    /// Of a box, their directions, though it may have no size along them.
    pub(super) directions: [DVec3; 3],
    /// How many of these count.
    pub(super) n_axes: usize,
    /// 0 for boxes.
    pub(super) radius: f64,
}

impl BodyCore {
    pub(super) fn of(body: &Body) -> Self {
        match *body {
            Body::Sphere { radius } => Self {
                axes: [DVec3::ZERO; 3],
                directions: DVec3::AXES,
                n_axes: 0,
                radius,
            },
            Body::Capsule { half, radius } => Self {
                axes: [half, DVec3::ZERO, DVec3::ZERO],
                directions: DVec3::AXES,
                n_axes: 1,
                radius,
            },
            Body::Box { half, turn } => {
                let turn = DMat3::from_quat(turn);
                let directions = [turn.x_axis, turn.y_axis, turn.z_axis];
                Self {
                    axes: [0, 1, 2].map(|k| directions[k] * half[k]),
                    directions,
                    n_axes: 3,
                    radius: 0.0,
                }
            }
        }
    }

    /// Half of what it takes along a direction of any length.
    #[inline]
    pub(super) fn support(&self, direction: DVec3) -> f64 {
        let mut sum = self.radius * direction.length();
        for axis in &self.axes[..self.n_axes] {
            sum += axis.dot(direction).abs();
        }
        sum
    }

    /// Half sizes of the box around it. [Units: wu]
    pub(super) fn reach(&self) -> DVec3 {
        let sum = |sum: DVec3, axis: &DVec3| sum + axis.abs();
        self.axes[..self.n_axes]
            .iter()
            .fold(DVec3::splat(self.radius), sum)
    }

    /// Half sizes of the box around it in a space that `to` leads to.
    pub(super) fn reach_in(&self, to: &DMat3) -> DVec3 {
        let rows = to.transpose();
        DVec3::from_array([0, 1, 2].map(|k| self.support(rows.col(k))))
    }
}
