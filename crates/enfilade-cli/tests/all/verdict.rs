//! The last line of a bake, refusals of worlds without rooms, and of scenes that lie on their side.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use enfilade_geom::scene::Scene;
use enfilade_geom::{Aabb, DVec3};
use enfilade_testkit::mixed;

fn folder(name: &str) -> PathBuf {
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR"))
        .join("verdict")
        .join(name);
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir).unwrap();
    dir
}

fn run(dir: &Path, line: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
    command.current_dir(dir).args(line.split_whitespace());
    command.output().unwrap()
}

fn said(done: &Output) -> String {
    String::from_utf8_lossy(&done.stderr).into_owned()
}

fn printed(done: &Output) -> String {
    String::from_utf8_lossy(&done.stdout).into_owned()
}

/// Two rooms as OBJ, each vertex mapped.
fn rooms(map: impl Fn([f64; 3]) -> [f64; 3]) -> String {
    obj(&mixed::two_rooms().scene, map)
}

fn obj(scene: &Scene, map: impl Fn([f64; 3]) -> [f64; 3]) -> String {
    let (mut text, mut first) = (String::new(), 1);
    for object in &scene.objects {
        writeln!(text, "o {}", object.name).unwrap();
        for part in &scene.meshes[object.mesh as usize].primitives {
            for t in part.placed_triangles(object.transform) {
                for p in t {
                    let [x, y, z] = map(p.to_array());
                    writeln!(text, "v {x:.4} {y:.4} {z:.4}").unwrap();
                }
                writeln!(text, "f {first} {} {}", first + 1, first + 2).unwrap();
                first += 3;
            }
        }
    }
    text
}

#[test]
fn the_last_line_says_how_far_to_trust_the_world() {
    let dir = folder("trust");
    fs::write(dir.join("a.obj"), rooms(|p| p)).unwrap();
    let done = run(&dir, "bake a.obj -o a.glb");
    let text = printed(&done);
    let last = text.lines().last().unwrap();
    assert!(last.starts_with("trust: good: 2 rooms"), "{text}");
    let done = run(&dir, "bake a.obj -o a.glb --json");
    let report: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(report["verdict"]["trust"], "good");
}

#[test]
fn a_scene_on_its_side_is_refused_with_all_options_in_one_message() {
    let dir = folder("side");
    let z_up = |factor: f64| move |[x, y, z]: [f64; 3]| [x, -z, y].map(|v| v * factor);
    fs::write(dir.join("m.obj"), rooms(z_up(1.0))).unwrap();
    let done = run(&dir, "bake m.obj -o m.glb");
    assert_eq!(done.status.code(), Some(1));
    assert!(said(&done).contains("--up z"), "{}", said(&done));
    assert!(!dir.join("m.glb").exists());
    let done = run(&dir, "bake m.obj -o m.glb --up z");
    assert!(
        printed(&done).contains("trust: good: 2 rooms"),
        "{}",
        said(&done)
    );
    fs::write(dir.join("mm.obj"), rooms(z_up(1000.0))).unwrap();
    let done = run(&dir, "bake mm.obj -o mm.glb");
    assert!(said(&done).contains("--unit mm --up z"), "{}", said(&done));
    let done = run(&dir, "bake mm.obj -o mm.glb --unit mm --up z");
    assert!(
        printed(&done).contains("trust: good: 2 rooms"),
        "{}",
        said(&done)
    );
    // Whoever says that y is up means it.
    let done = run(&dir, "bake m.obj -o y.glb --up y --allow-empty");
    assert!(done.status.success(), "{}", said(&done));
}

#[test]
fn feet_are_seen_by_the_height_of_the_doors() {
    let dir = folder("feet");
    let feet = |p: [f64; 3]| p.map(|v| v / 0.3048);
    let scene = mixed::double_door_corridor().scene;
    fs::write(dir.join("a.obj"), obj(&scene, feet)).unwrap();
    let done = run(&dir, "bake a.obj -o a.glb --allow-empty");
    assert!(printed(&done).contains("--unit ft"), "{}", printed(&done));
}

#[test]
fn a_unit_in_which_a_room_is_lost_is_not_advised() {
    let dir = folder("lost");
    let feet = |p: [f64; 3]| p.map(|v| v / 0.3048);
    let corridor = obj(&mixed::double_door_corridor().scene, feet);
    // A room of its own, so high: in feet nobody can stand in the lower one.
    let told = |high: f64| {
        let walls = [
            [[199.0, -1.0, -1.0], [213.0, 0.0, 13.0]],
            [[199.0, high, -1.0], [213.0, high + 1.0, 13.0]],
            [[199.0, 0.0, -1.0], [200.0, high, 13.0]],
            [[212.0, 0.0, -1.0], [213.0, high, 13.0]],
            [[200.0, 0.0, -1.0], [212.0, high, 0.0]],
            [[200.0, 0.0, 12.0], [212.0, high, 13.0]],
        ];
        let text = with_boxes(&corridor, &walls).replace("usemtl blue", "usemtl stone");
        fs::write(dir.join("a.obj"), text).unwrap();
        printed(&run(&dir, "bake a.obj -o a.glb"))
    };
    let text = told(9.0);
    assert!(text.contains("--unit ft"), "{text}");
    let text = told(4.0);
    assert!(
        text.contains("trust: low") && !text.contains("--unit"),
        "{text}"
    );
}

#[test]
fn feet_are_seen_by_the_steps_of_stairs() {
    let dir = folder("steps");
    // Its two doorways without leaves show nothing.
    let scene = mixed::stair_hall().scene;
    let feet = |p: [f64; 3]| p.map(|v| v / 0.3048);
    fs::write(dir.join("a.obj"), obj(&scene, feet)).unwrap();
    let done = run(&dir, "bake a.obj -o a.glb");
    assert!(done.status.success(), "{}", said(&done));
    assert!(said(&done).contains("--unit ft"), "{}", said(&done));
    let last = printed(&done);
    assert!(last.contains("trust: low") && last.contains("--unit ft"));
    let done = run(&dir, "bake a.obj -o b.glb --unit ft");
    assert!(!said(&done).contains("--unit"), "{}", said(&done));
    assert!(printed(&done).contains("trust: good: 4 rooms"));
}

#[test]
fn a_world_without_rooms_is_written_only_if_asked_for() {
    let dir = folder("empty");
    fs::write(dir.join("flat.obj"), "v 0 0 0\nv 9 0 0\nv 0 0 9\nf 1 2 3\n").unwrap();
    let done = run(&dir, "bake flat.obj -o flat.glb");
    assert_eq!(done.status.code(), Some(1));
    assert!(said(&done).contains("no room was found, and nothing was written"));
    assert!(!dir.join("flat.glb").exists());
    let done = run(&dir, "bake flat.obj -o flat.glb --allow-empty");
    assert!(done.status.success());
    assert!(printed(&done).contains("trust: none: no rooms"));
    // A triangle is not a room in any unit, and whichever axis points up: what was tried in vain is not advised.
    for vain in ["--unit", "--up"] {
        assert!(!printed(&done).contains(vain), "{}", printed(&done));
    }
    assert!(printed(&done).contains("--leak-path"), "{}", printed(&done));
    let done = run(&dir, "plan flat.glb -o flat.svg");
    assert!(said(&done).contains("has no room"), "{}", said(&done));
}

#[test]
fn another_scene_is_told_before_anything_is_counted() {
    let dir = folder("other");
    fs::write(dir.join("a.obj"), rooms(|p| p)).unwrap();
    fs::write(dir.join("b.obj"), rooms(|[x, y, z]| [x * 1.3, y, z * 0.9])).unwrap();
    assert!(run(&dir, "bake a.obj -o a.glb").status.success());
    let done = run(&dir, "verify a.glb --source b.obj --rays 1000 --sight 0");
    assert_eq!(done.status.code(), Some(1));
    assert!(said(&done).contains("another scene"), "{}", said(&done));
    assert!(!said(&done).contains("breaks a promise"), "{}", said(&done));
    let done = run(&dir, "verify a.glb --source a.obj --rays 1000 --sight 0");
    assert!(done.status.success(), "{}", said(&done));
}

#[test]
fn a_scene_whose_vertices_the_bake_moved_is_told_apart_from_another() {
    let dir = folder("moved");
    // Each vertex by itself, by up to a millimeter.
    let noise = |x: f64, by: f64| 1e-3 * ((x * 7919.0 + by).sin() * 43758.5453).fract();
    let count = std::cell::Cell::new(0.0);
    let moved = |p: [f64; 3]| {
        count.set(count.get() + 1.0);
        [0, 1, 2].map(|k| p[k] + noise(p[k] + k as f64, count.get()))
    };
    fs::write(dir.join("a.obj"), rooms(moved)).unwrap();
    assert!(run(&dir, "bake a.obj -o a.glb").status.success());
    let done = run(&dir, "verify a.glb --source a.obj --rays 1000 --sight 0");
    let text = said(&done);
    assert_eq!(done.status.code(), Some(1), "{text}");
    assert!(text.contains("moved its vertices"), "{text}");
    assert!(!text.contains("another scene"), "{text}");
    let done = run(&dir, "verify a.glb --rays 1000 --sight 0");
    assert!(done.status.success(), "{}", said(&done));
}

/// Adds boxes of a material of their own to an OBJ.
fn with_boxes(text: &str, boxes: &[[[f64; 3]; 2]]) -> String {
    let mut text = format!("usemtl stone\n{text}");
    let mut first = 1 + text.lines().filter(|l| l.starts_with("v ")).count();
    for (i, [min, max]) in boxes.iter().enumerate() {
        writeln!(text, "o Cube.{i:03}\nusemtl blue").unwrap();
        for t in Aabb::new(DVec3::from(*min), DVec3::from(*max)).triangles() {
            for p in t {
                writeln!(text, "v {} {} {}", p.x, p.y, p.z).unwrap();
            }
            writeln!(text, "f {first} {} {}", first + 1, first + 2).unwrap();
            first += 3;
        }
    }
    text
}

#[test]
fn boxes_that_may_be_volumes_of_an_engine_are_named_if_rooms_are_better_without_them() {
    let dir = folder("volumes");
    let told = |boxes: &[[[f64; 3]; 2]]| {
        fs::write(dir.join("a.obj"), with_boxes(&rooms(|p| p), boxes)).unwrap();
        said(&run(&dir, "bake a.obj -o a.glb --allow-empty"))
    };
    let world = enfilade::open(&{
        fs::write(dir.join("b.obj"), rooms(|p| p)).unwrap();
        run(&dir, "bake b.obj -o b.glb");
        dir.join("b.glb")
    });
    let world = world.unwrap();
    let within = world.graph.rooms().map(|(_, c)| {
        let [min, max] = c.aabb.map(|p| DVec3::from(p.map(f64::from)));
        [(min + 0.15).to_array(), (max - 0.15).to_array()]
    });
    let within: Vec<_> = within.collect();
    let text = told(&within);
    assert!(
        text.contains("--detail-name 'Cube.000' --detail-name 'Cube.001'"),
        "{text}"
    );
    let [min, _] = within[0];
    let pillar = [min, [min[0] + 0.4, min[1] + 2.0, min[2] + 0.4]];
    let text = told(&[pillar]);
    assert!(!text.contains("volumes of an engine"), "{text}");
}

#[test]
fn what_was_left_out_by_name_is_proposed_if_rooms_are_better_with_it() {
    let dir = folder("kept");
    let told = |names: [&str; 2], n_boxes: usize| {
        let mut text = String::new();
        let [low, high] = names;
        for (name, [min, max]) in [
            ("Floor", [[-0.3, -0.3, -0.3], [8.3, 0.0, 5.3]]),
            ("Ceiling", [[-0.3, 3.0, -0.3], [8.3, 3.3, 5.3]]),
            (low, [[-0.3, 0.0, -0.3], [0.0, 3.0, 5.3]]),
            (high, [[8.0, 0.0, -0.3], [8.3, 3.0, 5.3]]),
            ("South", [[0.0, 0.0, -0.3], [8.0, 3.0, 0.0]]),
            ("North", [[0.0, 0.0, 5.0], [8.0, 3.0, 5.3]]),
        ]
        .into_iter()
        .take(n_boxes)
        {
            text = with_boxes(&text, &[[min, max]]).replace("Cube.000", name);
        }
        fs::write(dir.join("a.obj"), text).unwrap();
        let done = run(&dir, "bake a.obj -o a.glb");
        said(&done) + &printed(&done)
    };
    // Thinner than what people go into, so part of the building whatever its name.
    let text = told(["Storage zone", "Stack volume"], 6);
    assert!(text.contains("good: 1 room"), "{text}");
    let text = told(["Occluder west", "Collider east"], 6);
    let proposal = "--structural-name 'Collider east' --structural-name 'Occluder west'";
    assert!(text.contains(proposal), "{text}");
    // Without the other walls nothing is better with it.
    let text = told(["Occluder west", ""], 3);
    assert!(!text.contains("better with it"), "{text}");
}
