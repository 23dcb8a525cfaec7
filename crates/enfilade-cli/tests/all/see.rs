//! Runs `see` and `verify --sight` on worlds made in code.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use enfilade_cpg::World;
use enfilade_cpg::wire::encode_glb;
use enfilade_testkit::{GridParams, room_grid};
use serde_json::Value;

fn enfilade(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(args)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// Writes a world to a file of this test alone.
fn file(name: &str, world: &World) -> String {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::write(&path, encode_glb(world).unwrap()).unwrap();
    path.to_str().unwrap().to_owned()
}

/// Two rooms in a row along x with a doorway between them.
fn two_rooms() -> World {
    room_grid(&GridParams {
        size: [2, 1, 1],
        doors: 1.0,
        windows: 0.0,
        ..GridParams::offices(2, 1)
    })
}

#[test]
fn see_prints_what_is_seen_in_every_mode() {
    let world = two_rooms();
    let path = file("see.glb", &world);
    let outline = &world.graph.portals[0].outline;
    let middle = [0, 1, 2].map(|k| outline.iter().map(|p| p[k]).sum::<f32>() / 4.0);
    let eye = format!("{},{},{}", middle[0] - 1.5, middle[1], middle[2]);
    let look = format!("{},{},{}", middle[0], middle[1], middle[2]);
    let away = format!("{},{},{}", middle[0] - 3.0, middle[1], middle[2]);
    for mode in ["rect", "polygon", "polygon-k"] {
        let args = ["see", &path, "--eye", &eye, "--look", &look, "--fov", "70"];
        let done =
            enfilade(&[&args[..], &["--size", "640x480", "--mode", mode, "--json"]].concat());
        assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
        let report: Value = serde_json::from_slice(&done.stdout).unwrap();
        assert_eq!(report["eye_cell"], 0);
        assert_eq!(report["cells"], serde_json::json!([0, 1]));
        assert_eq!(report["portals"], serde_json::json!([0]));
        assert!(report["counts"]["triangles"].as_u64().unwrap() > 0);
        assert!(report["seconds"].as_f64().unwrap() > 0.0);
    }
    let done = enfilade(&["see", &path, "--eye", &eye, "--look", &away]);
    assert!(
        text(&done.stdout).contains("1 of 3 cells"),
        "{}",
        text(&done.stdout)
    );
    let done = enfilade(&["see", &path, "--eye", &eye, "--look", &away, "--fov", "270"]);
    assert!(
        text(&done.stdout).contains("2 of 3 cells"),
        "{}",
        text(&done.stdout)
    );
}

#[test]
fn wrong_views_are_wrong_usage_or_say_why() {
    let path = file("see-wrong.glb", &two_rooms());
    for (option, value) in [("--eye", "1,2"), ("--eye", "1,2,nan"), ("--size", "640x0")] {
        let mut args = vec!["see", &path, "--eye", "1,1,1", "--look", "2,1,1"];
        args.retain(|a| *a != option || option != "--eye");
        let args = if option == "--eye" {
            vec!["see", path.as_str(), "--eye", value, "--look", "2,1,1"]
        } else {
            [args, vec![option, value]].concat()
        };
        assert_eq!(enfilade(&args).status.code(), Some(2), "{args:?}");
    }
    for extra in [["--fov", "0"], ["--far", "0"], ["--fov", "nan"]] {
        let args = ["see", &path, "--eye", "1,1,1", "--look", "2,1,1"];
        let done = enfilade(&[&args[..], &extra].concat());
        assert_eq!(done.status.code(), Some(1), "{extra:?}");
        assert!(
            text(&done.stderr).contains("greater than 0"),
            "{}",
            text(&done.stderr)
        );
    }
    let done = enfilade(&["see", &path, "--eye", "1,1,1", "--look", "1,1,1"]);
    assert!(text(&done.stderr).contains("no direction"));
}

#[test]
fn verify_asks_the_run_time_and_catches_a_door_that_is_not_in_the_graph() {
    let world = two_rooms();
    let path = file("sight-good.glb", &world);
    let done = enfilade(&["verify", &path, "--rays", "100", "--sight", "200", "--json"]);
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    let report: Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(report["sight"]["missed"], 0);
    assert!(report["sight"]["hits"].as_u64().unwrap() > 10_000);

    let mut broken = world;
    broken.graph.portals.clear();
    for cell in &mut broken.graph.cells {
        cell.portals.clear();
    }
    let path = file("sight-broken.glb", &broken);
    let done = enfilade(&["verify", &path, "--rays", "1", "--sight", "200"]);
    assert_eq!(done.status.code(), Some(1));
    assert!(
        text(&done.stdout).contains("hits missed"),
        "{}",
        text(&done.stdout)
    );
    assert!(
        text(&done.stderr).contains("missing from the answers")
            || text(&done.stderr).contains("breaks"),
        "{}",
        text(&done.stderr)
    );
}
