//! A patch: its points, the limits of its parameters, and what is wrong with it.

use enfilade_geom::{DVec3, DVec4, Purse};

use super::curves::{self, FreeformCurve, TrimCurve};
use super::spline::SplineBasis;
use crate::SourceError;

/// A patch: a surface over a rectangle of two parameters. [Units: those of its file]
#[derive(Clone, Debug, PartialEq)]
pub struct FreeformSurface {
    /// Line or element, for messages.
    pub place: String,
    /// Degree and knots along each parameter.
    pub bases: [SplineBasis; 2],
    /// Control points and their weights, the first parameter fastest.
    pub controls: Vec<(DVec3, f64)>,
    /// Least and largest value of each parameter.
    pub range: [[f64; 2]; 2],
    /// Closed loops in the plane of the parameters; what an odd number of them surrounds is kept. All of it without any.
    pub loops: Vec<Vec<TrimCurve>>,
}

/// The triangles and the work that are left.
pub(super) struct Budget<'l> {
    pub(super) n_triangles: u64,
    pub(super) work: u64,
    pub(super) purse: Purse<'l>,
}

/// Terms of a sum for a value in a unit of work.
pub(super) const TERMS: f64 = 16.0;

impl Budget<'_> {
    /// Takes work, in terms of sums for values; returns `false` if there is not as much left.
    pub(super) fn spend(&mut self, work: f64) -> bool {
        let is_enough = work <= self.work as f64 && self.purse.spend((work / TERMS) as u64 + 1);
        self.work = self.work.saturating_sub(work as u64);
        is_enough
    }

    /// Takes triangles, and evaluations of a cost each.
    pub(super) fn take(
        &mut self,
        patch: &FreeformSurface,
        n_triangles: f64,
        cost: f64,
    ) -> Result<(), SourceError> {
        // Also if a number is not one.
        let is_enough = n_triangles <= self.n_triangles as f64 && self.spend(n_triangles * cost);
        if !is_enough {
            return Err(patch.error(TOO_MUCH));
        }
        self.n_triangles -= n_triangles as u64;
        Ok(())
    }
}

impl FreeformSurface {
    /// Returns the point at two parameters within the range.
    #[must_use]
    pub fn at(&self, parameters: [f64; 2]) -> DVec3 {
        let [(i, along), (j, across)] = [0, 1].map(|a| self.bases[a].values(parameters[a]));
        let n = self.bases[0].n_controls();
        let mut sum = DVec4::ZERO;
        for (row, b) in across.iter().enumerate() {
            for (column, a) in along.iter().enumerate() {
                let (p, w) = self.controls[i + column + n * (j + row)];
                sum += p.extend(1.0) * (w * a * b);
            }
        }
        sum.truncate() / sum.w
    }

    /// Returns the distance of a point from the surface near two parameters; that of the nearest point found.
    pub(super) fn distance(&self, p: DVec3, mut near: [f64; 2]) -> f64 {
        let mut least = f64::INFINITY;
        for _ in 0..3 {
            let at = self.at(near);
            least = least.min(at.distance(p));
            // The foot of the point on the plane that touches there.
            let steps = [0, 1].map(|a| (self.range[a][1] - self.range[a][0]) * 1e-5);
            let [u, v] = [0, 1].map(|a| {
                let mut beside = near;
                let is_last = near[a] + steps[a] > self.range[a][1];
                let step = if is_last { -steps[a] } else { steps[a] };
                beside[a] += step;
                (self.at(beside) - at) / step
            });
            let (off, uv) = (p - at, u.dot(v));
            let [uu, vv] = [u.dot(u), v.dot(v)];
            let area = uu * vv - uv * uv;
            if area <= 1e-12 * uu * vv {
                break;
            }
            let [pu, pv] = [off.dot(u), off.dot(v)];
            let moves = [(pu * vv - pv * uv) / area, (pv * uu - pu * uv) / area];
            near = [0, 1].map(|a| (near[a] + moves[a]).clamp(self.range[a][0], self.range[a][1]));
        }
        least
    }

    /// Keeps what `kept` surround, all without any, except what `holes` surround.
    pub fn trim(&mut self, kept: Vec<Vec<TrimCurve>>, holes: Vec<Vec<TrimCurve>>) {
        let is_whole = kept.is_empty() && !holes.is_empty();
        self.loops = kept;
        if is_whole {
            let [[u0, u1], [v0, v1]] = self.range;
            let vertices = [[u0, v0], [u1, v0], [u1, v1], [u0, v1], [u0, v0]];
            self.loops.push(vec![TrimCurve::whole(FreeformCurve {
                basis: SplineBasis::clamped(1, vertices.len()),
                controls: vertices.map(|p| (p.into(), 1.0)).to_vec(),
            })]);
        }
        self.loops.extend(holes);
    }

    /// Returns the work of a value.
    pub(super) fn cost(&self) -> f64 {
        let [p, q] = [0, 1].map(|a| (self.bases[a].degree + 1) as f64);
        p * q
    }

    pub(super) fn error(&self, problem: impl Into<String>) -> SourceError {
        SourceError::new(&self.place, problem)
    }

    pub(super) fn check(&self) -> Result<(), SourceError> {
        for (axis, basis) in self.bases.iter().enumerate() {
            let name = ["u", "v"][axis];
            (basis.check()).map_err(|problem| self.error(format!("along {name}: {problem}")))?;
            let range = self.range[axis];
            (basis.check_range(range))
                .map_err(|problem| self.error(format!("along {name}: {problem}")))?;
        }
        let [m, n] = [0, 1].map(|a| self.bases[a].n_controls());
        if self.controls.len() != m * n {
            let problem = format!(
                "has {} control points where degrees and knots need {m} × {n}",
                self.controls.len()
            );
            return Err(self.error(problem));
        }
        let is_bad = |c: &(DVec3, f64)| !c.0.is_finite() || c.0.abs().max_element() > MAX_LENGTH;
        if let Some(k) = self.controls.iter().position(is_bad) {
            let problem = format!("control point {} is not finite, or beyond 1e9", k + 1);
            return Err(self.error(problem));
        }
        let weights = self.controls.iter().map(|c| c.1);
        if let Some(k) = weights.clone().position(|w| !curves::is_weight(w)) {
            let problem = format!(
                "control point {} has the weight {}; weights from 1e-6 to 1e6 are needed",
                k + 1,
                self.controls[k].1
            );
            return Err(self.error(problem));
        }
        Ok(())
    }
}

/// The problem with a patch that exceeds the budget.
pub(super) const TOO_MUCH: &str =
    "needs more triangles than are allowed; give a larger --patch-tolerance, or check its unit";

/// Largest coordinate: beyond, numbers are no longer exact to a thousandth.
const MAX_LENGTH: f64 = 1e9;
