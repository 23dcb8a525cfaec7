//! Moving objects and lights are drawn exactly while their cells are in view; others always.

use bevy::camera::visibility::VisibleEntities;
use bevy::prelude::*;
use bevy_enfilade::prelude::*;

use crate::LAMPS;
use crate::support::{Stage, Stand, demo_house, stands};

fn is_listed(stage: &Stage, entity: Entity) -> bool {
    let visible = stage.app.world().get::<VisibleEntities>(stage.camera);
    let mut lists = visible.expect("a list").entities.values();
    lists.any(|list| list.contains(&entity))
}

fn cube(stage: &mut Stage, size: f32) -> Entity {
    let world = stage.app.world_mut();
    let mesh = world
        .resource_mut::<Assets<Mesh>>()
        .add(Cuboid::from_length(size));
    let material = StandardMaterial::from(Color::srgb(1.0, 0.0, 0.0));
    let material = world
        .resource_mut::<Assets<StandardMaterial>>()
        .add(material);
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material))).id()
}

// Covers W3 and W4.
#[test]
fn movers_are_drawn_where_the_eye_sees_them_and_dropped_behind_walls() {
    let mut stage = Stage::new(&demo_house("movers"), UVec2::new(160, 120), LAMPS);
    let mover = cube(&mut stage, 0.25);
    let other = cube(&mut stage, 0.25);
    // On a child, as a character's meshes are.
    let body = stage
        .app
        .world_mut()
        .spawn((Mover, Transform::default(), Visibility::default()));
    let body = body.id();
    stage
        .app
        .world_mut()
        .entity_mut(mover)
        .insert(ChildOf(body));
    let (mut n_shown, mut n_dropped) = (0, 0);
    for stand in stands(stage.world(), 150, 11) {
        // In front of the eye, at times beyond a wall.
        let at = stand.eye + stand.toward * 3.0;
        stage.stand(stand);
        for (entity, at) in [(body, at), (other, at + Vec3::Y * 0.01)] {
            let place = Transform::from_translation(at);
            stage.app.world_mut().entity_mut(entity).insert(place);
        }
        stage.frame();
        let lines = &stage.world().lines;
        let state = stage
            .app
            .world()
            .get::<PortalState>(stage.root)
            .expect("a state");
        let is_clear = lines.is_clear(&state.doors, stand.eye.into(), at.into());
        let is_in_cell = stage.world().sight.locate(stand.eye.into()).is_some();
        let is_shown = is_listed(&stage, mover);
        assert!(is_shown || !(is_clear && is_in_cell), "{stand:?}");
        assert!(
            is_listed(&stage, other),
            "entities that no world knows are drawn"
        );
        n_shown += usize::from(is_shown);
        n_dropped += usize::from(!is_shown);
    }
    assert!(n_shown > 20 && n_dropped > 20, "{n_shown} {n_dropped}");
}

// Covers W3.
#[test]
fn a_moving_object_changes_no_pixel_either() {
    let mut stage = Stage::new(&demo_house("moved"), UVec2::new(160, 120), LAMPS);
    let mover = cube(&mut stage, 0.4);
    stage.app.world_mut().entity_mut(mover).insert(Mover);
    for stand in stands(stage.world(), 6, 5) {
        let at = Transform::from_translation(stand.eye + stand.toward * 1.5);
        stage.app.world_mut().entity_mut(mover).insert(at);
        assert_eq!(stage.n_different(stand), 0, "{stand:?}");
    }
}

/// Range of the light, less than most distances from the eye. [Units: m]
const RANGE: f32 = 0.3;

// Covers W3.
#[test]
fn lights_stay_while_they_shine_on_air_that_is_seen() {
    let mut stage = Stage::new(&demo_house("lights"), UVec2::splat(32), LAMPS);
    let world = stage.app.world_mut();
    let light = world
        .spawn(PointLight {
            range: RANGE,
            ..default()
        })
        .id();
    let baked = stage.world().world.clone();
    let lines = enfilade::Sightlines::build(&baked);
    let sight = enfilade::Sight::build(&baked).unwrap();
    let doors = enfilade::SightState::new(&sight);
    let (mut n_clear, mut n_dropped) = (0, 0);
    for (i, stand) in stands(stage.world(), 200, 3).into_iter().enumerate() {
        let distance = 0.5 + 0.1 * (i % 80) as f32;
        let at = stand.eye + stand.toward * distance;
        let place = Transform::from_translation(at);
        stage.app.world_mut().entity_mut(light).insert(place);
        stage.stand(Stand { ..stand });
        stage.frame();
        let is_kept = is_listed(&stage, light);
        // It is in the middle of the picture: where a ray from the eye meets it, its light is seen, in whatever room.
        let is_clear = lines.is_clear(&doors, stand.eye.to_array(), at.to_array());
        assert!(is_kept || !is_clear, "{stand:?} {distance}");
        n_clear += usize::from(
            is_clear && sight.locate(at.to_array()) != sight.locate(stand.eye.to_array()),
        );
        n_dropped += usize::from(!is_kept);
    }
    assert!(n_clear > 10 && n_dropped > 10, "{n_clear} {n_dropped}");
}
