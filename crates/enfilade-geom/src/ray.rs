//! Intersection of rays with triangles, and distances between points, segments and triangles.
//!
//! The intersection is that of Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection"
//! (JCGT 2(1), 2013), in `f64`: vertices are sheared so that the ray becomes the z axis, and the signs of
//! the edge functions then depend only on the sheared vertices. Two products are rounded and subtracted,
//! so a sign can come out as zero but never reversed, and zero counts as a hit: no ray passes between
//! triangles that share their vertices.

use crate::{DVec3, Triangle};

/// A ray, or a segment when `t_max` is finite: the points `origin + t · direction`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Point at `t = 0`. [Units: wu]
    pub origin: DVec3,
    /// Direction of any length but zero, the unit of `t`.
    pub direction: DVec3,
    /// Largest valid `t`, inclusive. May be infinite.
    pub t_max: f64,
}

impl Ray {
    /// Makes the closed segment from `a` (`t = 0`) to `b` (`t = 1`).
    #[must_use]
    pub fn segment(a: DVec3, b: DVec3) -> Self {
        Self {
            origin: a,
            direction: b - a,
            t_max: 1.0,
        }
    }

    /// Returns the point at `t`.
    #[must_use]
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }
}

/// Intersection of a ray with a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Position along the ray, in lengths of its direction.
    pub t: f64,
    /// Index of the triangle.
    pub triangle: u32,
    /// True if the ray meets the side from which the vertices run counter-clockwise.
    pub front: bool,
}

/// A ray prepared for many triangles: the axes and the shear of the watertight test.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShearedRay {
    origin: [f64; 3],
    axes: [usize; 3],
    shear: [f64; 3],
}

impl ShearedRay {
    pub(crate) fn new(ray: &Ray) -> Self {
        let d = ray.direction.to_array();
        let kz = if d[0].abs() >= d[1].abs() && d[0].abs() >= d[2].abs() {
            0
        } else if d[1].abs() >= d[2].abs() {
            1
        } else {
            2
        };
        let (mut kx, mut ky) = ((kz + 1) % 3, (kz + 2) % 3);
        if d[kz] < 0.0 {
            // Keeps the orientation of triangles under the projection.
            std::mem::swap(&mut kx, &mut ky);
        }
        let inverse = 1.0 / d[kz];
        Self {
            origin: ray.origin.to_array(),
            axes: [kx, ky, kz],
            shear: [d[kx] * inverse, d[ky] * inverse, inverse],
        }
    }

    /// Returns `t`, and `true` for a hit on the front; `None` if missed, edge-on or NaN.
    #[inline]
    pub(crate) fn hit(&self, triangle: &[[f64; 3]; 3], t_max: f64) -> Option<(f64, bool)> {
        let [kx, ky, kz] = self.axes;
        let [sx, sy, sz] = self.shear;
        let o = &self.origin;
        let [a, b, c] = triangle;
        let (az, bz, cz) = (a[kz] - o[kz], b[kz] - o[kz], c[kz] - o[kz]);
        let (ax, ay) = ((a[kx] - o[kx]) - sx * az, (a[ky] - o[ky]) - sy * az);
        let (bx, by) = ((b[kx] - o[kx]) - sx * bz, (b[ky] - o[ky]) - sy * bz);
        let (cx, cy) = ((c[kx] - o[kx]) - sx * cz, (c[ky] - o[ky]) - sy * cz);
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let det = u + v + w;
        if det == 0.0 {
            return None;
        }
        let t = (u * az + v * bz + w * cz) * sz / det;
        (t >= 0.0 && t <= t_max).then_some((t, det > 0.0))
    }
}

/// Intersects `ray` with one triangle; [`RayHit::triangle`] is 0. Edges and vertices count as hit, a triangle
/// seen edge-on does not.
#[must_use]
pub fn hit_triangle(ray: &Ray, triangle: &Triangle) -> Option<RayHit> {
    let (t, front) = ShearedRay::new(ray).hit(&triangle.map(|p| p.to_array()), ray.t_max)?;
    Some(RayHit {
        t,
        triangle: 0,
        front,
    })
}

/// Returns the point of the closed segment `a b` nearest to `p`.
#[inline]
#[must_use]
pub fn closest_point_on_segment(p: DVec3, a: DVec3, b: DVec3) -> DVec3 {
    let ab = b - a;
    let length_squared = ab.length_squared();
    if length_squared <= 0.0 {
        return a;
    }
    a + ab * ((p - a).dot(ab) / length_squared).clamp(0.0, 1.0)
}

/// Returns the point of a closed triangle nearest to `p`, degenerate triangles included.
///
/// After Ericson, *Real-Time Collision Detection* (2005), section 5.1.5, restated: inside the triangle's
/// prism it is the foot of the perpendicular, elsewhere the nearest point of the three edges.
#[must_use]
pub fn closest_point_on_triangle(p: DVec3, t: &Triangle) -> DVec3 {
    closest_with_normal(p, t, (t[1] - t[0]).cross(t[2] - t[0]))
}

/// Does [`closest_point_on_triangle`] with the cross product of two edges.
#[inline]
pub(crate) fn closest_with_normal(p: DVec3, t: &Triangle, n: DVec3) -> DVec3 {
    let n2 = n.length_squared();
    if n2 > 0.0 {
        let inside = (0..3).all(|i| {
            let (a, b) = (t[i], t[(i + 1) % 3]);
            n.cross(b - a).dot(p - a) >= 0.0
        });
        if inside {
            return p - n * (n.dot(p - t[0]) / n2);
        }
    }
    (0..3)
        .map(|i| closest_point_on_segment(p, t[i], t[(i + 1) % 3]))
        .min_by(|x, y| x.distance_squared(p).total_cmp(&y.distance_squared(p)))
        .unwrap_or(t[0])
}

/// Returns the squared distance between the closed segments `p q` and `a b`. [Units: wu²]
///
/// The least of the four end-to-segment distances and, if both feet lie inside, that of the common
/// perpendicular. Never less than the true value by more than rounding.
#[must_use]
pub fn segment_distance_squared(p: DVec3, q: DVec3, a: DVec3, b: DVec3) -> f64 {
    let (d, e, r) = (q - p, b - a, p - a);
    let n = d.cross(e);
    let n2 = n.length_squared();
    // Sine squared of the angle: below this the cross product is rounding noise, and for lines this
    // close to parallel the ends suffice.
    if n2 > 1e-20 * d.length_squared() * e.length_squared() {
        let s = e.cross(r).dot(n) / n2;
        let t = d.cross(r).dot(n) / n2;
        if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
            return (p + d * s).distance_squared(a + e * t);
        }
    }
    let ends = [
        closest_point_on_segment(p, a, b).distance_squared(p),
        closest_point_on_segment(q, a, b).distance_squared(q),
        closest_point_on_segment(a, p, q).distance_squared(a),
        closest_point_on_segment(b, p, q).distance_squared(b),
    ];
    ends.into_iter().fold(f64::INFINITY, f64::min)
}

/// Returns the distance between the closed segment `p q` and the outline of a triangle. [Units: wu]
#[must_use]
pub fn segment_to_edges_distance(p: DVec3, q: DVec3, t: &Triangle) -> f64 {
    (0..3)
        .map(|i| segment_distance_squared(p, q, t[i], t[(i + 1) % 3]))
        .fold(f64::INFINITY, f64::min)
        .sqrt()
}

/// Returns the distance between the closed segment `p q` and a closed triangle; 0 if they meet. [Units: wu]
#[must_use]
pub fn segment_to_triangle_distance(p: DVec3, q: DVec3, t: &Triangle) -> f64 {
    if hit_triangle(&Ray::segment(p, q), t).is_some() {
        return 0.0;
    }
    // If disjoint, the nearest points are on an edge and the segment, or an end and the face.
    segment_to_edges_distance(p, q, t)
        .min(closest_point_on_triangle(p, t).distance(p))
        .min(closest_point_on_triangle(q, t).distance(q))
}

/// Returns `true` if a triangle and a closed box touch, and perhaps if they miss each other by rounding.
///
/// Separating axes after Akenine-Möller, "Fast 3D Triangle-Box Overlap Testing" (2001).
#[must_use]
pub fn triangle_touches_box(t: &Triangle, bounds: &crate::Aabb) -> bool {
    if !crate::Aabb::of_points(t).overlaps(bounds) {
        return false;
    }
    let center = bounds.center();
    let half = bounds.size() * 0.5;
    let v = t.map(|p| p - center);
    // Rounding of a product of two differences of coordinates, with a margin.
    let slack = 1e-14 * (center.abs() + half + v[0].abs() + v[1].abs() + v[2].abs()).max_element();
    let apart = |axis: DVec3| {
        let reach = half.dot(axis.abs()) + slack * axis.abs().element_sum();
        let d = v.map(|p| p.dot(axis));
        d[0].min(d[1]).min(d[2]) > reach || d[0].max(d[1]).max(d[2]) < -reach
    };
    let edges = [v[1] - v[0], v[2] - v[1], v[0] - v[2]];
    if apart(edges[0].cross(edges[1])) {
        return false;
    }
    !edges.iter().any(|&e| {
        apart(DVec3::new(0.0, -e.z, e.y))
            || apart(DVec3::new(e.z, 0.0, -e.x))
            || apart(DVec3::new(-e.y, e.x, 0.0))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const T: Triangle = [
        DVec3::ZERO,
        DVec3::new(1.0, 0.0, 0.0),
        DVec3::new(0.0, 1.0, 0.0),
    ];

    #[test]
    fn the_front_is_the_side_seen_counter_clockwise() {
        for axis in 0..3 {
            // The same configuration with the axes permuted cyclically.
            let turn = |p: DVec3| match axis {
                0 => p,
                1 => DVec3::new(p.z, p.x, p.y),
                _ => DVec3::new(p.y, p.z, p.x),
            };
            let t = T.map(turn);
            let (above, below) = (DVec3::new(0.2, 0.3, 2.0), DVec3::new(0.1, 0.3, -1.0));
            let down = hit_triangle(&Ray::segment(turn(above), turn(below)), &t).unwrap();
            let up = hit_triangle(&Ray::segment(turn(below), turn(above)), &t).unwrap();
            assert!(down.front && !up.front);
            assert!((down.t - 2.0 / 3.0).abs() < 1e-15 && (up.t - 1.0 / 3.0).abs() < 1e-15);
        }
    }

    #[test]
    fn ends_vertices_and_edges_count_as_hit() {
        let hit = |a: [f64; 3], b: [f64; 3]| {
            hit_triangle(&Ray::segment(a.into(), b.into()), &T).is_some()
        };
        assert!(hit([0.2, 0.2, 1.0], [0.2, 0.2, 0.0]));
        assert!(!hit([0.2, 0.2, 1.0], [0.2, 0.2, 0.001]));
        assert!(hit([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]));
        assert!(hit([0.5, 0.5, 1.0], [0.5, 0.5, -1.0]));
        assert!(!hit([0.5, 0.51, 1.0], [0.5, 0.51, -1.0]));
        assert!(!hit([-1.0, 0.1, 0.0], [1.0, 0.1, 0.0]), "edge-on");
        assert!(!hit([f64::NAN, 0.1, 0.0], [1.0, 0.1, 0.0]));
        assert!(!hit([0.1, 0.1, 0.0], [0.1, 0.1, 0.0]), "no direction");
    }

    #[test]
    fn distances_of_known_figures() {
        let p = DVec3::new(0.25, 0.25, 3.0);
        assert_eq!(
            closest_point_on_triangle(p, &T),
            DVec3::new(0.25, 0.25, 0.0)
        );
        let far = DVec3::new(2.0, 2.0, 0.0);
        assert_eq!(
            closest_point_on_triangle(far, &T),
            DVec3::new(0.5, 0.5, 0.0)
        );
        let d = segment_to_triangle_distance(
            DVec3::new(-1.0, 2.0, 0.0),
            DVec3::new(2.0, -1.0, 0.5),
            &[DVec3::ZERO, -DVec3::X, -DVec3::Y],
        );
        assert!((d - 0.5f64.hypot(0.25)).abs() < 0.3 && d > 0.5);
        let crossing = segment_to_edges_distance(
            DVec3::new(0.25, 0.25, 1.0),
            DVec3::new(0.25, 0.25, -1.0),
            &T,
        );
        assert!((crossing - 0.25).abs() < 1e-15);
    }

    #[test]
    fn a_box_between_the_vertices_of_a_slanted_triangle_does_not_touch_it() {
        let t = [DVec3::X * 2.0, DVec3::Y * 2.0, DVec3::Z * 2.0];
        let near = |m: f64| crate::Aabb::new(DVec3::ZERO, DVec3::splat(m));
        assert!(!triangle_touches_box(&t, &near(0.66)));
        assert!(triangle_touches_box(&t, &near(0.67)));
    }
}
