//! *Planar, convex outline*: every portal, straight from its corners.

use enfilade_cpg::World;
use enfilade_geom::DVec3;

use crate::subject::to_dvec;

/// What is wrong with outlines and pieces, a line each.
///
/// Asked independently of `validate()`, from Newell normals and edge functions alone. Lengths within
/// `eps` pass: that is how far a corner may be snapped and rounded.
pub(crate) fn check(world: &World, eps: f64) -> Vec<String> {
    let mut problems = Vec::new();
    for (i, portal) in world.graph.portals.iter().enumerate() {
        let normal = to_dvec(portal.normal);
        let outline: Vec<DVec3> = portal.outline.iter().copied().map(to_dvec).collect();
        let mut say = |what: String| {
            let at = outline.first().copied().unwrap_or_default();
            problems.push(format!("portal {i} near ({at:.3}): {what}"));
        };
        let Some(&origin) = outline.first() else {
            say("it has no outline".into());
            continue;
        };
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
                say(format!("{name} has {} corners", polygon.len()));
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
            if let Some(dent) = worst_outside(&polygon, &polygon, normal, eps) {
                say(format!("{name} is not convex, by {dent:.2e} m"));
            }
            if let Some(out) = worst_outside(&outline, &polygon, normal, eps) {
                say(format!("{name} reaches out of the outline by {out:.2e} m"));
            }
        }
        // Each corner may be off by eps, which moves the area by the circumference times that.
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
                "area {stored} is stored, the pieces add up to {area}"
            ));
        }
    }
    problems
}

fn edges(polygon: &[DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
    (0..polygon.len()).map(|i| (polygon[i], polygon[(i + 1) % polygon.len()]))
}

/// How far the farthest of `points` lies beyond an edge of `polygon`; `None` when within `eps`.
fn worst_outside(polygon: &[DVec3], points: &[DVec3], normal: DVec3, eps: f64) -> Option<f64> {
    let mut worst = 0.0_f64;
    for (p, q) in edges(polygon) {
        // The line through an edge shorter than eps has no direction to speak of.
        if p.distance(q) <= eps {
            continue;
        }
        let inward = normal.cross(q - p).normalize_or_zero();
        for x in points {
            worst = worst.max(-inward.dot(*x - p));
        }
    }
    (worst > 2.0 * eps).then_some(worst)
}
