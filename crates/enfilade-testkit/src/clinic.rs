//! A clinic made of brushes, of any size: storeys of wards along corridors, in three wings around a hall.
//!
//! Stands for the clinic of Lefebvre & Hornus 2003, table 1, which is not public: rooms with doorways on
//! both sides of corridors, with the furniture that they list (tables, beds, wash basins) as structural
//! brushes, so that the tree has to cut them. Wings stand at 120 degrees to each other, none along an axis,
//! and furniture stands at any angle, as in real life, so that planes of one piece run through others: the
//! situation in which a tree cuts polygons.

use enfilade_geom::scene::{Entity, Mesh, Object, Primitive, Role, Scene};
use enfilade_geom::{ConvexSolid, DMat4, DVec3, Plane};

use crate::Rng;

/// Inner length and depth of a ward, width of a corridor, inner height, thickness of walls and slabs.
/// [Units: wu]
const WARD: [f64; 2] = [4.0, 5.0];
const CORRIDOR: f64 = 2.5;
const HEIGHT: f64 = 3.0;
const WALL: f64 = 0.25;
/// Wards on one side of a corridor.
const PER_SIDE: usize = 6;
/// Number of wings around the hall, and distance of its walls from its center. [Units: wu]
const WINGS: usize = 3;
const HALL: f64 = 4.25;
/// Angle of the first wing to the x axis, in radians: none of the three lies along an axis.
const TURN: f64 = 0.2;
/// Number of boards of a shelf.
const BOARDS: usize = 2;
/// Number of brush faces per storey seen from inside, as counted.
const PER_STOREY: f64 = 3750.0;

/// A frame: a position and a rotation about the vertical axis.
#[derive(Clone, Copy)]
struct Frame {
    origin: DVec3,
    /// In radians.
    angle: f64,
}

impl Frame {
    fn turned(&self, v: DVec3) -> DVec3 {
        let (s, c) = self.angle.sin_cos();
        DVec3::new(v.x * c - v.z * s, v.y, v.x * s + v.z * c)
    }

    fn at(&self, p: DVec3) -> DVec3 {
        self.origin + self.turned(p)
    }

    /// Returns a frame given in this one.
    fn within(&self, origin: DVec3, angle: f64) -> Self {
        Self {
            origin: self.at(origin),
            angle: self.angle + angle,
        }
    }

    /// Returns the solid behind all planes, each a point and a normal of this frame.
    fn solid(&self, planes: &[(DVec3, DVec3)]) -> ConvexSolid {
        let planes: Vec<Plane> = planes
            .iter()
            .map(|&(p, n)| Plane::through(self.at(p), self.turned(n)))
            .collect();
        ConvexSolid::from_planes(&planes, 1e5, 1e-6).expect("it bounds something")
    }

    fn boxed(&self, min: [f64; 3], max: [f64; 3]) -> ConvexSolid {
        let (min, max) = (DVec3::from(min), DVec3::from(max));
        let planes: Vec<_> = [DVec3::X, DVec3::Y, DVec3::Z]
            .into_iter()
            .flat_map(|n| [(max, n), (min, -n)])
            .collect();
        self.solid(&planes)
    }

    /// An upright prism of `n` sides around the frame's axis, which are `apothem` away.
    fn prism(&self, n: usize, apothem: f64, [low, high]: [f64; 2]) -> ConvexSolid {
        let mut planes = vec![(DVec3::Y * high, DVec3::Y), (DVec3::Y * low, -DVec3::Y)];
        planes.extend((0..n).map(|k| {
            let (s, c) = (k as f64 / n as f64 * std::f64::consts::TAU).sin_cos();
            let normal = DVec3::new(c, 0.0, s);
            (normal * apothem, normal)
        }));
        self.solid(&planes)
    }
}

/// A closed clinic with about `n_polygons` faces of brushes seen from inside. The hall is open through all storeys.
///
/// # Panics
/// Never: all brushes are bounded.
#[must_use]
pub fn clinic(n_polygons: usize, seed: u64) -> Scene {
    let mut rng = Rng::new(seed);
    let mut solids = Vec::new();
    let n_storeys = ((n_polygons as f64 / PER_STOREY).round() as usize).max(1);
    let ground = Frame {
        origin: DVec3::ZERO,
        angle: TURN,
    };
    let top = n_storeys as f64 * (HEIGHT + WALL);
    // Wider than the hall, whose walls stand on the floor and carry the roof.
    solids.push(ground.prism(WINGS, HALL + 0.1, [-WALL, 0.0]));
    solids.push(ground.prism(WINGS, HALL + 0.1, [top - WALL, top]));
    solids.push(ground.prism(8, 0.4, [0.0, top - WALL]));
    for storey in 0..n_storeys {
        for k in 0..WINGS {
            let wing = wing_frame(storey, k);
            wing_of(&mut rng, &wing, storey + 1 == n_storeys, &mut solids);
        }
    }
    scene_of(solids, n_storeys)
}

/// Frame of a wing: at the hall's wall, its floor, the outer wall of its first side of wards.
fn wing_frame(storey: usize, k: usize) -> Frame {
    let turn = TURN + k as f64 / WINGS as f64 * std::f64::consts::TAU;
    let hall = Frame {
        origin: DVec3::Y * (storey as f64 * (HEIGHT + WALL)),
        angle: turn,
    };
    let middle = WARD[1] + WALL + 0.5 * CORRIDOR;
    hall.within(DVec3::new(HALL, 0.0, -middle), 0.0)
}

/// A storey of one wing: wards on both sides of a corridor that is open to the hall.
fn wing_of(rng: &mut Rng, wing: &Frame, is_top: bool, solids: &mut Vec<ConvexSolid>) {
    let length = PER_SIDE as f64 * (WARD[0] + WALL) + WALL;
    let depth = 2.0 * WARD[1] + CORRIDOR + 4.0 * WALL;
    let top = HEIGHT + WALL;
    let z = [WARD[1] + WALL, WARD[1] + WALL + CORRIDOR];
    let mut add = |min, max| solids.push(wing.boxed(min, max));
    add([-WALL, -WALL, -WALL], [length, 0.0, depth]);
    if is_top {
        add([-WALL, HEIGHT, -WALL], [length, top, depth]);
    }
    // The hall's wall, a little longer than the hall's side, and the end of the wing.
    let over = 1.1;
    add([-WALL, -WALL, -over], [0.0, top, z[0]]);
    add([-WALL, -WALL, z[1]], [0.0, top, z[0] + z[1] + over]);
    add([length - WALL, 0.0, -WALL], [length, top, depth]);
    for side in 0..2 {
        // The outer wall, and the corridor's with doorways.
        let (inner, outer) = if side == 0 {
            ([z[0] - WALL, z[0]], [-WALL, 0.0])
        } else {
            ([z[1], z[1] + WALL], [depth - WALL, depth])
        };
        let mut add = |min, max| solids.push(wing.boxed(min, max));
        add([0.0, 0.0, outer[0]], [length - WALL, top, outer[1]]);
        let ward = if side == 0 {
            [0.0, inner[0]]
        } else {
            [inner[1], outer[0]]
        };
        for k in 0..PER_SIDE {
            let x = k as f64 * (WARD[0] + WALL);
            let door = x + 0.5 + 2.0 * rng.unit();
            let mut add = |min, max| solids.push(wing.boxed(min, max));
            add([x, 0.0, inner[0]], [door, top, inner[1]]);
            add([door + 1.0, 0.0, inner[0]], [x + WARD[0], top, inner[1]]);
            add([door, 2.1, inner[0]], [door + 1.0, top, inner[1]]);
            add(
                [x + WARD[0], 0.0, ward[0].min(inner[0])],
                [x + WARD[0] + WALL, top, ward[1].max(inner[1])],
            );
            furnish(rng, &wing.within(DVec3::new(x, 0.0, ward[0]), 0.0), solids);
        }
    }
}

/// Adds beds with slanted heads, a table on legs, a round stool, a wash basin on a foot, each at its own angle.
fn furnish(rng: &mut Rng, ward: &Frame, solids: &mut Vec<ConvexSolid>) {
    for bed in 0..2 {
        let z = 0.7 + 2.1 * f64::from(bed) + 0.3 * rng.unit();
        let turn = 0.3 * (rng.unit() - 0.5);
        let bed = ward.within(DVec3::new(0.3, 0.0, z), turn);
        solids.push(bed.boxed([0.0, 0.0, 0.0], [1.8, 0.5, 0.9]));
        // The head leans back: two planes are slanted.
        let lean = DVec3::new(1.0, 0.2, 0.0).normalize();
        let (low, high) = (DVec3::new(0.15, 0.5, 0.0), DVec3::new(0.0, 1.0, 0.9));
        solids.push(bed.solid(&[
            (low, lean),
            (low - DVec3::X * 0.1, -lean),
            (high, DVec3::Y),
            (low, -DVec3::Y),
            (high, DVec3::Z),
            (low, -DVec3::Z),
        ]));
    }
    let turn = std::f64::consts::TAU * rng.unit();
    let table = ward.within(DVec3::new(2.95, 0.0, 1.5 + 0.4 * rng.unit()), turn);
    solids.push(table.boxed([-0.4, 0.7, -0.6], [0.4, 0.75, 0.6]));
    for (x, z) in [(-0.35, -0.55), (0.25, -0.55), (-0.35, 0.45), (0.25, 0.45)] {
        solids.push(table.boxed([x, 0.0, z], [x + 0.1, 0.7, z + 0.1]));
    }
    let stool = ward.within(DVec3::new(2.6 + 0.8 * rng.unit(), 0.0, 3.0), turn);
    solids.push(stool.prism(6, 0.2, [0.0, 0.45]));
    // Four posts through the boards of a shelf that stands away from the wall.
    let place = DVec3::new(1.0 + rng.unit(), 0.0, 4.3);
    let shelf = ward.within(place, 0.4 * (rng.unit() - 0.5));
    for board in 0..BOARDS {
        let y = 0.1 + 0.5 * board as f64;
        solids.push(shelf.boxed([-0.5, y, -0.2], [0.5, y + 0.03, 0.2]));
    }
    for (x, z) in [(-0.45, -0.15), (0.4, -0.15), (-0.45, 0.1), (0.4, 0.1)] {
        solids.push(shelf.boxed([x, 0.0, z], [x + 0.05, 1.8, z + 0.05]));
    }
    let basin = ward.within(DVec3::new(3.3, 0.0, 4.3), 0.5 * rng.unit());
    solids.push(basin.boxed([-0.25, 0.8, -0.2], [0.25, 0.95, 0.2]));
    solids.push(basin.boxed([-0.05, 0.0, -0.05], [0.05, 0.8, 0.05]));
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
            filling: None,
            node: None,
        }],
        solids,
        entities: (0..n_storeys)
            .map(|s| Entity {
                class: "light".into(),
                position: Some(wing_frame(s, 0).at(DVec3::new(1.0, 1.5, WARD[1] + 1.0))),
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
    fn the_clinic_has_the_requested_size_and_its_lights_hang_in_air() {
        let (small, large) = (clinic(1, 1), clinic(11_500, 1));
        let n = |s: &Scene| s.solids.len();
        // One light per storey; all storeys are alike except the floor and the roof of the hall.
        assert_eq!([small.entities.len(), large.entities.len()], [1, 3]);
        let growth = n(&large) as f64 / n(&small) as f64;
        assert!((2.9..3.0).contains(&growth), "{growth}");
        for e in &large.entities {
            let p = e.position.unwrap();
            assert!(!large.solids.iter().any(|s| s.contains(p, -1e-3)), "{p}");
        }
    }
}
