//! Rigid motions between frames.

use enfilade_geom::{DMat3, DMat4, DQuat, DVec3, Similarity};

/// A rigid motion: rotate, then translate. Maps points of a frame to the frame in which it stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// The rotation; of unit length.
    pub turn: DQuat,
    /// Position of the frame's origin. [Units: wu]
    pub at: DVec3,
}

impl Default for Pose {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl From<Pose> for Similarity {
    fn from(pose: Pose) -> Self {
        Self::rigid(pose.turn, pose.at)
    }
}

impl Pose {
    /// The identity.
    pub const IDENTITY: Self = Self {
        turn: DQuat::IDENTITY,
        at: DVec3::ZERO,
    };

    /// Makes a translation. [Units: wu]
    #[must_use]
    pub const fn from_translation(at: DVec3) -> Self {
        Self {
            turn: DQuat::IDENTITY,
            at,
        }
    }

    /// Makes a rotation about a point. `angle` in radians, counter-clockwise about `axis`, which has unit length.
    #[must_use]
    pub fn about(point: DVec3, axis: DVec3, angle: f64) -> Self {
        let turn = DQuat::from_axis_angle(axis, angle);
        Self {
            turn,
            at: point - turn * point,
        }
    }

    /// Returns the motion that applies `inner` first, and then this one. Normalizes the rotation, so that errors do not grow
    /// with the number of motions.
    #[must_use]
    pub fn after(&self, inner: &Self) -> Self {
        Self {
            turn: (self.turn * inner.turn).normalize(),
            at: self.point(inner.at),
        }
    }

    /// Returns the inverse motion.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let turn = self.turn.conjugate();
        Self {
            turn,
            at: -(turn * self.at),
        }
    }

    /// Maps a point. [Units: wu]
    #[inline]
    #[must_use]
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.turn * p + self.at
    }

    /// Maps a point by the inverse. [Units: wu]
    #[inline]
    #[must_use]
    pub fn point_back(&self, p: DVec3) -> DVec3 {
        self.turn.conjugate() * (p - self.at)
    }

    /// Maps a direction.
    #[inline]
    #[must_use]
    pub fn direction(&self, v: DVec3) -> DVec3 {
        self.turn * v
    }

    /// Returns the rotation as a matrix.
    #[must_use]
    #[doc(hidden)]
    pub fn matrix3(&self) -> DMat3 {
        DMat3::from_quat(self.turn)
    }

    /// Returns the motion as a matrix.
    #[must_use]
    pub fn matrix(&self) -> DMat4 {
        DMat4::from_rotation_translation(self.turn, self.at)
    }

    /// Returns the pose at a fraction `t` of the way to `end`: the origin moves in a straight line, while the frame rotates
    /// uniformly by the lesser angle. [Limit: `t` from 0 to 1]
    #[must_use]
    #[doc(hidden)]
    pub fn toward(&self, end: &Self, t: f64) -> Self {
        Self {
            turn: self.turn.slerp(end.turn, t),
            at: self.at.lerp(end.at, t),
        }
    }

    /// Returns `true` if all its numbers are finite and its rotation has unit length.
    #[must_use]
    #[doc(hidden)]
    pub fn is_rigid(&self) -> bool {
        self.at.is_finite() && (self.turn.length_squared() - 1.0).abs() < 1e-6
    }
}
