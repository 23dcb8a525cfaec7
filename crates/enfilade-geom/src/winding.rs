//! Windings: convex planar polygons.

use crate::poly::{self, Poly, Sides};
use crate::{Aabb, DVec3, Plane};

/// A convex planar polygon, counter-clockwise seen from its plane's positive side.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Winding {
    /// Vertices in order; at least three in a polygon with area.
    pub points: Vec<DVec3>,
}

impl Winding {
    /// Makes the polygon with these vertices.
    #[must_use]
    pub fn new(points: Vec<DVec3>) -> Self {
        Self { points }
    }

    /// Makes a square of half-width `reach` around the point of `plane` nearest to `center`.
    #[must_use]
    #[doc(hidden)]
    pub fn square(plane: &Plane, center: DVec3, reach: f64) -> Self {
        let (u, v) = plane.basis();
        let c = plane.project(center);
        Self::new(vec![
            c - u * reach - v * reach,
            c + u * reach - v * reach,
            c + u * reach + v * reach,
            c - u * reach + v * reach,
        ])
    }

    /// Returns the section of `plane` with a box; `None` if they have no area in common.
    #[must_use]
    #[doc(hidden)]
    pub fn section_of_box(plane: &Plane, bounds: &Aabb) -> Option<Self> {
        let center = bounds.center();
        let mut w = Self::square(plane, center, bounds.size().length() + 1.0);
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            w = w.clipped(&Plane::through(bounds.min, axis), 0.0)?;
            w = w.clipped(&Plane::through(bounds.max, -axis), 0.0)?;
        }
        Some(w)
    }

    /// Returns twice the area times the unit normal (Newell's sum about the first vertex).
    #[must_use]
    pub fn area_normal(&self) -> DVec3 {
        poly::area_normal(&self.points)
    }

    /// Returns the area. [Units: wu²]
    #[must_use]
    pub fn area(&self) -> f64 {
        poly::area(&self.points)
    }

    /// Returns the centroid of the area; the mean of the vertices if there is none.
    #[must_use]
    pub fn centroid(&self) -> DVec3 {
        let Some(&o) = self.points.first() else {
            return DVec3::ZERO;
        };
        let n = self.area_normal();
        let (mut sum, mut total) = (DVec3::ZERO, 0.0);
        for e in self.points.windows(2) {
            let a = (e[0] - o).cross(e[1] - o).dot(n);
            sum += (o + e[0] + e[1]) * (a / 3.0);
            total += a;
        }
        if total > 0.0 {
            sum / total
        } else {
            self.mean()
        }
    }

    /// Returns the mean of the vertices.
    #[must_use]
    #[doc(hidden)]
    pub fn mean(&self) -> DVec3 {
        self.points.iter().sum::<DVec3>() / self.points.len().max(1) as f64
    }

    /// Returns the polygon seen from the other side.
    #[must_use]
    #[doc(hidden)]
    pub fn flipped(&self) -> Self {
        Self::new(self.points.iter().rev().copied().collect())
    }

    /// Returns the smallest box around it.
    #[must_use]
    #[doc(hidden)]
    pub fn aabb(&self) -> Aabb {
        Aabb::of_points(&self.points)
    }

    /// Returns the part on the positive side of `plane`; vertices within `eps` of it count as on it.
    ///
    /// `None` if only an edge or a vertex is left.
    #[must_use]
    #[doc(hidden)]
    pub fn clipped(&self, plane: &Plane, eps: f64) -> Option<Self> {
        self.split(plane, eps).0
    }

    /// Returns the parts on the positive and on the negative side of `plane`.
    ///
    /// Vertices within `eps` of the plane belong to both parts unmoved; a polygon in the plane belongs to
    /// neither.
    #[must_use]
    #[doc(hidden)]
    pub fn split(&self, plane: &Plane, eps: f64) -> (Option<Self>, Option<Self>) {
        let whole = || Some(self.clone());
        let part = |points: Poly| Some(Self::new(points.into_vec()));
        match poly::split(&self.points, plane, eps) {
            Sides::On => (None, None),
            Sides::Front => (whole(), None),
            Sides::Back => (None, whole()),
            Sides::Both(front, back) => (part(front), part(back)),
        }
    }

    /// Returns `true` if `p`, a point of the polygon's plane, lies in it or within `eps` of it.
    #[must_use]
    #[doc(hidden)]
    pub fn contains_in_plane(&self, p: DVec3, eps: f64) -> bool {
        let normal = self.area_normal().normalize_or_zero();
        let n = self.points.len();
        (0..n).all(|i| {
            let (a, b) = (
                self.points[i],
                self.points[if i + 1 == n { 0 } else { i + 1 }],
            );
            let inward = normal.cross(b - a);
            inward.dot(p - a) >= -eps * inward.length()
        })
    }

    /// Returns the convex hull of points of `plane`, counter-clockwise. Drops collinear points.
    #[must_use]
    #[doc(hidden)]
    pub fn hull_in_plane(plane: &Plane, points: &[DVec3]) -> Self {
        let (u, v) = plane.basis();
        let mut at: Vec<(f64, f64, DVec3)> =
            points.iter().map(|&p| (u.dot(p), v.dot(p), p)).collect();
        at.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        at.dedup_by(|a, b| a.0 == b.0 && a.1 == b.1);
        if at.len() < 3 {
            return Self::new(at.into_iter().map(|a| a.2).collect());
        }
        let turn = |a: &(f64, f64, DVec3), b: &(f64, f64, DVec3), c: &(f64, f64, DVec3)| {
            (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0)
        };
        let mut hull: Vec<(f64, f64, DVec3)> = Vec::with_capacity(at.len() + 1);
        let mut half = |sequence: &mut dyn Iterator<Item = (f64, f64, DVec3)>| {
            let base = hull.len();
            for p in sequence {
                while hull.len() >= base + 2
                    && turn(&hull[hull.len() - 2], &hull[hull.len() - 1], &p) <= 0.0
                {
                    hull.pop();
                }
                hull.push(p);
            }
            hull.pop();
        };
        half(&mut at.iter().copied());
        half(&mut at.iter().rev().copied());
        Self::new(hull.into_iter().map(|a| a.2).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit_square() -> Winding {
        Winding::new(vec![DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y])
    }

    #[test]
    fn a_split_keeps_the_area() {
        let w = unit_square();
        let plane = Plane::through(
            DVec3::new(0.3, 0.1, 0.0),
            DVec3::new(1.0, 0.4, 0.2).normalize(),
        );
        let (f, b) = w.split(&plane, 1e-9);
        assert!((f.unwrap().area() + b.unwrap().area() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_polygon_touching_the_plane_with_an_edge_stays_whole() {
        let (f, b) = unit_square().split(&Plane::through(DVec3::X, DVec3::X), 1e-9);
        assert!(f.is_none());
        assert_eq!(b.unwrap(), unit_square());
    }

    #[test]
    fn the_hull_of_a_square_with_points_inside_is_the_square() {
        let plane = Plane {
            normal: DVec3::Z,
            d: 0.0,
        };
        let mut points = unit_square().points;
        points.extend([DVec3::new(0.5, 0.5, 0.0), DVec3::new(0.5, 0.0, 0.0)]);
        let hull = Winding::hull_in_plane(&plane, &points);
        assert_eq!(hull.points.len(), 4);
        assert!((hull.area() - 1.0).abs() < 1e-12);
        assert!(hull.area_normal().z > 0.0);
    }
}
