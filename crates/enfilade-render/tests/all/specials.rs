//! Pictures of worlds with mirrors, teleporters, panes and monitors, by the software adapter, against traced rays.

use std::collections::HashSet;

use enfilade_cpg::{MonitorCamera, Pass, SpecialId, SpecialPortal, SpecialShape, Way, World};
use enfilade_geom::DVec3;
use enfilade_render::{AdapterChoice, Camera, Gpu, Picture, SpaceCounts, SpaceShot, Studio, Style};
use enfilade_testkit::{
    Chain, GridParams, Rng, Traced, TracedCamera, chains_of, painted, room_grid, with_specials,
};
use enfilade_world::{PartId, Space, SpaceSeen, SpaceViewer};

const SIZE: [u32; 2] = [96, 72];

fn gpu() -> Gpu {
    Gpu::open(&AdapterChoice::Software)
        .unwrap_or_else(|why| panic!("these tests need a software adapter: {why}"))
}

fn point(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

/// Writes a picture for people, if a folder is given.
fn show(name: &str, picture: &Picture) {
    if let Ok(dir) = std::env::var("ENFILADE_TEST_PICTURES") {
        let path = std::path::Path::new(&dir).join(format!("{name}.png"));
        std::fs::write(path, picture.to_png().unwrap()).unwrap();
    }
}

/// Surfaces in their own colors.
fn style() -> Style {
    Style {
        dark_corners: false,
        shadows: false,
        daylight: false,
        ..Style::default()
    }
}

/// A painted world, drawn and traced.
struct Scene {
    world: World,
    space: Space,
    studio: Studio,
    viewer: SpaceViewer,
    traced: Traced,
    size: [u32; 2],
}

/// Pixels of a picture: those with a certain color, those that differ from it, those that a special portal shows.
#[derive(Debug, Default)]
struct Pixels {
    n: usize,
    n_decided: usize,
    n_wrong: usize,
    n_special: usize,
}

impl Scene {
    fn new(world: World) -> Self {
        let world = painted(world, 61);
        let space = Space::new(world.clone()).unwrap();
        let mut studio = Studio::new(gpu(), &world).unwrap();
        studio.day = 0.0;
        let mut viewer = SpaceViewer::new(&space);
        viewer.specials_mut().max_contexts = 100;
        viewer.specials_mut().min_share = 1e-4;
        viewer.specials_mut().max_apart = 1e3;
        Self {
            traced: Traced::new(&world),
            world,
            space,
            studio,
            viewer,
            size: SIZE,
        }
    }

    fn draw(&mut self, camera: Camera) -> (Picture, SpaceCounts, HashSet<Chain>) {
        let view = camera
            .view(self.size[0] as f32 / self.size[1] as f32)
            .unwrap();
        let seen = self.viewer.see(&self.space, PartId::ROOT, &view);
        let shot = SpaceShot {
            space: &self.space,
            frame: PartId::ROOT,
            camera,
            seen: Some(seen),
            style: style(),
            marks: &[],
            props: &[],
            lamps: None,
        };
        let (picture, counts) = self.studio.space_picture(&shot, self.size).unwrap();
        (picture, counts, chains(&seen))
    }

    /// Draws a picture and counts its pixels. A color may differ by a step of 255.
    fn check(&mut self, camera: Camera, name: &str, pixels: &mut Pixels) -> SpaceCounts {
        let (picture, counts, known) = self.draw(camera);
        show(name, &picture);
        let traced = traced_camera(&camera, self.size);
        let [width, height] = self.size;
        let mut n_wrong = 0;
        for i in 0..width * height {
            let at = [i % width, i / width];
            let depth = std::cell::Cell::new(0);
            let is_known = |chain: &Chain| {
                depth.set(depth.get().max(chain.len()));
                known.contains(chain)
            };
            pixels.n += 1;
            let Some(expected) = self.traced.pixel(&traced, at, self.size, &is_known) else {
                continue;
            };
            pixels.n_decided += 1;
            pixels.n_special += usize::from(depth.get() > 0);
            let found = &picture.rgba[4 * i as usize..][..3];
            let differs = found.iter().zip(expected).any(|(a, b)| a.abs_diff(b) > 1);
            if differs {
                if n_wrong == 0 {
                    eprintln!("{name} at {at:?}: {found:?}, not {expected:?}");
                }
                n_wrong += 1;
            }
        }
        if n_wrong > 0 {
            eprintln!("{name}: {n_wrong} pixels, {camera:?}, {counts:?}");
        }
        pixels.n_wrong += n_wrong;
        counts
    }
}

/// Returns the chains of special portals that are looked into.
fn chains(seen: &SpaceSeen<'_>) -> HashSet<Chain> {
    let vias = seen.contexts().map(|context| context.via());
    let vias = vias.map(|via| via.map(|via| (via.parent, via.special.0, via.pass)));
    chains_of(vias).into_iter().collect()
}

fn traced_camera(camera: &Camera, size: [u32; 2]) -> TracedCamera {
    let tan = f64::from((camera.fov_y * 0.5).tan());
    TracedCamera {
        eye: point(camera.eye),
        axes: camera.axes().map(|a| a.as_dvec3()),
        tangents: [tan * f64::from(size[0]) / f64::from(size[1]), tan],
    }
}

/// A camera in the room of a special portal that looks about at it.
fn camera_before(world: &World, special: SpecialId, rng: &mut Rng) -> Camera {
    let (normal, pieces) = world.graph.special_opening(special);
    let middle = pieces[0].mean();
    let [low, high] = world.graph[world.graph.specials[special.idx()].cell]
        .aabb
        .map(point);
    let eye = if rng.chance(0.25) {
        // Close by.
        let right = normal.cross(DVec3::Y);
        middle - normal * [1e-5, 1e-3, 0.05, 0.3][rng.below(4)] + right * rng.range(-0.3, 0.3)
    } else {
        let t = DVec3::from_array([0, 1, 2].map(|_| rng.range(0.1, 0.9)));
        low + (high - low) * t
    };
    let side = DVec3::from_array([0, 1, 2].map(|_| rng.range(-0.4, 0.4)));
    let toward = (middle - eye).normalize_or(normal) + side;
    Camera {
        eye: eye.as_vec3().to_array(),
        toward: toward.as_vec3().to_array(),
        fov_y: rng.range(0.8, 1.6) as f32,
    }
}

fn offices(n: usize, seed: u64) -> World {
    room_grid(&GridParams {
        outdoors: seed.is_multiple_of(2),
        windows: 0.2,
        furniture: 0,
        ..GridParams::offices(n, seed)
    })
}

/// Returns the world with those of its special portals whose first pass is wanted.
fn only(mut world: World, is_wanted: impl Fn(&Way) -> bool) -> World {
    let old = std::mem::take(&mut world.graph.specials);
    let mut new_ids = vec![None; old.len()];
    let mut n = 0;
    for (id, side) in new_ids.iter_mut().zip(&old) {
        if is_wanted(&side.passes[0].way) {
            *id = Some(SpecialId(n));
            n += 1;
        }
    }
    for (id, mut side) in new_ids.iter().zip(old) {
        if let Way::Lead {
            back: Some(back), ..
        } = &mut side.passes[0].way
            && let Some(new) = new_ids[back.idx()]
        {
            *back = new;
        }
        if id.is_some() {
            world.graph.specials.push(side);
        }
    }
    world
}

fn check_views(scene: &mut Scene, n: usize, name: &str, seed: u64) -> Pixels {
    let mut rng = Rng::new(seed);
    let mut pixels = Pixels::default();
    for i in 0..n {
        let special = SpecialId((i % scene.world.graph.specials.len()) as u32);
        let camera = camera_before(&scene.world, special, &mut rng);
        scene.check(camera, &format!("{name}-{seed}-{i}"), &mut pixels);
    }
    eprintln!("{name}: {pixels:?}");
    pixels
}

#[test]
fn mirrors_show_what_rays_find() {
    for seed in 1..4 {
        let world = only(with_specials(offices(3, seed), 5, seed), |way| {
            *way == Way::Mirror
        });
        let mut scene = Scene::new(world);
        let pixels = check_views(&mut scene, 14, "mirrors", seed);
        assert_eq!(pixels.n_wrong, 0, "{pixels:?}");
        assert!(
            pixels.n_decided * 10 > pixels.n * 8 && pixels.n_special * 8 > pixels.n,
            "{pixels:?}"
        );
    }
}

#[test]
fn teleporters_show_the_place_they_lead_to_turned_and_scaled() {
    for seed in 1..4 {
        let is_lead = |way: &Way| matches!(way, Way::Lead { .. });
        let mut scene = Scene::new(only(with_specials(offices(4, seed), 3, seed), is_lead));
        let pixels = check_views(&mut scene, 18, "teleporters", seed);
        assert_eq!(pixels.n_wrong, 0, "{pixels:?}");
        assert!(
            pixels.n_decided * 10 > pixels.n * 8 && pixels.n_special * 8 > pixels.n,
            "{pixels:?}"
        );
    }
}

/// Adds a special portal to a side of each doorway.
fn with_panes(mut world: World, passes: &[Pass]) -> World {
    let portals: Vec<_> = world.graph.portal_ids().collect();
    for id in portals {
        world.graph.specials.push(SpecialPortal {
            name: "pane".into(),
            cell: world.graph[id].cells[0],
            shape: SpecialShape::Portal(id),
            passes: passes.to_vec(),
        });
    }
    world
}

fn tinted(way: Way, tint: [f32; 4]) -> Pass {
    Pass { way, tint }
}

#[test]
fn tints_and_later_passes_are_those_of_two_pictures() {
    // Tinted mirrors and teleporters, half of these reflecting, and doorways that reflect.
    let mut world = with_specials(offices(4, 5), 3, 5);
    for (i, side) in world.graph.specials.iter_mut().enumerate() {
        side.passes[0].tint = [0.9, 0.6, 0.8, 1.0];
        if i % 4 == 1 || i % 4 == 3 {
            side.passes.push(tinted(Way::Mirror, [1.0, 0.9, 0.7, 0.4]));
        }
    }
    let glass = [
        tinted(Way::Through, [0.7, 0.9, 0.8, 1.0]),
        tinted(Way::Mirror, [1.0, 1.0, 1.0, 0.3]),
    ];
    let mut scene = Scene::new(with_panes(world, &glass));
    let pixels = check_views(&mut scene, 40, "passes", 5);
    assert_eq!(pixels.n_wrong, 0, "{pixels:?}");
    assert!(pixels.n_special * 8 > pixels.n, "{pixels:?}");
}

#[test]
fn monitors_show_the_picture_of_their_camera() {
    let mut world = with_specials(offices(4, 2), 3, 2);
    let rooms: Vec<[DVec3; 2]> = (world.graph.indoor_cells())
        .map(|(_, cell)| cell.aabb.map(point))
        .collect();
    for (i, side) in world.graph.specials.iter_mut().enumerate() {
        if side.passes[0].way == Way::Mirror {
            let [low, high] = rooms[i % rooms.len()];
            side.passes[0].way = Way::Monitor(MonitorCamera {
                eye: ((low + high) * 0.5).as_vec3().to_array(),
                toward: [1.0, -0.3, 0.2 + i as f32],
                up: [0.1, 1.0, 0.0],
                fov_y: 1.2,
            });
        }
    }
    let mut scene = Scene::new(world);
    scene.size = [192, 144];
    let ids: Vec<SpecialId> = scene.world.graph.special_ids().collect();
    let mut rng = Rng::new(3);
    let mut pixels = Pixels::default();
    for (i, special) in ids.iter().cycle().step_by(4).take(12).enumerate() {
        let (normal, pieces) = scene.world.graph.special_opening(*special);
        let right = normal.cross(DVec3::Y);
        let middle = pieces[0].mean();
        let eye = middle - normal * rng.range(0.6, 2.0) + right * rng.range(-0.4, 0.4);
        let camera = Camera::looking_at(eye.as_vec3().to_array(), middle.as_vec3().to_array());
        scene.check(camera, &format!("monitors-{i}"), &mut pixels);
    }
    assert_eq!(pixels.n_wrong, 0, "{pixels:?}");
    assert!(pixels.n_special * 20 > pixels.n, "{pixels:?}");
}

#[test]
fn facing_mirrors_end_and_the_counts_tell() {
    let mut world = room_grid(&GridParams {
        furniture: 0,
        ..GridParams::two_rooms()
    });
    let (cell, room) = world.graph.indoor_cells().next().unwrap();
    let [low, high] = room.aabb.map(point);
    for (x, normal) in [(low.x + 1e-3, -DVec3::X), (high.x - 1e-3, DVec3::X)] {
        let middle = (low + high) * 0.5;
        let corner = |y: f64, z: f64| DVec3::new(x, middle.y + y, middle.z + z * normal.x);
        let piece = [(-0.8, 0.8), (-0.8, -0.8), (0.8, -0.8), (0.8, 0.8)];
        let piece = piece.map(|(y, z)| corner(y, z).as_vec3().to_array());
        world.graph.specials.push(SpecialPortal {
            name: String::new(),
            cell,
            shape: SpecialShape::Surface {
                normal: normal.as_vec3().to_array(),
                pieces: vec![piece.to_vec()],
            },
            passes: vec![Pass::new(Way::Mirror)],
        });
    }
    world.graph.validate().unwrap();
    let mut scene = Scene::new(world);
    let middle = (low + high) * 0.5;
    let camera = Camera::looking_at(
        (middle + DVec3::new(0.3, 0.1, 0.2)).as_vec3().to_array(),
        (middle + DVec3::X).as_vec3().to_array(),
    );
    // As many as asked for, and then the least share, bound the depth.
    for (most, share) in [(5, 0.0), (100, 0.0), (200, 0.0), (100, 1e-2)] {
        *scene.viewer.specials_mut() = enfilade_world::SpecialOptions {
            max_contexts: most,
            min_share: share,
            ..Default::default()
        };
        let mut pixels = Pixels::default();
        let counts = scene.check(camera, &format!("facing-{most}-{share}"), &mut pixels);
        assert_eq!(pixels.n_wrong, 0);
        assert!(counts.n_left_out >= 1, "{counts:?}");
        assert!(counts.n_contexts <= most.min(128), "{counts:?}");
        let is_ended = counts.n_contexts < 20;
        assert_eq!(is_ended, most < 100 || share > 0.0, "{counts:?}");
    }
}

#[test]
fn an_eye_walks_through_a_teleporter_without_a_flicker() {
    let is_linked = |way: &Way| matches!(way, Way::Lead { back: Some(_), .. });
    for seed in 1..3 {
        let mut scene = Scene::new(only(with_specials(offices(4, seed), 2, seed), is_linked));
        scene.size = [64, 48];
        let special = SpecialId(0);
        let (normal, pieces) = scene.world.graph.special_opening(special);
        let plane = pieces[0].mean();
        let Way::Lead { map, .. } = scene.world.graph.specials[0].passes[0].way.clone() else {
            panic!("a link");
        };
        let mut steps: Vec<f64> = (-40..40).map(|i| f64::from(i) * 1e-3 + 3e-4).collect();
        steps.extend([-1e-4, -1e-5, -1e-6, 1e-6, 1e-5, 1e-4]);
        let mut rng = Rng::new(seed);
        let mut pixels = Pixels::default();
        for (i, step) in steps.into_iter().enumerate() {
            let aside = normal.cross(DVec3::Y) * 0.07 + DVec3::Y * 0.05;
            let mut eye = plane + aside + normal * step;
            let mut toward = normal + DVec3::from_array([0, 1, 2].map(|_| rng.range(-0.9, 0.9)));
            if i % 5 == 0 {
                // Along the plane: half of the picture on each side.
                toward -= normal * normal.dot(toward);
            }
            let eye_there = eye.as_vec3().as_dvec3();
            if normal.dot(eye_there - plane) > 0.0 {
                eye = map.point(eye);
                toward = map.direction(toward);
            }
            let camera = Camera {
                eye: eye.as_vec3().to_array(),
                toward: toward.as_vec3().to_array(),
                fov_y: 1.2,
            };
            scene.check(camera, &format!("walk-{seed}-{i}"), &mut pixels);
        }
        assert_eq!(pixels.n_wrong, 0, "{pixels:?}");
        assert!(pixels.n_decided * 10 > pixels.n * 8, "{pixels:?}");
    }
}
