//! Distances that count as touching in a tree.

use enfilade_geom::{Aabb, plane_tolerance};

/// Distances that count as touching. [Units: wu]
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolerance {
    /// Vertices this near to a plane lie in it.
    pub(super) plane: f64,
    /// The same when portals are cut by planes, which are exact.
    pub(super) cut: f64,
    /// Portals narrower than this are closed.
    pub(super) width: f64,
}

impl Tolerance {
    /// Returns tolerances for vertices that are `f32` numbers of this size.
    pub(super) fn for_bounds(bounds: &Aabb) -> Self {
        let extent = bounds.extent();
        // Twice the measure of the cell complex, since a brush's exact plane and its rounded vertices may deviate to
        // either side.
        let plane = 2.0 * plane_tolerance(extent);
        Self {
            plane,
            cut: (1e-9 * extent).max(1e-8),
            width: 4.0 * plane,
        }
    }
}
