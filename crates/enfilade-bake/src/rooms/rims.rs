//! Caps: surfaces that close a tube, a cave or a shell that ends in an open rim.
//!
//! A scanned cave, a vessel or a room without its ceiling is one sheet of triangles that just ends. No
//! pinch shows the flood where: inside and outdoors flow together through a mouth as wide as the tube.
//! But the rim itself does: a closed loop of edges with a single triangle, about planar, with
//! the surface leaving its plane to one side all around. Such a mouth is capped for the flood (see
//! `closures`), and becomes an open portal. The rim of a flat sheet, a hill or a window in a thin wall
//! lies *in* the surface and gets no cap.
//!
//! Cost: a sort of the edges, `O(n log n)` in triangles.

use enfilade_geom::{DVec3, Triangle};

use crate::structure::{RimVertex, Rims};

/// Largest distance of a rim from its plane, as a share of the square root of its area.
const MAX_STRAY: f64 = 0.15;
/// Largest perimeter² ÷ area of a slit; a circle has 4π, a square 16.
const MAX_SLIT: f64 = 40.0;
/// Least sine of the angle between the surface and the rim's plane, about 30 degrees,
const MIN_SLOPE: f64 = 0.5;
/// … to the same side, along this share of the rim.
const MIN_SHARE: f64 = 0.8;

/// Returns triangles that cap the open rims of at least `min_area` wu². Independent of the order of the input.
#[must_use]
pub(crate) fn rim_caps(rims: &Rims, min_area: f64) -> Vec<Triangle> {
    let mut caps = Vec::new();
    for rim in rims.loops() {
        if let Some(center) = mouth_of(&rim, min_area) {
            let n = rim.len();
            caps.extend((0..n).map(|i| [center, rim[i].0, rim[(i + 1) % n].0]));
        }
    }
    caps
}

/// Returns the middle of a rim that is a mouth.
fn mouth_of(rim: &[RimVertex], min_area: f64) -> Option<DVec3> {
    let n = rim.len();
    let center = rim.iter().map(|c| c.0).sum::<DVec3>() / n as f64;
    let edge = |i: usize| (rim[i].0, rim[(i + 1) % n].0);
    let vector: DVec3 = (0..n)
        .map(|i| (edge(i).0 - center).cross(edge(i).1 - center))
        .sum::<DVec3>()
        * 0.5;
    let area = vector.length();
    let perimeter: f64 = (0..n).map(|i| edge(i).0.distance(edge(i).1)).sum();
    if area < min_area || perimeter * perimeter > MAX_SLIT * area {
        return None;
    }
    let normal = vector / area;
    let is_planar = rim
        .iter()
        .all(|c| normal.dot(c.0 - center).abs() <= MAX_STRAY * area.sqrt());
    let (mut up, mut down) = (0.0, 0.0);
    for (i, &(_, apex)) in rim.iter().enumerate() {
        let (a, b) = edge(i);
        let along = (b - a).normalize_or_zero();
        let away = apex - a;
        let slope = normal.dot((away - along * along.dot(away)).normalize_or_zero());
        if slope > MIN_SLOPE {
            up += a.distance(b);
        } else if slope < -MIN_SLOPE {
            down += a.distance(b);
        }
    }
    (is_planar && f64::max(up, down) >= MIN_SHARE * perimeter).then_some(center)
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::Aabb;

    /// A tube of `n` sides along z, from 0 to `length`, conical with these two radii.
    fn tube(n: usize, length: f64, radii: [f64; 2]) -> Vec<Triangle> {
        let p = |i: usize, k: usize| {
            let a = std::f64::consts::TAU * (i % n) as f64 / n as f64;
            DVec3::new(a.cos() * radii[k], a.sin() * radii[k], length * k as f64)
        };
        (0..n)
            .flat_map(|i| {
                [
                    [p(i, 0), p(i + 1, 0), p(i + 1, 1)],
                    [p(i, 0), p(i + 1, 1), p(i, 1)],
                ]
            })
            .collect()
    }

    fn area(caps: &[Triangle]) -> f64 {
        caps.iter()
            .map(|t| (t[1] - t[0]).cross(t[2] - t[0]).length() * 0.5)
            .sum()
    }

    #[test]
    fn both_mouths_of_a_tube_are_capped_whatever_the_order() {
        let mut t = tube(24, 5.0, [1.0, 1.0]);
        let caps = rim_caps(&Rims::of(&t), 0.3);
        assert!((area(&caps) - 2.0 * 12.0 * (15.0_f64).to_radians().sin()).abs() < 1e-9);
        t.reverse();
        assert_eq!(rim_caps(&Rims::of(&t), 0.3), caps);
        assert!(rim_caps(&Rims::of(&t), 4.0).is_empty());
    }

    #[test]
    fn flat_sheets_and_shallow_bowls_have_no_mouth() {
        assert!(rim_caps(&Rims::of(&tube(24, 0.0, [1.0, 3.0])), 0.3).is_empty());
        assert!(rim_caps(&Rims::of(&tube(24, 0.5, [1.0, 3.0])), 0.3).is_empty());
    }

    #[test]
    fn a_closed_box_has_no_rim() {
        let mut t = Aabb::new(DVec3::ZERO, DVec3::splat(3.0)).triangles();
        assert!(rim_caps(&Rims::of(&t), 0.3).is_empty());
        // Without its lid it has one mouth.
        t.truncate(10);
        assert!((area(&rim_caps(&Rims::of(&t), 0.3)) - 9.0).abs() < 1e-9);
    }
}
