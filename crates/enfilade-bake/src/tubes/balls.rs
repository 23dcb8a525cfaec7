//! Balls of air, whatever its parts are.

use enfilade_geom::{Allowance, DVec3};

/// Parts of the air, each with a ball: tetrahedra or voxels.
pub(crate) trait Balls {
    /// Returns the number of parts.
    fn n_parts(&self) -> usize;

    /// Returns the radius of the ball of a part. [Units: wu]
    fn radius(&self, t: u32) -> f64;

    /// Returns the center of the ball of a part. [Units: wu]
    fn center(&self, t: u32) -> DVec3;

    /// Returns what a part belongs to: a fork lies within one of these.
    fn owner(&self, t: u32) -> u32;

    /// Returns the neighbors of a part, each with the radius of the widest ball that passes. [Units: wu]
    fn ways(&self, t: u32) -> impl Iterator<Item = (u32, f64)>;

    fn allowance(&self) -> &Allowance;
}
