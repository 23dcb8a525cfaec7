//! `-` is standard input among inputs and standard output among outputs.

use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use enfilade_testkit::{GridParams, room_grid};

/// A folder with a world and a scene.
fn folder(name: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("streams-{name}"));
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir).unwrap();
    enfilade::save(dir.join("w.glb"), &room_grid(&GridParams::offices(3, 1))).unwrap();
    let scene = enfilade_testkit::furnished_house().scene;
    fs::write(dir.join("house.glb"), enfilade::import::export_glb(&scene)).unwrap();
    dir
}

fn run(dir: &PathBuf, line: &str, input: &[u8]) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(line.split(' '))
        .current_dir(dir)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let input = input.to_vec();
    // A command that stops reading closes the pipe.
    let feeder = std::thread::spawn(move || drop(stdin.write_all(&input)));
    let done = child.wait_with_output().unwrap();
    feeder.join().unwrap();
    done
}

fn said(done: &Output) -> String {
    String::from_utf8_lossy(&done.stderr).into_owned()
}

#[test]
fn a_command_in_a_pipe_answers_as_with_files() {
    let dir = folder("pipe");
    let world = fs::read(dir.join("w.glb")).unwrap();
    let n_files = fs::read_dir(&dir).unwrap().count();
    // A line, the same with files, and the file whose bytes the first prints; without a file, both print the same.
    for (piped, filed, file) in [
        ("plan - -o -", "plan w.glb -o x.svg", Some("x.svg")),
        ("pvs - -o -", "pvs w.glb -o x.pvs", Some("x.pvs")),
        ("pvs -", "pvs w.glb -o x.pvs", Some("x.pvs")),
        (
            "pvs - -o /dev/null --into -",
            "pvs w.glb -o x.pvs --into x.glb",
            Some("x.glb"),
        ),
        (
            "pvs - -o /dev/null --mutual -",
            "pvs w.glb -o x.pvs --mutual x.txt",
            Some("x.txt"),
        ),
        (
            "simplify - --max-cells 2 -o -",
            "simplify w.glb --max-cells 2 -o x.glb",
            Some("x.glb"),
        ),
        (
            "edit - --delete-portal 0 -o -",
            "edit w.glb --delete-portal 0 -o x.glb",
            Some("x.glb"),
        ),
        ("inspect - --json", "inspect w.glb --json", None),
        (
            "see - --eye 2,1.6,2 --look 3,1.6,2 --json",
            "inspect w.glb",
            None,
        ),
        (
            "verify - --rays 2000 --sight 10",
            "verify w.glb --rays 2000 --sight 10",
            None,
        ),
    ] {
        let (one, other) = (run(&dir, piped, &world), run(&dir, filed, b""));
        assert!(one.status.success(), "{piped}: {}", said(&one));
        assert!(other.status.success(), "{filed}: {}", said(&other));
        if let Some(file) = file {
            assert!(one.stdout == fs::read(dir.join(file)).unwrap(), "{piped}");
            // Results otherwise printed go to standard error.
            assert_eq!(other.stdout.is_empty(), said(&one).is_empty(), "{piped}");
        } else if !piped.starts_with("see") {
            assert!(one.stdout == other.stdout, "{piped}");
        }
        for file in ["x.svg", "x.pvs", "x.glb", "x.txt"] {
            let _ = fs::remove_file(dir.join(file));
        }
        assert_eq!(fs::read_dir(&dir).unwrap().count(), n_files, "{piped}");
    }
    let page = run(&dir, "report - --no-pictures --views 2 -o -", &world);
    assert!(
        page.stdout
            .to_ascii_lowercase()
            .starts_with(b"<!doctype html>"),
        "{}",
        said(&page)
    );
    fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn a_scene_is_baked_from_one_pipe_into_another() {
    let dir = folder("bake");
    let house = fs::read(dir.join("house.glb")).unwrap();
    let done = run(&dir, "bake - -o - --voxel 0.2", &house);
    assert!(done.status.success(), "{}", said(&done));
    assert!(
        said(&done).contains("cells indoors") && said(&done).contains("wrote to standard output")
    );
    let filed = run(&dir, "bake house.glb -o x.glb --voxel 0.2", b"");
    assert!(filed.status.success(), "{}", said(&filed));
    assert!(done.stdout == fs::read(dir.join("x.glb")).unwrap());
    // Formats are recognized by content; a scene that refers to other files has no folder to look in.
    let obj = b"v 0 0 0\nv 4 0 0\nv 0 3 0\nf 1 2 3\n";
    let done = run(&dir, "bake - -o - --allow-empty", obj);
    assert!(done.stdout.starts_with(b"glTF"), "{}", said(&done));
    let settings = run(&dir, "bake house.glb --config - -o y.glb", b"voxel = 0.2\n");
    assert!(settings.status.success(), "{}", said(&settings));
    assert!(fs::read(dir.join("y.glb")).unwrap() == filed_bytes(&dir));
    let nothing = run(&dir, "bake - -o z.glb", b"hello");
    assert_eq!(nothing.status.code(), Some(1));
    assert!(
        said(&nothing).contains("standard input"),
        "{}",
        said(&nothing)
    );
    fs::remove_dir_all(&dir).unwrap();
}

fn filed_bytes(dir: &std::path::Path) -> Vec<u8> {
    fs::read(dir.join("x.glb")).unwrap()
}

#[test]
fn a_stream_is_one_input_and_one_output() {
    let dir = folder("once");
    let once = "standard input can be read once only";
    let world = fs::read(dir.join("w.glb")).unwrap();
    for (line, says) in [
        ("bake - - -o x.glb", once),
        ("bake - --detail - -o x.glb", once),
        ("bake - --config - -o x.glb", once),
        ("verify - --source -", once),
        ("verify - --evidence -", once),
        ("render - --path - -o x.png", once),
        ("locate -", "give the world as a file"),
        ("decimate - --steps", "give files to read"),
        ("bake w.glb -o - --leak -", "is to be written by -o, too"),
        (
            "render w.glb -o - --record -",
            "is to be written by --record, too",
        ),
        ("render w.glb --walk 2 -o -", "another name than '-'"),
        ("pvs w.glb -o - --into -", "is to be written by -o, too"),
        ("pvs - --evidence -", "is to be written by -o, too"),
        ("pvs w.glb --checkpoint -", "give it a file"),
        (
            "verify w.glb --views 1 --pictures -",
            "another name than '-'",
        ),
        ("demo -o -", "another name than '-'"),
    ] {
        let done = run(&dir, line, &world);
        assert_eq!(done.status.code(), Some(1), "{line}: {}", said(&done));
        assert!(said(&done).contains(says), "{line}: {}", said(&done));
        assert!(done.stdout.is_empty(), "{line}");
    }
    assert_eq!(fs::read_dir(&dir).unwrap().count(), 2);
    fs::remove_dir_all(&dir).unwrap();
}

#[cfg(target_os = "linux")]
#[test]
fn an_endless_stream_is_no_world_and_takes_no_memory() {
    let dir = folder("endless");
    fs::write(dir.join("c.toml"), "voxel = 0.2\n").unwrap();
    for line in [
        "inspect - < /dev/zero",
        "plan /dev/zero -o x.svg",
        "verify - < /dev/zero",
        "pvs - < /dev/zero",
        "simplify - --max-cells 2 -o x.prt < /dev/zero",
        "bake - -o x.glb < /dev/zero",
        "decimate - < /dev/zero",
        "verify w.glb --source - < /dev/zero",
        "bake - -o x.glb --config c.toml < /dev/zero",
    ] {
        let shell = format!("ulimit -v 2097152 && exec \"$0\" {line}");
        let done = Command::new("sh")
            .args(["-c", &shell, env!("CARGO_BIN_EXE_enfilade")])
            .current_dir(&dir)
            .output()
            .unwrap();
        assert_eq!(done.status.code(), Some(1), "{line}: {}", said(&done));
        // The head is enough to decide.
        assert!(!said(&done).contains("cannot read"), "{}", said(&done));
    }
    for (line, says) in [
        ("bake - -o x.glb", "standard input: not a glTF"),
        ("bake w.glb --config - -o x.glb", "more than 67108864 bytes"),
    ] {
        let shell = format!("ulimit -v 2097152 && yes hello | \"$0\" {line}");
        let done = Command::new("sh")
            .args(["-c", &shell, env!("CARGO_BIN_EXE_enfilade")])
            .current_dir(&dir)
            .output()
            .unwrap();
        assert_eq!(done.status.code(), Some(1), "{line}: {}", said(&done));
        assert!(said(&done).contains(says), "{line}: {}", said(&done));
    }
    fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn a_file_cut_short_by_its_reader_is_a_failure_and_a_list_is_none() {
    let dir = folder("cut");
    for (line, code) in [
        ("bake house.glb --voxel 0.2 -o -", 1),
        ("simplify house-world.glb --max-cells 2 -o -", 1),
        ("plan house-world.glb -o -", 1),
        ("completions bash", 0),
        ("inspect house-world.glb", 0),
        ("bake house.glb --voxel 0.2 -o house-world.glb", 0),
    ]
    .iter()
    .rev()
    {
        let mut child = Command::new(env!("CARGO_BIN_EXE_enfilade"))
            .args(line.split(' '))
            .current_dir(&dir)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let done = child.wait_with_output().unwrap();
        assert_eq!(done.status.code(), Some(*code), "{line}: {}", said(&done));
        assert_eq!(said(&done).contains("is cut off"), *code == 1, "{line}");
    }
    fs::remove_dir_all(&dir).unwrap();
}
