//! Convex shapes, and their contact with openings.
//!
//! A shape is the hull of a few points, grown by a radius: a sphere is one point, a capsule two, a box eight. It meets a convex
//! polygon if the distance of the two hulls is at most the radius. The distance is computed by the algorithm of Gilbert, Johnson
//! & Keerthi ("A fast procedure for computing the distance between complex objects", 1988), which needs only the farthest point
//! of a hull in a direction: O(points) per step, a handful of steps. A lower bound ends it as soon as the two are certainly
//! apart. If rounding stops its progress, they count as meeting: within the tolerance.

use enfilade_geom::{Aabb, DVec3};

use crate::pose::Pose;

/// Maximum number of steps; each gets nearer by more than rounding, and a dozen suffice for ordinary bodies.
const MAX_STEPS: usize = 64;

/// The hull of some points, grown by `radius`. In a frame of its own, about its origin.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    points: Vec<DVec3>,
    radius: f64,
}

/// Reason why a shape is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ShapeError {
    /// A shape without points.
    #[error("a shape needs at least one point")]
    NoPoints,
    /// A coordinate or radius that is not finite, or a radius below 0.
    #[error("a shape's points and radius must be finite, and the radius not below 0")]
    NotFinite,
}

impl Shape {
    /// Makes the hull of `points`, grown by `radius`. [Units: wu] Points inside the hull only cost time.
    ///
    /// # Errors
    ///
    /// If there are no points, a value is not finite, or the radius is below 0.
    pub fn hull(points: Vec<DVec3>, radius: f64) -> Result<Self, ShapeError> {
        if points.is_empty() {
            return Err(ShapeError::NoPoints);
        }
        let is_finite = points.iter().all(|p| p.is_finite()) && radius.is_finite();
        if !is_finite || radius < 0.0 {
            return Err(ShapeError::NotFinite);
        }
        Ok(Self { points, radius })
    }

    /// Makes a ball about the origin, such as the range of a lamp or of a sound. [Units: wu]
    ///
    /// # Errors
    ///
    /// If the radius is not finite, or below 0.
    pub fn sphere(radius: f64) -> Result<Self, ShapeError> {
        Self::hull(vec![DVec3::ZERO], radius)
    }

    /// Makes the set of points within `radius` of the segment from `a` to `b`. [Units: wu]
    ///
    /// # Errors
    ///
    /// If a value is not finite, or the radius is below 0.
    pub fn capsule(a: DVec3, b: DVec3, radius: f64) -> Result<Self, ShapeError> {
        Self::hull(vec![a, b], radius)
    }

    /// Makes a box. [Units: wu]
    ///
    /// # Errors
    ///
    /// If a value is not finite, or the box is empty.
    pub fn block(bounds: &Aabb) -> Result<Self, ShapeError> {
        Self::hull(bounds.corners().to_vec(), 0.0)
    }

    /// Returns the points.
    #[must_use]
    #[doc(hidden)]
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Returns the growth of their hull. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Returns its greatest distance from its origin. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn reach(&self) -> f64 {
        let far = self.points.iter().map(|p| p.length());
        far.fold(0.0, f64::max) + self.radius
    }

    /// Writes the positions of its points in `pose` into `into`.
    #[doc(hidden)]
    pub fn place(&self, pose: &Pose, into: &mut Vec<DVec3>) {
        into.clear();
        into.extend(self.points.iter().map(|p| pose.point(*p)));
    }
}

/// Returns `true` if the distance between the hulls of two sets of points is at most `reach`, up to rounding.
#[must_use]
pub(crate) fn is_near(a: &[DVec3], b: &[DVec3], reach: f64) -> bool {
    let (Some(first_a), Some(first_b)) = (a.first(), b.first()) else {
        return false;
    };
    // Differences of points of both; the distance is that of their hull from the origin.
    let mut simplex = Simplex::default();
    let mut nearest = *first_a - *first_b;
    simplex.add(nearest);
    let scale = a.iter().chain(b).map(|p| p.abs().max_element());
    let rounding = 1e-15 * scale.fold(1.0, f64::max);
    for _ in 0..MAX_STEPS {
        let distance = nearest.length();
        if distance <= reach + rounding {
            return true;
        }
        let toward = nearest / distance;
        let next = farthest(a, -toward) - farthest(b, toward);
        // No point of the difference is nearer along `toward` than this.
        let least = next.dot(toward);
        if least > reach + rounding {
            return false;
        }
        simplex.add(next);
        let better = simplex.nearest_to_origin();
        if better.length() >= distance {
            return true;
        }
        nearest = better;
    }
    true
}

/// Returns the point farthest along a direction; the first of several.
fn farthest(points: &[DVec3], along: DVec3) -> DVec3 {
    let mut best = (f64::NEG_INFINITY, DVec3::ZERO);
    for &p in points {
        let at = p.dot(along);
        if at > best.0 {
            best = (at, p);
        }
    }
    best.1
}

/// One to four points.
#[derive(Default)]
struct Simplex {
    points: [DVec3; 4],
    len: usize,
}

impl Simplex {
    fn add(&mut self, p: DVec3) {
        self.points[self.len] = p;
        self.len += 1;
    }

    /// Returns the point of the simplex nearest to the origin; keeps only the vertices of the face that contains it, three at
    /// most unless the origin is inside.
    fn nearest_to_origin(&mut self) -> DVec3 {
        if self.len == 4 && self.holds_origin() {
            return DVec3::ZERO;
        }
        let mut best = (f64::INFINITY, DVec3::ZERO, 0);
        // Each vertex, edge and face, as a set of bits.
        for bits in 1_u8..1 << self.len {
            if let Some(p) = self.nearest_of(bits) {
                let square = p.length_squared();
                if square < best.0 {
                    best = (square, p, bits);
                }
            }
        }
        let kept = (0..self.len).filter(|i| (best.2 >> i) & 1 == 1);
        let mut points = [DVec3::ZERO; 4];
        let mut len = 0;
        for i in kept {
            points[len] = self.points[i];
            len += 1;
        }
        (self.points, self.len) = (points, len);
        best.1
    }

    /// Returns the point nearest to the origin on the flat through some vertices, if it lies between them.
    fn nearest_of(&self, bits: u8) -> Option<DVec3> {
        let mut p = [DVec3::ZERO; 3];
        let mut n = 0;
        for i in (0..self.len).filter(|i| (bits >> i) & 1 == 1) {
            *p.get_mut(n)? = self.points[i];
            n += 1;
        }
        let [a, b, c] = p;
        match n {
            1 => Some(a),
            2 => {
                let ab = b - a;
                let t = -a.dot(ab) / ab.length_squared();
                (0.0..=1.0).contains(&t).then(|| a + ab * t)
            }
            _ => {
                let normal = (b - a).cross(c - a);
                let square = normal.length_squared();
                let [u, v, w] = [b.cross(c), c.cross(a), a.cross(b)].map(|x| x.dot(normal));
                let is_inside = u >= 0.0 && v >= 0.0 && w >= 0.0 && square > 0.0;
                is_inside.then(|| normal * (normal.dot(a) / square))
            }
        }
    }

    /// Returns `true` if the origin is inside the tetrahedron, on the inner side of each face.
    fn holds_origin(&self) -> bool {
        let p = self.points;
        (0..4).all(|i| {
            let [a, b, c, d] = [p[i], p[(i + 1) % 4], p[(i + 2) % 4], p[(i + 3) % 4]];
            let normal = (c - b).cross(d - b);
            let (own, origin) = (normal.dot(a - b), normal.dot(-b));
            own * origin > 0.0
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::closest_point_on_triangle;
    use enfilade_testkit::Rng;

    fn random_point(rng: &mut Rng, reach: f64) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|_| rng.range(-reach, reach)))
    }

    /// Least distance between hulls of few points: between vertices and faces, and between edges.
    fn distance(a: &[DVec3], b: &[DVec3]) -> f64 {
        // Support gaps along all candidate directions: normals of faces and cross products of edges. The hulls are apart by the
        // greatest gap along a direction; if none is positive they meet.
        let mut directions = Vec::new();
        let edges = |p: &[DVec3]| -> Vec<DVec3> {
            (0..p.len())
                .flat_map(|i| (0..i).map(move |j| (i, j)))
                .map(|(i, j)| p[i] - p[j])
                .collect()
        };
        let (ea, eb) = (edges(a), edges(b));
        for (i, x) in ea.iter().enumerate() {
            directions.extend(ea[..i].iter().map(|y| x.cross(*y)));
            directions.extend(eb.iter().map(|y| x.cross(*y)));
        }
        for (i, x) in eb.iter().enumerate() {
            directions.extend(eb[..i].iter().map(|y| x.cross(*y)));
        }
        let gap = |n: DVec3| {
            let least = b.iter().map(|p| p.dot(n)).fold(f64::INFINITY, f64::min);
            let most = a.iter().map(|p| p.dot(n)).fold(f64::NEG_INFINITY, f64::max);
            least - most
        };
        let flat = |n: &DVec3| n.length() > 1e-9;
        let unit = directions.into_iter().filter(flat).map(DVec3::normalize);
        unit.flat_map(|n| [n, -n])
            .map(gap)
            .fold(f64::NEG_INFINITY, f64::max)
    }

    #[test]
    fn hulls_meet_where_no_plane_separates_them() {
        let mut rng = Rng::new(5);
        let mut n_near = 0;
        for _ in 0..3000 {
            let count = 4 + rng.below(4);
            let offset = random_point(&mut rng, 1.5);
            let a: Vec<DVec3> = (0..count)
                .map(|_| offset + random_point(&mut rng, 1.0))
                .collect();
            let b: Vec<DVec3> = (0..4).map(|_| random_point(&mut rng, 1.0)).collect();
            let gap = distance(&a, &b);
            if gap.abs() < 1e-9 {
                continue;
            }
            n_near += usize::from(gap < 0.0);
            assert_eq!(is_near(&a, &b, 0.0), gap < 0.0, "{a:?} {b:?} {gap}");
        }
        assert!((300..2700).contains(&n_near), "{n_near}");
    }

    #[test]
    fn a_sphere_meets_a_triangle_at_its_nearest_point() {
        let mut rng = Rng::new(6);
        for _ in 0..3000 {
            let triangle = [0, 1, 2].map(|_| random_point(&mut rng, 1.0));
            let center = random_point(&mut rng, 3.0);
            let distance = center.distance(closest_point_on_triangle(center, &triangle));
            for (radius, meets) in [(distance - 1e-9, false), (distance + 1e-9, true)] {
                if radius > 0.0 {
                    assert_eq!(is_near(&[center], &triangle, radius), meets, "{triangle:?}");
                }
            }
        }
    }

    #[test]
    fn slivers_and_points_that_coincide_are_no_trouble() {
        let flat = [DVec3::ZERO, DVec3::X, DVec3::X * 2.0, DVec3::X];
        assert!(is_near(&flat, &flat, 0.0));
        assert!(!is_near(&flat, &[DVec3::Y; 4], 0.5));
        assert!(is_near(&flat, &[DVec3::Y; 4], 1.0));
        assert!(!is_near(&[], &flat, 1.0));
    }

    #[test]
    fn shapes_without_points_or_sizes_are_refused() {
        assert_eq!(Shape::hull(Vec::new(), 1.0), Err(ShapeError::NoPoints));
        for radius in [-1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(Shape::sphere(radius), Err(ShapeError::NotFinite));
        }
        assert_eq!(Shape::block(&Aabb::EMPTY), Err(ShapeError::NotFinite));
    }
}
