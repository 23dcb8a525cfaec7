//! Plans of generated and of real scenes: every room is drawn and named, and the number of storeys is as a person
//! counts.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use enfilade::World;
use enfilade::import::export_glb;
use enfilade_report::{PlanOptions, find_storeys, plan_svg};
use enfilade_testkit::{
    Generated, TowerParams, Variant, cave, furnished_house, gjorup_cavern, gjorup_rooms, mixed,
    office_tower,
};

fn enfilade(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(args)
        .output()
        .unwrap()
}

fn folder(name: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("plans-{name}"));
    let _ = std::fs::remove_dir_all(&dir);
    std::fs::create_dir_all(&dir).unwrap();
    dir
}

fn baked(dir: &Path, name: &str, scene: &[&str]) -> World {
    let world = dir.join(format!("{name}-world.glb"));
    let world = world.to_str().unwrap();
    let done = enfilade(&[&["bake", "-q"], scene, &["-o", world]].concat());
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{name}: {said}");
    enfilade::open(world).unwrap()
}

/// The cells of the elements with these beginnings.
fn cells(svg: &str, starts: &[&str]) -> BTreeSet<u32> {
    let lines = svg
        .lines()
        .filter(|l| starts.iter().any(|s| l.starts_with(s)));
    let id = |line: &str| {
        let (_, rest) = line.split_once("data-cell=\"")?;
        rest.split_once('"')?.0.parse().ok()
    };
    lines.filter_map(id).collect()
}

/// Checks that each room is drawn and named, and returns the number of storeys.
fn check(name: &str, world: &World) -> usize {
    let svg = plan_svg(world, &PlanOptions::default());
    let indoor = world.graph.indoor_cells();
    // Plans hatch voids only where a cut passes.
    let indoor = indoor.filter(|(_, cell)| !cell.is_void);
    let indoor: BTreeSet<u32> = indoor.map(|(id, _)| id.0).collect();
    let shapes = ["<path class=\"cell\"", "<path class=\"thin\""];
    assert_eq!(cells(&svg, &shapes), indoor, "{name}: drawn");
    assert_eq!(cells(&svg, &["<text"]), indoor, "{name}: named");
    let storeys = find_storeys(world);
    let on: BTreeSet<u32> = storeys
        .iter()
        .flat_map(|s| s.cells.iter().map(|c| c.0))
        .collect();
    assert_eq!(on, indoor, "{name}: on a storey");
    storeys.iter().filter(|s| !s.is_between).count()
}

#[test]
fn every_room_of_generated_scenes_is_on_a_plan() {
    let dir = folder("generated");
    let tower = office_tower(&TowerParams::with_rooms(64, 3));
    let mut scenes: Vec<(Generated, Option<usize>)> = vec![
        (furnished_house(), Some(3)),
        (tower, Some(4)),
        (gjorup_rooms(Variant::Optimised, [0.0; 3]), None),
        (gjorup_cavern([0.0; 3]), None),
        (cave(2), None),
    ];
    scenes.extend(mixed::all().into_iter().map(|s| (s, None)));
    for (generated, n_storeys) in scenes {
        let name = &generated.truth.scene;
        let scene = dir.join(format!("{name}.glb"));
        std::fs::write(&scene, export_glb(&generated.scene)).unwrap();
        let world = baked(&dir, name, &[scene.to_str().unwrap()]);
        let found = check(name, &world);
        assert!(
            n_storeys.is_none_or(|n| n == found),
            "{name}: {found} storeys"
        );
    }
}

#[test]
fn every_room_of_real_scenes_is_on_a_plan() {
    let scenes = std::env::var_os("ENFILADE_SCENES").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes"),
        PathBuf::from,
    );
    let dir = folder("real");
    for (file, storeys) in [
        ("fzk-haus/scene.glb", 2..=2),
        ("institute/scene.glb", 5..=5),
        ("kit-edc/scene.glb", 3..=3),
        ("recast-dungeon/scene.glb", 1..=1),
        // Floors at 11 heights, of which some lie above others.
        ("quake/id_e1m1.map", 2..=3),
        ("foreign/darkzone.map", 2..=4),
    ] {
        let scene = scenes.join(file);
        if !scene.exists() {
            eprintln!("skipped: {} is not there", scene.display());
            continue;
        }
        let name = file.replace(['/', '.'], "-");
        let world = baked(&dir, &name, &[scene.to_str().unwrap()]);
        let found = check(file, &world);
        assert!(storeys.contains(&found), "{file}: {found} storeys");
    }
}

#[test]
fn the_extension_says_what_is_written_and_a_storey_can_be_chosen() {
    let dir = folder("files");
    let scene = dir.join("house.glb");
    std::fs::write(&scene, export_glb(&furnished_house().scene)).unwrap();
    baked(&dir, "house", &[scene.to_str().unwrap(), "--voxel", "0.2"]);
    let plan = |args: &str| {
        Command::new(env!("CARGO_BIN_EXE_enfilade"))
            .args(["plan", "house-world.glb"])
            .args(args.split(' '))
            .current_dir(&dir)
            .output()
            .unwrap()
    };
    let file = |name: &str| std::fs::read(dir.join(name)).unwrap();
    for (args, name, start) in [
        ("-o a.svg", "a.svg", &b"<?xml"[..]),
        ("-o a.png --width 400", "a.png", b"\x89PNG"),
        ("-o a.pdf --paper a3 --scale 1:100", "a.pdf", b"%PDF-"),
    ] {
        let done = plan(args);
        assert!(done.status.success(), "{args}: {done:?}");
        assert!(file(name).starts_with(start), "{args}");
        assert!(plan(args).status.success());
    }
    let width = u32::from_be_bytes(file("a.png")[16..20].try_into().unwrap());
    assert_eq!(width, 400);
    let pages = file("a.pdf");
    let pages = String::from_utf8_lossy(&pages);
    assert!(pages.contains("/Count 3"), "a page for each storey");

    let storeys = |name: &str| {
        let svg = String::from_utf8(file(name)).unwrap();
        svg.matches("class=\"storey\"").count()
    };
    assert_eq!(storeys("a.svg"), 3);
    assert!(plan("-o one.svg --storey 2").status.success());
    assert_eq!(storeys("one.svg"), 1);
    assert!(
        String::from_utf8(file("one.svg"))
            .unwrap()
            .contains("Storey 2 of 3")
    );
    // The attic, by the name of its room.
    let done = plan("-o attic.svg --storey cell-1 --json");
    let told: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(told["storeys"].as_array().unwrap().len(), 1, "{told}");
    assert!(
        told["storeys"][0]["cells"]
            .as_array()
            .unwrap()
            .contains(&1.into())
    );
    let done = plan("-o of-{}.svg --json");
    let told: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(told["plans"][2]["file"], "of-3.svg", "{told}");
    assert!((1..=3).all(|k| storeys(&format!("of-{k}.svg")) == 1));

    for (args, said) in [
        ("-o x.svg --storey 9", "its storeys are 1, 2, 3"),
        ("-o x.svg --scale 1:50", "leave --scale out"),
        ("-o x.pdf --scale 1:20", "use 1:75 or larger paper"),
        ("-o x.pdf --paper B7", "a size of paper is needed: A5, A4"),
        ("-o x.pdf --scale 0.5", "a scale from 1:1"),
        ("-o x.png --width 99999", "16384"),
        ("-o x.png --width 300 --storey none", "has no storey none"),
    ] {
        let done = plan(args);
        let text = String::from_utf8_lossy(&done.stderr);
        assert!(
            !done.status.success() && text.contains(said),
            "{args}: {text}"
        );
        let name = args.split(' ').nth(1).unwrap();
        assert!(!dir.join(name).exists(), "{args}");
    }
}
