//! *Planar, convex outline*: every portal, directly from its vertices.

use enfilade_cpg::{PortalId, World};
use enfilade_geom::poly::{self, Poly};
use enfilade_geom::{Aabb, DVec3, Plane, Winding, closest_point_on_segment};

use crate::subject::to_dvec;

/// Returns faults of outlines and pieces, a line each.
///
/// Independent of `validate()`: uses Newell normals, hulls and distances. Lengths within `eps` pass, since a vertex
/// may be snapped and rounded by that much.
pub(crate) fn check(world: &World, eps: f64) -> Vec<String> {
    let mut problems = Vec::new();
    for (id, portal) in (0..).map(PortalId).zip(&world.graph.portals) {
        let normal = to_dvec(portal.normal);
        let outline: Vec<DVec3> = portal.outline.iter().copied().map(to_dvec).collect();
        let mut say = |what: String| {
            let at = outline.first().copied().unwrap_or_default();
            problems.push(format!("{id} near ({at:.3}): {what}"));
        };
        let Some(&origin) = outline.first() else {
            say("it has no outline".into());
            continue;
        };
        // The outline may be dented by less than the tolerance; it bounds its hull.
        let plane = Plane::through(origin, normal);
        let hull_of = |polygon: &[DVec3]| Winding::hull_in_plane(&plane, polygon).points;
        let outline_hull = hull_of(&outline);
        let mut area = 0.0;
        let pieces = portal
            .pieces
            .iter()
            .map(|p| p.iter().copied().map(to_dvec).collect());
        for (k, polygon) in std::iter::once(outline.clone()).chain(pieces).enumerate() {
            let name = if k == 0 {
                "outline".to_owned()
            } else {
                format!("piece {}", k - 1)
            };
            let twice_area: DVec3 = edges(&polygon)
                .map(|(p, q)| (p - polygon[0]).cross(q - polygon[0]))
                .sum();
            if polygon.len() < 3 {
                say(format!("{name} has {} vertices", polygon.len()));
                continue;
            }
            if k > 0 {
                area += 0.5 * twice_area.length();
            }
            let off = polygon
                .iter()
                .map(|&p| (p - origin).dot(normal).abs())
                .fold(0.0, f64::max);
            if off > eps {
                say(format!("{name} leaves the portal's plane by {off:.2e} m"));
            }
            let turn = twice_area.dot(normal);
            if turn <= 0.0 || turn.is_nan() {
                say(format!("{name} runs clockwise, or has no area"));
            }
            if let Some(dent) = worst_dent(&hull_of(&polygon), &polygon, eps) {
                say(format!("{name} is not convex, by {dent:.2e} m"));
            }
            if let Some(out) = worst_outside(&outline_hull, &polygon, normal, eps) {
                say(format!("{name} reaches out of the outline by {out:.2e} m"));
            }
        }
        let polygons: Vec<Vec<DVec3>> = (portal.pieces.iter())
            .map(|p| p.iter().copied().map(to_dvec).collect())
            .collect();
        if let Some([j, k]) = overlapping(&polygons, normal, eps) {
            say(format!("pieces {j} and {k} overlap"));
        }
        // Each vertex may be off by eps, which changes the area by the circumference times that.
        let circumference: f64 = portal
            .pieces
            .iter()
            .flat_map(|p| (0..p.len()).map(move |i| (p[i], p[(i + 1) % p.len()])))
            .map(|(p, q)| to_dvec(p).distance(to_dvec(q)))
            .sum();
        let stored = f64::from(portal.area);
        let off = (stored - area).abs();
        if off > eps * circumference + 1e-6 * area + 1e-12 || off.is_nan() {
            say(format!(
                "the stored area is {stored}, but the pieces add up to {area}"
            ));
        }
    }
    problems
}

/// Returns two pieces that overlap by more than rounding explains.
///
/// Sweeps the pieces along the axis of their largest spread; time near-linear if few lie side by side.
fn overlapping(pieces: &[Vec<DVec3>], normal: DVec3, eps: f64) -> Option<[usize; 2]> {
    let boxes: Vec<Aabb> = pieces.iter().map(Aabb::of_points).collect();
    let size = boxes.iter().fold(Aabb::EMPTY, |a, &b| a.union(b)).size();
    let axis = (0..3).max_by(|&i, &j| size[i].total_cmp(&size[j]))?;
    let mut order: Vec<usize> = (0..pieces.len()).collect();
    order.sort_by(|&i, &j| {
        boxes[i].min[axis]
            .total_cmp(&boxes[j].min[axis])
            .then(i.cmp(&j))
    });
    for (n, &i) in order.iter().enumerate() {
        let besides = order[n + 1..].iter();
        let mut besides = besides.take_while(|&&j| boxes[j].min[axis] < boxes[i].max[axis]);
        let overlaps = |&&j: &&usize| {
            boxes[i].overlaps(&boxes[j]) && is_overlap(&pieces[i], &pieces[j], normal, eps)
        };
        if let Some(&j) = besides.find(overlaps) {
            return Some([i.min(j), i.max(j)]);
        }
    }
    None
}

/// Allowed overlap of pieces: a builder's planes nearly coincide there, and each side cuts by its own. [Units: wu]
const SEAM: f64 = 1e-3;
/// Allowed overlap as a share of the smaller piece's area: slivers may lie in one another.
const SEAM_SHARE: f64 = 0.1;

/// Returns `true` if a part of `b` lies deeper than a seam within all edges of `a`.
fn is_overlap(a: &[DVec3], b: &[DVec3], normal: DVec3, eps: f64) -> bool {
    let seam = SEAM.max(2.0 * eps);
    let mut rest: Poly = b.iter().copied().collect();
    for (p, q) in edges(a) {
        let Some(inward) = normal.cross(q - p).try_normalize() else {
            continue;
        };
        let plane = Plane::through(p + inward * seam, inward);
        match poly::clip(&rest, &plane, 0.0) {
            Some(part) => rest = part,
            None => return false,
        }
    }
    let smaller = poly::area(a).min(poly::area(b));
    poly::width(&rest) > seam && poly::area(&rest) > SEAM_SHARE * smaller
}

fn edges(polygon: &[DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
    (0..polygon.len()).map(|i| (polygon[i], polygon[(i + 1) % polygon.len()]))
}

/// Returns the distance of the farthest of `points` from the region that `hull` bounds; `None` within `2 eps`.
fn worst_outside(hull: &[DVec3], points: &[DVec3], normal: DVec3, eps: f64) -> Option<f64> {
    let outside = |x: &DVec3| {
        let is_inside = edges(hull).all(|(p, q)| normal.cross(q - p).dot(*x - p) >= 0.0);
        if is_inside {
            0.0
        } else {
            distance_to_border(hull, *x)
        }
    };
    let worst = points.iter().map(outside).fold(0.0, f64::max);
    (worst > 2.0 * eps).then_some(worst)
}

/// Returns the depth in its hull of the vertex that dents the polygon most; `None` within `2 eps`.
fn worst_dent(hull: &[DVec3], polygon: &[DVec3], eps: f64) -> Option<f64> {
    let worst = polygon
        .iter()
        .map(|&x| distance_to_border(hull, x))
        .fold(0.0, f64::max);
    (worst > 2.0 * eps).then_some(worst)
}

/// Measured to the border itself, not to lines through its edges: the direction of an edge not much longer than `eps`
/// is noise, which a line carries across the whole polygon.
fn distance_to_border(hull: &[DVec3], x: DVec3) -> f64 {
    edges(hull)
        .map(|(p, q)| closest_point_on_segment(x, p, q).distance(x))
        .fold(f64::INFINITY, f64::min)
}
