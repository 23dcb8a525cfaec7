//! Runs the command on worlds made in code.

use crate::cpg_common as common;

use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use common::two_rooms;
use enfilade_cpg::wire::encode_glb;
use serde_json::{Value, json};

fn enfilade(args: &[&str], stdin: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    let text = stdin.to_owned();
    let writer = std::thread::spawn(move || {
        // The command may have stopped reading; the test checks the result of that.
        let _ = input.write_all(text.as_bytes());
    });
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    output
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// Writes `bytes` to a file of this test alone.
fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::write(&path, bytes).unwrap();
    path
}

fn two_rooms_file(name: &str) -> PathBuf {
    file(name, &encode_glb(&two_rooms()).unwrap())
}

#[test]
fn inspect_prints_the_agreed_json() {
    let path = two_rooms_file("json.glb");
    let done = enfilade(&["inspect", path.to_str().unwrap(), "--json"], "");
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    let report: Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(
        report["cells"][1],
        json!({"id": 1, "name": "cell-1", "aabb": [[4.0, 0.0, 0.0], [8.0, 3.0, 5.0]],
            "volume": 60.0, "triangles": 2, "detail_triangles": 2, "portals": [0, 1],
            "outdoor": false, "kind": "room", "storeys": ["1"], "floor_area": 20.0,
            "area_above_1_5": 20.0, "area_above_2_3": 20.0, "height": 2.9, "doors": 0, "windows": 1})
    );
    assert_eq!(report["cells"][2]["outdoor"], json!(true));
    assert_eq!(report["cells"][2]["kind"], json!("outdoors"));
    let seen = report["portals"][0]["visible_volume"].as_f64().unwrap();
    assert!(seen > 0.0);
    assert_eq!(
        report["portals"][0],
        json!({"id": 0, "cells": [0, 1], "kind": "open", "area": 2.1, "width": 1.0, "height": 2.1,
            "pieces": 1, "visible_volume": seen, "balance": 2.0, "score": 2.0 * seen, "normal": [1.0, 0.0, 0.0],
            "outline": [[4.0, 0.0, 2.0], [4.0, 2.1, 2.0], [4.0, 2.1, 3.0], [4.0, 0.0, 3.0]],
            "fittings": [{"detail": 0, "part": "leaf", "turns": {"through": [4.0, 0.0, 1.0], "axis": [0.0, 1.0, 0.0],
                "shut_degrees": -14.323_945, "open_degrees": 71.619_73}}]})
    );
    assert_eq!(
        report["portals"][1]["fittings"],
        json!([{"detail": 1, "part": "pane"},
            {"detail": 2, "part": "leaf", "slides": {"along": [0.0, 0.0, -1.0], "shut": 0.0, "open": 1.5}}])
    );
    assert_eq!(report["portals"][1]["kind"], json!("window"));
    assert_eq!(report["stats"]["input_triangles"], json!(8));
    assert_eq!(report["stats"]["seconds"], json!({}));
    assert_eq!(report["stats"]["peak_bytes"], json!(0));
}

#[test]
fn inspect_tells_machines_of_suspected_holes() {
    let mut world = two_rooms();
    world.graph.portals[1].kind = enfilade_cpg::PortalKind::Open;
    let [a, b, c, _] = world.graph.portals[1].outline[..] else {
        panic!("the window is no rectangle")
    };
    // A missing triangle leaves half a rectangle.
    world.graph.portals[1].outline = vec![a, b, c];
    world.graph.portals[1].pieces = vec![vec![a, b, c]];
    world.graph.portals[1].area = 2.0;
    let path = file("holes.glb", &encode_glb(&world).unwrap());
    let done = enfilade(&["inspect", path.to_str().unwrap(), "--json"], "");
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    let report: Value = serde_json::from_slice(&done.stdout).unwrap();
    let hole = &report["suspected_holes"][0];
    assert_eq!(hole["portal"], json!(1));
    assert_eq!(hole["reason"], json!("of no regular shape"));
    assert_eq!(hole["position"].as_array().unwrap().len(), 3);
}

/// Runs the demo's hints, except for the window and the user's own file.
#[test]
fn the_demo_makes_a_house_and_its_hints_work() {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("demo");
    // Files of an earlier version would be in the way.
    let _ = fs::remove_dir_all(&dir);
    let done = enfilade(&["demo", "-o", dir.to_str().unwrap()], "");
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    for name in ["house.glb", "world.glb", "plan.svg"] {
        assert!(dir.join(name).metadata().unwrap().len() > 1000, "{name}");
    }
    let bin = PathBuf::from(env!("CARGO_BIN_EXE_enfilade"));
    let said = text(&done.stdout);
    let hints: Vec<&str> = said
        .lines()
        .map(str::trim)
        .filter(|l| l.contains("enfilade ") && !l.contains("YOUR") && !l.contains("enfilade view"))
        .filter(|l| l.starts_with("enfilade") || l.starts_with("echo"))
        .collect();
    assert!(hints.len() >= 3, "{said}");
    for hint in hints {
        let tried = Command::new("sh")
            .args(["-c", &hint.replace("enfilade ", "\"$ENFILADE\" ")])
            .env("ENFILADE", &bin)
            // Where the report goes.
            .current_dir(&dir)
            .output()
            .unwrap();
        assert!(
            tried.status.success() && !tried.stdout.is_empty(),
            "{hint}: {}",
            text(&tried.stderr)
        );
    }
}

// Covers P5.
#[test]
fn inspect_prints_a_table_for_people() {
    let path = two_rooms_file("table.glb");
    let done = enfilade(&["inspect", path.to_str().unwrap()], "");
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    let table = text(&done.stdout);
    for part in [
        "outdoors",
        "window",
        "2 rooms and outdoors",
        "2 (1 open, 1 window)",
        "20.00      2.90       60.00",
        "portal-0",
        "cell-0 – cell-1",
        "cell-1 – outdoors",
    ] {
        assert!(table.contains(part), "{part:?} is missing from\n{table}");
    }
    // The largest cell comes first.
    assert!(table.find("outdoors").unwrap() < table.find("cell-0").unwrap());
}

#[test]
fn inspect_tells_voids_from_rooms() {
    let mut world = two_rooms();
    world.graph.cells[1].is_void = true;
    let path = file("void.glb", &encode_glb(&world).unwrap());
    let done = enfilade(&["inspect", path.to_str().unwrap()], "");
    let table = text(&done.stdout);
    assert!(table.contains("1 room, 1 void and outdoors"), "{table}");
    let done = enfilade(&["inspect", path.to_str().unwrap(), "--json"], "");
    let report: Value = serde_json::from_slice(&done.stdout).unwrap();
    let kinds = [0, 1, 2].map(|c: usize| report["cells"][c]["kind"].clone());
    assert_eq!(kinds, ["room", "void", "outdoors"]);
}

// Covers P6.
#[test]
fn locate_answers_line_by_line() {
    let path = two_rooms_file("locate.glb");
    let points = "1 1 1\n5 1 1\n 5\t0.05 1\n-3 1e9 0\nnan 0 0\n3.999 1 1";
    let done = enfilade(&["locate", path.to_str().unwrap()], points);
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    assert_eq!(text(&done.stdout), "0\n1\n-\n2\n-\n0\n");
}

#[test]
fn locate_names_the_line_that_is_no_point() {
    let path = two_rooms_file("malformed.glb");
    let done = enfilade(&["locate", path.to_str().unwrap()], "1 1 1\n5 1 1\n1,1,1\n");
    assert_eq!(done.status.code(), Some(1));
    assert_eq!(text(&done.stdout), "0\n1\n");
    assert!(
        text(&done.stderr).contains("line 3"),
        "{}",
        text(&done.stderr)
    );
}

#[test]
fn a_plain_glb_is_told_to_be_baked_first() {
    let mut json = br#"{"asset":{"version":"2.0"}}"#.to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend((20 + json.len() as u32).to_le_bytes());
    glb.extend((json.len() as u32).to_le_bytes());
    glb.extend(b"JSON");
    glb.extend(json);
    let path = file("plain.glb", &glb);
    for command in ["inspect", "locate"] {
        let done = enfilade(&[command, path.to_str().unwrap()], "");
        assert_eq!(done.status.code(), Some(1));
        assert!(
            text(&done.stderr).contains("enfilade bake"),
            "{}",
            text(&done.stderr)
        );
    }
}

#[test]
fn a_missing_file_is_named() {
    let done = enfilade(&["inspect", "/nowhere/x.glb"], "");
    assert_eq!(done.status.code(), Some(1));
    assert!(
        text(&done.stderr).contains("/nowhere/x.glb"),
        "{}",
        text(&done.stderr)
    );
}

#[test]
fn the_command_and_the_worlds_that_it_makes_name_one_version() {
    let done = enfilade(&["--version"], "");
    let version = text(&done.stdout).trim_end();
    assert!(version.starts_with("enfilade 0."), "{version}");
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("version");
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir).unwrap();
    let dir = dir.to_str().unwrap();
    let done = enfilade(&["demo", "-q", "-o", dir], "");
    assert_eq!(text(&done.stderr), "");
    let made = enfilade(&["inspect", "--json", &format!("{dir}/world.glb")], "");
    let made: Value = serde_json::from_slice(&made.stdout).unwrap();
    assert_eq!(made["stats"]["generator"], json!(version));
}

#[test]
fn wrong_usage_exits_with_2() {
    assert_eq!(enfilade(&["inspect"], "").status.code(), Some(2));
    assert_eq!(enfilade(&["dance"], "").status.code(), Some(2));
    assert_eq!(enfilade(&[], "").status.code(), Some(2));
    assert_eq!(enfilade(&["--help"], "").status.code(), Some(0));
}

#[test]
fn a_reader_that_stops_early_is_no_error() {
    let path = two_rooms_file("pipe.glb");
    let mut child = Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(["locate", path.to_str().unwrap()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let mut input = child.stdin.take().unwrap();
    let lines = "1 1 1\n".repeat(100_000);
    let writer = std::thread::spawn(move || {
        let _ = input.write_all(lines.as_bytes());
    });
    let done = child.wait_with_output().unwrap();
    writer.join().unwrap();
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    assert_eq!(text(&done.stderr), "");
}
