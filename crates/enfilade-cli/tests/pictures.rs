//! `render`, `verify --views` and `report`, run as commands, with the software adapter.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use enfilade_cpg::wire::encode_glb;
use enfilade_testkit::{GridParams, room_grid};

fn enfilade(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(args)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

fn place(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name)
}

fn grid(name: &str) -> String {
    let path = place(name);
    let world = room_grid(&GridParams::offices(24, 1));
    fs::write(&path, encode_glb(&world).unwrap()).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn render_finds_a_view_and_says_where_it_is() {
    let world = grid("render.glb");
    let out = place("render.png");
    let args = [
        "render",
        &world,
        "-o",
        out.to_str().unwrap(),
        "--size",
        "160x90",
        "--adapter",
        "software",
    ];
    let done = enfilade(&args);
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    let said = text(&done.stdout);
    assert!(
        said.contains("--eye") && said.contains("triangles"),
        "{said}"
    );
    let png = fs::read(&out).unwrap();
    assert!(
        png.starts_with(b"\x89PNG") && png.len() > 500,
        "{} bytes",
        png.len()
    );
}

#[test]
fn a_path_that_was_recorded_gives_the_same_pictures_again() {
    let world = grid("path.glb");
    let (first, again, path) = (place("walk.png"), place("again.png"), place("walk.txt"));
    let common = ["--size", "64x36", "--plain", "--adapter", "software"];
    let mut args = vec![
        "render",
        &world,
        "-o",
        first.to_str().unwrap(),
        "--walk",
        "3",
    ];
    args.extend(["--record", path.to_str().unwrap()]);
    args.extend(common);
    let done = enfilade(&args);
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    let mut args = vec!["render", &world, "-o", again.to_str().unwrap()];
    args.extend(["--path", path.to_str().unwrap()]);
    args.extend(common);
    let done = enfilade(&args);
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    for n in 1..=3 {
        let read = |name: &str| fs::read(place(&format!("{name}-000{n}.png"))).unwrap();
        assert_eq!(read("walk"), read("again"));
    }
}

#[test]
fn views_are_compared_pixel_by_pixel() {
    let world = grid("views.glb");
    let args = [
        "verify",
        &world,
        "--rays",
        "100",
        "--views",
        "20",
        "--adapter",
        "software",
        "--json",
    ];
    let done = enfilade(&args);
    let report: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(report["exact"]["views"], 20);
    assert_eq!(report["exact"]["differing"], 0, "{report}");
    assert!(report["exact"]["pixels"].as_u64().unwrap() > 1_000_000);
}

#[test]
fn a_report_needs_no_adapter() {
    let world = grid("report.glb");
    let out = place("report.html");
    let args = [
        "report",
        &world,
        "-o",
        out.to_str().unwrap(),
        "--no-pictures",
        "--views",
        "20",
    ];
    let done = enfilade(&args);
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    let page = fs::read_to_string(&out).unwrap();
    for part in ["Plans", "Graph", "Visibility", "On a walk", "Rooms"] {
        assert!(page.contains(&format!("<h2>{part}</h2>")), "{part}");
    }
    assert!(!page.contains("<img"));
}

#[test]
fn what_cannot_be_drawn_is_said() {
    let world = grid("bad.glb");
    let cut = place("cut.glb");
    let whole = fs::read(&world).unwrap();
    fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
    let png = place("bad.png");
    let png = png.to_str().unwrap();
    let refused = |args: &[&str], code: i32, words: &str| {
        let done = enfilade(args);
        let said = text(&done.stderr);
        assert_eq!(done.status.code(), Some(code), "{args:?}: {said}");
        assert!(said.contains(words), "{args:?}: {said}");
    };
    refused(
        &["render", cut.to_str().unwrap(), "-o", png],
        1,
        "cut off or damaged",
    );
    refused(
        &["render", &world, "-o", png, "--adapter", "nobody's"],
        1,
        "no adapter is named",
    );
    refused(
        &["render", &world, "-o", png, "--close", "9999"],
        1,
        "no portal 9999",
    );
    refused(&["render", &world, "-o", png, "--fov", "190"], 2, "angle");
    refused(
        &["render", &world, "-o", png, "--eye", "1,1,1"],
        2,
        "--look",
    );
    let nowhere = [
        "render", &world, "-o", png, "--eye", "1,1,1", "--look", "1,1,1",
    ];
    refused(&nowhere, 1, "direction");
}

#[test]
fn the_environment_tells_how_adapters_are_spoken_to() {
    let world = grid("backend.glb");
    let out = place("backend.png");
    let by = |backend: &str| {
        Command::new(env!("CARGO_BIN_EXE_enfilade"))
            .args(["render", &world, "-o", out.to_str().unwrap()])
            .args(["--size", "64x36", "--adapter", "software"])
            .env("WGPU_BACKEND", backend)
            .output()
            .unwrap()
    };
    let none = by("nonsense");
    let said = text(&none.stderr);
    assert_eq!(none.status.code(), Some(1), "{said}");
    assert!(said.contains("WGPU_BACKEND=nonsense"), "{said}");
    let mut n = 0;
    for backend in ["vulkan", "gl"] {
        let done = by(backend);
        if done.status.code() == Some(1) {
            eprintln!("no software by {backend}: not tried");
            continue;
        }
        let said = text(&done.stdout);
        assert!(said.contains(&format!("({backend})")), "{said}");
        n += 1;
    }
    assert!(n > 0, "neither Vulkan nor OpenGL draws here");
}
