//! Runs `sound` on a world made in code.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use enfilade_cpg::wire::encode_glb;
use enfilade_testkit::{GridParams, room_grid};
use serde_json::Value;

fn enfilade(args: &[&str]) -> Output {
    let out = Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(args)
        .output()
        .unwrap();
    assert!(
        out.status.success(),
        "{}",
        String::from_utf8_lossy(&out.stderr)
    );
    out
}

fn file(name: &str) -> String {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    path.to_str().unwrap().to_owned()
}

/// A world of two rooms, and three points: in the first, in the doorway, in the second.
fn two_rooms(name: &str) -> (String, [String; 3]) {
    let world = room_grid(&GridParams::two_rooms());
    let path = file(name);
    fs::write(&path, encode_glb(&world).unwrap()).unwrap();
    let outline = &world.graph.portals[0].outline;
    let middle = [0, 1, 2].map(|k| outline.iter().map(|p| p[k]).sum::<f32>() / 4.0);
    let places =
        [-1.5, 0.01, 1.5].map(|x| format!("{},{},{}", middle[0] + x, middle[1], middle[2]));
    (path, places)
}

fn samples(path: &str) -> Vec<f64> {
    let mut reader = hound::WavReader::open(path).unwrap();
    assert_eq!(reader.spec().channels, 2);
    reader
        .samples::<i16>()
        .map(|s| f64::from(s.unwrap()) / 32767.0)
        .collect()
}

fn energy(samples: &[f64]) -> f64 {
    samples.iter().map(|s| s * s).sum()
}

/// W11: a closed door takes 20 dB and more; equal runs give equal bytes.
#[test]
fn a_closed_door_is_heard() {
    let (world, [a, _, b]) = two_rooms("sound-closed.glb");
    let [open, again, shut] = ["open.wav", "again.wav", "shut.wav"].map(file);
    let ask = |more: &[&str]| {
        let mut args = vec!["sound", &world, "--listener", &a, "--source", &b];
        args.extend(more);
        enfilade(&args);
    };
    ask(&["-o", &open]);
    ask(&["-o", &again]);
    ask(&["-o", &shut, "--closed", "0"]);
    assert_eq!(fs::read(&open).unwrap(), fs::read(&again).unwrap());
    let fallen = 10.0 * (energy(&samples(&open)) / energy(&samples(&shut))).log10();
    assert!(fallen > 20.0, "{fallen} dB");
}

/// W11: on a walk through the doorway no sample jumps by more than the source's own samples do.
#[test]
fn a_walk_has_no_clicks_and_a_table() {
    let (world, [a, door, b]) = two_rooms("sound-walk.glb");
    let wav = file("walk.wav");
    let walk = format!("{a};{door};{b}");
    let source = b.clone();
    let out = enfilade(&[
        "sound",
        &world,
        "--listener",
        &walk,
        "--source",
        &source,
        "-o",
        &wav,
        "--json",
    ]);
    let printed: Value = serde_json::from_slice(&out.stdout).unwrap();
    let rows = &printed["heard"];
    let rows = rows.as_array().unwrap();
    assert!(rows.len() >= 20);
    let of = |i: usize, key: &str| rows[i][key].as_f64().unwrap();
    assert!((of(0, "length") - 3.0).abs() < 0.05);
    assert!(of(rows.len() - 1, "gain_db") > of(0, "gain_db"));
    assert!(rows.iter().all(|r| r["rt60"].as_f64().unwrap() > 0.1));
    assert_ne!(rows[0]["cell"], rows[rows.len() - 1]["cell"]);
    let samples = samples(&wav);
    // The test sound has slopes of 0.5 * (440 + 0.5 * 660) Hz at 44.1 kHz; at a quarter, and at most 3 times that for
    // direct sound and room.
    let most = 3.0 * 0.25 * 0.5 * (440.0 + 330.0) * std::f64::consts::TAU / 44100.0;
    for k in 0..2 {
        let channel: Vec<f64> = samples.iter().skip(k).step_by(2).copied().collect();
        let jump = channel
            .windows(2)
            .map(|w| (w[1] - w[0]).abs())
            .fold(0.0, f64::max);
        assert!(jump > 1e-4 && jump <= most, "{jump} {most}");
    }
}

/// Without `--walk` the listener of two points goes straight, also through walls, and is told.
#[test]
fn a_listener_walks_through_walls_only_with_a_warning() {
    let world = room_grid(&GridParams {
        outdoors: true,
        ..GridParams::two_rooms()
    });
    let path = file("sound-walls.glb");
    fs::write(&path, encode_glb(&world).unwrap()).unwrap();
    let [low, high] = world.graph.cells[0].aabb;
    let outline = &world.graph.portals[0].outline;
    let z = outline.iter().map(|p| p[2]).sum::<f32>() / outline.len() as f32;
    // Beside the doorway, as far from it as the room allows.
    let beside = if z - low[2] > high[2] - z {
        low[2] + 0.4
    } else {
        high[2] - 0.4
    };
    let at = |x: f32, z: f32| format!("{x},1.6,{z}");
    let [a, b] = [at(high[0] - 1.0, beside), at(high[0] + 1.0, beside)];
    let ask = |listener: &str, more: &[&str]| -> Value {
        let args = [
            "sound",
            &path,
            "--listener",
            listener,
            "--source",
            &a,
            "--json",
        ];
        let done = enfilade(&[&args[..], more].concat());
        let report: Value = serde_json::from_slice(&done.stdout).unwrap();
        let said = String::from_utf8(done.stderr).unwrap();
        let warnings = report["warnings"].as_array().unwrap();
        let lines: Vec<&str> = warnings.iter().map(|w| w.as_str().unwrap()).collect();
        assert_eq!(said.lines().collect::<Vec<_>>(), lines);
        report
    };
    let said = |report: &Value| report["warnings"].to_string();
    let straight = ask(&format!("{a};{b}"), &[]);
    assert!(
        said(&straight).contains("walks through a wall at")
            && said(&straight).contains("after 0.7 s"),
        "{straight}"
    );
    let walked = ask(&format!("{a};{b}"), &["--walk"]);
    assert_eq!(said(&walked), "[]");
    let last = |report: &Value| report["heard"].as_array().unwrap().last().unwrap().clone();
    let seconds = |report: &Value| last(report)["seconds"].as_f64().unwrap();
    assert!(seconds(&walked) > 1.1 * seconds(&straight), "{walked}");
    assert!((last(&walked)["position"][1].as_f64().unwrap() - 1.6).abs() < 0.1);
    // Through the doorway, and around in front of it: no warning.
    let through = format!("{};{}", at(high[0] - 1.0, z), at(high[0] + 1.0, z));
    assert_eq!(said(&ask(&through, &[])), "[]");
    // Outdoors, beside the building and below it.
    assert_eq!(said(&ask("-5,1.6,2", &[])), "[]");
    let below = ask("2,-3,2", &[]);
    assert!(
        said(&below).contains("below the ground, or under the building"),
        "{below}"
    );
}

#[test]
fn a_walk_that_is_not_possible_says_why() {
    let (world, [a, _, b]) = two_rooms("sound-no-walk.glb");
    let walk = format!("{a};{b}");
    let ask = |args: &[&str]| {
        let all = [&["sound", &world, "--source", &a][..], args].concat();
        let done = Command::new(env!("CARGO_BIN_EXE_enfilade"))
            .args(all)
            .output()
            .unwrap();
        assert_eq!(done.status.code(), Some(1));
        String::from_utf8(done.stderr).unwrap()
    };
    let said = ask(&["--listener", &walk, "--walk", "--closed", "0"]);
    assert!(
        said.contains("portal-0, an opening") && said.contains("is closed"),
        "{said}"
    );
    let said = ask(&["--listener", "1,-0.1,1"]);
    assert!(
        said.contains("--listener: the walk starts in solid matter"),
        "{said}"
    );
}
