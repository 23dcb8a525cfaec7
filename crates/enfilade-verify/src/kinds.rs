//! Kinds of portals, as far as a file determines them.
//!
//! In every world, a crack is narrow and a door stands upright. In a bake of this version, sill and height also
//! determine which portals are windows, doors or openings, unless portals were cut since. `fittings` judges the kinds
//! that leaves determine.
//!
//! Sills are measured anew from the triangles of the file; values within rounding of another kind are not judged.

use enfilade_cpg::{Portal, PortalKind, World};
use enfilade_geom::{Bvh, DVec3, Plane, Ray, Triangle, Winding};

use crate::subject::to_dvec;

/// Largest width of every piece of a crack. [Units: wu]
const CRACK_WIDTH: f64 = 0.05;
/// Largest rise of the normal of an upright opening.
const UPRIGHT: f64 = 0.5;
/// Least height of a sill over the ground. [Units: wu]
const SILL: f64 = 0.4;
/// Least height of a door. [Units: wu]
const LEAST_DOOR: f64 = 1.5;
/// More than the growth of outlines: closer to a bound, nothing is judged. [Units: wu]
const ROOM: f64 = 0.02;
/// Distance from an opening at which the ground is searched. [Units: wu]
const BESIDE: f64 = 0.5;

/// Returns problems, a line each.
pub(crate) fn check(world: &World, own: &[Triangle]) -> Vec<String> {
    let is_by_rule = is_by_rule(world);
    let ground = is_by_rule.then(|| Bvh::build(own));
    let portals = world.graph.portals.iter().enumerate();
    portals
        .filter_map(|(i, p)| {
            let of_shape = shape_problem(p);
            let what = of_shape.or_else(|| stance_problem(p, ground.as_ref()?))?;
            Some(format!(
                "portal {i} is of kind {}, but {what}",
                word(p.kind)
            ))
        })
        .collect()
}

/// Returns `true` if all portals are as a bake of this version made them.
pub(crate) fn is_by_rule(world: &World) -> bool {
    let counts = &world.graph.statistics.counts;
    let is_cut = ["edits", "cost_cuts"]
        .iter()
        .any(|name| counts.get(*name).is_some_and(|&n| n > 0.0));
    let ours = concat!("enfilade ", env!("CARGO_PKG_VERSION"));
    world.graph.provenance.generator == ours && !is_cut
}

fn word(kind: PortalKind) -> &'static str {
    match kind {
        PortalKind::Open => "open",
        PortalKind::Door => "a door",
        PortalKind::Window => "a window",
        PortalKind::Crack => "a crack",
    }
}

fn shape_problem(p: &Portal) -> Option<String> {
    match p.kind {
        PortalKind::Crack => {
            let width = p
                .pieces
                .iter()
                .map(|piece| width(piece))
                .fold(0.0, f64::max);
            (width > CRACK_WIDTH + ROOM).then(|| format!("is {width:.3} m wide"))
        }
        PortalKind::Door => (!is_upright(p)).then(|| "does not stand upright".to_owned()),
        PortalKind::Open | PortalKind::Window => None,
    }
}

/// Returns a contradiction between kind, height and sill of an upright portal.
fn stance_problem(p: &Portal, ground: &Bvh) -> Option<String> {
    if p.kind == PortalKind::Crack || !is_upright(p) {
        return None;
    }
    // Measure the open area: outlines of sharp openings are rectangles and may reach below the ground.
    let corners: Vec<DVec3> = p.pieces.iter().flatten().map(|&c| to_dvec(c)).collect();
    let normal = to_dvec(p.normal).try_normalize()?;
    let plane = Plane::through(*corners.first()?, normal);
    let opening = Winding::hull_in_plane(&plane, &corners);
    let heights = corners.iter().map(|c| c.y);
    let [low, high] = heights.fold([f64::MAX, f64::MIN], |[a, b], y| [a.min(y), b.max(y)]);
    let height = high - low;
    let [least, most] = sills(normal, opening.centroid().with_y(low), ground);
    match p.kind {
        PortalKind::Door if height < LEAST_DOOR - ROOM => Some(format!("is {height:.2} m high")),
        PortalKind::Door | PortalKind::Open if least > SILL + ROOM => {
            Some(format!("stands {least:.2} m over the ground"))
        }
        // A piece among several may be a bay, joined from panes that are lower.
        PortalKind::Window
            if p.pieces.len() == 1 && height > LEAST_DOOR + ROOM && most < SILL - ROOM =>
        {
            Some(format!("is {height:.2} m high and stands on the ground"))
        }
        _ => None,
    }
}

fn is_upright(p: &Portal) -> bool {
    f64::from(p.normal[1]).abs() < UPRIGHT
}

/// Returns least and greatest height of an opening's `foot` over the ground on the higher side, at several points
/// around that of the rule, so that a ray beside an edge does not decide. [Units: wu]
fn sills(n: DVec3, foot: DVec3, ground: &Bvh) -> [f64; 2] {
    let out = DVec3::new(n.x, 0.0, n.z).normalize_or_zero();
    let along = out.cross(DVec3::Y);
    let mut bounds = [f64::INFINITY, 0.0_f64];
    for (u, v) in [
        (0.0, 0.0),
        (ROOM, 0.0),
        (-ROOM, 0.0),
        (0.0, ROOM),
        (0.0, -ROOM),
    ] {
        let drop = |side: f64| {
            let ray = Ray {
                origin: foot + DVec3::Y * 0.05 + out * (BESIDE * side + u) + along * v,
                direction: -DVec3::Y,
                t_max: 100.0,
            };
            let hit = ground.closest_hit(&ray, |_| false);
            hit.map_or(f64::INFINITY, |h| h.t - 0.05)
        };
        let sill = drop(1.0).min(drop(-1.0));
        bounds = [bounds[0].min(sill), bounds[1].max(sill)];
    }
    bounds
}

/// Returns the least distance between two parallel lines along an edge that enclose the polygon. [Units: wu]
fn width(piece: &[[f32; 3]]) -> f64 {
    let points: Vec<DVec3> = piece.iter().map(|&c| to_dvec(c)).collect();
    let n = points.len();
    let across = |i: usize| {
        let (a, b) = (points[i], points[(i + 1) % n]);
        let along = (b - a).try_normalize()?;
        let off = |p: &DVec3| (*p - a).reject_from_normalized(along).length();
        Some(points.iter().map(off).fold(0.0, f64::max))
    };
    (0..n).filter_map(across).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_cpg::{CellId, CellPortalGraph};
    use enfilade_geom::Aabb;

    #[test]
    fn a_sill_is_that_of_what_is_open_and_not_of_the_outline() {
        // A triangle that stands on the ground, in an outline that reaches half a meter below it.
        let ground = Aabb::new(DVec3::new(-5.0, -0.2, -5.0), DVec3::new(5.0, 0.0, 5.0)).triangles();
        let open = Portal {
            cells: [CellId(0), CellId(1)],
            kind: PortalKind::Open,
            normal: [1.0, 0.0, 0.0],
            outline: vec![
                [0.0, -0.5, 0.0],
                [0.0, -0.5, 2.0],
                [0.0, 2.0, 2.0],
                [0.0, 2.0, 0.0],
            ],
            pieces: vec![vec![[0.0, 0.0, 0.0], [0.0, 0.0, 2.0], [0.0, 2.0, 1.0]]],
            area: 2.0,
            fittings: Vec::new(),
        };
        let mut world = World {
            graph: CellPortalGraph {
                portals: vec![open],
                ..CellPortalGraph::default()
            },
            ..World::default()
        };
        world.graph.provenance.generator = concat!("enfilade ", env!("CARGO_PKG_VERSION")).into();
        assert_eq!(check(&world, &ground), Vec::<String>::new());
        // A meter higher it has a sill.
        for corner in &mut world.graph.portals[0].pieces[0] {
            corner[1] += 1.0;
        }
        let said = check(&world, &ground);
        assert!(
            said.len() == 1 && said[0].contains("1.00 m over the ground"),
            "{said:?}"
        );
    }
}
