//! Air as tetrahedra: where one can get from one to the next, and how wide it is there.
//!
//! Gjørup 1999, §4.2.1–4.2.2, with two departures. Large triangles give spikes because their few
//! corners say little about where the surface is (his §4.3.3), so surfaces are *sampled* first: along
//! edges and on a lattice inside. And tetrahedra are not cut by polygons here: two neighbors are
//! joined only where the line from middle to middle over the middle of their facet meets no polygon.
//! Such lines put together make a way through the air, so no wall without a hole is ever passed;
//! what is exact is left to the cell complex.
//!
//! How wide it is: the circumsphere of a tetrahedron is a ball of air that touches four surface
//! points, so its middle is on the medial axis; between two neighbors the widest ball that passes is
//! as wide as their facet's circle, or as the lesser of both where the circle is no bottleneck (Dey,
//! Giesen & Goswami, "Shape segmentation and matching with flow discretization", 2003).

use std::collections::BTreeSet;

use enfilade_geom::{Aabb, Bvh, DVec3, Triangle};
use rayon::prelude::*;

use super::tetrahedra::{Delaunay, DelaunayError, INFINITE, tetrahedralize};

/// Points sampled on the walls at most about this many; larger scenes are sampled more coarsely.
const MAX_POINTS: f64 = 300_000.0;
/// Points along each edge of the box around the scene.
const BOX_POINTS: usize = 9;
/// A tetrahedron of less than this share of the cube over its longest edge has no reliable middle.
const FLAT: f64 = 1e-5;

/// The air between surfaces, as tetrahedra.
pub struct Space {
    /// The tetrahedra. [Units: wu]
    pub delaunay: Delaunay,
    /// Distance between points sampled on surfaces. [Units: wu]
    pub spacing: f64,
    /// Middle of each finite tetrahedron. [Units: wu]
    pub middles: Vec<DVec3>,
    /// Volume of each. [Units: wu³]
    pub volumes: Vec<f64>,
    /// Radius of the ball of air that each one holds; 0 for spikes, infinite outdoors. [Units: wu]
    pub radii: Vec<f64>,
    /// Ways from one to the next.
    pub links: Vec<Link>,
}

/// A way from one tetrahedron to a neighbor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// The two tetrahedra; the first holds the facet.
    pub tetrahedra: [u32; 2],
    /// The facet of the first.
    pub facet: u8,
    /// Radius of the widest ball that passes. [Units: wu]
    pub radius: f64,
}

/// Divides the air around `walls` into tetrahedra.
///
/// `bvh` holds the walls; the points of `closures` (door leaves, panes) narrow what is near them but
/// close nothing. `spacing` is the distance between sampled points; scenes too large for it get more.
///
/// # Errors
/// When coordinates are out of limits; the box around the scene always has a volume.
pub fn divide(
    walls: &[Triangle],
    closures: &[Triangle],
    bvh: &Bvh,
    spacing: f64,
) -> Result<Space, DelaunayError> {
    let all = || walls.iter().chain(closures);
    let area: f64 = all()
        .map(|t| enfilade_geom::triangle_area_normal(t).length() * 0.5)
        .sum();
    let spacing = spacing.max((area / MAX_POINTS).sqrt());
    let bounds = all().flatten().fold(Aabb::EMPTY, |b, &p| b.including(p));
    let mut points: Vec<DVec3> = all()
        .collect::<Vec<_>>()
        .into_par_iter()
        .flat_map_iter(|t| sampled(t, spacing))
        .collect();
    let n_surface = points.len();
    let around = bounds.expanded(2.0 + 0.25 * bounds.size().max_element());
    points.extend(box_points(&around));
    let delaunay = tetrahedralize(&points)?;
    let n = delaunay.n_finite;
    let is_box: BTreeSet<u32> = delaunay.vertex_of_point[n_surface..]
        .iter()
        .copied()
        .collect();
    let outdoors = |t: usize| {
        let tet = &delaunay.tetrahedra[t];
        (0..4).any(|i| tet.neighbor(i) as usize >= n)
            || tet.vertices.iter().all(|v| is_box.contains(v))
    };
    let facts: Vec<(DVec3, f64, f64, DVec3)> = (0..n)
        .into_par_iter()
        .map(|t| {
            let c = delaunay.corners(t as u32);
            let middle = c.iter().sum::<DVec3>() / 4.0;
            let (center, radius, volume) = circumsphere(c);
            // A ball on the other side of a wall says nothing about this side.
            let is_own = radius.is_finite() && !bvh.any_hit(middle, center, |_| false);
            let radius = if outdoors(t) {
                f64::INFINITY
            } else if is_own {
                radius
            } else {
                0.0
            };
            (middle, volume, radius, center)
        })
        .collect();
    let links: Vec<Link> = (0..n)
        .into_par_iter()
        .flat_map_iter(|t| {
            let (delaunay, facts) = (&delaunay, &facts);
            (0..4).filter_map(move |i| {
                let tet = &delaunay.tetrahedra[t];
                let other = tet.neighbor(i) as usize;
                if other >= n || other < t {
                    return None;
                }
                let corners = tet.facet(i).map(|v| delaunay.vertices[v as usize]);
                let over = corners.iter().sum::<DVec3>() / 3.0;
                if bvh.any_hit(facts[t].0, over, |_| false)
                    || bvh.any_hit(facts[other].0, over, |_| false)
                {
                    return None;
                }
                Some(Link {
                    tetrahedra: [t as u32, other as u32],
                    facet: i as u8,
                    radius: passing_radius(corners, &facts[t], &facts[other]),
                })
            })
        })
        .collect();
    Ok(Space {
        spacing,
        middles: facts.iter().map(|f| f.0).collect(),
        volumes: facts.iter().map(|f| f.1).collect(),
        radii: facts.iter().map(|f| f.2).collect(),
        links,
        delaunay,
    })
}

/// Points along the edges of a triangle and on a lattice inside, which neighbors in its plane share.
fn sampled(t: &Triangle, spacing: f64) -> Vec<DVec3> {
    let mut out = t.to_vec();
    for i in 0..3 {
        let (mut a, mut b) = (t[i], t[(i + 1) % 3]);
        // The neighbor across the edge must find the very same points.
        if (a.x, a.y, a.z) > (b.x, b.y, b.z) {
            std::mem::swap(&mut a, &mut b);
        }
        let n = (a.distance(b) / spacing).ceil() as usize;
        out.extend((1..n).map(|k| a.lerp(b, k as f64 / n as f64)));
    }
    let normal = enfilade_geom::triangle_area_normal(t);
    let axis = (0..3)
        .max_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs()).then(b.cmp(&a)))
        .unwrap_or(0);
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let (mut lo, mut hi) = ([f64::MAX; 2], [f64::MIN; 2]);
    for p in t {
        for (k, x) in [p[u], p[v]].into_iter().enumerate() {
            lo[k] = lo[k].min(x);
            hi[k] = hi[k].max(x);
        }
    }
    let range = |k: usize| (lo[k] / spacing).ceil() as i64..=(hi[k] / spacing).floor() as i64;
    let edge = |a: DVec3, b: DVec3, x: f64, y: f64| {
        (b[u] - a[u]) * (y - a[v]) - (b[v] - a[v]) * (x - a[u])
    };
    let whole = edge(t[0], t[1], t[2][u], t[2][v]);
    if whole == 0.0 {
        return out;
    }
    for j in range(1) {
        for i in range(0) {
            let (x, y) = (i as f64 * spacing, j as f64 * spacing);
            let w = [1, 2, 0].map(|k| edge(t[k], t[(k + 1) % 3], x, y) / whole);
            // Edges have their own points.
            if w.iter().all(|&w| w > 1e-6) {
                out.push(t[0] * w[0] + t[1] * w[1] + t[2] * w[2]);
            }
        }
    }
    out
}

/// A lattice on the faces of a box.
fn box_points(b: &Aabb) -> Vec<DVec3> {
    let n = BOX_POINTS;
    let step = |i: usize| i as f64 / (n - 1) as f64;
    let mut out = Vec::new();
    for i in 0..n * n * n {
        let at = [i % n, i / n % n, i / (n * n)];
        if at.iter().any(|&k| k == 0 || k == n - 1) {
            let t = DVec3::from_array(at.map(step));
            out.push(b.min + b.size() * t);
        }
    }
    out
}

/// Middle and radius of the sphere through four points, and the volume between them. The radius is
/// infinite where the points are too flat for it to mean anything.
fn circumsphere(c: [DVec3; 4]) -> (DVec3, f64, f64) {
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

/// Radius of the widest ball that passes a facet from one tetrahedron's middle to the other's.
fn passing_radius(
    f: [DVec3; 3],
    a: &(DVec3, f64, f64, DVec3),
    b: &(DVec3, f64, f64, DVec3),
) -> f64 {
    let least = a.2.min(b.2);
    let (p, q) = (f[0] - f[2], f[1] - f[2]);
    let normal = p.cross(q);
    let area2 = normal.length();
    let circle = if area2 > 0.0 {
        p.length() * q.length() * (p - q).length() / (2.0 * area2)
    } else {
        0.0
    };
    if least == 0.0 {
        // Beside a spike nothing is known but the facet; no ball is wider than what it leads to.
        return circle.min(a.2.max(b.2)).max(0.0);
    }
    let side = |c: DVec3| normal.dot(c - f[2]);
    if least.is_finite() && side(a.3) * side(b.3) > 0.0 {
        return least;
    }
    circle.min(least)
}

impl Space {
    /// Corners of the facet of a link, counter-clockwise seen from its second tetrahedron. [Units: wu]
    #[must_use]
    pub fn facet(&self, link: &Link) -> Triangle {
        let tet = &self.delaunay.tetrahedra[link.tetrahedra[0] as usize];
        tet.facet(usize::from(link.facet)).map(|v| {
            debug_assert!(v != INFINITE);
            self.delaunay.vertices[v as usize]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbors_sample_their_edge_alike_and_all_points_lie_in_the_triangle() {
        let [a, b, c, d] = [
            DVec3::new(0.1, 0.0, 0.3),
            DVec3::new(3.7, 0.2, 1.1),
            DVec3::new(1.0, 2.5, 0.7),
            DVec3::new(2.0, -2.5, 0.9),
        ];
        let (left, right) = (sampled(&[a, b, c], 0.2), sampled(&[b, a, d], 0.2));
        let on_edge = |points: &[DVec3]| -> Vec<[u64; 3]> {
            let mut bits: Vec<_> = points
                .iter()
                .filter(|p| (b - a).cross(**p - a).length() < 1e-9)
                .map(|p| p.to_array().map(f64::to_bits))
                .collect();
            bits.sort_unstable();
            bits
        };
        assert!(on_edge(&left).len() > 15);
        assert_eq!(on_edge(&left), on_edge(&right));
        let normal = (b - a).cross(c - a).normalize();
        for p in &left {
            assert!(normal.dot(*p - a).abs() < 1e-12);
            for (q, r) in [(a, b), (b, c), (c, a)] {
                assert!((r - q).cross(*p - q).dot(normal) > -1e-9);
            }
        }
    }

    #[test]
    fn the_ball_through_four_corners_touches_them() {
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
