//! Bounds on the costs of cells, from the command line: kept by every builder, or reported as unmet.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn enfilade(args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
    command.args(args).output().unwrap()
}

fn place(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

fn said(done: &Output) -> String {
    assert!(
        done.status.success(),
        "{}",
        String::from_utf8_lossy(&done.stderr)
    );
    String::from_utf8_lossy(&done.stderr).into_owned()
}

/// A hall of 10 x 4 x 8 m with six columns, closed except for a door, as an OBJ file with material `stone`.
fn hall(name: &str) -> String {
    let mut boxes = vec![
        ([-0.2, -0.2, -0.2], [10.2, 0.0, 8.2]),
        ([-0.2, 4.0, -0.2], [10.2, 4.2, 8.2]),
        ([-0.2, 0.0, -0.2], [10.2, 4.0, 0.0]),
        ([-0.2, 0.0, 8.0], [10.2, 4.0, 8.2]),
        ([10.0, 0.0, 0.0], [10.2, 4.0, 8.0]),
        ([-0.2, 0.0, 0.0], [0.0, 4.0, 3.5]),
        ([-0.2, 0.0, 4.5], [0.0, 4.0, 8.0]),
        ([-0.2, 2.1, 3.5], [0.0, 4.0, 4.5]),
    ];
    for i in 0..6 {
        let (x, z) = (2.0 + 3.0 * f64::from(i / 2), 2.0 + 4.0 * f64::from(i % 2));
        boxes.push(([x - 0.2, 0.0, z - 0.2], [x + 0.2, 4.0, z + 0.2]));
    }
    std::fs::write(
        place(&format!("{name}.mtl")),
        "newmtl stone\nKd 0.5 0.5 0.5\n",
    )
    .unwrap();
    let mut text = format!("mtllib {name}.mtl\n");
    for (i, (min, max)) in boxes.iter().enumerate() {
        writeln!(text, "o wall-{i}\nusemtl stone").unwrap();
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
    let path = place(&format!("{name}.obj"));
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

/// The largest cost of a cell of a world, in triangles, and the number of cells.
fn cells(world: &str) -> (u64, usize) {
    let done = enfilade(&["inspect", world, "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    let cells = report["cells"].as_array().unwrap();
    let cost = |c: &serde_json::Value| {
        c["triangles"].as_u64().unwrap() + c["detail_triangles"].as_u64().unwrap()
    };
    (cells.iter().map(cost).max().unwrap(), cells.len())
}

#[test]
fn every_builder_keeps_to_the_bound_also_outdoors_where_asked() {
    let input = hall("bounded");
    for method in ["watershed", "bsp", "delaunay"] {
        let world = place(&format!("bounded-{method}.glb"));
        let world = world.to_str().unwrap();
        let bake = [
            "bake",
            &input,
            "--auto-roles",
            "off",
            "-o",
            world,
            "--method",
            method,
        ];
        said(&enfilade(&bake));
        let (before, n) = cells(world);
        assert!(before > 30, "{method}: {before}");
        let bounded = [&bake[..], &["--max-cost", "30"]].concat();
        let told = said(&enfilade(&bounded));
        assert!(told.contains("cost more than 30"), "{method}: {told}");
        assert!(told.contains("it is the outdoors"), "{method}: {told}");
        let told = said(&enfilade(&[&bounded[..], &["--split-outdoors"]].concat()));
        assert!(!told.contains("cost more than"), "{method}: {told}");
        let (after, more) = cells(world);
        assert!(after <= 30 && more > n, "{method}: {after} {more}");
        let tried = enfilade(&["verify", world, "--rays", "20000"]);
        assert!(tried.status.success(), "{method}");
    }
}

#[test]
fn simplify_cuts_too_and_says_what_it_could_not() {
    let input = hall("simplified");
    let [world, simple] = ["simplified.glb", "simple.glb"].map(place);
    let [world, simple] = [&world, &simple].map(|p| p.to_str().unwrap());
    said(&enfilade(&[
        "bake",
        &input,
        "--auto-roles",
        "off",
        "-o",
        world,
    ]));
    let simplify = [
        "simplify",
        world,
        "-o",
        simple,
        "--split-outdoors",
        "--max-cost",
    ];
    let told = said(&enfilade(&[&simplify[..], &["60"]].concat()));
    assert!(!told.contains("cost more"), "{told}");
    assert!(cells(simple).0 <= 60);
    let told = said(&enfilade(&[&simplify[..], &["1"]].concat()));
    assert!(
        told.contains("cost more than 1") && told.contains("no plane"),
        "{told}"
    );
}

#[test]
fn materials_that_no_scene_has_are_refused_with_those_that_it_has() {
    let input = hall("material");
    let settings = place("material.toml");
    std::fs::write(&settings, "[bsp.material_costs]\nstonne = 3\n").unwrap();
    let world = place("material.glb");
    let world = world.to_str().unwrap();
    for method in ["watershed", "bsp", "delaunay"] {
        let config = ["--config", settings.to_str().unwrap()];
        let bake = ["bake", &input, "-o", world, "--method", method];
        let done = enfilade(&[&bake[..], &config].concat());
        let told = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(1), "{method}: {told}");
        assert!(
            told.contains("'stonne'") && told.contains("'stone'"),
            "{told}"
        );
    }
    said(&enfilade(&["bake", &input, "-o", world]));
    let simplify = ["simplify", world, "-o", world, "--max-cost", "60"];
    let done = enfilade(&[&simplify[..], &["--material-cost", "stonne=2"]].concat());
    assert_eq!(done.status.code(), Some(1));
}
