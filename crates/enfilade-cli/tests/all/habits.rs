//! Conventions of all commands: JSON for machines, quiet, completions and manual pages.

use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use enfilade::import::export_glb;
use enfilade_testkit::{Variant, gjorup_rooms};
use serde_json::Value;

/// Keys in the `--json` output of each command; the files come from the rows before.
const COMMANDS: [(&str, &[&str]); 32] = [
    ("demo", &["files", "triangles", "cells_indoors"]),
    (
        "bake house.glb --voxel 0.2 -o w.glb",
        &["file", "bytes", "doors", "method", "notes", "seconds"],
    ),
    (
        "bake house.glb --voxel 0.2 -v -o w.glb",
        &["file", "cells_indoors"],
    ),
    ("decimate rooms.glb", &["steps", "stop", "cells_indoors"]),
    ("decimate rooms.glb -o r.glb", &["steps", "baked"]),
    (
        "edit world.glb --delete-portal 0 -o e.glb",
        &["file", "cells", "portals", "costs"],
    ),
    ("export world.glb -o graph.graphml", &["file", "bytes"]),
    (
        "generate maze --rooms 4 --pieces tiles -o m.glb",
        &["file", "instances", "joined"],
    ),
    ("kit tiles -o k.html", &["pieces", "groups", "palette"]),
    (
        "assemble level.toml -o a.glb",
        &["file", "instances", "open"],
    ),
    ("inspect world.glb", &["cells", "portals", "stats"]),
    ("job plan world.glb -o job", &["shards", "input", "mode"]),
    ("job run job", &["done", "there", "missing"]),
    ("job merge job job", &["done", "there", "missing"]),
    ("job finish job -o j.pvs", &["cells", "pairs", "complete"]),
    ("locate world.glb", &["cells"]),
    (
        "name world.glb --at 2,1,2 Hall --cell outdoors Garden -o n.glb",
        &["file", "bytes", "names", "warnings"],
    ),
    ("pack world.glb -o w.enf", &["file", "packed", "pieces"]),
    ("unpack w.enf -o u.glb", &["file", "bytes"]),
    ("plan world.glb -o p.svg", &["file", "bytes"]),
    (
        "portals world.glb --side 32 --max-bytes 40K --plain --adapter software -o w.ptx",
        &["file", "bytes", "textures", "left_out"],
    ),
    ("pvs world.glb -o p.pvs", &["cells", "pairs", "complete"]),
    (
        "rebake w.glb --source house.glb --voxel 0.2 -o re.glb",
        &["file", "bytes", "changed", "gone", "moved", "whole"],
    ),
    (
        "render world.glb --size 64x36 --plain --adapter software -o x.png",
        &["file", "eye", "triangles"],
    ),
    (
        "render world.glb --size 64x36 --plain --adapter software --walk 2 -o x.png",
        &["pictures"],
    ),
    (
        "render world.glb --size 64x36 --plain --adapter software --mode portal-textures -o x.png",
        &["textured_portals", "plain_portals", "textures_made"],
    ),
    (
        "path world.glb --from 2,1,2 --to 8,1,3.6",
        &["length", "portals", "points"],
    ),
    (
        "report world.glb --no-pictures --views 2 -o r.html",
        &["file", "pictures", "notes"],
    ),
    ("see world.glb --eye 2,1,2 --look 3,1,2", &["visits"]),
    (
        "simplify world.glb --max-cells 6 -o s.glb",
        &["file", "cells", "portals", "warning"],
    ),
    (
        "sound world.glb --listener 2,1,2 --source 3,1,2 -o s.wav",
        &["file", "heard"],
    ),
    (
        "verify world.glb --rays 100 --sight 10",
        &["unsealed", "sight"],
    ),
];

/// Commands without output for machines: a script for a shell, files, a server, a window.
const OTHERS: [&str; 5] = ["completions", "help", "man", "serve", "view"];

/// A folder of this test alone.
fn folder(name: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("habits-{name}"));
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir).unwrap();
    let rooms = gjorup_rooms(Variant::Optimised, [0.0; 3]).scene;
    fs::write(dir.join("rooms.glb"), export_glb(&rooms)).unwrap();
    let level = "kit = \"tiles\"\nplace = [{ piece = \"crossing\" }]";
    fs::write(dir.join("level.toml"), level).unwrap();
    dir
}

fn run(dir: &Path, args: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(args.split_whitespace())
        .current_dir(dir)
        // A Vulkan layer of Mesa otherwise looks for a display, and reports that there is none.
        .env("NODEVICE_SELECT", "1")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Two points for `locate`, one of them in the floor; no other command reads them.
    let _ = child.stdin.take().unwrap().write_all(b"2 1 2\n2 -0.1 2\n");
    child.wait_with_output().unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// The names of all commands, as the help lists them.
fn names(dir: &Path) -> BTreeSet<String> {
    let help = run(dir, "--help");
    let help = text(&help.stdout);
    let (_, list) = help.split_once("Commands:\n").unwrap();
    let (list, _) = list.split_once("\n\n").unwrap();
    let first = |line: &str| line.split_whitespace().next().unwrap().to_owned();
    list.lines().map(first).collect()
}

#[test]
fn every_command_that_prints_answers_in_one_json_object_and_quietly_if_asked() {
    let dir = folder("json");
    let mut without = names(&dir);
    for (args, keys) in COMMANDS {
        without.remove(args.split(' ').next().unwrap());
        let done = run(&dir, &format!("{args} --json --quiet"));
        assert!(done.status.success(), "{args}: {}", text(&done.stderr));
        assert_eq!(text(&done.stderr), "", "{args}");
        let printed = text(&done.stdout);
        assert_eq!(printed.lines().count(), 1, "{args}: {printed}");
        let value: Value = serde_json::from_str(printed).unwrap();
        let object = value
            .as_object()
            .unwrap_or_else(|| panic!("{args}: {value}"));
        for key in keys {
            assert!(object.contains_key(*key), "{args}: no {key} in {value}");
        }
    }
    let others: BTreeSet<String> = OTHERS.map(str::to_owned).into();
    let others = others.intersection(&without).cloned().collect();
    assert_eq!(without, others, "not in the table");
    let located = run(&dir, "locate world.glb --json");
    let located: Value = serde_json::from_slice(&located.stdout).unwrap();
    let cells = located["cells"].as_array().unwrap();
    assert!(cells.len() == 2 && cells[0].is_u64() && cells[1].is_null());
    // If a file goes to standard output, results go to standard error.
    let done = run(
        &dir,
        "sound world.glb --listener 2,1,2 --source 3,1,2 --json -o -",
    );
    assert!(done.stdout.starts_with(b"RIFF"));
    let _: Value = serde_json::from_slice(&done.stderr).unwrap();
    let done = run(
        &dir,
        "sound world.glb --listener 2,1,2 --source 3,1,2 -o world.glb",
    );
    assert!(text(&done.stderr).contains("world.glb is the input"));
    let done = run(&dir, "plan world.glb --json -o -");
    assert!(text(&done.stdout).contains("<svg"));
    let _: Value = serde_json::from_slice(&done.stderr).unwrap();
}

#[test]
fn quiet_leaves_errors_and_warnings() {
    let dir = folder("quiet");
    let done = run(&dir, "inspect -q none.glb");
    assert!(text(&done.stderr).contains("none.glb"));
    fs::write(dir.join("flat.obj"), "v 0 0 0\nv 9 0 0\nv 0 0 9\nf 1 2 3\n").unwrap();
    let done = run(&dir, "bake flat.obj -o flat.glb --allow-empty");
    let all = text(&done.stderr);
    assert!(
        all.contains("no room was found") && all.contains("method "),
        "{all}"
    );
    let done = run(&dir, "--quiet bake flat.obj -o flat.glb --allow-empty");
    let left = text(&done.stderr);
    assert!(left.starts_with("no room was found"), "{left}");
    assert!(
        !left.contains("method ") && !left.contains("model as found"),
        "{left}"
    );
}

#[test]
fn shells_and_manuals_know_every_command() {
    let dir = folder("manual");
    let names = names(&dir);
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let done = run(&dir, &format!("completions {shell}"));
        let script = text(&done.stdout);
        for word in names.iter().map(String::as_str).chain(["max-cells"]) {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
    assert_eq!(run(&dir, "completions dos").status.code(), Some(2));
    let done = run(&dir, "man pages");
    assert!(done.status.success(), "{}", text(&done.stderr));
    let page = |name: &str| fs::read_to_string(dir.join("pages").join(name)).unwrap();
    for name in names.iter().filter(|n| *n != "help") {
        let page = page(&format!("enfilade-{name}.1"));
        assert!(page.contains(".TH") && page.contains("quiet"), "{name}");
    }
    assert!(page("enfilade.1").contains("enfilade 0."));
    assert_eq!(
        fs::read_dir(dir.join("pages")).unwrap().count(),
        names.len()
    );
    assert_eq!(run(&dir, "man -").status.code(), Some(1));
}
