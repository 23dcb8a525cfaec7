//! Surfaces (triangles and candidates) and their shared list of planes.

use std::cmp::Reverse;
use std::collections::HashSet;
use std::ops::ControlFlow;

use enfilade_geom::poly::{self, Poly};
use enfilade_geom::{Bvh, DVec3, Plane, Purse, plane_tolerance};
use rayon::prelude::*;
use smallvec::SmallVec;

use super::planes::{PlaneList, faces_ahead};

/// Origin of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Source {
    /// A structural triangle, by its index in the input.
    Triangle(u32),
    /// A candidate, by its index in the input.
    Candidate(u32),
    /// A seam, see [`seams`]: it blocks, but is not part of the scene.
    Seam,
}

/// A triangle, a candidate or a seam.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    /// Its origin.
    pub(super) source: Source,
    /// Index into the list of planes, or [`NO_PLANE`].
    pub(super) plane: u32,
    /// Vertices as given.
    pub(super) points: SurfacePoints,
}

/// Vertices of a surface; triangles stay inline.
pub(super) type SurfacePoints = SmallVec<[DVec3; 3]>;

/// Plane of a surface too thin to have one.
pub(super) const NO_PLANE: u32 = u32::MAX;

/// Tolerances of one complex. [Units: wu]
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolerance {
    /// Surfaces this near to a plane lie in it.
    pub(super) plane: f64,
    /// Vertices this near to a cutting plane are on it.
    pub(super) cut: f64,
    /// Openings narrower than this are closed.
    pub(super) width: f64,
}

/// Openings with less area are closed. [Units: wu²]
pub(super) const MIN_AREA: f64 = 1e-8;

/// Planes whose normals differ by less may hold each other's surfaces. [Units: rad]
pub(super) const PARALLEL: f64 = 0.02;

/// Sine of the largest angle at which edges come apart, see [`seams`]; beyond it, the wedges are hardly wider than
/// openings that count as closed.
const SHALLOW: f64 = 0.35;

impl Tolerance {
    /// Returns the tolerances for coordinates up to `extent` from the origin.
    pub(super) fn for_extent(extent: f64) -> Self {
        let plane = plane_tolerance(extent);
        // f64 noise is 1e-15 of the extent. Intersecting planes differ by more than plane / size, so cut vertices are
        // accurate to about 1e-9 of the extent.
        let cut = (1e-10 * extent).max(1e-9);
        Self {
            plane,
            cut,
            width: 2.0 * plane,
        }
    }
}

/// Surfaces and the list of their planes.
pub(super) struct SurfaceSet {
    /// Surfaces, largest first, then by coordinates: independent of the order of the input.
    pub(super) surfaces: Vec<Surface>,
    /// Distinct planes.
    pub(super) planes: PlaneList,
    /// Triangles left out of `surfaces` as copies of others, with the planes of those.
    pub(super) copies: Vec<Surface>,
}

/// Most identical triangles that take part in cutting. Doubled faces are common, and the choice of splitters accounts
/// for them; more only add cost.
const MOST_COPIES: usize = 4;

/// Cost of examining a surface, or an edge of it, in units of [`enfilade_geom::Allowance`].
const WORK_A_SURFACE: u64 = 2;

/// Sorts by area, then coordinates, so that the order of the input does not matter.
fn canonical_order(surfaces: &mut Vec<Surface>) {
    let key = |s: &Surface| {
        let by_area = Reverse(ordered_bits(poly::area(&s.points)));
        let is_candidate = matches!(s.source, Source::Candidate(_));
        (is_candidate, by_area, s.points.iter().map(bits).min())
    };
    let mut order: Vec<_> = surfaces.par_iter().map(|s| (key(s), s)).collect();
    order.par_sort_unstable_by(|(p, a), (q, b)| {
        let by_points = || sorted_points(a).cmp(&sorted_points(b));
        p.cmp(q)
            .then_with(by_points)
            .then_with(|| a.source.cmp(&b.source))
    });
    *surfaces = order.into_par_iter().map(|(_, s)| s.clone()).collect();
}

fn bits(p: &DVec3) -> [u64; 3] {
    p.to_array().map(ordered_bits)
}

/// Returns the vertices in an order that is the same for duplicates, which may start at different vertices or have the
/// opposite orientation.
fn sorted_points(s: &Surface) -> SmallVec<[[u64; 3]; 4]> {
    let mut points: SmallVec<_> = s.points.iter().map(bits).collect();
    points.sort_unstable();
    points
}

/// Returns bits that compare like the number.
fn ordered_bits(x: f64) -> u64 {
    let bits = (x + 0.0).to_bits();
    if bits >> 63 == 1 {
        !bits
    } else {
        bits | (1 << 63)
    }
}

/// Returns the plane of a polygon, unless that is too thin to have one; the sign of its normal depends on the normal
/// alone.
///
/// Axis-aligned planes are exact: the normal is a unit axis, the offset a vertex's coordinate.
fn own_plane(points: &[DVec3], tolerance: &Tolerance) -> Option<Plane> {
    if poly::width(points) < tolerance.plane {
        return None;
    }
    let n = poly::area_normal(points).try_normalize()?;
    for axis in 0..3 {
        if points.iter().all(|p| p[axis] == points[0][axis]) {
            let mut normal = DVec3::ZERO;
            normal[axis] = 1.0;
            return Some(Plane {
                normal,
                d: -points[0][axis],
            });
        }
    }
    let n = if faces_ahead(n) { n } else { -n };
    let mean = points.iter().sum::<DVec3>() / points.len() as f64;
    Some(Plane::through(mean, n))
}

/// Gives every surface its plane: an existing one that holds all its vertices, or a new one.
///
/// A pair of surfaces in one plane that [`PlaneList`] misses still meets in the tree, where a surface that lies in a
/// splitter within tolerance counts as in it.
pub(super) fn gather(
    mut surfaces: Vec<Surface>,
    center: DVec3,
    tolerance: &Tolerance,
    purse: Purse<'_>,
) -> SurfaceSet {
    canonical_order(&mut surfaces);
    let mut copies = take_copies(&mut surfaces);
    let mut planes = PlaneList::new(center, tolerance.plane);
    let own: Vec<Option<Plane>> = surfaces
        .par_iter()
        .chain(&copies)
        .map(|s| own_plane(&s.points, tolerance))
        .collect();
    for (s, own) in surfaces.iter_mut().chain(&mut copies).zip(own) {
        let before = planes.n_looked();
        s.plane = own.map_or(NO_PLANE, |own| planes.find_or_add(&own, &s.points));
        if !purse.spend(WORK_A_SURFACE + (planes.n_looked() - before) / 4) {
            break;
        }
    }
    SurfaceSet {
        surfaces,
        planes,
        copies,
    }
}

/// Adds the seams. `bvh` is the tree of the input's triangles.
pub(super) fn add_seams(set: &mut SurfaceSet, bvh: &Bvh, tolerance: &Tolerance, purse: Purse<'_>) {
    for mut seam in seams(&set.surfaces, set.planes.planes(), bvh, tolerance, purse) {
        let own = own_plane(&seam.points, tolerance);
        seam.plane = own.map_or(NO_PLANE, |own| set.planes.find_or_add(&own, &seam.points));
        set.surfaces.push(seam);
    }
}

/// Removes and returns triangles with [`MOST_COPIES`] identical ones before them, in canonical order.
fn take_copies(surfaces: &mut Vec<Surface>) -> Vec<Surface> {
    let mut copies = Vec::new();
    let mut kept: Vec<Surface> = Vec::with_capacity(surfaces.len());
    let mut n_alike = 0;
    for surface in surfaces.drain(..) {
        let is_alike = kept.last().is_some_and(|last| {
            matches!(surface.source, Source::Triangle(_))
                && sorted_points(last) == sorted_points(&surface)
        });
        n_alike = if is_alike { n_alike + 1 } else { 0 };
        if n_alike < MOST_COPIES {
            kept.push(surface);
        } else {
            copies.push(surface);
        }
    }
    *surfaces = kept;
    copies
}

/// Returns seams along the edges that come apart as their triangles move into planes.
///
/// A triangle's vertices move by up to a tolerance into its plane. If another triangle begins at such an edge, in a
/// plane at a shallow angle, the two planes cross far beside the edge, and a wedge lies between them: at the edge
/// thinner than any opening, yet open to one side in front of it and to the other behind it. A strip across the edge,
/// slightly higher than the wedge, closes it where the scene is closed. One query of a box tree for each edge moved.
fn seams(
    surfaces: &[Surface],
    planes: &[Plane],
    bvh: &Bvh,
    tolerance: &Tolerance,
    purse: Purse<'_>,
) -> Vec<Surface> {
    let mut of_triangle: Vec<Option<&Surface>> = Vec::new();
    let mut flat: Vec<&Surface> = Vec::new();
    for s in surfaces.iter().filter(|s| s.plane != NO_PLANE) {
        if let Source::Triangle(t) = s.source {
            let t = t as usize;
            of_triangle.resize(of_triangle.len().max(t + 1), None);
            of_triangle[t] = Some(s);
            flat.push(s);
        }
    }
    let is_moved = |s: &Surface| {
        let plane = &planes[s.plane as usize];
        s.points
            .iter()
            .any(|&p| plane.signed_distance(p).abs() > tolerance.cut)
    };
    if !flat.iter().any(|s| is_moved(s)) {
        return Vec::new();
    }
    let seams: Vec<(EdgeKey, Surface)> = flat
        .par_iter()
        .with_min_len(64)
        .filter(|s| is_moved(s))
        .flat_map_iter(|s| {
            let normal = planes[s.plane as usize].normal;
            let of_triangle = &of_triangle;
            (0..3).filter_map(move |i| {
                let (a, b) = (s.points[i], s.points[(i + 1) % 3]);
                let mut n_looked = 0;
                let is_apart = |other: &Surface| {
                    let other_normal = || planes[other.plane as usize].normal;
                    other.plane != s.plane
                        && other_normal().cross(normal).length_squared() < SHALLOW * SHALLOW
                        && run_along(&other.points, a, b, tolerance.width)
                };
                let found = bvh.for_each_around_segment(a, b, tolerance.width, |t, _| {
                    n_looked += 1;
                    match of_triangle.get(t as usize).copied().flatten() {
                        Some(other) if is_apart(other) => ControlFlow::Break(()),
                        _ => ControlFlow::Continue(()),
                    }
                });
                let is_wanted = purse.spend(WORK_A_SURFACE + n_looked / 4) && found.is_break();
                is_wanted.then(|| {
                    let up = normal * (1.5 * tolerance.width);
                    let seam = Surface {
                        source: Source::Seam,
                        plane: NO_PLANE,
                        points: [a - up, b - up, b + up, a + up].into_iter().collect(),
                    };
                    (edge_key(a, b), seam)
                })
            })
        })
        .collect();
    // Both triangles at an edge may propose one. Their order is that of the surfaces for any number of threads.
    let mut seen: HashSet<EdgeKey> = HashSet::new();
    seams
        .into_iter()
        .filter(|(key, _)| seen.insert(*key))
        .map(|(_, seam)| seam)
        .collect()
}

/// Returns `true` if a polygon has an edge that overlaps the segment from `a` to `b`.
fn run_along(points: &[DVec3], a: DVec3, b: DVec3, width: f64) -> bool {
    let length = a.distance(b);
    let along = (b - a) / length;
    let mut last: Option<f64> = None;
    points.iter().chain(&points[..1]).any(|&p| {
        let at = along.dot(p - a);
        let is_on_line = (p - a - along * at).length() <= width;
        let before = std::mem::replace(&mut last, is_on_line.then_some(at));
        let (Some(from), true) = (before, is_on_line) else {
            return false;
        };
        at.max(from).min(length) - at.min(from).max(0.0) > width
    })
}

type EdgeKey = [[u64; 3]; 2];

fn edge_key(a: DVec3, b: DVec3) -> EdgeKey {
    let mut key = [a, b].map(|p| p.to_array().map(ordered_bits));
    key.sort_unstable();
    key
}

/// Returns `true` if all of a surface lies in the plane `plane_id`. Fragments moved one by one would come apart where
/// their regions meet.
pub(super) fn lies_in<'a>(
    surface_plane: u32,
    points: impl FnOnce() -> &'a [DVec3],
    plane_id: u32,
    planes: &[Plane],
    tolerance: &Tolerance,
) -> bool {
    if surface_plane == plane_id {
        return true;
    }
    let plane = &planes[plane_id as usize];
    // Only near-parallel planes: the tip of a steep wall is near the floor, and must stay a wall.
    planes[surface_plane as usize]
        .normal
        .cross(plane.normal)
        .length_squared()
        < PARALLEL * PARALLEL
        && points()
            .iter()
            .all(|&p| plane.signed_distance(p).abs() <= tolerance.plane)
}

/// Returns the vertices moved onto `plane`, counter-clockwise seen from its positive side.
pub(super) fn projected(points: &[DVec3], plane: &Plane) -> Poly {
    let mut poly: Poly = points.iter().map(|&p| plane.project(p)).collect();
    if poly::area_normal(&poly).dot(plane.normal) < 0.0 {
        poly.reverse();
    }
    poly
}
