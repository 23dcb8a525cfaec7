//! How near counts as touching, where corners are `f32` numbers.
//!
//! Half a unit in the last place of an `f32` is `6e-8` of the number, and a plane through three such corners strays a
//! few times that over its own polygon's neighborhood. Builders, the run-time and the checker take the same share of
//! the scene's extent, so that none of them calls open what another calls closed.

use crate::Aabb;

/// How far planes and corners stray, as a share of the largest coordinate.
const SHARE: f64 = 4e-7;

/// Corners this near to a plane lie in it, for coordinates up to `extent` from the origin. [Units: wu]
///
/// Not less than 2 µm, which is far below any opening that matters.
#[must_use]
pub fn plane_tolerance(extent: f64) -> f64 {
    (SHARE * extent).max(2e-6)
}

/// How far a builder may move planes and a file may round corners, of a world with coordinates up to `extent` from the
/// origin: what lies nearer to a wall or a portal's outline is judged neither way. [Units: wu]
///
/// Not less than 20 µm, whichever builder made the world.
#[must_use]
pub fn world_tolerance(extent: f64) -> f64 {
    (SHARE * extent).max(2e-5)
}

impl Aabb {
    /// The largest coordinate of it, as an absolute number; 0 when empty. [Units: wu]
    #[must_use]
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
