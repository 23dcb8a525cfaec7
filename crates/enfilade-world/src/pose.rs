//! Rigid motions: where one frame is in another.

use enfilade_geom::{DMat3, DMat4, DQuat, DVec3};

/// A rigid motion: turn, then move. Takes points of a frame to the frame in which it stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// The turn; of unit length.
    pub turn: DQuat,
    /// Where the frame's origin is. [Units: wu]
    pub at: DVec3,
}

impl Default for Pose {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Pose {
    /// No motion.
    pub const IDENTITY: Self = Self {
        turn: DQuat::IDENTITY,
        at: DVec3::ZERO,
    };

    /// A move without a turn. [Units: wu]
    #[must_use]
    pub const fn from_translation(at: DVec3) -> Self {
        Self {
            turn: DQuat::IDENTITY,
            at,
        }
    }

    /// A turn about a point. `angle` in radians, counter-clockwise about `axis`, which is of unit length.
    #[must_use]
    pub fn about(point: DVec3, axis: DVec3, angle: f64) -> Self {
        let turn = DQuat::from_axis_angle(axis, angle);
        Self {
            turn,
            at: point - turn * point,
        }
    }

    /// The motion that does `inner` first, and then this one. The turn is made of unit length again, so that errors do not
    /// grow with the number of motions.
    #[must_use]
    pub fn after(&self, inner: &Self) -> Self {
        Self {
            turn: (self.turn * inner.turn).normalize(),
            at: self.point(inner.at),
        }
    }

    /// The motion that takes this one back.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let turn = self.turn.conjugate();
        Self {
            turn,
            at: -(turn * self.at),
        }
    }

    /// Where a point goes. [Units: wu]
    #[inline]
    #[must_use]
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.turn * p + self.at
    }

    /// Where a point comes from. [Units: wu]
    #[inline]
    #[must_use]
    pub fn point_back(&self, p: DVec3) -> DVec3 {
        self.turn.conjugate() * (p - self.at)
    }

    /// Where a direction goes.
    #[inline]
    #[must_use]
    pub fn direction(&self, v: DVec3) -> DVec3 {
        self.turn * v
    }

    /// The turn as a matrix.
    #[must_use]
    pub fn matrix3(&self) -> DMat3 {
        DMat3::from_quat(self.turn)
    }

    /// As a matrix.
    #[must_use]
    pub fn matrix(&self) -> DMat4 {
        DMat4::from_rotation_translation(self.turn, self.at)
    }

    /// The pose at a share `t` of the way to `end`: the origin moves in a straight line, while the frame turns evenly by the
    /// lesser angle. [Limit: `t` from 0 to 1]
    #[must_use]
    pub fn toward(&self, end: &Self, t: f64) -> Self {
        Self {
            turn: self.turn.slerp(end.turn, t),
            at: self.at.lerp(end.at, t),
        }
    }

    /// Whether all its numbers are finite and its turn is one.
    #[must_use]
    pub fn is_rigid(&self) -> bool {
        self.at.is_finite() && (self.turn.length_squared() - 1.0).abs() < 1e-6
    }
}
