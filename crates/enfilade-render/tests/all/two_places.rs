//! Things that stand in special portals are drawn on both sides. A doorway that leads into a copy of the world shows what the
//! plain world shows, which is the judge.

use enfilade_cpg::{PortalId, World};
use enfilade_geom::{DQuat, DVec3, Similarity};
use enfilade_render::{
    AdapterChoice, Camera, Gpu, Picture, Prop, PropMesh, SpaceShot, Studio, Style,
};
use enfilade_testkit::{GridParams, Rng, linked_copies, painted, room_grid};
use enfilade_world::{PartId, Pose, Space, SpaceViewer};

const SIZE: [u32; 2] = [96, 72];

struct Scene {
    space: Space,
    studio: Studio,
}

impl Scene {
    fn new(world: World) -> Self {
        let gpu = Gpu::open(&AdapterChoice::Software).expect("a software adapter");
        let mut studio = Studio::new(gpu, &world).unwrap();
        studio.day = 0.0;
        Self {
            space: Space::new(world).unwrap(),
            studio,
        }
    }

    fn draw(&mut self, camera: Camera, props: &[Prop]) -> Picture {
        let view = camera.view(SIZE[0] as f32 / SIZE[1] as f32).unwrap();
        let mut viewer = SpaceViewer::new(&self.space);
        let seen = viewer.see(&self.space, PartId::ROOT, &view);
        let shot = SpaceShot {
            space: &self.space,
            frame: PartId::ROOT,
            camera,
            seen: Some(seen),
            style: Style {
                dark_corners: false,
                shadows: false,
                daylight: false,
                ..Style::default()
            },
            marks: &[],
            props,
            lamps: None,
        };
        self.studio.space_picture(&shot, SIZE).unwrap().0
    }
}

/// A world in which each batch has its own color, and the same with a doorway that leads into a copy.
fn twins(map: &Similarity) -> [World; 2] {
    let world = painted(
        room_grid(&GridParams {
            outdoors: false,
            doors: 1.0,
            furniture: 0,
            ..GridParams::offices(6, 5)
        }),
        61,
    );
    let linked = linked_copies(&world, PortalId(0), map);
    [world, linked]
}

fn moved(camera: &Camera, map: &Similarity) -> Camera {
    let eye = map.point(DVec3::from_array(camera.eye.map(f64::from)));
    let toward = map.direction(DVec3::from_array(camera.toward.map(f64::from)));
    Camera {
        eye: eye.as_vec3().to_array(),
        toward: toward.as_vec3().to_array(),
        ..*camera
    }
}

/// Returns the number of pixels whose surroundings have one color in the first picture, of those that show the second color of
/// `picture` with the prop, and of those that differ.
fn compare(plain: &Picture, linked: &Picture, without: &Picture) -> [usize; 3] {
    let [mut n, mut n_props, mut n_wrong] = [0; 3];
    for y in 1..SIZE[1] - 1 {
        for x in 1..SIZE[0] - 1 {
            let own = plain.pixel(x, y);
            let around = (0..9).map(|k| plain.pixel(x + k % 3 - 1, y + k / 3 - 1));
            if around.clone().any(|other| other != own) {
                continue;
            }
            n += 1;
            n_props += usize::from(without.pixel(x, y) != own);
            let found = linked.pixel(x, y);
            n_wrong += usize::from(found.iter().zip(own).any(|(a, b)| a.abs_diff(b) > 1));
        }
    }
    [n, n_props, n_wrong]
}

// Covers W9.
#[test]
fn props_in_a_special_doorway_look_as_in_a_plain_one() {
    let map = Similarity::rigid(DQuat::from_rotation_y(1.1), DVec3::new(60.0, 4.0, -7.0));
    let [plain, linked] = twins(&map);
    let portal = &plain.graph[PortalId(0)];
    let normal = DVec3::from_array(portal.normal.map(f64::from));
    let mut scenes = [plain.clone(), linked].map(Scene::new);
    let layout = scenes[0].space.layout(PartId::ROOT);
    let (center, right) = {
        let opening = layout.opening(PortalId(0));
        (opening.center(), opening.normal().cross(DVec3::Y))
    };
    let mut rng = Rng::new(9);
    let mut sum = [0; 3];
    for i in 0..60 {
        let mesh = [PropMesh::BOX, PropMesh::BALL, PropMesh::PERSON][i % 3];
        let size = [[0.5, 0.9, 0.7], [0.35; 3], [1.0; 3]][i % 3];
        let depth = rng.range(0.005, 0.3);
        let turn = DQuat::from_rotation_y(rng.range(-3.0, 3.0));
        let drop = if mesh == PropMesh::PERSON { 1.0 } else { 0.2 };
        let at = center - normal * depth + right * rng.range(-0.1, 0.1) - DVec3::Y * drop;
        let prop = Prop {
            mesh,
            pose: Pose { turn, at },
            size,
            color: [0.1, 0.9, 0.3],
            glow: 1.0,
            ..Prop::default()
        };
        // Before the doorway, and behind it.
        let is_behind = i % 2 == 1;
        let side = if is_behind { 1.0 } else { -1.0 };
        let eye = center + normal * (side * rng.range(1.2, 1.8)) + right * rng.range(-0.7, 0.7);
        let toward = center - eye + DVec3::Y * rng.range(-0.4, 0.2);
        let camera = Camera {
            eye: eye.as_vec3().to_array(),
            toward: toward.as_vec3().to_array(),
            fov_y: 1.2,
        };
        let there = if is_behind {
            moved(&camera, &map)
        } else {
            camera
        };
        let expected = scenes[0].draw(camera, &[prop]);
        let without = scenes[0].draw(camera, &[]);
        let found = scenes[1].draw(there, &[prop]);
        let counts = compare(&expected, &found, &without);
        if let Ok(dir) = std::env::var("ENFILADE_TEST_PICTURES") {
            for (name, picture) in [("plain", &expected), ("linked", &found)] {
                let path = std::path::Path::new(&dir).join(format!("two-{i}-{name}.png"));
                std::fs::write(path, picture.to_png().unwrap()).unwrap();
            }
        }
        for k in 0..3 {
            sum[k] += counts[k];
        }
    }
    let [n, n_props, n_wrong] = sum;
    eprintln!("{n_wrong} of {n} pixels differ, {n_props} show props");
    assert_eq!(n_wrong, 0);
    assert!(n_props * 30 > n, "{n_props} of {n}");
}

#[test]
fn a_prop_ends_at_the_plane_for_who_looks_from_the_place_that_really_is_behind() {
    let map = Similarity::rigid(DQuat::IDENTITY, DVec3::new(60.0, 0.0, 0.0));
    let [plain, linked] = twins(&map);
    let mut scenes = [plain, linked].map(Scene::new);
    let (center, normal, right) = {
        let opening = scenes[0].space.layout(PartId::ROOT).opening(PortalId(0));
        let normal = opening.normal();
        (opening.center(), normal, normal.cross(DVec3::Y))
    };
    // A box along the normal, from 0.5 m before the plane to 0.3 m behind it, and one that ends at the plane.
    let [whole, cut] = [[-0.5, 0.3], [-0.5, 0.0]].map(|[from, to]: [f64; 2]| {
        let along = (normal.abs() * (to - from)).as_vec3();
        let across = (DVec3::ONE - normal.abs()).as_vec3() * 0.6;
        Prop {
            pose: Pose::from_translation(center + normal * (0.5 * (from + to))),
            size: (along + across).to_array(),
            color: [0.1, 0.9, 0.3],
            glow: 1.0,
            ..Prop::default()
        }
    });
    let mut sum = [0; 3];
    for aside in [-1.0, -0.4, 0.5, 1.0] {
        let eye = center + normal * 1.2 + right * aside;
        let camera = Camera {
            eye: eye.as_vec3().to_array(),
            toward: (center - eye).as_vec3().to_array(),
            fov_y: 1.2,
        };
        let expected = scenes[0].draw(camera, &[cut]);
        let longer = scenes[0].draw(camera, &[whole]);
        let found = scenes[1].draw(camera, &[whole]);
        let counts = compare(&expected, &found, &longer);
        for k in 0..3 {
            sum[k] += counts[k];
        }
    }
    let [n, n_longer, n_wrong] = sum;
    eprintln!("{n_wrong} of {n} pixels differ, {n_longer} tell the whole box from its part");
    assert_eq!(n_wrong, 0);
    assert!(n_longer > 100, "{n_longer}");
}
