//! Candidate portals: fits a plane in the real opening to the faces where two cells meet.
//!
//! Haumont et al. 2003, §4.3 place a portal from the distance map (the geodesic between the two
//! regions) or from the silhouette of the opening seen from one side, and take the smaller. We also take
//! the smallest, but among planes that the scene itself suggests: the planes of the walls around
//! the opening, midway between two of them, and the front's own mean plane, moved and tilted.
//! Each plane is judged by its *free cross-section*: the part of the plane that can be reached
//! from the front without crossing a triangle, measured on the triangles themselves, not on voxels.
//!
//! The result is a [`Candidate`]: a convex polygon that covers that cross-section and reaches a little
//! into the walls. The cell complex decides which parts of it are open, and between which cells.
//!
//! Cost: a few dozen sections per opening, each linear in the triangles near it. Numerically harmless:
//! a section is a picture of fixed resolution; errors make a candidate a few centimeters too large.

use enfilade_geom::{Aabb, Allowance, Bvh, DVec3, Plane, Triangle, Winding, triangle_area_normal};

use enfilade_cpg::Why;

use super::picture::Picture;
use crate::SmallestHole;
use crate::voxel::{BitVolume, for_runs};

/// An opening between two cells, as the builder describes it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Opening {
    /// Mean plane.
    pub(crate) plane: Plane,
    /// Mean of the front's points. [Units: wu]
    pub(crate) center: DVec3,
    /// Length of the vector area, or the projected area if the front wraps around something. [Units: wu²]
    pub(crate) area: f64,
    /// Share filled by door leaves and panes.
    pub(crate) closed: f64,
}

/// A candidate portal: a convex polygon across an opening, slightly larger than the opening.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    /// Its polygon.
    pub(crate) winding: Winding,
    /// Share of the opening that a door leaf or a pane fills.
    pub(crate) closed: f64,
    /// Why there are two cells.
    pub(crate) why: Why,
}

/// Distance beyond the front's extent at which a section counts as unbounded. [Units: wu]
const MARGIN: f64 = 0.7;
/// Largest distance of a candidate from the front's mean plane. [Units: wu]
const OFFSET: f64 = 0.6;
/// Cosine of the greatest angle between normals that count as one: a degree.
const PARALLEL: f64 = 0.9998;
/// Greatest step within a surface, and distance of a surface that bounds a section from its plane, as a share of the widest gaps
/// that are closed.
const ROUNDED: f64 = 0.2;

/// Returns [`ROUNDED`] as a length, where gaps up to `hole` are closed or would be. [Units: wu]
fn rounding(hole: f64) -> f64 {
    ROUNDED * hole.max(SmallestHole::LEAST)
}

/// Fits the polygon of a candidate to an opening, given as points `spacing` apart all over it, among `triangles`, which `bvh` indexes.
/// Slits narrower than `hole` count as closed: through them a section would extend into the hollow of a wall.
#[must_use]
pub(crate) fn fit_candidate(
    centers: &[DVec3],
    spacing: f64,
    opening: &Opening,
    triangles: &[Triangle],
    bvh: &Bvh,
    hole: f64,
    allowance: &Allowance,
) -> Winding {
    let bounds = Aabb::of_points(centers).expanded(OFFSET + MARGIN);
    let mut near = Vec::new();
    bvh.for_each_in_box(&bounds, |t| near.push(t));
    near.sort_unstable();
    let around: Vec<Triangle> = near.iter().map(|&t| triangles[t as usize]).collect();
    let mut best: Option<FreeSection> = None;
    // Wall planes come first; others are tried only if no wall plane closes the opening.
    for normals in candidate_normals(opening, &around) {
        for normal in normals {
            for plane in candidate_planes(opening, normal, &around, hole) {
                let section = free_section(&plane, centers, &around, [spacing, hole]);
                // A picture of so many cells; each triangle is drawn into it.
                let n = section.open.n_voxels() / 4 + 5 * around.len() + centers.len() / 2;
                if !allowance.spend(n as u64) {
                    return section.winding();
                }
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
    let section =
        best.unwrap_or_else(|| free_section(&opening.plane, centers, &around, [spacing, hole]));
    section.winding()
}

/// Returns directions worth trying, unit length, facing like the opening's own normal: those of walls, the
/// front's own, and tilted ones.
fn candidate_normals(opening: &Opening, around: &[Triangle]) -> [Vec<DVec3>; 3] {
    let own = opening.plane.normal;
    let mut faces: Vec<(DVec3, f64)> = Vec::new();
    for t in around {
        let area_normal = triangle_area_normal(t);
        let area = area_normal.length();
        let facing = area_normal * area_normal.dot(own).signum();
        // At a door where two walls meet, the front runs askew, by up to 45 degrees.
        if area > 1e-9 && facing.dot(own) > 0.65 * area {
            faces.push((facing / area, area));
        }
    }
    // The largest surfaces represent those nearly parallel to them: small triangles tilt where vertices were moved.
    let order = |n: DVec3| n.to_array().map(f64::to_bits);
    faces.sort_by(|a, b| b.1.total_cmp(&a.1).then(order(a.0).cmp(&order(b.0))));
    let mut normals: Vec<(DVec3, f64)> = Vec::new();
    for (n, area) in faces {
        // Large walls far off count no more than surfaces right at the opening.
        let weight = area.min(opening.area);
        match normals.iter_mut().find(|(m, _)| m.dot(n) > PARALLEL) {
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
    // The front is a little ragged: its plane is usually meant to be upright or level.
    let upright = DVec3::new(own.x, 0.0, own.z).normalize_or_zero();
    for n in [upright, DVec3::Y * own.y.signum(), own] {
        if n.dot(own) > 0.94 && walls.iter().chain(&fronts).all(|m| m.dot(n) < PARALLEL) {
            fronts.push(n);
        }
    }
    let (u, v) = opening.plane.basis();
    let tilted = [u, -u, v, -v].map(|tilt| (own + tilt * 0.2).normalize());
    [walls, fronts, tilted.to_vec()]
}

/// Returns planes with about this normal worth trying: those of walls, those midway between two, and a sweep.
fn candidate_planes(
    opening: &Opening,
    normal: DVec3,
    around: &[Triangle],
    hole: f64,
) -> Vec<Plane> {
    let step = rounding(hole);
    let middle = Plane::through(opening.center, normal);
    let at_offset = |t: f64| Plane::through(opening.center + normal * t, normal);
    // Offset along the normal, area, and plane.
    let mut faces: Vec<(f64, f64, Plane)> = Vec::new();
    for t in around {
        let d = t.map(|p| middle.signed_distance(p));
        let (lo, hi) = (d[0].min(d[1]).min(d[2]), d[0].max(d[1]).max(d[2]));
        let area_normal = triangle_area_normal(t);
        let area = area_normal.length();
        if area <= 1e-4 || hi <= -OFFSET || lo >= OFFSET {
            continue;
        }
        let own = area_normal * (area_normal.dot(normal).signum() / area);
        let is_parallel = own.dot(normal) > PARALLEL;
        // Where the plane of a long wall crosses the normal; of a small triangle, only its place is known well.
        let at = if hi - lo < step {
            (lo + hi) * 0.5
        } else if is_parallel {
            (t[0] - opening.center).dot(own) / normal.dot(own)
        } else {
            continue;
        };
        let plane = if is_parallel {
            Plane::through((t[0] + t[1] + t[2]) / 3.0, own)
        } else {
            at_offset(at)
        };
        faces.push((at, area, plane));
    }
    faces.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.total_cmp(&a.1)));
    // The largest triangle represents those in about its plane, as in the complex: all of a long wall lies in its own plane, not
    // in one that a larger wall elsewhere suggests.
    let largest = faces.chunk_by(|a, b| b.0 - a.0 < step).filter_map(|sheet| {
        let all = sheet.iter().rev();
        all.max_by(|a, b| a.1.total_cmp(&b.1))
    });
    let (offsets, sheets): (Vec<f64>, Vec<Plane>) = largest.map(|f| (f.0, f.2)).unzip();
    let middles = (offsets.windows(2)).filter(|w| w[1] - w[0] > 2.0 * step);
    let mut tries: Vec<Plane> = middles.map(|w| at_offset((w[0] + w[1]) * 0.5)).collect();
    tries.extend(sheets);
    // A plane hardly off a wall's would leave a sliver of space between the two.
    let sweep = (-6..=6).map(|i| f64::from(i) * OFFSET / 6.0);
    let sweep = sweep.filter(|t| offsets.iter().all(|at| (at - t).abs() >= step));
    tries.extend(sweep.map(at_offset));
    tries
}

/// The part of a plane that can be reached from the front without crossing a triangle.
struct FreeSection {
    plane: Plane,
    picture: Picture,
    open: BitVolume,
    area: f64,
    bounded: bool,
    /// Distance from the front's middle.
    offset: f64,
}

impl FreeSection {
    /// Lower is better: the smallest closed section; near ties go to the plane nearest the front.
    fn cost(&self, opening: &Opening) -> f64 {
        let unbounded = if self.bounded { 1.0 } else { 4.0 };
        // A tenth of a wall's thickness does not justify a plane off the middle.
        (self.area + 1e-3) * unbounded * (1.0 + 0.1 * self.offset.abs())
            + 0.02 * opening.area * self.offset.abs()
    }

    /// Returns the convex hull of the open lattice cells, grown into the walls.
    fn winding(&self) -> Winding {
        let mut corners = Vec::new();
        let Picture {
            origin,
            u,
            v,
            step,
            side,
        } = self.picture;
        let nv = side[1];
        let grow = step * 1.5 + 0.01;
        for j in 0..nv {
            let mut ends: Option<[u32; 2]> = None;
            for_runs(self.open.row(j), |from, to| {
                ends = Some([ends.map_or(from, |e| e[0]), to]);
            });
            let Some([first, end]) = ends.map(|e| e.map(f64::from)) else {
                continue;
            };
            for (i, sign) in [(first, -1.0), (end, 1.0)] {
                for (dj, up) in [(0.0, -1.0), (1.0, 1.0)] {
                    corners.push(
                        origin
                            + u * (i * step + sign * grow)
                            + v * ((j as f64 + dj) * step + up * grow),
                    );
                }
            }
        }
        Winding::hull_in_plane(&self.plane, &corners)
    }
}

fn free_section(
    plane: &Plane,
    centers: &[DVec3],
    around: &[Triangle],
    [spacing, hole]: [f64; 2],
) -> FreeSection {
    let picture = Picture::around(plane, centers, MARGIN + spacing);
    let blocked = picture.blocked(plane, around, rounding(hole));
    // Half a hole from each side, rounded to cells.
    let reach = (0.5 * hole / picture.step).round() as usize;
    let patches = picture.patches(&picture.grown(&blocked, reach), centers);
    // The patch that most of the front projects onto, the first of several.
    let main = patches.iter().rev().max_by_key(|patch| patch.n_hits);
    let (open, area, bounded) = match main {
        Some(main) => {
            // A plane that most of the front misses does not belong to this opening.
            let share = main.n_hits as f64 / centers.len() as f64;
            let mut open = picture.grown(&main.cells, reach);
            open.subtract(&blocked);
            let area = open.count() as f64 * picture.step * picture.step;
            (open, area, !main.meets_border && share > 0.5)
        }
        None => (blocked.complement(), f64::MAX / 1e6, false),
    };
    let offset: f64 = centers.iter().map(|&c| plane.signed_distance(c)).sum();
    FreeSection {
        plane: *plane,
        picture,
        open,
        area,
        bounded,
        offset: offset / centers.len() as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the faces of a block, two triangles each.
    fn block(lo: DVec3, hi: DVec3) -> Vec<Triangle> {
        Aabb::new(lo, hi).triangles()
    }

    // Covers V4 and V5.
    #[test]
    fn a_front_that_stands_askew_before_a_doorway_gets_a_candidate_in_the_wall() {
        // A wall 0.2 m thick at x = 2 with a doorway of 1 × 2 m, floor and ceiling.
        let walls = [
            ([2.0, 0.0, 0.0], [2.2, 2.5, 2.0]),
            ([2.0, 0.0, 3.0], [2.2, 2.5, 5.0]),
            ([2.0, 2.0, 2.0], [2.2, 2.5, 3.0]),
            ([0.0, -0.2, 0.0], [5.0, 0.0, 5.0]),
            ([0.0, 2.5, 0.0], [5.0, 2.7, 5.0]),
        ]
        .map(|(lo, hi): ([f64; 3], [f64; 3])| block(lo.into(), hi.into()))
        .concat();
        let bvh = Bvh::build(&walls);
        // Two floods met 0.15 m before the wall, in a front that leans by 8 degrees.
        let lean = 0.14;
        let centers: Vec<DVec3> = (0..10)
            .flat_map(|j| {
                (0..20).map(move |i| (2.05 + 0.1 * f64::from(j), 0.05 + 0.1 * f64::from(i)))
            })
            .map(|(z, y)| DVec3::new(1.85 + lean * (z - 2.5), y, z))
            .collect();
        let center = centers.iter().sum::<DVec3>() / centers.len() as f64;
        let opening = Opening {
            plane: Plane::through(center, DVec3::new(1.0, 0.0, -lean).normalize()),
            center,
            area: 2.0,
            closed: 0.25,
        };
        let found = fit_candidate(
            &centers,
            0.1,
            &opening,
            &walls,
            &bvh,
            0.01,
            &Allowance::default(),
        );
        let on = |k: usize| found.points.iter().map(move |p| p[k]);
        let range = |k: usize| {
            (
                on(k).fold(f64::MAX, f64::min),
                on(k).fold(f64::MIN, f64::max),
            )
        };
        let ((x0, x1), (y0, y1), (z0, z1)) = (range(0), range(1), range(2));
        assert!(
            (2.0..=2.2).contains(&x0) && (2.0..=2.2).contains(&x1),
            "{x0} to {x1}"
        );
        // It covers the doorway, and reaches into the walls by a few steps of the picture at most.
        let near = |at: f64, by: f64| (0.0..0.15).contains(&(at * by));
        assert!(near(z0 - 2.0, -1.0) && near(z1 - 3.0, 1.0), "{z0} to {z1}");
        assert!(near(y0, -1.0) && near(y1 - 2.0, 1.0), "{y0} to {y1}");
    }

    #[test]
    fn the_largest_surface_stands_for_a_direction_whatever_the_order() {
        let wall = [
            DVec3::ZERO,
            DVec3::new(0.0, 3.0, 0.0),
            DVec3::new(0.0, 0.0, 5.0),
        ];
        // A short piece of the wall, its vertices moved by 2 mm: it leans by 0.6 degrees.
        let small = [
            DVec3::new(0.0, 0.0, 5.0),
            DVec3::new(0.0, 0.2, 5.0),
            DVec3::new(0.002, 0.0, 5.2),
        ];
        let opening = Opening {
            plane: Plane::through(DVec3::ZERO, DVec3::X),
            center: DVec3::ZERO,
            area: 2.0,
            closed: 0.0,
        };
        for around in [[wall, small], [small, wall]] {
            let [walls, ..] = candidate_normals(&opening, &around);
            assert_eq!(walls, [DVec3::X]);
        }
    }

    // A facade of one sheet, half a degree off the direction of the building.
    #[test]
    fn a_wall_bounds_a_long_window_in_its_own_plane() {
        let lean = 0.5_f64.to_radians().tan();
        let on = |y: f64, z: f64| DVec3::new(2.0 + lean * z, y, z);
        let quad = |y: [f64; 2], z: [f64; 2]| -> Vec<Triangle> {
            let [a, b] = [on(y[0], z[0]), on(y[0], z[1])];
            let [c, d] = [on(y[1], z[1]), on(y[1], z[0])];
            vec![[a, b, c], [a, c, d]]
        };
        let around = [
            quad([0.0, 3.0], [0.0, 1.0]),
            quad([0.0, 3.0], [7.0, 8.0]),
            quad([0.0, 0.05], [1.0, 7.0]),
            quad([2.9, 3.0], [1.0, 7.0]),
            block(DVec3::new(-6.0, 3.0, 0.0), DVec3::new(2.0, 9.0, 8.0)),
        ];
        let walls = around.concat();
        let centers: Vec<DVec3> = (0..60)
            .flat_map(|j| {
                (0..28).map(move |i| on(0.1 + 0.1 * f64::from(i), 1.05 + 0.1 * f64::from(j)))
            })
            .collect();
        let opening = Opening {
            plane: Plane::through(on(1.5, 4.0), DVec3::X),
            center: on(1.5, 4.0),
            area: 17.1,
            closed: 0.0,
        };
        let bvh = Bvh::build(&walls);
        let allowance = Allowance::default();
        let found = fit_candidate(&centers, 0.1, &opening, &walls, &bvh, 0.01, &allowance);
        for p in &found.points {
            assert!((p.x - on(p.y, p.z).x).abs() < 1e-6, "{p}");
            assert!((0.8..7.2).contains(&p.z), "{p}");
        }
    }

    #[test]
    fn a_slit_beside_a_jamb_does_not_lead_a_section_into_the_hollow_of_the_wall() {
        let quad = |a: [f64; 3], b: [f64; 3], c: [f64; 3], d: [f64; 3]| -> Vec<Triangle> {
            let [a, b, c, d] = [a, b, c, d].map(DVec3::from);
            vec![[a, b, c], [a, c, d]]
        };
        // Two sheets 0.2 m apart with a doorway of 1 × 2 m, and its lining: the left jamb ends 45 mm below the lintel.
        let sheet = |x: f64| {
            [
                quad([x, 0.0, 0.0], [x, 2.5, 0.0], [x, 2.5, 2.0], [x, 0.0, 2.0]),
                quad([x, 0.0, 3.0], [x, 2.5, 3.0], [x, 2.5, 5.0], [x, 0.0, 5.0]),
                quad([x, 2.0, 2.0], [x, 2.5, 2.0], [x, 2.5, 3.0], [x, 2.0, 3.0]),
            ]
            .concat()
        };
        let across = |y: [f64; 2], z: [f64; 2]| {
            quad(
                [2.0, y[0], z[0]],
                [2.2, y[0], z[0]],
                [2.2, y[1], z[1]],
                [2.0, y[1], z[1]],
            )
        };
        let walls = [
            sheet(2.0),
            sheet(2.2),
            across([0.0, 1.955], [2.0, 2.0]),
            across([0.0, 2.0], [3.0, 3.0]),
            across([2.0, 2.0], [2.0, 3.0]),
            block(DVec3::new(0.0, -0.2, 0.0), DVec3::new(5.0, 0.0, 5.0)),
        ]
        .concat();
        let centers: Vec<DVec3> = (0..10)
            .flat_map(|j| {
                (0..20).map(move |i| (2.05 + 0.1 * f64::from(j), 0.05 + 0.1 * f64::from(i)))
            })
            .map(|(z, y)| DVec3::new(2.1, y, z))
            .collect();
        let middle = Plane::through(DVec3::new(2.1, 1.0, 2.5), DVec3::X);
        let section = |hole: f64| free_section(&middle, &centers, &walls, [0.1, hole]);
        let closed = section(0.05);
        // Within two picture steps around a doorway of 2 m².
        assert!(
            closed.bounded && (closed.area - 2.0).abs() < 0.25,
            "{}",
            closed.area
        );
        assert!(section(0.01).area > 3.0, "{}", section(0.01).area);
    }
}
