//! The parameters at which a patch is evaluated.

use enfilade_geom::DVec3;

use super::patch::{Budget, FreeformSurface, TERMS, TOO_MUCH};
use super::spline::SplineSpan;
use crate::SourceError;

/// Lines of parameters across a patch, so close that triangles between their crossings are within the tolerance. Its
/// coordinates count lines.
pub(super) struct Lattice2 {
    /// For each parameter: parts without knots inside, and the number of steps in each.
    pub(super) steps: [Vec<(SplineSpan, usize)>; 2],
}

impl Lattice2 {
    pub(super) fn new(
        patch: &FreeformSurface,
        tolerance: f64,
        budget: &mut Budget<'_>,
    ) -> Result<Self, SourceError> {
        let spans = [0, 1].map(|a| patch.bases[a].spans(patch.range[a]));
        let n_spans = (spans[0].len() * spans[1].len()) as f64;
        // The values that a second fundamental form takes.
        budget.take(patch, n_spans, 36.0 * patch.cost() * patch.cost())?;
        // The same again for each part as it is done, for those who look at the clock.
        let of_each = 36.0 * patch.cost() * patch.cost() / TERMS;
        let mut n = [vec![1.0; spans[0].len()], vec![1.0; spans[1].len()]];
        for (j, &v) in spans[1].iter().enumerate() {
            for (i, &u) in spans[0].iter().enumerate() {
                if !budget.purse.spend(of_each as u64) {
                    return Err(patch.error(TOO_MUCH));
                }
                let [along, across, twist] = curvature(patch, [u, v]);
                // A right triangle with steps a and b along the axes is a²/8 (along + twist) +
                // b²/8 (across + twist) off; half of the error from each.
                let steps = |most: f64| ((most + twist) / (4.0 * tolerance)).sqrt().ceil();
                n[0][i] = f64::max(n[0][i], steps(along));
                n[1][j] = f64::max(n[1][j], steps(across));
            }
        }
        let [m, n_lines] = [0, 1].map(|a| n[a].iter().sum::<f64>());
        let n_parts = (spans[0].len() + spans[1].len()) as f64;
        budget.take(patch, 2.0 * m * n_lines, patch.cost() + n_parts / 8.0)?;
        let steps = [0, 1].map(|a| {
            let n = n[a].iter().map(|n| *n as usize);
            spans[a].iter().copied().zip(n).collect()
        });
        Ok(Self { steps })
    }

    /// Returns the work of a value at a place: the patch's, and a search among the parts.
    pub(super) fn cost(&self, patch: &FreeformSurface) -> f64 {
        patch.cost() + (self.steps[0].len() + self.steps[1].len()) as f64 / 8.0
    }

    /// Returns the number of steps along each axis.
    pub(super) fn size(&self) -> [usize; 2] {
        [0, 1].map(|a| self.steps[a].iter().map(|s| s.1).sum())
    }

    /// Returns the lines along which the patch may have a crease, across each axis.
    pub(super) fn creases(&self, patch: &FreeformSurface) -> [Vec<f64>; 2] {
        [0, 1].map(|axis| {
            let at = |t: f64| {
                let mut both = patch.range.map(|r| r[0]);
                both[axis] = t;
                self.place(both)[axis]
            };
            let [from, to] = patch.range[axis];
            let inner = patch.bases[axis].creases().into_iter();
            let mut lines: Vec<f64> = inner.filter(|t| *t > from && *t < to).map(at).collect();
            lines.dedup();
            lines
        })
    }

    /// Returns the parameters at a place of the lattice.
    pub(super) fn parameters(&self, at: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| {
            let mut left = at[axis];
            let steps = &self.steps[axis];
            for (k, (span, n)) in steps.iter().enumerate() {
                let n = *n as f64;
                if left <= n || k + 1 == steps.len() {
                    let share = (left / n).clamp(0.0, 1.0);
                    return span.from * (1.0 - share) + span.to * share;
                }
                left -= n;
            }
            f64::NAN
        })
    }

    /// Returns the place of parameters.
    pub(super) fn place(&self, parameters: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| {
            let mut before = 0.0;
            let steps = &self.steps[axis];
            for (k, (span, n)) in steps.iter().enumerate() {
                if parameters[axis] <= span.to || k + 1 == steps.len() {
                    let share = (parameters[axis] - span.from) / (span.to - span.from);
                    return before + share.clamp(0.0, 1.0) * *n as f64;
                }
                before += *n as f64;
            }
            f64::NAN
        })
    }
}

/// Share of a span by which values for a second derivative are apart.
const APART: f64 = 1.0 / 64.0;

/// Returns the largest second derivatives found along the first parameter of a part, the second, and both, by spans, as far as they
/// point out of the surface.
fn curvature(patch: &FreeformSurface, spans: [SplineSpan; 2]) -> [f64; 3] {
    let [m, n] = [0, 1].map(|a| 2 * patch.bases[a].degree + 1);
    let mut most = [0.0_f64; 3];
    for j in 0..n {
        for i in 0..m {
            let share = [(i as f64 + 0.5) / m as f64, (j as f64 + 0.5) / n as f64];
            let at = |k: f64, l: f64| {
                let moved = [share[0] + k * APART, share[1] + l * APART];
                patch.at([0, 1].map(|a| spans[a].from + (spans[a].to - spans[a].from) * moved[a]))
            };
            let p = at(0.0, 0.0);
            let [e, w, n, s] = [at(1.0, 0.0), at(-1.0, 0.0), at(0.0, 1.0), at(0.0, -1.0)];
            let out = (e - w).cross(n - s).normalize_or_zero();
            // Where a side is a point, there is no normal nearby.
            let size = |d: DVec3| match out == DVec3::ZERO {
                true => d.length() / (APART * APART),
                false => d.dot(out).abs() / (APART * APART),
            };
            let twist = (at(1.0, 1.0) - at(1.0, -1.0) - at(-1.0, 1.0) + at(-1.0, -1.0)) / 4.0;
            let found = [e - 2.0 * p + w, n - 2.0 * p + s, twist].map(size);
            most = [0, 1, 2].map(|k| most[k].max(found[k]));
        }
    }
    most
}
