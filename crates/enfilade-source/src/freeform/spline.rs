//! Degree and knots of a spline, and its parts without inner knots as Bézier curves.

use std::ops::{Add, Mul};

/// Shortest part between knots. [Units: the range of the parameter]
const SHORTEST: f64 = 1e-9;

/// Degree and knots along one parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct SplineBasis {
    /// Degree, from 1 to 16.
    pub degree: usize,
    /// Knots in ascending order: the number of control points, plus the degree, plus one.
    pub knots: Vec<f64>,
}

/// A part of a range without knots inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SplineSpan {
    /// Index of the last knot at or before it.
    knot: usize,
    pub(super) from: f64,
    pub(super) to: f64,
}

impl SplineBasis {
    /// Largest degree: programs write at most 9, and the time to evaluate a point grows with its square.
    pub const MAX_DEGREE: usize = 16;

    /// Bézier curves joined end to end, from the values of the parameter at their ends. Curves of degree `d` have `d + 1`
    /// control points each, of which neighbors share one.
    #[must_use]
    pub fn bezier(degree: usize, ends: &[f64]) -> Self {
        let mut knots = Vec::new();
        for (i, &end) in ends.iter().enumerate() {
            let is_last = i == 0 || i + 1 == ends.len();
            knots.extend(std::iter::repeat_n(end, degree + usize::from(is_last)));
        }
        Self { degree, knots }
    }

    /// Evenly spaced knots for a number of control points, so that the curve starts and ends at the first and last of them.
    #[must_use]
    pub fn clamped(degree: usize, n_controls: usize) -> Self {
        let n = n_controls.saturating_sub(degree);
        let knots = (0..n_controls + degree + 1)
            .map(|k| k.saturating_sub(degree).min(n) as f64)
            .collect();
        Self { degree, knots }
    }

    /// Returns the number of control points.
    #[must_use]
    pub fn n_controls(&self) -> usize {
        self.knots.len().saturating_sub(self.degree + 1)
    }

    /// Returns the values of the parameter for which the spline is defined.
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        [self.knots[self.degree], self.knots[self.n_controls()]]
    }

    /// Returns the problem with degree and knots.
    pub(super) fn check(&self) -> Result<(), String> {
        let (d, n) = (self.degree, self.knots.len());
        if d == 0 || d > Self::MAX_DEGREE {
            let most = Self::MAX_DEGREE;
            return Err(format!("the degree is {d}; 1 to {most} are possible"));
        }
        if n < 2 * (d + 1) {
            return Err(format!(
                "degree {d} needs {} knots or more, and {} control points; there are {n} knots",
                2 * (d + 1),
                d + 1
            ));
        }
        if let Some(k) = self.knots.iter().position(|t| !t.is_finite()) {
            return Err(format!("knot {} is not finite", k + 1));
        }
        if let Some(k) = self.knots.windows(2).position(|t| t[1] < t[0]) {
            return Err(format!("knot {} is less than the one before it", k + 2));
        }
        // The ends of the range, and all knots within, may be repeated as often as the degree and once more at the ends.
        let torn = |k: &usize| self.knots[*k] == self.knots[k + d];
        if let Some(k) = (1..n - d - 1).find(torn) {
            return Err(format!(
                "knot {} is repeated more than {d} times; give the parts as patches of their own",
                k + 1
            ));
        }
        Ok(())
    }

    /// Returns it, or the problem with it.
    pub(super) fn checked(self) -> Result<Self, String> {
        self.check().map(|()| self)
    }

    /// Returns the problem with a range of the parameter.
    pub(super) fn check_range(&self, [from, to]: [f64; 2]) -> Result<(), String> {
        let [least, most] = self.range();
        if from >= least && to <= most && to - from > SHORTEST * (most - least) {
            return Ok(());
        }
        Err(format!(
            "the range from {from} to {to} is empty, or leaves that of the knots, from {least} to {most}"
        ))
    }

    /// Returns the parts of a range.
    pub(super) fn spans(&self, [from, to]: [f64; 2]) -> Vec<SplineSpan> {
        let shortest = SHORTEST * (to - from);
        let mut spans: Vec<SplineSpan> = Vec::new();
        let mut start = from;
        for k in self.degree..self.n_controls() {
            let end = self.knots[k + 1].min(to);
            if end - start > shortest && self.knots[k] < to {
                spans.push(SplineSpan {
                    knot: k,
                    from: start,
                    to: end,
                });
                start = end;
            }
        }
        // The rest is too short to count.
        if let Some(last) = spans.last_mut() {
            last.to = to;
        }
        spans
    }

    /// Returns the inner knots at which a spline may have a crease.
    pub(super) fn creases(&self) -> Vec<f64> {
        let (d, n) = (self.degree, self.n_controls());
        (d + 1..n)
            .filter(|&k| self.knots[k] == self.knots[k + d - 1])
            .map(|k| self.knots[k])
            .collect()
    }

    /// Returns the first control point that matters at a parameter, and the weights of it and of the next.
    pub(super) fn values(&self, t: f64) -> (usize, Vec<f64>) {
        let (d, knots) = (self.degree, &self.knots);
        let after = knots.partition_point(|k| *k <= t);
        let k = after.clamp(d + 1, self.n_controls()) - 1;
        // At the end of the range, the last part that has a length.
        let k = (d..=k)
            .rev()
            .find(|&k| knots[k] < knots[k + 1])
            .unwrap_or(k);
        let mut values = vec![1.0];
        for r in 1..=d {
            let mut next = vec![0.0; r + 1];
            for (j, value) in values.iter().enumerate() {
                let (a, b) = (knots[k + 1 + j - r], knots[k + 1 + j]);
                let share = (t - a) / (b - a);
                next[j] += value * (1.0 - share);
                next[j + 1] += value * share;
            }
            values = next;
        }
        (k - d, values)
    }

    /// Returns the control points of a span as a Bézier curve. `control` gives those of the spline.
    pub(super) fn bezier_of<P>(&self, span: SplineSpan, control: impl Fn(usize) -> P) -> Vec<P>
    where
        P: Copy + Add<Output = P> + Mul<f64, Output = P>,
    {
        let d = self.degree;
        (0..=d)
            .map(|j| {
                let mut points: Vec<P> = (span.knot - d..=span.knot).map(&control).collect();
                // The polar form at `from`, d - j times, and at `to`, j times.
                for r in 1..=d {
                    let t = if r <= d - j { span.from } else { span.to };
                    for i in 0..=d - r {
                        let k = span.knot - d + r + i;
                        let (a, b) = (self.knots[k], self.knots[span.knot + 1 + i]);
                        points[i] = between(points[i], points[i + 1], (t - a) / (b - a));
                    }
                }
                points[0]
            })
            .collect()
    }
}

/// Returns a point between two others; exactly one of them at its end.
pub(super) fn between<P>(a: P, b: P, share: f64) -> P
where
    P: Copy + Add<Output = P> + Mul<f64, Output = P>,
{
    if share == 0.0 {
        a
    } else if share == 1.0 {
        b
    } else {
        a * (1.0 - share) + b * share
    }
}

/// Returns a point of a Bézier curve (de Casteljau).
pub(super) fn bezier_at<P>(controls: &[P], t: f64) -> P
where
    P: Copy + Add<Output = P> + Mul<f64, Output = P>,
{
    let mut points = controls.to_vec();
    for n in (1..points.len()).rev() {
        for i in 0..n {
            points[i] = between(points[i], points[i + 1], t);
        }
    }
    points[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_as_bezier_curve_is_the_spline() {
        let basis = SplineBasis {
            degree: 3,
            knots: vec![0.0, 0.0, 0.0, 0.0, 0.3, 0.3, 0.9, 1.0, 1.2, 1.5, 1.5],
        };
        let controls = [0.0, 2.0, -1.0, 4.0, 3.5, -2.0, 1.0];
        assert_eq!(basis.range(), [0.0, 1.0]);
        let spans = basis.spans([0.1, 1.0]);
        assert_eq!(spans.len(), 3);
        for span in spans {
            let bezier = basis.bezier_of(span, |k| controls[k]);
            for i in 0..=8 {
                let t = f64::from(i) / 8.0;
                let (first, weights) = basis.values(span.from + t * (span.to - span.from));
                let wanted: f64 = weights
                    .iter()
                    .zip(&controls[first..])
                    .map(|(w, c)| w * c)
                    .sum();
                let found = bezier_at(&bezier, t);
                assert!(
                    (found - wanted).abs() < 1e-12,
                    "{span:?} {t}: {found} {wanted}"
                );
            }
        }
    }

    #[test]
    fn joined_bezier_curves_meet_at_every_degreeth_control_point() {
        let basis = SplineBasis::bezier(2, &[0.0, 1.0, 3.0]);
        assert_eq!(basis.n_controls(), 5);
        let (first, weights) = basis.values(1.0);
        let at_joint: Vec<_> = weights.iter().enumerate().filter(|w| *w.1 != 0.0).collect();
        assert_eq!((first + at_joint[0].0, at_joint.len()), (2, 1));
    }

    #[test]
    fn unusable_knots_are_named() {
        let said = |degree, knots: &[f64]| {
            let basis = SplineBasis {
                degree,
                knots: knots.to_vec(),
            };
            basis.check().unwrap_err()
        };
        assert!(said(0, &[0.0, 1.0]).contains("degree is 0"));
        assert!(said(2, &[0.0, 0.0, 1.0, 1.0]).contains("6 knots"));
        assert!(said(1, &[0.0, 0.0, f64::NAN, 1.0]).contains("knot 3 is not finite"));
        assert!(said(1, &[0.0, 1.0, 0.5, 1.0]).contains("knot 3 is less"));
        assert!(said(1, &[0.0, 0.0, 1.0, 1.0, 2.0, 2.0]).contains("repeated more than 1"));
        assert!(said(2, &[1.0; 6]).contains("repeated"));
    }
}
