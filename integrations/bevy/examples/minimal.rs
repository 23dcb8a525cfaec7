//! A camera that turns around in a house and draws what it sees through the doorways: F3 shows the rooms.

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy_enfilade::prelude::*;

fn main() {
    App::new()
        .add_plugins((
            DefaultPlugins,
            EnfiladePlugin,
            PortalOverlayPlugin::default(),
        ))
        .add_systems(Startup, set_up)
        .add_systems(Update, turn)
        .add_observer(|entered: On<CellEntered>, worlds: PortalWorlds| {
            info!("in {:?}", worlds.name(entered.root, entered.cell));
        })
        .run();
}

fn set_up(mut commands: Commands, assets: Res<AssetServer>) {
    commands.spawn(WorldAssetRoot(assets.load("world.glb#Scene0")));
    commands.spawn((PointLight::default(), Transform::from_xyz(2.0, 2.2, 2.0)));
    commands.spawn((
        Camera3d::default(),
        Tonemapping::AcesFitted,
        Transform::from_xyz(2.0, 1.6, 2.0),
        PortalCulling::default(), // draws no entity that walls hide
        CurrentCell::default(),   // knows its room
    ));
}

fn turn(time: Res<Time>, mut camera: Single<&mut Transform, With<Camera3d>>) {
    camera.rotate_y(0.3 * time.delta_secs());
}
