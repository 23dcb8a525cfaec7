//! Small convex polygons without heap allocation: split, measure, subtract.
//!
//! Builders make tens of millions of them, nearly all with three to six vertices, so they are stored
//! inline. Those that are kept become a [`Winding`](crate::Winding).

use smallvec::SmallVec;

use crate::{Aabb, DVec3, Plane};

/// A convex planar polygon; its orientation depends on its origin.
pub type Poly = SmallVec<[DVec3; 6]>;

/// Position of a polygon relative to a plane.
#[expect(
    clippy::large_enum_variant,
    reason = "lives for a match; a box would allocate a million times"
)]
pub enum Sides {
    /// In the plane, within the tolerance.
    On,
    /// Entirely on the positive side.
    Front,
    /// Entirely on the negative side.
    Back,
    /// Cut in two: the positive and the negative part.
    Both(Poly, Poly),
}

/// Side of a plane on which a polygon lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// In the plane, within the tolerance.
    On,
    /// Entirely on the positive side.
    Front,
    /// Entirely on the negative side.
    Back,
    /// On both.
    Both,
}

/// Returns the side on which a polygon lies; vertices within `eps` of the plane have none.
#[inline]
#[must_use]
pub fn side(points: &[DVec3], plane: &Plane, eps: f64) -> Side {
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for &p in points {
        let d = plane.signed_distance(p);
        if d < least {
            least = d;
        }
        if d > most {
            most = d;
        }
    }
    match (most > eps, least < -eps) {
        (false, false) => Side::On,
        (true, false) => Side::Front,
        (false, true) => Side::Back,
        (true, true) => Side::Both,
    }
}

/// Splits a polygon; vertices within `eps` of the plane belong to both parts unmoved.
#[must_use]
pub fn split(points: &[DVec3], plane: &Plane, eps: f64) -> Sides {
    // Most polygons lie on one side: copy nothing until one does not.
    match side(points, plane, eps) {
        Side::On => Sides::On,
        Side::Front => Sides::Front,
        Side::Back => Sides::Back,
        Side::Both => {
            let [mut front, mut back] = [Poly::new(), Poly::new()];
            add_parts(points, plane, eps, &mut front, &mut back);
            Sides::Both(front, back)
        }
    }
}

/// Appends the vertices of the positive and the negative part of a polygon on both sides of a plane, as [`split`] does.
pub fn add_parts(points: &[DVec3], plane: &Plane, eps: f64, front: &mut Poly, back: &mut Poly) {
    divide(points, plane, eps, |p| front.push(p), |p| back.push(p));
}

/// Passes on the vertices of both parts, in order.
#[inline]
fn divide(
    points: &[DVec3],
    plane: &Plane,
    eps: f64,
    mut front: impl FnMut(DVec3),
    mut back: impl FnMut(DVec3),
) {
    let Some(&first) = points.first() else { return };
    let d_first = plane.signed_distance(first);
    let (mut p, mut dp) = (first, d_first);
    for i in 0..points.len() {
        let (q, dq) = match points.get(i + 1) {
            Some(&q) => (q, plane.signed_distance(q)),
            None => (first, d_first),
        };
        if dp >= -eps {
            front(p);
        }
        if dp <= eps {
            back(p);
        }
        if (dp > eps && dq < -eps) || (dp < -eps && dq > eps) {
            // Always cut from the front vertex, so that both directions of an edge round alike.
            let (a, b, da, db) = if dp > 0.0 {
                (p, q, dp, dq)
            } else {
                (q, p, dq, dp)
            };
            let cut = a + (b - a) * (da / (da - db));
            front(cut);
            back(cut);
        }
        (p, dp) = (q, dq);
    }
}

/// Returns the part on the positive side; `None` if no area is left.
#[must_use]
pub fn clip(points: &[DVec3], plane: &Plane, eps: f64) -> Option<Poly> {
    match side(points, plane, eps) {
        Side::Front => Some(points.into()),
        Side::Both => Some(front_part(points, plane, eps)),
        Side::On | Side::Back => None,
    }
}

/// Keeps the part on the positive side; returns `true` if any is left.
#[must_use]
pub fn clip_in_place(points: &mut Poly, plane: &Plane, eps: f64) -> bool {
    match side(points, plane, eps) {
        Side::Front => {}
        Side::Both => *points = front_part(points, plane, eps),
        Side::On | Side::Back => return false,
    }
    true
}

fn front_part(points: &[DVec3], plane: &Plane, eps: f64) -> Poly {
    let mut front = Poly::new();
    divide(points, plane, eps, |p| front.push(p), |_| {});
    front
}

/// Returns the part in a box; `None` if no area is left. A polygon in a face of the box counts as inside.
#[must_use]
pub fn clip_to_box(points: &[DVec3], bounds: &Aabb, eps: f64) -> Option<Poly> {
    let b = Aabb::of_points(points);
    let mut poly: Poly = points.into();
    for axis in 0..3 {
        for (limit, sign) in [(bounds.min[axis], 1.0), (bounds.max[axis], -1.0)] {
            let reach = if sign > 0.0 {
                b.min[axis] - limit
            } else {
                limit - b.max[axis]
            };
            if reach >= -eps {
                continue;
            }
            let mut normal = DVec3::ZERO;
            normal[axis] = sign;
            let side = Plane {
                normal,
                d: -sign * limit,
            };
            if !clip_in_place(&mut poly, &side, eps) {
                return None;
            }
        }
    }
    Some(poly)
}

/// Returns the section of a plane with a box, counter-clockwise seen from the positive side.
#[must_use]
pub fn section_of_box(plane: &Plane, bounds: &Aabb, eps: f64) -> Option<Poly> {
    for axis in 0..3 {
        if plane.normal[axis].abs() == 1.0 {
            let at = -plane.d * plane.normal[axis];
            if at < bounds.min[axis] + eps || at > bounds.max[axis] - eps {
                return None;
            }
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let corner = |pu: f64, pv: f64| {
                let mut p = DVec3::ZERO;
                p[axis] = at;
                p[u] = pu;
                p[v] = pv;
                p
            };
            let (lo, hi) = (bounds.min, bounds.max);
            let mut poly = Poly::from_slice(&[
                corner(lo[u], lo[v]),
                corner(hi[u], lo[v]),
                corner(hi[u], hi[v]),
                corner(lo[u], hi[v]),
            ]);
            if plane.normal[axis] < 0.0 {
                poly.reverse();
            }
            return Some(poly);
        }
    }
    let (u, v) = plane.basis();
    let center = plane.project(bounds.center());
    let reach = bounds.size().length() + 1.0;
    let square = [
        center - u * reach - v * reach,
        center + u * reach - v * reach,
        center + u * reach + v * reach,
        center - u * reach + v * reach,
    ];
    clip_to_box(&square, bounds, eps)
}

/// Returns twice the area times the unit normal (Newell's sum about the first vertex).
#[must_use]
pub fn area_normal(points: &[DVec3]) -> DVec3 {
    let Some(&o) = points.first() else {
        return DVec3::ZERO;
    };
    points.windows(2).map(|e| (e[0] - o).cross(e[1] - o)).sum()
}

/// Returns the area. [Units: wu²]
#[must_use]
pub fn area(points: &[DVec3]) -> f64 {
    area_normal(points).length() * 0.5
}

/// Returns the least distance between two parallel lines that enclose the polygon. [Units: wu]
///
/// For a convex polygon one of the lines contains an edge, so all edges are tried.
#[must_use]
pub fn width(points: &[DVec3]) -> f64 {
    let normal = area_normal(points).normalize_or_zero();
    let mut least = f64::INFINITY;
    for (i, &a) in points.iter().enumerate() {
        let b = points[if i + 1 == points.len() { 0 } else { i + 1 }];
        let Some(inward) = normal.cross(b - a).try_normalize() else {
            continue;
        };
        let reach = points
            .iter()
            .map(|&p| inward.dot(p - a))
            .fold(0.0, f64::max);
        least = least.min(reach);
    }
    if least.is_finite() { least } else { 0.0 }
}

/// Returns `true` if both the area and the [`width`] reach a limit, mostly without computing the width.
#[must_use]
pub fn is_larger(points: &[DVec3], min_area: f64, min_width: f64) -> bool {
    let area = area(points);
    if area < min_area {
        return false;
    }
    // A narrow polygon has little area for its length; a thousandth is for rounding.
    let length = Aabb::of_points(points).size().length();
    area >= 1.001 * min_width * length || width(points) >= min_width
}

/// Cuts `poly` by a convex `cover` in the same plane, counter-clockwise about `normal`: appends the parts
/// outside to `outside` and returns the part inside.
///
/// If the part inside is narrower than `min_width`, appends the whole `poly` to `outside`.
pub fn cut_out(
    poly: &[DVec3],
    cover: &[DVec3],
    normal: DVec3,
    eps: f64,
    min_width: f64,
    outside: &mut Vec<Poly>,
) -> Option<Poly> {
    let before = outside.len();
    let boxes = (Aabb::of_points(poly), Aabb::of_points(cover));
    let mut inside: Poly = poly.into();
    let mut hit = boxes.0.expanded(eps).overlaps(&boxes.1);
    for (i, &a) in cover.iter().enumerate() {
        if !hit {
            break;
        }
        let b = cover[if i + 1 == cover.len() { 0 } else { i + 1 }];
        let Some(inward) = normal.cross(b - a).try_normalize() else {
            continue;
        };
        match split(&inside, &Plane::through(a, inward), eps) {
            Sides::Front => {}
            Sides::Both(front, back) => {
                outside.push(back);
                inside = front;
            }
            Sides::Back | Sides::On => hit = false,
        }
    }
    if hit && (min_width <= 0.0 || width(&inside) >= min_width) {
        return Some(inside);
    }
    // No significant overlap: keep the polygon in one piece instead of the shreds cut so far.
    outside.truncate(before);
    outside.push(poly.into());
    None
}
