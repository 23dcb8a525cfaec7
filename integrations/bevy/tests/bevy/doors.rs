//! Doors move their leaves, hide the room behind, and stop rays.

use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_enfilade::WorldDetail;
use bevy_enfilade::prelude::*;

use crate::LAMPS;
use crate::support::{Stage, Stand, demo_house};

/// Doors between two rooms, each with its middle and normal.
fn inner_doors(stage: &mut Stage) -> Vec<(Entity, PortalId, Vec3, Vec3)> {
    let mut doors = stage.app.world_mut().query::<(Entity, &Door)>();
    let doors: Vec<(Entity, PortalId)> = doors
        .iter(stage.app.world())
        .map(|(entity, door)| (entity, door.id()))
        .collect();
    let graph = &stage.world().world.graph;
    let is_inner = |id: PortalId| graph[id].cells.iter().all(|c| !graph[*c].outdoor);
    doors
        .into_iter()
        .filter(|(_, id)| is_inner(*id) && graph[*id].normal[1].abs() < 0.1)
        .map(|(e, id)| (e, id, graph[id].center().into(), graph[id].normal.into()))
        .collect()
}

fn set_target(stage: &mut Stage, door: Entity, target: f32) {
    let mut door = stage.app.world_mut().entity_mut(door);
    let mut door = door.get_mut::<Door>().expect("a door");
    (door.target, door.speed) = (target, 1e6);
}

// Covers W5.
#[test]
fn a_shut_door_hides_the_room_behind_and_stops_rays() {
    let mut stage = Stage::new(&demo_house("doors"), UVec2::splat(32), LAMPS);
    let doors = inner_doors(&mut stage);
    assert!(doors.len() >= 5, "{}", doors.len());
    for (door, id, middle, normal) in doors {
        let [near, behind] = stage.world().world.graph[id].cells;
        let eye = middle - 0.6 * normal;
        assert_eq!(stage.world().sight.locate(eye.to_array()), Some(near));
        stage.stand(Stand {
            eye,
            toward: normal,
        });
        let sees = |stage: &mut Stage| {
            // One frame moves the leaves, in the next they are in place.
            stage.frame();
            stage.frame();
            stage.view().world(stage.root).expect("a view").sees(behind)
        };
        set_target(&mut stage, door, 1.0);
        assert!(sees(&mut stage), "{id} open");
        let open = leaf_places(&mut stage, id);
        set_target(&mut stage, door, 0.0);
        let sees_shut = sees(&mut stage);
        let shut = leaf_places(&mut stage, id);
        assert!(!open.is_empty());
        for (a, b) in open.iter().zip(&shut) {
            // A leaf turns about one of its edges or slides, so its middle moves by a good part of its width.
            assert!(a.distance(*b) > 0.2, "{id}: {a} {b}");
        }
        let pick = move |worlds: PortalWorlds| worlds.pick(eye, eye + 1.2 * normal);
        let hit = stage.app.world_mut().run_system_once(pick).expect("a run");
        let hit = hit.unwrap_or_else(|| panic!("{id} is shut"));
        assert_eq!(hit.door, Some(id));
        assert!(hit.entity.is_some() || hit.distance > 0.5);
        let is_glass = stage
            .world()
            .sight
            .leaves(id)
            .iter()
            .any(|l| stage.world().world.is_see_through(l.detail.0));
        // Another way around may show the room, through a third one.
        let n_ways = stage.world().world.graph[behind].portals.len();
        assert!(!sees_shut || is_glass || n_ways > 1, "{id} shut");
    }
}

/// Returns the middles of the boxes of a door's leaves, from the transforms that are drawn with.
fn leaf_places(stage: &mut Stage, portal: PortalId) -> Vec<Vec3> {
    let leaves = stage.world().sight.leaves(portal).to_vec();
    let world = stage.app.world_mut();
    let mut details = world.query::<(&WorldDetail, &Children)>();
    let meshes: Vec<Entity> = details
        .iter(world)
        .filter(|(d, _)| leaves.iter().any(|l| l.detail.0 == d.detail))
        .flat_map(|(_, children)| children.iter())
        .collect();
    let boxes = meshes.into_iter().filter_map(|mesh| {
        let aabb = world.get::<bevy::camera::primitives::Aabb>(mesh)?;
        let place = world.get::<GlobalTransform>(mesh)?;
        Some(place.transform_point(aabb.center.into()))
    });
    boxes.collect()
}
