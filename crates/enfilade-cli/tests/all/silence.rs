//! Warnings of bakes without rooms, or with more cracks than doors; and the line that shows where a room leaks.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use enfilade_cpg::wire::decode_glb;

/// Vertices and faces of objects, as OBJ.
#[derive(Default)]
struct Obj {
    text: String,
    n: usize,
}

impl Obj {
    fn faces(&mut self, name: &str, corners: &[[f64; 3]], faces: &[&[usize]]) -> &mut Self {
        writeln!(self.text, "o {name}").unwrap();
        for [x, y, z] in corners {
            writeln!(self.text, "v {x} {y} {z}").unwrap();
        }
        for face in faces {
            let ids: Vec<String> = face.iter().map(|v| (v + self.n).to_string()).collect();
            writeln!(self.text, "f {}", ids.join(" ")).unwrap();
        }
        self.n += corners.len();
        self
    }

    fn cuboid(&mut self, min: [f64; 3], max: [f64; 3]) -> &mut Self {
        let corner = |c: usize| [0, 1, 2].map(|k| if c >> k & 1 == 1 { max[k] } else { min[k] });
        let corners: Vec<[f64; 3]> = (0..8).map(corner).collect();
        let faces: [&[usize]; 6] = [
            &[1, 3, 4, 2],
            &[5, 6, 8, 7],
            &[1, 2, 6, 5],
            &[3, 7, 8, 4],
            &[1, 5, 7, 3],
            &[2, 4, 8, 6],
        ];
        self.faces("part", &corners, &faces)
    }

    /// Writes to a file of this test alone.
    fn write(&self, file: &str) -> PathBuf {
        let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(file);
        std::fs::write(&path, &self.text).unwrap();
        path
    }
}

fn bake(input: &Path, more: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .arg("bake")
        .arg(input)
        .arg("-o")
        .arg(input.with_extension("world.glb"))
        .args(more)
        .output()
        .unwrap()
}

fn said(done: &Output) -> String {
    String::from_utf8_lossy(&done.stderr).into_owned()
}

fn row(done: &Output, name: &str) -> usize {
    let table = String::from_utf8_lossy(&done.stdout).into_owned();
    let row = table.lines().find(|l| l.trim().starts_with(name));
    row.unwrap()
        .split_whitespace()
        .last()
        .unwrap()
        .parse()
        .unwrap()
}

/// Rooms of 4 × 4 × 2.6 m in a row along x, each open over its whole south side.
fn open_rooms(n: usize) -> Obj {
    let mut obj = Obj::default();
    let end = 4.2 * n as f64;
    obj.cuboid([-0.2, -0.2, 0.0], [end, 0.0, 4.2]);
    obj.cuboid([-0.2, 2.6, 0.0], [end, 2.8, 4.2]);
    obj.cuboid([-0.2, 0.0, 4.0], [end, 2.6, 4.2]);
    for k in 0..=n {
        let x = 4.2 * k as f64;
        obj.cuboid([x - 0.2, 0.0, 0.0], [x, 2.6, 4.0]);
    }
    obj
}

/// Hills of 40 × 40 m, 3 m high.
fn hills() -> Obj {
    let height = |x: usize, z: usize| 1.5 * ((x as f64 * 0.9).sin() + (z as f64 * 0.7).cos());
    let mut corners = Vec::new();
    let mut faces = Vec::new();
    for z in 0..21 {
        for x in 0..21 {
            corners.push([2.0 * x as f64, height(x, z), 2.0 * z as f64]);
            if x < 20 && z < 20 {
                let v = 21 * z + x + 1;
                faces.push([v, v + 21, v + 1]);
                faces.push([v + 1, v + 21, v + 22]);
            }
        }
    }
    let faces: Vec<&[usize]> = faces.iter().map(|f| &f[..]).collect();
    let mut obj = Obj::default();
    obj.faces("hills", &corners, &faces);
    obj
}

#[test]
fn no_bake_without_rooms_is_silent() {
    let square = [
        [0.0, 0.0, 0.0],
        [9.0, 0.0, 0.0],
        [9.0, 0.0, 9.0],
        [0.0, 0.0, 9.0],
    ];
    let mut plane = Obj::default();
    plane.faces("plane", &square, &[&[1, 4, 3, 2]]);
    let mut triangle = Obj::default();
    triangle.faces("triangle", &square[..3], &[&[1, 2, 3]]);
    let scenes = [
        ("plane", plane, "no way out can be shown: no air"),
        ("triangle", triangle, "no way out can be shown: no air"),
        (
            "open_rooms",
            open_rooms(2),
            "a wall, floor or roof is missing",
        ),
        (
            "open_box",
            open_rooms(1),
            "a wall, floor or roof is missing",
        ),
        ("hills", hills(), "the widest way out"),
    ];
    for (name, obj, way) in scenes {
        for method in ["auto", "watershed", "bsp", "delaunay"] {
            let input = obj.write(&format!("{name}_{method}.obj"));
            let done = bake(&input, &["--method", method]);
            let text = said(&done);
            assert_eq!(done.status.code(), Some(1), "{name} by {method}: {text}");
            assert!(text.contains("nothing was written"), "{text}");
            let done = bake(&input, &["--method", method, "--allow-empty"]);
            let text = said(&done);
            assert!(done.status.success(), "{name} by {method}: {text}");
            assert_eq!(row(&done, "cells indoors"), 0, "{name} by {method}");
            for words in ["no room was found", way] {
                assert!(text.contains(words), "{name} by {method}: {text}");
            }
        }
    }
    let nothing = Obj::default().write("nothing.obj");
    let done = bake(&nothing, &[]);
    assert_eq!(done.status.code(), Some(1));
    assert!(said(&done).len() > 20, "{}", said(&done));
}

/// The numbers after a word.
fn point_after(text: &str, word: &str) -> [f64; 3] {
    let (_, rest) = text
        .split_once(word)
        .unwrap_or_else(|| panic!("no {word:?}: {text}"));
    let mut numbers = rest
        .split(|c: char| c.is_whitespace() || c == ',')
        .filter_map(|n| n.parse().ok());
    [0; 3].map(|_| numbers.next().unwrap())
}

#[test]
fn a_leak_path_is_a_line_of_the_world_and_nothing_else() {
    let input = open_rooms(2).write("leaking.obj");
    let world = input.with_extension("world.glb");
    let read = || decode_glb(&std::fs::read(&world).unwrap()).unwrap();
    // Without rooms the way out is reported, but written only on request.
    let done = bake(&input, &["--allow-empty"]);
    assert!(
        said(&done).contains("--leak-path writes it"),
        "{}",
        said(&done)
    );
    let without = read();
    assert!(without.leak_path.is_empty());
    let done = bake(&input, &["--leak-path=6.0,1.0,3.0"]);
    let text = said(&done);
    assert!(text.contains("the object 'enfilade leak path'"), "{text}");
    let [x, y, z] = point_after(&text, "narrowest at ");
    assert!(
        (4.2..8.2).contains(&x) && (0.0..2.6).contains(&y) && z.abs() < 0.2,
        "{text}"
    );
    let with = read();
    let ([x, ..], [.., z]) = (with.leak_path[0], with.leak_path[with.leak_path.len() - 1]);
    assert!((4.2..8.2).contains(&x) && z < -0.5);
    // Only the line differs.
    let mut plain = with.clone();
    plain.leak_path.clear();
    assert_eq!(format!("{plain:?}"), format!("{without:?}"));

    let enfilade = |args: &[&str]| {
        let done = Command::new(env!("CARGO_BIN_EXE_enfilade"))
            .args(args)
            .output()
            .unwrap();
        assert!(done.status.success(), "{args:?}: {}", said(&done));
        done
    };
    let path = world.to_str().unwrap();
    enfilade(&["inspect", path]);
    enfilade(&[
        "verify",
        path,
        "--source",
        input.to_str().unwrap(),
        "--rays",
        "2000",
    ]);
    // Read as a scene, it has the same triangles, and lines are not objects.
    let again = bake(&world, &["-v", "--allow-empty"]);
    assert_eq!(row(&again, "triangles"), row(&done, "triangles"));
    assert_eq!(row(&again, "detail objects"), 0);
    let text = said(&again);
    let roles = |l: &&str| l.starts_with("structural") || l.starts_with("detail");
    assert!(
        !text.lines().filter(roles).any(|l| l.contains("leak path")),
        "{text}"
    );
    assert!(text.contains("points or lines; left out"), "{text}");
}

#[test]
fn a_leak_path_from_nowhere_is_refused() {
    let input = open_rooms(1).write("nowhere.obj");
    for (point, word) in [("900,1,1", "outside the scene"), ("1,2", "three numbers")] {
        let done = bake(&input, &[&format!("--leak-path={point}")]);
        assert!(!done.status.success());
        assert!(said(&done).contains(word), "{}", said(&done));
    }
}

#[test]
fn more_cracks_than_doors_are_told_and_can_be_closed() {
    // Six rooms in a row whose partition walls end 20 mm below the ceiling; a door leads into the first.
    let mut obj = Obj::default();
    let end = 4.2 * 6.0;
    obj.cuboid([-0.2, -0.2, -0.2], [end, 0.0, 4.2]);
    obj.cuboid([-0.2, 2.6, -0.2], [end, 2.8, 4.2]);
    obj.cuboid([-0.2, 0.0, 4.0], [end, 2.6, 4.2]);
    obj.cuboid([-0.2, 0.0, -0.2], [1.0, 2.6, 0.0]);
    obj.cuboid([2.0, 0.0, -0.2], [end, 2.6, 0.0]);
    obj.cuboid([1.0, 2.1, -0.2], [2.0, 2.6, 0.0]);
    obj.cuboid([-0.2, 0.0, 0.0], [0.0, 2.6, 4.0]);
    obj.cuboid([end - 0.2, 0.0, 0.0], [end, 2.6, 4.0]);
    for k in 1..6 {
        let x = 4.2 * f64::from(k);
        obj.cuboid([x - 0.2, 0.0, 0.0], [x, 2.58, 4.0]);
    }
    let input = obj.write("cracks.obj");
    let done = bake(&input, &[]);
    let text = said(&done);
    let n = row(&done, "cracks");
    assert!(n >= 5, "{text}");
    assert!(
        text.contains(&format!("{n} cracks, and 1 doorways and windows")),
        "{text}"
    );
    let (_, proposal) = text.split_once("--smallest-hole ").unwrap();
    let width = proposal.split_whitespace().next().unwrap();
    let done = bake(&input, &["--smallest-hole", width]);
    assert_eq!(row(&done, "cracks"), 0, "{width}: {text}");
    assert!(
        !said(&done).contains("surfaces that should meet"),
        "{}",
        said(&done)
    );
    assert_eq!(row(&done, "cells indoors"), 6);
}
