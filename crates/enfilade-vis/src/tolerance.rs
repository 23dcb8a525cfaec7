//! How far numbers are trusted, and the half-spaces that are held against it.

use enfilade_geom::DVec3;

/// How far numbers are trusted. [Units: wu]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tolerance {
    /// A clip keeps this much more.
    pub(crate) outward: f64,
    /// Rounding of `normal · point`.
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
    /// Whether a ball (middle, radius) lies in it.
    #[inline]
    pub(crate) fn holds(&self, [x, y, z, radius]: [f64; 4]) -> bool {
        self.normal.dot(DVec3::new(x, y, z)) - self.offset >= radius
    }
}
