//! Convex pieces of space: parts of a box in front of planes.

use enfilade_geom::{Aabb, DVec3, Plane, poly};

/// Returns the faces of the part of a box in front of all planes, each with at least one vertex; none if it is empty.
/// Vertices within `eps` of a plane count as on it. Time: the square of the number of planes.
pub(crate) fn faces_in_box(planes: &[Plane], bounds: &Aabb, eps: f64) -> Vec<Vec<DVec3>> {
    let mut faces = Vec::new();
    for face in bounds.faces() {
        let mut points = face.to_vec();
        for plane in planes {
            clip(&mut points, plane, eps);
        }
        if points.len() > 2 {
            faces.push(points);
        }
    }
    for (i, plane) in planes.iter().enumerate() {
        let Some(section) = poly::section_of_box(&plane.flipped(), bounds, eps) else {
            continue;
        };
        let mut points: Vec<DVec3> = section.iter().copied().collect();
        for (k, other) in planes.iter().enumerate() {
            // A repeated plane makes only one face.
            let is_twin =
                other.normal.dot(plane.normal) > 1.0 - 1e-15 && (other.d - plane.d).abs() < eps;
            if k < i && is_twin {
                points.clear();
            } else if k != i && !is_twin {
                clip(&mut points, other, eps);
            }
        }
        if points.len() > 2 {
            faces.push(points);
        }
    }
    faces
}

/// Clips a convex polygon to the front of a plane, or to within `eps` behind it; a segment or a point may be left.
pub(crate) fn clip(points: &mut Vec<DVec3>, plane: &Plane, eps: f64) {
    let heights: Vec<f64> = points
        .iter()
        .map(|&p| plane.signed_distance(p) + eps)
        .collect();
    if heights.iter().all(|&h| h >= 0.0) {
        return;
    }
    let n = points.len();
    let mut out = Vec::with_capacity(n + 1);
    for i in 0..n {
        let j = (i + 1) % n;
        if heights[i] >= 0.0 {
            out.push(points[i]);
        }
        if (heights[i] > 0.0) != (heights[j] > 0.0) && heights[i] * heights[j] < 0.0 {
            let t = heights[i] / (heights[i] - heights[j]);
            out.push(points[i] + (points[j] - points[i]) * t);
        }
    }
    *points = out;
}
