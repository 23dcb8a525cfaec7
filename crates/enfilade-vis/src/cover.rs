//! Occlusion by all walls in one plane together: a test whether they cross all lines of a beam.
//!
//! A sheet (`sheets`) ends where two walls meet without shared edges: two boxes side by side, a long wall beside two
//! short ones. Here all triangles in one plane form one occluder, after the fused occluders of Schaufler, Dorsey,
//! Decoret and Sillion, *Conservative Volumetric Visibility with Occluder Fusion* (SIGGRAPH 2000), but exact: the
//! beam's section with the plane is a convex polygon, and the triangles must cover all of it. Doorways in the plane
//! stay uncovered.
//!
//! Errs to visible, except for lines that pass nearer to a wall's edge than the world's tolerance, for which either
//! answer is right: vertices that near to a plane count as in it, and gaps that narrow count as closed.

use enfilade_geom::poly::{Poly, cut_out, is_larger};
use enfilade_geom::{Aabb, DVec2, DVec3, Plane, Triangle};

use crate::sheets::{Sheets, cut};

/// Most triangles tested in one plane, and most pieces that they may leave of a section.
const MAX_TRIANGLES: usize = 256;
const MAX_LEFT: usize = 32;

/// The effect of the walls in a plane on a beam.
pub(crate) enum Cover {
    /// All lines cross them.
    Closed,
    /// The plane passes through this end of the beam; the walls hide the part of it behind the plane.
    Cuts(usize, Plane),
    Open,
}

/// Distances that count as zero, each for its purpose. [Units: wu]
#[derive(Clone, Copy)]
pub(crate) struct Near {
    /// Larger distances count as apart.
    pub(crate) apart: f64,
    /// An end of a beam that reaches no farther in front of a plane counts as behind it.
    pub(crate) strip: f64,
    /// The world's tolerance: how far planes and vertices may be moved.
    pub(crate) slack: f64,
}

impl Sheets<'_> {
    /// Tests the lines from one polygon to another against all walls in the plane of a triangle.
    pub(crate) fn cover(&self, seed: u32, ends: &[Vec<DVec3>; 2], near: Near) -> Cover {
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
        if second_high > near.strip {
            return Cover::Cuts(1, plane);
        }
        if first_low < -near.strip {
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
        Cover::Open
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
