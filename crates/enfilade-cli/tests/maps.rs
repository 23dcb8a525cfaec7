//! Quake maps through the command: baked by partition, leaks refused, worlds simplified and edited.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn enfilade(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(args)
        .output()
        .unwrap()
}

fn boxed(min: [i32; 3], max: [i32; 3]) -> String {
    let mut out = "{\n".to_owned();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for high in [false, true] {
            let base = if high { max } else { min };
            let (mut a, mut c) = (base, base);
            a[if high { u } else { v }] += 16;
            c[if high { v } else { u }] += 16;
            for p in [a, base, c] {
                write!(out, "( {} {} {} ) ", p[0], p[1], p[2]).unwrap();
            }
            writeln!(out, "wall 0 0 0 1 1").unwrap();
        }
    }
    out + "}\n"
}

/// Two rooms with a doorway, a light in the first; the ceiling may end early.
fn map(ceiling_from: i32) -> String {
    let boxes = [
        ([-16, -16, -16], [288, 144, 0]),
        ([ceiling_from, -16, 96], [288, 144, 112]),
        ([-16, -16, 0], [288, 0, 96]),
        ([-16, 128, 0], [288, 144, 96]),
        ([-16, 0, 0], [0, 128, 96]),
        ([272, 0, 0], [288, 128, 96]),
        ([128, 0, 0], [144, 48, 96]),
        ([128, 80, 0], [144, 128, 96]),
        ([128, 48, 64], [144, 80, 96]),
    ];
    let brushes: String = boxes.iter().map(|&(min, max)| boxed(min, max)).collect();
    format!(
        "{{\n\"classname\" \"worldspawn\"\n{brushes}}}\n{{\n\"classname\" \"light\"\n\"origin\" \"64 64 48\"\n}}\n"
    )
}

struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path =
            std::env::temp_dir().join(format!("enfilade-maps-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn path(&self, name: &str) -> String {
        Path::new(&self.0).join(name).display().to_string()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn a_map_is_baked_by_partition_verified_simplified_and_edited() {
    let folder = Folder::new("whole");
    let (input, world) = (folder.path("two.map"), folder.path("w.glb"));
    std::fs::write(&input, map(-16)).unwrap();
    let out = enfilade(&["bake", &input, "-o", &world, "--min-cost", "0"]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert!(text(&out.stderr).contains("method bsp: the structure is made of 9 brushes"));
    let verified = enfilade(&["verify", &world, "--source", &input, "--rays", "20000"]);
    assert!(verified.status.success(), "{}", text(&verified.stdout));
    let cells = |world: &str| {
        let json = text(&enfilade(&["inspect", world, "--json"]).stdout);
        let value: serde_json::Value = serde_json::from_str(&json).unwrap();
        [
            value["cells"].as_array().unwrap().len(),
            value["portals"].as_array().unwrap().len(),
        ]
    };
    // Two rooms, and what is in the doorway.
    assert_eq!(cells(&world), [3, 2]);
    let simple = folder.path("simple.glb");
    let out = enfilade(&["simplify", &world, "-o", &simple, "--max-cells", "2"]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert_eq!(cells(&simple), [2, 1]);
    assert!(
        enfilade(&["verify", &simple, "--source", &input, "--rays", "20000"])
            .status
            .success()
    );
    let edited = folder.path("edited.glb");
    let out = enfilade(&[
        "edit",
        &world,
        "-o",
        &edited,
        "--delete-portal",
        "0",
        "--delete-portal",
        "1",
    ]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert_eq!(cells(&edited), [1, 0]);
    let out = enfilade(&["edit", &world, "-o", &edited, "--delete-portal", "7"]);
    assert_eq!(out.status.code(), Some(1));
    assert!(text(&out.stderr).contains("no portal 7"));
}

#[test]
fn a_leak_ends_the_bake_with_the_way_out_and_writes_no_world() {
    let folder = Folder::new("leak");
    let (input, world, way) = (
        folder.path("leak.map"),
        folder.path("w.glb"),
        folder.path("way.pts"),
    );
    std::fs::write(&input, map(16)).unwrap();
    let out = enfilade(&["bake", &input, "-o", &world, "--leak", &way]);
    assert_eq!(out.status.code(), Some(1));
    assert!(
        text(&out.stderr).contains("the map leaks: light"),
        "{}",
        text(&out.stderr)
    );
    assert!(!Path::new(&world).exists());
    let points = std::fs::read_to_string(&way).unwrap();
    assert_eq!(points.lines().next(), Some("2 1.5 -2"));
    assert!(
        points
            .lines()
            .all(|l| l.split(' ').filter(|n| n.parse::<f64>().is_ok()).count() == 3)
    );
    let out = enfilade(&["bake", &input, "-o", &world, "--allow-leak"]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert!(
        enfilade(&["verify", &world, "--rays", "20000"])
            .status
            .success()
    );
}

#[test]
fn a_broken_map_is_refused_with_its_place() {
    let folder = Folder::new("broken");
    let (input, world) = (folder.path("broken.map"), folder.path("w.glb"));
    std::fs::write(
        &input,
        map(-16)
            .replacen("( 0 0 16 )", "( 0 0 up )", 1)
            .replacen("( -16", "( x", 1),
    )
    .unwrap();
    let out = enfilade(&["bake", &input, "-o", &world]);
    assert_eq!(out.status.code(), Some(1));
    assert!(
        text(&out.stderr).contains("line 4:3: 'x'"),
        "{}",
        text(&out.stderr)
    );
    assert!(!Path::new(&world).exists());
}
