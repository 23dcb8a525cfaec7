//! Runs the living demo: a tower with a lift, people, doors, lamps. Covers W5, W3.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

fn enfilade(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(args)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

fn folder(name: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&dir);
    dir
}

#[test]
fn the_tower_is_walked_and_its_lift_goes_by_the_clock() {
    let dir = folder("living");
    let done = enfilade(&["demo", "--living", "-o", dir.to_str().unwrap()]);
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    let file = |name: &str| dir.join(name).to_str().unwrap().to_owned();
    let [world, living] = ["world.glb", "living.json"].map(file);
    // Up the stairs, two storeys.
    let ends = ["--from", "6.1,0.1,5.6", "--to", "2.6,6.5,8"];
    let path = enfilade(&[&["path", &world][..], &ends].concat());
    assert_eq!(path.status.code(), Some(0), "{}", text(&path.stderr));
    // Into the shaft's door: open while the lift waits, shut when it has gone.
    let picture = |time: &str| {
        let to = file(&format!("at-{time}.png"));
        let done = enfilade(&[
            "render", &world, "--living", &living, "--time", time, "--eye", "6,1.6,5", "--look",
            "6,1.3,2", "--size", "96x72", "-o", &to,
        ]);
        if text(&done.stderr).contains("no adapter") {
            return None;
        }
        assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
        Some(fs::read(to).unwrap())
    };
    let pictures: Option<Vec<_>> = ["4", "4", "12"].into_iter().map(picture).collect();
    if let Some(pictures) = pictures {
        assert!(pictures[0] == pictures[1], "equal times look equal");
        assert!(pictures[0] != pictures[2], "the lift has gone");
    }
}

#[test]
fn files_that_are_wrong_are_refused_by_name_and_place() {
    let dir = folder("living-bad");
    fs::create_dir_all(&dir).unwrap();
    let done = enfilade(&["demo", "-o", dir.to_str().unwrap()]);
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    let world = dir.join("world.glb");
    for (json, what) in [
        ("{", "EOF"),
        (r#"{"version":7}"#, "version 7"),
        (
            r#"{"version":1,"lifts":[{"world":"none.glb","stops":[[0,0,0],[0,3,0]]}]}"#,
            "none.glb",
        ),
        (
            r#"{"version":1,"people":{"count":2,"places":[[0,0,0]]}}"#,
            "people.places",
        ),
    ] {
        let living = dir.join("living.json");
        fs::write(&living, json).unwrap();
        let (world, living) = (world.to_str().unwrap(), living.to_str().unwrap());
        let to = dir.join("x.png");
        let to = to.to_str().unwrap();
        let done = enfilade(&[
            "render", world, "--living", living, "-o", to, "--size", "64x64",
        ]);
        assert_eq!(done.status.code(), Some(1), "{json}");
        let why = text(&done.stderr);
        assert!(why.contains(what), "{json}: {why}");
        assert!(!std::path::Path::new(to).exists());
    }
}
