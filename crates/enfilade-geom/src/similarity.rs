//! Similarities: rotations, reflections, uniform scales and translations.

use crate::{DMat3, DMat4, DQuat, DVec3};

/// A map that keeps angles: scale, rotate, then translate. A negative scale reflects: `-1` with half a turn about `n` is the
/// reflection in a plane of normal `n`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    /// The rotation; of unit length.
    pub turn: DQuat,
    /// Image of the origin. [Units: wu]
    pub at: DVec3,
    /// Factor of all lengths, negative for reflections. [Limit: finite, not 0]
    pub scale: f64,
}

impl Default for Similarity {
    fn default() -> Self {
        Self::IDENTITY
    }
}

/// Greatest relative deviation of a matrix from a similarity. Matrices of `f32` are within it.
const ROUNDING: f64 = 1e-5;

/// Greatest and least absolute scale.
const SCALES: [f64; 2] = [1e-6, 1e6];

impl Similarity {
    /// The identity.
    pub const IDENTITY: Self = Self {
        turn: DQuat::IDENTITY,
        at: DVec3::ZERO,
        scale: 1.0,
    };

    /// Makes a rigid motion.
    #[must_use]
    pub const fn rigid(turn: DQuat, at: DVec3) -> Self {
        Self {
            turn,
            at,
            scale: 1.0,
        }
    }

    /// Makes the reflection in the plane through a point; `normal` has unit length.
    #[must_use]
    pub fn reflection(point: DVec3, normal: DVec3) -> Self {
        // Half a turn about the normal, and the point reflection: I - 2 n nᵀ = -(2 n nᵀ - I).
        Self {
            turn: DQuat::from_xyzw(normal.x, normal.y, normal.z, 0.0),
            at: 2.0 * normal.dot(point) * normal,
            scale: -1.0,
        }
    }

    /// Returns the similarity of a matrix; `None` if it shears, stretches, flattens, projects, is not finite, or scales beyond
    /// a millionth to a million.
    #[must_use]
    pub fn of_matrix(matrix: &DMat4) -> Option<Self> {
        let linear = DMat3::from_mat4(*matrix);
        let is_affine = matrix.row(3).abs_diff_eq(glam::DVec4::W, ROUNDING);
        let size = linear.determinant().abs().cbrt();
        if !matrix.is_finite() || !is_affine || !(SCALES[0]..=SCALES[1]).contains(&size) {
            return None;
        }
        let scale = size.copysign(linear.determinant());
        let turn = linear * (1.0 / scale);
        // A rotation's transpose is its inverse.
        if !(turn.transpose() * turn).abs_diff_eq(DMat3::IDENTITY, ROUNDING) {
            return None;
        }
        Some(Self {
            turn: DQuat::from_mat3(&turn).normalize(),
            at: matrix.w_axis.truncate(),
            scale,
        })
    }

    /// Returns `true` if all numbers are finite, the rotation has unit length, and the scale is not 0.
    #[must_use]
    #[doc(hidden)]
    pub fn is_valid(&self) -> bool {
        self.at.is_finite()
            && (self.turn.length_squared() - 1.0).abs() < 1e-6
            && (SCALES[0]..=SCALES[1]).contains(&self.scale.abs())
    }

    /// Returns `true` if it turns right-handed things into left-handed ones.
    #[must_use]
    pub fn is_reflection(&self) -> bool {
        self.scale < 0.0
    }

    /// Returns the map that applies `inner` first, and then this one. Normalizes the rotation, so that errors do not grow with
    /// the number of maps.
    #[must_use]
    pub fn after(&self, inner: &Self) -> Self {
        Self {
            turn: (self.turn * inner.turn).normalize(),
            at: self.point(inner.at),
            scale: self.scale * inner.scale,
        }
    }

    /// Returns the inverse map.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let turn = self.turn.conjugate();
        let scale = self.scale.recip();
        Self {
            turn,
            at: -(turn * self.at) * scale,
            scale,
        }
    }

    /// Maps a point. [Units: wu]
    #[inline]
    #[must_use]
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.turn * (p * self.scale) + self.at
    }

    /// Maps a point by the inverse. [Units: wu]
    #[inline]
    #[must_use]
    pub fn point_back(&self, p: DVec3) -> DVec3 {
        (self.turn.conjugate() * (p - self.at)) / self.scale
    }

    /// Maps a displacement, its length included.
    #[inline]
    #[must_use]
    pub fn vector(&self, v: DVec3) -> DVec3 {
        self.turn * (v * self.scale)
    }

    /// Maps a direction; keeps its length.
    #[inline]
    #[must_use]
    #[doc(hidden)]
    pub fn direction(&self, v: DVec3) -> DVec3 {
        self.turn * (v * self.scale.signum())
    }

    /// Returns the linear part: rotation and scale.
    #[must_use]
    #[doc(hidden)]
    pub fn linear(&self) -> DMat3 {
        DMat3::from_quat(self.turn) * self.scale
    }

    /// Returns the map as a matrix.
    #[must_use]
    pub fn matrix(&self) -> DMat4 {
        DMat4::from_mat3_translation(self.linear(), self.at)
    }

    /// Returns `true` if no point within `reach` of the origin moves farther than `margin` between both maps. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn is_near(&self, other: &Self, reach: f64, margin: f64) -> bool {
        let [a, b] = [self.linear(), other.linear()];
        let columns = [
            a.x_axis - b.x_axis,
            a.y_axis - b.y_axis,
            a.z_axis - b.z_axis,
        ];
        let norm = columns
            .iter()
            .map(|c| c.length_squared())
            .sum::<f64>()
            .sqrt();
        self.at.distance(other.at) + norm * reach <= margin
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn any_similarity() -> impl Strategy<Value = Similarity> {
        let turn = prop::array::uniform4(-1.0..1.0_f64)
            .prop_filter("has a direction", |q| q.iter().any(|x| x.abs() > 0.1));
        let at = prop::array::uniform3(-1e3..1e3_f64);
        (turn, at, 0.1..10.0_f64, any::<bool>()).prop_map(|(turn, at, scale, flips)| Similarity {
            turn: DQuat::from_array(turn).normalize(),
            at: at.into(),
            scale: if flips { -scale } else { scale },
        })
    }

    proptest! {
        #[test]
        fn is_its_matrix(a in any_similarity(), b in any_similarity(), p in prop::array::uniform3(-1e3..1e3_f64)) {
            let p = DVec3::from(p);
            let (m, n) = (a.matrix(), b.matrix());
            prop_assert!(m.transform_point3(p).distance(a.point(p)) < 1e-8);
            prop_assert!((m * n).abs_diff_eq(a.after(&b).matrix(), 1e-7));
            prop_assert!(a.point_back(a.point(p)).distance(p) < 1e-9);
            prop_assert!(a.inverse().after(&a).is_near(&Similarity::IDENTITY, 1e3, 1e-8));
            let back = Similarity::of_matrix(&m).unwrap();
            prop_assert!(back.is_near(&a, 1e3, 1e-7));
            prop_assert_eq!(back.is_reflection(), m.determinant() < 0.0);
        }

        #[test]
        fn reflects_in_a_plane(n in prop::array::uniform3(-1.0..1.0_f64), at in prop::array::uniform3(-9.0..9.0_f64)) {
            let Some(n) = DVec3::from(n).try_normalize() else { return Ok(()) };
            let at = DVec3::from(at);
            let mirror = Similarity::reflection(at, n);
            let p = at + n * 3.0 + n.any_orthonormal_vector();
            prop_assert!(mirror.point(p).distance(p - 6.0 * n) < 1e-12);
            prop_assert!(mirror.after(&mirror).is_near(&Similarity::IDENTITY, 10.0, 1e-12));
        }
    }

    #[test]
    fn only_similarities_are_taken() {
        let of = |m: DMat4| Similarity::of_matrix(&m);
        assert!(of(DMat4::from_scale(DVec3::new(1.0, 1.0, 1.001))).is_none());
        assert!(of(DMat4::from_scale(DVec3::new(1.0, 1.0, 0.0))).is_none());
        assert!(of(DMat4::from_scale(DVec3::splat(1e7))).is_none());
        assert!(of(DMat4::perspective_rh(1.0, 1.0, 0.1, 9.0)).is_none());
        assert!(of(DMat4::from_translation(DVec3::NAN)).is_none());
        assert!(of(DMat4::from_scale(DVec3::new(1.0, -1.0, 1.0))).is_some());
    }
}
