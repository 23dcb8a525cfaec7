//! The flat surfaces of a model whose vertices are off, and their planes.

use enfilade_geom::{Allowance, DVec3, Plane, Triangle, triangle_area_normal};

use super::weld::PointMesh;
use crate::complex::planes::{PlaneList, faces_ahead};

/// Least cosine of the angle between a triangle of a sheet and its plane: small triangles turn far when their vertices
/// move, but the edge of a thin plate stays apart from its face.
const LEAST_COSINE: f64 = 0.5;

/// The planes of the sheets, largest first, and to which each triangle belongs.
pub(super) struct Sheets {
    pub(super) planes: Vec<Plane>,
    /// The plane of each triangle; `None` if it has no area.
    pub(super) plane_of: Vec<Option<u32>>,
}

/// Triangles in one plane, connected by their vertices.
struct Sheet {
    triangles: Vec<u32>,
    plane: Plane,
    area: f64,
}

impl Sheets {
    /// Finds the sheets of a model whose vertices are up to `off` from their places. [Units: wu]
    pub(super) fn of(
        mesh: &PointMesh,
        triangles: &[Triangle],
        off: f64,
        allowance: &Allowance,
    ) -> Self {
        let mut sheets = grow(mesh, triangles, off, allowance);
        sheets.sort_by(|a, b| b.area.total_cmp(&a.area));
        let center = mesh.points.iter().sum::<DVec3>() / mesh.points.len().max(1) as f64;
        let mut list = PlaneList::new(center, off);
        let mut plane_of = vec![None; triangles.len()];
        for sheet in &sheets {
            let points: Vec<DVec3> = points_of(sheet, triangles).collect();
            let before = list.n_looked();
            let id = list.find_or_add(&sheet.plane, &points);
            allowance.spend((list.n_looked() - before) / 4);
            for &t in &sheet.triangles {
                plane_of[t as usize] = Some(id);
            }
        }
        Self {
            planes: list.into_planes(),
            plane_of,
        }
    }
}

fn points_of<'a>(sheet: &'a Sheet, triangles: &'a [Triangle]) -> impl Iterator<Item = DVec3> + 'a {
    sheet.triangles.iter().flat_map(|&t| triangles[t as usize])
}

/// Grows sheets from the largest triangles on. Every triangle with an area is in one.
fn grow(mesh: &PointMesh, triangles: &[Triangle], off: f64, allowance: &Allowance) -> Vec<Sheet> {
    let normals: Vec<DVec3> = triangles.iter().map(triangle_area_normal).collect();
    let area = |t: u32| 0.5 * normals[t as usize].length();
    let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
    order.retain(|&t| area(t) > 0.0);
    // Points are sorted by place, so the order of the input has no say.
    order.sort_by_cached_key(|&t| {
        let mut ids = mesh.corners[t as usize];
        ids.sort_unstable();
        ids
    });
    let around = TrianglesAt::of(mesh, &order);
    order.sort_by(|&s, &t| area(t).total_cmp(&area(s)));
    let mut is_taken = vec![false; triangles.len()];
    let mut sheets = Vec::new();
    for seed in order {
        if std::mem::replace(&mut is_taken[seed as usize], true) {
            continue;
        }
        let mut sheet = Sheet {
            triangles: vec![seed],
            plane: fitted(&[seed], triangles, &normals, normals[seed as usize]),
            area: 0.0,
        };
        let (mut next, mut n_fitted) = (0, 1);
        while next < sheet.triangles.len() {
            let at = mesh.corners[sheet.triangles[next] as usize];
            next += 1;
            for t in at.iter().flat_map(|&p| around.triangles_at(p)) {
                if is_taken[*t as usize] || !allowance.spend(1) {
                    continue;
                }
                let (triangle, normal) = (&triangles[*t as usize], normals[*t as usize]);
                let is_in = normal.dot(sheet.plane.normal).abs() > LEAST_COSINE * normal.length()
                    && triangle
                        .iter()
                        .all(|&p| sheet.plane.signed_distance(p).abs() <= off);
                if is_in {
                    is_taken[*t as usize] = true;
                    sheet.triangles.push(*t);
                }
            }
            if sheet.triangles.len() >= 2 * n_fitted || next == sheet.triangles.len() {
                n_fitted = sheet.triangles.len();
                sheet.plane = fitted(&sheet.triangles, triangles, &normals, sheet.plane.normal);
            }
        }
        sheet.area = sheet.triangles.iter().map(|&t| area(t)).sum();
        sheet.plane = upright(sheet.plane, points_of(&sheet, triangles), off);
        sheets.push(sheet);
    }
    sheets
}

/// Returns the plane through the middle of triangles, at a right angle to the sum of their areas: of the points inside,
/// which neighbors share, none turns it.
fn fitted(members: &[u32], triangles: &[Triangle], normals: &[DVec3], like: DVec3) -> Plane {
    let (mut normal, mut middle, mut weight) = (DVec3::ZERO, DVec3::ZERO, 0.0);
    for &t in members {
        let (n, [a, b, c]) = (normals[t as usize], triangles[t as usize]);
        let area = n.length();
        normal += n * n.dot(like).signum();
        middle += (a + b + c) / 3.0 * area;
        weight += area;
    }
    let normal = normal.normalize_or(like.normalize_or(DVec3::Y));
    Plane::through(
        middle / weight,
        if faces_ahead(normal) { normal } else { -normal },
    )
}

/// Returns the plane that follows the axes if that holds all points as well.
fn upright(plane: Plane, points: impl Iterator<Item = DVec3>, off: f64) -> Plane {
    let axis = (0..3).max_by(|&a, &b| plane.normal[a].abs().total_cmp(&plane.normal[b].abs()));
    let axis = axis.unwrap_or(0);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    points.for_each(|p| (low, high) = (low.min(p[axis]), high.max(p[axis])));
    if high - low > 2.0 * off {
        return plane;
    }
    let mut normal = DVec3::ZERO;
    normal[axis] = 1.0;
    // One that vertices of the file can lie in to the last bit.
    let at = f64::from((0.5 * (low + high)) as f32);
    Plane { normal, d: -at }
}

/// The triangles at each point.
struct TrianglesAt {
    start: Vec<u32>,
    triangles: Vec<u32>,
}

impl TrianglesAt {
    /// Lists the triangles of `order`, in that order.
    fn of(mesh: &PointMesh, order: &[u32]) -> Self {
        let corners = || order.iter().map(|&t| (t, mesh.corners[t as usize]));
        let mut start = vec![0_u32; mesh.points.len() + 1];
        for p in corners().flat_map(|c| c.1) {
            start[p as usize + 1] += 1;
        }
        for i in 1..start.len() {
            start[i] += start[i - 1];
        }
        let mut end = start.clone();
        let mut triangles = vec![0_u32; 3 * order.len()];
        for (t, ids) in corners() {
            for p in ids {
                triangles[end[p as usize] as usize] = t;
                end[p as usize] += 1;
            }
        }
        Self { start, triangles }
    }

    fn triangles_at(&self, p: u32) -> &[u32] {
        let at = |i: u32| self.start[i as usize] as usize;
        &self.triangles[at(p)..at(p + 1)]
    }
}
