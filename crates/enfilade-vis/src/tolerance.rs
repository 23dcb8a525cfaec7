//! Numeric tolerances, and half-spaces that use them.

use enfilade_geom::DVec3;

/// Numeric tolerances. [Units: wu]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tolerance {
    /// Extra distance that a clip keeps.
    pub(crate) outward: f64,
    /// Rounding error of `normal · point`.
    pub(crate) rounding: f64,
    /// A sight line that stays this far inside every opening's edges is never lost.
    pub(crate) clearance: f64,
}

impl Tolerance {
    pub(crate) fn new(scale: f64, clearance: f64) -> Self {
        Self {
            outward: 1e-9 * scale,
            rounding: 1e-13 * scale,
            clearance,
        }
    }
}

/// The part of space where `normal · p >= offset`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HalfSpace {
    pub(crate) normal: DVec3,
    pub(crate) offset: f64,
}

impl HalfSpace {
    /// Returns `true` if a ball (center, radius) lies in it.
    #[inline]
    pub(crate) fn holds(&self, [x, y, z, radius]: [f64; 4]) -> bool {
        self.normal.dot(DVec3::new(x, y, z)) - self.offset >= radius
    }
}
