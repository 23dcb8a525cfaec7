//! Trimming loops as polylines.

use enfilade_geom::{DVec2, DVec3, closest_point_on_segment};

use super::curves::TrimCurve;
use super::lattice::Lattice2;
use super::patch::{Budget, FreeformSurface, TOO_MUCH};
use super::sides::LimitVertex;
use crate::SourceError;

/// Times that a part of a curve is halved at most.
const MOST_HALVINGS: u32 = 16;
/// How far a trimming curve may leave the range of the parameters. [Units: the range]
const BEYOND: f64 = 1e-6;
/// Most of the tolerance that a polyline may be from its curve.
const SHARE: f64 = 0.5;

/// A closed polyline in the plane of the lattice.
#[derive(Debug)]
pub(super) struct Polyline(pub(super) Vec<LimitVertex>);

impl Polyline {
    pub(super) fn of_sides(outline: &[Vec<LimitVertex>; 4]) -> Self {
        Self(outline.concat())
    }

    /// Returns the pairs of neighbors.
    pub(super) fn edges(&self) -> impl Iterator<Item = [&LimitVertex; 2]> {
        let next = self.0.iter().cycle().skip(1);
        self.0.iter().zip(next).map(|(a, b)| [a, b])
    }
}

/// Returns the loops of a patch, within `tolerance` of their curves.
pub(super) fn polylines(
    patch: &FreeformSurface,
    lattice: &Lattice2,
    outline: &[Vec<LimitVertex>; 4],
    tolerance: f64,
    budget: &mut Budget<'_>,
) -> Result<Vec<Polyline>, SourceError> {
    let creases = lattice.creases(patch);
    let mut all = Vec::with_capacity(patch.loops.len());
    for (k, curves) in patch.loops.iter().enumerate() {
        let bad = |problem: String| patch.error(format!("trimming loop {}: {problem}", k + 1));
        let mut tracer = Tracer {
            patch,
            lattice,
            tolerance: tolerance * SHARE,
            points: Vec::new(),
            budget,
            cost: 8.0 * lattice.cost(patch),
        };
        for curve in curves {
            curve.check().map_err(bad)?;
            tracer.add(curve).map_err(bad)?;
        }
        let points = tracer.points;
        budget.take(patch, points.len() as f64, 0.0)?;
        // Each part is compared with the sides and with all creases.
        let n_lines: usize =
            outline.iter().map(Vec::len).sum::<usize>() + creases[0].len() + creases[1].len();
        if !budget.spend(points.len() as f64 * n_lines as f64 / 16.0) {
            return Err(patch.error(TOO_MUCH));
        }
        let points = with_sides(points, lattice, outline);
        let line = Polyline(points).at_creases(patch, lattice, &creases);
        if line.0.len() < 3 {
            return Err(bad("has no area; remove it, or check its curves".into()));
        }
        all.push(line);
    }
    Ok(all)
}

/// Points of a loop as they are found.
struct Tracer<'p, 'l> {
    patch: &'p FreeformSurface,
    lattice: &'p Lattice2,
    tolerance: f64,
    points: Vec<LimitVertex>,
    budget: &'p mut Budget<'l>,
    /// Work of each part of a curve.
    cost: f64,
}

impl Tracer<'_, '_> {
    fn add(&mut self, curve: &TrimCurve) -> Result<(), String> {
        let mut ends: Vec<f64> = Vec::new();
        let spans = curve.curve.basis.spans(curve.ascending());
        let d = curve.curve.basis.degree;
        for span in &spans {
            ends.extend((0..d).map(|k| span.from + (span.to - span.from) * k as f64 / d as f64));
        }
        ends.extend(spans.last().map(|s| s.to));
        if curve.range[0] > curve.range[1] {
            ends.reverse();
        }
        for pair in ends.windows(2) {
            let [from, to] = [pair[0], pair[1]];
            let [a, b] = [self.place(curve, from)?, self.place(curve, to)?];
            self.push(a);
            self.divide(curve, [from, to], [a, b], MOST_HALVINGS)?;
            self.push(b);
        }
        Ok(())
    }

    /// Adds the points between two.
    fn divide(
        &mut self,
        curve: &TrimCurve,
        [from, to]: [f64; 2],
        [a, b]: [DVec2; 2],
        n_halvings: u32,
    ) -> Result<(), String> {
        if !self.budget.spend(self.cost) {
            return Err(TOO_MUCH.into());
        }
        let mut is_close = a.distance(b) <= 1.0;
        let [p, q] = [self.point(a), self.point(b)];
        for share in [0.25, 0.5, 0.75] {
            let on = self.point(self.place(curve, from + (to - from) * share)?);
            is_close &= closest_point_on_segment(on, p, q).distance(on) <= self.tolerance;
        }
        if is_close || n_halvings == 0 {
            return Ok(());
        }
        let t = 0.5 * (from + to);
        let middle = self.place(curve, t)?;
        self.divide(curve, [from, t], [a, middle], n_halvings - 1)?;
        self.push(middle);
        self.divide(curve, [t, to], [middle, b], n_halvings - 1)
    }

    fn point(&self, at: DVec2) -> DVec3 {
        self.patch.at(self.lattice.parameters(at.to_array()))
    }

    /// Returns the place of a point of a curve in the lattice.
    fn place(&self, curve: &TrimCurve, t: f64) -> Result<DVec2, String> {
        let mut p = curve.at(t).to_array();
        for (axis, c) in p.iter_mut().enumerate() {
            let [from, to] = self.patch.range[axis];
            let beyond = BEYOND * (to - from);
            if !(*c >= from - beyond && *c <= to + beyond) {
                return Err(format!(
                    "its curve passes {} {c}, outside the surface, which has {from} to {to}",
                    ["u", "v"][axis]
                ));
            }
            *c = if *c < from + beyond {
                from
            } else if *c > to - beyond {
                to
            } else {
                *c
            };
        }
        Ok(DVec2::from_array(self.lattice.place(p)))
    }

    fn push(&mut self, at: DVec2) {
        // Ends of curves that meet differ by rounding.
        let is_near = |v: &LimitVertex| DVec2::from_array(v.at).distance(at) < 1e-6;
        if !self.points.last().is_some_and(is_near) {
            self.points.push(LimitVertex {
                at: at.to_array(),
                position: self.point(at),
            });
        }
    }
}

/// Replaces the parts of a loop along sides of the patch by the vertices of the sides.
fn with_sides(
    mut points: Vec<LimitVertex>,
    lattice: &Lattice2,
    outline: &[Vec<LimitVertex>; 4],
) -> Vec<LimitVertex> {
    let is_near = |a: &LimitVertex, b: &LimitVertex| {
        DVec2::from_array(a.at).distance(DVec2::from_array(b.at)) < 1e-6
    };
    while points.len() > 1 && is_near(&points[0], &points[points.len() - 1]) {
        points.pop();
    }
    let size = lattice.size().map(|n| n as f64);
    let is_on = |v: &LimitVertex, side: usize| match side {
        0 => v.at[1] == 0.0,
        1 => v.at[0] == size[0],
        2 => v.at[1] == size[1],
        _ => v.at[0] == 0.0,
    };
    // Vertices between two others on the same side, and those of all sides in between.
    for side in 0..4 {
        let n = points.len();
        let is_between = |i: usize| {
            let before = &points[(i + n - 1) % n];
            let after = &points[(i + 1) % n];
            let axis = side % 2;
            let is_ahead = (points[i].at[axis] - before.at[axis])
                * (after.at[axis] - points[i].at[axis])
                > 0.0;
            is_ahead && [before, &points[i], after].iter().all(|v| is_on(v, side))
        };
        let kept = (0..n).filter(|&i| !is_between(i)).map(|i| points[i]);
        points = kept.collect();
    }
    let mut line: Vec<LimitVertex> = Vec::with_capacity(points.len());
    for (i, &a) in points.iter().enumerate() {
        line.push(a);
        let b = points[(i + 1) % points.len()];
        let Some(side) = (0..4).find(|&s| is_on(&a, s) && is_on(&b, s)) else {
            continue;
        };
        let axis = side % 2;
        let [least, most] = [a.at[axis].min(b.at[axis]), a.at[axis].max(b.at[axis])];
        let mut inner: Vec<LimitVertex> = (outline[side].iter())
            .filter(|v| v.at[axis] > least + 1e-6 && v.at[axis] < most - 1e-6)
            .copied()
            .collect();
        inner.sort_by(|v, w| v.at[axis].total_cmp(&w.at[axis]));
        if a.at[axis] > b.at[axis] {
            inner.reverse();
        }
        line.extend(inner);
    }
    line
}

impl Polyline {
    /// Adds a vertex wherever the line crosses a crease.
    fn at_creases(
        self,
        patch: &FreeformSurface,
        lattice: &Lattice2,
        creases: &[Vec<f64>; 2],
    ) -> Self {
        let mut line = Vec::with_capacity(self.0.len());
        for [a, b] in self.edges() {
            line.push(*a);
            let mut crossed: Vec<(f64, [f64; 2])> = Vec::new();
            for (axis, lines) in creases.iter().enumerate() {
                let [from, to] = [a.at[axis], b.at[axis]];
                for &c in lines.iter().filter(|&&c| (from - c) * (to - c) < 0.0) {
                    let share = (c - from) / (to - from);
                    let mut at = [0, 1].map(|k| a.at[k] + share * (b.at[k] - a.at[k]));
                    at[axis] = c;
                    crossed.push((share, at));
                }
            }
            crossed.sort_by(|x, y| x.0.total_cmp(&y.0));
            line.extend(crossed.into_iter().map(|(_, at)| LimitVertex {
                at,
                position: patch.at(lattice.parameters(at)),
            }));
        }
        Self(line)
    }
}
