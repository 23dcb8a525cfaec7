//! Visibility of worlds with special portals: what a side hides need not be in the set, and everything else must.

use enfilade_cpg::{CellId, Pass, PortalId, Pvs, SpecialPortal, SpecialShape, Way, World};
use enfilade_geom::Triangle;
use enfilade_testkit::{GridParams, room_grid};
use enfilade_verify::{VerifyOptions, VerifyReport, structural_triangles, verify_world};
use enfilade_vis::{VisConfig, VisContext, see_parts_through, see_world};

fn verify(world: &World) -> VerifyReport {
    let options = VerifyOptions {
        rays: 4000,
        ..VerifyOptions::default()
    };
    verify_world(world, None, &options)
}

/// Offices in which every third doorway is a mirror from one side.
fn mirrored(seed: u64) -> World {
    let mut world = room_grid(&GridParams {
        doors: 1.0,
        ..GridParams::offices(8, seed)
    });
    for i in (0..world.graph.portals.len() as u32).step_by(3) {
        let portal = PortalId(i);
        world.graph.specials.push(SpecialPortal {
            name: String::new(),
            cell: world.graph[portal].cells[0],
            shape: SpecialShape::Portal(portal),
            passes: vec![Pass::new(Way::Mirror)],
        });
    }
    let walls: Vec<Triangle> = structural_triangles(&world).iter().map(|t| t.0).collect();
    let mut context = VisContext {
        on_round: &mut |_, _| true,
        walls: Some(&walls),
        checkpoint: None,
    };
    let found = see_world(&world.graph, &VisConfig::default(), &mut context).unwrap();
    let mut pvs = found.vis.cells;
    let (volumes, parts) = see_parts_through(&world, &pvs, &found.through).unwrap();
    (pvs.volumes, pvs.parts) = (Some(volumes), Some(parts));
    world.pvs = Some(pvs);
    world
}

#[test]
fn visibility_with_special_portals_keeps_its_promises() {
    for seed in 0..4 {
        let world = mirrored(seed);
        let pvs = world.pvs.as_ref().unwrap();
        assert!(pvs.pairs().any(|(a, b)| !pvs.sees(b, a)), "seed {seed}");
        let report = verify(&world);
        assert!(report.holds(), "seed {seed}: {report:?}");
    }
}

#[test]
fn a_cell_left_out_of_a_set_with_special_portals_is_found() {
    let mut world = mirrored(1);
    let graph = &world.graph;
    let portal = graph
        .portal_ids()
        .find(|&p| graph.special_side(p, graph[p].cells[0]).is_none())
        .unwrap();
    let [a, b] = graph[portal].cells;
    let pvs = world.pvs.as_ref().unwrap();
    let rows = (0..pvs.n_cells() as u32).map(CellId).map(|c| {
        let row = pvs.visible_from(c).filter(move |&d| (c, d) != (a, b));
        row.map(|d| d.0)
    });
    world.pvs = Some(Pvs::of_ascending(rows));
    assert!(!verify(&world).holds());
}
