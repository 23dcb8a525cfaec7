//! Sounds come through doorways, and grow quieter as doors shut.

use bevy::prelude::*;
use bevy_enfilade::prelude::*;

use crate::LAMPS;
use crate::support::{Stage, Stand, demo_house};

/// A door between two rooms: its entity, its portal, its middle and its normal.
fn inner_door(stage: &mut Stage) -> (Entity, PortalId, Vec3, Vec3) {
    let mut doors = stage.app.world_mut().query::<(Entity, &Door)>();
    let doors: Vec<(Entity, PortalId)> = doors
        .iter(stage.app.world())
        .map(|(entity, door)| (entity, door.id()))
        .collect();
    let graph = &stage.world().world.graph;
    let is_only = |id: PortalId| {
        let [a, b] = graph[id].cells;
        let n_ways = graph[a]
            .portals
            .iter()
            .filter(|p| graph[**p].cells.contains(&b));
        n_ways.count() == 1 && !graph[a].outdoor && !graph[b].outdoor
    };
    let (entity, id) = *doors.iter().find(|(_, id)| is_only(*id)).expect("a door");
    (
        entity,
        id,
        graph[id].center().into(),
        graph[id].normal.into(),
    )
}

/// Sets a door, and hears once it has moved.
fn hear(stage: &mut Stage, door: Entity, radio: Entity, share: f32) -> Heard {
    let mut own = stage.app.world_mut().entity_mut(door);
    let mut own = own.get_mut::<Door>().expect("a door");
    (own.target, own.speed) = (share, 1e6);
    for _ in 0..500 {
        stage.frame();
        let heard = *stage.app.world().get::<Heard>(radio).expect("an emitter");
        let is_there = stage.app.world().get::<Door>(door).expect("a door").share == share;
        if is_there && heard.gain > 0.0 {
            // In the next frame, transforms and doors are at rest.
            stage.frame();
            return *stage.app.world().get::<Heard>(radio).expect("an emitter");
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    panic!("nothing is heard");
}

#[test]
fn a_radio_in_the_next_room_comes_through_the_doorway_and_fades_as_the_door_shuts() {
    let mut stage = Stage::new(&demo_house("hearing"), UVec2::splat(32), LAMPS);
    // The whole house stands elsewhere, turned.
    let turn = Transform::from_xyz(30.0, 2.0, -7.0).with_rotation(Quat::from_rotation_y(1.2));
    let top = {
        let world = stage.app.world();
        let above = world.get::<ChildOf>(stage.root).expect("a parent");
        above.parent()
    };
    stage.app.world_mut().entity_mut(top).insert(turn);
    let (door, id, middle, normal) = inner_door(&mut stage);
    let side = normal.cross(Vec3::Y);
    let outline = &stage.world().world.graph[id].outline;
    let offsets = outline.iter().map(|p| side.dot(Vec3::from(*p) - middle));
    let half_width = offsets.fold(0.0, f32::max);
    // Both are beside the doorway: between them is the wall.
    let aside = (half_width + 0.6) * side;
    let (ears, source) = (middle - normal + aside, middle + normal + aside);
    let cells = stage.world().world.graph[id].cells;
    for (p, cell) in [(ears, cells[0]), (source, cells[1])] {
        assert_eq!(stage.world().sight.locate(p.to_array()), Some(cell));
    }
    let radio = turn.transform_point(source);
    let radio = (Emitter, Transform::from_translation(radio));
    let radio = stage.app.world_mut().spawn(radio).id();
    let camera = stage.camera;
    stage.app.world_mut().entity_mut(camera).insert(Ears);
    stage.stand(Stand {
        eye: turn.transform_point(ears),
        toward: Vec3::X,
    });
    let open = hear(&mut stage, door, radio, 1.0);
    let half = hear(&mut stage, door, radio, 0.5);
    let shut = hear(&mut stage, door, radio, 0.0);
    let levels = [open, half, shut].map(|heard| heard.level());
    assert!(
        levels[0] > levels[1] + 0.5 && levels[1] > levels[2] + 5.0,
        "{levels:?}"
    );
    // It seems to come from the opening, not from behind the wall.
    let toward = turn.rotation.inverse() * open.direction;
    let met = toward * (1.0 / toward.dot(normal));
    let offset = side.dot(met + aside);
    assert!(
        (offset - half_width).abs() < 0.2,
        "{offset} of {half_width}"
    );
    let [ears, source] = [ears, source].map(|p| turn.transform_point(p));
    assert!(open.length > ears.distance(source));
    assert!((open.delay() - open.length / 343.0).abs() < 1e-3);
    // Shut, it is duller: higher octaves lose more.
    let treble = |heard: &Heard| heard.bands[5] / heard.bands[0];
    assert!(treble(&shut) <= treble(&open));
    let beyond = shut.position(ears) - ears;
    assert!((beyond.length() * shut.gain - 1.0).abs() < 1e-3);
}
