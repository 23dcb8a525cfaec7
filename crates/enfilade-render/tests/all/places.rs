//! Features that depend on the place of a point, not on its triangle: light, cells, reasons of visibility.

use enfilade_cpg::{Batch, CellId, World, cell_paint};
use enfilade_render::{
    AdapterChoice, Camera, Culling, Frame, Gpu, Paint, Picture, Projection, Studio, Style,
    walk_cameras,
};
use enfilade_testkit::{GridParams, Rng, room_grid};

const SIZE: [u32; 2] = [160, 120];

fn gpu() -> Gpu {
    Gpu::open(&AdapterChoice::Software)
        .unwrap_or_else(|why| panic!("these tests need a software adapter: {why}"))
}

/// Rooms whose walls are one batch that every cell sees, as from a builder whose slabs reach through all rooms.
fn shared() -> World {
    let mut world = room_grid(&GridParams::offices(30, 1));
    let mut all = Batch {
        cells: (0..world.graph.cells.len() as u32).map(CellId).collect(),
        ..Batch::default()
    };
    for batch in &world.batches {
        let base = all.primitive.positions.len() as u32;
        all.primitive.positions.extend(&batch.primitive.positions);
        all.primitive
            .indices
            .extend(batch.primitive.indices.iter().map(|i| i + base));
    }
    world.batches = vec![all];
    world.details.clear();
    world
}

/// The points below the pixels of a picture from straight above, at a given height.
struct FromAbove {
    center: [f32; 3],
    height: f32,
}

impl FromAbove {
    fn new(world: &World) -> Self {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for (_, cell) in world.graph.indoor_cells() {
            for k in 0..3 {
                low[k] = low[k].min(cell.aabb[0][k]);
                high[k] = high[k].max(cell.aabb[1][k]);
            }
        }
        let size = [high[0] - low[0], high[2] - low[2]];
        Self {
            center: [0, 1, 2].map(|k| (low[k] + high[k]) * 0.5),
            height: size[1].max(size[0] * SIZE[1] as f32 / SIZE[0] as f32) * 1.02,
        }
    }

    fn projection(&self) -> Projection {
        let aspect = SIZE[0] as f32 / SIZE[1] as f32;
        // Not quite straight down, where no direction is upright.
        Projection::parallel(self.center, [0.0, -1.0, -1e-3], self.height, aspect, 100.0)
    }

    /// Returns pixels above the floors of rooms, well inside, with the cell and the point of the floor.
    fn pixels(&self, world: &World) -> Vec<([u32; 2], CellId, [f32; 3])> {
        let projection = self.projection();
        let mut out = Vec::new();
        for (id, cell) in world.graph.indoor_cells() {
            let [low, high] = cell.aabb;
            for (u, v) in [(0.3, 0.3), (0.7, 0.3), (0.5, 0.7), (0.2, 0.8), (0.8, 0.8)] {
                let p = [
                    low[0] + (high[0] - low[0]) * u,
                    low[1],
                    low[2] + (high[2] - low[2]) * v,
                ];
                let [x, y] = projection.place(p).unwrap();
                out.push((
                    [(x * SIZE[0] as f32) as u32, (y * SIZE[1] as f32) as u32],
                    id,
                    p,
                ));
            }
        }
        out
    }
}

/// Linear color of a floor without a material.
const PLAIN: [f32; 3] = [0.45, 0.35, 0.25];

/// Returns the color whose hue a painted pixel has; `plain` is the pixel without paint.
fn nearest_hue(pixel: [u8; 4], plain: [u8; 4], colors: &[[f32; 3]]) -> usize {
    // Compare directions: shading makes colors darker but keeps their hue, apart from the tint of the light.
    let unit = |c: [f32; 3]| {
        let length = c.iter().map(|x| x * x).sum::<f32>().sqrt().max(1e-6);
        c.map(|x| x / length)
    };
    let linear = |c: u8| (f32::from(c) / 255.0).powf(2.2);
    let tint = [0, 1, 2].map(|k| linear(plain[k]).max(1e-3) / PLAIN[k]);
    let p = unit([0, 1, 2].map(|k| linear(pixel[k]) / tint[k]));
    let distance = |c: &[f32; 3]| {
        let c = unit(c.map(|x| x.powf(2.2)));
        (0..3).map(|k| (c[k] - p[k]).powi(2)).sum::<f32>()
    };
    (0..colors.len())
        .min_by(|&a, &b| distance(&colors[a]).total_cmp(&distance(&colors[b])))
        .unwrap()
}

#[test]
fn a_floor_of_many_rooms_is_painted_by_each_of_them() {
    let world = shared();
    let mut studio = Studio::new(gpu(), &world).unwrap();
    studio.add_light(&world).unwrap();
    let above = FromAbove::new(&world);
    let list = studio.everything();
    let style = Style {
        paint: Paint::Cells,
        shadows: false,
        dark_corners: false,
        daylight: false,
        // Below the ceilings.
        cut_above: above.center[1],
    };
    let frame = Frame {
        projection: above.projection(),
        list: &list,
        style,
        marks: &[],
    };
    let picture = studio.picture_of(&frame, SIZE).unwrap();
    let unpainted = Frame {
        style: Style {
            paint: Paint::Lit,
            ..style
        },
        ..frame
    };
    let plain = studio.picture_of(&unpainted, SIZE).unwrap();
    let colors: Vec<_> = (0..world.graph.cells.len() as u32)
        .map(|c| cell_paint(CellId(c)).map(|c| f32::from(c) / 255.0))
        .collect();
    let pixels = above.pixels(&world);
    let right = (pixels.iter())
        .filter(|([x, y], cell, _)| {
            let [pixel, plain] = [&picture, &plain].map(|p| p.pixel(*x, *y));
            nearest_hue(pixel, plain, &colors) == cell.idx()
        })
        .count();
    assert!(pixels.len() > 100);
    // Two of 42 hues may be confused where colors are rounded.
    assert!(
        right * 100 >= pixels.len() * 95,
        "{right} of {}",
        pixels.len()
    );
}

#[test]
fn what_is_seen_of_a_floor_looks_as_it_does_and_what_is_not_is_gray_or_red() {
    let world = shared();
    let mut studio = Studio::new(gpu(), &world).unwrap();
    studio.add_light(&world).unwrap();
    let above = FromAbove::new(&world);
    let (first, cell) = world.graph.indoor_cells().next().unwrap();
    let eye = [0, 1, 2].map(|k| (cell.aabb[0][k] + cell.aabb[1][k]) * 0.5);
    let ahead = [above.center[0] - eye[0], 0.0, above.center[2] - eye[2]];
    let camera = Camera {
        eye,
        toward: ahead,
        fov_y: 1.2,
    };
    let view = camera.view(1.5).unwrap();
    let list = studio.everything();
    let frame = Frame {
        projection: above.projection(),
        list: &list,
        style: Style {
            shadows: false,
            dark_corners: false,
            daylight: false,
            cut_above: above.center[1],
            ..Style::default()
        },
        marks: &[],
    };
    let picture = studio.explained(&view, &frame, SIZE).unwrap();
    let (mut bright, mut gray, mut red) = (0, 0, 0);
    for ([x, y], id, p) in above.pixels(&world) {
        let [r, g, b, _] = picture.pixel(x, y).map(i32::from);
        // The gray is bluish.
        let (is_gray, is_red) = (b > r + 8, r > g + 30);
        let is_bright = !is_gray && !is_red;
        let d = [p[0] - eye[0], p[2] - eye[2]];
        let is_behind = d[0] * ahead[0] + d[1] * ahead[2] < -0.5;
        assert!(
            !(is_behind && (is_bright || is_red)),
            "{p:?} is behind the eye: {r} {g} {b}"
        );
        assert!(!(is_bright && id != first) || studio.sight.locate(p).is_some());
        bright += u32::from(is_bright);
        red += u32::from(is_red);
        gray += u32::from(is_gray);
    }
    assert!(bright > 2 && gray > 10 && red > 10, "{bright} {gray} {red}");
    // Afterwards, pictures explain nothing.
    let plain = studio.picture_of(&frame, SIZE).unwrap();
    assert!(
        above
            .pixels(&world)
            .iter()
            .all(|([x, y], ..)| plain.pixel(*x, *y)[1] > 130)
    );
}

/// Returns the mean brightness of a picture, 0 to 255.
fn brightness(picture: &Picture) -> f64 {
    let sum: u64 = picture.rgba.chunks_exact(4).map(|p| u64::from(p[1])).sum();
    sum as f64 / f64::from(picture.width * picture.height)
}

#[test]
fn light_does_not_depend_on_what_is_culled() {
    let world = room_grid(&GridParams::offices(60, 3));
    let mut studio = Studio::new(gpu(), &world).unwrap();
    let mut rng = Rng::new(5);
    let indoors: Vec<_> = world.graph.indoor_cells().map(|(_, c)| c.aabb).collect();
    let cameras: Vec<Camera> = (0..12)
        .map(|_| {
            let [low, high] = indoors[rng.below(indoors.len())];
            let angle = rng.range(0.0, std::f64::consts::TAU) as f32;
            Camera {
                eye: [0, 1, 2].map(|k| low[k] + (high[k] - low[k]) * rng.range(0.2, 0.8) as f32),
                toward: [angle.cos(), -0.1, angle.sin()],
                fov_y: 1.2,
            }
        })
        .collect();
    let shot = |studio: &mut Studio, camera: &Camera, culling| {
        (studio.picture(camera, culling, Style::default(), &[], SIZE)).unwrap()
    };
    let flat: Vec<Picture> = (cameras.iter())
        .map(|c| shot(&mut studio, c, Culling::Portals))
        .collect();
    studio.add_light(&world).unwrap();
    for (camera, flat) in cameras.iter().zip(&flat) {
        let [all, portals] =
            [Culling::Everything, Culling::Portals].map(|c| shot(&mut studio, camera, c));
        let differing = (all.rgba.chunks_exact(4).zip(portals.rgba.chunks_exact(4)))
            .filter(|(a, b)| a != b)
            .count();
        // An edge between two triangles may be rounded to either.
        assert!(differing <= 4, "{differing} pixels of {camera:?}");
        assert_ne!(&all, flat, "the light of places is another");
        let b = brightness(&all);
        assert!((40.0..235.0).contains(&b), "neither night nor glare: {b}");
    }
}

#[test]
fn glass_mirrors_the_sky_at_a_grazing_angle_and_is_seen_through_from_before() {
    use enfilade_geom::scene::{Material, Primitive};
    let mut world = World::default();
    world.materials.push(Material {
        base_color: [0.0, 0.0, 0.0, 0.25],
        transparent: true,
        ..Material::default()
    });
    // A horizontal pane over a black floor.
    world.materials.push(Material {
        base_color: [0.0, 0.0, 0.0, 1.0],
        ..Material::default()
    });
    for (height, material) in [(0.0, 0), (-1.0, 1)] {
        let corner = |x: f32, z: f32| [x * 200.0, height, z * 200.0];
        let primitive = Primitive {
            positions: vec![
                corner(-1.0, -1.0),
                corner(-1.0, 1.0),
                corner(1.0, 1.0),
                corner(1.0, -1.0),
            ],
            indices: vec![0, 1, 2, 0, 2, 3],
            material: Some(material),
            ..Primitive::default()
        };
        world.batches.push(Batch {
            primitive,
            ..Batch::default()
        });
    }
    let mut studio = Studio::new(gpu(), &world).unwrap();
    let style = Style {
        dark_corners: false,
        ..Style::default()
    };
    let mut green_at = |look: [f32; 3]| {
        let camera = Camera::looking_at([0.0, 1.5, 0.0], look);
        let picture = studio.picture(&camera, Culling::Everything, style, &[], SIZE);
        picture.unwrap().pixel(SIZE[0] / 2, SIZE[1] / 2)[1]
    };
    let (below, far) = (green_at([0.01, 0.0, 0.0]), green_at([40.0, 0.0, 0.0]));
    assert!(below < 110, "black shows through: {below}");
    assert!(far > 180, "the sky is mirrored: {far}");
}

#[test]
fn a_walk_begins_where_it_can_go_on() {
    let mut world = room_grid(&GridParams::offices(30, 1));
    let sight = enfilade_runtime::Sight::build(&world).unwrap();
    let whole = walk_cameras(&world, &sight, 20, 1.0);
    assert_eq!(whole.len(), 20);
    let (first, _) = world.graph.indoor_cells().next().unwrap();
    assert_eq!(sight.locate(whole[0].eye), Some(first));
    // Its first cell becomes a closed pocket.
    let portals = world.graph.portals.clone();
    for cell in &mut world.graph.cells {
        cell.portals
            .retain(|p| !portals[p.idx()].cells.contains(&first));
    }
    let rest = walk_cameras(&world, &sight, 20, 1.0);
    assert_eq!(rest.len(), 20);
}
