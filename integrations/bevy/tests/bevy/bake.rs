//! Rooms made of the program's own entities, found while it runs.

use bevy::camera::visibility::VisibleEntities;
use bevy::prelude::*;
use bevy_enfilade::{BakeDone, BakeFailed, BakeRole, PortalBake};

use crate::support::{Stage, Stand};

#[derive(Resource, Default)]
struct Outcome(Option<Result<(), String>>);

fn spawn_box(stage: &mut Stage, low: [f32; 3], high: [f32; 3], role: BakeRole) -> Entity {
    let (low, high) = (Vec3::from(low), Vec3::from(high));
    let world = stage.app.world_mut();
    let mesh = Cuboid::from_size(high - low);
    let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
    let material = StandardMaterial::from(Color::srgb(0.8, 0.7, 0.6));
    let material = world
        .resource_mut::<Assets<StandardMaterial>>()
        .add(material);
    let place = Transform::from_translation(low.midpoint(high));
    let parts = (Mesh3d(mesh), MeshMaterial3d(material), place, role);
    world.spawn(parts).id()
}

/// Two rooms of 4 × 4 m side by side, with a doorway of 1 × 2 m in the wall between, and a chest in each.
fn two_rooms(stage: &mut Stage) -> [Entity; 2] {
    use BakeRole::{Detail, Structure};
    for (low, high) in [
        ([-0.2, -0.2, -0.2], [8.4, 0.0, 4.2]),
        ([-0.2, 2.6, -0.2], [8.4, 2.8, 4.2]),
        ([-0.2, 0.0, -0.2], [8.4, 2.6, 0.0]),
        ([-0.2, 0.0, 4.0], [8.4, 2.6, 4.2]),
        ([-0.2, 0.0, 0.0], [0.0, 2.6, 4.0]),
        ([8.2, 0.0, 0.0], [8.4, 2.6, 4.0]),
        ([4.0, 0.0, 0.0], [4.2, 2.6, 2.8]),
        ([4.0, 0.0, 3.8], [4.2, 2.6, 4.0]),
        ([4.0, 2.0, 2.8], [4.2, 2.6, 3.8]),
    ] {
        spawn_box(stage, low, high, Structure);
    }
    [
        spawn_box(stage, [0.3, 0.05, 0.3], [0.9, 0.5, 0.7], Detail),
        spawn_box(stage, [6.0, 0.05, 0.3], [6.9, 0.5, 0.7], Detail),
    ]
}

#[test]
fn rooms_of_entities_are_found_and_culled_by() {
    let mut stage = Stage::empty(UVec2::new(160, 120));
    let chests = two_rooms(&mut stage);
    stage.app.init_resource::<Outcome>();
    let mut root = stage.app.world_mut().spawn(PortalBake::default());
    let root = root
        .observe(|_: On<BakeDone>, mut o: ResMut<Outcome>| o.0 = Some(Ok(())))
        .observe(|e: On<BakeFailed>, mut o: ResMut<Outcome>| o.0 = Some(Err(e.reason.clone())))
        .id();
    for _ in 0..2_000 {
        stage.frame();
        if stage.app.world().resource::<Outcome>().0.is_some() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert_eq!(stage.app.world().resource::<Outcome>().0, Some(Ok(())));
    stage.root = root;
    let graph = &stage.world().world.graph;
    assert_eq!(graph.rooms().count(), 2);
    let between = graph
        .portals
        .iter()
        .filter(|p| p.cells.iter().all(|c| !graph[*c].outdoor));
    assert_eq!(between.count(), 1);
    let drawn = |stage: &mut Stage, eye: [f32; 3], toward: [f32; 3]| {
        let [eye, toward] = [eye, toward].map(Vec3::from);
        let stand = Stand { eye, toward };
        assert_eq!(stage.n_different(stand), 0);
        stage.set_culling(true);
        stage.frame();
        let visible = stage
            .app
            .world()
            .get::<VisibleEntities>(stage.camera)
            .expect("a list");
        let list = visible.get(std::any::TypeId::of::<Mesh3d>());
        chests.map(|c| list.contains(&c))
    };
    // From the first room: at the first chest, with the second behind the wall; and along the doorway.
    assert_eq!(
        drawn(&mut stage, [3.0, 1.5, 3.5], [-2.5, -1.0, -3.0]),
        [true, false]
    );
    assert_eq!(
        drawn(&mut stage, [1.0, 1.0, 0.5], [1.0, 0.0, 0.0]),
        [false, false]
    );
    assert_eq!(
        drawn(&mut stage, [4.8, 1.0, 3.4], [1.5, -0.7, -2.9]),
        [false, true]
    );
}
