//! Openings that a designer marked, beside the portals that were found.

use std::io::{self, Write};

use enfilade::cpg::{Portal, World};
use enfilade::geom::scene::{GivenPortal, Scene};
use enfilade::geom::{Aabb, DVec3, shown};

/// A portal farther than this from a mark is another opening: a room is wider. [Units: wu]
const REACH: f64 = 1.5;
/// Planes that turn away from each other by more than 30 degrees are those of two openings.
const ALONG: f64 = 0.866;
/// A portal this near to a mark, beyond half of its thickness, is the mark: the grid of editors. [Units: wu]
const SAME: f64 = 0.05;

/// A portal near a mark, and its distance along the mark's normal.
struct Near {
    portal: usize,
    distance: f64,
}

/// Tells for each mark of a scene which portal of its world it is, or how far away the next one is.
pub(super) fn tell(out: &mut impl Write, scene: &Scene, world: &World) -> io::Result<()> {
    let graph = &world.graph;
    let mut n_matched = 0;
    for given in &scene.given_portals {
        let near = (graph.portals.iter().enumerate())
            .filter_map(|(portal, p)| {
                let distance = distance(given, p)?;
                Some(Near { portal, distance })
            })
            .min_by(|a, b| a.distance.total_cmp(&b.distance));
        let name = shown(&given.name);
        let parts = |near: &Near| {
            let [a, b] = graph.portals[near.portal].cells;
            let [a, b] = [a, b].map(|c| graph.cells[c.idx()].name.clone());
            shown(format!("{a} and {b}")).to_string()
        };
        match near {
            Some(near) if near.distance <= SAME + given.thickness / 2.0 => {
                n_matched += 1;
                let parts = parts(&near);
                writeln!(out, "  {name} is portal {}, between {parts}", near.portal)?;
            }
            Some(near) => writeln!(
                out,
                "  {name} stands {:.2} m from portal {}, between {}",
                near.distance,
                near.portal,
                parts(&near)
            )?,
            None => {
                let [x, y, z] = middle(&given.outline).to_array();
                writeln!(
                    out,
                    "  {name} at {x:.2} {y:.2} {z:.2} parts nothing: no portal is within {REACH} m"
                )?;
            }
        }
    }
    writeln!(
        out,
        "{n_matched} of {} given portals were found",
        scene.given_portals.len()
    )
}

/// Returns the distance of a portal from a mark that it faces and covers in part, `None` for others.
fn distance(given: &GivenPortal, portal: &Portal) -> Option<f64> {
    let points: Vec<DVec3> = portal
        .outline
        .iter()
        .map(|p| DVec3::from(p.map(f64::from)))
        .collect();
    let normal = DVec3::from(portal.normal.map(f64::from));
    let own = Aabb::of_points(&given.outline);
    let away = given
        .normal
        .dot(middle(&points) - middle(&given.outline))
        .abs();
    let reached = Aabb::of_points(
        &points
            .iter()
            .map(|&p| p - given.normal * given.normal.dot(p - middle(&given.outline)))
            .collect::<Vec<_>>(),
    );
    let is_along = normal.dot(given.normal).abs() >= ALONG;
    (is_along && away <= REACH && own.expanded(SAME).overlaps(&reached)).then_some(away)
}

fn middle(points: &[DVec3]) -> DVec3 {
    points.iter().sum::<DVec3>() / points.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade::cpg::{Cell, CellId, CellPortalGraph, PortalKind};

    fn square(x: f64) -> Vec<DVec3> {
        [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]
            .map(|[z, y]| DVec3::new(x, y, z))
            .to_vec()
    }

    fn told(at: f64, thickness: f64) -> String {
        let portal = Portal {
            cells: [CellId(0), CellId(1)],
            kind: PortalKind::Open,
            normal: [1.0, 0.0, 0.0],
            outline: square(0.0).iter().map(|p| p.as_vec3().to_array()).collect(),
            pieces: Vec::new(),
            area: 4.0,
            fittings: Vec::new(),
            why: Vec::new(),
        };
        let cell = |name: &str| Cell {
            name: name.to_owned(),
            ..Cell::default()
        };
        let world = World {
            graph: CellPortalGraph {
                cells: vec![cell("hall"), cell("shed")],
                portals: vec![portal],
                ..CellPortalGraph::default()
            },
            ..World::default()
        };
        let scene = Scene {
            given_portals: vec![GivenPortal {
                name: "visportal 1".to_owned(),
                outline: square(at),
                normal: DVec3::X,
                thickness,
            }],
            ..Scene::default()
        };
        let mut out = Vec::new();
        tell(&mut out, &scene, &world).unwrap();
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn a_mark_is_a_portal_or_stands_off_it_or_parts_nothing() {
        assert!(told(0.04, 0.0).contains("visportal 1 is portal 0, between hall and shed"));
        assert!(told(0.2, 0.5).contains("1 of 1 given portals were found"));
        assert!(told(0.4, 0.0).contains("stands 0.40 m from portal 0"));
        let far = told(1.6, 0.0);
        assert!(
            far.contains("parts nothing") && far.contains("0 of 1"),
            "{far}"
        );
    }
}
