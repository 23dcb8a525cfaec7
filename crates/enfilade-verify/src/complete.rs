//! *Complete*: a triangle is listed in every cell from which it is visible without passing a portal.

use enfilade_cpg::CellId;
use enfilade_geom::{DVec3, Ray};

use crate::report::{Break, Failure, FailureKind, Tally};
use crate::rng::Rng;
use crate::sealed::{Path, follow};
use crate::subject::{Subject, point_of_triangle};

/// The path of a ray, and the triangles at its end by index in the world: several where they coincide.
pub(crate) type Seen = (Path, Vec<u32>);

/// Casts ray number `i` from a random point of a random cell, every other time towards a random triangle, and judges
/// the triangle that it meets.
///
/// A ray that crosses portals judges the cell in which it arrives: from the last portal on, it is a line of sight of
/// that cell.
pub(crate) fn try_ray(subject: &Subject, rng: &mut Rng, i: u64, tally: &mut Tally) -> Option<Seen> {
    let counts = &mut tally.complete;
    counts.drawn += 1;
    if subject.sampled.is_empty() {
        counts.on_surface += 1;
        return None;
    }
    let is_aimed = i % 2 == 1 && !subject.triangles.is_empty();
    let aimed = is_aimed.then(|| aim_at_triangle(subject, rng)).flatten();
    let (start, a, direction) = aimed.unwrap_or_else(|| {
        let start = subject.sampled[rng.below(subject.sampled.len())];
        (start, subject.point_in_cell(rng, start), rng.direction())
    });
    if subject.is_close_to_surface(a) {
        counts.on_surface += 1;
        return None;
    }
    let ray = Ray {
        origin: a,
        direction,
        t_max: f64::INFINITY,
    };
    let Some(hit) = subject.blockers.closest_hit(&ray, |_| false) else {
        counts.escaped += 1;
        return None;
    };
    let at = ray.at(hit.t);
    // Extend the ray slightly past the triangle, so that it passes the triangle's own edges, too.
    let b = ray.at(hit.t + 2.0 * subject.eps);
    if subject.grazes(hit.triangle, a, b) || subject.nearest_portal(at).is_some() {
        counts.grazing += 1;
        return None;
    }
    // The end of the segment is on a boundary, so follow the segment to a point before the triangle by more than the
    // triangle may be misplaced.
    let slack = 3.0 * subject.eps / surface_slope(subject, hit.triangle, ray.direction).max(1e-3);
    let end = ray.at(hit.t - slack);
    let mut crossings = Vec::new();
    subject.crossings(a, at, &mut crossings);
    let n_crossings = crossings.len();
    subject.crossings(a, end, &mut crossings);
    if hit.t <= slack || crossings.len() != n_crossings {
        counts.grazing += 1;
        return None;
    }
    let path = match follow(subject, rng, [a, end], start, &mut crossings) {
        Ok(path) => path,
        Err(wrong) => {
            // The path there is a segment like any other, so it breaks the other promise.
            counts.unresolved += 1;
            if !subject.is_close_to_surface(end) {
                tally.add_failure(subject, Failure::of_break(&wrong, i, [a, end], &crossings));
            }
            return None;
        }
    };
    let cell = path.cells.last().map_or(start, |c| c.0);
    let (mut listed, mut is_present) = (Vec::new(), false);
    let window = Ray {
        t_max: hit.t + 2.0 * slack,
        ..ray
    };
    subject.for_each_own_at(&window, at, |triangle, batch| {
        is_present = true;
        let cells = &subject.world.batches[batch as usize].cells;
        listed.extend(cells.binary_search(&cell).is_ok().then_some(triangle));
    });
    if listed.is_empty() && subject.is_grazing_own(a, b) {
        counts.grazing += 1;
        return None;
    }
    counts.judged += 1;
    if !listed.is_empty() {
        return Some((path, listed));
    }
    let kind = if is_present {
        FailureKind::Unlisted
    } else {
        FailureKind::MissingTriangle
    };
    let portal = crossings.last().map(|c| c.portal);
    let wrong = Break {
        kind,
        expected: Some(cell),
        found: None,
        portal,
        at,
    };
    let triangle = subject.triangles[hit.triangle as usize].map(|p| p.to_array());
    let failure = Failure::of_break(&wrong, i, [a, at], &crossings);
    tally.add_failure(
        subject,
        Failure {
            triangle: Some(triangle),
            ..failure
        },
    );
    None
}

/// Attempts before a ray is not aimed any more: many triangles are inside walls.
const DRAWS: usize = 4;

/// Returns a point of air and a direction to a point of a random triangle: small triangles are as likely as large ones.
fn aim_at_triangle(subject: &Subject, rng: &mut Rng) -> Option<(CellId, DVec3, DVec3)> {
    (0..DRAWS).find_map(|_| {
        let t = &subject.triangles[rng.below(subject.triangles.len())];
        let (p, away) = (point_of_triangle(rng, t), rng.direction());
        let a = p + away * rng.log_range(10.0 * subject.eps, 10.0);
        Some((subject.locator.locate(a)?, a, -away))
    })
}

/// Returns the sine of the angle between a ray and a triangle: 1 head-on, 0 along it.
fn surface_slope(subject: &Subject, triangle: u32, direction: DVec3) -> f64 {
    let t = &subject.triangles[triangle as usize];
    let n = (t[1] - t[0]).cross(t[2] - t[0]).normalize_or_zero();
    n.dot(direction).abs()
}
