//! Growth of outlines: what covers an opening must reach past its rim.

use enfilade_geom::{Plane, Winding};

/// Largest growth of an outline at a sharp vertex, as a multiple of its growth elsewhere.
const MITER: f64 = 4.0;

/// Returns `outline` with its rim moved outward by about `by`.
pub(crate) fn grown(outline: &Winding, plane: &Plane, by: f64) -> Winding {
    let points = &outline.points;
    let n = points.len();
    let outward = |i: usize| {
        let edge = points[(i + 1) % n] - points[i % n];
        edge.cross(plane.normal).normalize_or_zero()
    };
    let moved = (0..n).map(|i| {
        let both = outward(i + n - 1) + outward(i);
        let length = both.length().max(2.0 / MITER);
        points[i] + both * (2.0 * by / (length * length))
    });
    Winding::new(moved.collect())
}
