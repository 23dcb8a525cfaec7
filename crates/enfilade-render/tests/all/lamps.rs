//! Lamps, by the software adapter: what they light, and nothing else.

use enfilade_cpg::{PortalId, World};
use enfilade_geom::{DVec3, Triangle};
use enfilade_render::{
    AdapterChoice, Camera, Culling, Gpu, LampCone, LampLight, LampOptions, Picture, SpaceShot,
    Studio, Style,
};
use enfilade_testkit::{GridParams, Rng, cabin, room_grid};
use enfilade_world::{PartId, Pose, Space, SpaceViewer};

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

/// A studio that knows the cell of each point.
fn studio(world: &World) -> Studio {
    let mut studio = Studio::new(gpu(), world).unwrap();
    studio.add_light(world).unwrap();
    // At night, each lit pixel differs.
    studio.day = 0.0;
    studio
}

fn lamp(at: DVec3) -> LampLight {
    LampLight {
        part: PartId::ROOT,
        at: at.as_vec3().to_array(),
        color: [4.0, 3.6, 3.0],
        range: 12.0,
        cone: None,
    }
}

/// Without effects that depend on neighboring pixels.
fn style() -> Style {
    Style {
        dark_corners: false,
        shadows: false,
        ..Style::default()
    }
}

fn picture(studio: &mut Studio, camera: &Camera) -> Picture {
    studio
        .picture(camera, Culling::Portals, style(), &[], SIZE)
        .unwrap()
}

/// Returns the positions of pixels in which two pictures differ.
fn differing(a: &Picture, b: &Picture, by: u8) -> Vec<usize> {
    let pixels = a.rgba.chunks_exact(4).zip(b.rgba.chunks_exact(4));
    let differ = |(a, b): &(&[u8], &[u8])| a.iter().zip(*b).any(|(x, y)| x.abs_diff(*y) > by);
    let pixels = pixels.enumerate().filter(|(_, p)| differ(p));
    pixels.map(|(i, _)| i).collect()
}

/// Middles of the rooms of a world, in their upper half.
fn middles(world: &World) -> Vec<DVec3> {
    let rooms = world.graph.indoor_cells();
    rooms
        .map(|(_, cell)| {
            let [low, high] = cell.aabb.map(point);
            low + (high - low) * DVec3::new(0.5, 0.7, 0.5)
        })
        .collect()
}

fn camera(rng: &mut Rng, from: DVec3) -> Camera {
    let angle = rng.range(0.0, std::f64::consts::TAU);
    Camera {
        eye: (from - DVec3::Y * 0.4).as_vec3().to_array(),
        toward: [angle.cos() as f32, -0.2, angle.sin() as f32],
        fov_y: 1.4,
    }
}

/// All triangles of a world without objects.
fn triangles(world: &World) -> Vec<Triangle> {
    let batches = world.batches.iter().map(|b| &b.primitive);
    let of = |p: &enfilade_geom::scene::Primitive| {
        let triples = p.triples().iter();
        let corners = triples.map(|t| t.map(|i| point(p.positions[i as usize])));
        corners.collect::<Vec<_>>()
    };
    batches.flat_map(of).collect()
}

#[test]
fn a_surface_is_lit_if_nothing_is_between_it_and_a_lamp() {
    let mut params = GridParams::offices(30, 3);
    params.furniture = 0;
    let world = room_grid(&params);
    let bvh = enfilade_geom::Bvh::build(&triangles(&world));
    let [mut dark, mut lit] = [(), ()].map(|()| studio(&world));
    let rooms = middles(&world);
    let mut rng = Rng::new(8);
    let (mut n, mut n_lit, mut n_wrong) = (0, 0, [0; 2]);
    for k in 0..20 {
        let room = rng.below(rooms.len());
        let light = lamp(rooms[room]);
        lit.set_lamps(vec![light]).unwrap();
        // In its room, and in another one.
        let from = if k % 2 == 0 {
            room
        } else {
            rng.below(rooms.len())
        };
        let camera = camera(&mut rng, rooms[from]);
        let [a, b] = [&mut dark, &mut lit].map(|s| picture(s, &camera));
        show(&format!("lit-{k}"), &b);
        let differing = differing(&a, &b, 0);
        let [ids, _] = dark.ids(&camera, Culling::Portals, SIZE).unwrap();
        let axes = camera.axes().map(|a| a.as_dvec3());
        let tan = f64::from((camera.fov_y * 0.5).tan());
        let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
        for i in 0..SIZE[0] * SIZE[1] {
            let at = [i % SIZE[0], i / SIZE[0]];
            let (_, depth) = ids.at(at);
            if depth <= 0.0 {
                continue;
            }
            let [x, y] = [0, 1].map(|k| (f64::from(at[k]) + 0.5) / f64::from(SIZE[k]) * 2.0 - 1.0);
            let ray = axes[2] + axes[0] * (x * tan * aspect) - axes[1] * (y * tan);
            let p = point(camera.eye) + ray * f64::from(Camera::distance_of(depth));
            let to = point(light.at) - p;
            if to.length() > 0.8 * f64::from(light.range) {
                continue;
            }
            // Within a few texels of the map, edges of shadows are soft.
            let around = [DVec3::X, DVec3::Y, DVec3::Z].map(|a| a * (0.02 * to.length()));
            let is_clear = |from: DVec3| {
                let ray = enfilade_geom::Ray {
                    origin: point(light.at),
                    direction: from - point(light.at),
                    t_max: 0.995,
                };
                bvh.closest_hit(&ray, |_| false).is_none()
            };
            let back = p - ray.normalize() * 0.01;
            let near = around.iter().flat_map(|a| [back + *a, back - *a]);
            let clear: Vec<bool> = near.chain([back]).map(is_clear).collect();
            let is_lit = differing.binary_search(&(i as usize)).is_ok();
            n += 1;
            n_lit += usize::from(is_lit);
            n_wrong[0] += usize::from(is_lit && clear.iter().all(|c| !c));
            n_wrong[1] += usize::from(!is_lit && clear.iter().all(|c| *c));
        }
    }
    assert!(n > 50_000 && n_lit > 10_000, "{n} pixels, {n_lit} lit");
    // Where triangles meet without a common vertex, rasterizers leave single texels open.
    assert!(n_wrong[0] <= 2, "{} are lit behind a wall", n_wrong[0]);
    // Surfaces that the light grazes.
    assert!(
        n_wrong[1] < n_lit / 200,
        "{} are dark in the light",
        n_wrong[1]
    );
}

#[test]
fn maps_of_what_a_lamp_reaches_light_as_maps_of_everything() {
    let world = room_grid(&GridParams::offices(60, 4));
    let rooms = middles(&world);
    let lamps: Vec<LampLight> = rooms.iter().map(|at| lamp(*at)).collect();
    let mut studios = [true, false].map(|is_culled| {
        let mut studio = Studio::new(gpu(), &world).unwrap();
        let options = LampOptions {
            most: 200,
            side: 64,
            is_culled,
        };
        studio.set_lamp_options(options).unwrap();
        studio.set_lamps(lamps.clone()).unwrap();
        studio
    });
    let mut rng = Rng::new(2);
    for _ in 0..20 {
        let room = rng.below(rooms.len());
        let camera = camera(&mut rng, rooms[room]);
        let [a, b] = studios.each_mut().map(|s| picture(s, &camera));
        assert_eq!(a, b);
    }
}

#[test]
fn light_follows_doors_and_cones() {
    let world = room_grid(&GridParams::two_rooms());
    let rooms = middles(&world);
    let mut rng = Rng::new(3);
    let cameras: Vec<Camera> = (0..8).map(|_| camera(&mut rng, rooms[1])).collect();
    let [mut dark, mut studio] = [(), ()].map(|()| studio(&world));
    studio.set_lamps(vec![lamp(rooms[0])]).unwrap();
    let mut n_lit = |studio: &mut Studio, name: &str| -> usize {
        let lit = cameras.iter().enumerate().map(|(i, camera)| {
            dark.state = studio.state.clone();
            let [a, b] = [&mut dark, &mut *studio].map(|s| picture(s, camera));
            show(&format!("{name}-{i}"), &b);
            differing(&a, &b, 0).len()
        });
        lit.sum()
    };
    let open = n_lit(&mut studio, "open");
    assert!(open > 100, "{open} pixels are lit through the doorway");
    let portals: Vec<PortalId> = world.graph.portal_ids().collect();
    for p in &portals {
        studio.state.close(*p);
    }
    assert_eq!(n_lit(&mut studio, "shut"), 0);
    for p in &portals {
        studio.state.open(*p);
    }
    assert_eq!(n_lit(&mut studio, "open-again"), open);
    // A cone that looks up lights the ceiling only.
    let mut spot = lamp(rooms[1]);
    spot.cone = Some(LampCone {
        toward: [0.0, 1.0, 0.0],
        inner: 0.1,
        outer: 0.6,
    });
    studio.set_lamps(vec![spot]).unwrap();
    let up = n_lit(&mut studio, "spot");
    spot.cone = None;
    studio.set_lamps(vec![spot]).unwrap();
    let around = n_lit(&mut studio, "point");
    assert!(up * 3 < around, "{up} of {around}");
}

#[test]
fn a_lamp_of_a_moving_room_lights_what_it_then_reaches() {
    let (host, guest) = (cabin(1, 3.0, 0), cabin(7, 0.6, 0));
    let [a, b] = [&host, &guest].map(|w| middles(w)[0]);
    let pose = |i: usize| Pose {
        turn: enfilade_geom::DQuat::from_rotation_y(0.3 * i as f64),
        at: a + DVec3::new(0.4 * i as f64, -1.5, 0.0) - b,
    };
    let lights = || {
        let own = LampLight {
            part: PartId(1),
            ..lamp(b)
        };
        vec![own, lamp(a + DVec3::new(4.0, 2.0, 4.0))]
    };
    let make = |space: &Space| {
        let mut studio = Studio::new(gpu(), &host).unwrap();
        studio.follow_parts(space).unwrap();
        studio.set_lamps(lights()).unwrap();
        studio
    };
    let mut space = Space::new(host.clone()).unwrap();
    let part = space
        .add_part(guest.clone(), PartId::ROOT, pose(0))
        .unwrap();
    let mut kept = make(&space);
    let mut before: Option<Picture> = None;
    for i in 0..4 {
        space.set_pose(part, pose(i)).unwrap();
        let eye = a + DVec3::new(-4.0, 1.0, 3.0);
        let camera = Camera::looking_at(eye.as_vec3().to_array(), a.as_vec3().to_array());
        let view = camera.view(SIZE[0] as f32 / SIZE[1] as f32).unwrap();
        let mut viewer = SpaceViewer::new(&space);
        let shot = SpaceShot {
            space: &space,
            frame: PartId::ROOT,
            camera,
            seen: Some(viewer.see(&space, PartId::ROOT, &view)),
            style: style(),
            marks: &[],
            props: &[],
            lamps: None,
        };
        let (picture, _) = kept.space_picture(&shot, SIZE).unwrap();
        show(&format!("ride-{i}"), &picture);
        let mut fresh = make(&space);
        let (expected, _) = fresh.space_picture(&shot, SIZE).unwrap();
        assert_eq!(picture, expected, "step {i}");
        let every = SpaceShot {
            lamps: Some(&[0, 1]),
            ..shot
        };
        let (picture, _) = kept.space_picture(&every, SIZE).unwrap();
        assert_eq!(picture, expected, "step {i}, every lamp");
        if let Some(before) = before.replace(picture.clone()) {
            assert_ne!(before, picture, "step {i} changes the picture");
        }
    }
}
