//! Worlds drawn without a window: for tests, measurements and the pictures of the documentation.

#![allow(dead_code, reason = "each program uses some of it")]

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bevy::app::PluginsState;
use bevy::asset::RenderAssetUsages;
use bevy::camera::RenderTarget;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::{CascadeShadowConfigBuilder, DirectionalLightShadowMap, PointLightShadowMap};
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_resource::{PollType, TextureFormat, TextureUsages};
use bevy::render::renderer::RenderDevice;
use bevy::winit::WinitPlugin;
use bevy_enfilade::prelude::*;

/// Distance of the camera's near plane. [Units: m]
const NEAR: f32 = 0.05;

/// Frames of a view before its picture.
const SETTLING: u32 = 5;

/// Longest wait for a world to be loaded, or for a picture, in frames.
const MOST_FRAMES: u32 = 20_000;

/// Lamps of a stage.
#[derive(Clone, Copy)]
pub(crate) struct Lamps {
    /// Range of the lamp of each room. [Units: m]
    pub(crate) range: f32,
    /// Number of lamps that cast shadows.
    pub(crate) with_shadows: usize,
    /// True for a sun with cascaded shadows.
    pub(crate) sun: bool,
}

/// A program that draws one world to an image, frame by frame as it is told.
pub(crate) struct Stage {
    pub(crate) app: App,
    pub(crate) camera: Entity,
    /// The entity of the world's `PortalRoot`.
    pub(crate) root: Entity,
    image: Handle<Image>,
    size: UVec2,
}

/// Where to look from, and where to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stand {
    pub(crate) eye: Vec3,
    pub(crate) toward: Vec3,
}

#[derive(Resource, Default)]
struct Picture(Option<Vec<u8>>);

fn new_app(folder: PathBuf) -> App {
    let mut app = App::new();
    let plugins = DefaultPlugins
        .set(AssetPlugin {
            file_path: folder.to_string_lossy().into_owned(),
            ..default()
        })
        .set(WindowPlugin {
            primary_window: None,
            exit_condition: bevy::window::ExitCondition::DontExit,
            ..default()
        })
        .set(RenderPlugin {
            // A picture without its materials would be equal to any other such picture.
            synchronous_pipeline_compilation: true,
            ..default()
        })
        .disable::<PipelinedRenderingPlugin>()
        .disable::<WinitPlugin>()
        .disable::<bevy::log::LogPlugin>();
    app.add_plugins((plugins, EnfiladePlugin))
        .init_resource::<Picture>()
        .insert_resource(PointLightShadowMap { size: 256 })
        .insert_resource(DirectionalLightShadowMap { size: 512 });
    while app.plugins_state() == PluginsState::Adding {
        bevy::tasks::tick_global_task_pools_on_main_thread();
    }
    app.finish();
    app.cleanup();
    app
}

impl Stage {
    /// Loads a world and lights it. The camera culls.
    pub(crate) fn new(world: &Path, size: UVec2, lamps: Lamps) -> Self {
        Self::with(world, size, lamps, ())
    }

    /// As [`Stage::new`], with components beside the world's `WorldAssetRoot`.
    pub(crate) fn with(world: &Path, size: UVec2, lamps: Lamps, beside: impl Bundle) -> Self {
        let world = std::path::absolute(world).expect("a path");
        let folder = world.parent().expect("a folder").to_owned();
        let file = world.file_name().expect("a file name").to_string_lossy();
        let mut stage = Self::with_app(new_app(folder), size);
        let scene = GltfAssetLabel::Scene(0).from_asset(file.into_owned());
        let scene = stage.app.world().resource::<AssetServer>().load(scene);
        let world = WorldAssetRoot(scene.clone());
        stage.app.world_mut().spawn((world, beside));
        stage.root = wait_for_root(&mut stage.app, scene.id().untyped());
        stage.light(lamps);
        stage.frame();
        stage
    }

    /// Makes one without a world; its root is a placeholder.
    pub(crate) fn empty(size: UVec2) -> Self {
        Self::with_app(new_app(std::env::temp_dir()), size)
    }

    fn with_app(mut app: App, size: UVec2) -> Self {
        let mut image =
            Image::new_target_texture(size.x, size.y, TextureFormat::Rgba8UnormSrgb, None);
        image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        image.asset_usage = RenderAssetUsages::all();
        let image = app.world_mut().resource_mut::<Assets<Image>>().add(image);
        let camera = app.world_mut().spawn((
            Camera3d::default(),
            Camera {
                clear_color: ClearColorConfig::Custom(Color::srgb(0.4, 0.6, 0.9)),
                ..default()
            },
            RenderTarget::from(image.clone()),
            Projection::Perspective(PerspectiveProjection {
                fov: 1.2,
                near: NEAR,
                ..default()
            }),
            Msaa::Off,
            Tonemapping::AcesFitted,
            PortalCulling::default(),
            CurrentCell::default(),
        ));
        let camera = camera.id();
        Self {
            app,
            camera,
            root: Entity::PLACEHOLDER,
            image,
            size,
        }
    }

    /// Puts a lamp in the middle of each room's box, and a sun.
    fn light(&mut self, lamps: Lamps) {
        let boxes: Vec<[Vec3; 2]> = {
            let graph = &self.world().world.graph;
            let rooms = graph.rooms().map(|(_, room)| room.aabb.map(Vec3::from));
            rooms.collect()
        };
        for (i, [low, high]) in boxes.into_iter().enumerate() {
            let at = low.midpoint(high).with_y(high.y - 0.4);
            self.app.world_mut().spawn((
                PointLight {
                    intensity: 60_000.0,
                    range: lamps.range,
                    color: Color::hsl(i as f32 * 67.0, 0.5, 0.8),
                    shadow_maps_enabled: i < lamps.with_shadows,
                    ..default()
                },
                Transform::from_translation(at),
            ));
        }
        if lamps.sun {
            self.app.world_mut().spawn((
                DirectionalLight {
                    illuminance: 3_000.0,
                    shadow_maps_enabled: true,
                    ..default()
                },
                CascadeShadowConfigBuilder {
                    num_cascades: 2,
                    maximum_distance: 40.0,
                    ..default()
                }
                .build(),
                Transform::from_xyz(3.0, 8.0, 5.0).looking_at(Vec3::ZERO, Vec3::Y),
            ));
        }
    }

    /// Returns the baked world.
    pub(crate) fn world(&self) -> &PortalWorld {
        let root = self.app.world().get::<PortalRoot>(self.root);
        let worlds = self.app.world().resource::<Assets<PortalWorld>>();
        worlds.get(&root.expect("a root").world).expect("a world")
    }

    /// Finds the root again after the world was loaded anew; returns `false` while there is none.
    pub(crate) fn reset_root(&mut self) -> bool {
        let world = self.app.world_mut();
        let mut roots = world.query_filtered::<Entity, With<PortalState>>();
        let root = roots.iter(world).next();
        self.root = root.unwrap_or(self.root);
        root.is_some()
    }

    pub(crate) fn view(&self) -> &PortalView {
        self.app.world().get(self.camera).expect("a view")
    }

    pub(crate) fn set_culling(&mut self, is_enabled: bool) {
        let mut camera = self.app.world_mut().entity_mut(self.camera);
        *camera.get_mut::<PortalCulling>().expect("culling") = PortalCulling { is_enabled };
    }

    pub(crate) fn stand(&mut self, stand: Stand) {
        let place = Transform::from_translation(stand.eye).looking_to(stand.toward, Vec3::Y);
        let mut camera = self.app.world_mut().entity_mut(self.camera);
        *camera.get_mut::<Transform>().expect("a transform") = place;
    }

    /// Draws a frame and waits until the device has finished it.
    pub(crate) fn frame(&mut self) -> Duration {
        let start = Instant::now();
        self.app.update();
        let device = self.app.world().resource::<RenderDevice>();
        device
            .poll(PollType::wait_indefinitely())
            .expect("a device");
        start.elapsed()
    }

    /// Draws, and returns the picture as rows of RGBA.
    pub(crate) fn picture(&mut self) -> Vec<u8> {
        self.app.world_mut().resource_mut::<Picture>().0 = None;
        // The engine sizes its lists of lights by those of the frames before, and drops what does not fit.
        for _ in 0..SETTLING {
            self.frame();
        }
        let readback = Readback::texture(self.image.clone());
        let readback = self.app.world_mut().spawn(readback).id();
        let keep = |done: On<ReadbackComplete>, mut picture: ResMut<Picture>| {
            picture.0 = Some(done.data.clone());
        };
        self.app.world_mut().entity_mut(readback).observe(keep);
        for _ in 0..MOST_FRAMES {
            self.frame();
            if let Some(picture) = self.app.world_mut().resource_mut::<Picture>().0.take() {
                self.app.world_mut().despawn(readback);
                // Rows are padded to multiples of 256 bytes.
                let row = 4 * self.size.x as usize;
                let rows = picture.chunks(row.next_multiple_of(256));
                return rows.flat_map(|r| &r[..row]).copied().collect();
            }
        }
        panic!("no picture came back");
    }

    /// Draws the same view twice, with and without culling; returns the number of pixels that differ. Pictures that do are left
    /// among the system's temporary files.
    pub(crate) fn n_different(&mut self, stand: Stand) -> usize {
        self.stand(stand);
        self.set_culling(true);
        let culled = self.picture();
        self.set_culling(false);
        let whole = self.picture();
        assert!(!whole.is_empty() && culled.len() == whole.len());
        let pairs = culled.chunks(4).zip(whole.chunks(4));
        let n_different = pairs.filter(|(a, b)| a != b).count();
        if n_different > 0 {
            let folder = std::env::temp_dir();
            self.save(culled, &folder.join("bevy-enfilade-culled.png"));
            self.save(whole, &folder.join("bevy-enfilade-whole.png"));
        }
        n_different
    }

    /// Writes a picture as a PNG file.
    pub(crate) fn save(&self, picture: Vec<u8>, path: &Path) {
        let [width, height] = self.size.to_array();
        let image = image::RgbaImage::from_raw(width, height, picture).expect("a picture");
        // Without transparency, as a screen shows it.
        let image = image::DynamicImage::from(image).into_rgb8();
        image.save(path).expect("a file to write to");
    }
}

/// Runs frames until the world is spawned and all it needs is loaded.
fn wait_for_root(app: &mut App, scene: bevy::asset::UntypedAssetId) -> Entity {
    let mut roots = app
        .world_mut()
        .query_filtered::<Entity, (With<PortalRoot>, With<PortalState>)>();
    for _ in 0..MOST_FRAMES {
        app.update();
        let server = app.world().resource::<AssetServer>();
        if let bevy::asset::LoadState::Failed(error) = server.load_state(scene) {
            panic!("{error}");
        }
        let is_loaded = server.is_loaded_with_dependencies(scene);
        if let (true, Some(root)) = (is_loaded, roots.iter(app.world()).next()) {
            return root;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    panic!("the world was not loaded");
}

/// A simple generator of numbers, the same on every machine (xorshift64*).
pub(crate) struct Rng(u64);

impl Rng {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    /// Returns a number from 0 to 1.
    pub(crate) fn unit(&mut self) -> f32 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 40) as f32 / (1_u64 << 24) as f32
    }
}

/// Returns `true` if nothing is so near that the near plane could cut it: through a cut wall, one sees the rooms behind.
fn has_room(world: &PortalWorld, state: &enfilade::SightState, eye: Vec3) -> bool {
    let steps = [-1.0, 0.0, 1.0];
    let rays = steps.map(|x| steps.map(|y| steps.map(|z| Vec3::new(x, y, z))));
    let mut rays = rays.into_iter().flatten().flatten();
    rays.all(|ray| {
        let end = eye + ray.normalize_or_zero() * 3.0 * NEAR;
        matches!(world.lines.pick(state, eye.into(), end.into()), Ok(None))
    })
}

/// Draws random places to look from, spread over the cells, in all directions.
pub(crate) fn stands(world: &PortalWorld, n: usize, seed: u64) -> Vec<Stand> {
    let mut rng = Rng::new(seed);
    let graph = &world.world.graph;
    let cells: Vec<CellId> = graph.cell_ids().filter(|c| !graph[*c].is_void).collect();
    let state = enfilade::SightState::new(&world.sight);
    let mut found = Vec::new();
    while found.len() < n {
        let cell = cells[(rng.unit() * cells.len() as f32) as usize % cells.len()];
        let [low, high] = graph[cell].aabb.map(Vec3::from);
        let eye = low + (high - low) * Vec3::new(rng.unit(), rng.unit(), rng.unit());
        let yaw = rng.unit() * std::f32::consts::TAU;
        let pitch = rng.unit() - 0.5;
        if world.sight.locate(eye.to_array()) == Some(cell) && has_room(world, &state, eye) {
            let toward = Quat::from_euler(EulerRot::YXZ, yaw, pitch, 0.0) * Vec3::NEG_Z;
            found.push(Stand { eye, toward });
        }
    }
    found
}

/// Bakes the demo house to a file in a folder of its own, once per name; returns its path.
pub(crate) fn demo_house(name: &str) -> PathBuf {
    use enfilade::bake::{BakeConfig, BakeContext, bake};
    let folder = std::env::temp_dir().join(format!("bevy-enfilade-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join(format!("{name}.glb"));
    let scene = enfilade_testkit::furnished_house().scene;
    let output = bake(&scene, &BakeConfig::default(), &BakeContext::default());
    enfilade::save(&path, &output.expect("a bake").world).expect("a file");
    path
}
