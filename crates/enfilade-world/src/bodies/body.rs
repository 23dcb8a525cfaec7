//! Shapes of bodies.

use enfilade_geom::{Aabb, DMat3, DQuat, DVec3, Similarity};

/// The shape of a body about its center. Sizes must not be negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Body {
    /// A ball; with radius 0 a point.
    Sphere {
        /// Radius. [Units: wu] [Limit: >= 0]
        radius: f64,
    },
    /// All points within `radius` of a segment.
    Capsule {
        /// Vector from the center to one end of the segment; the other end is opposite. [Units: wu]
        half: DVec3,
        /// Radius. [Units: wu] [Limit: >= 0]
        radius: f64,
    },
    /// An oriented box.
    Box {
        /// Half sizes along its own axes. [Units: wu] [Limit: >= 0]
        half: DVec3,
        /// Rotation from its own axes to the world's.
        turn: DQuat,
    },
}

impl Body {
    /// Makes an upright capsule of a total height and a radius. [Units: wu]
    #[must_use]
    pub fn upright(height: f64, radius: f64) -> Self {
        Self::Capsule {
            half: DVec3::Y * (0.5 * height - radius).max(0.0),
            radius,
        }
    }

    /// Returns its bounding box with its center at `center`. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn bounds(&self, center: DVec3) -> Aabb {
        let half = BodyCore::of(self).reach();
        Aabb::new(center - half, center + half)
    }

    /// Returns the body grown by `margin` on every side; boxes stay boxes.
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

    /// Returns the body in another frame.
    pub(super) fn mapped(&self, to: &Similarity) -> Self {
        let size = to.scale.abs();
        match *self {
            Self::Sphere { radius } => Self::Sphere {
                radius: radius * size,
            },
            Self::Capsule { half, radius } => Self::Capsule {
                half: to.vector(half),
                radius: radius * size,
            },
            // Symmetric about its center, so a reflection is a rotation.
            Self::Box { half, turn } => Self::Box {
                half: half * size,
                turn: to.turn * turn,
            },
        }
    }

    /// Returns `true` if all its numbers are finite.
    pub(super) fn is_finite(&self) -> bool {
        match *self {
            Self::Sphere { radius } => radius.is_finite(),
            Self::Capsule { half, radius } => half.is_finite() && radius.is_finite(),
            Self::Box { half, turn } => half.is_finite() && turn.is_finite(),
        }
    }
}

/// A body as a Minkowski sum: all points `s0 · axes[0] + s1 · axes[1] + s2 · axes[2]` with factors from -1 to 1, and everything
/// within a radius of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct BodyCore {
    pub(super) axes: [DVec3; 3],
    /// For a box, the directions of its axes, even if it has no size along them.
    pub(super) directions: [DVec3; 3],
    /// Number of axes used.
    pub(super) n_axes: usize,
    /// Radius; 0 for boxes.
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

    /// Returns half of its extent along a direction of any length.
    #[inline]
    pub(super) fn support(&self, direction: DVec3) -> f64 {
        let mut sum = self.radius * direction.length();
        for axis in &self.axes[..self.n_axes] {
            sum += axis.dot(direction).abs();
        }
        sum
    }

    /// Returns the half sizes of its bounding box. [Units: wu]
    pub(super) fn reach(&self) -> DVec3 {
        let sum = |sum: DVec3, axis: &DVec3| sum + axis.abs();
        self.axes[..self.n_axes]
            .iter()
            .fold(DVec3::splat(self.radius), sum)
    }

    /// Returns the half sizes of its bounding box in another space; `to` maps to that space.
    pub(super) fn reach_in(&self, to: &DMat3) -> DVec3 {
        let rows = to.transpose();
        DVec3::from_array([0, 1, 2].map(|k| self.support(rows.col(k))))
    }
}
