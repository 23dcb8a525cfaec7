//! Form factors: the share of a point's hemisphere, weighted by cosine, that a polygon covers.
//!
//! Lambert's formula for a point and a polygon that radiates diffusely, as in Baum, Rushmeier & Winget, "Improving
//! Radiosity Solutions Through the Use of Analytically Determined Form-Factors" (SIGGRAPH 1989), section 4. The
//! point is the origin.

use glam::Vec3;

/// Vertices of a convex polygon relative to the point that sees it. [Units: wu]
pub(super) type Polygon = Vec<Vec3>;

/// Clips a convex polygon to the side `n · p >= 0` of a plane through the origin, into `out`.
pub(super) fn clip_into(polygon: &[Vec3], n: Vec3, out: &mut Polygon) {
    out.clear();
    for (i, &b) in polygon.iter().enumerate() {
        let a = polygon[(i + polygon.len() - 1) % polygon.len()];
        let (da, db) = (n.dot(a), n.dot(b));
        if (da < 0.0) != (db < 0.0) {
            out.push(a + (b - a) * (da / (da - db)));
        }
        if db >= 0.0 {
            out.push(b);
        }
    }
}

/// Returns the part of `polygon` visible through `hole` from the origin; both are convex. `hole` may have either
/// orientation.
pub(super) fn clip_through(polygon: &[Vec3], hole: &[Vec3]) -> Polygon {
    let middle: Vec3 = hole.iter().sum::<Vec3>() / hole.len().max(1) as f32;
    let (mut out, mut next) = (polygon.to_vec(), Vec::new());
    for (i, &a) in hole.iter().enumerate() {
        let n = a.cross(hole[(i + 1) % hole.len()]);
        let n = if n.dot(middle) < 0.0 { -n } else { n };
        clip_into(&out, n, &mut next);
        std::mem::swap(&mut out, &mut next);
        if out.len() < 3 {
            return Vec::new();
        }
    }
    out
}

/// Returns the share of the light on a surface with unit normal `n` at the origin that comes from a polygon, if
/// everything visible were equally bright: 0 to 1. `scratch` avoids an allocation.
pub(super) fn form_factor(polygon: &[Vec3], n: Vec3, scratch: &mut Polygon) -> f32 {
    clip_into(polygon, n, scratch);
    if scratch.len() < 3 {
        return 0.0;
    }
    let mut sum = 0.0;
    let mut a = scratch[scratch.len() - 1].normalize_or_zero();
    for corner in scratch.iter() {
        let b = corner.normalize_or_zero();
        let cross = a.cross(b);
        let sin = cross.length();
        if sin > 1e-7 {
            sum += sin.atan2(a.dot(b)) * n.dot(cross) / sin;
        }
        a = b;
    }
    // Positive for either orientation of the polygon.
    (sum.abs() / std::f32::consts::TAU).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(half: f32, away: f32) -> Polygon {
        let corner = |x: f32, z: f32| Vec3::new(x * half, away, z * half);
        vec![
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ]
    }

    #[test]
    fn a_ceiling_without_end_is_all_of_the_light_from_above_and_half_of_that_on_a_wall() {
        let ceiling = square(1e4, 1.0);
        let mut scratch = Vec::new();
        assert!((form_factor(&ceiling, Vec3::Y, &mut scratch) - 1.0).abs() < 1e-3);
        assert!((form_factor(&ceiling, Vec3::X, &mut scratch) - 0.5).abs() < 1e-3);
        assert!(form_factor(&ceiling, Vec3::NEG_Y, &mut scratch).abs() < 1e-6);
    }

    #[test]
    fn a_square_overhead_agrees_with_the_closed_form() {
        // For a quarter of it, a by b at a distance of 1, Baum et al. give (a / √(1 + a²) · atan(b / √(1 + a²)) +
        // the same with a and b exchanged) / 2π; four of them.
        let a = 1.0_f32;
        let root = (1.0 + a * a).sqrt();
        let quarter = 2.0 * a / root * (a / root).atan() / std::f32::consts::TAU;
        let got = form_factor(&square(1.0, 1.0), Vec3::Y, &mut Vec::new());
        assert!((got - 4.0 * quarter).abs() < 1e-4, "{got}");
    }

    #[test]
    fn through_a_hole_the_part_behind_it_is_left() {
        let (near, far) = (square(0.5, 1.0), square(10.0, 2.0));
        let seen = clip_through(&far, &near);
        let mut scratch = Vec::new();
        let (a, b) = (
            form_factor(&seen, Vec3::Y, &mut scratch),
            form_factor(&near, Vec3::Y, &mut scratch),
        );
        assert!((a - b).abs() < 1e-5, "{a} {b}");
        let aside: Polygon = near.iter().map(|p| *p + Vec3::X * 30.0).collect();
        assert!(clip_through(&far, &aside).is_empty());
    }
}
