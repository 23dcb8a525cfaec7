//! Covers W14: kits, levels and generated levels as commands: what is written, and what is refused with place and reason.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use enfilade::import::export_glb;
use enfilade_testkit::{gjorup_cavern, maze_kit};
use serde_json::Value;

fn run(dir: &Path, line: &str) -> (Option<i32>, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
    let done = command.args(line.split(' ')).current_dir(dir).output();
    let done = done.unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (done.status.code(), text(&done.stdout), text(&done.stderr))
}

/// A folder of this test alone, with a kit of tiles.
fn folder(name: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("kits-{name}"));
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(dir.join("kit")).unwrap();
    for piece in maze_kit() {
        let file = format!("kit/{}.glb", piece.name);
        fs::write(dir.join(file), export_glb(&piece.scene)).unwrap();
    }
    dir
}

fn value(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

/// Assembles a level of these places; returns the exit code and the message.
fn assembled(dir: &Path, places: &str) -> (Option<i32>, String) {
    let level = format!("kit = \"kit\"\n{places}\n");
    fs::write(dir.join("level.toml"), level).unwrap();
    let _ = fs::remove_file(dir.join("w.glb"));
    let (code, _, said) = run(dir, "assemble level.toml -o w.glb");
    assert_eq!(dir.join("w.glb").exists(), code == Some(0), "{said}");
    (code, said)
}

#[test]
fn equal_seeds_give_equal_levels_that_keep_all_promises() {
    let dir = folder("seeds");
    for kind in ["dungeon", "office", "maze"] {
        let make = |seed: u32, file: &str| {
            let line = format!("generate {kind} --rooms 9 --seed {seed} -o {file} --json");
            let (code, printed, said) = run(&dir, &line);
            assert_eq!(code, Some(0), "{said}");
            (value(&printed), fs::read(dir.join(file)).unwrap())
        };
        let (summary, bytes) = make(5, "a.glb");
        assert!(bytes == make(5, "b.glb").1, "{kind}");
        assert!(bytes != make(6, "c.glb").1, "{kind}");
        assert!(summary["rooms"].as_u64() >= Some(9) && summary["joined"].as_u64() >= Some(8));
        let (code, _, said) = run(&dir, "verify a.glb --rays 20000 --sight 1000");
        assert_eq!(code, Some(0), "{kind}: {said}");
    }
}

#[test]
fn a_level_of_scenes_is_put_together_and_read_by_all_commands() {
    let dir = folder("level");
    let places = "place = [\n\
        { piece = \"crossing\", name = \"middle\", at = [5.0, 1.0, 2.0], turn = 10.0 },\n\
        { piece = \"straight.south\", onto = \"middle.east\" },\n\
        { piece = \"end.south\", onto = \"straight-2.north\", name = \"end\" },\n]\n\
        close = [[\"end.south\", \"straight-2.north\"]]";
    let (code, said) = assembled(&dir, places);
    assert_eq!((code, &*said), (Some(0), ""));
    let (_, printed, _) = run(&dir, "inspect w.glb --json");
    let cells = value(&printed)["cells"].as_array().unwrap().clone();
    let names: Vec<&str> = cells.iter().map(|c| c["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["outdoors", "middle", "straight-2", "end"]);
    let (code, _, said) = run(&dir, "path w.glb --from 5,2,2 --to 10.9,2,0.96");
    assert_eq!(code, Some(0), "{said}");
    for line in ["plan w.glb -o w.svg", "pvs w.glb -o w.pvs"] {
        assert_eq!(run(&dir, line).0, Some(0), "{line}");
    }
}

#[test]
fn the_palette_shows_all_pieces_and_what_fits() {
    let dir = folder("palette");
    let (code, printed, said) = run(&dir, "kit kit -o palette.html --json");
    assert_eq!((code, &*said), (Some(0), ""));
    let report = value(&printed);
    assert_eq!(report["pieces"].as_array().unwrap().len(), 5);
    assert_eq!(
        report["groups"][0].as_array().unwrap().len(),
        1 + 2 + 2 + 3 + 4
    );
    let page = fs::read_to_string(dir.join("palette.html")).unwrap();
    assert_eq!(page.matches("<svg").count(), 5);
    assert!(page.contains("<h2>crossing</h2>"));
    // One attachment by a name of its own, and a piece without any.
    let settings =
        "[pieces.end.attach]\ngate = { near = [0.0, 1.0, 9.0] }\n[pieces.fork]\nattach = {}\n";
    fs::write(dir.join("kit/kit.toml"), settings).unwrap();
    let (code, printed, said) = run(&dir, "kit kit");
    assert_eq!(code, Some(1));
    assert!(said.contains("fork: it has no attachment"), "{said}");
    assert!(
        printed.contains("gate: opening of 1.20 × 2.10 m at 0.00,0.00,1.50"),
        "{printed}"
    );
}

#[test]
fn what_does_not_fit_is_refused_with_place_and_reason_and_nothing_is_written() {
    let dir = folder("refused");
    let one = "{ piece = \"crossing\", name = \"a\" }";
    for (places, reasons) in [
        (
            format!("place = [{one}, {{ piece = \"end.south\", onto = \"a.up\" }}]"),
            vec![
                "place 2 (end.south onto a.up)",
                "no attachment \"up\"",
                "west",
            ],
        ),
        (
            format!("place = [{one}, {{ piece = \"end.south\", onto = \"b.east\" }}]"),
            vec!["there is no instance \"b\""],
        ),
        (
            format!("place = [{one}, {{ piece = \"tower\" }}]"),
            vec!["place 2 (tower)", "no piece \"tower\""],
        ),
        (
            format!("place = [{one}, {{ piece = \"end\", onto = \"a.east\" }}]"),
            vec!["which of its attachments?"],
        ),
        (
            format!("place = [{one}, {one}]"),
            vec!["another instance is named \"a\""],
        ),
        (
            format!("place = [{one}, {{ piece = \"end\", at = [1.0, 0.0, 0.0] }}]"),
            vec!["place 2 (end)", "overlap a by at least 0.900 m"],
        ),
        (
            format!("place = [{one}, {{ piece = \"end\", at = [3.0, 0.0, 1.2] }}]"),
            vec!["would be in front of", "75 %"],
        ),
        (
            format!("place = [{one}]\nclose = [[\"a.east\", \"a.west\"]]"),
            vec!["close 1", "3.000 m apart"],
        ),
        ("places = []".into(), vec!["level.toml", "line 2", "places"]),
    ] {
        let (code, said) = assembled(&dir, &places);
        assert_eq!(code, Some(1), "{places}");
        for reason in reasons {
            assert!(said.contains(reason), "{places}: {said}");
        }
    }
}

#[test]
fn bad_kits_are_refused_with_file_and_reason() {
    let dir = folder("bad");
    let twice = fs::read(dir.join("kit/end.glb")).unwrap();
    fs::write(dir.join("kit/end.obj"), twice).unwrap();
    let (code, _, said) = run(&dir, "kit kit");
    assert_eq!(code, Some(1));
    assert!(
        said.contains("two pieces are named \"end\"") && said.contains("end.obj"),
        "{said}"
    );
    fs::write(dir.join("kit/end.obj"), "").unwrap();
    fs::remove_file(dir.join("kit/end.obj")).unwrap();
    fs::write(dir.join("kit/kit.toml"), "[pieces.lost]\n").unwrap();
    let (_, _, said) = run(&dir, "kit kit");
    assert!(
        said.contains("kit.toml: the kit has no piece \"lost\""),
        "{said}"
    );
    fs::write(dir.join("kit/kit.toml"), "tolerance = 5\n").unwrap();
    assert!(run(&dir, "kit kit").2.contains("tolerance 5"));
    fs::write(
        dir.join("kit/kit.toml"),
        "[pieces.end.attach]\na = { portal = 7 }\n",
    )
    .unwrap();
    let (_, _, said) = run(&dir, "kit kit");
    assert!(
        said.contains("end.glb") && said.contains("portal-7 does not lead outdoors"),
        "{said}"
    );
    fs::remove_file(dir.join("kit/kit.toml")).unwrap();
    // A cave has no outdoors.
    let cave = export_glb(&gjorup_cavern([0.0; 3]).scene);
    fs::write(dir.join("kit/cave.glb"), cave).unwrap();
    let (_, _, said) = run(&dir, "kit kit");
    assert!(said.contains("cave: it has no attachment"), "{said}");
    fs::create_dir(dir.join("empty")).unwrap();
    assert!(run(&dir, "kit empty").2.contains("has no pieces"));
    assert!(
        run(&dir, "kit nowhere")
            .2
            .contains("cannot read the kit nowhere")
    );
}
