//! Occlusion by all walls in one plane together: a test whether they cross all lines of a beam.
//!
//! A sheet (`sheets`) ends where two walls meet without shared edges: two boxes side by side, a long wall beside two
//! short ones. Here all triangles in one plane form one occluder, after the fused occluders of Schaufler, Dorsey,
//! Decoret and Sillion, *Conservative Volumetric Visibility with Occluder Fusion* (SIGGRAPH 2000), but exact: the
//! beam's section with the plane is a convex polygon, and the triangles must cover all of it. Doorways in the plane
//! stay uncovered: the parts of the section that are left are *gaps*, and only lines through a gap go on. Where two
//! walls hide something together, as a floor and the front that ends at it, few lines pass the gap of one of them, and
//! the other closes those. What of the ends such lines reach is bounded by planes through an edge of the gap, as are
//! Teller's antipenumbras (*Visibility Computations in Densely Occluded Polyhedral Environments*, 1992), but with one
//! plane for each edge.
//!
//! Errs to visible, except for lines that pass nearer to a wall's edge than the world's tolerance, for which either
//! answer is right: vertices that near to a plane count as in it, and gaps that narrow count as closed.

use enfilade_geom::poly::{Poly, area, cut_out, is_larger};
use enfilade_geom::{Aabb, DVec2, DVec3, Plane, Triangle};

use crate::sheets::{Sheets, cut};

/// Most triangles tested in one plane, and most pieces that they may leave of a section.
const MAX_TRIANGLES: usize = 256;
const MAX_LEFT: usize = 32;
/// More gaps than this are not followed one by one.
const MAX_GAPS: usize = 6;
/// Walls that leave more than this share of the section are hardly in the way.
const MOST_OPEN: f64 = 0.999;
/// Most vertices that narrowing may give a polygon: each costs time in all that follows.
const MAX_VERTICES: usize = 8;

/// The effect of the walls in a plane on a beam.
pub(crate) enum Cover {
    /// All lines cross them.
    Closed,
    /// The plane passes through this end of the beam; the walls hide the part of it behind the plane.
    Cuts(usize, Plane),
    /// All lines cross them but for those through these parts of the section, of this share of its area.
    Gaps(f64, Vec<Poly>),
    Open,
}

/// Distances that count as zero, each for its purpose. [Units: wu]
#[derive(Clone, Copy)]
pub(crate) struct Near {
    /// Larger distances count as apart.
    pub(crate) apart: f64,
    /// The world's tolerance: how far planes and vertices may be moved.
    pub(crate) slack: f64,
}

impl Sheets<'_> {
    /// Tests the lines from one polygon to another against all walls in the plane of a triangle. An end of them that reaches
    /// no farther past a plane than its `strip` counts as on one side of it. [Units: wu]
    pub(crate) fn cover(
        &self,
        seed: u32,
        ends: &[Vec<DVec3>; 2],
        strips: [f64; 2],
        near: Near,
    ) -> Cover {
        let Some(plane) = Plane::of_triangle(self.triangle(seed)) else {
            return Cover::Open;
        };
        let middle = |end: &[DVec3]| {
            end.iter().map(|&p| plane.signed_distance(p)).sum::<f64>() / end.len() as f64
        };
        // Turn the plane so that the first end lies in front.
        let plane = if middle(&ends[0]) >= middle(&ends[1]) {
            plane
        } else {
            plane.flipped()
        };
        let heights = |end: &[DVec3]| {
            let heights = end.iter().map(|&p| plane.signed_distance(p));
            heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
                (l.min(x), h.max(x))
            })
        };
        let (first_low, _) = heights(&ends[0]);
        let (second_low, second_high) = heights(&ends[1]);
        let least = 4.0 * near.apart;
        if second_low > -near.slack {
            return Cover::Open;
        }
        if second_high > strips[1] {
            return Cover::Cuts(1, plane);
        }
        if first_low < -strips[0] {
            return Cover::Cuts(0, plane);
        }
        let first = cut(&ends[0], plane.normal, least - plane.d);
        let second = cut(&ends[1], -plane.normal, least + plane.d);
        if first.is_empty() || second.is_empty() {
            return Cover::Open;
        }
        self.is_covered(&plane, [&first, &second], near)
    }

    fn is_covered(&self, plane: &Plane, [first, second]: [&[DVec3]; 2], near: Near) -> Cover {
        let (u, v) = plane.basis();
        let origin = plane.project(first[0]);
        let mut points = Vec::with_capacity(first.len() * second.len());
        for &p in first {
            let h = plane.signed_distance(p);
            for &q in second {
                let g = plane.signed_distance(q);
                let at = p + (q - p) * (h / (h - g)) - origin;
                points.push(DVec2::new(at.dot(u), at.dot(v)));
            }
        }
        let hull = convex_hull(points);
        let section: Poly = hull.iter().map(|at| origin + u * at.x + v * at.y).collect();
        if section.len() < 3 {
            return Cover::Open;
        }
        let bounds = Aabb::of_points(&section).expanded(near.slack);
        let mut inside = Vec::new();
        let is_in = |p: &DVec3| plane.signed_distance(*p).abs() <= near.slack;
        // Few triangles near it lie in the plane, and that is quickly told.
        self.bvh.any_in_box_of(
            &bounds,
            |triangle| triangle.iter().all(is_in),
            |i| {
                inside.push(i);
                inside.len() >= MAX_TRIANGLES
            },
        );
        inside.sort_unstable();
        let whole = area(&section);
        let mut left = vec![section];
        for i in inside {
            let mut cover = self.triangle(i).map(|p| plane.project(p));
            if (cover[1] - cover[0])
                .cross(cover[2] - cover[0])
                .dot(plane.normal)
                < 0.0
            {
                cover.swap(0, 1);
            }
            let mut next = Vec::new();
            for poly in &left {
                let from = next.len();
                if cut_out(poly, &cover, plane.normal, near.apart, 0.0, &mut next).is_none() {
                    continue;
                }
                let mut at = from;
                while at < next.len() {
                    if is_larger(&next[at], 0.0, near.slack) {
                        at += 1;
                    } else {
                        next.swap_remove(at);
                    }
                }
            }
            left = next;
            if left.is_empty() {
                return Cover::Closed;
            }
            if left.len() > MAX_LEFT {
                break;
            }
        }
        let share = left.iter().map(|gap| area(gap)).sum::<f64>() / whole;
        if left.len() <= MAX_GAPS && share < MOST_OPEN {
            Cover::Gaps(share, left)
        } else {
            Cover::Open
        }
    }

    /// Returns `true` if a polygon lies in a triangle's plane within the world's tolerance. The triangle does not
    /// hide it then, as both may be moved.
    pub(crate) fn is_in_plane(&self, triangle: u32, polygon: &[DVec3], slack: f64) -> bool {
        let Some(plane) = Plane::of_triangle(self.triangle(triangle)) else {
            return true;
        };
        polygon
            .iter()
            .all(|&p| plane.signed_distance(p).abs() <= slack)
    }

    fn triangle(&self, i: u32) -> &Triangle {
        &self.triangles[i as usize]
    }
}

/// Returns the parts of two polygons between which lines through a gap lead; `None` if there are none. They may be larger,
/// never smaller. Time is edges of the gap times vertices.
pub(crate) fn narrowed(
    [first, second]: [&Vec<DVec3>; 2],
    gap: &[DVec3],
    near: Near,
) -> Option<[Vec<DVec3>; 2]> {
    let second = beyond(first, gap, second, near)?;
    let first = beyond(&second, gap, first, near)?;
    Some([first, second])
}

/// Returns the part of a polygon that lines from another reach through a gap, or all of it if that has too many vertices.
fn beyond(from: &[DVec3], gap: &[DVec3], to: &[DVec3], near: Near) -> Option<Vec<DVec3>> {
    let mut part = to.to_vec();
    for i in 0..gap.len() {
        let edge = [gap[i], gap[(i + 1) % gap.len()]];
        if let Some(normal) = separating(edge, gap, from, near.apart) {
            part = cut(&part, normal, normal.dot(edge[0]) - near.slack);
            if part.is_empty() {
                return None;
            }
        }
    }
    let most = MAX_VERTICES.max(to.len());
    Some(if part.len() > most { to.to_vec() } else { part })
}

/// Returns the normal of the plane through an edge of a gap that has the gap in front and touches a polygon behind it.
fn separating([a, b]: [DVec3; 2], gap: &[DVec3], from: &[DVec3], apart: f64) -> Option<DVec3> {
    let along = (b - a).try_normalize()?;
    let away = |p: &DVec3| (*p - a).reject_from_normalized(along);
    let far = gap.iter().map(away);
    let inward = far.max_by(|p, q| p.length_squared().total_cmp(&q.length_squared()))?;
    let plane_of = |p: &DVec3| {
        let normal = along.cross(*p - a).normalize_or_zero();
        if normal.dot(inward) < 0.0 {
            -normal
        } else {
            normal
        }
    };
    // The plane turns about the edge until no vertex is in front of it.
    let mut normal = DVec3::ZERO;
    for p in from {
        if normal == DVec3::ZERO || normal.dot(*p - a) > 0.0 {
            normal = plane_of(p);
        }
    }
    let heights = |points: &[DVec3]| {
        let heights = points.iter().map(|p| normal.dot(*p - a));
        heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(x), h.max(x))
        })
    };
    let is_apart = heights(from).1 <= apart && heights(gap).0 >= -apart;
    (normal != DVec3::ZERO && is_apart).then_some(normal)
}

/// Returns the vertices of the convex hull, counter-clockwise (Andrew 1979).
fn convex_hull(mut points: Vec<DVec2>) -> Vec<DVec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    let mut hull: Vec<DVec2> = Vec::new();
    for half in 0..2 {
        let first = hull.len();
        for &p in &points {
            while hull.len() >= first + 2 {
                let (a, b) = (hull[hull.len() - 2], hull[hull.len() - 1]);
                if (b - a).perp_dot(p - b) > 0.0 {
                    break;
                }
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop();
        if half == 0 {
            points.reverse();
        }
    }
    hull
}
