//! Cells of entities, events, lines of sight and picking, against answers computed from the graph by other means.

use std::collections::HashMap;

use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_enfilade::prelude::*;

use crate::LAMPS;
use crate::support::{Stage, Stand, demo_house};

#[derive(Resource, Default)]
struct Log(Vec<(bool, CellId, Option<PortalId>)>);

/// A point before and one behind the middle of each door, and the cells that the file names for them.
fn doorways(stage: &Stage) -> Vec<(PortalId, [Vec3; 2], [CellId; 2])> {
    let graph = &stage.world().world.graph;
    let doorways = graph.portal_ids().filter_map(|id| {
        let portal = &graph[id];
        let points = portal.outline.iter().map(|p| Vec3::from(*p));
        let middle = points.sum::<Vec3>() / portal.outline.len() as f32;
        let normal = Vec3::from(portal.normal);
        let is_upright = normal.y.abs() < 0.1;
        is_upright.then_some((
            id,
            [middle - 0.3 * normal, middle + 0.3 * normal],
            portal.cells,
        ))
    });
    doorways.collect()
}

// Covers P6.
#[test]
fn one_event_leaves_and_one_enters_at_each_doorway() {
    let mut stage = Stage::new(&demo_house("cells"), UVec2::splat(32), LAMPS);
    let doorways = doorways(&stage);
    assert!(doorways.len() > 20, "{}", doorways.len());
    stage.app.init_resource::<Log>();
    let world = stage.app.world_mut();
    world.add_observer(|e: On<CellEntered>, mut log: ResMut<Log>| {
        log.0.push((true, e.cell, e.portal));
    });
    world.add_observer(|e: On<CellLeft>, mut log: ResMut<Log>| {
        log.0.push((false, e.cell, e.portal));
    });
    let mut n_crossed = 0;
    for (portal, [a, b], [from, to]) in doorways {
        let toward = b - a;
        stage.stand(Stand { eye: a, toward });
        stage.frame();
        stage.app.world_mut().resource_mut::<Log>().0.clear();
        stage.stand(Stand { eye: b, toward });
        stage.frame();
        let log = std::mem::take(&mut stage.app.world_mut().resource_mut::<Log>().0);
        let own = stage.app.world().get::<CurrentCell>(stage.camera);
        assert_eq!(own.expect("a cell").root, Some(stage.root));
        // Thick walls, and openings with a sill, have both points in other cells at times.
        if own.expect("a cell").cell == Some(to) && log.len() == 2 {
            let expected = [(false, from, Some(portal)), (true, to, Some(portal))];
            assert_eq!(log, expected, "{portal}");
            n_crossed += 1;
        }
    }
    assert!(n_crossed > 20, "{n_crossed}");
}

// Covers R6.
#[test]
fn rays_hit_what_stands_in_their_way_also_in_a_moved_world() {
    let mut stage = Stage::new(&demo_house("rays"), UVec2::splat(32), LAMPS);
    let doorways = doorways(&stage);
    let place = Transform::from_xyz(40.0, -3.0, 7.0)
        .with_rotation(Quat::from_rotation_y(0.7))
        .with_scale(Vec3::splat(2.0));
    for place in [Transform::IDENTITY, place] {
        let root = stage.root;
        stage.app.world_mut().entity_mut(root).insert(place);
        stage.frame();
        let doorways = doorways.clone();
        let check = move |worlds: PortalWorlds| {
            let mut by_cell: HashMap<CellId, Vec<Vec3>> = HashMap::new();
            for (_, points, cells) in &doorways {
                for (p, cell) in points.iter().zip(cells) {
                    let p = place.transform_point(*p);
                    if let Some(at) = worlds.locate(p) {
                        assert_eq!(at.root, root);
                        by_cell.entry(at.cell).or_default().push(p);
                        let name = worlds.name(root, *cell);
                        assert!(name.is_some_and(|n| !n.is_empty()));
                    }
                }
            }
            let points: Vec<(CellId, Vec3)> = by_cell
                .iter()
                .flat_map(|(cell, points)| points.iter().map(|p| (*cell, *p)))
                .collect();
            let (mut n_clear, mut n_blocked) = (0, 0);
            for (i, (_, a)) in points.iter().enumerate() {
                for (_, b) in &points[..i] {
                    let is_clear = worlds.is_clear(*a, *b);
                    let hit = worlds.pick(*a, *b);
                    if let Some(hit) = hit {
                        // The hit is on the segment, and its normal faces the start.
                        let along = (*b - *a).normalize();
                        let at = *a + along * hit.distance;
                        assert!(at.distance(hit.position) < 1e-2, "{at} {}", hit.position);
                        assert!(hit.normal.dot(along) <= 1e-3, "{}", hit.normal);
                        assert!((hit.normal.length() - 1.0).abs() < 1e-3);
                    }
                    // Furniture stops a pick and no line of sight.
                    assert!(is_clear || hit.is_some());
                    n_clear += usize::from(is_clear);
                    n_blocked += usize::from(!is_clear);
                }
            }
            assert!(n_clear > 20 && n_blocked > 100, "{n_clear} {n_blocked}");
        };
        stage.app.world_mut().run_system_once(check).expect("a run");
    }
}
