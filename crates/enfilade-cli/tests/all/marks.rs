//! Scenes with objects called `mirror` and `portal:NAME` through the command. FEATURES: W7, W8.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use enfilade_cpg::wire::decode_glb;
use enfilade_cpg::{Way, World};

/// A room of 6 x 4 x 2.6 m, and rectangles in its walls: their names, and the place along x of the ends in the wall z = 0.
fn room(file: &str, panels: &[(&str, [f64; 2])]) -> PathBuf {
    let boxes = [
        [[-0.2, -0.2, -0.2], [6.2, 0.0, 4.2]],
        [[-0.2, 2.6, -0.2], [6.2, 2.8, 4.2]],
        [[-0.2, 0.0, -0.2], [6.2, 2.6, 0.0]],
        [[-0.2, 0.0, 4.0], [6.2, 2.6, 4.2]],
        [[-0.2, 0.0, 0.0], [0.0, 2.6, 4.0]],
        [[6.0, 0.0, 0.0], [6.2, 2.6, 4.0]],
    ];
    let mut text = String::new();
    for (n, [min, max]) in (0..).zip(boxes) {
        writeln!(text, "o wall_{n}").unwrap();
        for i in 0..8 {
            let [x, y, z] = [0, 1, 2].map(|k| if i >> k & 1 == 1 { max[k] } else { min[k] });
            writeln!(text, "v {x} {y} {z}").unwrap();
        }
        for q in [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ] {
            let [a, b, c, d] = q.map(|i| n * 8 + i + 1);
            writeln!(text, "f {a} {b} {c} {d}").unwrap();
        }
    }
    for (name, [x0, x1]) in panels {
        writeln!(text, "o {name}").unwrap();
        for [x, y] in [[x0, &0.5], [x1, &0.5], [x1, &1.9], [x0, &1.9]] {
            writeln!(text, "v {x} {y} 0").unwrap();
        }
        writeln!(text, "f -4 -3 -2 -1").unwrap();
    }
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(file);
    std::fs::write(&path, text).unwrap();
    path
}

fn enfilade(args: &[&str]) -> Output {
    let done = Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(args)
        .output()
        .unwrap();
    assert!(done.status.success(), "{args:?}: {}", said(&done));
    done
}

fn said(done: &Output) -> String {
    String::from_utf8_lossy(&done.stderr).into_owned()
}

/// Bakes to a file beside the scene.
fn bake(input: &Path, more: &[&str]) -> (Output, World, PathBuf) {
    let output = input.with_extension("world.glb");
    let files = [input, &output].map(|p| p.display().to_string());
    let done = enfilade(&[&["bake", &files[0], "-o", &files[1]], more].concat());
    let world = decode_glb(&std::fs::read(&output).unwrap()).unwrap();
    (done, world, output)
}

#[test]
fn a_bake_makes_mirrors_and_links_and_lists_them() {
    let panels = [
        ("Mirror_hall", [0.5, 1.5]),
        ("portal:a", [2.0, 3.0]),
        ("portal:a.001", [4.0, 5.0]),
    ];
    let input = room("marks.obj", &panels);
    let (done, world, output) = bake(&input, &[]);
    let text = said(&done);
    for line in [
        "'Mirror_hall' becomes special-0: mirror of a wall in cell-1, at 1.00 1.20 0.00",
        "'portal:a' becomes special-1: to cell-1, back by special-2 of a wall in cell-1, at 2.50 1.20 0.00",
        "'portal:a.001' becomes special-2: to cell-1, back by special-1 of a wall",
    ] {
        assert!(text.contains(line), "{line}: {text}");
    }
    let table = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(table.contains("special portals          3"), "{table}");
    assert!(matches!(world.graph.specials[0].passes[0].way, Way::Mirror));
    // Walls and objects, and where objects are, are as in the scene.
    let files = [&output, &input].map(|p| p.display().to_string());
    enfilade(&[
        "verify", &files[0], "--source", &files[1], "--rays", "2000", "--sight", "20",
    ]);
    // Equal bytes again, and none without marks.
    let bytes = std::fs::read(&output).unwrap();
    bake(&input, &[]);
    assert_eq!(bytes, std::fs::read(&output).unwrap());
    let (done, plain, _) = bake(&input, &["--marks", "off"]);
    assert!(plain.graph.specials.is_empty() && !said(&done).contains("becomes"));
    let report = enfilade(&["bake", &files[1], "-o", &files[0], "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&report.stdout).unwrap();
    assert_eq!(report["special_portals"], 3);
    // The objects go with the world, so a bake of it makes the same.
    let (_, again, _) = bake(&output, &[]);
    assert_eq!(again.graph.specials, world.graph.specials);
}

#[test]
fn an_object_that_cannot_be_one_is_told() {
    let input = room(
        "unmarked.obj",
        &[("portal:a", [2.0, 3.0]), ("portal:b", [4.0, 5.0])],
    );
    let (done, world, _) = bake(&input, &[]);
    let text = said(&done);
    assert!(world.graph.specials.is_empty());
    assert!(
        text.contains("'portal:a' at 2.50,1.20,0.00 stays plain geometry"),
        "{text}"
    );
    assert!(text.contains("a link needs two"), "{text}");
}
