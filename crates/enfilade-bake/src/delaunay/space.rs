//! Air as tetrahedra: where one can get from one to the next, and how wide it is there.
//!
//! Gjørup 1999, §4.2.1–4.2.2. Large triangles give spikes because their few corners say little about where
//! the surface is (his §4.3.3), so points are added to surfaces first (`refine`), as dense as the air beside
//! them is narrow. What polygons still run through is cut by them (`cut`), and two parts are joined by
//! what the polygons leave open of their common boundary: no opening is missed and no wall passed, however
//! few points there are.
//!
//! How wide it is: the circumsphere of a tetrahedron is a ball of air that touches four surface
//! points, so its middle is on the medial axis; between two neighbors the widest ball that passes is
//! as wide as their facet's circle, or as the lesser of both where the circle is no bottleneck (Dey,
//! Giesen & Goswami, "Shape segmentation and matching with flow discretization", 2003). A part of a
//! tetrahedron is a spike and has none.

use std::collections::BTreeSet;

use enfilade_geom::{Aabb, Bvh, DVec3, Triangle};
use rayon::prelude::*;
use smallvec::SmallVec;

use super::cut::{self, Found, Tolerance};
use super::refine::{ENTERS, refined};
use super::tetrahedra::{Delaunay, DelaunayError, INFINITE};
use crate::complex::poly::{area, area_normal, width};

/// Most points added to surfaces; up to 4 kB each while tetrahedra become cells.
const MAX_POINTS: usize = 300_000;
/// Air between the scene and the box around it, besides a quarter of the scene. [Units: narrowest openings]
const MARGIN: f64 = 4.0;
/// Points along each edge of the box around the scene.
const BOX_POINTS: usize = 9;
/// A tetrahedron of less than this share of the cube over its longest edge has no reliable middle.
const FLAT: f64 = 1e-5;
/// What polygons leave of a facet is a crack where it is less than this share of the narrowest opening wide: a way
/// through, but none to put a portal in, since the cell complex finds the exact one.
const CRACK: f64 = 1.0 / 60.0;
/// Balls of air are known down to a radius of this share of the narrowest opening, which passes one of half its width.
pub const LEAST_BALL: f64 = 1.0 / 3.0;
/// Points nearer to a plane than this share of the largest coordinate lie in it.
const ON_PLANE: f64 = 1e-9;
/// What is less than this many times as wide as points may lie off a plane is closed. Coordinates are rounded to a grid of
/// `2⁻²⁴` of their size, 60 times as much, and walls that met before may have gaps of that width.
const CLOSED: f64 = 64.0;

/// The air between surfaces, as tetrahedra and parts of tetrahedra.
pub struct Space {
    /// The tetrahedra. [Units: wu]
    pub delaunay: Delaunay,
    /// Balls of air of this radius and more are known: no surface runs through them. More than [`LEAST_BALL`] of the
    /// narrowest opening where points ran out. [Units: wu]
    pub finest: f64,
    /// The tetrahedron of each part: as many parts as tetrahedra, part by part, then further parts of those
    /// that are cut.
    pub tetrahedron_of_part: Vec<u32>,
    /// Polygons that no longer cut a tetrahedron since it had too many parts.
    pub n_passed_over: usize,
    /// A point well inside each part. [Units: wu]
    pub middles: Vec<DVec3>,
    /// Volume of each. [Units: wu³]
    pub volumes: Vec<f64>,
    /// Radius of the ball of air that each one holds; 0 for spikes, infinite outdoors. [Units: wu]
    pub radii: Vec<f64>,
    /// Ways from one to the next.
    pub links: Vec<Link>,
    /// Outlines narrower than this are cracks. [Units: wu]
    crack: f64,
    /// Corners of openings that are no whole facets, one after the other. [Units: wu]
    corners: Vec<DVec3>,
}

/// A way from one part to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// The two parts.
    pub parts: [u32; 2],
    /// A tetrahedron that the opening bounds or lies in: that of the first part.
    pub tetrahedron: u32,
    /// Its facet, or 4 where the opening lies inside.
    pub facet: u8,
    /// Corners of the opening's outline; 0 for the whole facet.
    n_corners: u16,
    /// Where they begin.
    first_corner: u32,
    /// Radius of the widest ball that passes. [Units: wu]
    pub radius: f64,
}

/// What is known of a part.
#[derive(Clone, Copy)]
struct Fact {
    middle: DVec3,
    volume: f64,
    radius: f64,
    /// Middle of the tetrahedron's ball.
    center: DVec3,
}

/// Divides the air around `walls` into tetrahedra.
///
/// `bvh` holds the walls; the points of `closures` (door leaves, panes) narrow what is near them but
/// close nothing. Openings down to `narrowest` are weighed rightly; if that takes more points than there
/// is memory for, [`Space::finest`] tells from which width on.
///
/// # Errors
/// When coordinates are out of limits; the box around the scene always has a volume.
pub fn divide(
    walls: &[Triangle],
    closures: &[Triangle],
    bvh: &Bvh,
    narrowest: f64,
) -> Result<Space, DelaunayError> {
    let all: Vec<Triangle> = walls.iter().chain(closures).copied().collect();
    let all_bvh = Bvh::build(&all);
    let bounds = all
        .iter()
        .flatten()
        .fold(Aabb::EMPTY, |b, &p| b.including(p));
    let mut points: Vec<DVec3> = all.iter().flatten().copied().collect();
    let n_surface = points.len();
    let around = bounds.expanded(MARGIN * narrowest + 0.25 * bounds.size().max_element());
    points.extend(box_points(&around));
    let least = narrowest * LEAST_BALL;
    let max_points = points.len() + MAX_POINTS;
    let refined = refined(&points, &all_bvh, &around, least, max_points)?;
    drop((points, all_bvh, all));
    let delaunay = refined.delaunay;
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
    let reach = around.min.abs().max(around.max.abs()).max_element();
    let tolerance = Tolerance {
        plane: ON_PLANE * reach,
        width: CLOSED * ON_PLANE * reach,
    };
    let found: Vec<Found> = (0..n)
        .into_par_iter()
        .map(|t| cut::cut(&delaunay, t as u32, walls, bvh, tolerance))
        .collect();
    let balls: Vec<Fact> = (0..n)
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
                of_air(center, radius, bvh)
            } else {
                0.0
            };
            Fact {
                middle,
                volume,
                radius,
                center,
            }
        })
        .collect();
    // The first part of a tetrahedron has its number, the others come after all tetrahedra.
    let mut facts = balls.clone();
    let mut tetrahedron_of_part: Vec<u32> = (0..n as u32).collect();
    let mut further: Vec<u32> = vec![0; n];
    let mut n_passed_over = 0;
    for (t, found) in found.iter().enumerate() {
        let Some(parts) = &found.parts else { continue };
        n_passed_over += parts.n_passed_over;
        further[t] = facts.len() as u32;
        for (k, part) in parts.parts.iter().enumerate() {
            // The ball, which a polygon runs through, says nothing about a part: it is a spike. Of what reaches the
            // box, some may lie in a wall.
            let corners = delaunay.tetrahedra[t].vertices.iter();
            let is_outdoors = balls[t].radius == f64::INFINITY
                && corners
                    .filter(|v| is_box.contains(v))
                    .any(|&v| part.has_corner(delaunay.vertices[v as usize]));
            let radius = if is_outdoors { f64::INFINITY } else { 0.0 };
            let fact = Fact {
                middle: part.middle,
                volume: part.volume,
                radius,
                center: part.middle,
            };
            if k == 0 {
                facts[t] = fact;
            } else {
                facts.push(fact);
                tetrahedron_of_part.push(t as u32);
            }
        }
    }
    let number = |t: usize, part: u32| {
        if part == 0 {
            t as u32
        } else {
            further[t] + part - 1
        }
    };
    let ways: Vec<(Link, cut::Outline)> = (0..n)
        .into_par_iter()
        .flat_map_iter(|t| {
            let tet = &delaunay.tetrahedra[t];
            let mut out: SmallVec<[(Link, cut::Outline); 4]> = SmallVec::new();
            for i in 0..4 {
                let other = tet.neighbor(i) as usize;
                if other >= n || other < t {
                    continue;
                }
                let f = tet.facet(i).map(|v| delaunay.vertices[v as usize]);
                let pair = [&found[t], &found[other]];
                let is_cut = pair.iter().any(|f| f.parts.is_some());
                for o in cut::openings(&delaunay, (t as u32, i), pair, walls, bvh, tolerance) {
                    let parts = [number(t, o.parts[0]), number(other, o.parts[1])];
                    let [a, b] = parts.map(|p| &facts[p as usize]);
                    let whole = passing_radius(f, a, b);
                    let radius = match &o.outline {
                        // What a polygon covers of a facet narrows it; where it cuts beside it does not, but for cracks.
                        Some(outline) if !is_cut || width(outline) < CRACK * narrowest => {
                            whole.min(by_size(outline))
                        }
                        _ => whole,
                    };
                    out.push((Link::new(parts, t, i, radius), o.outline));
                }
            }
            for (pair, outline) in found[t].parts.iter().flat_map(|p| &p.inner) {
                let parts = pair.map(|k| number(t, k));
                let is_outdoors = parts.map(|p| facts[p as usize].radius == f64::INFINITY);
                let radius = if is_outdoors == [true; 2] {
                    f64::INFINITY
                } else {
                    by_size(outline)
                };
                out.push((Link::new(parts, t, 4, radius), Some(outline.clone())));
            }
            out
        })
        .collect();
    let mut corners = Vec::new();
    let links = ways
        .into_iter()
        .map(|(mut link, outline)| {
            if let Some(outline) = outline {
                link.first_corner = corners.len() as u32;
                link.n_corners = outline.len() as u16;
                corners.extend(outline);
            }
            link
        })
        .collect();
    Ok(Space {
        finest: refined.down_to,
        tetrahedron_of_part,
        n_passed_over,
        middles: facts.iter().map(|f| f.middle).collect(),
        volumes: facts.iter().map(|f| f.volume).collect(),
        radii: facts.iter().map(|f| f.radius).collect(),
        links,
        crack: CRACK * narrowest,
        corners,
        delaunay,
    })
}

/// What passes an outline beside a spike: nothing is known but its size.
fn by_size(outline: &[DVec3]) -> f64 {
    (area(outline) / std::f64::consts::PI).sqrt()
}

/// A lattice on the faces of a box.
pub(super) fn box_points(b: &Aabb) -> Vec<DVec3> {
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

/// Middle and radius of the circle through three points; `None` when they lie on a line.
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

/// Radius of the ball of air about the middle of a ball between points: where a surface enters it, less.
fn of_air(center: DVec3, radius: f64, bvh: &Bvh) -> f64 {
    bvh.nearest(center, radius * (1.0 - ENTERS))
        .map_or(radius, |n| n.distance)
}

/// Radius of the widest ball that passes a facet from one part's middle to the other's.
fn passing_radius(f: Triangle, a: &Fact, b: &Fact) -> f64 {
    let least = a.radius.min(b.radius);
    let circle = circle(f).map_or(0.0, |c| c.1);
    if least == 0.0 {
        // Beside a spike nothing is known but the facet; no ball is wider than what it leads to.
        let most = a.radius.max(b.radius);
        return if most > 0.0 { circle.min(most) } else { circle };
    }
    let normal = enfilade_geom::triangle_area_normal(&f);
    let side = |c: DVec3| normal.dot(c - f[2]);
    if least.is_finite() && side(a.center) * side(b.center) > 0.0 {
        return least;
    }
    circle.min(least)
}

impl Link {
    fn new(parts: [u32; 2], tetrahedron: usize, facet: usize, radius: f64) -> Self {
        Self {
            parts,
            tetrahedron: tetrahedron as u32,
            facet: facet as u8,
            n_corners: 0,
            first_corner: 0,
            radius,
        }
    }
}

impl Space {
    /// Outline of an opening: convex, counter-clockwise seen from the second part. [Units: wu]
    pub(super) fn outline(&self, link: &Link) -> SmallVec<[DVec3; 6]> {
        if link.n_corners > 0 {
            let first = link.first_corner as usize;
            return self.corners[first..first + usize::from(link.n_corners)].into();
        }
        let tet = &self.delaunay.tetrahedra[link.tetrahedron as usize];
        let corner = |v: u32| {
            debug_assert!(v != INFINITE);
            self.delaunay.vertices[v as usize]
        };
        tet.facet(usize::from(link.facet))
            .map(corner)
            .into_iter()
            .collect()
    }

    /// Whether polygons leave less of a facet than a portal could be put in.
    pub(super) fn is_crack(&self, link: &Link) -> bool {
        link.n_corners > 0 && width(&self.outline(link)) < self.crack
    }

    /// Area of an opening times its unit normal, which points from the first part to the second.
    /// [Units: wu²]
    #[must_use]
    pub fn area_vector(&self, link: &Link) -> DVec3 {
        area_normal(&self.outline(link)) * 0.5
    }

    /// Vertices about an opening, to tell which openings touch.
    pub(super) fn vertices_about(&self, link: &Link) -> SmallVec<[u32; 4]> {
        let tet = &self.delaunay.tetrahedra[link.tetrahedron as usize];
        if link.facet == 4 {
            tet.vertices.into()
        } else {
            tet.facet(usize::from(link.facet)).into_iter().collect()
        }
    }

    /// Corners of the tetrahedron of a part. [Units: wu]
    #[must_use]
    pub fn corners(&self, part: u32) -> [DVec3; 4] {
        self.delaunay
            .corners(self.tetrahedron_of_part[part as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
