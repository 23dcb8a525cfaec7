//! Rooms renamed by `enfilade name`, and by the table `[names]` of a bake's settings.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use enfilade::cpg::World;
use enfilade::cpg::wire::{decode_glb, encode_glb};
use enfilade::import::export_glb;
use enfilade_testkit::mixed::two_rooms;
use enfilade_testkit::{GridParams, room_grid};
use serde_json::Value;

/// A folder of one test, with a world of two rooms and the outdoors.
fn folder(name: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("name-{name}"));
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir).unwrap();
    let rooms = GridParams {
        outdoors: true,
        ..GridParams::two_rooms()
    };
    enfilade::save(dir.join("w.glb"), &room_grid(&rooms)).unwrap();
    dir
}

/// Runs the command; returns the exit code, the output, and the messages.
fn run(dir: &Path, args: &[&str]) -> (Option<i32>, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
    let done = command.args(args).current_dir(dir).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (done.status.code(), text(&done.stdout), text(&done.stderr))
}

fn named(dir: &Path, more: &[&str]) -> (Option<i32>, String, String) {
    run(dir, &[&["name", "w.glb", "-o", "n.glb"], more].concat())
}

fn world(dir: &Path, file: &str) -> World {
    decode_glb(&fs::read(dir.join(file)).unwrap()).unwrap()
}

/// The middle of a cell, as an argument.
fn middle(world: &World, cell: usize) -> String {
    let [low, high] = world.graph.cells[cell].aabb;
    let [x, y, z] = [0, 1, 2].map(|k| (low[k] + high[k]) / 2.0);
    format!("{x},{y},{z}")
}

#[test]
fn rooms_are_renamed_by_point_and_by_cell_and_all_else_stays() {
    let dir = folder("both");
    let mut before = world(&dir, "w.glb");
    let at = middle(&before, 0);
    let (code, printed, said) = named(
        &dir,
        &[
            "--at",
            &at,
            " Kü\n\u{1b}[2Jche ",
            "--cell",
            "cell-1",
            "Hall",
        ],
    );
    assert_eq!((code, &said[..]), (Some(0), ""));
    assert!(
        printed.contains(r"cell-0 → Kü\n\u{1b}[2Jche") && printed.contains("cell-1 → Hall"),
        "{printed}"
    );
    assert!(!printed.contains('\u{1b}'));
    let after = world(&dir, "n.glb");
    assert_eq!(after.graph.cells[0].name, "Kü\n\u{1b}[2Jche");
    before.graph.cells[0].name = "Kü\n\u{1b}[2Jche".into();
    before.graph.cells[1].name = "Hall".into();
    assert!(encode_glb(&before).unwrap() == fs::read(dir.join("n.glb")).unwrap());
    // Commands take the names for cells, and show them.
    let (code, printed, said) = run(&dir, &["inspect", "n.glb", "--objects", "Hall"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(printed.contains("object"), "{printed}");
    for (args, says) in [
        (
            &["path", "n.glb", "--from", &at, "--to", &at][..],
            r"from Kü\n\u{1b}[2Jche",
        ),
        (
            &["see", "n.glb", "--eye", &at, "--look", "1,1,1"],
            r"Kü\n\u{1b}[2Jche",
        ),
        (&["inspect", "n.glb"], r"Kü\n\u{1b}[2Jche"),
    ] {
        let (_, printed, said) = run(&dir, args);
        assert!(printed.contains(says), "{args:?}: {printed} {said}");
    }
    fs::write(
        dir.join("points"),
        format!("{}\n0 -9 0\n", at.replace(',', " ")),
    )
    .unwrap();
    for (json, says) in [
        (&[][..], "0 Kü\\n\\u{1b}[2Jche\n2 outdoors\n"),
        (&["--json"], r#""names":["Kü\n\u001b[2Jche","outdoors"]"#),
    ] {
        let points = fs::File::open(dir.join("points")).unwrap();
        let done = Command::new(env!("CARGO_BIN_EXE_enfilade"))
            .args([&["locate", "n.glb", "--names"], json].concat())
            .current_dir(&dir)
            .stdin(points)
            .output()
            .unwrap();
        let printed = String::from_utf8(done.stdout).unwrap();
        assert!(printed.contains(says), "{printed}");
    }
}

#[test]
fn a_name_that_is_taken_gets_a_number_and_is_told() {
    let dir = folder("taken");
    let (code, printed, said) = named(&dir, &["--cell", "0", "cell-1", "--json"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("this one is called 'cell-1 2'"), "{said}");
    let report: Value = serde_json::from_str(&printed).unwrap();
    assert_eq!(
        report["names"],
        serde_json::json!([{"cell": 0, "before": "cell-0", "after": "cell-1 2"}])
    );
    assert_eq!(report["warnings"].as_array().unwrap().len(), 1);
    let (_, _, said) = named(&dir, &["--cell", "0", "cell-1", "--cell", "1", "cell-0"]);
    assert!(said.contains("another cell"), "{said}");
    let (code, _, said) = named(&dir, &["--at", "-500,1,-500", "Garden"]);
    assert!(code == Some(0) && said.contains("this is no room, but the outdoors"));
    let (code, _, said) = named(&dir, &["--cell", "outdoors", "Garden"]);
    assert!(code == Some(0) && said.is_empty(), "{said}");
}

#[test]
fn what_names_no_room_is_refused_with_the_reason() {
    let dir = folder("refused");
    let known = world(&dir, "w.glb");
    let at = middle(&known, 0);
    for (args, says) in [
        (&["--at", "1,2", "Hall"][..], "three numbers"),
        (&["--at", "1,2,nan", "Hall"], "three numbers"),
        (&["--at", &at, " "], "at least one letter"),
        (&["--cell", "99", "Hall"], "no cell is called '99'"),
        (
            &["--at", &at, "Hall", "--cell", "0", "Den"],
            "cell-0 has a name already, by --at",
        ),
    ] {
        let (code, _, said) = named(&dir, args);
        assert_eq!(code, Some(1), "{args:?}: {said}");
        assert!(said.contains(says), "{args:?}: {said}");
        assert!(!dir.join("n.glb").exists(), "{args:?}");
    }
    assert_eq!(named(&dir, &[]).0, Some(2));
    assert_eq!(named(&dir, &["--at", &at]).0, Some(2));
}

#[test]
fn a_table_of_the_settings_names_rooms_of_a_bake() {
    let dir = folder("table");
    fs::write(dir.join("s.glb"), export_glb(&two_rooms().scene)).unwrap();
    let table = "voxel = 0.2\n[names]\n\"Kitchen\" = [2, 1.2, 2]\nDen = [7, 1.2, 2.0]\nAttic = [2, -0.1, 2]\n";
    fs::write(dir.join("c.toml"), table).unwrap();
    let bake = ["bake", "s.glb", "--config", "c.toml", "-o", "b.glb"];
    let (code, _, said) = run(&dir, &bake);
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.contains("'Attic' is for the point 2.00 -0.10 2.00, which is in a wall"),
        "{said}"
    );
    let names = world(&dir, "b.glb").graph.cells;
    for name in ["Kitchen", "Den"] {
        assert!(names.iter().any(|c| c.name == name), "{name}");
    }
    // Points are those of the world: after the origin has moved.
    fs::write(dir.join("c.toml"), format!("origin = [100, 0, 0]\n{table}")).unwrap();
    let (_, _, said) = run(&dir, &bake);
    assert!(said.contains("it names the outdoors"), "{said}");
    for (table, says) in [
        ("[names]\nHall = [1, 2]\n", "line 2"),
        ("[names]\n\" \" = [1, 2, 3]\n", "a name in [names] is empty"),
    ] {
        fs::write(dir.join("c.toml"), table).unwrap();
        let (code, _, said) = run(&dir, &bake);
        assert_eq!(code, Some(1));
        assert!(said.contains(says) && said.contains("c.toml"), "{said}");
    }
}
