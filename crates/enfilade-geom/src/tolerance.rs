//! Tolerances for contact between geometry with `f32` vertices.
//!
//! Half a unit in the last place of an `f32` is `6e-8` of the number, and a plane through three such vertices deviates by a
//! few times that in the neighborhood of its polygon. Builders, the run-time and the checker use the same fraction of the
//! scene's extent, so that none calls open what another calls closed.

use crate::Aabb;

/// Deviation of planes and vertices, as a fraction of the largest coordinate.
const SHARE: f64 = 4e-7;

/// Returns the distance within which a vertex lies in a plane, for coordinates up to `extent` from the origin. [Units: wu]
///
/// At least 2 µm, far below any relevant opening.
#[must_use]
pub fn plane_tolerance(extent: f64) -> f64 {
    (SHARE * extent).max(2e-6)
}

/// Returns the largest shift of planes by a builder and of vertices by a file, in a world with coordinates up to `extent`
/// from the origin: checks do not judge anything nearer than that to a wall or a portal's outline. [Units: wu]
///
/// At least 20 µm, for any builder.
#[must_use]
pub fn world_tolerance(extent: f64) -> f64 {
    (SHARE * extent).max(2e-5)
}

impl Aabb {
    /// Returns its largest absolute coordinate; 0 if empty. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn extent(&self) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        self.min.abs().max(self.max.abs()).max_element()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DVec3;

    #[test]
    fn tolerances_grow_with_the_farthest_coordinate_of_either_sign() {
        let near = Aabb::new(DVec3::splat(-1.0), DVec3::splat(1.0));
        let far = Aabb::new(DVec3::new(0.0, -1000.0, 0.0), DVec3::splat(1.0));
        assert_eq!(
            [near, far, Aabb::EMPTY].map(|b| b.extent()),
            [1.0, 1000.0, 0.0]
        );
        assert_eq!(plane_tolerance(1.0), 2e-6);
        assert_eq!(world_tolerance(1.0), 2e-5);
        assert!((plane_tolerance(1000.0) - 4e-4).abs() < 1e-18);
        assert_eq!(world_tolerance(1000.0), plane_tolerance(1000.0));
    }
}
