//! Doors in pictures: leaves in their positions, and plugs of shut openings. FEATURES: W5.

use enfilade_cpg::{PortalId, World};
use enfilade_render::{AdapterChoice, Camera, Culling, Gpu, Oracle, PixelContent, Studio};
use enfilade_testkit::{GridParams, Rng, room_grid, with_doors};

const SIZE: [u32; 2] = [96, 64];

fn gpu() -> Gpu {
    Gpu::open(&AdapterChoice::Software)
        .unwrap_or_else(|why| panic!("these tests need a software adapter: {why}"))
}

fn portals(world: &World) -> impl Iterator<Item = PortalId> + use<> {
    (0..world.graph.portals.len() as u32).map(PortalId)
}

/// A camera in a room, anywhere in it.
fn camera(rng: &mut Rng, world: &World) -> Camera {
    let [low, high] = world.graph.cells[rng.below(world.graph.cells.len() - 1)].aabb;
    let eye = [0, 1, 2].map(|k| rng.range(low[k].into(), high[k].into()) as f32);
    let angle = rng.range(0.0, std::f64::consts::TAU);
    Camera {
        eye,
        toward: [
            angle.cos() as f32,
            rng.range(-0.4, 0.4) as f32,
            angle.sin() as f32,
        ],
        fov_y: rng.range(0.5, 1.8) as f32,
    }
}

/// However doors stand, culling changes no pixel; and leaves and plugs are among the visible objects.
#[test]
fn culling_changes_no_pixel_however_doors_stand() {
    let world = with_doors(room_grid(&GridParams::offices(40, 3)), |p| p % 4 == 0);
    let mut studio = Studio::new(gpu(), &world).unwrap();
    let mut oracle = Oracle::new(&world, &studio.sight);
    let mut rng = Rng::new(5);
    let (mut n_leaf, mut n_plug) = (0, 0);
    for _ in 0..60 {
        for p in portals(&world) {
            match rng.below(4) {
                0 => studio.state.set_leaves(p, 0.0),
                1 => studio.state.set_leaves(p, rng.range(0.0, 1.0) as f32),
                2 if rng.chance(0.3) => studio.state.close(p),
                _ => studio.state.open(p),
            }
        }
        oracle.follow(&studio.sight, &studio.state);
        let camera = camera(&mut rng, &world);
        if oracle.is_at_surface(camera.eye) {
            continue;
        }
        let [whole, culled] = studio.ids_compared(&camera, SIZE).unwrap();
        for (layer, (a, b)) in whole.iter().zip(&culled).enumerate() {
            for l in a.difference(b).lost {
                let is_lost = oracle.is_lost(&camera, &l, SIZE, layer == 1);
                assert!(!is_lost, "{l:?} of {camera:?}");
            }
        }
        for (shown, _) in &culled[0].pixels {
            match *shown {
                PixelContent::Plug { .. } => n_plug += 1,
                PixelContent::Detail { detail, .. } => {
                    let name = &world.details[detail as usize].name;
                    n_leaf += usize::from(name.starts_with("leaf"));
                }
                _ => {}
            }
        }
    }
    assert!(n_leaf > 1000 && n_plug > 100, "{n_leaf} {n_plug}");
}

/// Returns the share of pixels for which `is_it` holds.
fn share(
    studio: &mut Studio,
    camera: &Camera,
    culling: Culling,
    is_it: impl Fn(&PixelContent) -> bool,
) -> f64 {
    let [solid, _] = studio.ids(camera, culling, SIZE).unwrap();
    let n = solid.pixels.iter().filter(|p| is_it(&p.0)).count();
    n as f64 / solid.pixels.len() as f64
}

const ALL: [Culling; 3] = [Culling::Everything, Culling::Frustum, Culling::Portals];

#[test]
fn a_closed_opening_without_a_leaf_is_filled_also_with_corners_behind_the_eye() {
    let world = room_grid(&GridParams::two_rooms());
    let mut studio = Studio::new(gpu(), &world).unwrap();
    let door = PortalId(0);
    let outline = &world.graph[door].outline;
    let center = [0, 1, 2].map(|k| outline.iter().map(|p| p[k]).sum::<f32>() / 4.0);
    let normal = world.graph[door].normal;
    studio.state.close(door);
    // 12 cm before the opening, looking along it: its near edge is behind the eye.
    for aside in [0.0, 2.0, -2.0] {
        let eye = [0, 1, 2].map(|k| center[k] - 0.12 * normal[k]);
        let toward = [
            normal[0] + aside * normal[2],
            0.0,
            normal[2] - aside * normal[0],
        ];
        let camera = Camera {
            eye,
            toward,
            fov_y: 1.6,
        };
        for culling in ALL {
            let sky = share(&mut studio, &camera, culling, |s| *s == PixelContent::Sky);
            assert_eq!(sky, 0.0, "{culling:?} {aside}");
            let plug =
                |s: &PixelContent| matches!(s, PixelContent::Plug { portal } if *portal == door);
            assert!(
                share(&mut studio, &camera, culling, plug) > 0.2,
                "{culling:?} {aside}"
            );
        }
    }
}

#[test]
fn a_shut_leaf_hides_what_fills_its_opening_and_an_open_one_shows_the_room_behind() {
    let world = with_doors(room_grid(&GridParams::two_rooms()), |_| false);
    let mut studio = Studio::new(gpu(), &world).unwrap();
    let door = PortalId(0);
    let outline = &world.graph[door].outline;
    let center = [0, 1, 2].map(|k| outline.iter().map(|p| p[k]).sum::<f32>() / 4.0);
    let normal = world.graph[door].normal;
    let is_leaf = |s: &PixelContent| matches!(s, PixelContent::Detail { .. });
    let is_plug = |s: &PixelContent| matches!(s, PixelContent::Plug { .. });
    for side in [-1.5, 1.5] {
        let eye = [0, 1, 2].map(|k| center[k] + side * normal[k]);
        let camera = Camera::looking_at(eye, center);
        for culling in ALL {
            studio.state.set_leaves(door, 0.0);
            let shut = share(&mut studio, &camera, culling, is_leaf);
            let plug = share(&mut studio, &camera, culling, is_plug);
            // Strips between portal and leaf are visible edge-on around it.
            assert!(
                shut > 0.1 && plug < 0.3 * shut,
                "{culling:?}: {shut} {plug}"
            );
            studio.state.set_leaves(door, 1.0);
            let [solid, _] = studio.ids(&camera, culling, SIZE).unwrap();
            let (through, _) = solid.at([SIZE[0] / 2, SIZE[1] / 2]);
            assert!(
                matches!(through, PixelContent::Structure { .. }),
                "{culling:?}: {through:?}"
            );
            assert_eq!(share(&mut studio, &camera, culling, is_plug), 0.0);
        }
    }
}
