//! Rooms built of blocks, and the parts of them taken for furniture.

use super::*;
use enfilade_geom::DMat4;
use enfilade_geom::scene::{Filling, Mesh, Object, Primitive};
use proptest::prelude::*;

#[derive(Debug, Default)]
pub(super) struct Build(Scene);

impl Build {
    pub(super) fn block(&mut self, name: &str, min: [f64; 3], max: [f64; 3]) -> &mut Self {
        self.blocks(name, &[(min, max)])
    }

    /// Adds boxes as one object that no rule decides.
    pub(super) fn blocks(&mut self, name: &str, boxes: &[([f64; 3], [f64; 3])]) -> &mut Self {
        let mut p = Primitive::default();
        for (min, max) in boxes {
            let first = p.positions.len() as u32;
            for i in 0..8 {
                let c = |k: usize| if i >> k & 1 == 1 { max[k] } else { min[k] } as f32;
                p.positions.push([c(0), c(1), c(2)]);
            }
            for f in [
                [0, 2, 3, 1],
                [4, 5, 7, 6],
                [0, 1, 5, 4],
                [2, 6, 7, 3],
                [0, 4, 6, 2],
                [1, 3, 7, 5],
            ] {
                let quad = [f[0], f[1], f[2], f[0], f[2], f[3]];
                p.indices.extend(quad.map(|i: u32| first + i));
            }
        }
        self.0.objects.push(Object {
            name: name.into(),
            mesh: self.0.meshes.len() as u32,
            transform: DMat4::IDENTITY,
            role: Role::Structural,
            reason: DEFAULT.into(),
            filling: None,
            node: None,
        });
        self.0.meshes.push(Mesh {
            name: String::new(),
            primitives: vec![p],
        });
        self
    }

    /// Gives the last object the role that a name decides, and what it fills by its name.
    pub(super) fn by_name(&mut self, filling: Option<Filling>) -> &mut Self {
        let object = self.0.objects.last_mut().unwrap();
        object.reason = format!("name: '{}'", object.name);
        object.filling = filling;
        self
    }

    /// Moves the vertices of the last object.
    pub(super) fn bent(&mut self, moved: impl Fn([f32; 3]) -> [f32; 3]) -> &mut Self {
        let primitives = &mut self.0.meshes.last_mut().unwrap().primitives;
        for p in primitives.iter_mut().flat_map(|p| &mut p.positions) {
            *p = moved(*p);
        }
        self
    }

    /// Builds a room of 5 x 4 x 2.6 m with a doorway in its east wall, which has three pieces.
    pub(super) fn room() -> Self {
        let mut b = Self::default();
        b.block("floor", [0.0, -0.2, 0.0], [5.0, 0.0, 4.0])
            .block("ceiling", [0.0, 2.6, 0.0], [5.0, 2.8, 4.0])
            .block("west", [-0.2, 0.0, 0.0], [0.0, 2.6, 4.0])
            .block("north", [0.0, 0.0, -0.2], [5.0, 2.6, 0.0])
            .block("south", [0.0, 0.0, 4.0], [5.0, 2.6, 4.2])
            .block("east, short", [5.0, 0.0, 0.0], [5.2, 2.6, 0.6])
            .block("east, long", [5.0, 0.0, 1.5], [5.2, 2.6, 4.0])
            .block("lintel", [5.0, 2.1, 0.6], [5.2, 2.6, 1.5])
            .block("threshold", [5.0, -0.2, 0.6], [5.2, 0.0, 1.5])
            .block("post", [2.0, 0.0, 2.0], [2.15, 2.6, 2.15]);
        b
    }

    /// Merges all objects into one mesh, with one reason for its role, or none.
    pub(super) fn merged(self, reason: &str) -> Self {
        let mut all = Primitive::default();
        for own in self.0.meshes.iter().flat_map(|m| &m.primitives) {
            let first = all.positions.len() as u32;
            all.positions.extend(&own.positions);
            all.indices.extend(own.indices.iter().map(|i| first + i));
        }
        let mut out = Self::default();
        out.blocks("", &[]);
        out.0.meshes[0].primitives = vec![all];
        if !reason.is_empty() {
            out.0.objects[0].reason = reason.into();
        }
        out
    }

    /// Adds the objects of another.
    pub(super) fn and(mut self, mut other: Self) -> Self {
        let n_meshes = self.0.meshes.len() as u32;
        other.0.objects.iter_mut().for_each(|o| o.mesh += n_meshes);
        self.0.meshes.append(&mut other.0.meshes);
        self.0.objects.append(&mut other.0.objects);
        self
    }

    pub(super) fn decided(mut self) -> Scene {
        decide(&mut self.0);
        self.0
    }

    pub(super) fn details(mut self) -> Vec<String> {
        decide(&mut self.0);
        let is_detail = |o: &&Object| o.role == Role::Detail;
        self.0
            .objects
            .iter()
            .filter(is_detail)
            .map(|o| o.name.clone())
            .collect()
    }

    /// Returns name and reason of each detail object.
    pub(super) fn reasons(mut self) -> Vec<String> {
        decide(&mut self.0);
        let details = self.0.objects.iter().filter(|o| o.role == Role::Detail);
        details
            .map(|o| format!("{}: {}", o.name, o.reason))
            .collect()
    }
}

#[test]
fn what_a_room_is_built_of_stays() {
    assert_eq!(Build::room().details(), [""; 0]);
}

// Covers S4.
#[test]
fn what_stands_in_a_room_is_detail() {
    let mut b = Build::room();
    b.blocks(
        "chair",
        &[
            ([3.0, 0.4, 3.0], [3.4, 0.45, 3.4]),
            ([3.0, 0.0, 3.0], [3.05, 0.4, 3.05]),
            ([3.35, 0.0, 3.35], [3.4, 0.4, 3.4]),
            ([3.0, 0.45, 3.0], [3.05, 0.9, 3.4]),
        ],
    )
    .block("lamp", [1.0, 2.3, 1.0], [1.3, 2.6, 1.3])
    .block("picture", [0.0, 1.2, 1.0], [0.03, 1.8, 1.8])
    .block("rug", [0.8, 0.0, 2.2], [1.6, 0.01, 3.2])
    .block("ball", [4.0, 1.0, 1.0], [4.2, 1.2, 1.2])
    // As high as the room: it may be a pier.
    .block("wardrobe", [3.0, 0.0, 0.0], [4.2, 2.6, 0.6]);
    assert_eq!(b.details(), ["chair", "lamp", "picture", "rug", "ball"]);
}

#[test]
fn the_reason_is_told() {
    let mut b = Build::room();
    b.block("stool", [3.0, 0.0, 3.0], [3.4, 0.5, 3.4]);
    decide(&mut b.0);
    let stool = b.0.objects.last().unwrap();
    assert_eq!(
        stool.reason,
        "small, hides little: 0.4 x 0.5 x 0.4 m, touches its bottom only"
    );
}

#[test]
fn a_railing_hides_little_and_a_wall_with_windows_does_not() {
    let mut b = Build::room();
    let bars: Vec<_> = (0..16)
        .map(|i| 0.3 * f64::from(i))
        .map(|x| ([x, 0.0, 8.0], [x + 0.012, 1.0, 8.012]))
        .collect();
    b.blocks("railing", &bars).blocks(
        "facade",
        &[
            ([0.0, 0.0, 9.0], [8.0, 0.4, 9.2]),
            ([0.0, 2.4, 9.0], [8.0, 2.6, 9.2]),
            ([0.0, 0.4, 9.0], [0.2, 2.4, 9.2]),
            ([7.8, 0.4, 9.0], [8.0, 2.4, 9.2]),
        ],
    );
    assert_eq!(b.details(), ["railing"]);
}

/// Walls split by material: the faces of a wall are one object, the reveals of its window another.
#[test]
fn the_reveals_of_a_window_stay() {
    let mut b = Build::room();
    let (x, y, z) = ([1.0, 2.2], [0.9, 2.1], [8.0, 8.2]);
    let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, k)| [x[i], y[k]]);
    let mut p = Primitive::default();
    for [x, y] in corners {
        p.positions
            .extend(z.map(|z| [x as f32, y as f32, z as f32]));
    }
    for i in 0..4 {
        let [a, b, c, d] = [2 * i, 2 * i + 1, (2 * i + 3) % 8, (2 * i + 2) % 8];
        p.indices.extend([a, b, c, a, c, d]);
    }
    // The wall's faces around the window, each a sheet.
    let sides = z.into_iter().flat_map(|z| {
        [
            ([0.0, 0.0, z], [1.0, 2.6, z]),
            ([2.2, 0.0, z], [4.0, 2.6, z]),
            ([1.0, 0.0, z], [2.2, 0.9, z]),
            ([1.0, 2.1, z], [2.2, 2.6, z]),
        ]
    });
    b.blocks("wall", &sides.collect::<Vec<_>>());
    b.0.objects.push(Object {
        name: "reveals".into(),
        mesh: b.0.meshes.len() as u32,
        ..b.0.objects[0].clone()
    });
    b.0.meshes.push(Mesh {
        name: String::new(),
        primitives: vec![p],
    });
    assert_eq!(b.details(), [""; 0]);
}

#[test]
fn walls_and_floors_of_small_tiles_stay() {
    let mut b = Build::default();
    for i in 0..6 {
        for k in 0..6 {
            let (x, z) = (f64::from(i), f64::from(k));
            b.block("tile", [x, -0.1, z], [x + 1.0, 0.0, z + 1.0]);
            b.block("roof", [x, 2.0, z], [x + 1.0, 2.1, z + 1.0]);
        }
        for y in [0.0, 1.0] {
            let x = f64::from(i);
            b.block("brick", [x, y, -0.2], [x + 1.0, y + 1.0, 0.0]);
        }
    }
    assert_eq!(b.details(), [""; 0]);
}

#[test]
fn a_heap_of_loose_blocks_is_no_furniture() {
    let mut b = Build::default();
    for i in 0..5 {
        let x = 2.0 * f64::from(i);
        b.block("block", [x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]);
    }
    decide(&mut b.0);
    assert!(b.0.objects.iter().all(|o| o.role == Role::Structural));
    assert!(b.0.objects[0].reason.contains("too much of the scene"));
}

#[test]
fn what_somebody_said_is_kept() {
    let mut b = Build::room();
    b.block("stool", [3.0, 0.0, 3.0], [3.4, 0.5, 3.4]);
    b.0.objects.last_mut().unwrap().reason = "name: 'wall'".into();
    assert_eq!(b.details(), [""; 0]);
}

/// Cuts at least 0.5 m apart, and both ends, in sixty-fourths of a meter, so that all turns and moves are exact
/// in `f32`.
fn cuts(length: u32) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(32..96_u32, 1..40).prop_map(move |steps| {
        let mut at = vec![0];
        for step in steps {
            let next = at.last().unwrap() + step;
            if next + 32 > length {
                break;
            }
            at.push(next);
        }
        at.push(length);
        at.into_iter().map(|v| f64::from(v) / 64.0).collect()
    })
}

/// A closed room of six slabs cut into tiles at random, with blocks standing in it.
fn tiled_room() -> impl Strategy<Value = Build> {
    let block = (0..192_u32, 0..192_u32, 8..64_u32, 8..96_u32, 8..64_u32);
    (192..512_u32, 128..208_u32, 192..512_u32)
        .prop_flat_map(move |(x, y, z)| {
            let blocks = prop::collection::vec(block.clone(), 0..6);
            (cuts(x), cuts(y), cuts(z), blocks)
        })
        .prop_map(|(x, y, z, blocks)| {
            let mut b = Build::default();
            let cuts = [&x, &y, &z];
            for axis in 0..3 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let end = *cuts[axis].last().unwrap();
                for (lo, hi) in [(-0.25, 0.0), (end, end + 0.25)] {
                    for cu in cuts[u].windows(2) {
                        for cv in cuts[v].windows(2) {
                            let (mut min, mut max) = ([0.0; 3], [0.0; 3]);
                            (min[axis], max[axis]) = (lo, hi);
                            (min[u], max[u]) = (cu[0], cu[1]);
                            (min[v], max[v]) = (cv[0], cv[1]);
                            b.block("tile", min, max);
                        }
                    }
                }
            }
            for (x, z, dx, dy, dz) in blocks {
                let m = |v: u32| f64::from(v) / 64.0;
                let (x, z) = (m(x).min(2.0), m(z).min(2.0));
                b.block("block", [x, 0.0, z], [x + m(dx), m(dy), z + m(dz)]);
            }
            b
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_tile_of_a_closed_room_is_furniture(room in tiled_room()) {
        let details = room.details();
        prop_assert!(details.iter().all(|name| name == "block"), "{details:?}");
    }

    #[test]
    fn neither_order_nor_place_nor_a_quarter_turn_changes_a_role(
        room in tiled_room(),
        turns in 0..4_usize,
        step in (-640..640_i32, -640..640_i32, -640..640_i32),
        first in any::<prop::sample::Index>(),
    ) {
        let [mut here, mut there] = [room.0.clone(), room.0];
        let turn = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]][turns];
        let place = DMat4::from_cols_array(&[
            turn[0], 0.0, -turn[1], 0.0,
            0.0, 1.0, 0.0, 0.0,
            turn[1], 0.0, turn[0], 0.0,
            f64::from(step.0) / 64.0, f64::from(step.1) / 64.0, f64::from(step.2) / 64.0, 1.0,
        ]);
        there.objects.iter_mut().for_each(|o| o.transform = place);
        let n = first.index(there.objects.len());
        there.objects.rotate_left(n);
        decide(&mut here);
        decide(&mut there);
        there.objects.rotate_right(n);
        let roles = |s: &Scene| s.objects.iter().map(|o| o.role).collect::<Vec<_>>();
        prop_assert_eq!(roles(&here), roles(&there));
    }

    #[test]
    fn only_what_nothing_is_said_about_gets_a_role(
        room in tiled_room(),
        said in prop::collection::vec(any::<Option<bool>>(), 1..20),
    ) {
        let mut scene = room.0;
        for (o, said) in scene.objects.iter_mut().zip(said.iter().cycle()) {
            if let Some(is_detail) = said {
                o.role = if *is_detail { Role::Detail } else { Role::Structural };
                o.reason = "said".into();
            }
        }
        let before = scene.clone();
        decide(&mut scene);
        prop_assert_eq!(format!("{:?}", scene.meshes), format!("{:?}", before.meshes));
        for (o, was) in scene.objects.iter().zip(&before.objects) {
            if was.reason == "said" {
                prop_assert_eq!(format!("{o:?}"), format!("{was:?}"));
            } else {
                prop_assert_eq!((&o.name, o.transform), (&was.name, was.transform));
                prop_assert!(o.role == Role::Structural || o.reason.contains(" m, "));
            }
        }
    }
}
