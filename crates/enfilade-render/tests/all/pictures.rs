//! Pictures by the software adapter, which is the same on every machine.

use std::collections::BTreeSet;
use std::f32::consts::{PI, TAU};

use enfilade_cpg::{CellId, DetailObject, World};
use enfilade_geom::scene::{Material, Mesh, Primitive, Texture};
use enfilade_render::{
    AdapterChoice, Camera, Culling, Frame, Gpu, GpuWorld, MarkShape, Oracle, Paint, PictureMark,
    PixelContent, RenderError, Sparing, Studio, Style,
};
use enfilade_runtime::Sight;
use enfilade_testkit::{GridParams, Rng, room_grid};
use glam::Mat4;

const SIZE: [u32; 2] = [96, 64];

/// Opens the adapter. Without one, tests fail: a test that draws nothing shows nothing.
fn gpu() -> Gpu {
    Gpu::open(&AdapterChoice::Software)
        .unwrap_or_else(|why| panic!("these tests need a software adapter: {why}"))
}

fn grid() -> World {
    room_grid(&GridParams::offices(60, 3))
}

/// A camera in a room of the grid.
fn camera(rng: &mut Rng, world: &World) -> Camera {
    let cells = &world.graph.cells;
    let indoors: Vec<_> = cells.iter().filter(|c| !c.outdoor).collect();
    let [low, high] = indoors[rng.below(indoors.len())].aabb;
    let t = [0, 1, 2].map(|_| rng.range(0.1, 0.9) as f32);
    let angle = rng.range(0.0, std::f64::consts::TAU);
    Camera {
        eye: [0, 1, 2].map(|k| low[k] + (high[k] - low[k]) * t[k]),
        toward: [
            angle.cos() as f32,
            rng.range(-0.4, 0.4) as f32,
            angle.sin() as f32,
        ],
        fov_y: rng.range(0.5, 1.8) as f32,
    }
}

/// Returns the number of pixels that culling lost, by the rule of `verify --views`, and of those that differ at all.
fn n_lost(studio: &mut Studio, world: &World, views: usize, seed: u64) -> [usize; 2] {
    let mut rng = Rng::new(seed);
    let oracle = Oracle::new(world, &studio.sight);
    let mut n = [0; 2];
    for _ in 0..views {
        let camera = camera(&mut rng, world);
        let [whole, culled] = studio.ids_compared(&camera, SIZE).unwrap();
        for (layer, (a, b)) in whole.iter().zip(&culled).enumerate() {
            for l in a.difference(b).lost {
                n[0] += usize::from(oracle.is_lost(&camera, &l, SIZE, layer == 1));
                n[1] += 1;
            }
        }
    }
    n
}

// Covers R1.
#[test]
fn culling_by_portals_changes_no_pixel() {
    let world = grid();
    let mut studio = Studio::new(gpu(), &world).unwrap();
    let [lost, differing] = n_lost(&mut studio, &world, 60, 1);
    assert_eq!(lost, 0);
    // A few of 370,000 pixels lie on an edge, where adapters round; more would be a fault.
    assert!(differing < 20, "{differing} pixels");
}

#[test]
fn a_traversal_that_loses_a_room_is_noticed() {
    let world = grid();
    let mut studio = Studio::new(gpu(), &world).unwrap();
    for c in 0..world.graph.cells.len() as u32 {
        studio.state.lock(CellId(c), true);
    }
    let [lost, differing] = n_lost(&mut studio, &world, 20, 1);
    assert!(
        lost > 100 && lost * 10 > differing * 9,
        "{lost} of {differing}"
    );
}

// Covers R9.
#[test]
fn the_adapter_asked_about_portals_loses_no_pixel_either() {
    let world = grid();
    let mut studio = Studio::new(gpu(), &world).unwrap();
    let mut rng = Rng::new(4);
    let (mut n_cells, mut n_clipped) = (0, 0);
    for _ in 0..12 {
        let camera = camera(&mut rng, &world);
        let (list, counts) = studio.list_by_queries(&world, &camera, SIZE).unwrap();
        let view = camera.view(1.5).unwrap();
        n_cells += counts.n_cells;
        let seen = studio.viewer.see(&studio.sight, &studio.state, &view);
        n_clipped += seen.cells().len() as u32;
        let frame = |list| Frame {
            projection: camera.projection(1.5).unwrap(),
            list,
            style: Style::default(),
            marks: &[],
        };
        let all = studio
            .list(&view, camera.eye, Culling::Everything, SIZE)
            .clone();
        let asked = studio.picture_of(&frame(&list), SIZE).unwrap();
        let whole = studio.picture_of(&frame(&all), SIZE).unwrap();
        let n = (asked.rgba.chunks_exact(4).zip(whole.rgba.chunks_exact(4)))
            .filter(|(a, b)| a != b)
            .count();
        // Ambient occlusion depends on depths nearby: one rounding on an edge shows in a few pixels.
        assert!(n < 8, "{n} pixels, {counts:?}");
        assert!(list.n_triangles() < all.n_triangles() / 2, "{counts:?}");
        assert!(counts.n_rounds >= 1 && counts.n_cells >= 1);
    }
    // Grown outlines and unnarrowed frusta find more cells, but not all.
    assert!(
        n_cells < 4 * n_clipped,
        "{n_cells} cells, {n_clipped} by clipping"
    );
}

// Covers R7.
#[test]
fn a_portal_of_few_pixels_is_filled_or_left_out() {
    let world = grid();
    let mut studio = Studio::new(gpu(), &world).unwrap();
    let mut rng = Rng::new(2);
    let mut n_stopped = 0;
    for _ in 0..12 {
        let camera = camera(&mut rng, &world);
        let view = camera.view(1.5).unwrap();
        let list = |studio: &mut Studio, sparing| {
            studio.sparing = sparing;
            studio
                .list(&view, camera.eye, Culling::Portals, SIZE)
                .clone()
        };
        let whole = list(&mut studio, Sparing::default());
        assert!(whole.stand_ins().is_empty());
        let stop = |stop_at_nothing| Sparing {
            stop_below: 400.0,
            stop_at_nothing,
            ..Sparing::default()
        };
        let filled = list(&mut studio, stop(false));
        let empty = list(&mut studio, stop(true));
        let bare = Sparing {
            objects_below: 1e9,
            ..Sparing::default()
        };
        let without = list(&mut studio, bare);
        assert!(filled.n_triangles() <= whole.n_triangles());
        assert_eq!(empty.n_triangles(), filled.n_triangles());
        assert!(empty.stand_ins().is_empty());
        assert!(without.n_triangles() <= whole.n_triangles());
        n_stopped += filled.stand_ins().len();
        if !filled.stand_ins().is_empty() {
            let mut draw = |list| {
                let frame = Frame {
                    projection: camera.projection(1.5).unwrap(),
                    list,
                    style: Style::default(),
                    marks: &[],
                };
                studio.picture_of(&frame, SIZE).unwrap()
            };
            // Small portals: most of the picture stays the same.
            let (a, b) = (draw(&whole), draw(&filled));
            let n = (a.rgba.chunks_exact(4).zip(b.rgba.chunks_exact(4)))
                .filter(|(a, b)| a != b)
                .count();
            let limit = 500 * filled.stand_ins().len() + 100;
            assert!(
                n < limit,
                "{n} pixels of {} portals",
                filled.stand_ins().len()
            );
        }
    }
    assert!(n_stopped > 3, "{n_stopped}");
}

/// A ball of about 2,500 triangles, half a meter in radius.
fn ball() -> Mesh {
    let n = 36_u32;
    let mut p = Primitive::default();
    for i in 0..=n {
        for j in 0..n {
            let (a, b) = (i as f32 * PI / n as f32, j as f32 * TAU / n as f32);
            let normal = [a.sin() * b.cos(), a.cos(), a.sin() * b.sin()];
            p.normals.push(normal);
            p.positions.push(normal.map(|x| 0.5 * x));
        }
    }
    let at = |i: u32, j: u32| i * n + j % n;
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
        p.indices.extend([a, b, c, a, c, d]);
    }
    Mesh {
        primitives: vec![p],
        ..Mesh::default()
    }
}

// Covers R7.
#[test]
fn objects_far_away_have_fewer_triangles_and_look_the_same() {
    let mut world = World {
        detail_meshes: vec![ball()],
        ..World::default()
    };
    // In a row away from the eye, each twice as far as the one before.
    for i in 0..7 {
        let mut transform = Mat4::IDENTITY.to_cols_array();
        transform[12] = i as f32 - 3.0;
        transform[14] = -2_f32.powi(i);
        world.details.push(DetailObject {
            name: String::new(),
            mesh: 0,
            transform,
            cells: Vec::new(),
            source: None,
            part_of: None,
        });
    }
    let mut studio = Studio::new(gpu(), &world).unwrap();
    let camera = Camera::looking_at([0.0, 0.0, 3.0], [0.0, 0.0, -1.0]);
    let view = camera.view(1.5).unwrap();
    let drawn = |studio: &mut Studio, lod| {
        studio.sparing.lod = lod;
        let list = studio.list(&view, camera.eye, Culling::Frustum, SIZE);
        let n = list.n_triangles();
        let style = Style {
            shadows: false,
            dark_corners: false,
            ..Style::default()
        };
        let picture = studio.picture(&camera, Culling::Frustum, style, &[], SIZE);
        (n, picture.unwrap())
    };
    let (n, whole) = drawn(&mut studio, 0.0);
    assert_eq!(n, 7 * 36 * 72);
    // There are no levels yet.
    assert_eq!(drawn(&mut studio, 1.0).0, n);
    studio.add_levels(&world).unwrap();
    assert_eq!(drawn(&mut studio, 0.0), (n, whole.clone()));
    let mut last = n;
    for lod in [0.25, 1.0, 4.0] {
        let (less, picture) = drawn(&mut studio, lod);
        assert!(less < last, "{less} of {last} triangles at {lod} px");
        last = less;
        let pixels = whole.rgba.chunks_exact(4).zip(picture.rgba.chunks_exact(4));
        let n_other = pixels
            .filter(|(a, b)| (0..3).any(|k| a[k].abs_diff(b[k]) > 24))
            .count();
        // Outlines of seven balls.
        assert!(
            n_other as f32 <= 150.0 * lod,
            "{n_other} pixels at {lod} px"
        );
    }
    assert!(last * 12 < n, "{last} of {n} triangles");
}

// Covers Z1.
#[test]
fn portals_draw_less_than_the_frustum_and_that_less_than_everything() {
    let world = grid();
    let mut studio = Studio::new(gpu(), &world).unwrap();
    let mut rng = Rng::new(5);
    let mut sums = [0; 3];
    for _ in 0..20 {
        let camera = camera(&mut rng, &world);
        let view = camera.view(1.5).unwrap();
        let modes = [Culling::Everything, Culling::Frustum, Culling::Portals];
        let n = modes.map(|m| studio.list(&view, camera.eye, m, SIZE).n_triangles());
        assert!(n[0] >= n[1] && n[1] >= n[2] && n[2] > 0, "{n:?}");
        assert_eq!(n[0], studio.world.n_triangles());
        for (sum, n) in sums.iter_mut().zip(n) {
            *sum += n;
        }
    }
    assert!(sums[2] * 3 < sums[1], "{sums:?}");
}

#[test]
fn the_same_camera_gives_the_same_picture_and_another_another() {
    let world = grid();
    let mut studio = Studio::new(gpu(), &world).unwrap();
    let mut rng = Rng::new(2);
    let (a, b) = (camera(&mut rng, &world), camera(&mut rng, &world));
    let mut draw = |c: &Camera, culling| {
        studio
            .picture(c, culling, Style::default(), &[], SIZE)
            .unwrap()
    };
    let first = draw(&a, Culling::Portals);
    assert_ne!(first, draw(&b, Culling::Portals));
    assert_eq!(first, draw(&a, Culling::Portals));
    assert_eq!(first, draw(&a, Culling::Everything), "colors as well");
    let colors: BTreeSet<_> = first.rgba.chunks_exact(4).collect();
    assert!(colors.len() > 4, "{} colors", colors.len());
}

#[test]
fn paints_and_marks_change_what_is_seen() {
    let world = grid();
    let mut studio = Studio::new(gpu(), &world).unwrap();
    let camera = camera(&mut Rng::new(2), &world);
    let mut draw = |paint, marks: &[PictureMark]| {
        let style = Style {
            paint,
            ..Style::default()
        };
        studio
            .picture(&camera, Culling::Portals, style, marks, SIZE)
            .unwrap()
    };
    let lit = draw(Paint::Lit, &[]);
    assert_ne!(lit, draw(Paint::Cells, &[]));
    assert_ne!(lit, draw(Paint::Overdraw, &[]));
    let mark = PictureMark {
        shape: MarkShape::Rectangle([-0.5, -0.5, 0.5, 0.5]),
        color: [1.0, 0.0, 0.0, 1.0],
        width: 3.0,
        on_top: true,
    };
    let marked = draw(Paint::Lit, &[mark]);
    assert_eq!(marked.pixel(SIZE[0] / 2, SIZE[1] / 4), [255, 0, 0, 255]);
    assert_eq!(marked.pixel(1, 1), lit.pixel(1, 1));
    assert_eq!(
        studio.everything().n_triangles(),
        studio.world.n_triangles(),
        "each once"
    );
}

#[test]
fn a_world_without_anything_is_sky() {
    let mut studio = Studio::new(gpu(), &World::default()).unwrap();
    let camera = Camera::looking_at([0.0; 3], [0.0, 0.0, -1.0]);
    let [solid, glass] = studio.ids(&camera, Culling::Portals, SIZE).unwrap();
    assert!(
        solid
            .pixels
            .iter()
            .chain(&glass.pixels)
            .all(|p| p.0 == PixelContent::Sky)
    );
    studio
        .picture(&camera, Culling::Portals, Style::default(), &[], SIZE)
        .unwrap();
}

#[test]
fn eyes_outside_and_in_walls_see_all_that_a_picture_without_culling_shows() {
    let world = grid();
    let mut studio = Studio::new(gpu(), &world).unwrap();
    let [low, high] = studio.world.bounds();
    let center = [0, 1, 2].map(|k| (low[k] + high[k]) * 0.5);
    for out in [0.5, 3.0, 40.0] {
        let camera = Camera::looking_at([high[0] + out, center[1], high[2] + out], center);
        let [whole, culled] = studio.ids_compared(&camera, SIZE).unwrap();
        assert_eq!(whole[0].difference(&culled[0]).lost, []);
        assert!(whole[0].pixels.iter().any(|p| p.0 != PixelContent::Sky));
    }
}

#[test]
fn missing_pictures_are_counted_and_drawn_without() {
    let mut world = grid();
    world.textures.push(Texture::default());
    world.materials.push(Material {
        gltf: r#"{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}"#.into(),
        base_color: [0.2, 0.4, 0.6, 1.0],
        ..Material::default()
    });
    let material = world.materials.len() as u32 - 1;
    for batch in &mut world.batches {
        batch.primitive.material = Some(material);
    }
    let gpu = gpu();
    let sight = Sight::build(&world).unwrap();
    let loaded = GpuWorld::load(&gpu, &world, &sight).unwrap();
    assert_eq!(loaded.n_missing_pictures(), 1);
}

#[test]
fn what_cannot_be_is_an_error_that_says_what_to_do() {
    let found = Gpu::open(&AdapterChoice::Named("no such adapter".into()));
    let Err(why @ RenderError::NoSuchAdapter { .. }) = found else {
        panic!("{found:?}");
    };
    assert!(why.to_string().contains("no such adapter"), "{why}");
    assert!(
        RenderError::NoAdapter
            .to_string()
            .contains("apt-get install")
    );
    let mut studio = Studio::new(gpu(), &grid()).unwrap();
    let camera = Camera::looking_at([1.0, 1.0, 1.0], [2.0, 1.0, 1.0]);
    let mut draw =
        |camera, size| studio.picture(camera, Culling::Portals, Style::default(), &[], size);
    assert!(matches!(
        draw(&camera, [1 << 20, 4]),
        Err(RenderError::TooLarge { .. })
    ));
    let nowhere = Camera {
        toward: [0.0; 3],
        ..camera
    };
    assert!(matches!(draw(&nowhere, SIZE), Err(RenderError::Camera(_))));
    draw(&camera, SIZE).unwrap();
}
