//! Bakes two rooms whose door is shut by a leaf, by an object called a wall, or not at all.

use std::fmt::Write;
use std::path::PathBuf;
use std::process::{Command, Output};

/// Boxes as an OBJ file of this test alone: name, minimum and maximum.
fn obj(file: &str, boxes: &[(&str, [f64; 3], [f64; 3])]) -> PathBuf {
    let mut text = String::new();
    for (i, (name, min, max)) in boxes.iter().enumerate() {
        writeln!(text, "o {name}").unwrap();
        for corner in 0..8 {
            let at = |k: usize| if corner >> k & 1 == 1 { max[k] } else { min[k] };
            writeln!(text, "v {} {} {}", at(0), at(1), at(2)).unwrap();
        }
        for face in [
            [1, 3, 4, 2],
            [5, 6, 8, 7],
            [1, 2, 6, 5],
            [3, 7, 8, 4],
            [1, 5, 7, 3],
            [2, 4, 8, 6],
        ] {
            let [a, b, c, d] = face.map(|v| v + 8 * i);
            writeln!(text, "f {a} {b} {c} {d}").unwrap();
        }
    }
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(file);
    std::fs::write(&path, text).unwrap();
    path
}

/// Rooms of 4 x 4 x 2.6 m side by side. The west one has a doorway to the outside; an object of the given name shuts
/// a doorway between them.
fn shut_rooms(file: &str, leaf: &str) -> PathBuf {
    obj(
        file,
        &[
            ("a", [-0.2, -0.2, -0.2], [8.4, 0.0, 4.2]),
            ("b", [-0.2, 2.6, -0.2], [8.4, 2.8, 4.2]),
            ("c", [-0.2, 0.0, -0.2], [8.4, 2.6, 0.0]),
            ("d", [-0.2, 0.0, 4.0], [8.4, 2.6, 4.2]),
            ("e", [8.2, 0.0, 0.0], [8.4, 2.6, 4.0]),
            // The outer wall with its doorway.
            ("f", [-0.2, 0.0, 0.0], [0.0, 2.6, 1.5]),
            ("g", [-0.2, 0.0, 2.5], [0.0, 2.6, 4.0]),
            ("h", [-0.2, 2.1, 1.5], [0.0, 2.6, 2.5]),
            // The inner wall, its doorway and the object that shuts it.
            ("i", [4.0, 0.0, 0.0], [4.2, 2.6, 1.5]),
            ("j", [4.0, 0.0, 2.5], [4.2, 2.6, 4.0]),
            ("k", [4.0, 2.1, 1.5], [4.2, 2.6, 2.5]),
            (leaf, [4.08, 0.0, 1.5], [4.12, 2.1, 2.5]),
        ],
    )
}

fn bake(input: &PathBuf, more: &[&str]) -> Output {
    let world = input.with_extension("glb");
    let done = Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .arg("bake")
        .arg(input)
        .arg("-o")
        .arg(&world)
        .args(more)
        .output()
        .unwrap();
    assert!(done.status.success(), "{}", said(&done));
    done
}

fn said(done: &Output) -> String {
    String::from_utf8_lossy(&done.stderr).into_owned()
}

fn n_doors(done: &Output) -> String {
    let table = String::from_utf8_lossy(&done.stdout).into_owned();
    let row = table.lines().find(|l| l.trim().starts_with("doors"));
    row.unwrap().split_whitespace().last().unwrap().to_owned()
}

#[test]
fn rooms_without_a_doorway_are_told() {
    let input = shut_rooms("shut.obj", "wall_leaf");
    let done = bake(&input, &[]);
    let text = said(&done);
    assert!(text.contains("1 room has no doorway"), "{text}");
    assert!(text.contains("--detail-name"), "{text}");
    assert!(text.contains(" 1.30 2.00"), "{text}");
    // A placeholder is proposed, and not tried.
    let printed = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(
        printed.contains("(try --detail-name 'PATTERN')"),
        "{printed}"
    );
    let done = bake(&input, &["--detail-name", "*leaf"]);
    assert!(!said(&done).contains("no doorway"), "{}", said(&done));
    assert_eq!(n_doors(&done), "1");
}

#[test]
fn a_leaf_without_a_name_is_found() {
    let input = shut_rooms("nameless.obj", "l");
    let done = bake(&input, &["-v"]);
    let text = said(&done);
    let of_leaf = |line: &str| line.contains("fills an opening") && line.ends_with(": l");
    assert!(text.lines().any(of_leaf), "{text}");
    assert!(!text.contains("no doorway"), "{text}");
    assert_eq!(n_doors(&done), "1");
    // Without automatic roles, a leaf is a wall.
    let done = bake(&input, &["--auto-roles", "off"]);
    assert!(said(&done).contains("1 room has no doorway"));
}

#[test]
fn a_scene_without_rooms_says_so() {
    let slab = [("a", [-4.0, -0.2, -4.0], [4.0, 0.0, 4.0])];
    let done = bake(&obj("slab.obj", &slab), &["--allow-empty"]);
    assert!(said(&done).contains("no room was found"), "{}", said(&done));
    let done = bake(&shut_rooms("rooms.obj", "door"), &[]);
    assert!(
        !said(&done).contains("no room was found"),
        "{}",
        said(&done)
    );
}
