//! Runs benchmarks on worlds made in code, and on invalid files.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use enfilade_cpg::World;
use enfilade_cpg::wire::encode_glb;
use enfilade_testkit::{GridParams, room_grid};
use serde_json::Value;

fn bench(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_enfilade-bench"))
        .args(args)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// Writes a world to a file used by this test only.
fn file(name: &str, world: &World) -> String {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::write(&path, encode_glb(world).unwrap()).unwrap();
    path.to_str().unwrap().to_owned()
}

/// Returns two rooms in a row along x with a doorway between them.
fn two_rooms() -> World {
    room_grid(&GridParams {
        size: [2, 1, 1],
        doors: 1.0,
        windows: 0.0,
        ..GridParams::offices(2, 1)
    })
}

#[test]
fn benches_print_tables() {
    let path = file("bench.glb", &two_rooms());
    let prt = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("bench.prt");
    fs::write(
        &prt,
        "PRT1\n2\n1\n4 0 1 (0 0 0 ) (0 64 0 ) (0 64 64 ) (0 0 64 )\n",
    )
    .unwrap();
    let prt = prt.to_str().unwrap();
    for (args, rows) in [
        (vec!["see", &path, prt, "--rooms", "20", "--views", "10"], 9),
        (vec!["tight", &path, "--views", "4", "--rays", "50"], 4),
        (vec!["maze", &path, "--views", "5"], 4),
        (vec!["los", &path, "--pairs", "50"], 1),
    ] {
        let done = bench(&args);
        assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
        let table = text(&done.stdout);
        let n = table.lines().filter(|l| l.starts_with("| ")).count();
        assert_eq!(n, rows + 2, "{table}");
    }
}

#[test]
fn rows_are_objects_with_json() {
    let path = file("json.glb", &two_rooms());
    let done = bench(&["los", &path, "--pairs", "50", "--json"]);
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    let row: Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(row["scene"], "json");
    assert_eq!(row["pairs"], 50.0);
    assert_eq!(row["differ"], 0.0);
}

#[test]
fn what_is_no_world_and_what_has_no_rooms_is_refused() {
    let whole = encode_glb(&two_rooms()).unwrap();
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    fs::write(dir.join("half.glb"), &whole[..whole.len() / 2]).unwrap();
    fs::write(dir.join("text.glb"), b"no world").unwrap();
    file("empty.glb", &World::default());
    for (name, words) in [
        ("half.glb", "cut off or damaged"),
        ("text.glb", "text.glb"),
        ("missing.glb", "missing.glb"),
        ("empty.glb", "no room"),
    ] {
        let path = dir.join(name);
        let path = path.to_str().unwrap();
        let done = bench(&["walkthrough", path, "--adapter", "software"]);
        let said = text(&done.stderr);
        assert_eq!(done.status.code(), Some(1), "{name}: {said}");
        assert!(said.contains(words), "{name}: {said}");
        assert!(!said.contains("panicked"), "{name}: {said}");
    }
    assert_eq!(bench(&["nothing"]).status.code(), Some(2));
}
