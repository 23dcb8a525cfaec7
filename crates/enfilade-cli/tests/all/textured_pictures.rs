//! `enfilade render --mode portal-textures`: pictures in which far portals are textures. Covers X1, X2.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use enfilade_render::Picture;
use enfilade_testkit::{GridParams, room_grid};
use serde_json::Value;

/// A folder of one test, with a world of rooms.
fn folder(name: &str, n_rooms: usize) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("textured-{name}"));
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir).unwrap();
    let world = room_grid(&GridParams::offices(n_rooms, 3));
    enfilade::save(dir.join("w.glb"), &world).unwrap();
    dir
}

/// Runs a command; returns the exit code, the output, and the messages.
fn run(dir: &Path, line: &str) -> (Option<i32>, String, String) {
    let done = Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(line.split_whitespace())
        .args(["--adapter", "software"])
        .current_dir(dir)
        .env("NODEVICE_SELECT", "1")
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (done.status.code(), text(&done.stdout), text(&done.stderr))
}

/// Draws the pictures of the recorded walk; returns the reports on them.
fn rendered(dir: &Path, options: &str) -> Vec<Value> {
    let line = format!("render w.glb --size 160x120 --json {options}");
    let (code, printed, said) = run(dir, &line);
    assert_eq!(code, Some(0), "{line}: {said}");
    let report: Value = serde_json::from_str(&printed).unwrap();
    report["pictures"].as_array().unwrap().clone()
}

fn sum(reports: &[Value], key: &str) -> u64 {
    reports.iter().map(|r| r[key].as_u64().unwrap()).sum()
}

fn picture(dir: &Path, name: &str) -> Picture {
    Picture::from_png(&fs::read(dir.join(name)).unwrap()).unwrap()
}

fn mean_difference(a: &Picture, b: &Picture) -> f64 {
    let pairs = a.rgba.iter().zip(&b.rgba);
    let sum: u64 = pairs.map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / a.rgba.len() as f64
}

#[test]
fn far_portals_become_textures_that_look_like_what_is_behind() {
    const N: usize = 8;
    let dir = folder("drawn", 24);
    let all = rendered(&dir, &format!("--walk {N} --record p.txt -o all.png"));
    assert!(all.iter().all(|r| r.get("textured_portals").is_none()));
    let own = rendered(&dir, "--path p.txt --mode portal-textures -o own.png");
    assert!(sum(&own, "textured_portals") > 3, "{own:?}");
    assert!(sum(&own, "textures_made") > 3 && sum(&own, "textures_loaded") == 0);
    assert!(sum(&own, "triangles") < sum(&all, "triangles"));
    let mut n_different = 0;
    for (i, report) in own.iter().enumerate() {
        let [a, b] = ["all", "own"].map(|name| picture(&dir, &format!("{name}-{:04}.png", i + 1)));
        let mean = mean_difference(&a, &b);
        assert!(mean <= 1.0, "{mean}: {report}");
        n_different += usize::from(a != b);
        if report["textured_portals"] == 0 {
            assert_eq!(report["triangles"], all[i]["triangles"]);
        }
    }
    assert!(n_different > 0, "textures show");
    // A picture is the same without those before it on the walk.
    let cameras = fs::read_to_string(dir.join("p.txt")).unwrap();
    let mut lines: Vec<&str> = cameras.lines().filter(|l| !l.starts_with('#')).collect();
    lines.reverse();
    fs::write(dir.join("back.txt"), lines.join("\n")).unwrap();
    rendered(&dir, "--path back.txt --mode portal-textures -o back.png");
    for i in 1..=N {
        let [a, b] = [
            format!("own-{i:04}.png"),
            format!("back-{:04}.png", N + 1 - i),
        ];
        assert!(picture(&dir, &a) == picture(&dir, &b), "{a} {b}");
    }
    fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn pictures_keep_to_a_bound_on_triangles() {
    let dir = folder("bound", 24);
    let free = rendered(
        &dir,
        "--walk 6 --record p.txt --mode portal-textures -o a.png",
    );
    let most = 40;
    let options = format!("--path p.txt --mode portal-textures --max-triangles {most} -o b.png");
    let bound = rendered(&dir, &options);
    let triangles = |r: &Value| r["triangles"].as_u64().unwrap();
    assert!(free.iter().any(|r| triangles(r) > most), "{free:?}");
    assert!(bound.iter().all(|r| triangles(r) <= most), "{bound:?}");
    let instead = ["textured_portals", "plain_portals"];
    let n = |reports: &[Value]| -> u64 { instead.iter().map(|key| sum(reports, key)).sum() };
    assert!(n(&bound) > n(&free), "{bound:?}");
    fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn textures_made_ahead_are_loaded_and_those_for_another_world_or_light_refused() {
    let dir = folder("ahead", 5);
    let (code, _, said) = run(&dir, "portals w.glb --max-bytes 8M -o w.ptx");
    assert_eq!(code, Some(0), "{said}");
    let own = rendered(
        &dir,
        "--walk 12 --mode portal-textures --textures w.ptx -o own.png",
    );
    assert!(sum(&own, "textures_loaded") > 0, "{own:?}");
    enfilade::save(dir.join("v.glb"), &room_grid(&GridParams::offices(12, 3))).unwrap();
    let file = fs::read(dir.join("w.ptx")).unwrap();
    fs::write(dir.join("cut.ptx"), &file[..file.len() / 2]).unwrap();
    let textured = "--mode portal-textures --size 64x36";
    for (line, code, says) in [
        ("v.glb -o a.png --textures w.ptx", 1, "w.ptx: "),
        ("v.glb -o a.png --textures w.ptx", 1, "another world"),
        ("w.glb -o a.png --textures cut.ptx", 1, "damaged"),
        (
            "w.glb -o a.png --textures w.glb",
            1,
            "not a file of portal textures",
        ),
        ("w.glb -o a.png --textures none.ptx", 1, "none.ptx"),
        ("w.glb -o a.png --textures w.ptx --plain", 1, "daylight"),
        ("w.glb -o a.png --max-triangles 0", 2, "max-triangles"),
        ("w.glb -o w.ptx --textures w.ptx", 1, "is the input"),
    ] {
        let (found, _, said) = run(&dir, &format!("render {line} {textured}"));
        assert_eq!(found, Some(code), "{line}: {said}");
        assert!(said.contains(says), "{line}: {said}");
        assert!(!dir.join("a.png").exists());
    }
    for option in ["--textures w.ptx", "--max-triangles 100"] {
        let (found, _, said) = run(&dir, &format!("render w.glb -o a.png {option}"));
        assert_eq!(found, Some(1), "{option}: {said}");
        assert!(said.contains("add --mode portal-textures"), "{said}");
    }
    assert_eq!(fs::read(dir.join("w.ptx")).unwrap(), file);
    fs::remove_dir_all(&dir).unwrap();
}
