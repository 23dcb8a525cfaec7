//! Random segments: a mix that includes small cells and narrow openings.

use enfilade_geom::DVec3;

use crate::rng::Rng;
use crate::subject::{Subject, point_in, point_of_triangle};

/// Largest reach of aimed segments from their target. [Units: wu]
const REACH: f64 = 10.0;

/// Number of ways to draw a segment.
const KINDS: u64 = 10;

/// Draws both ends of segment number `i`, which selects the way of drawing.
pub(crate) fn draw_segment(subject: &Subject, rng: &mut Rng, i: u64) -> (DVec3, DVec3) {
    let near = 3.0 * subject.eps;
    let has_portals = !subject.crossable.is_empty();
    match i % KINDS {
        1 | 2 if !subject.sampled.is_empty() => {
            let cell = subject.sampled[rng.below(subject.sampled.len())];
            let a = subject.point_in_cell(rng, cell);
            let b = if i % KINDS == 1 {
                let other = subject.sampled[rng.below(subject.sampled.len())];
                subject.point_in_cell(rng, other)
            } else {
                a + rng.direction() * rng.log_range(0.05, 5.0)
            };
            (a, b)
        }
        // Through a portal, any direction.
        3 | 4 if has_portals => {
            let portal = subject.crossable[rng.below(subject.crossable.len())];
            let p = subject.point_of_portal(rng, portal);
            around(rng, p, near)
        }
        // Past the rim of a portal.
        5 if has_portals => {
            let portal = subject.crossable[rng.below(subject.crossable.len())];
            let p = subject.rim_point_of_portal(rng, portal)
                + rng.direction() * rng.log_range(near, 0.3);
            around(rng, p, near)
        }
        // Along a surface, close to it.
        6 if !subject.triangles.is_empty() => {
            let t = &subject.triangles[rng.below(subject.triangles.len())];
            let p = point_of_triangle(rng, t);
            let n = (t[1] - t[0]).cross(t[2] - t[0]).normalize_or(DVec3::Y);
            let p = p + n * (rng.sign() * rng.log_range(near, 0.5));
            let d = rng.direction();
            let along = (d - n * d.dot(n)).normalize_or(DVec3::X) + d * rng.log_range(1e-4, 1.0);
            let d = along.normalize();
            (
                p - d * rng.log_range(near, REACH),
                p + d * rng.log_range(near, REACH),
            )
        }
        // Past the edge of a surface: where a triangle or a seal is missing, others end.
        8 | 9 if !subject.triangles.is_empty() => {
            let t = &subject.triangles[rng.below(subject.triangles.len())];
            let k = rng.below(3);
            let p = t[k].lerp(t[(k + 1) % 3], rng.unit());
            let p = p + rng.direction() * rng.log_range(near, 0.05);
            around(rng, p, near)
        }
        // Through two portals at once.
        7 if has_portals => {
            let first = subject.crossable[rng.below(subject.crossable.len())];
            let cell = subject.portals[first.0 as usize].cells[rng.below(2)];
            let exits = &subject.world.graph[cell].portals;
            let second = if exits.is_empty() {
                first
            } else {
                exits[rng.below(exits.len())]
            };
            if subject.crossable.binary_search(&second).is_err() {
                return (
                    point_in(rng, &subject.padded),
                    point_in(rng, &subject.padded),
                );
            }
            let p = subject.point_of_portal(rng, first);
            let q = subject.point_of_portal(rng, second);
            let d = (q - p).normalize_or(DVec3::X);
            (
                p - d * rng.log_range(near, REACH),
                q + d * rng.log_range(near, REACH),
            )
        }
        _ => (
            point_in(rng, &subject.padded),
            point_in(rng, &subject.padded),
        ),
    }
}

/// Returns a segment through `p` in a random direction.
fn around(rng: &mut Rng, p: DVec3, near: f64) -> (DVec3, DVec3) {
    let d = rng.direction();
    (
        p - d * rng.log_range(near, REACH),
        p + d * rng.log_range(near, REACH),
    )
}
