//! A square kilometer each of valleys, of hamlets among hollows, and of a city, with the places that are cells of their own.
//!
//! Places and shapes come from the same few numbers; nothing here looks at a height map.

use enfilade_geom::scene::{Mesh, Object, Primitive, Role, Scene};
use enfilade_geom::{Aabb, DMat4, DVec3};

use crate::land::{hills, quads};
use enfilade_demo::Rng;

/// Half the side of the land. [Units: wu]
const HALF: f64 = 500.0;
/// Height of places over the ground. [Units: wu]
const EYES: f64 = 1.5;

/// Open land with truth.
#[derive(Clone, Debug)]
pub struct OpenLand {
    /// Land and houses, all structural.
    pub scene: Scene,
    /// Valleys, streets, squares and courtyards: points in each, over the ground.
    pub places: Vec<Vec<DVec3>>,
    /// A point in each room of houses.
    pub rooms: Vec<DVec3>,
    /// A point in each block, which is matter.
    pub blocks: Vec<DVec3>,
}

impl OpenLand {
    fn new(ground: Mesh) -> Self {
        let mut land = Self {
            scene: Scene::default(),
            places: Vec::new(),
            rooms: Vec::new(),
            blocks: Vec::new(),
        };
        land.add(ground);
        land
    }

    fn add(&mut self, mesh: Mesh) {
        self.scene.objects.push(Object {
            name: mesh.name.clone(),
            mesh: self.scene.meshes.len() as u32,
            transform: DMat4::IDENTITY,
            role: Role::Structural,
            reason: String::new(),
            filling: None,
            node: None,
        });
        self.scene.meshes.push(mesh);
    }

    fn add_boxes(&mut self, name: &str, boxes: &[Aabb]) {
        let mut primitive = Primitive::default();
        for p in boxes.iter().flat_map(Aabb::triangles).flatten() {
            primitive.indices.push(primitive.positions.len() as u32);
            primitive.positions.push(p.as_vec3().to_array());
        }
        self.add(Mesh {
            name: name.to_owned(),
            primitives: vec![primitive],
        });
    }
}

/// Makes six winding valleys side by side, 160 m wide, that fall to the south; ridges between them are 11 to 18 m high.
#[must_use]
pub fn valleys() -> OpenLand {
    const WIDE: f64 = 160.0;
    const DEEP: f64 = 18.0;
    let axis = |k: i32, z: f64| f64::from(k) * WIDE - 400.0 + 25.0 * (z / 90.0).sin();
    let height = move |x: f64, z: f64| {
        let across = (x - axis(0, z)) / WIDE;
        let ridge = 0.5 - 0.5 * (std::f64::consts::TAU * across).cos();
        let pass = 0.8 + 0.2 * (z / 70.0 + 2.0 * across.round()).cos();
        let rough = 0.3 * (1.7 * x).sin() * (1.3 * z).sin();
        DEEP * ridge * pass - 0.03 * z + rough
    };
    let mut land = OpenLand::new(quads(8.0, height));
    let point = |k: i32, z: f64| {
        let x = axis(k, z);
        DVec3::new(x, height(x, z) + EYES, z)
    };
    let zs = [-350.0, -200.0, 0.0, 200.0, 350.0];
    land.places = (0..6).map(|k| zs.map(|z| point(k, z)).to_vec()).collect();
    land
}

/// Makes hollows between hills of 15 m, and hamlets of four houses with one room each on passes between them.
#[must_use]
pub fn hamlets() -> OpenLand {
    use std::f64::consts::{FRAC_PI_2, PI};
    let pass = |i: i32, k: i32| {
        let [i, k] = [i, k].map(f64::from);
        DVec3::new(70.0 * PI * i, 0.0, 50.0 * (FRAC_PI_2 + PI * k))
    };
    let passes = [(-1, -2), (1, 0), (0, 1), (-2, 0), (2, -2), (0, -3)].map(|(i, k)| pass(i, k));
    let mut land = OpenLand::new(hills(&passes, 0.0, 30.0, 8.0));
    for (m, n) in (-3_i32..3).flat_map(|m| (-3..4).map(move |n| (m, n))) {
        let at = DVec3::new(
            70.0 * (FRAC_PI_2 + PI * f64::from(m)),
            EYES - 15.0,
            50.0 * PI * f64::from(n),
        );
        let is_low = (m + n).rem_euclid(2) == 1;
        if is_low && at.x.abs() < 0.9 * HALF && at.z.abs() < 0.9 * HALF {
            land.places.push(vec![at]);
        }
    }
    for place in passes {
        for [x, z] in [[-9.0, -8.0], [9.0, -8.0], [-9.0, 8.0], [9.0, 8.0]] {
            let at = place + DVec3::new(x, 0.0, z);
            land.add_boxes("house", &house(at));
            land.rooms.push(at + DVec3::Y * EYES);
        }
    }
    land
}

/// The walls, floor and roof of a house of 8 × 7 m, with a doorway.
fn house(at: DVec3) -> Vec<Aabb> {
    let of = |[x0, y0, z0, x1, y1, z1]: [f64; 6]| {
        Aabb::new(at + DVec3::new(x0, y0, z0), at + DVec3::new(x1, y1, z1))
    };
    [
        [-4.0, -1.0, -3.5, 4.0, 0.1, 3.5],
        [-4.0, 2.7, -3.5, 4.0, 3.2, 3.5],
        [-4.0, 0.1, -3.5, -3.7, 2.7, 3.5],
        [3.7, 0.1, -3.5, 4.0, 2.7, 3.5],
        [-3.7, 0.1, -3.5, 3.7, 2.7, -3.2],
        [-3.7, 0.1, 3.2, -0.5, 2.7, 3.5],
        [0.5, 0.1, 3.2, 3.7, 2.7, 3.5],
        [-0.5, 2.2, 3.2, 0.5, 2.7, 3.5],
    ]
    .map(of)
    .to_vec()
}

/// Blocks along a side of the city.
const BLOCKS: usize = 12;
/// Distance from street to street. [Units: wu]
const PITCH: f64 = 80.0;
/// Widths of streets: every third is a wide one. [Units: wu]
const LANE: f64 = 12.0;
const STREET: f64 = 20.0;

/// Makes twelve by twelve blocks, 9 to 21 m high, some around courtyards, with streets, lanes and two squares.
#[must_use]
pub fn city(seed: u64) -> OpenLand {
    let mut land = OpenLand::new(quads(20.0, |_, _| 0.0));
    let mut rng = Rng::new(seed);
    let first = -0.5 * PITCH * BLOCKS as f64;
    let line = |k: usize| first + k as f64 * PITCH;
    let is_wide = |k: usize| k.is_multiple_of(3);
    let half = |k: usize| 0.5 * if is_wide(k) { STREET } else { LANE };
    let squares = [[3, 4], [4, 4], [8, 7]];
    let is_square = |i: usize, k: usize| squares.contains(&[i, k]);
    for i in 0..BLOCKS {
        for k in 0..BLOCKS {
            let [x0, x1] = [line(i) + half(i), line(i + 1) - half(i + 1)];
            let [z0, z1] = [line(k) + half(k), line(k + 1) - half(k + 1)];
            let height = 9.0 + (4.0 * rng.unit()).floor() * 4.0;
            if is_square(i, k) {
                continue;
            }
            let part = |x0: f64, z0: f64, x1: f64, z1: f64| {
                Aabb::new(DVec3::new(x0, -0.5, z0), DVec3::new(x1, height, z1))
            };
            let middle = DVec3::new(0.5 * (x0 + x1), EYES, 0.5 * (z0 + z1));
            if (i + 2 * k) % 5 == 0 {
                const WING: f64 = 13.0;
                land.add_boxes(
                    "block",
                    &[
                        part(x0, z0, x1, z0 + WING),
                        part(x0, z1 - WING, x1, z1),
                        part(x0, z0 + WING, x0 + WING, z1 - WING),
                        part(x1 - WING, z0 + WING, x1, z1 - WING),
                    ],
                );
                land.places.push(vec![middle]);
                land.blocks
                    .push(DVec3::new(x0 + 0.5 * WING, EYES, middle.z));
            } else {
                land.add_boxes("block", &[part(x0, z0, x1, z1)]);
                land.blocks.push(middle);
            }
        }
    }
    let square =
        |[i, k]: [usize; 2]| DVec3::new(line(i) + 0.5 * PITCH, EYES, line(k) + 0.5 * PITCH);
    land.places
        .push(vec![square(squares[0]), square(squares[1])]);
    land.places.push(vec![square(squares[2])]);
    for along_x in [false, true] {
        for at in 1..BLOCKS {
            // A block beside a part of the street.
            let is_open = |on: usize| {
                let beside = [at - 1, at].map(|side| if along_x { [on, side] } else { [side, on] });
                beside.iter().any(|&[i, k]| is_square(i, k))
            };
            let point = |on: usize| {
                let [across, along] = [line(at), line(on) + 0.5 * PITCH];
                let [x, z] = if along_x {
                    [along, across]
                } else {
                    [across, along]
                };
                DVec3::new(x, EYES, z)
            };
            // From crossing to crossing with a street as wide, or wider. Beside a square it is part of that.
            let length = if is_wide(at) { 3 } else { 1 };
            let parts = (0..BLOCKS).step_by(length).map(|from| from..from + length);
            let streets = parts.filter(|parts| !parts.clone().any(is_open));
            land.places
                .extend(streets.map(|parts| parts.map(point).collect()));
        }
    }
    land
}
