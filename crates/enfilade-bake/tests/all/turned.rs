//! A building turned on its site keeps its rooms and doorways.

use enfilade_bake::{BakeConfig, BakeContext, Silent, bake};
use enfilade_cpg::{CellPortalGraph, Portal, PortalKind};
use enfilade_geom::{DMat4, DVec3};
use enfilade_testkit::mixed::{pitched_roof_attic, stair_hall};
use enfilade_testkit::{Generated, furnished_house, rotated};

fn graph_of(g: &Generated) -> CellPortalGraph {
    let context = BakeContext::new(&Silent, None);
    bake(&g.scene, &BakeConfig::default(), &context)
        .unwrap()
        .world
        .graph
}

fn center(p: &Portal) -> DVec3 {
    let sum: DVec3 = p
        .outline
        .iter()
        .map(|q| DVec3::from(q.map(f64::from)))
        .sum();
    sum / p.outline.len() as f64
}

#[test]
fn turned_buildings_keep_their_rooms_and_doorways() {
    for make in [furnished_house, stair_hall, pitched_roof_attic] {
        let straight = make();
        let before = graph_of(&straight);
        for degrees in [17.0, 45.0, 71.0] {
            let g = rotated(make(), degrees);
            let what = format!("{} turned by {degrees} degrees", g.truth.scene);
            let after = graph_of(&g);
            let indoors = |g: &CellPortalGraph| g.indoor_cells().count();
            assert_eq!(indoors(&before), indoors(&after), "{what}");
            for room in &g.truth.rooms {
                let cells: std::collections::BTreeSet<_> = room
                    .sample_points
                    .iter()
                    .map(|&p| after.locator.locate(p))
                    .collect();
                assert_eq!(cells.len(), 1, "{} of {what}", room.name);
            }
            // Openings also keep their positions, though possibly on the wall's other side. Hairline cracks come and go
            // with the rounding of vertices.
            let by = DMat4::from_rotation_y(f64::to_radians(degrees));
            let openings = |g: &CellPortalGraph| -> Vec<Portal> {
                let is_opening = |p: &&Portal| p.kind != PortalKind::Crack;
                g.portals.iter().filter(is_opening).cloned().collect()
            };
            assert_eq!(openings(&before).len(), openings(&after).len(), "{what}");
            for p in openings(&before) {
                let at = by.transform_point3(center(&p));
                let twin = openings(&after)
                    .into_iter()
                    .any(|q| q.kind == p.kind && (center(&q) - at).length() < 0.3);
                assert!(twin, "{:?} at {at:.2} in {what}", p.kind);
            }
        }
    }
}
