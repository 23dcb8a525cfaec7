//! Runs `verify` and `plan` on a hand-made house.

use crate::verify_common as common;

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use common::house;
use enfilade_cpg::wire::encode_glb;
use serde_json::Value;

fn enfilade(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(args)
        .output()
        .unwrap()
}

/// Writes a world to a file of this test alone.
fn file(name: &str, world: &enfilade_cpg::World) -> String {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::write(&path, encode_glb(world).unwrap()).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn a_good_world_passes_and_is_its_own_source() {
    let path = file("verify-good.glb", &house());
    for source in [&[][..], &["--source", &path][..]] {
        let args = [&["verify", &path, "--rays", "3000", "--json"][..], source].concat();
        let done = enfilade(&args);
        assert_eq!(
            done.status.code(),
            Some(0),
            "{}",
            String::from_utf8_lossy(&done.stderr)
        );
        let report: Value = serde_json::from_slice(&done.stdout).unwrap();
        assert_eq!(report["unsealed"], 0);
        assert_eq!(report["has_source"], !source.is_empty());
        assert!(
            report["sealed"]["judged"].as_u64().unwrap() > 500,
            "{report}"
        );
    }
}

/// Bakes a scene of this text, and returns what `verify` says of it.
fn verified(name: &str, text: &str) -> Output {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let [scene, world] = [name.to_owned(), format!("{name}.glb")]
        .map(|n| folder.join(n).to_str().unwrap().to_owned());
    fs::write(&scene, text).unwrap();
    let baked = enfilade(&["bake", &scene, "-o", &world, "--allow-empty"]);
    assert!(
        baked.status.success(),
        "{}",
        String::from_utf8_lossy(&baked.stderr)
    );
    enfilade(&["verify", &world, "--rays", "20000", "--sight", "200"])
}

#[test]
fn objects_without_names_of_their_own_break_no_promise() {
    let triangle = r#""buffers":[{"byteLength":36,"uri":"data:;base64,AAAAAAAAAAAAAAAAAACAQAAAAAAAAAAAAAAAAAAAQEAAAAAA"}],
        "bufferViews":[{"buffer":0,"byteLength":36}],"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}]"#;
    let primitives = r#""primitives":[{"attributes":{"POSITION":0}}]"#;
    for (k, nodes, meshes) in [
        // Below an object with a name: without any name, and with one of its mesh.
        (
            0,
            r#"{"mesh":0,"name":"Lamp","children":[1]},{"mesh":1,"translation":[3,0,1]}"#,
            ["", "", ""],
        ),
        (
            1,
            r#"{"mesh":0,"name":"Lamp","children":[1]},{"mesh":1,"translation":[3,0,1]}"#,
            ["", "Shade", ""],
        ),
        // Called as an object elsewhere.
        (
            2,
            r#"{"name":"Group","children":[1]},{"mesh":0},{"mesh":1,"name":"Chair","translation":[3,0,1]}"#,
            ["Chair", "", ""],
        ),
    ] {
        let meshes = meshes
            .map(|name| format!("{{{primitives},\"name\":\"{name}\"}}"))
            .join(",");
        let roots = if k == 2 { "0,2,3" } else { "0,2" };
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[{roots}]}}],"nodes":[{nodes},{{"mesh":2,"name":"Wall","scale":[2,2,2]}}],"meshes":[{meshes}],{triangle}}}"#
        );
        let done = verified(&format!("nameless-{k}.gltf"), &text);
        assert!(
            done.status.success(),
            "{k}: {}",
            String::from_utf8_lossy(&done.stdout)
        );
    }
}

#[test]
fn triangles_without_area_break_no_promise() {
    // A room seen from inside, and in it what is left of a box of no thickness.
    let mut text = String::new();
    for corner in 0..8 {
        let [x, y, z] = [
            corner / 4 * 5 - 2,
            corner / 2 % 2 * 3 - 1,
            corner % 2 * 4 - 2,
        ];
        text += &format!("v {x} {y} {z}\n");
    }
    text += "v 0 0 0\nv 9e-44 1.5 -9e-44\nv 5.266220431402358e-37 1.5000154972076416 -9e-44\n";
    for side in [
        "3 4 2 1", "6 8 7 5", "2 6 5 1", "7 8 4 3", "5 7 3 1", "4 8 6 2", "9 10 11", "9 9 10",
    ] {
        text += &format!("f {side}\n");
    }
    let done = verified("needle.obj", &text);
    assert!(
        done.status.success(),
        "{}",
        String::from_utf8_lossy(&done.stdout)
    );
}

#[test]
fn a_broken_promise_ends_in_exit_code_1_and_says_where() {
    let mut world = house();
    world.batches[5].cells = vec![common::A];
    let path = file("verify-broken.glb", &world);
    let done = enfilade(&["verify", &path, "--rays", "20000"]);
    assert_eq!(done.status.code(), Some(1));
    let (out, err) = (
        String::from_utf8(done.stdout).unwrap(),
        String::from_utf8(done.stderr).unwrap(),
    );
    assert!(
        out.contains("a triangle's batch lacks a cell that sees it; seen from cell-1"),
        "{out}"
    );
    assert!(err.contains("breaks a promise"), "{err}");
    assert_eq!(
        enfilade(&["verify", &path, "--tolerance", "0"])
            .status
            .code(),
        Some(2)
    );
}

#[test]
fn a_plan_is_written() {
    let path = file("plan.glb", &house());
    let svg = format!("{path}.svg");
    let done = enfilade(&["plan", &path, "-o", &svg, "--height", "1.5"]);
    assert_eq!(
        done.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&done.stderr)
    );
    assert!(fs::read_to_string(&svg).unwrap().contains("cut +1.50 m"));
    assert_eq!(
        enfilade(&["plan", &path, "-o", &svg, "--height", "-1"])
            .status
            .code(),
        Some(2)
    );
}

#[test]
fn a_detail_moved_within_its_room_is_found_by_the_source() {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let [scene, baked, moved] = ["house.glb", "baked.glb", "moved.glb"]
        .map(|name| dir.join(format!("verify-moved-{name}")));
    let house = enfilade_testkit::furnished_house().scene;
    fs::write(&scene, enfilade::import::export_glb(&house)).unwrap();
    let [scene, baked] = [&scene, &baked].map(|p| p.to_str().unwrap());
    let done = enfilade(&["bake", scene, "-o", baked, "--voxel", "0.2"]);
    assert!(done.status.success(), "{done:?}");
    let verify = |world: &str| {
        let quick = ["--rays", "0", "--sight", "0"];
        enfilade(&[&["verify", world, "--source", scene][..], &quick].concat())
    };
    let done = verify(baked);
    assert!(done.status.success(), "{done:?}");
    let mut world = enfilade::open(baked).unwrap();
    let n = world.details.len();
    world.details[n / 2].transform[13] += 0.01;
    enfilade::save(&moved, &world).unwrap();
    let done = verify(moved.to_str().unwrap());
    assert_eq!(done.status.code(), Some(1), "{done:?}");
    let out = String::from_utf8_lossy(&done.stdout);
    assert!(
        out.contains("the world lacks a detail of the source"),
        "{out}"
    );
}
