//! Curves in the plane of the parameters, of which trimming loops are made.

use enfilade_geom::{DVec2, DVec3};

use super::spline::SplineBasis;

/// Least and largest weight of a control point; far beyond both, sums of weights lose their digits.
const WEIGHTS: [f64; 2] = [1e-6, 1e6];

pub(super) fn is_weight(w: f64) -> bool {
    (WEIGHTS[0]..=WEIGHTS[1]).contains(&w)
}

/// A curve in the plane of the parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeformCurve {
    /// Degree and knots.
    pub basis: SplineBasis,
    /// Control points and their weights.
    pub controls: Vec<(DVec2, f64)>,
}

/// The part of a curve from one value of its parameter to another; backwards if the second is less.
#[derive(Clone, Debug, PartialEq)]
pub struct TrimCurve {
    /// The curve.
    pub curve: FreeformCurve,
    /// Both ends.
    pub range: [f64; 2],
}

impl TrimCurve {
    /// A whole curve.
    #[must_use]
    pub fn whole(curve: FreeformCurve) -> Self {
        let range = curve.basis.range();
        Self { curve, range }
    }

    /// Returns the range in ascending order.
    pub(super) fn ascending(&self) -> [f64; 2] {
        let [a, b] = self.range;
        [a.min(b), a.max(b)]
    }

    /// Returns the problem with it.
    pub(super) fn check(&self) -> Result<(), String> {
        let FreeformCurve { basis, controls } = &self.curve;
        basis.check()?;
        basis.check_range(self.ascending())?;
        if controls.len() != basis.n_controls() {
            return Err(format!(
                "has {} control points where degree and knots need {}",
                controls.len(),
                basis.n_controls()
            ));
        }
        match controls
            .iter()
            .position(|c| !c.0.is_finite() || !is_weight(c.1))
        {
            None => Ok(()),
            Some(k) => Err(format!(
                "control point {} is not finite, or its weight is not from 1e-6 to 1e6",
                k + 1
            )),
        }
    }

    /// Returns the point at a parameter within the range.
    pub(super) fn at(&self, t: f64) -> DVec2 {
        let (first, values) = self.curve.basis.values(t);
        let controls = values.iter().zip(&self.curve.controls[first..]);
        let sum: DVec3 = controls.map(|(v, (p, w))| p.extend(1.0) * (v * w)).sum();
        sum.truncate() / sum.z
    }
}
