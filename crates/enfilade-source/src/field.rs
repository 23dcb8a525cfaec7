//! Fields: how far from the surface, and on which side.

use enfilade_geom::{Aabb, DVec3};

/// A field over space, whose zero set is the surface between matter, where it is negative, and air.
///
/// Its values need not be distances: an extraction asks only for signs, for zeros along edges, and for bounds.
pub trait Field {
    /// Returns the value at a point. Equal points have equal values, to the bit.
    fn at(&self, p: DVec3) -> f64;

    /// Returns bounds on the values in a closed box; never too narrow.
    fn range(&self, within: &Aabb) -> Interval;

    /// Returns a cheaper field with the same values in a box, if there is one.
    fn narrowed(&self, within: &Aabb) -> Option<Box<dyn Field + '_>> {
        let _ = within;
        None
    }

    /// Returns the unit direction into the air at a point of the surface, if the field is exact enough to show its edges.
    fn normal(&self, p: DVec3) -> Option<DVec3> {
        let _ = p;
        None
    }

    /// Returns about how much work one value takes, in values of a ball.
    fn cost(&self) -> u64 {
        1
    }
}

/// A closed interval of values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Least value.
    pub lo: f64,
    /// Largest value.
    pub hi: f64,
}

impl Interval {
    /// Returns the values of a field in a box that has `value` in its middle and changes at most as fast as the distance
    /// does.
    #[must_use]
    pub fn of_slope_one(value: f64, within: &Aabb) -> Self {
        let reach = within.size().length() * 0.5;
        // The rounding of a few dozen operations on coordinates of this size.
        let size = within.min.abs().max(within.max.abs()).max_element() + value.abs() + reach;
        let reach = reach + 64.0 * f64::EPSILON * size;
        Self {
            lo: value - reach,
            hi: value + reach,
        }
    }

    /// Returns `true` if it has zero, or values on both sides of it, or a bound is `NaN`.
    #[must_use]
    pub fn has_zero(self) -> bool {
        !(self.lo > 0.0 || self.hi < 0.0)
    }
}
