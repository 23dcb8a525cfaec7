//! A hospital wing made of brushes, of any size: storeys of wards along corridors.
//!
//! Stands for the clinic of Lefebvre & Hornus 2003, table 1, which is not public: rooms with doorways on
//! both sides of corridors, furnished with what they name (tables, beds, wash basins) as brushes of the
//! structure, so that the tree has to cut them.

use enfilade_geom::scene::{Entity, Mesh, Object, Primitive, Role, Scene};
use enfilade_geom::{ConvexSolid, DMat4, DVec3, Plane};

use crate::Rng;

/// Inner length and depth of a ward, width of a corridor, inner height, thickness of what is between.
/// [Units: wu]
const WARD: [f64; 2] = [4.0, 5.0];
const CORRIDOR: f64 = 2.5;
const HEIGHT: f64 = 3.0;
const WALL: f64 = 0.25;
/// Wards on one side of a corridor.
const PER_SIDE: usize = 10;

/// A clinic of about `n_polygons` polygons seen from inside; closed. Storeys are joined by a stairwell.
///
/// # Panics
/// Never: all brushes are boxes.
#[must_use]
pub fn clinic(n_polygons: usize, seed: u64) -> Scene {
    let mut rng = Rng::new(seed);
    let mut solids = Vec::new();
    // Counted: a storey of twenty wards has about this many.
    let n_storeys = ((n_polygons as f64 / 2020.0).round() as usize).max(1);
    let length = PER_SIDE as f64 * (WARD[0] + WALL) + WALL;
    let depth = 2.0 * WARD[1] + CORRIDOR + 4.0 * WALL;
    for storey in 0..n_storeys {
        let y = storey as f64 * (HEIGHT + WALL);
        let mut add = |min: [f64; 3], max: [f64; 3]| solids.push(boxed(min, max, y));
        // The floor, open above the stairwell of the storey below, which lies beside the corridor's end.
        let hole = [length - WALL, length - WALL + 3.0];
        add([-WALL, -WALL, -WALL], [length, 0.0, depth]);
        if storey == 0 {
            add([length, -WALL, -WALL], [hole[1] + WALL, 0.0, depth]);
        }
        if storey + 1 == n_storeys {
            add(
                [-WALL, HEIGHT, -WALL],
                [hole[1] + WALL, HEIGHT + WALL, depth],
            );
        }
        // The stairwell's three outer walls and the end of the building.
        let z = [WARD[1] + WALL, WARD[1] + WALL + CORRIDOR];
        let top = HEIGHT + WALL;
        add(
            [hole[1], -WALL, z[0] - WALL],
            [hole[1] + WALL, top, z[1] + WALL],
        );
        add([length, -WALL, z[0] - WALL], [hole[1], top, z[0]]);
        add([length, -WALL, z[1]], [hole[1], top, z[1] + WALL]);
        add([length - WALL, 0.0, -WALL], [length, top, z[0]]);
        add([length - WALL, 0.0, z[1]], [length, top, depth]);
        add([-WALL, 0.0, -WALL], [0.0, top, depth]);
        for side in 0..2 {
            // The outer wall, and the corridor's with doorways.
            let (inner, outer) = if side == 0 {
                ([z[0] - WALL, z[0]], [-WALL, 0.0])
            } else {
                ([z[1], z[1] + WALL], [depth - WALL, depth])
            };
            add([0.0, 0.0, outer[0]], [length - WALL, top, outer[1]]);
            let ward = if side == 0 {
                [0.0, inner[0]]
            } else {
                [inner[1], outer[0]]
            };
            for k in 0..PER_SIDE {
                let x = k as f64 * (WARD[0] + WALL);
                let door = x + 0.5 + 2.0 * rng.unit();
                add([x, 0.0, inner[0]], [door, top, inner[1]]);
                add([door + 1.0, 0.0, inner[0]], [x + WARD[0], top, inner[1]]);
                add([door, 2.1, inner[0]], [door + 1.0, top, inner[1]]);
                add(
                    [x + WARD[0], 0.0, ward[0].min(inner[0])],
                    [x + WARD[0] + WALL, top, ward[1].max(inner[1])],
                );
                furnish(&mut rng, [x, ward[0]], &mut add);
            }
        }
    }
    scene_of(solids, n_storeys)
}

/// Beds, a table on legs, a wash basin on a foot.
fn furnish(rng: &mut Rng, [x, z]: [f64; 2], add: &mut impl FnMut([f64; 3], [f64; 3])) {
    let dx = 0.4 * rng.unit();
    for bed in 0..2 {
        let z = z + 0.6 + 2.2 * bed as f64 + 0.3 * rng.unit();
        add([x, 0.0, z], [x + 2.0, 0.5, z + 0.9]);
        add([x, 0.5, z], [x + 0.1, 1.0, z + 0.9]);
    }
    let (tx, tz) = (x + 2.5 + dx, z + 1.0 + rng.unit());
    add([tx, 0.7, tz], [tx + 0.8, 0.75, tz + 1.2]);
    for (lx, lz) in [(0.0, 0.0), (0.7, 0.0), (0.0, 1.1), (0.7, 1.1)] {
        add([tx + lx, 0.0, tz + lz], [tx + lx + 0.1, 0.7, tz + lz + 0.1]);
    }
    let bx = x + 3.0 + dx;
    add([bx, 0.8, z + 4.4], [bx + 0.5, 0.95, z + 4.8]);
    add([bx + 0.2, 0.0, z + 4.5], [bx + 0.3, 0.8, z + 4.6]);
}

fn boxed(min: [f64; 3], max: [f64; 3], y: f64) -> ConvexSolid {
    let up = DVec3::new(0.0, y, 0.0);
    let (min, max) = (DVec3::from(min) + up, DVec3::from(max) + up);
    let planes: Vec<Plane> = [DVec3::X, DVec3::Y, DVec3::Z]
        .into_iter()
        .flat_map(|n| [Plane::through(max, n), Plane::through(min, -n)])
        .collect();
    ConvexSolid::from_planes(&planes, 1e5, 1e-6).expect("a box bounds something")
}

fn scene_of(solids: Vec<ConvexSolid>, n_storeys: usize) -> Scene {
    let mut primitive = Primitive::default();
    for w in solids.iter().flat_map(|s| &s.faces) {
        let first = primitive.positions.len() as u32;
        let corners = w.points.iter().map(|p| p.as_vec3().to_array());
        primitive.positions.extend(corners);
        let n = w.points.len() as u32;
        let fan = (1..n - 1).flat_map(|k| [first, first + k, first + k + 1]);
        primitive.indices.extend(fan);
    }
    Scene {
        meshes: vec![Mesh {
            name: "clinic".into(),
            primitives: vec![primitive],
        }],
        objects: vec![Object {
            name: "clinic".into(),
            mesh: 0,
            transform: DMat4::IDENTITY,
            role: Role::Structural,
            reason: "map: brushes of worldspawn".into(),
        }],
        solids,
        entities: (0..n_storeys)
            .map(|s| Entity {
                class: "light".into(),
                position: Some(DVec3::new(
                    1.0,
                    1.5 + s as f64 * (HEIGHT + WALL),
                    WARD[1] + 1.0,
                )),
                ..Entity::default()
            })
            .collect(),
        ..Scene::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_grows_as_asked_and_its_lights_hang_in_air() {
        let (small, large) = (clinic(1, 1), clinic(11_500, 1));
        let n = |s: &Scene| s.solids.len();
        assert!(n(&large) >= 5 * n(&small), "{} {}", n(&small), n(&large));
        for e in &large.entities {
            let p = e.position.unwrap();
            assert!(!large.solids.iter().any(|s| s.contains(p, -1e-3)), "{p}");
        }
    }
}
