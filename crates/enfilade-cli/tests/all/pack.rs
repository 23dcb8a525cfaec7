//! A packed world unpacks to the same bytes, and nothing else is replaced by one.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use enfilade_testkit::{GridParams, room_grid};

fn folder(name: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("pack-{name}"));
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir).unwrap();
    enfilade::save(dir.join("w.glb"), &room_grid(&GridParams::offices(12, 1))).unwrap();
    dir
}

/// Runs the command in a folder; returns success, standard output and standard error.
fn run(dir: &Path, line: &str) -> (bool, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
    let done = command
        .args(line.split(' '))
        .current_dir(dir)
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (
        done.status.success(),
        text(&done.stdout),
        text(&done.stderr),
    )
}

#[test]
fn a_packed_world_unpacks_to_the_same_bytes() {
    let dir = folder("same");
    let glb = fs::read(dir.join("w.glb")).unwrap();
    for line in [
        "pack w.glb -o w.enf",
        "pack w.glb -o one.enf --one-file",
        // A packed world is replaced.
        "pack w.glb -o w.enf",
    ] {
        let (is_done, out, err) = run(&dir, line);
        assert!(is_done, "{err}");
        assert!(
            out.contains("the head takes") && out.contains("wrote "),
            "{out}"
        );
    }
    for packed in ["w.enf", "one.enf"] {
        let (is_done, out, err) = run(&dir, &format!("unpack {packed} -o back.glb"));
        assert!(is_done, "{err}");
        assert!(out.starts_with("wrote back.glb ("), "{out}");
        assert!(fs::read(dir.join("back.glb")).unwrap() == glb, "{packed}");
    }
    // Commands read packed worlds as they are.
    let (_, whole, _) = run(&dir, "inspect w.glb --json");
    let (is_done, packed, err) = run(&dir, "inspect w.enf --json");
    assert!(is_done, "{err}");
    let [whole, packed]: [serde_json::Value; 2] =
        [whole, packed].map(|json| serde_json::from_str(&json).unwrap());
    assert_eq!(whole["cells"], packed["cells"]);
    let (_, json, _) = run(&dir, "pack w.glb -o w.enf --json");
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["original"], glb.len());
}

#[test]
fn a_walk_opens_the_world_beside_its_page() {
    let dir = folder("walk");
    let made = |page: &str| -> serde_json::Value {
        let page = fs::read_to_string(dir.join(page)).unwrap();
        let start = page.find("data-walk=\"").unwrap() + "data-walk=\"".len();
        let text = page[start..].split('"').next().unwrap();
        serde_json::from_str(&text.replace("&quot;", "\"")).unwrap()
    };
    for (line, page, world) in [
        ("pack w.glb -o w.enf --walk", "w.enf/index.html", "./"),
        (
            "pack w.glb -o one.enf --one-file --walk",
            "one-walk.html",
            "one.enf",
        ),
        (
            "report w.glb -o r.html --walk --no-pictures",
            "r-walk.html",
            "w.glb",
        ),
    ] {
        let (is_done, _, err) = run(&dir, line);
        assert!(is_done, "{line}: {err}");
        let made = made(page);
        assert_eq!(made["page"]["world"], world, "{line}");
        assert_eq!(made["hasFirst"], page != "r-walk.html", "{line}");
        let storeys = made["page"]["storeys"].as_array().unwrap();
        assert!(!storeys.is_empty() && storeys[0]["name"] == "1", "{line}");
    }
    assert!(
        fs::read_to_string(dir.join("r.html"))
            .unwrap()
            .contains("href=\"r-walk.html\"")
    );
    assert_eq!(made("w.enf/index.html")["page"]["title"], "W");
    let size = |name: &str| fs::metadata(dir.join("w.enf").join(name)).unwrap().len();
    let first = ["index.html", "walk-code.bin", "walk-first.bin"].map(size);
    assert!(first.iter().sum::<u64>() < 300_000, "{first:?}");
    assert!(size("walk-module.bin") > 100_000);
    // The page is not a part of the world.
    let (is_done, _, err) = run(&dir, "unpack w.enf -o back.glb");
    assert!(is_done, "{err}");
    assert!(fs::read(dir.join("back.glb")).unwrap() == fs::read(dir.join("w.glb")).unwrap());
    let (is_done, _, err) = run(&dir, "report w.glb -o - --walk --no-pictures");
    assert!(!is_done && err.contains("--walk"), "{err}");
}

#[test]
fn what_is_no_packed_world_is_neither_replaced_nor_read() {
    let dir = folder("refused");
    fs::create_dir_all(dir.join("other")).unwrap();
    fs::write(dir.join("other/thing"), "mine").unwrap();
    for (line, message) in [
        ("pack w.glb -o w.glb", "writes a packed world"),
        ("pack w.glb -o other", "is a folder with other contents"),
        ("pack other/thing -o x.enf", "this is not a GLB file"),
        ("unpack w.glb -o x.glb", "this is not a packed world"),
        ("unpack other -o x.glb", "other"),
    ] {
        let (is_done, _, err) = run(&dir, line);
        assert!(!is_done && err.contains(message), "{line}: {err}");
    }
    assert_eq!(fs::read(dir.join("other/thing")).unwrap(), b"mine");
    assert!(!dir.join("x.enf").exists() && !dir.join("x.glb").exists());
}

#[test]
fn an_app_is_the_walk_and_the_packed_world_in_one_folder() {
    let dir = folder("app");
    let glb = fs::read(dir.join("w.glb")).unwrap();
    // The second time, the folder is replaced.
    for _ in 0..2 {
        let (is_done, out, err) = run(&dir, "pack w.glb --app site");
        assert!(is_done, "{err}");
        assert!(out.contains("wrote site"), "{out}");
    }
    let page = fs::read_to_string(dir.join("site/index.html")).unwrap();
    assert!(page.contains("&quot;world&quot;:&quot;world.enf/&quot;"));
    // A link names a world on another host.
    assert!(page.contains("#world="));
    for part in ["walk-code.bin", "walk-module.bin"] {
        assert!(dir.join("site").join(part).is_file(), "{part}");
    }
    let (is_done, _, err) = run(&dir, "unpack site/world.enf -o back.glb");
    assert!(is_done, "{err}");
    assert!(fs::read(dir.join("back.glb")).unwrap() == glb);
    // Nothing else is replaced, and one place is enough.
    fs::create_dir(dir.join("mine")).unwrap();
    fs::write(dir.join("mine/a.txt"), "mine").unwrap();
    let (is_done, _, err) = run(&dir, "pack w.glb --app mine");
    assert!(
        !is_done && err.contains("choose another name with --app"),
        "{err}"
    );
    assert!(!run(&dir, "pack w.glb --app site -o w.enf").0);
    assert!(!run(&dir, "pack w.glb").0);
}
