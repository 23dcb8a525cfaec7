//! Quake maps through the command: baked by partition, leaks refused, worlds simplified and edited.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn enfilade(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(args)
        .output()
        .unwrap()
}

fn boxed(min: [i32; 3], max: [i32; 3]) -> String {
    let mut out = "{\n".to_owned();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for high in [false, true] {
            let base = if high { max } else { min };
            let (mut a, mut c) = (base, base);
            a[if high { u } else { v }] += 16;
            c[if high { v } else { u }] += 16;
            for p in [a, base, c] {
                write!(out, "( {} {} {} ) ", p[0], p[1], p[2]).unwrap();
            }
            writeln!(out, "wall 0 0 0 1 1").unwrap();
        }
    }
    out + "}\n"
}

/// Two rooms with a doorway, a light in the first; the ceiling starts at `ceiling_from`, which may leave a gap.
fn map(ceiling_from: i32) -> String {
    let boxes = [
        ([-16, -16, -16], [288, 144, 0]),
        ([ceiling_from, -16, 96], [288, 144, 112]),
        ([-16, -16, 0], [288, 0, 96]),
        ([-16, 128, 0], [288, 144, 96]),
        ([-16, 0, 0], [0, 128, 96]),
        ([272, 0, 0], [288, 128, 96]),
        ([128, 0, 0], [144, 48, 96]),
        ([128, 80, 0], [144, 128, 96]),
        ([128, 48, 64], [144, 80, 96]),
    ];
    let brushes: String = boxes.iter().map(|&(min, max)| boxed(min, max)).collect();
    format!(
        "{{\n\"classname\" \"worldspawn\"\n{brushes}}}\n{{\n\"classname\" \"light\"\n\"origin\" \"64 64 48\"\n}}\n"
    )
}

struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path =
            std::env::temp_dir().join(format!("enfilade-maps-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn path(&self, name: &str) -> String {
        Path::new(&self.0).join(name).display().to_string()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

// Covers B2, P1 and P4.
#[test]
fn a_map_is_baked_by_partition_verified_simplified_and_edited() {
    let folder = Folder::new("whole");
    let (input, world) = (folder.path("two.map"), folder.path("w.glb"));
    std::fs::write(&input, map(-16)).unwrap();
    let out = enfilade(&["bake", &input, "-o", &world, "--min-cost", "0"]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert!(text(&out.stderr).contains("method bsp: the structure is made of 9 brushes"));
    let verified = enfilade(&["verify", &world, "--source", &input, "--rays", "20000"]);
    assert!(verified.status.success(), "{}", text(&verified.stdout));
    let cells = |world: &str| {
        let json = text(&enfilade(&["inspect", world, "--json"]).stdout);
        let value: serde_json::Value = serde_json::from_str(&json).unwrap();
        [
            value["cells"].as_array().unwrap().len(),
            value["portals"].as_array().unwrap().len(),
        ]
    };
    // Two rooms, and the space in the doorway.
    assert_eq!(cells(&world), [3, 2]);
    let by_default = folder.path("default.glb");
    assert!(
        enfilade(&["bake", &input, "-o", &by_default])
            .status
            .success()
    );
    assert_eq!(cells(&by_default), [2, 1]);
    let merged = enfilade(&["bake", &input, "-o", &by_default, "--min-cost", "50"]);
    assert!(merged.status.success());
    assert_eq!(cells(&by_default), [1, 0]);
    let simple = folder.path("simple.glb");
    let out = enfilade(&["simplify", &world, "-o", &simple, "--max-cells", "2"]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert_eq!(cells(&simple), [2, 1]);
    assert!(
        enfilade(&["verify", &simple, "--source", &input, "--rays", "20000"])
            .status
            .success()
    );
    let edited = folder.path("edited.glb");
    let out = enfilade(&[
        "edit",
        &world,
        "-o",
        &edited,
        "--delete-portal",
        "0",
        "--delete-portal",
        "1",
    ]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert_eq!(cells(&edited), [1, 0]);
    let out = enfilade(&["edit", &world, "-o", &edited, "--delete-portal", "7"]);
    assert_eq!(out.status.code(), Some(1));
    assert!(text(&out.stderr).contains("no portal 7"));
}

#[test]
fn walls_of_detail_are_named_with_the_option_that_closes_the_map() {
    let folder = Folder::new("detail");
    let (input, world) = (folder.path("detail.map"), folder.path("w.glb"));
    let below = boxed([-16, -16, -64], [288, 144, -48]);
    let classes = format!("\"worldspawn\"\n{below}}}\n{{\n\"classname\" \"func_geo\"\n");
    std::fs::write(&input, map(-16).replacen("\"worldspawn\"\n", &classes, 1)).unwrap();
    let bake = |more: &[&str]| enfilade(&[&["bake", &input, "-o", &world], more].concat());
    let refused = text(&bake(&[]).stderr);
    let option = "--structural-name 'func_geo *'";
    assert!(
        refused.contains("the map leaks") && refused.contains(option),
        "{refused}"
    );
    let closed = bake(&["--structural-name", "func_geo *"]);
    assert!(closed.status.success(), "{}", text(&closed.stderr));
    let all = String::from("\"worldspawn\"\n}\n{\n\"classname\" \"func_geo\"\n");
    std::fs::write(&input, map(-16).replacen("\"worldspawn\"\n", &all, 1)).unwrap();
    let refused = text(&bake(&[]).stderr);
    assert!(
        refused.contains("all brushes are detail") && refused.contains(option),
        "{refused}"
    );
    // A gap that no class closes.
    std::fs::write(&input, map(64)).unwrap();
    let refused = text(&bake(&[]).stderr);
    assert!(!refused.contains("--structural-name"), "{refused}");
}

#[test]
fn a_portal_is_put_in_and_what_parts_nothing_is_refused() {
    let folder = Folder::new("add");
    let (input, world, edited) = (
        folder.path("two.map"),
        folder.path("w.glb"),
        folder.path("edited.glb"),
    );
    std::fs::write(&input, map(-16)).unwrap();
    assert!(
        enfilade(&["bake", &input, "-o", &world, "--min-cost", "0"])
            .status
            .success()
    );
    let edit = |more: &[&str]| enfilade(&[&["edit", &world, "-o", &edited], more].concat());
    // The first room is 4 by 3 by 4 meters, from the origin to -z; the doorway is removed first.
    let across = "2,-1,1;2,-1,-5;2,4,-5;2,4,1";
    let out = edit(&["--delete-portal", "0", "--add-portal", across]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    let told = text(&out.stdout);
    assert!(
        told.contains("of 12.00 m² divides cell-1: now cell-1 (24.0 m³)"),
        "{told}"
    );
    assert!(told.contains("cost of a cell"), "{told}");
    let verify = ["verify", &edited, "--source", &input, "--rays", "20000"];
    let verified = enfilade(&verify);
    assert!(verified.status.success(), "{}", text(&verified.stdout));
    std::fs::remove_file(&edited).unwrap();
    for (polygon, code, says) in [
        // A meter short of the ceiling.
        (
            "1,-1,1;1,-1,-5;1,2,-5;1,2,1",
            1,
            "a way leads around it at 1.00,2.",
        ),
        (
            "2,-1,1;2,-1,-5;2.5,4,-5;2,4,1",
            1,
            "off the plane of the others",
        ),
        (
            "2,-1,1;2,-1,-5;2,1,-2;2,4,1",
            1,
            "not convex at vertex 2, 2.00,1.00,-2.00",
        ),
        ("20,-1,1;20,-1,-5;20,4,-5;20,4,1", 1, "lies in solid matter"),
        ("2,-1,1;2,-1", 2, "vertex 1: '2,-1' has 2 numbers"),
    ] {
        let out = edit(&["--add-portal", across, "--add-portal", polygon]);
        let error = text(&out.stderr);
        assert_eq!(out.status.code(), Some(code), "{polygon}: {error}");
        assert!(error.contains(says), "{polygon}: {error}");
        if code == 1 {
            assert!(error.contains("--add-portal number 2"), "{error}");
        }
        assert!(!Path::new(&edited).exists());
    }
    assert_eq!(edit(&[]).status.code(), Some(2));
}

#[test]
fn a_leak_ends_the_bake_with_the_way_out_and_writes_no_world() {
    let folder = Folder::new("leak");
    let (input, world, way) = (
        folder.path("leak.map"),
        folder.path("w.glb"),
        folder.path("way.pts"),
    );
    std::fs::write(&input, map(16)).unwrap();
    let out = enfilade(&["bake", &input, "-o", &world, "--leak", &way]);
    assert_eq!(out.status.code(), Some(1));
    assert!(
        text(&out.stderr).contains("the map leaks: light"),
        "{}",
        text(&out.stderr)
    );
    assert!(!Path::new(&world).exists());
    let points = std::fs::read_to_string(&way).unwrap();
    assert_eq!(points.lines().next(), Some("2 1.5 -2"));
    assert!(
        points
            .lines()
            .all(|l| l.split(' ').filter(|n| n.parse::<f64>().is_ok()).count() == 3)
    );
    let out = enfilade(&["bake", &input, "-o", &world, "--allow-leak"]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert!(
        enfilade(&["verify", &world, "--rays", "20000"])
            .status
            .success()
    );
}

/// Two houses of 8 by 8 m on a street, each with a doorway, and a player in the first or on the street.
fn street(player: [i32; 3]) -> String {
    let mut brushes = boxed([-512, -512, -16], [1024, 1024, 0]);
    for (z, door_at) in [(0, 240), (512, 512)] {
        let far = if door_at == z { z + 240 } else { z };
        for (min, max) in [
            ([0, z, 96], [256, z + 256, 112]),
            ([0, z, 0], [16, z + 256, 96]),
            ([240, z, 0], [256, z + 256, 96]),
            ([16, far, 0], [240, far + 16, 96]),
            ([16, door_at, 0], [104, door_at + 16, 96]),
            ([152, door_at, 0], [240, door_at + 16, 96]),
            ([104, door_at, 72], [152, door_at + 16, 96]),
        ] {
            brushes += &boxed(min, max);
        }
    }
    let [x, y, z] = player;
    format!(
        "{{\n\"classname\" \"worldspawn\"\n{brushes}}}\n{{\n\"classname\" \"info_player_start\"\n\"origin\" \"{x} {y} {z}\"\n}}\n"
    )
}

#[test]
fn a_world_without_a_lid_is_open_and_a_sealed_one_with_a_hole_is_not() {
    let folder = Folder::new("open");
    let (input, world) = (folder.path("open.map"), folder.path("w.glb"));
    let bake = |text: &str, more: &[&str]| {
        std::fs::write(&input, text).unwrap();
        let _ = std::fs::remove_file(&world);
        enfilade(&[&["bake", &input, "-o", &world], more].concat())
    };
    let cells = || {
        let json = text(&enfilade(&["inspect", &world, "--json"]).stdout);
        let value: serde_json::Value = serde_json::from_str(&json).unwrap();
        let cells = value["cells"].as_array().unwrap().clone();
        let n_out = cells.iter().filter(|c| c["outdoor"] == true).count();
        (cells.len() - n_out, n_out)
    };
    for player in [[128, 128, 24], [128, 384, 24]] {
        let out = bake(&street(player), &[]);
        let said = text(&out.stderr);
        assert!(out.status.success(), "{said}");
        assert!(
            said.contains("the map leaks") && said.contains("open world"),
            "{said}"
        );
        assert_eq!(cells(), (2, 1));
        assert!(
            enfilade(&["verify", &world, "--source", &input, "--rays", "20000"])
                .status
                .success()
        );
    }
    let refused = bake(&street([128, 128, 24]), &["--world", "sealed"]);
    assert_eq!(refused.status.code(), Some(1));
    // The outer walls of a sealed level in turn.
    let sealed = map(-16);
    let brushes: Vec<&str> = sealed.split_inclusive("}\n").collect();
    for gone in 2..6 {
        let holed = [&brushes[..gone], &brushes[gone + 1..]].concat().concat();
        let out = bake(&holed, &[]);
        let said = text(&out.stderr);
        assert_eq!(out.status.code(), Some(1), "{gone}: {said}");
        assert!(said.contains("the map leaks"), "{gone}: {said}");
    }
    let out = bake(&map(16), &["--world", "open"]);
    assert!(out.status.success(), "{}", text(&out.stderr));
}

#[test]
fn inside_a_box_of_sky_is_outdoors() {
    let folder = Folder::new("sky");
    let (input, world) = (folder.path("sky.map"), folder.path("w.glb"));
    let sky: String = [
        ([-528, -528, -16], [-512, 1040, 512]),
        ([1024, -528, -16], [1040, 1040, 512]),
        ([-512, -528, -16], [1024, -512, 512]),
        ([-512, 1024, -16], [1024, 1040, 512]),
        ([-528, -528, 512], [1040, 1040, 528]),
    ]
    .map(|(min, max)| boxed(min, max).replace("wall", "sky1"))
    .concat();
    let text_of = street([128, 128, 24]);
    let below = text_of.replacen("\"worldspawn\"\n", &format!("\"worldspawn\"\n{sky}"), 1);
    let bake = |text: &str| {
        std::fs::write(&input, text).unwrap();
        enfilade(&["bake", &input, "-o", &world, "--json"])
    };
    let out = bake(&below);
    let said = text(&out.stderr);
    assert!(out.status.success(), "{said}");
    assert!(said.contains("sky") && !said.contains("leaks"), "{said}");
    let json = text(&enfilade(&["inspect", &world, "--json"]).stdout);
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    let cells = value["cells"].as_array().unwrap();
    assert_eq!(cells.len(), 3);
    assert!(cells[0]["outdoor"] == true, "{json}");
    // A hole in the sky is a hole in a sealed world.
    let sides: Vec<&str> = sky.split_inclusive("}\n").collect();
    let holed = below.replacen(sides[1], "", 1);
    assert_ne!(holed, below);
    let said = text(&bake(&holed).stderr);
    assert!(said.contains("the map leaks"), "{said}");
}

#[test]
fn a_broken_map_is_refused_with_its_place() {
    let folder = Folder::new("broken");
    let (input, world) = (folder.path("broken.map"), folder.path("w.glb"));
    std::fs::write(
        &input,
        map(-16)
            .replacen("( 0 0 16 )", "( 0 0 up )", 1)
            .replacen("( -16", "( x", 1),
    )
    .unwrap();
    let out = enfilade(&["bake", &input, "-o", &world]);
    assert_eq!(out.status.code(), Some(1));
    assert!(
        text(&out.stderr).contains("line 4:3: expected a coordinate, found 'x'"),
        "{}",
        text(&out.stderr)
    );
    assert!(!Path::new(&world).exists());
}

/// Checks the separators among brushes, or among triangles if there are none.
fn check_separators(name: &str, scene: &enfilade::geom::scene::Scene) {
    use enfilade::bake::bsp::{Guide, Heuristic};
    use enfilade::geom::scene::{Role, TriangleSource};
    use enfilade::geom::{Aabb, ConvexSolid, DVec3, Triangle, Winding};
    use enfilade::internals::bake::bsp::{Bsp, BspInput};
    use enfilade::internals::geom::{BoxTree, Bvh, Sets};
    let entities = scene.entities.iter().filter(|e| e.object.is_none());
    let inside: Vec<DVec3> = entities.filter_map(|e| e.position).collect();
    let (sources, triangles): (Vec<TriangleSource>, Vec<Triangle>) = scene
        .triangle_sources(Role::Structural)
        .map(|s| (s, scene.world_triangle(s)))
        .filter(|_| scene.solids.is_empty())
        .filter(|(_, t)| (t[1] - t[0]).cross(t[2] - t[0]).length_squared() > 0.0)
        .unzip();
    let objects: Vec<u32> = sources.iter().map(|s| s.object).collect();
    let input = BspInput {
        triangles: &triangles,
        objects: &objects,
        solids: &scene.solids,
        inside: &inside,
    };
    let bsp = Bsp::build(&input, Heuristic::Default, &Guide::default());
    let portals: Vec<([u32; 2], Winding)> = bsp.portals().collect();
    let separators = bsp.separators();
    eprintln!("{name}: {} separators", separators.len());
    assert!(!separators.is_empty(), "{name}");
    let boxes: Vec<Aabb> = scene.solids.iter().map(ConvexSolid::aabb).collect();
    let tree = BoxTree::new(&boxes);
    let surfaces = Bvh::build(&triangles);
    // Brushes meet their neighbors within the tree's tolerance, some hundredths of a millimeter at this size; rounded
    // vertices may stray by a few times that.
    let eps = 1e-3;
    let is_on_solid = |p: DVec3| {
        let mut found = surfaces.nearest(p, eps).is_some();
        tree.for_each_in_box(&Aabb::new(p, p).expanded(eps), |i| {
            found |= scene.solids[i as usize].contains(p, -eps);
        });
        found
    };
    for s in &separators {
        for &p in s {
            let points = &portals[p].1.points;
            for (i, &a) in points.iter().enumerate() {
                let b = points[(i + 1) % points.len()];
                for k in 0..=8 {
                    let at = a.lerp(b, f64::from(k) / 8.0);
                    let on_own = || {
                        s.iter()
                            .any(|&o| o != p && portals[o].1.contains_in_plane(at, eps))
                    };
                    assert!(is_on_solid(at) || on_own(), "{name}: {at} is on nothing");
                }
            }
        }
    }
    // Joins leaves across all portals except some.
    let n_leaves = portals.iter().flat_map(|p| p.0).max().unwrap_or(0) as usize + 1;
    let of_separator: std::collections::BTreeSet<usize> =
        separators.iter().flatten().copied().collect();
    let mut sets = Sets::new(n_leaves);
    for (i, (leaves, _)) in portals.iter().enumerate() {
        if !of_separator.contains(&i) {
            sets.join(leaves[0], leaves[1]);
        }
    }
    for (k, s) in separators.iter().enumerate() {
        let joins = s.iter().any(|&p| {
            let [a, b] = portals[p].0.map(|l| sets.find(l));
            a != b
        });
        assert!(joins, "{name}: nothing touches where separator {k} was");
    }
}

// Covers B4 and B6.
#[test]
fn separators_of_levels_end_on_solids_and_each_parts_two_cells() {
    use enfilade::import::{ImportOptions, import};
    check_separators("clinic", &enfilade_testkit::clinic(4000, 3));
    let scenes = std::env::var_os("ENFILADE_SCENES").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes"),
        PathBuf::from,
    );
    let mut maps: Vec<PathBuf> = std::fs::read_dir(scenes.join("quake"))
        .map(|dir| dir.filter_map(|e| Some(e.ok()?.path())).collect())
        .unwrap_or_default();
    maps.retain(|p| p.extension().is_some_and(|e| e == "map"));
    maps.sort();
    if maps.is_empty() {
        eprintln!("skipped: no maps in {}", scenes.display());
    }
    for map in &maps {
        let imported = import(std::slice::from_ref(map), &[], &ImportOptions::default()).unwrap();
        check_separators(&map.file_stem().unwrap().to_string_lossy(), &imported.scene);
    }
}

// Covers B2, B4 and B6.
#[test]
fn separators_of_buildings_end_on_surfaces_and_each_parts_two_cells() {
    use enfilade::import::{ImportOptions, import};
    check_separators("house", &enfilade_testkit::furnished_house().scene);
    let scenes = std::env::var_os("ENFILADE_SCENES").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes"),
        PathBuf::from,
    );
    for name in [
        "duplex",
        "fzk-haus",
        "institute",
        "jasmin-sun",
        "kit-edc",
        "samplehouse4",
    ] {
        let file = scenes.join(name).join("scene.glb");
        if !file.exists() {
            eprintln!("skipped: no {}", file.display());
            continue;
        }
        let imported = import(&[file], &[], &ImportOptions::default()).unwrap();
        check_separators(name, &imported.scene);
    }
}

#[test]
fn a_brush_that_stands_twice_changes_nothing_but_its_own_line() {
    let folder = Folder::new("twice");
    let (input, world) = (folder.path("twice.map"), folder.path("w.glb"));
    let inspect = |text: &str| {
        std::fs::write(&input, text).unwrap();
        let out = enfilade(&["bake", &input, "-o", &world]);
        assert!(out.status.success(), "{}", self::text(&out.stderr));
        assert!(
            enfilade(&["verify", &world, "--rays", "20000"])
                .status
                .success()
        );
        let out = enfilade(&["inspect", "--json", &world]);
        let json: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
        let n = |of: &str| json[of].as_array().unwrap().len();
        (n("cells"), n("portals"))
    };
    let (once, wall) = (map(-16), boxed([128, 0, 0], [144, 48, 96]));
    // The same brush again, and one that shares a face's plane with it and reaches farther.
    let again = wall.clone() + &boxed([128, 0, -8], [144, 40, 96]);
    let twice = once.replacen(&wall, &(wall.clone() + &again), 1);
    assert_ne!(once, twice);
    assert_eq!(inspect(&once), inspect(&twice));
}
