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
fn counts_are_those_of_the_picture() {
    use enfilade_render::{AdapterChoice, Camera, Culling, Gpu, Sparing, Studio};
    let path = grid("counts.glb");
    let world = room_grid(&GridParams::offices(24, 1));
    let gpu = Gpu::open(&AdapterChoice::Software).unwrap();
    let mut studio = Studio::new(gpu, &world).unwrap();
    let (mut tried, mut spared) = (0, 0);
    for (_, cell) in world.graph.indoor_cells().take(6) {
        let eye = [0, 1, 2].map(|k| (cell.aabb[0][k] + cell.aabb[1][k]) * 0.5);
        let look = [eye[0] + 1.0, eye[1], eye[2] + 0.3];
        let words = |p: [f32; 3]| p.map(|x| x.to_string()).join(",");
        let out = place("counts.png");
        let done = enfilade(&[
            "render",
            &path,
            "-o",
            out.to_str().unwrap(),
            "--eye",
            &words(eye),
            "--look",
            &words(look),
            "--size",
            "160x90",
            "--stop",
            "150",
            "--objects",
            "700",
            "--plain",
            "--json",
            "--adapter",
            "software",
        ]);
        assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
        let said: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
        // Pictures are drawn at twice their size and halved: four pixels for each.
        let size = [320, 180];
        let camera = Camera {
            fov_y: enfilade_render::PHOTO_FOV,
            ..Camera::looking_at(eye, look)
        };
        let view = camera.view(size[0] as f32 / size[1] as f32).unwrap();
        studio.sparing = Sparing::default();
        let all = studio
            .list(&view, eye, Culling::Portals, size)
            .n_triangles();
        studio.sparing = Sparing {
            stop_below: 600.0,
            objects_below: 2800.0,
            ..Sparing::default()
        };
        let list = studio.list(&view, eye, Culling::Portals, size);
        assert_eq!(said["triangles"], list.n_triangles(), "at {eye:?}");
        assert_eq!(said["draws"], list.n_draws(), "at {eye:?}");
        tried += 1;
        spared += u32::from(list.n_triangles() < all);
    }
    assert!(
        tried == 6 && spared > 0,
        "{spared} of {tried} are spared something"
    );
}

#[test]
fn lamps_of_the_world_are_lit() {
    use enfilade_geom::scene::{Fixture, FixtureKind};
    use enfilade_geom::{DMat4, DVec3};
    let mut world = room_grid(&GridParams::offices(24, 1));
    let (_, cell) = world.graph.indoor_cells().next().unwrap();
    let [low, high] = cell.aabb;
    let at = [0, 1, 2].map(|k| (low[k] + high[k]) * 0.5);
    world.fixtures.push(Fixture {
        kind: FixtureKind::Light,
        name: "bulb".into(),
        transform: DMat4::from_translation(DVec3::from_array(at.map(f64::from))),
        gltf: r#"{"type":"point","intensity":80}"#.into(),
        extras: String::new(),
    });
    let path = place("lamps.glb");
    fs::write(&path, encode_glb(&world).unwrap()).unwrap();
    let words = |p: [f32; 3]| p.map(|x| x.to_string()).join(",");
    let (eye, look) = (
        words([at[0], at[1], at[2] + 0.5]),
        words([at[0] + 1.0, at[1], at[2]]),
    );
    let draw = |extra: &[&str]| {
        let out = place("lamps.png");
        let mut args = vec![
            "render",
            path.to_str().unwrap(),
            "-o",
            out.to_str().unwrap(),
            "--eye",
            &eye,
            "--look",
            &look,
            "--size",
            "64x36",
            "--adapter",
            "software",
        ];
        args.extend(extra);
        let done = enfilade(&args);
        assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
        fs::read(&out).unwrap()
    };
    let [lit, dark, night, black] = [
        &[][..],
        &["--no-lamps"],
        &["--daylight", "0"],
        &["--no-lamps", "--daylight", "0"],
    ]
    .map(draw);
    assert_ne!(lit, dark);
    assert_ne!(night, black);
    assert_ne!(lit, night);
    let bad = enfilade(&[
        "render",
        path.to_str().unwrap(),
        "-o",
        "x.png",
        "--daylight",
        "2",
    ]);
    assert_eq!(bad.status.code(), Some(2));
}

#[test]
fn overdraw_has_a_scale() {
    let world = grid("overdraw.glb");
    let out = place("overdraw.png");
    let args = [
        "--size",
        "320x180",
        "--paint",
        "overdraw",
        "--adapter",
        "software",
    ];
    let done = enfilade(&[&["render", &world, "-o", out.to_str().unwrap()], &args[..]].concat());
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    let picture = enfilade_render::Picture::from_png(&fs::read(&out).unwrap()).unwrap();
    // White stands for 16 draws and more, which these rooms never need.
    let white = picture
        .rgba
        .chunks_exact(4)
        .filter(|p| *p == [255; 4])
        .count();
    assert!(white > 20, "{white} white pixels");
}

#[test]
fn a_photographer_stands_in_a_corner_and_sees_far() {
    use enfilade_render::{AdapterChoice, Gpu, Studio};
    use enfilade_render::{EYE_HEIGHT, good_camera};
    let world = room_grid(&GridParams::offices(24, 1));
    let gpu = || Gpu::open(&AdapterChoice::Software).unwrap();
    let mut studio = Studio::new(gpu(), &world).unwrap();
    let camera = good_camera(&mut studio, &world).unwrap();
    assert_eq!(
        camera,
        good_camera(&mut studio, &world).unwrap(),
        "the same each time"
    );
    let cell = studio.sight.locate(camera.eye).expect("it is in a room");
    let [low, high] = world.graph[cell].aabb;
    assert!(!world.graph[cell].outdoor);
    assert!(
        (camera.eye[1] - low[1] - EYE_HEIGHT).abs() < 0.05,
        "{camera:?}"
    );
    // Closer to walls than to the middle, on both axes, and turned towards the middle.
    let middle = [0, 2].map(|k| (low[k] + high[k]) * 0.5);
    let from = [camera.eye[0] - middle[0], camera.eye[2] - middle[1]];
    for (k, axis) in [(0, 0), (1, 2)] {
        assert!(
            from[k].abs() > (high[axis] - low[axis]) * 0.2,
            "{camera:?} in {low:?} {high:?}"
        );
    }
    assert!(camera.toward[0] * from[0] + camera.toward[2] * from[1] < 0.0);
    // A world without rooms is shown from outside, all of it.
    let mut shell = world.clone();
    for cell in &mut shell.graph.cells {
        cell.outdoor = true;
    }
    let mut studio = Studio::new(gpu(), &shell).unwrap();
    let camera = good_camera(&mut studio, &shell).unwrap();
    let [low, high] = studio.world.bounds();
    assert!((0..3).any(|k| camera.eye[k] < low[k] || camera.eye[k] > high[k]));
    let projection = camera.projection(16.0 / 9.0).unwrap();
    for i in 0..8 {
        let corner = [0, 1, 2].map(|k| [low, high][i >> k & 1][k]);
        let [x, y] = projection.place(corner).expect("before the eye");
        assert!(
            (0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y),
            "{corner:?}"
        );
    }
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
