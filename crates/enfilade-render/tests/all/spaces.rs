//! Pictures of worlds that stand in worlds, by the software adapter.

use enfilade_cpg::World;
use enfilade_geom::{DQuat, DVec3};
use enfilade_render::{
    AdapterChoice, Camera, Culling, Gpu, Picture, Prop, PropMesh, SpaceShot, Studio, Style,
};
use enfilade_testkit::cabin;
use enfilade_world::{PartId, Pose, Space, SpaceViewer};

const SIZE: [u32; 2] = [96, 72];

fn gpu() -> Gpu {
    Gpu::open(&AdapterChoice::Software)
        .unwrap_or_else(|why| panic!("these tests need a software adapter: {why}"))
}

/// Returns the number of pixels that differ by more than 8 steps of a color.
fn n_differing(a: &Picture, b: &Picture) -> usize {
    let pixels = a.rgba.chunks_exact(4).zip(b.rgba.chunks_exact(4));
    let differ = |(a, b): &(&[u8], &[u8])| a.iter().zip(*b).any(|(x, y)| x.abs_diff(*y) > 8);
    pixels.filter(differ).count()
}

fn point(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

/// Returns the camera in the frame to which `motion` maps.
fn moved(camera: &Camera, motion: &Pose) -> Camera {
    Camera {
        eye: motion.point(point(camera.eye)).as_vec3().to_array(),
        toward: (motion.direction(point(camera.toward)).as_vec3()).to_array(),
        fov_y: camera.fov_y,
    }
}

/// Writes a picture for people, if a folder is given.
fn show(name: &str, picture: &Picture) {
    if let Ok(dir) = std::env::var("ENFILADE_TEST_PICTURES") {
        let path = std::path::Path::new(&dir).join(format!("{name}.png"));
        std::fs::write(path, picture.to_png().unwrap()).unwrap();
    }
}

fn middle(world: &World) -> DVec3 {
    let (_, cell) = world.graph.indoor_cells().next().unwrap();
    let [low, high] = cell.aabb.map(point);
    (low + high) * 0.5
}

/// Returns a world with the triangles of another in it, at a pose.
fn merged(host: &World, guest: &World, pose: &Pose) -> World {
    let mut world = host.clone();
    for batch in &guest.batches {
        let mut batch = batch.clone();
        batch.cells.clear();
        for p in &mut batch.primitive.positions {
            *p = pose.point(point(*p)).as_vec3().to_array();
        }
        for n in &mut batch.primitive.normals {
            *n = pose.direction(point(*n)).as_vec3().to_array();
        }
        world.batches.push(batch);
    }
    world
}

/// A room in a larger one, three times as wide, at several poses.
fn rooms() -> (World, World, Vec<Pose>) {
    let (host, guest) = (cabin(1, 3.0, 0), cabin(7, 0.6, 0));
    let pose = |turn: DQuat, by: DVec3| Pose {
        turn,
        at: middle(&host) + by - turn * middle(&guest),
    };
    let poses = vec![
        pose(DQuat::IDENTITY, DVec3::ZERO),
        pose(DQuat::from_rotation_y(0.7), DVec3::new(1.0, -1.0, 0.5)),
        pose(
            DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.4),
            DVec3::new(-1.0, 0.4, 0.0),
        ),
    ];
    (host, guest, poses)
}

#[test]
fn a_room_in_a_room_is_drawn_as_one_world_would_be() {
    let (host, guest, poses) = rooms();
    for (k, pose) in poses.iter().enumerate() {
        let whole = merged(&host, &guest, pose);
        let mut one = Studio::new(gpu(), &whole).unwrap();
        let mut space = Space::new(host.clone()).unwrap();
        space.add_part(guest.clone(), PartId::ROOT, *pose).unwrap();
        let mut studio = Studio::new(gpu(), &host).unwrap();
        studio.follow_parts(&space).unwrap();
        let mut viewer = SpaceViewer::new(&space);
        for i in 0..12 {
            let angle = f64::from(i) * 0.53;
            // Inside the guest, and around it.
            let reach = if i % 3 == 0 { 0.2 } else { 4.5 };
            let eye = middle(&host) + DVec3::new(angle.cos(), 0.2, angle.sin()) * reach;
            let at = if i % 3 == 0 {
                eye + DVec3::new(angle.sin(), 0.1, 0.6)
            } else {
                middle(&host)
            };
            let camera = Camera::looking_at(eye.as_vec3().to_array(), at.as_vec3().to_array());
            let style = Style::default();
            let expected = one
                .picture(&camera, Culling::Everything, style, &[], SIZE)
                .unwrap();
            show(&format!("rooms-{k}-{i}-one"), &expected);
            let view = camera.view(SIZE[0] as f32 / SIZE[1] as f32).unwrap();
            for culls in [false, true] {
                let seen = culls.then(|| viewer.see(&space, PartId::ROOT, &view));
                let shot = SpaceShot {
                    space: &space,
                    frame: PartId::ROOT,
                    camera,
                    seen,
                    style,
                    marks: &[],
                    props: &[],
                    lamps: None,
                };
                let (picture, counts) = studio.space_picture(&shot, SIZE).unwrap();
                show(&format!("rooms-{k}-{i}-{culls}"), &picture);
                assert!(culls || counts.n_parts == 2);
                // Along edges, other frames round otherwise.
                let n = n_differing(&expected, &picture);
                assert!(
                    n <= 30,
                    "pose {k}, camera {i}, culling {culls}: {n} pixels differ"
                );
            }
        }
    }
}

#[test]
fn a_far_room_looks_as_a_near_one_in_its_own_frame_and_in_the_root_s() {
    let (host, guest) = (cabin(1, 0.3, 0), cabin(7, 1.0, 3));
    let mut pictures = Vec::new();
    for at in [
        DVec3::new(40.0, 10.0, -7.0),
        DVec3::new(10_000.0, 3.0, -7_000.0),
    ] {
        let pose = Pose {
            turn: DQuat::from_rotation_y(0.5),
            at,
        };
        let mut space = Space::new(host.clone()).unwrap();
        let part = space.add_part(guest.clone(), PartId::ROOT, pose).unwrap();
        let mut studio = Studio::new(gpu(), &host).unwrap();
        studio.follow_parts(&space).unwrap();
        let mut viewer = SpaceViewer::new(&space);
        let eye = middle(&guest).as_vec3().to_array();
        for toward in [[1.0, -0.1, 0.3], [-0.2, 0.0, 1.0], [-1.0, -0.3, -0.8]] {
            let camera = Camera {
                eye,
                toward,
                fov_y: 1.2,
            };
            for (frame, camera) in [(part, camera), (PartId::ROOT, moved(&camera, &pose))] {
                let view = camera.view(SIZE[0] as f32 / SIZE[1] as f32).unwrap();
                let shot = SpaceShot {
                    space: &space,
                    frame,
                    camera,
                    seen: Some(viewer.see(&space, frame, &view)),
                    // The map's texels grow with the distance of the two.
                    style: Style {
                        shadows: false,
                        ..Style::default()
                    },
                    marks: &[],
                    props: &[],
                    lamps: None,
                };
                let (picture, counts) = studio.space_picture(&shot, SIZE).unwrap();
                show(&format!("far-{}", pictures.len()), &picture);
                assert!(counts.n_triangles > 0);
                pictures.push(picture);
            }
        }
    }
    let (near, far) = pictures.split_at(6);
    for i in 0..6 {
        for other in [&near[i / 2 * 2], &far[i]] {
            let n = n_differing(&near[i], other);
            assert!(n <= 30, "{i}: {n} pixels differ");
        }
    }
}

#[test]
fn props_are_hidden_by_walls_and_stand_in_rooms() {
    let (host, guest, poses) = rooms();
    let mut space = Space::new(host.clone()).unwrap();
    let part = space
        .add_part(guest.clone(), PartId::ROOT, poses[1])
        .unwrap();
    let mut studio = Studio::new(gpu(), &host).unwrap();
    studio.follow_parts(&space).unwrap();
    let mut viewer = SpaceViewer::new(&space);
    let at = middle(&host);
    let camera = Camera::looking_at(
        (at + DVec3::new(-3.97, 0.2, 2.12)).as_vec3().to_array(),
        at.as_vec3().to_array(),
    );
    let view = camera.view(SIZE[0] as f32 / SIZE[1] as f32).unwrap();
    let red = |mesh, part, at| Prop {
        mesh,
        part,
        pose: Pose::from_translation(at),
        size: [0.5; 3],
        color: [1.0, 0.0, 0.0],
        glow: 0.0,
    };
    let mut n_red = |props: &[Prop], name: &str| {
        let shot = SpaceShot {
            space: &space,
            frame: PartId::ROOT,
            camera,
            seen: Some(viewer.see(&space, PartId::ROOT, &view)),
            style: Style::default(),
            marks: &[],
            props,
            lamps: None,
        };
        let (picture, _) = studio.space_picture(&shot, SIZE).unwrap();
        show(name, &picture);
        let pixels = picture.rgba.chunks_exact(4);
        pixels.filter(|p| p[0] > 40 && p[0] / 3 > p[1]).count()
    };
    assert_eq!(n_red(&[], "props-none"), 0);
    let before = at + DVec3::new(-2.6, -1.0, 1.4);
    for mesh in [PropMesh::BOX, PropMesh::BALL, PropMesh::PERSON] {
        let n = n_red(
            &[red(mesh, PartId::ROOT, before)],
            &format!("props-{mesh:?}"),
        );
        assert!(n > 60, "{mesh:?} covers {n} pixels");
    }
    // Below the floor of the root, and of the part.
    let below = at - DVec3::Y * 20.0;
    assert_eq!(
        n_red(&[red(PropMesh::BALL, PartId::ROOT, below)], "props-below"),
        0
    );
    let mut inside = red(PropMesh::BALL, part, middle(&guest));
    inside.size = [0.8; 3];
    let through = n_red(&[inside], "props-inside");
    inside.part = PartId::ROOT;
    inside.pose = poses[1].after(&inside.pose);
    let of_root = n_red(&[inside], "props-inside-of-root");
    assert!(
        (4..400).contains(&through),
        "{through} pixels through a window"
    );
    assert!(
        through.abs_diff(of_root) < 4,
        "{of_root} pixels in the root's frame"
    );
}

#[test]
fn a_studio_that_follows_a_space_draws_what_one_made_anew_draws() {
    let (host, guest, poses) = rooms();
    let mut space = Space::new(host.clone()).unwrap();
    let mut studio = Studio::new(gpu(), &host).unwrap();
    let look = |studio: &mut Studio, space: &Space| {
        let eye = middle(&host) + DVec3::new(4.5, 0.3, 0.4);
        let at = middle(&host).as_vec3().to_array();
        let camera = Camera::looking_at(eye.as_vec3().to_array(), at);
        let shot = SpaceShot {
            space,
            frame: PartId::ROOT,
            camera,
            seen: None,
            style: Style::default(),
            marks: &[],
            props: &[],
            lamps: None,
        };
        let picture = studio.space_picture(&shot, SIZE).unwrap().0;
        (picture, studio.n_triangles_in(space))
    };
    let mut pictures = Vec::new();
    let mut both = |space: &Space| {
        studio.follow_parts(space).unwrap();
        let mut anew = Studio::new(gpu(), &host).unwrap();
        anew.follow_parts(space).unwrap();
        let (now, fresh) = (look(&mut studio, space), look(&mut anew, space));
        assert_eq!(now.1, fresh.1);
        assert_eq!(n_differing(&now.0, &fresh.0), 0, "step {}", pictures.len());
        pictures.push(now.0);
    };
    both(&space);
    let part = space
        .add_part(guest.clone(), PartId::ROOT, poses[0])
        .unwrap();
    both(&space);
    space.withdraw(part).unwrap();
    both(&space);
    // Its place is taken by another world, and a copy of it.
    space.forget(part).unwrap();
    let other = space
        .add_part(cabin(3, 0.5, 0), PartId::ROOT, poses[0])
        .unwrap();
    space.add_copy(other, PartId::ROOT, poses[1]).unwrap();
    both(&space);
    assert_eq!(n_differing(&pictures[0], &pictures[2]), 0);
    let n_seen = [(0, 1), (1, 3)].map(|(a, b)| n_differing(&pictures[a], &pictures[b]));
    assert!(n_seen.iter().all(|n| *n > 50), "{n_seen:?}");
}
