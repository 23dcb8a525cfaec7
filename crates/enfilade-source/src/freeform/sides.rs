//! Sides of patches, divided as the curve on them is, so that patches that share it share its vertices.

use std::collections::HashMap;

use enfilade_geom::{DVec3, DVec4};

use super::lattice::Lattice2;
use super::patch::{Budget, FreeformSurface};
use super::spline::{SplineSpan, bezier_at};
use crate::SourceError;

/// Curves whose control points differ by less are the same. [Units: tolerances]
const SAME: f64 = 1e-3;
/// Weights that differ by less are the same.
const SAME_WEIGHT: f64 = 1e-6;

/// A vertex on the limit of a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LimitVertex {
    /// Place in the lattice of its patch.
    pub(super) at: [f64; 2],
    pub(super) position: DVec3,
}

/// A Bézier curve to the precision to which two are the same, in one of its directions.
type CurveKey = Vec<[i64; 4]>;

/// The number of steps of each curve that is a part of a side.
pub(super) struct Sides {
    tolerance: f64,
    steps: HashMap<CurveKey, usize>,
}

/// Part of a side as a Bézier curve in the direction that all patches agree on.
struct SidePart {
    controls: Vec<DVec4>,
    is_reversed: bool,
    key: CurveKey,
}

impl SidePart {
    /// Returns into how many chords the curve has to be divided: of a second derivative `d` across the curve, a chord over a share
    /// `a` of it is `a²d/8` off.
    fn n_steps(&self, tolerance: f64) -> usize {
        const APART: f64 = 1.0 / 64.0;
        let at = |t: f64| {
            let p = bezier_at(&self.controls, t);
            p.truncate() / p.w
        };
        let n = 2 * self.controls.len();
        let bend = (0..n).map(|k| {
            let t = (k as f64 + 0.5) / n as f64;
            let [before, p, after] = [at(t - APART), at(t), at(t + APART)];
            let along = (after - before).normalize_or_zero();
            (before - 2.0 * p + after)
                .reject_from_normalized(along)
                .length()
                / (APART * APART)
        });
        let most = bend.fold(0.0, f64::max);
        ((most / (8.0 * tolerance)).sqrt().ceil() as usize).max(1)
    }
}

impl Sides {
    pub(super) fn new(tolerance: f64) -> Self {
        Self {
            tolerance,
            steps: HashMap::new(),
        }
    }

    /// Counts the steps that a patch needs along its sides.
    pub(super) fn count(
        &mut self,
        patch: &FreeformSurface,
        lattice: &Lattice2,
        budget: &mut Budget<'_>,
    ) -> Result<(), SourceError> {
        for axis in 0..2 {
            for end in 0..2 {
                for &(span, n) in &lattice.steps[axis] {
                    let part = self.part(patch, [axis, end], span);
                    let n_own = part.n_steps(self.tolerance);
                    budget.take(patch, n_own as f64, patch.cost())?;
                    let steps = self.steps.entry(part.key).or_default();
                    *steps = n.max(*steps).max(n_own);
                }
            }
        }
        Ok(())
    }

    /// Returns the four sides of a patch, counter-clockwise, each without its last vertex.
    pub(super) fn outline(
        &self,
        patch: &FreeformSurface,
        lattice: &Lattice2,
    ) -> [Vec<LimitVertex>; 4] {
        [[0, 0], [1, 1], [0, 1], [1, 0]].map(|[axis, end]| {
            let far = lattice.size()[1 - axis] as f64 * end as f64;
            let mut side: Vec<LimitVertex> = Vec::new();
            let mut before = 0.0;
            for &(span, n) in &lattice.steps[axis] {
                let part = self.part(patch, [axis, end], span);
                let n_parts = self.steps.get(&part.key).map_or(n, |&most| most.max(n));
                // Both ends; the first is the last of the part before.
                for k in usize::from(!side.is_empty())..=n_parts {
                    let share = k as f64 / n_parts as f64;
                    let t = match part.is_reversed {
                        true => (n_parts - k) as f64 / n_parts as f64,
                        false => share,
                    };
                    let p = bezier_at(&part.controls, t);
                    let mut at = [far; 2];
                    at[axis] = before + share * n as f64;
                    side.push(LimitVertex {
                        at,
                        position: p.truncate() / p.w,
                    });
                }
                before += n as f64;
            }
            // The second and third sides go on in the direction of their parameter or against it.
            if axis == end {
                side.pop();
            } else {
                side.reverse();
                side.pop();
            }
            side
        })
    }

    /// Returns a part of a side: along an axis, at the least or largest value of the other parameter.
    fn part(&self, patch: &FreeformSurface, [axis, end]: [usize; 2], span: SplineSpan) -> SidePart {
        let (first, values) = patch.bases[1 - axis].values(patch.range[1 - axis][end]);
        let n = patch.bases[0].n_controls();
        let mut controls: Vec<DVec4> = patch.bases[axis].bezier_of(span, |k| {
            let of = |(i, value): (usize, &f64)| {
                let at = match axis {
                    0 => k + n * (first + i),
                    _ => first + i + n * k,
                };
                let (p, w) = patch.controls[at];
                p.extend(1.0) * (w * value)
            };
            values.iter().enumerate().map(of).sum()
        });
        let heaviest = controls.iter().map(|c| c.w).fold(0.0, f64::max);
        controls.iter_mut().for_each(|c| *c /= heaviest);
        let rounded = |c: &DVec4| {
            let p = (c.truncate() / c.w / (SAME * self.tolerance)).round();
            [p.x, p.y, p.z, (c.w / SAME_WEIGHT).round()].map(|v| v as i64)
        };
        let key: CurveKey = controls.iter().map(rounded).collect();
        let backwards: CurveKey = key.iter().rev().copied().collect();
        if backwards < key {
            controls.reverse();
            SidePart {
                controls,
                is_reversed: true,
                key: backwards,
            }
        } else {
            SidePart {
                controls,
                is_reversed: false,
                key,
            }
        }
    }
}
