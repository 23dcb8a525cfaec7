//! Screens: from where two floods meet to a plane in the real opening.
//!
//! Haumont et al. 2003, §4.3 place a portal from the distance map (the geodesic between the two
//! regions) or from the silhouette of the opening seen from one side, and take the smaller. We take
//! the smallest, too, but among planes that the scene itself suggests: the planes of the walls around
//! the opening, the middles between two of them, and the front's own mean plane, moved and tilted.
//! Each candidate is judged by its *free cross-section*: the part of the plane that can be reached
//! from the front without meeting a triangle, measured on the triangles themselves, not on voxels.
//!
//! The result is a [`Screen`]: a convex polygon that covers that cross-section and reaches a little
//! into the walls. How much of it is really open, and between which cells, the cell complex decides.
//!
//! Cost: a few dozen sections an opening, each linear in the triangles near it. Numerically harmless:
//! a section is a picture of fixed resolution; errors make a screen a few centimeters too large.

use enfilade_geom::{Aabb, DVec3, Plane, Triangle, Winding, triangle_area_normal};

use crate::voxel::Grid;

use super::fronts::{Opening, face_center};

/// A candidate portal: a convex polygon across an opening, a bit larger than the opening.
#[derive(Clone, Debug)]
pub struct Screen {
    /// The regions it parts.
    pub regions: [u32; 2],
    /// Its polygon, counter-clockwise seen from the second region.
    pub winding: Winding,
    /// Free cross-section in its plane. [Units: wu²]
    pub area: f64,
    /// Whether the cross-section is closed by triangles all around.
    pub bounded: bool,
    /// Share of the opening that a door leaf or a pane fills.
    pub closed: f64,
}

/// Most lattice points along one side of a section's picture.
const MAX_SIDE: usize = 320;
/// Finest lattice spacing of a section's picture. [Units: wu]
const FINEST: f64 = 0.02;
/// How far around the front's extent a section may reach before it counts as unbounded. [Units: wu]
const MARGIN: f64 = 0.7;
/// How far from the front's mean plane a candidate may lie. [Units: wu]
const OFFSET: f64 = 0.6;

/// Fits a screen to an opening. `near` lists the structural triangles that touch a box.
#[must_use]
pub fn fit_screen(
    grid: &Grid,
    opening: &Opening,
    regions: [u32; 2],
    triangles: &[Triangle],
    near: &dyn Fn(&Aabb) -> Vec<u32>,
) -> Screen {
    let centers: Vec<DVec3> = opening
        .faces
        .iter()
        .map(|&f| face_center(grid, f))
        .collect();
    fit_screen_at(&centers, grid.voxel, opening, regions, triangles, near)
}

/// Fits a screen to an opening for which points `spacing` apart stand; its faces are not asked.
#[must_use]
pub fn fit_screen_at(
    centers: &[DVec3],
    spacing: f64,
    opening: &Opening,
    regions: [u32; 2],
    triangles: &[Triangle],
    near: &dyn Fn(&Aabb) -> Vec<u32>,
) -> Screen {
    let bounds = Aabb::of_points(centers).expanded(OFFSET + MARGIN);
    let around: Vec<Triangle> = near(&bounds)
        .iter()
        .map(|&t| triangles[t as usize])
        .collect();
    let mut best: Option<Section> = None;
    // Wall planes come first; others are asked only when no wall closes the opening.
    for normals in candidate_normals(opening, &around) {
        for normal in normals {
            for plane in candidate_planes(opening, normal, &around) {
                let section = free_section(&plane, centers, &around, spacing);
                let better = best
                    .as_ref()
                    .is_none_or(|b| section.cost(opening) < b.cost(opening) - 1e-9);
                if better {
                    best = Some(section);
                }
            }
        }
        if best.as_ref().is_some_and(|b| b.bounded) {
            break;
        }
    }
    let section = best.unwrap_or_else(|| free_section(&opening.plane, centers, &around, spacing));
    Screen {
        regions,
        winding: section.winding(),
        area: section.area,
        bounded: section.bounded,
        closed: opening.closed,
    }
}

/// Directions worth trying, unit length, facing like the opening's own normal: those of walls, the
/// front's own, and tilted ones.
fn candidate_normals(opening: &Opening, around: &[Triangle]) -> [Vec<DVec3>; 3] {
    let own = opening.plane.normal;
    let mut normals: Vec<(DVec3, f64)> = Vec::new();
    for t in around {
        let area_normal = triangle_area_normal(t);
        let area = area_normal.length();
        if area < 1e-9 {
            continue;
        }
        let mut n = area_normal / area;
        if n.dot(own) < 0.0 {
            n = -n;
        }
        // At a door in the corner of a room the front runs askew, by up to half a right angle.
        if n.dot(own) < 0.65 {
            continue;
        }
        // Large walls far off count no more than what stands right at the opening.
        let weight = area.min(opening.area);
        match normals.iter_mut().find(|(m, _)| m.dot(n) > 0.9998) {
            Some((_, w)) => *w += weight,
            None => normals.push((n, weight)),
        }
    }
    normals.sort_by(|a, b| {
        b.1.total_cmp(&a.1)
            .then(b.0.dot(own).total_cmp(&a.0.dot(own)))
    });
    normals.retain(|&(_, w)| w > 0.1 * opening.area);
    normals.truncate(3);
    let walls: Vec<DVec3> = normals.into_iter().map(|(n, _)| n).collect();
    let mut fronts: Vec<DVec3> = Vec::new();
    // The front is a little ragged: upright and level planes are what it means most of the time.
    let upright = DVec3::new(own.x, 0.0, own.z).normalize_or_zero();
    for n in [upright, DVec3::Y * own.y.signum(), own] {
        if n.dot(own) > 0.94 && walls.iter().chain(&fronts).all(|m| m.dot(n) < 0.9998) {
            fronts.push(n);
        }
    }
    let (u, v) = opening.plane.basis();
    let tilted = [u, -u, v, -v].map(|tilt| (own + tilt * 0.2).normalize());
    [walls, fronts, tilted.to_vec()]
}

/// Planes with this normal worth trying: those of walls, those midway between two, and a sweep.
fn candidate_planes(opening: &Opening, normal: DVec3, around: &[Triangle]) -> Vec<Plane> {
    let middle = Plane::through(opening.center, normal);
    let mut offsets: Vec<f64> = Vec::new();
    for t in around {
        let d = t.map(|p| middle.signed_distance(p));
        let (lo, hi) = (d[0].min(d[1]).min(d[2]), d[0].max(d[1]).max(d[2]));
        if hi - lo < 2e-3 && hi > -OFFSET && lo < OFFSET && triangle_area_normal(t).length() > 1e-4
        {
            offsets.push((lo + hi) * 0.5);
        }
    }
    offsets.sort_by(f64::total_cmp);
    offsets.dedup_by(|a, b| (*a - *b).abs() < 2e-3);
    let mut tries: Vec<f64> = offsets
        .windows(2)
        .filter(|w| w[1] - w[0] > 4e-3)
        .map(|w| (w[0] + w[1]) * 0.5)
        .collect();
    tries.extend(&offsets);
    tries.extend((-6..=6).map(|i| f64::from(i) * OFFSET / 6.0));
    tries
        .iter()
        .map(|&t| Plane::through(opening.center + normal * t, normal))
        .collect()
}

/// What of a plane can be reached from the front without meeting a triangle.
struct Section {
    plane: Plane,
    /// Lattice origin, directions and spacing.
    origin: DVec3,
    u: DVec3,
    v: DVec3,
    step: f64,
    side: [usize; 2],
    open: Vec<bool>,
    area: f64,
    bounded: bool,
    /// Distance from the front's middle.
    offset: f64,
}

impl Section {
    /// Lower is better: the smallest closed section; near ties go to the plane nearest the front.
    fn cost(&self, opening: &Opening) -> f64 {
        let unbounded = if self.bounded { 1.0 } else { 4.0 };
        // A tenth of a wall's thickness is no reason to prefer a plane off the middle.
        (self.area + 1e-3) * unbounded * (1.0 + 0.1 * self.offset.abs())
            + 0.02 * opening.area * self.offset.abs()
    }

    /// Convex hull of the open lattice cells, grown into the walls.
    fn winding(&self) -> Winding {
        let mut corners = Vec::new();
        let [nu, nv] = self.side;
        let grow = self.step * 1.5 + 0.01;
        for j in 0..nv {
            let row = &self.open[j * nu..(j + 1) * nu];
            let (Some(first), Some(last)) =
                (row.iter().position(|&o| o), row.iter().rposition(|&o| o))
            else {
                continue;
            };
            for (i, sign) in [(first as f64, -1.0), (last as f64 + 1.0, 1.0)] {
                for (dj, up) in [(0.0, -1.0), (1.0, 1.0)] {
                    corners.push(
                        self.origin
                            + self.u * (i * self.step + sign * grow)
                            + self.v * ((j as f64 + dj) * self.step + up * grow),
                    );
                }
            }
        }
        Winding::hull_in_plane(&self.plane, &corners)
    }
}

fn free_section(plane: &Plane, centers: &[DVec3], around: &[Triangle], voxel: f64) -> Section {
    let (u, v) = plane.basis();
    let base = plane.project(centers[0]);
    let (mut lo, mut hi) = ([f64::MAX; 2], [f64::MIN; 2]);
    let mut offset = 0.0;
    for &c in centers {
        for (k, t) in [u.dot(c - base), v.dot(c - base)].into_iter().enumerate() {
            lo[k] = lo[k].min(t);
            hi[k] = hi[k].max(t);
        }
        offset += plane.signed_distance(c);
    }
    offset /= centers.len() as f64;
    let margin = MARGIN + voxel;
    let extent = (hi[0] - lo[0]).max(hi[1] - lo[1]) + 2.0 * margin;
    let step = (extent / MAX_SIDE as f64).max(FINEST);
    let side = [0, 1].map(|k| (((hi[k] - lo[k] + 2.0 * margin) / step).ceil() as usize).max(1));
    let origin = base + u * (lo[0] - margin) + v * (lo[1] - margin);
    let mut blocked = vec![false; side[0] * side[1]];
    let to_lattice = |p: DVec3| [u.dot(p - origin) / step, v.dot(p - origin) / step];
    for t in around {
        let d = t.map(|p| plane.signed_distance(p));
        if d.iter().all(|d| d.abs() < 1e-3) {
            fill_triangle(&mut blocked, side, t.map(to_lattice));
        } else if d.iter().any(|&d| d <= 0.0) && d.iter().any(|&d| d >= 0.0) {
            let mut ends: [Option<DVec3>; 2] = [None, None];
            for i in 0..3 {
                let j = (i + 1) % 3;
                if (d[i] < 0.0) != (d[j] < 0.0) {
                    let cut = t[i] + (t[j] - t[i]) * (d[i] / (d[i] - d[j]));
                    let slot = usize::from(ends[0].is_some());
                    ends[slot] = Some(cut);
                }
            }
            if let [Some(p), Some(q)] = ends {
                draw_segment(&mut blocked, side, to_lattice(p), to_lattice(q));
            }
        }
    }
    // The piece that most of the front projects onto.
    let mut piece = vec![0_u32; blocked.len()];
    let mut hits: Vec<(usize, usize, bool)> = Vec::new(); // seeds, cells, touches the border
    let mut stack = Vec::new();
    for &c in centers {
        let [x, y] = to_lattice(c);
        let (i, j) = (
            (x.max(0.0) as usize).min(side[0] - 1),
            (y.max(0.0) as usize).min(side[1] - 1),
        );
        let at = j * side[0] + i;
        if blocked[at] {
            continue;
        }
        if piece[at] == 0 {
            hits.push((0, 0, false));
            let id = hits.len() as u32;
            piece[at] = id;
            stack.push(at);
            let (mut cells, mut border) = (0, false);
            while let Some(k) = stack.pop() {
                cells += 1;
                let (i, j) = (k % side[0], k / side[0]);
                border |= i == 0 || j == 0 || i + 1 == side[0] || j + 1 == side[1];
                let mut visit = |inside: bool, next: usize| {
                    if inside && !blocked[next] && piece[next] == 0 {
                        piece[next] = id;
                        stack.push(next);
                    }
                };
                visit(i > 0, k.wrapping_sub(1));
                visit(i + 1 < side[0], k + 1);
                visit(j > 0, k.wrapping_sub(side[0]));
                visit(j + 1 < side[1], k + side[0]);
            }
            hits.last_mut().expect("pushed above").1 = cells;
            hits.last_mut().expect("pushed above").2 = border;
        }
        hits[piece[at] as usize - 1].0 += 1;
    }
    let main = (0..hits.len()).max_by_key(|&i| (hits[i].0, usize::MAX - i));
    let (open, area, bounded) = match main {
        Some(i) => {
            let open = piece.iter().map(|&p| p as usize == i + 1).collect();
            // A plane that most of the front misses is no plane of this opening.
            let share = hits[i].0 as f64 / centers.len() as f64;
            (
                open,
                hits[i].1 as f64 * step * step,
                !hits[i].2 && share > 0.5,
            )
        }
        None => (blocked.iter().map(|b| !b).collect(), f64::MAX / 1e6, false),
    };
    Section {
        plane: *plane,
        origin,
        u,
        v,
        step,
        side,
        open,
        area,
        bounded,
        offset,
    }
}

/// Marks the lattice cells along a segment, so that no step between edge neighbors crosses it.
fn draw_segment(blocked: &mut [bool], side: [usize; 2], p: [f64; 2], q: [f64; 2]) {
    let length = (q[0] - p[0]).abs().max((q[1] - p[1]).abs());
    let n = ((length * 2.0).ceil() as usize).clamp(1, 4 * MAX_SIDE * 8);
    for k in 0..=n {
        let t = k as f64 / n as f64;
        let (x, y) = (p[0] + (q[0] - p[0]) * t, p[1] + (q[1] - p[1]) * t);
        if x >= 0.0 && y >= 0.0 && (x as usize) < side[0] && (y as usize) < side[1] {
            blocked[y as usize * side[0] + x as usize] = true;
        }
    }
}

/// Marks the lattice cells whose centers a triangle of the plane covers.
fn fill_triangle(blocked: &mut [bool], side: [usize; 2], t: [[f64; 2]; 3]) {
    for i in 0..3 {
        draw_segment(blocked, side, t[i], t[(i + 1) % 3]);
    }
    let cross = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let range = |k: usize| {
        let lo = t.iter().map(|p| p[k]).fold(f64::MAX, f64::min).max(0.0);
        let hi = t
            .iter()
            .map(|p| p[k])
            .fold(f64::MIN, f64::max)
            .min(side[k] as f64);
        (lo as usize, hi.max(0.0) as usize)
    };
    let ((x0, x1), (y0, y1)) = (range(0), range(1));
    for y in y0..y1.min(side[1]) {
        for x in x0..x1.min(side[0]) {
            let c = [x as f64 + 0.5, y as f64 + 0.5];
            let s = [
                cross(t[0], t[1], c),
                cross(t[1], t[2], c),
                cross(t[2], t[0], c),
            ];
            if s.iter().all(|&s| s >= 0.0) || s.iter().all(|&s| s <= 0.0) {
                blocked[y * side[0] + x] = true;
            }
        }
    }
}
