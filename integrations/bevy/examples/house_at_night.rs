//! A house at night: walk with W A S D, look with the arrow keys or the mouse, open a door with E, switch the lamp of the room with
//! F, and look behind the scenes with F3: there, an arrow points to where a radio is heard from. `assets/world.glb` is the house of
//! `enfilade demo -o assets`.
//!
//! With `--shot FILE.png`, opens a door, waits, saves a picture and ends; `--behind` shows the overlay in it.

use std::path::PathBuf;

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::input::mouse::AccumulatedMouseMotion;
use bevy::light::PointLightShadowMap;
use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, save_to_disk};
use bevy_enfilade::PortalOverlay;
use bevy_enfilade::prelude::*;

/// Height of the eyes above the floor. [Units: m]
const EYES: f32 = 1.6;
/// Farthest door that one can open. [Units: m]
const REACH: f32 = 2.0;
/// Place of the radio, in a room beside that of the player. [Units: m]
const RADIO: Vec3 = Vec3::new(7.0, 1.0, 2.0);
/// Frames until the picture: the house is loaded, and the door is open.
const FRAMES: u32 = 12;

/// The lamp of a room, and the room.
#[derive(Component)]
struct Lamp(CellId);

/// Angles of the player's head. [Units: rad]
#[derive(Component, Default)]
struct Head {
    yaw: f32,
    pitch: f32,
}

#[derive(Resource)]
struct Shot {
    path: PathBuf,
    n_frames: u32,
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let path = arguments.iter().position(|a| a == "--shot");
    let path = path.and_then(|at| arguments.get(at + 1));
    let mut app = App::new();
    app.add_plugins((
        DefaultPlugins,
        EnfiladePlugin,
        PortalOverlayPlugin::default(),
    ))
    .insert_resource(GlobalAmbientLight {
        brightness: 8.0,
        color: Color::srgb(0.5, 0.6, 1.0),
        ..default()
    })
    .insert_resource(ClearColor(Color::srgb(0.01, 0.012, 0.03)))
    .insert_resource(PointLightShadowMap { size: 512 })
    .add_systems(Startup, set_up)
    .add_systems(Update, (hang_lamps, look, walk, use_door, use_lamp).chain())
    .add_observer(tell_room);
    if let Some(path) = path {
        app.insert_resource(Shot {
            path: path.into(),
            n_frames: 0,
        })
        .add_systems(Update, take_picture);
    }
    if arguments.iter().any(|a| a == "--behind") {
        app.add_systems(
            PostStartup,
            |mut overlay: ResMut<PortalOverlay>, mut gizmos: ResMut<PortalGizmos>| {
                overlay.is_shown = true;
                (gizmos.portals, gizmos.views, gizmos.sounds) = (true, true, true);
            },
        );
    }
    app.run();
}

fn set_up(mut commands: Commands, assets: Res<AssetServer>) {
    commands.spawn(WorldAssetRoot(assets.load("world.glb#Scene0")));
    commands.spawn((
        Camera3d::default(),
        Tonemapping::AcesFitted,
        Projection::Perspective(PerspectiveProjection {
            fov: 1.2,
            near: 0.05,
            ..default()
        }),
        Transform::from_xyz(2.0, EYES, 2.0),
        Head {
            yaw: -2.2,
            pitch: -0.1,
        },
        PortalCulling::default(),
        CurrentCell::default(),
        Ears,
    ));
    let radio = Transform::from_translation(RADIO);
    commands.spawn((Name::new("radio"), Emitter, radio));
}

/// Hangs a lamp in each room of a house that was just loaded.
fn hang_lamps(
    mut commands: Commands,
    roots: Query<(Entity, &PortalRoot), Added<PortalState>>,
    worlds: PortalWorlds,
) {
    for (root, _) in &roots {
        let Some(world) = worlds.world(root) else {
            continue;
        };
        for (cell, room) in world.world.graph.rooms() {
            let [low, high] = room.aabb.map(Vec3::from);
            let at = low.midpoint(high).with_y(high.y - 0.35);
            // Every third is off.
            let is_on = cell.0 % 3 != 1;
            commands.spawn((
                Lamp(cell),
                PointLight {
                    color: Color::srgb(1.0, 0.8, 0.55),
                    intensity: 100_000.0,
                    range: 7.0,
                    shadow_maps_enabled: true,
                    ..default()
                },
                Transform::from_translation(at),
                if is_on {
                    Visibility::Inherited
                } else {
                    Visibility::Hidden
                },
                ChildOf(root),
            ));
        }
    }
}

fn look(
    keys: Res<ButtonInput<KeyCode>>,
    mouse: Res<AccumulatedMouseMotion>,
    time: Res<Time>,
    mut player: Single<(&mut Transform, &mut Head)>,
) {
    let (place, head) = &mut *player;
    let axis = |less, more| f32::from(keys.pressed(more)) - f32::from(keys.pressed(less));
    let step = 1.8 * time.delta_secs();
    head.yaw -= axis(KeyCode::ArrowLeft, KeyCode::ArrowRight) * step + mouse.delta.x * 0.002;
    head.pitch += axis(KeyCode::ArrowDown, KeyCode::ArrowUp) * step - mouse.delta.y * 0.002;
    head.pitch = head.pitch.clamp(-1.4, 1.4);
    place.rotation = Quat::from_euler(EulerRot::YXZ, head.yaw, head.pitch, 0.0);
}

/// Walks where neither walls nor shut doors are in the way, and on whatever floor is below.
fn walk(
    keys: Res<ButtonInput<KeyCode>>,
    time: Res<Time>,
    worlds: PortalWorlds,
    mut player: Single<(&mut Transform, &Head)>,
) {
    let (place, head) = &mut *player;
    let axis = |less, more| f32::from(keys.pressed(more)) - f32::from(keys.pressed(less));
    let ahead = Vec3::new(
        axis(KeyCode::KeyA, KeyCode::KeyD),
        0.0,
        axis(KeyCode::KeyW, KeyCode::KeyS),
    );
    let step =
        Quat::from_rotation_y(head.yaw) * ahead.normalize_or_zero() * 2.5 * time.delta_secs();
    // Slides along walls: tries the whole step, then each axis.
    let tries = [step, step.with_z(0.0), step.with_x(0.0)];
    let is_free = |step: &Vec3| {
        let room = step.normalize_or_zero() * 0.3;
        *step != Vec3::ZERO && worlds.is_clear(place.translation, place.translation + *step + room)
    };
    if let Some(step) = tries.iter().find(|s| is_free(s)) {
        place.translation += *step;
    }
    let below = place.translation - Vec3::Y * 4.0;
    if let Some(floor) = worlds.pick(place.translation, below) {
        let goal = floor.position.y + EYES;
        let share = (12.0 * time.delta_secs()).min(1.0);
        place.translation.y += (goal - place.translation.y) * share;
    }
}

/// Opens or shuts the door in front of the eyes.
fn use_door(
    keys: Res<ButtonInput<KeyCode>>,
    shot: Option<Res<Shot>>,
    worlds: PortalWorlds,
    player: Single<&Transform, With<Head>>,
    mut doors: Query<&mut Door>,
) {
    let is_asked = keys.just_pressed(KeyCode::KeyE);
    // For the picture, all doors open by themselves.
    if shot.is_some_and(|s| s.n_frames == FRAMES / 3) {
        doors.iter_mut().for_each(|mut door| door.target = 0.8);
    }
    let to = player.translation + *player.forward() * REACH;
    if let Some(picked) = worlds.pick(player.translation, to).filter(|_| is_asked)
        && let Some(portal) = picked.door
    {
        let is_it = |d: &Mut<Door>| d.root == picked.root && d.id() == portal;
        doors.iter_mut().filter(is_it).for_each(|mut d| d.toggle());
    }
}

fn use_lamp(
    keys: Res<ButtonInput<KeyCode>>,
    player: Single<&CurrentCell>,
    mut lamps: Query<(&Lamp, &mut Visibility)>,
) {
    if keys.just_pressed(KeyCode::KeyF) {
        let own = lamps
            .iter_mut()
            .filter(|(lamp, _)| Some(lamp.0) == player.cell);
        own.for_each(|(_, mut v)| v.toggle_inherited_hidden());
    }
}

fn tell_room(entered: On<CellEntered>, worlds: PortalWorlds) {
    if let Some(name) = worlds.name(entered.root, entered.cell) {
        info!("{name}");
    }
}

fn take_picture(
    mut commands: Commands,
    mut shot: ResMut<Shot>,
    roots: Query<(), With<PortalState>>,
    mut exit: MessageWriter<AppExit>,
) {
    if roots.is_empty() {
        return;
    }
    shot.n_frames += 1;
    if shot.n_frames == FRAMES {
        let save = save_to_disk(shot.path.clone());
        commands.spawn(Screenshot::primary_window()).observe(save);
    }
    // The picture is saved some frames after it was asked for.
    if shot.n_frames > FRAMES && shot.path.exists() {
        exit.write(AppExit::Success);
    }
}
