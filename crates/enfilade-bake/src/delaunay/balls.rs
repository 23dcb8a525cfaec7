//! Spheres through points: the largest balls of air between sampled surfaces.

use enfilade_geom::{Bvh, DVec3, Triangle};

/// Share of a ball's radius by which a surface may enter it. Walls then have points about half a radius apart, and
/// radii are accurate to a twentieth.
pub(super) const ENTERS: f64 = 0.1;
/// Least volume of a tetrahedron with a reliable circumsphere, as a share of the cube over its longest edge.
const FLAT: f64 = 1e-5;

/// Returns center and radius of the sphere through four points, and the volume of their tetrahedron. The radius is
/// infinite if the points are too flat for it to mean anything.
pub(super) fn circumsphere(c: [DVec3; 4]) -> (DVec3, f64, f64) {
    let (u, v, w) = (c[0] - c[3], c[1] - c[3], c[2] - c[3]);
    let det = u.dot(v.cross(w));
    let longest = [u, v, w, u - v, v - w, w - u]
        .iter()
        .map(|d| d.length_squared())
        .fold(0.0, f64::max);
    let volume = det.abs() / 6.0;
    if volume < FLAT * longest * longest.sqrt() {
        return (c[3], f64::INFINITY, volume);
    }
    let to_center = (v.cross(w) * u.length_squared()
        + w.cross(u) * v.length_squared()
        + u.cross(v) * w.length_squared())
        / (2.0 * det);
    (c[3] + to_center, to_center.length(), volume)
}

/// Returns center and radius of the circle through three points; `None` if they lie on a line.
pub(super) fn circle(f: Triangle) -> Option<(DVec3, f64)> {
    let (p, q) = (f[0] - f[2], f[1] - f[2]);
    let normal = p.cross(q);
    let area4 = 2.0 * normal.length_squared();
    if area4 == 0.0 {
        return None;
    }
    let to_middle = (q * p.length_squared() - p * q.length_squared()).cross(normal) / area4;
    Some((f[2] + to_middle, to_middle.length()))
}

/// Returns the radius of the ball of air about the center of a circumsphere: smaller than `radius` if a surface enters
/// the sphere by more than [`ENTERS`].
pub(super) fn of_air(center: DVec3, radius: f64, bvh: &Bvh) -> f64 {
    bvh.nearest(center, radius * (1.0 - ENTERS))
        .map_or(radius, |n| n.distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sphere_through_four_points_touches_them() {
        let c = [
            DVec3::ZERO,
            DVec3::Y * 2.0,
            DVec3::X,
            DVec3::new(0.1, 0.2, 3.0),
        ];
        let (center, radius, volume) = circumsphere(c);
        for p in c {
            assert!((center.distance(p) - radius).abs() < 1e-12);
        }
        assert!((volume - 1.0).abs() < 1e-12);
        let flat = [DVec3::ZERO, DVec3::Y, DVec3::X, DVec3::new(1.0, 1.0, 1e-9)];
        assert!(circumsphere(flat).1.is_infinite());
    }
}
