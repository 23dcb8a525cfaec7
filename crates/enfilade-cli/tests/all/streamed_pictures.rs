//! Pictures of packed worlds, of which only what is in view is loaded: those of the whole world, byte for byte.

use crate::pictured;

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use enfilade_cpg::World;
use enfilade_testkit::{GridParams, room_grid, with_doors, with_specials};
use pictured::pictured;

fn folder(name: &str, world: &World) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("streamed-{name}"));
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(dir.join("worlds")).unwrap();
    enfilade::save(dir.join("w.glb"), world).unwrap();
    done(&dir, "pack w.glb -o worlds/w.enf");
    done(&dir, "pack w.glb -o worlds/one.enf --one-file");
    fs::write(dir.join("path.txt"), path(world)).unwrap();
    dir
}

/// Cameras in the middle of rooms, each toward a doorway.
fn path(world: &World) -> String {
    let mut out = String::new();
    for (id, cell) in world.graph.indoor_cells().step_by(5) {
        let eye = [0, 1, 2].map(|k| (cell.aabb[0][k] + cell.aabb[1][k]) * 0.5);
        if let Some(exit) = world.graph.exits(id).next() {
            let look = exit.portal.center();
            let numbers = eye.iter().chain(&look).map(ToString::to_string);
            out += &numbers.collect::<Vec<_>>().join(" ");
            out += "\n";
        }
    }
    out
}

fn command(dir: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
    command.args(line.split(' ')).current_dir(dir);
    // A proxy of this machine does not know the server of the test.
    command.env("NO_PROXY", "127.0.0.1");
    command
}

fn run(dir: &Path, line: &str) -> Output {
    command(dir, line).output().unwrap()
}

fn done(dir: &Path, line: &str) -> String {
    let output = run(dir, line);
    let err = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{line}: {err}");
    String::from_utf8(output.stdout).unwrap()
}

/// Draws the path; returns the pictures, and the reports.
fn pictures(dir: &Path, world: &str, options: &str) -> (Vec<Vec<u8>>, serde_json::Value) {
    let line = format!(
        "render {world} -o p.png --path path.txt --size 96x64 --adapter software --json {options}"
    );
    let report: serde_json::Value = serde_json::from_str(&done(dir, &line)).unwrap();
    let all = report["pictures"].as_array().unwrap().iter();
    let read = all.map(|p| fs::read(dir.join(p["file"].as_str().unwrap())).unwrap());
    (read.collect(), report)
}

/// A running server, killed at the end.
struct Server(Child);

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn serve(dir: &Path) -> (Server, String) {
    let line = "serve worlds --address 127.0.0.1:0";
    let mut child = command(dir, line).stdout(Stdio::piped()).spawn().unwrap();
    let out = BufReader::new(child.stdout.take().unwrap());
    let server = Server(child);
    // All that it prints, so that it does not write to a closed pipe.
    let lines: Vec<String> = out.lines().take(3).map(Result::unwrap).collect();
    (server, lines[0].split(' ').nth(3).unwrap().to_owned())
}

#[test]
fn pictures_from_pieces_are_those_of_the_whole_world() {
    let grid = |n, seed| room_grid(&GridParams::offices(n, seed));
    for (name, world) in [
        ("doors", with_doors(grid(40, 3), |p| p % 2 == 0)),
        ("mirrors", with_specials(grid(30, 9), 3, 4)),
        ("pictures", pictured(grid(30, 5))),
    ] {
        let dir = folder(name, &world);
        for options in ["--plain", "--plain --stop 40 --portals --close 1,3"] {
            let (whole, report) = pictures(&dir, "w.glb", options);
            assert!(whole.len() > 4 && report["pictures"][0]["loaded_bytes"].is_null());
            for packed in ["worlds/w.enf", "worlds/one.enf"] {
                let (streamed, told) = pictures(&dir, packed, options);
                assert!(streamed == whole, "{packed} {options}");
                for (a, b) in (report["pictures"].as_array().unwrap().iter())
                    .zip(told["pictures"].as_array().unwrap())
                {
                    assert_eq!(a["triangles"], b["triangles"]);
                    assert_eq!(a["of_triangles"], b["of_triangles"]);
                    let [loaded, all] = [0, 1].map(|i| b["loaded_bytes"][i].as_u64().unwrap());
                    assert!(loaded > 0 && loaded <= all, "{loaded} of {all}");
                }
                let first = &told["pictures"][0]["loaded_bytes"];
                let [loaded, all] = [0, 1].map(|i| first[i].as_u64().unwrap());
                assert!(2 * loaded < all, "{loaded} of {all}");
            }
        }
    }
}

#[test]
fn pictures_from_a_server_are_the_same() {
    let dir = folder("served", &room_grid(&GridParams::offices(24, 5)));
    let (whole, _) = pictures(&dir, "w.glb", "--plain");
    let (_server, url) = serve(&dir);
    for name in ["w.enf", "one.enf"] {
        let (streamed, _) = pictures(&dir, &format!("{url}{name}"), "--plain");
        assert!(streamed == whole, "{name}");
    }
}

#[test]
fn what_needs_the_whole_world_reads_it_and_says_so() {
    let dir = folder("whole", &room_grid(&GridParams::offices(12, 2)));
    for (options, words) in [
        ("--path path.txt", "daylight and shadows"),
        ("--path path.txt --plain --mode everything", "--mode"),
        ("--path path.txt --plain --paint cells", "--paint cells"),
        ("--plain", "finding views"),
    ] {
        let line = |world: &str, out: &str| {
            format!("render {world} -o {out}.png --size 48x32 --adapter software {options}")
        };
        done(&dir, &line("w.glb", "a"));
        let output = run(&dir, &line("worlds/w.enf", "b"));
        let err = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{options}: {err}");
        assert!(
            err.contains("is loaded whole") && err.contains(words),
            "{err}"
        );
        let suffix = if options.contains("--path") {
            "-0001"
        } else {
            ""
        };
        let read = |out: &str| fs::read(dir.join(format!("{out}{suffix}.png"))).unwrap();
        assert!(read("a") == read("b"), "{options}");
    }
}

#[test]
fn pieces_that_do_not_come_are_named() {
    let dir = folder("damaged", &room_grid(&GridParams::offices(12, 2)));
    let pieces = dir.join("worlds/w.enf/pieces.enfp");
    let line =
        "render worlds/w.enf -o p.png --path path.txt --plain --size 48x32 --adapter software";
    let bytes = fs::read(&pieces).unwrap();
    fs::write(&pieces, vec![7; bytes.len()]).unwrap();
    for (what, words) in [("damaged", "is damaged"), ("gone", "cannot be read")] {
        let output = run(&dir, line);
        let err = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "{what}");
        assert!(
            err.contains("pieces that this view needs did not come") && err.contains(words),
            "{err}"
        );
        let _ = fs::remove_file(&pieces);
    }
}
