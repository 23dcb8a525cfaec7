//! All output is plain text: names with terminal commands, line breaks and reversed text, in everything that has a
//! name, through every command.

#![cfg(unix)]

use std::ffi::{OsStr, OsString};
use std::fs;
use std::io::Write;
use std::os::unix::ffi::OsStringExt;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use enfilade::cpg::wire::encode_glb;
use enfilade::import::export_glb;
use serde_json::Value;

/// Sets the title, rings, clears, begins lines, colors by C1, reverses text, and hides characters in between.
const NAME: &str = "odd\u{1b}]0;owned\u{7}\u{1b}[2J\nwrote all.glb (1.0 MB)\r\u{0}\u{9b}31m\u{202e}gnp\u{2066}x\u{200f}\u{61c}\u{7f}\u{200b}\u{2028}";
/// The same without characters that file names cannot contain.
const FILE: &str = "odd\u{1b}]0;owned\u{7}\u{1b}[2J\nwrote all.glb (1.0 MB)\u{9b}31m\u{202e}";
/// The visible form of both.
const SEEN: &str = r"odd\u{1b}]0;owned\u{7}\u{1b}[2J\nwrote all.glb";

/// Returns the harm in a text: a hidden character, by an independent list, or a line that a name began.
fn is_harmful(text: &str) -> Option<String> {
    let is_hidden = |c: char| {
        (c.is_control() && c != '\n')
            || ['\u{61c}', '\u{200b}', '\u{200e}', '\u{200f}', '\u{feff}'].contains(&c)
            || ('\u{2028}'..='\u{202e}').contains(&c)
            || ('\u{2066}'..='\u{2069}').contains(&c)
    };
    let hidden = text.chars().find(|c| is_hidden(*c));
    let line = text.lines().find(|line| line.starts_with("wrote all.glb"));
    hidden.map(|c| format!("{c:?}")).or(line.map(str::to_owned))
}

fn folder(name: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("screen-{name}"));
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir).unwrap();
    dir
}

/// Runs a line of words, in which `@X` is the file X with the odd name, and `@@` the name itself.
fn run(dir: &Path, line: &str, input: &str) -> Output {
    let args = line.split(' ').map(|word| match word.split_once('@') {
        Some((before, "@")) => OsString::from(format!("{before}{NAME}").replace('\0', "")),
        Some((before, ending)) => OsString::from(format!("{before}{FILE}{ending}")),
        None => OsString::from(word),
    });
    run_args(dir, args, input)
}

fn run_args(dir: &Path, args: impl Iterator<Item = impl AsRef<OsStr>>, input: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(args)
        .current_dir(dir)
        .env("NODEVICE_SELECT", "1")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    child.wait_with_output().unwrap()
}

/// Runs the line, and checks that the output is harmless.
fn check(dir: &Path, line: &str, input: &str, code: i32, is_named: bool) {
    let done = run(dir, line, input);
    check_done(line, &done, code, is_named);
}

fn check_done(line: &str, done: &Output, code: i32, is_named: bool) {
    let mut all = String::new();
    for bytes in [&done.stdout, &done.stderr] {
        let text = std::str::from_utf8(bytes).unwrap();
        if let Some(why) = is_harmful(text) {
            panic!("{line}: {why} in\n{text:?}");
        }
        all += text;
    }
    let begin: String = all.chars().take(2000).collect();
    assert_eq!(done.status.code(), Some(code), "{line}: {begin}");
    let is_seen = if line.contains("--json") {
        let value: Value = serde_json::from_slice(&done.stdout).expect(line);
        value.to_string().contains("owned")
    } else {
        all.contains(SEEN)
    };
    assert_eq!(is_seen, is_named, "{line}: {begin}");
}

/// A scene with the odd name everywhere, and its world, with cells of such names.
fn scene_and_world(dir: &Path) {
    let mut scene = enfilade_testkit::furnished_house().scene;
    for o in &mut scene.objects {
        o.name = format!("{}{NAME}", o.name);
    }
    for m in &mut scene.meshes {
        m.name = format!("{}{NAME}", m.name);
    }
    let glb = with_names(&export_glb(&scene));
    fs::write(dir.join(format!("{FILE}s.glb")), &glb).unwrap();
    fs::write(dir.join("s.glb"), &glb).unwrap();
    let done = run(dir, "bake s.glb --voxel 0.2 -o w.glb", "");
    assert!(done.status.success(), "{done:?}");
    let mut world = enfilade::open(dir.join("w.glb")).unwrap();
    for (i, cell) in world.graph.cells.iter_mut().enumerate() {
        cell.name = format!("{NAME} {i}");
    }
    assert!(world.sources.iter().any(|s| s.name.contains(NAME)));
    assert!(world.materials.iter().any(|m| m.name.contains(NAME)));
    let told = &mut world.graph.provenance;
    for text in [&mut told.generator, &mut told.method, &mut told.input_hash] {
        *text = NAME.into();
    }
    told.settings.insert(NAME.into(), NAME.into());
    world.graph.statistics.counts.insert(NAME.into(), 1.0);
    let bytes = encode_glb(&world).unwrap();
    fs::write(dir.join(format!("{FILE}w.glb")), &bytes).unwrap();
    // A world that breaks promises, so that messages contain names: each object lies elsewhere.
    for detail in &mut world.details {
        detail.cells.clear();
    }
    fs::write(dir.join("broken.glb"), encode_glb(&world).unwrap()).unwrap();
}

/// The same GLB with the odd name where [`export_glb`] writes none: in its asset, its scenes, and nodes without a
/// mesh.
fn with_names(glb: &[u8]) -> Vec<u8> {
    let n = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let mut json: Value = serde_json::from_slice(&glb[20..20 + n]).unwrap();
    json["asset"]["copyright"] = NAME.into();
    json["asset"]["generator"] = NAME.into();
    json["asset"]["extras"] = serde_json::json!({ NAME: NAME });
    json["scenes"][0]["name"] = NAME.into();
    json["materials"] = serde_json::json!([{ "name": NAME }]);
    for mesh in json["meshes"].as_array_mut().unwrap() {
        for primitive in mesh["primitives"].as_array_mut().unwrap() {
            primitive["material"] = 0.into();
        }
    }
    for node in json["nodes"].as_array_mut().unwrap() {
        node["extras"] = serde_json::json!({ NAME: NAME });
    }
    let nodes = json["nodes"].as_array_mut().unwrap();
    nodes.push(serde_json::json!({ "name": NAME, "mesh": 0, "skin": 0, "camera": 0 }));
    let last = nodes.len() - 1;
    json["cameras"] = serde_json::json!([{ "name": NAME, "type": "perspective", "perspective": {"yfov": 1, "znear": 1} }]);
    json["scenes"][0]["nodes"]
        .as_array_mut()
        .unwrap()
        .push(last.into());
    json["extensionsUsed"] = serde_json::json!([NAME]);
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let rest = &glb[20 + n..];
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend(((20 + text.len() + rest.len()) as u32).to_le_bytes());
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(text);
    out.extend(rest);
    out
}

#[test]
fn no_name_of_a_world_or_scene_reaches_a_terminal_as_it_is() {
    let dir = folder("worlds");
    scene_and_world(&dir);
    for (line, is_named) in [
        ("bake @s.glb --voxel 0.2 -o @o.glb", true),
        ("bake @s.glb --voxel 0.2 -v -o @o.glb", true),
        (
            "bake s.glb --voxel 0.2 -v --repair --leak-path -o o.glb",
            true,
        ),
        ("bake @w.glb --voxel 0.2 --max-cost 100 -o @o.glb", true),
        ("bake @s.glb --voxel 0.2 --json -o @o.glb", true),
        ("inspect @w.glb", true),
        ("inspect @w.glb --json", true),
        ("inspect @w.glb --objects 0", true),
        ("inspect @w.glb --objects 0 --json", true),
        ("locate @w.glb --object *owned*", false),
        ("locate @w.glb --object *owned* --json", false),
        ("see @w.glb --eye 2,1,2 --look 8,1,3", true),
        ("see @w.glb --eye 2,1,2 --look 8,1,3 --json", false),
        ("path @w.glb --from 2,1,2 --to 8,1,3.6", true),
        ("path @w.glb --from 2,1,2 --to 8,1,3.6 --json", false),
        ("plan @w.glb -o @o.svg --json", true),
        ("plan @w.glb -o plan.svg", false),
        ("plan @w.glb -o plan.pdf", false),
        ("plan @w.glb -o -", true),
        (
            "report @w.glb --no-pictures --views 2 -o @o.html --json",
            true,
        ),
        (
            "report @w.glb --no-pictures --views 2 -o report.html",
            false,
        ),
        (
            "pvs @w.glb --mode fast -o @o.pvs --statistics statistics.json",
            true,
        ),
        ("pvs @w.glb --mode fast -o o.pvs --statistics -", true),
        ("pvs @w.glb --mode fast -o @o.pvs --json", false),
        (
            "render @w.glb --size 32x32 --plain --adapter software -o @o.png",
            true,
        ),
        (
            "render @w.glb --size 32x32 --plain --adapter software -o @o.png --json",
            true,
        ),
        (
            "sound @w.glb --listener 2,1,2 --source 3,1,2 -o @o.wav --json",
            true,
        ),
        ("simplify @w.glb --max-cells 6 -o @o.glb", true),
        (
            "simplify @w.glb --max-cost 100 --split-outdoors -o @o.glb",
            true,
        ),
        ("simplify @w.glb --max-cells 6 -o @o.glb --json", true),
        ("edit @w.glb --delete-portal 0 -o @o.glb", true),
        ("verify @w.glb --source @s.glb --rays 100 --sight 10", false),
        ("demo -o @demo", true),
        ("demo -o @demo --json", true),
        ("man @man", false),
    ] {
        check(&dir, line, "", 0, is_named);
    }
    for (line, is_named) in [
        ("verify broken.glb --rays 100 --sight 10", true),
        ("verify broken.glb --rays 100 --sight 10 --json", true),
        (
            "verify @w.glb --source s.glb --detail-name * --rays 100 --sight 0",
            true,
        ),
    ] {
        check(&dir, line, "", 1, is_named);
    }
    let mut n_named = 0;
    for name in ["plan.svg", "report.html", "statistics.json"] {
        let text = fs::read_to_string(dir.join(name)).unwrap();
        assert_eq!(is_harmful(&text), None, "{name}");
        n_named += usize::from(text.contains("owned"));
    }
    assert_eq!(n_named, 3);
    fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn no_error_repeats_a_name_as_it_is() {
    let dir = folder("errors");
    let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::offices(2, 1));
    enfilade::save(dir.join("w.glb"), &world).unwrap();
    enfilade::save(dir.join(format!("{FILE}w.glb")), &world).unwrap();
    fs::write(dir.join("s.obj"), "v 0 0 0\nv 4 0 0\nv 0 3 0\nf 1 2 3\n").unwrap();
    let write = |ending: &str, text: &str| {
        fs::write(dir.join(format!("{FILE}{ending}")), text).unwrap();
    };
    let json = serde_json::to_string(NAME).unwrap();
    write("x.txt", &format!("{NAME} is no scene"));
    write("c.toml", &format!("{json} = 1\n"));
    write("d.toml", &format!("keep = {json}\n"));
    write(
        "m.obj",
        &format!(
            "mtllib {}\nusemtl {NAME}\n{NAME} 1\nv 0 0 {NAME}\n",
            NAME.replace('\n', "")
        ),
    );
    write(
        "p.ply",
        &format!(
            "ply\nformat ascii 1.0\nelement {} 1\n",
            NAME.replace('\n', "")
        ),
    );
    write("t.stl", &format!("solid {NAME}\n facet {NAME}\n"));
    write("q.prt", &format!("PRT1\n2\n{NAME}\n"));
    write(
        "r.map",
        &format!("{{\n\"classname\" {json}\n{{\n( {NAME} )\n}}\n}}\n"),
    );
    write("e.ev", &format!("ENFEVID4{NAME}"));
    let extension = format!(r#"{{"asset":{{"version":{json}}},"extensionsRequired":[{json}]}}"#);
    write("v.gltf", &extension);
    write("e.gltf", &extension.replacen(&json, "\"2.0\"", 1));
    write(
        "i.ifc",
        "ISO-10303-21;\nFILE_SCHEMA(('IFC4'));\nENDSEC;\nEND-ISO-10303-21;\n",
    );
    let converter = dir.join("convert");
    fs::write(
        &converter,
        format!(
            "#!/bin/sh\ncat <<'END'\n{}\nEND\nexit 1\n",
            NAME.replace('\0', "")
        ),
    )
    .unwrap();
    fs::set_permissions(&converter, fs::Permissions::from_mode(0o755)).unwrap();
    for line in [
        "bake @none.glb -o o.glb",
        "bake @x.txt -o o.glb",
        "bake @m.obj -o o.glb",
        "bake @p.ply -o o.glb",
        "bake @t.stl -o o.glb",
        "bake @r.map -o o.glb",
        "bake @v.gltf -o o.glb",
        "bake @e.gltf -o o.glb",
        "bake @i.ifc -o o.glb --ifc-convert ./convert",
        "bake s.obj -o o.glb --config @c.toml",
        "bake s.obj -o o.glb --method delaunay --choices @d.toml",
        "bake s.obj -o @none/o.glb",
        "bake s.obj -o @o.obj",
        "decimate @m.obj",
        "inspect @none.glb",
        "inspect @x.txt",
        "inspect w.glb --objects @@",
        "locate w.glb --object @@",
        "plan w.glb --storey @@ -o o.svg",
        "plan w.glb -o @o.jpg",
        "pvs @q.prt",
        "simplify @q.prt --max-cells 1 -o o.prt",
        "simplify w.glb --max-cells 1 --material-cost @@=2 -o o.glb",
        "verify w.glb --evidence @e.ev",
        "sound w.glb --listener 2,1,2 --source 3,1,2 --wav @x.txt",
        "render w.glb --path @x.txt -o o.png",
        "report w.glb -o @o.mp3",
        "edit @none.glb --delete-portal 0 -o o.glb",
        "path @x.txt --from 1,1,1 --to 2,1,1",
        "see @x.txt --eye 1,1,1 --look 2,1,1",
        "man @x.txt",
        "demo -o @x.txt",
    ] {
        check(&dir, line, "", 1, true);
    }
    // Usage errors repeat the arguments.
    for line in [
        "inspect w.glb @@",
        "bake s.obj -o o.glb --voxel @@",
        "edit w.glb -o o.glb --add-portal 1,2,@@;4,5,6;7,8,9",
        "@@",
        "inspect w.glb --@@",
    ] {
        check(&dir, line, "", 2, true);
    }
    // Names that are not text, and the commands of a walk through a decimation.
    let odd = OsString::from_vec(b"odd\x1b]0;owned\x07\x1b[2J\nwrote all.glb\x9b\xff.glb".to_vec());
    fs::copy(dir.join("w.glb"), dir.join(&odd)).unwrap();
    for line in ["inspect", "bake --voxel 0.2 -o", "bake --json -o"] {
        let words = line.split(' ').map(OsStr::new).chain([odd.as_os_str()]);
        let is_bake = line.starts_with("bake");
        let done = run_args(
            &dir,
            words.chain(is_bake.then_some(OsStr::new("w.glb"))),
            "",
        );
        check_done(line, &done, 0, is_bake);
    }
    fs::remove_dir_all(&dir).unwrap();
}
