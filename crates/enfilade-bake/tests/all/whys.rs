//! Every cell and portal of a world tells why it is there, by every method and after every change.

use enfilade_bake::edit::add_portal;
use enfilade_bake::rebake::rebake;
use enfilade_bake::{BakeConfig, BakeContext, Method, Outdoors, bake};
use enfilade_cpg::{CellPortalGraph, Reason, World};
use enfilade_geom::scene::Scene;
use enfilade_geom::{DVec3, Plane, Winding};
use enfilade_testkit::{
    Edit, Rng, TowerParams, cave, clinic, edited, furnished_house, hamlets, office_tower,
    with_cupboards,
};
use enfilade_verify::{VerifyOptions, verify_world};

fn baked(scene: &Scene, config: &BakeConfig) -> World {
    let done = bake(scene, config, &BakeContext::default());
    done.unwrap_or_else(|e| panic!("{e}")).world
}

/// Checks that nothing lacks a decision, and that decisions pass verification.
#[track_caller]
fn check(world: &World, what: &str) {
    let graph = &world.graph;
    for cell in &graph.cells {
        assert!(!cell.why.is_empty(), "{what}: {}", cell.name);
    }
    for id in graph.portal_ids() {
        assert!(!graph[id].why.is_empty(), "{what}: {id}");
    }
    let options = VerifyOptions {
        rays: 0,
        ..VerifyOptions::default()
    };
    let report = verify_world(world, None, &options);
    let decided = |p: &&String| {
        ["decision", "decided", "tells why"]
            .iter()
            .any(|w| p.contains(w))
    };
    let wrong: Vec<&String> = report.problems.iter().filter(decided).collect();
    assert!(wrong.is_empty(), "{what}: {wrong:#?}");
}

fn has(graph: &CellPortalGraph, reason: Reason) -> bool {
    let of_cells = graph.cells.iter().map(|c| &c.why);
    let mut all = of_cells
        .chain(graph.portals.iter().map(|p| &p.why))
        .flatten();
    all.any(|why| why.reason == reason)
}

#[test]
fn buildings_tell_why_by_every_method() {
    let tower = with_cupboards(&office_tower(&TowerParams::with_rooms(32, 1)).scene, 8, 1);
    let house = furnished_house().scene;
    for (name, scene) in [("tower", &tower), ("house", &house)] {
        for method in [Method::Watershed, Method::Bsp, Method::Delaunay] {
            let world = baked(scene, &BakeConfig::of(method));
            assert!(world.graph.cells.len() > 3, "{name} {method:?}");
            check(&world, &format!("{name} {method:?}"));
        }
    }
}

#[test]
fn brush_maps_caves_and_land_tell_why() {
    let map = clinic(2000, 1);
    let world = baked(&map, &BakeConfig::default());
    check(&world, "brushes");
    check(&baked(&cave(1).scene, &BakeConfig::default()), "cave");
    let config = BakeConfig {
        outdoors: Outdoors::Split { minima: Vec::new() },
        ..BakeConfig::default()
    };
    let land = baked(&hamlets().scene, &config);
    check(&land, "land");
    assert!(has(&land.graph, Reason::Land) && has(&land.graph, Reason::Border));
}

#[test]
fn what_a_person_asks_for_says_so_and_the_rest_keeps_its_reasons() {
    let mut world = baked(&furnished_house().scene, &BakeConfig::default());
    for _ in 0..3 {
        let graph = &world.graph;
        let rooms = graph.cell_ids().filter(|&c| graph[c].is_room());
        let room = rooms
            .max_by(|&a, &b| graph[a].volume.total_cmp(&graph[b].volume))
            .unwrap();
        let [low, high] = graph[room].aabb.map(|p| DVec3::from(p.map(f64::from)));
        let middle = 0.5 * (low + high);
        // Across every doorway on the way.
        let normal = if high.x - low.x > high.z - low.z {
            DVec3::X
        } else {
            DVec3::Z
        };
        let polygon = Winding::square(&Plane::through(middle, normal), middle, 50.0);
        world = add_portal(&world, &polygon.points).unwrap().world;
        check(&world, "an edit");
    }
    assert!(has(&world.graph, Reason::Asked));
}

#[test]
fn a_rebaked_world_tells_why() {
    let base = with_cupboards(&office_tower(&TowerParams::with_rooms(32, 1)).scene, 8, 1);
    let mut world = baked(&base, &BakeConfig::default());
    for (seed, edit) in (1..).zip([Edit::DoorCut, Edit::WallOut, Edit::Moved]) {
        let (scene, _) = edited(&base, edit, &mut Rng::new(seed)).expect("a place");
        let done = rebake(
            &world,
            &scene,
            &BakeConfig::default(),
            &BakeContext::default(),
        );
        world = done.unwrap().world;
        check(&world, &format!("{edit:?}"));
    }
}
