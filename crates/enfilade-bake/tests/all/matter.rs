//! Separation of rooms from the insides of solids.

use enfilade_bake::{BakeConfig, BakeContext, BakeOutput, Silent, bake};
use enfilade_geom::DVec3;
use enfilade_geom::scene::{Material, Object, Role, Scene};
use enfilade_testkit::solid::{MeshBuilder, aabb};

/// Adds the mesh that `build` makes as an object.
fn add(scene: &mut Scene, role: Role, build: impl FnOnce(&mut MeshBuilder)) {
    if scene.materials.is_empty() {
        scene.materials.push(Material::default());
    }
    let mut mesh = MeshBuilder::new(0);
    build(&mut mesh);
    scene.meshes.push(mesh.build("", &[]));
    scene.objects.push(Object {
        name: String::new(),
        mesh: scene.meshes.len() as u32 - 1,
        transform: enfilade_geom::DMat4::IDENTITY,
        role,
        reason: String::new(),
        filling: None,
        node: None,
    });
}

fn block(scene: &mut Scene, min: [f64; 3], max: [f64; 3]) {
    add(scene, Role::Structural, |m| {
        m.cuboid(aabb(min, max));
    });
}

fn baked(scene: &Scene) -> BakeOutput {
    bake(
        scene,
        &BakeConfig::default(),
        &BakeContext::new(&Silent, None),
    )
    .unwrap()
}

fn n_indoors(baked: &BakeOutput) -> usize {
    let cells = &baked.world.graph.cells;
    cells.iter().filter(|c| !c.outdoor).count()
}

fn is_indoors(baked: &BakeOutput, p: [f64; 3]) -> bool {
    let graph = &baked.world.graph;
    let cell = graph.locator.locate(DVec3::from(p));
    cell.is_some_and(|c| !graph[c].outdoor)
}

/// Turns over the triangles for whose number `is_turned` returns `true`.
fn turned(mut scene: Scene, is_turned: impl Fn(usize) -> bool) -> Scene {
    let mut n = 0;
    for mesh in &mut scene.meshes {
        for part in &mut mesh.primitives {
            for t in part.indices.chunks_exact_mut(3) {
                if is_turned(n) {
                    t.swap(1, 2);
                }
                n += 1;
            }
        }
    }
    scene
}

/// The same scene with its surfaces facing correctly, inside out, and randomly.
fn three_ways(scene: &Scene) -> [(&'static str, Scene); 3] {
    let mixed = |n: usize| (n.wrapping_mul(2_654_435_761) >> 7) & 1 == 1;
    [
        ("outward", scene.clone()),
        ("inside out", turned(scene.clone(), |_| true)),
        ("anyhow", turned(scene.clone(), mixed)),
    ]
}

/// A building of two rooms of 6 m × 3 m × 6 m with a door between them and a door to the open, and
/// the given blocks in it.
fn house(things: &[([f64; 3], [f64; 3])]) -> Scene {
    let mut scene = Scene::default();
    add(&mut scene, Role::Structural, |m| {
        m.carved(
            &[aabb([-0.3, -0.3, -0.3], [12.5, 3.3, 6.3])],
            &[
                aabb([0.0, 0.0, 0.0], [6.0, 3.0, 6.0]),
                aabb([6.2, 0.0, 0.0], [12.2, 3.0, 6.0]),
                aabb([6.0, 0.0, 2.5], [6.2, 2.0, 3.4]),
                aabb([-0.3, 0.0, 2.5], [0.0, 2.0, 3.4]),
            ],
        );
    });
    for &(min, max) in things {
        block(&mut scene, min, max);
    }
    scene
}

// Covers V1.
#[test]
fn things_that_stand_in_rooms_are_solid_whichever_way_they_face() {
    // Clear of the walls, so that the rooms flow around: a block, a column from floor to ceiling, and
    // two that intersect.
    let scene = house(&[
        ([2.0, 0.0, 1.0], [3.5, 1.5, 2.5]),
        ([2.0, -0.1, 4.0], [3.4, 3.1, 5.4]),
        ([8.0, 0.02, 1.5], [9.5, 1.7, 3.0]),
        ([8.8, 0.02, 2.2], [10.4, 1.6, 4.0]),
    ]);
    for (how, scene) in three_ways(&scene) {
        let baked = baked(&scene);
        assert_eq!(n_indoors(&baked), 2, "{how}");
        for p in [[2.8, 0.7, 1.8], [2.7, 1.5, 4.7], [9.1, 0.8, 2.6]] {
            assert!(!is_indoors(&baked, p), "{p:?} of a model facing {how}");
        }
        let said = baked.notes.iter().filter(|n| n.contains("closed solid"));
        assert_eq!(said.count(), 1, "{how}: {:?}", baked.notes);
    }
}

#[test]
fn a_room_behind_walls_stays_a_room_without_any_opening() {
    let mut scene = house(&[]);
    // An annex with walls, and no door.
    add(&mut scene, Role::Structural, |m| {
        m.carved(
            &[aabb([14.0, -0.3, 0.0], [18.0, 3.3, 4.0])],
            &[aabb([14.3, 0.0, 0.3], [17.7, 3.0, 3.7])],
        );
    });
    for (how, scene) in three_ways(&scene) {
        let baked = baked(&scene);
        assert!(is_indoors(&baked, [16.0, 1.5, 2.0]), "{how}");
        assert_eq!(n_indoors(&baked), 3, "{how}");
    }
}

#[test]
fn a_room_sunk_into_solid_ground_stays_a_room() {
    // Solid ground with a vault in it, beside a house.
    let mut scene = house(&[]);
    block(&mut scene, [14.0, -1.0, -2.0], [24.0, 8.0, 8.0]);
    add(&mut scene, Role::Structural, |m| {
        m.carved(
            &[aabb([16.0, 0.0, 0.0], [22.0, 4.0, 6.0])],
            &[aabb([16.4, 0.4, 0.4], [21.6, 3.6, 5.6])],
        );
    });
    let baked = baked(&scene);
    assert!(is_indoors(&baked, [19.0, 2.0, 3.0]));
    assert!(!is_indoors(&baked, [15.0, 2.0, 3.0]));
}

#[test]
fn blocks_on_open_land_have_no_rooms() {
    let mut scene = Scene::default();
    add(&mut scene, Role::Structural, |m| {
        m.sheet(aabb([0.0, 0.0, 0.0], [40.0, 0.0, 30.0]), 1, true, &[]);
    });
    block(&mut scene, [4.0, -0.5, 4.0], [10.0, 5.0, 10.0]);
    block(&mut scene, [8.0, -0.5, 7.0], [14.0, 7.0, 14.0]);
    // One stands on the land without an underside: a tower, so that little of it is missing.
    add(&mut scene, Role::Structural, |m| {
        let (lo, hi) = ([24.0, 0.0, 10.0], [28.0, 16.0, 14.0]);
        m.sheet(aabb([lo[0], hi[1], lo[2]], hi), 1, true, &[]);
        for (axis, across) in [(0, lo[0]), (0, hi[0]), (2, lo[2]), (2, hi[2])] {
            let (mut min, mut max) = (lo, hi);
            (min[axis], max[axis]) = (across, across);
            m.sheet(aabb(min, max), axis, across == hi[axis], &[]);
        }
    });
    for (how, scene) in three_ways(&scene) {
        if how == "inside out" {
            // Like a level of closed rooms modelled from inside: indistinguishable.
            continue;
        }
        let baked = baked(&scene);
        assert_eq!(n_indoors(&baked), 0, "{how}: {:?}", baked.notes);
        assert!(!baked.notes.is_empty(), "{how}");
    }
}

#[test]
fn a_closed_box_that_is_all_there_is_is_a_room_and_two_are_blocks() {
    let mut scene = Scene::default();
    block(&mut scene, [0.0; 3], [4.0, 3.0, 5.0]);
    for (how, scene) in three_ways(&scene) {
        let baked = baked(&scene);
        assert_eq!(n_indoors(&baked), 1, "{how}");
        let is_said = baked.notes.iter().any(|n| n.contains("the whole scene"));
        assert_eq!(is_said, how != "inside out", "{how}: {:?}", baked.notes);
    }
    block(&mut scene, [8.0, 0.0, 0.0], [12.0, 3.0, 5.0]);
    assert_eq!(n_indoors(&baked(&scene)), 0);
}

#[test]
fn rooms_of_single_sheets_stay_whichever_way_these_face() {
    // Three rooms in a row, of sheets, with doors between them and to the open.
    let mut scene = Scene::default();
    add(&mut scene, Role::Structural, |m| {
        let door = |x: f64| aabb([x, 0.0, 2.0], [x, 2.0, 2.9]);
        m.sheet(aabb([0.0, 0.0, 0.0], [15.0, 0.0, 5.0]), 1, true, &[]);
        m.sheet(aabb([0.0, 3.0, 0.0], [15.0, 3.0, 5.0]), 1, false, &[]);
        m.sheet(aabb([0.0, 0.0, 0.0], [15.0, 3.0, 0.0]), 2, true, &[]);
        m.sheet(aabb([0.0, 0.0, 5.0], [15.0, 3.0, 5.0]), 2, false, &[]);
        for x in [0.0, 5.0, 10.0, 15.0] {
            let holes = if x < 15.0 { vec![door(x)] } else { Vec::new() };
            m.sheet(aabb([x, 0.0, 0.0], [x, 3.0, 5.0]), 0, x < 9.0, &holes);
        }
    });
    for (how, scene) in three_ways(&scene) {
        assert_eq!(n_indoors(&baked(&scene)), 3, "{how}");
    }
}

#[test]
fn a_suite_of_sheets_without_a_way_out_is_rooms() {
    // Two rooms joined by a doorway, and beside them one with a window: all of sheets, 2.7 m high.
    let mut scene = Scene::default();
    add(&mut scene, Role::Structural, |m| {
        let window = aabb([7.0, 1.0, 8.0], [9.0, 2.0, 8.0]);
        let doorway = aabb([2.0, 0.0, 4.0], [3.0, 2.1, 4.0]);
        m.sheet(aabb([0.0, 0.0, 0.0], [10.0, 0.0, 8.0]), 1, true, &[]);
        m.sheet(aabb([0.0, 2.7, 0.0], [10.0, 2.7, 8.0]), 1, true, &[]);
        m.sheet(aabb([0.0, 0.0, 0.0], [10.0, 2.7, 0.0]), 2, true, &[]);
        m.sheet(aabb([0.0, 0.0, 8.0], [10.0, 2.7, 8.0]), 2, true, &[window]);
        m.sheet(aabb([0.0, 0.0, 4.0], [6.0, 2.7, 4.0]), 2, true, &[doorway]);
        for x in [0.0, 6.0, 10.0] {
            m.sheet(aabb([x, 0.0, 0.0], [x, 2.7, 8.0]), 0, true, &[]);
        }
    });
    let baked = baked(&scene);
    for p in [[2.0, 1.2, 2.0], [2.0, 1.2, 6.0], [8.0, 1.2, 4.0]] {
        assert!(is_indoors(&baked, p), "{p:?}: {:?}", baked.notes);
    }
    assert_eq!(n_indoors(&baked), 3);
}

#[test]
fn a_crate_does_not_turn_the_level_around_it_to_matter() {
    // Two halls and the doorway between them, as the cavity alone.
    let mut scene = Scene::default();
    add(&mut scene, Role::Structural, |m| {
        let cavity = [
            aabb([0.0, 0.0, 0.0], [7.0, 3.0, 7.0]),
            aabb([7.0, 0.0, 2.5], [7.5, 2.2, 4.5]),
            aabb([7.5, 0.0, 0.0], [14.5, 3.0, 7.0]),
        ];
        m.carved(&cavity, &[]);
    });
    let mut scene = turned(scene, |_| true);
    block(&mut scene, [2.0, 0.1, 2.0], [4.0, 2.1, 4.0]);
    // All surfaces face away from the air.
    let scene = turned(scene, |_| true);
    let baked = baked(&scene);
    assert_eq!(n_indoors(&baked), 2, "{:?}", baked.notes);
    assert!(is_indoors(&baked, [1.0, 1.5, 1.0]) && is_indoors(&baked, [12.0, 1.5, 1.0]));
    assert!(!is_indoors(&baked, [3.0, 1.0, 3.0]));
}

#[test]
fn a_hollow_piece_of_wall_with_a_hole_in_its_end_is_no_room() {
    let mut scene = house(&[]);
    // 0.9 m thick, which leaves no room for a person.
    add(&mut scene, Role::Structural, |m| {
        let ([x0, y0, z0], [x1, y1, z1]) = ([20.0, 0.0, 0.0], [24.0, 3.0, 0.9]);
        let hole = aabb([x0, 1.0, 0.25], [x0, 1.5, 0.65]);
        for (axis, at) in [(0, x0), (0, x1), (1, y0), (1, y1), (2, z0), (2, z1)] {
            let (mut min, mut max) = ([x0, y0, z0], [x1, y1, z1]);
            (min[axis], max[axis]) = (at, at);
            let holes = if at == x0 { vec![hole] } else { Vec::new() };
            m.sheet(aabb(min, max), axis, [x1, y1, z1][axis] == at, &holes);
        }
    });
    let baked = baked(&scene);
    assert_eq!(n_indoors(&baked), 2, "{:?}", baked.notes);
    let is_said = |n: &String| n.contains("hollow piece of wall");
    assert!(baked.notes.iter().any(is_said), "{:?}", baked.notes);
}

/// A hall of 16 m × 10 m under an arched roof: two ends are walls whose tops follow the arch in level
/// strips, and the sides are panes from post to post.
fn glazed_hall() -> Scene {
    let mut scene = Scene::default();
    let top = |i: i32| 6.0 - 0.02 * f64::from(i * i);
    block(&mut scene, [-0.3, -0.3, -0.3], [16.3, 0.0, 10.3]);
    for x in [-0.3, 16.0] {
        add(&mut scene, Role::Structural, |m| {
            let strips: Vec<_> = (-10..10)
                .map(|i| {
                    let z = 5.0 + f64::from(i) * 0.5;
                    let height = top(if i < 0 { i } else { i + 1 });
                    aabb([x, 0.0, z], [x + 0.3, height, z + 0.5])
                })
                .collect();
            m.carved(&strips, &[]);
        });
    }
    add(&mut scene, Role::Structural, |m| {
        let strips: Vec<_> = (-10..10)
            .map(|i| {
                let z = 5.0 + f64::from(i) * 0.5;
                let height = top(if i < 0 { i } else { i + 1 });
                aabb([-0.3, height, z], [16.3, 6.3, z + 0.5])
            })
            .collect();
        m.carved(&strips, &[]);
    });
    for z in [0.0, 9.9] {
        for i in 0..8 {
            let x = f64::from(i) * 2.0;
            block(&mut scene, [x, 0.0, z], [x + 0.1, 4.0, z + 0.1]);
            add(&mut scene, Role::Detail, |m| {
                m.cuboid(aabb([x + 0.1, 0.0, z + 0.04], [x + 2.0, 4.0, z + 0.06]));
            });
        }
    }
    scene
}

#[test]
fn panes_close_a_hall_however_many_they_are() {
    let with_panes = baked(&glazed_hall());
    assert_eq!(n_indoors(&with_panes), 1);
    assert!(is_indoors(&with_panes, [8.0, 1.5, 5.0]));
}

/// Seven rooms of ten walls, 2.7 m high, with doors: nothing below, nothing above.
fn walls_alone() -> Scene {
    let mut scene = Scene::default();
    let wall = |min: [f64; 2], max: [f64; 2]| aabb([min[0], 0.0, min[1]], [max[0], 2.7, max[1]]);
    let door = |min: [f64; 2], max: [f64; 2]| aabb([min[0], 0.0, min[1]], [max[0], 2.1, max[1]]);
    add(&mut scene, Role::Structural, |m| {
        m.carved(
            &[
                wall([0.0, 0.0], [12.2, 0.2]),
                wall([0.0, 10.2], [12.2, 10.4]),
                wall([0.0, 0.0], [0.2, 10.4]),
                wall([12.0, 0.0], [12.2, 10.4]),
                wall([0.0, 4.0], [12.2, 4.2]),
                wall([0.0, 6.0], [12.2, 6.2]),
                wall([4.0, 0.0], [4.2, 4.0]),
                wall([8.0, 0.0], [8.2, 4.0]),
                wall([4.0, 6.2], [4.2, 10.4]),
                wall([8.0, 6.2], [8.2, 10.4]),
            ],
            &[
                door([1.5, 4.0], [2.4, 4.2]),
                door([5.5, 4.0], [6.4, 4.2]),
                door([9.5, 4.0], [10.4, 4.2]),
                door([1.5, 6.0], [2.4, 6.2]),
                door([5.5, 6.0], [6.4, 6.2]),
                door([9.5, 6.0], [10.4, 6.2]),
                door([0.0, 4.6], [0.2, 5.5]),
            ],
        );
    });
    scene
}

#[test]
fn walls_alone_enclose_rooms_and_what_was_supplied_is_said() {
    let scene = walls_alone();
    let baked = baked(&scene);
    assert_eq!(n_indoors(&baked), 7);
    for (what, ends) in [("ceilings", "top"), ("floors", "foot")] {
        let is_said = |n: &String| n.starts_with(what) && n.contains(ends);
        assert!(baked.notes.iter().any(is_said), "{:?}", baked.notes);
    }
}
