//! Surfaces (triangles and screens) and the one list of planes that they share.

use std::collections::HashMap;

use enfilade_geom::{Aabb, DVec3, Plane};

use super::poly::{self, Poly};

/// What a surface is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Source {
    /// A structural triangle, by its index in the input.
    Triangle(u32),
    /// A screen, by its index in the input.
    Screen(u32),
}

/// A triangle or a screen.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    /// What it is.
    pub(super) source: Source,
    /// Index into the list of planes, or [`NO_PLANE`].
    pub(super) plane: u32,
    /// Corners as given.
    pub(super) points: SurfacePoints,
}

/// Corners of a surface; triangles stay inline.
pub(super) type SurfacePoints = smallvec::SmallVec<[DVec3; 3]>;

/// The plane of a surface too thin to have one.
pub(super) const NO_PLANE: u32 = u32::MAX;

/// Tolerances of one complex. [Units: wu]
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolerance {
    /// Surfaces this near to a plane lie in it.
    pub(super) plane: f64,
    /// Corners this near to a cutting plane are on it.
    pub(super) cut: f64,
    /// Openings narrower than this are closed.
    pub(super) width: f64,
}

/// Openings of less area are closed. [Units: wu²]
pub(super) const MIN_AREA: f64 = 1e-8;

/// Planes whose normals differ by less than this (radians) may hold each other's surfaces.
pub(super) const PARALLEL: f64 = 0.02;

impl Tolerance {
    /// For coordinates up to `extent` from the origin.
    ///
    /// Corners are `f32`: half a unit in the last place is `6e-8 * extent`, and a plane through
    /// three such corners strays a few times that over its own triangle's neighborhood.
    pub(super) fn for_extent(extent: f64) -> Self {
        let plane = (4e-7 * extent).max(2e-6);
        // f64 noise is 1e-15 of the extent; the planes that meet differ by more than plane / size,
        // so cut corners are good to about 1e-9 of the extent.
        let cut = (1e-10 * extent).max(1e-9);
        Self {
            plane,
            cut,
            width: 2.0 * plane,
        }
    }
}

/// The plane list and who lies in it.
pub(super) struct SurfaceSet {
    /// Surfaces, largest first, then by coordinates: the same for any order of the input.
    pub(super) surfaces: Vec<Surface>,
    /// Distinct planes.
    pub(super) planes: Vec<Plane>,
}

/// Orders by area, then coordinates, so that the input's order has no say.
fn canonical_order(surfaces: &mut [Surface]) {
    let key = |s: &Surface| (poly::area(&s.points), matches!(s.source, Source::Screen(_)));
    surfaces.sort_by_cached_key(|s| {
        let (area, screen) = key(s);
        let mut corners: Vec<[u64; 3]> = s
            .points
            .iter()
            .map(|p| p.to_array().map(ordered_bits))
            .collect();
        // Duplicates may start at different corners or turn the other way.
        corners.sort_unstable();
        let by_area = std::cmp::Reverse(ordered_bits(area));
        (screen, by_area, corners, s.source)
    });
}

/// Bits that compare like the number.
fn ordered_bits(x: f64) -> u64 {
    let bits = (x + 0.0).to_bits();
    if bits >> 63 == 1 {
        !bits
    } else {
        bits | (1 << 63)
    }
}

/// The plane of a polygon, its normal's sign chosen by the normal alone.
///
/// Axis-aligned planes come out exact: the normal a unit axis, the offset a corner's coordinate.
fn own_plane(points: &[DVec3]) -> Option<Plane> {
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
    // An odd direction: the largest component would tie on every 45 degree wall.
    let n = if n.dot(DVec3::new(1.0, 0.618_034, 0.324_718)) < 0.0 {
        -n
    } else {
        n
    };
    let mean = points.iter().sum::<DVec3>() / points.len() as f64;
    Some(Plane::through(mean, n))
}

/// Gives every surface its plane: one that exists and holds all its corners, or a new one.
///
/// Planes are looked up by rounded normal and offset, both neighbors tried where the value is
/// near a step. A pair missed by that (tiny triangle, far from the origin) still meets in the tree,
/// where a fragment that lies in a splitter within tolerance is taken to be in it.
pub(super) fn gather(
    mut surfaces: Vec<Surface>,
    bounds: &Aabb,
    tolerance: &Tolerance,
) -> SurfaceSet {
    canonical_order(&mut surfaces);
    let center = bounds.center();
    let mut planes: Vec<Plane> = Vec::new();
    let mut buckets: HashMap<[i32; 4], Vec<u32>> = HashMap::new();
    for s in &mut surfaces {
        s.plane = NO_PLANE;
        if poly::width(&s.points) < tolerance.plane {
            continue;
        }
        let Some(plane) = own_plane(&s.points) else {
            continue;
        };
        let at = [
            plane.normal.x * 256.0,
            plane.normal.y * 256.0,
            plane.normal.z * 256.0,
            plane.signed_distance(center) * 100.0,
        ];
        let mut best: Option<(f64, u32)> = None;
        for choice in 0..16u32 {
            let key: [i32; 4] = std::array::from_fn(|i| {
                let low = (at[i] - 0.5).floor() as i32;
                low + (choice >> i & 1) as i32
            });
            for &id in buckets.get(&key).into_iter().flatten() {
                let p = &planes[id as usize];
                let stray = s
                    .points
                    .iter()
                    .map(|&q| p.signed_distance(q).abs())
                    .fold(0.0, f64::max);
                if stray <= tolerance.plane && best.is_none_or(|b| (stray, id) < b) {
                    best = Some((stray, id));
                }
            }
        }
        s.plane = match best {
            Some((_, id)) => id,
            None => {
                let id = planes.len() as u32;
                planes.push(plane);
                buckets
                    .entry(at.map(|x| x.floor() as i32))
                    .or_default()
                    .push(id);
                id
            }
        };
    }
    SurfaceSet { surfaces, planes }
}

/// Whether a fragment of a surface lies in `plane`, whose id is `plane_id`.
pub(super) fn lies_in(
    surface_plane: u32,
    points: &[DVec3],
    plane_id: u32,
    planes: &[Plane],
    tolerance: &Tolerance,
) -> bool {
    if surface_plane == plane_id {
        return true;
    }
    let plane = &planes[plane_id as usize];
    // Only near-parallel ones: the tip of a steep wall is near the floor, and must stay a wall.
    planes[surface_plane as usize]
        .normal
        .cross(plane.normal)
        .length_squared()
        < PARALLEL * PARALLEL
        && points
            .iter()
            .all(|&p| plane.signed_distance(p).abs() <= tolerance.plane)
}

/// Corners moved onto `plane`, counter-clockwise seen from its positive side.
pub(super) fn projected(points: &[DVec3], plane: &Plane) -> Poly {
    let mut poly: Poly = points.iter().map(|&p| plane.project(p)).collect();
    if poly::area_normal(&poly).dot(plane.normal) < 0.0 {
        poly.reverse();
    }
    poly
}
