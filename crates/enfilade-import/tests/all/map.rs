//! Quake maps: results of brushes, and places of errors. Covers S2.

use enfilade_geom::scene::Role;
use enfilade_import::{ImportOptions, decode_map};
use std::fmt::Write;

/// A box brush in the Standard format.
fn boxed(min: [i32; 3], max: [i32; 3], texture: &str) -> String {
    let mut out = "{\n".to_owned();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for high in [false, true] {
            let base = if high { max } else { min };
            let (mut a, mut c) = (base, base);
            // The cross product of a - b and c - b points outwards.
            a[if high { u } else { v }] += 16;
            c[if high { v } else { u }] += 16;
            for p in [a, base, c] {
                write!(out, "( {} {} {} ) ", p[0], p[1], p[2]).unwrap();
            }
            writeln!(out, "{texture} 0 0 0 1 1").unwrap();
        }
    }
    out + "}\n"
}

fn map(world: &str, others: &str) -> String {
    format!("// made here\n{{\n\"classname\" \"worldspawn\"\n{world}}}\n{others}")
}

fn read(text: &str) -> enfilade_import::Imported {
    decode_map(text.as_bytes(), &ImportOptions::default()).unwrap()
}

fn problem(text: &str) -> String {
    decode_map(text.as_bytes(), &ImportOptions::default())
        .unwrap_err()
        .to_string()
}

#[test]
fn a_box_has_twelve_triangles_in_meters_with_y_up() {
    let scene = read(&map(&boxed([0, 0, 0], [64, 32, 96], "stone"), "")).scene;
    assert_eq!(scene.triangle_sources(Role::Structural).count(), 12);
    let b = scene.object_aabb(0);
    assert_eq!(
        (b.min.to_array(), b.max.to_array()),
        ([0.0, 0.0, -1.0], [2.0, 3.0, 0.0])
    );
    assert!((scene.solids[0].volume() - 6.0).abs() < 1e-9);
    // Outward, and in the right places.
    for s in scene.triangle_sources(Role::Structural) {
        let t = scene.world_triangle(s);
        let outward = (t[0] + t[1] + t[2]) / 3.0 - b.center();
        assert!(enfilade_geom::triangle_area_normal(&t).dot(outward) > 0.0);
    }
}

#[test]
fn the_scale_is_the_callers() {
    let options = ImportOptions {
        unit: Some(0.5),
        ..ImportOptions::default()
    };
    let text = map(&boxed([0, 0, 0], [8, 8, 8], "stone"), "");
    let scene = decode_map(text.as_bytes(), &options).unwrap().scene;
    assert_eq!(scene.object_aabb(0).size().to_array(), [4.0; 3]);
    assert!((scene.solids[0].volume() - 64.0).abs() < 1e-9);
}

#[test]
fn both_formats_give_the_same_solid() {
    let standard = boxed([0, 0, 0], [64, 32, 96], "stone");
    let valve = standard.replace("stone 0 0 0 1 1", "stone [ 1 0 0 0 ] [ 0 -1 0 8.5 ] 0 1 1");
    assert_eq!(
        read(&map(&standard, "")).scene.solids,
        read(&map(&valve, "")).scene.solids
    );
    // Quake 2 adds three numbers.
    let quake2 = standard.replace("0 0 0 1 1", "0 0 0 1 1 1 2 0");
    assert_eq!(
        read(&map(&standard, "")).scene.solids,
        read(&map(&quake2, "")).scene.solids
    );
}

#[test]
fn entities_say_what_brushes_are() {
    let b = |x: i32, t: &str| boxed([x, 0, 0], [x + 32, 32, 32], t);
    let others = format!(
        "{{\n\"classname\" \"func_detail_wall\"\n{}}}\n{{\n\"classname\" \"func_group\"\n{}}}\n\
         {{\n\"classname\" \"trigger_once\"\n{}}}\n{{\n\"classname\" \"light\"\n\"origin\" \"32 64 96\"\n}}\n",
        b(100, "wall"),
        b(200, "wall"),
        b(300, "trigger")
    );
    let scene = read(&map(
        &(b(0, "*water0") + &b(400, "CLIP") + &b(500, "{fence")),
        &others,
    ))
    .scene;
    let found: Vec<(&str, Role)> = scene
        .objects
        .iter()
        .map(|o| (o.name.as_str(), o.role))
        .collect();
    assert_eq!(
        found,
        [
            ("func_detail_wall 1", Role::Detail),
            ("func_group 2", Role::Structural),
            ("worldspawn 0", Role::Structural),
            ("worldspawn 0 liquid", Role::Detail),
        ]
    );
    assert_eq!(scene.solids.len(), 2);
    assert_eq!(scene.entities.len(), 5);
    let entity = |class: &str| scene.entities.iter().find(|e| e.class == class).unwrap();
    let light = entity("light");
    assert_eq!(light.position.unwrap().to_array(), [1.0, 3.0, -2.0]);
    assert_eq!(
        light.properties[1],
        ("origin".to_owned(), "32 64 96".to_owned())
    );
    assert_eq!(entity("func_detail_wall").object, Some(0));
    assert_eq!(entity("worldspawn").object, Some(2));
}

#[test]
fn sky_closes_the_world_also_as_detail() {
    let detail = boxed([0, 0, 0], [32, 32, 32], "sky1") + &boxed([64, 0, 0], [96, 32, 32], "wall");
    let others = format!("{{\n\"classname\" \"func_detail_wall\"\n{detail}}}\n");
    let scene = read(&map(&boxed([200, 0, 0], [232, 32, 32], "wall"), &others)).scene;
    let role = |name: &str| scene.objects.iter().find(|o| o.name == name).unwrap().role;
    assert_eq!(role("func_detail_wall 1 sky"), Role::Structural);
    assert_eq!(role("func_detail_wall 1"), Role::Detail);
    assert_eq!(scene.solids.len(), 2);
}

#[test]
fn what_other_brushes_hide_is_left_out_once() {
    let (a, b) = (
        boxed([0, 0, 0], [32, 32, 32], "a"),
        boxed([32, 0, 0], [64, 32, 32], "b"),
    );
    let n = |text: &str| read(text).scene.triangle_sources(Role::Structural).count();
    // Two boxes side by side: the two faces between them are left out.
    assert_eq!(n(&map(&(a.clone() + &b), "")), 20);
    // The same box twice shows once.
    assert_eq!(n(&map(&(a.clone() + &a), "")), 12);
}

#[test]
fn what_is_wrong_is_said_with_line_and_column() {
    let good = boxed([0, 0, 0], [32, 32, 32], "a");
    let says = |text: &str, place: &str, what: &str| {
        let p = problem(text);
        assert!(p.contains(place) && p.contains(what), "{p}");
    };
    says(
        &map(&good.replacen("( 0 ", "( zero ", 1), ""),
        "line 5:3",
        "'zero'",
    );
    says(&map(&good.replacen("1 1", "1", 1), ""), "line 6:1", "'('");
    says(
        &map(&good.replacen("a 0 0", "a [ 0 0", 1), ""),
        "line 5:45",
        "axis",
    );
    says(
        "{\n\"classname\" \"worldspawn\"\n{\n( 0 0",
        "line 4:",
        "ends",
    );
    says("{\n\"classname\" \"worldspawn\n}", "line 2:13", "quote");
    says("{\n\"classname\" \"worldspawn\"\n", "line 1:1", "no '}'");
    says("{\n\"classname\" \"light\"\n}", "line 1:1", "worldspawn");
    says(&map("{\nbrushDef\n{\n}\n}\n", ""), "line 4:1", "0 sides");
    says(
        &map("{\nbrushDef3\n{\n( 0 0 0 5 )", ""),
        "line 7:1",
        "direction",
    );
    says(
        &map("{\npatchDefWS\n{\n}\n}\n", ""),
        "line 5:1",
        "another game",
    );
    says(
        &map(&patch("( 4 3 0 0 0 )"), ""),
        "line 4:1",
        "4 x 3 points",
    );
    says(&map(&patch("( 5 3 0 0 0 )"), ""), "line 13:1", "row");
    says(&map(&patch("( 3 3 0 0 )"), ""), "line 8:11", "flag");
    // Inside out: two points of each side swapped.
    let swap = |line: &str| {
        let parts: Vec<&str> = line.split(" ) ").collect();
        match parts[..] {
            [a, b, c, rest] => format!("{c} ) {b} ) {a} ) {rest}"),
            _ => line.to_owned(),
        }
    };
    let inverted: String = good.lines().map(|l| swap(l) + "\n").collect();
    says(&map(&inverted, ""), "line 4:1", "inside out");
    let open: String = good
        .lines()
        .filter(|l| !l.contains("( 32 32 32 )"))
        .map(|l| l.to_owned() + "\n")
        .collect();
    says(&map(&open, ""), "line 4:1", "sides");
    let line: String = good.replacen("( 0 16 0 )", "( 0 0 0 )", 1);
    says(&map(&line, ""), "line 5:1", "line");
}

/// A quarter of a pipe of 64 units, 96 long, with this line of numbers.
fn patch(numbers: &str) -> String {
    let row =
        |x: i32, y: i32| format!("( ( {x} {y} 0 0 0 ) ( {x} {y} 48 0 0.5 ) ( {x} {y} 96 0 1 ) )\n");
    let rows = row(64, 0) + &row(64, 64) + &row(0, 64);
    let name = if numbers.split(' ').count() > 7 {
        "patchDef3"
    } else {
        "patchDef2"
    };
    format!("{{\n{name}\n{{\nbase/pipe\n{numbers}\n(\n{rows})\n}}\n}}\n")
}

#[test]
fn patches_are_curved_details() {
    let wall = boxed([200, 0, 0], [232, 32, 32], "wall");
    let scene = read(&map(&(wall.clone() + &patch("( 3 3 0 0 0 )")), "")).scene;
    let object = &scene.objects[1];
    assert_eq!(
        (object.name.as_str(), object.role),
        ("worldspawn 0 patches", Role::Detail)
    );
    let primitive = &scene.meshes[object.mesh as usize].primitives[0];
    assert!(scene.materials[primitive.material.unwrap() as usize].double_sided);
    // 64 - 128 + 0 is at most 90 off a line: five segments around, one along.
    assert_eq!(
        (primitive.positions.len(), primitive.indices.len()),
        (12, 30)
    );
    assert!(primitive.positions.contains(&[64.0, 0.0, 0.0]));
    assert!(primitive.positions.contains(&[0.0, 64.0, 96.0]));
    for (p, n) in primitive.positions.iter().zip(&primitive.normals) {
        // The curve is x = 64 (1 - t²), y = 64 (2t - t²); its square roots make a straight line.
        let t = (1.0 - p[0] / 64.0).max(0.0).sqrt();
        assert!((p[1] - 64.0 * (2.0 * t - t * t)).abs() < 1e-3, "{p:?}");
        assert!(
            n[2].abs() < 1e-6 && n[0] * p[0] + n[1] * p[1] != 0.0,
            "{n:?}"
        );
    }
    // Doom 3 gives the numbers of segments.
    let scene = read(&map(&(wall + &patch("( 3 3 7 2 0 0 0 )")), "")).scene;
    let primitive = &scene.meshes[scene.objects[1].mesh as usize].primitives[0];
    assert_eq!(primitive.positions.len(), 8 * 3);
}

#[test]
fn brush_primitives_and_planes_give_the_same_solid() {
    let standard = boxed([0, 0, 0], [64, 32, 96], "stone");
    let quake3 = standard.replacen("{\n", "{\nbrushDef\n{\n", 1).replace(
        "stone 0 0 0 1 1",
        "( ( 0.03125 0 -0 ) ( 0 0.03125 0 ) ) stone 0 0 0",
    ) + "}\n";
    let plain = read(&map(&standard, "")).scene;
    assert_eq!(plain.solids, read(&map(&quake3, "")).scene.solids);
    let mut planes = String::new();
    for plane in [
        "-1 0 0 0",
        "1 0 0 -64",
        "0 -1 0 0",
        "0 1 0 -32",
        "0 0 -2 0",
        "0 0 1 -96",
    ] {
        writeln!(
            planes,
            "( {plane} ) ( ( 1 0 0 ) ( 0 1 0 ) ) \"textures/base\" 0 0 0"
        )
        .unwrap();
    }
    let doom3 = format!("{{\nbrushDef3\n{{\n{planes}}}\n}}\n");
    let scene = read(&format!("Version 2\n{}", map(&doom3, ""))).scene;
    assert_eq!(scene.object_aabb(0), plain.object_aabb(0));
    assert!((scene.solids[0].volume() - plain.solids[0].volume()).abs() < 1e-9);
    assert_eq!(scene.materials[0].name, "textures/base");
}

#[test]
fn the_detail_flag_and_tools_of_quake_3_close_nothing() {
    let detail = boxed([64, 0, 0], [96, 32, 32], "base/trim")
        .replace(" 0 0 0 1 1", " 0 0 0 1 1 134217728 0 0");
    let others = boxed([0, 0, 0], [32, 32, 32], "base/wall")
        + &boxed([128, 0, 0], [160, 32, 32], "common/weapclip")
        + &boxed([192, 0, 0], [224, 32, 32], "base/#lava1");
    let scene = read(&map(&(detail + &others), "")).scene;
    let told: Vec<_> = scene
        .objects
        .iter()
        .map(|o| (o.name.as_str(), o.role))
        .collect();
    assert_eq!(
        told,
        [
            ("worldspawn 0", Role::Structural),
            ("worldspawn 0 detail", Role::Detail),
            ("worldspawn 0 liquid", Role::Detail),
        ]
    );
    assert_eq!(scene.solids.len(), 1);
}

#[test]
fn a_box_of_sky_kilometers_away_is_no_reason_to_refuse_a_map() {
    let far = 100_000;
    let sky = boxed([-far, -far, -far], [far, far, 64 - far], "skies/blue");
    let wall = boxed([0, 0, 0], [64, 32, 96], "stone");
    let text = map(&(wall + &sky), "");
    assert!(read(&text).scene.object_aabb(0).size().x > 6000.0);
    // With a unit from the caller it may be wrong, and is an error.
    let options = ImportOptions {
        unit: Some(1.0),
        ..ImportOptions::default()
    };
    let error = decode_map(text.as_bytes(), &options)
        .unwrap_err()
        .to_string();
    assert!(error.contains("--unit"), "{error}");
}

#[test]
fn every_prefix_of_a_map_is_an_error_or_a_scene() {
    let text = map(
        (boxed([0, 0, 0], [32, 32, 32], "a")
            .replace("a 0 0 0 1 1", "a [ 1 0 0 0 ] [ 0 1 0 0 ] 0 1 1")
            + &patch("( 3 3 0 0 0 )")
            + &patch("( 3 3 7 2 0 0 0 )"))
            .as_str(),
        "{\n\"classname\" \"light\"\n}\n",
    );
    for n in 0..text.len() {
        let _ = decode_map(&text.as_bytes()[..n], &ImportOptions::default());
    }
}

#[test]
fn a_hundred_thousand_brushes_are_read_in_linear_memory() {
    let mut world = String::new();
    for i in 0..100_000 {
        let (x, y) = (i % 320 * 40 - 6400, i / 320 * 40 - 6400);
        world += &boxed([x, y, 0], [x + 32, y + 32, 32], "a");
    }
    let scene = read(&map(&world, "")).scene;
    assert_eq!(scene.solids.len(), 100_000);
}

/// Returns the names of the objects of a wall and a brush with one texture on a side, others elsewhere.
fn objects_beside_a_wall(texture: &str, others: &str) -> Vec<String> {
    let brush = boxed([64, 0, 0], [96, 32, 32], others).replacen(others, texture, 1);
    let wall = boxed([0, 0, 0], [32, 32, 32], "stone");
    let scene = read(&map(&(wall + &brush), "")).scene;
    let size = scene.solids.len();
    let names = scene.objects.into_iter().map(|o| o.name);
    names.chain([format!("{size} solids")]).collect()
}

#[test]
fn tool_textures_are_walls_or_nothing_as_their_games_have_it() {
    let alone = ["worldspawn 0", "1 solids"];
    let walls = ["worldspawn 0", "2 solids"];
    assert_eq!(
        objects_beside_a_wall("textures/editor/visportal", "textures/common/nodraw"),
        alone
    );
    assert_eq!(objects_beside_a_wall("trigger", "stone"), alone);
    assert_eq!(objects_beside_a_wall("skip", "skip"), alone);
    assert_eq!(objects_beside_a_wall("hint", "skip"), alone);
    assert_eq!(objects_beside_a_wall("skip", "stone"), walls);
    assert_eq!(objects_beside_a_wall("null", "null"), walls);
    assert_eq!(objects_beside_a_wall("common/caulk", "common/caulk"), walls);
}

#[test]
fn layers_omitted_from_export_are_left_out_with_their_groups() {
    let entity = |keys: &str, at: i32| {
        let brush = boxed([at, 0, 0], [at + 32, 32, 32], "stone");
        format!("{{\n\"classname\" \"func_group\"\n{keys}{brush}}}\n")
    };
    let layer = |omit: &str| {
        let keys = "\"_tb_type\" \"_tb_layer\"\n\"_tb_name\" \"Draft\"\n\"_tb_id\" \"3\"\n";
        entity(&format!("{keys}{omit}"), 64)
    };
    let inner = entity(
        "\"_tb_type\" \"_tb_group\"\n\"_tb_id\" \"5\"\n\"_tb_group\" \"4\"\n",
        128,
    );
    let outer = entity(
        "\"_tb_type\" \"_tb_group\"\n\"_tb_id\" \"4\"\n\"_tb_layer\" \"3\"\n",
        192,
    );
    let of = |omit: &str| {
        let others = format!("{inner}{outer}{}", layer(omit));
        read(&map(&boxed([0, 0, 0], [32, 32, 32], "stone"), &others))
    };
    let omitted = of("\"_tb_layer_omit_from_export\" \"1\"\n");
    assert_eq!(omitted.scene.solids.len(), 1);
    assert_eq!(omitted.report.left_out[0].names, ["Draft"]);
    let hidden = of("\"_tb_layer_hidden\" \"1\"\n");
    assert_eq!(hidden.scene.solids.len(), 4);
    assert_eq!(hidden.report.left_out, []);
}

/// The text of a map of Source: a box as a solid of the world, and another as an entity.
fn vmf(extra: &str) -> String {
    let solid = |at: i32, material: &str| {
        let mut sides = String::new();
        for (k, [a, b, c]) in [
            [[0, 64, 64], [64, 64, 64], [64, 0, 64]],
            [[0, 0, 0], [64, 0, 0], [64, 64, 0]],
            [[0, 64, 64], [0, 0, 64], [0, 0, 0]],
            [[64, 64, 0], [64, 0, 0], [64, 0, 64]],
            [[64, 64, 64], [0, 64, 64], [0, 64, 0]],
            [[64, 0, 0], [0, 0, 0], [0, 0, 64]],
        ]
        .into_iter()
        .enumerate()
        {
            let point = |[x, y, z]: [i32; 3]| format!("({} {y} {z})", x + at);
            writeln!(
                sides,
                "side\n{{\n\"id\" \"{k}\"\n\"plane\" \"{} {} {}\"\n\"material\" \"{material}\"\ndispinfo\n{{\nnormals\n{{\n\"row0\" \"0 0 1\"\n}}\n}}\n}}",
                point(a), point(b), point(c)
            )
            .unwrap();
        }
        format!("solid\n{{\n\"id\" \"2\"\n{sides}editor\n{{\n\"color\" \"0 1 2\"\n}}\n}}\n")
    };
    let (wall, detail) = (solid(0, "BRICK/WALL"), solid(128, "BRICK/TRIM"));
    let clip = solid(256, "TOOLS/TOOLSPLAYERCLIP");
    let hidden = solid(512, "BRICK/WALL");
    format!(
        "versioninfo\n{{\n\"editorversion\" \"400\"\n}}\nvisgroups\n{{\n}}\nworld\n{{\n\"id\" \"1\"\n\"classname\" \"worldspawn\"\n{wall}{clip}hidden\n{{\n{hidden}}}\n}}\nentity\n{{\n\"classname\" \"func_detail\"\n{detail}}}\nentity\n{{\n\"classname\" \"info_player_start\"\n\"origin\" \"10 20 30\"\n}}\n{extra}"
    )
}

#[test]
fn a_map_of_source_has_brushes_in_three_quarters_of_an_inch() {
    let imported = read(&vmf(""));
    let scene = &imported.scene;
    assert_eq!(imported.report.files[0].format, "VMF");
    assert_eq!(scene.solids.len(), 1);
    let names: Vec<(&str, Role)> = (scene.objects.iter())
        .map(|o| (o.name.as_str(), o.role))
        .collect();
    assert_eq!(
        names,
        [
            ("func_detail 1", Role::Detail),
            ("worldspawn 0", Role::Structural)
        ]
    );
    let size = scene.object_aabb(0).size();
    assert!((size - 64.0 * 0.01905).abs().max_element() < 1e-6, "{size}");
    let player = scene
        .entities
        .iter()
        .find(|e| e.class == "info_player_start");
    let at = player.unwrap().position.unwrap() / 0.01905;
    assert!(
        (at.x - 10.0).abs() < 1e-6 && (at.y - 30.0).abs() < 1e-6,
        "{at}"
    );
}

#[test]
fn what_is_wrong_in_a_map_of_source_is_said_with_its_line() {
    assert!(problem(&vmf("entity\n{\n")).contains("no '}'"));
    assert!(problem(&vmf("entity\n{\n\"a\" b\n}")).contains("without a quoted value"));
    let bad = vmf("").replacen("(0 64 64)", "(0 64)", 1);
    assert!(problem(&bad).contains("not three points"));
    let text = vmf("");
    for end in (0..text.len()).step_by(7) {
        let _ = decode_map(&text.as_bytes()[..end], &ImportOptions::default());
    }
}

#[test]
fn marked_openings_are_kept_with_their_planes() {
    let one_side = boxed([0, 0, 0], [8, 64, 96], "common/nodraw");
    let one_side = one_side.replacen("common/nodraw", "editor/visportal", 1);
    let door = boxed([100, 0, 0], [108, 64, 96], "common/trigger");
    let others = format!("{{\n\"classname\" \"func_areaportal\"\n{door}}}\n");
    // The other sides of a hint only close it.
    let hint = boxed([300, 0, 0], [308, 64, 96], "hintskip").replacen("hintskip", "hint", 1);
    let world = one_side + &hint + &boxed([200, 0, 0], [208, 64, 96], "stone");
    let scene = read(&map(&world, &others)).scene;
    let given: Vec<(&str, f64)> = (scene.given_portals.iter())
        .map(|g| (g.name.as_str(), g.thickness * 32.0))
        .collect();
    let all = [("hint 2", 8.0), ("visportal 1", 8.0), ("areaportal 3", 8.0)];
    assert_eq!(given, all);
    // In the first side of the one, in the middle of the other.
    for (given, x) in scene.given_portals.iter().zip([300.0, 0.0, 104.0]) {
        assert!(given.normal.x.abs() > 0.999);
        assert!(given.outline.iter().all(|p| (p.x * 32.0 - x).abs() < 1e-6));
    }
    assert!(
        read(&map(&boxed([0, 0, 0], [8, 64, 96], "stone"), ""))
            .scene
            .given_portals
            .is_empty()
    );
}

#[test]
fn groups_and_layers_are_nodes_above_what_they_hold() {
    let layer = "{\n\"classname\" \"func_group\"\n\"_tb_type\" \"_tb_layer\"\n\"_tb_name\" \"Cellar\"\n\"_tb_id\" \"2\"\n";
    let group = "{\n\"classname\" \"func_group\"\n\"_tb_type\" \"_tb_group\"\n\"_tb_name\" \"Stairs\"\n\"_tb_id\" \"3\"\n\"_tb_layer\" \"2\"\n";
    let light = "{\n\"classname\" \"func_door\"\n\"_tb_group\" \"3\"\n";
    let [a, b, c] = [0, 100, 200].map(|x| boxed([x, 0, 0], [x + 8, 64, 96], "stone"));
    let world = boxed([300, 0, 0], [308, 64, 96], "stone");
    let text = map(
        &world,
        &format!("{layer}{a}}}\n{group}{b}}}\n{light}{c}}}\n"),
    );
    let scene = read(&text).scene;
    let path = |class: &str, x: f64| {
        let is_at = |o: &&enfilade_geom::scene::Object| {
            let primitive = &scene.meshes[o.mesh as usize].primitives[0];
            let mut points = primitive.placed_triangles(o.transform).flatten();
            o.name.starts_with(class) && points.any(|p| (p.x * 32.0 - x).abs() < 1e-6)
        };
        let object = scene.objects.iter().find(is_at).unwrap();
        let first = object.node.map(|n| &scene.nodes[n as usize]);
        let parent =
            |n: &&enfilade_geom::scene::SourceNode| n.parent.map(|p| &scene.nodes[p as usize]);
        let names = std::iter::successors(first, |n| parent(n)).skip(1);
        names
            .map(|n| n.name.as_str())
            .collect::<Vec<_>>()
            .join(" in ")
    };
    assert_eq!(path("func_group", 0.0), "Cellar");
    assert_eq!(path("func_group", 100.0), "Stairs in Cellar");
    assert_eq!(path("func_door", 200.0), "Stairs in Cellar");
    assert_eq!(path("worldspawn", 300.0), "");
    // Rules of names reach what is in a layer.
    let mut options = ImportOptions::default();
    options.roles.detail = vec!["Cellar".to_owned()];
    let scene = decode_map(text.as_bytes(), &options).unwrap().scene;
    let details = scene
        .objects
        .iter()
        .filter(|o| o.role == enfilade_geom::scene::Role::Detail);
    assert_eq!(details.count(), 3);
}
