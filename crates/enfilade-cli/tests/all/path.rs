//! Runs `path` on worlds made in code. Covers W10.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use enfilade_cpg::wire::encode_glb;
use enfilade_cpg::{CellId, DetailObject, PortalKind, World};
use enfilade_geom::scene::{Mesh, Primitive};
use enfilade_geom::{Aabb, DVec3};
use enfilade_testkit::{GridParams, room_grid};
use serde_json::Value;

fn enfilade(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(args)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// Two rooms with a doorway between them, and a point on the floor of each.
fn two_rooms(name: &str) -> (String, [String; 2]) {
    write(name, &room_grid(&GridParams::two_rooms()))
}

fn write(name: &str, world: &World) -> (String, [String; 2]) {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::write(&path, encode_glb(world).unwrap()).unwrap();
    let points = [0, 1].map(|c| {
        let [low, high] = world.graph.cells[c].aabb;
        format!(
            "{},0.5,{}",
            (low[0] + high[0]) / 2.0,
            (low[2] + high[2]) / 2.0
        )
    });
    (path.to_str().unwrap().to_owned(), points)
}

#[test]
fn a_path_goes_through_the_doorway() {
    let (world, [from, to]) = two_rooms("path.glb");
    let args = [
        "path", &world, "--from", &from, "--to", &to, "--radius", "0.2",
    ];
    let done = enfilade(&[&args[..], &["--json"]].concat());
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    let report: Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(report["cells"], serde_json::json!([0, 1]));
    assert_eq!(report["portals"], serde_json::json!([0]));
    let points = report["points"].as_array().unwrap();
    assert!(points.len() >= 2 && points.iter().all(|p| p[1].as_f64().unwrap().abs() < 1e-3));
    let length = report["length"].as_f64().unwrap();
    assert!(length > 2.0 && length < 20.0);
    let plain = enfilade(&args);
    assert!(
        text(&plain.stdout).starts_with(&format!("{length:.2} m")),
        "{}",
        text(&plain.stdout)
    );
    assert!(text(&plain.stdout).contains("portal-0  into cell-1"));
}

#[test]
fn no_path_is_an_error_that_says_why() {
    let (world, [from, to]) = two_rooms("no_path.glb");
    let args = ["path", &world, "--from", &from, "--to", &to];
    for (more, says) in [
        (["--radius", "9"], "no floor"),
        (["--closed", "7"], "1 portals"),
        (["--radius", "0"], "above 0"),
        (["--step", "-1"], "at least 0"),
    ] {
        let more = [format!("{}={}", more[0], more[1])];
        let done = enfilade(&[&args[..], &[more[0].as_str()]].concat());
        assert_eq!(done.status.code(), Some(1), "{more:?}");
        assert!(
            text(&done.stderr).contains(says),
            "{more:?}: {}",
            text(&done.stderr)
        );
        assert!(done.stdout.is_empty());
    }
}

/// The error of a path that is not found.
fn refusal(args: &[&str]) -> String {
    let done = enfilade(args);
    assert_eq!(done.status.code(), Some(1), "{args:?}");
    assert!(done.stdout.is_empty(), "{args:?}");
    let said = text(&done.stderr);
    assert!(said.contains("no way that a walker can go: "), "{said}");
    said.to_owned()
}

/// How far one gets, and how far the end then is, in a refusal. [Units: wu]
fn how_far(said: &str) -> [f64; 2] {
    let number = |before: &str, after: &str| {
        let (_, rest) = said.split_once(before).unwrap();
        let (number, _) = rest.split_once(after).unwrap();
        let number = number.rsplit(' ').next().unwrap();
        number.parse::<f64>().unwrap()
    };
    [
        number("one gets ", " m far"),
        number("m far, to", " m from the end"),
    ]
}

#[test]
fn a_refusal_names_the_closed_door_and_how_far_one_gets() {
    let mut named = room_grid(&GridParams::two_rooms());
    named.graph.cells[0].name = "Hall".into();
    named.graph.cells[1].name = "Kit\u{1b}chen".into();
    let (world, [from, to]) = write("closed.glb", &named);
    let said = refusal(&[
        "path", &world, "--from", &from, "--to", &to, "--closed", "0",
    ]);
    assert!(
        said.contains(r"portal-0, an opening between Hall and Kit\u{1b}chen at ")
            && said.contains("is closed")
            && said.contains("in Hall, "),
        "{said}"
    );
    let [far, left] = how_far(&said);
    let done = enfilade(&["path", &world, "--from", &from, "--to", &to, "--json"]);
    let whole: Value = serde_json::from_slice(&done.stdout).unwrap();
    let whole = whole["length"].as_f64().unwrap();
    assert!(
        far > 1.0 && left > 1.0 && (far + left - whole).abs() < 0.6,
        "{said} {whole}"
    );
}

#[test]
fn a_refusal_names_the_opening_that_a_walker_does_not_fit_through() {
    let door = room_grid(&GridParams::two_rooms());
    let window = room_grid(&GridParams {
        doors: 0.0,
        windows: 1.0,
        ..GridParams::two_rooms()
    });
    let step = "is 0.90 m higher than the floor before it, more than a step of 0.30 m (--step)";
    for (name, world, walker, says) in [
        (
            "narrow",
            &door,
            ["--radius", "0.9"],
            "m wide, too narrow for a walker of 1.80 m",
        ),
        (
            "low",
            &door,
            ["--height", "2.5"],
            "is 2.10 m high, too low for a walker of 2.50 m",
        ),
        ("sill", &window, ["--height", "1.2"], step),
    ] {
        let (world, [from, to]) = write(&format!("unfit-{name}.glb"), world);
        let args = ["path", &world, "--from", &from, "--to", &to];
        let said = refusal(&[&args[..], &walker].concat());
        assert!(
            said.contains("portal-0, ") && said.contains(says),
            "{name}: {said}"
        );
        assert!(
            said.contains(" between cell-0 and cell-1 at "),
            "{name}: {said}"
        );
        assert!(how_far(&said)[0] > 0.5, "{name}: {said}");
    }
}

#[test]
fn a_refusal_names_a_stair_that_is_too_low_and_a_leaf_in_the_way() {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("path-stair");
    let _ = fs::remove_dir_all(&dir);
    let made = enfilade(&["demo", "-q", "-o", dir.to_str().unwrap()]);
    assert_eq!(made.status.code(), Some(0), "{}", text(&made.stderr));
    let world = dir.join("world.glb");
    let args = [
        "path",
        world.to_str().unwrap(),
        "--from",
        "2,0,4",
        "--to",
        "9,2.9,6",
    ];
    assert_eq!(
        enfilade(&[&args[..], &["--height", "1.7"]].concat())
            .status
            .code(),
        Some(0)
    );
    let said = refusal(&[&args[..], &["--height", "2.0"]].concat());
    assert!(
        said.contains(
            "a walker 1.50 m high would get there, and this one is 2.00 m high (--height)"
        ),
        "{said}"
    );
    assert!(how_far(&said)[0] > 3.0, "{said}");
    // Leaves of the double door reach far into the hall.
    let args = [
        "path",
        world.to_str().unwrap(),
        "--from",
        "2,0,4",
        "--to",
        "5.5,0,7",
    ];
    let said = refusal(&[&args[..], &["--radius", "0.45"]].concat());
    assert!(
        said.contains("the open leaf of portal-19, a door between cell-2 and cell-4 at 4.35 0.00 4.00, is in the way"),
        "{said}"
    );
    assert!(how_far(&said)[0] > 1.5, "{said}");
}

#[test]
fn a_path_tells_ends_that_are_elsewhere() {
    let (world, [from, to]) = two_rooms("moved.glb");
    let ask = |to: &str| {
        let done = enfilade(&["path", &world, "--from", &from, "--to", to, "--json"]);
        let said = text(&done.stderr).to_owned();
        assert_eq!(done.status.code(), Some(0), "{said}");
        let report: Value = serde_json::from_slice(&done.stdout).unwrap();
        (report["moved"].as_array().unwrap().clone(), said)
    };
    let (moved, said) = ask(&to);
    assert!(moved.is_empty() && said.is_empty(), "{said}");
    // Beside the far wall, in solid matter.
    let wall = room_grid(&GridParams::two_rooms()).graph.cells[1].aabb[1][0];
    let z = to.rsplit(',').next().unwrap();
    let (moved, said) = ask(&format!("{},0.5,{z}", wall + 0.1));
    assert_eq!(moved.len(), 1);
    assert_eq!(moved[0]["option"], "--to");
    let distance = moved[0]["distance"].as_f64().unwrap();
    assert!((0.3..0.5).contains(&distance), "{distance}");
    assert!(
        said.contains("--to: a walker cannot stand at")
            && said.contains(&format!("{distance:.2} m beside")),
        "{said}"
    );
}

#[test]
fn a_point_without_a_floor_is_told_with_the_nearest_floor() {
    let (world, [from, _]) = two_rooms("no_floor.glb");
    let done = enfilade(&["path", &world, "--from", &from, "--to", "1,9,1"]);
    let said = text(&done.stderr);
    assert_eq!(done.status.code(), Some(1));
    assert!(
        said.contains("--to: no floor for a walker")
            && said.contains("the nearest is 9.00 m away, at 0.97 0.00"),
        "{said}"
    );
}

/// Puts an object into a cell.
fn add_counter(world: &mut World, cell: u32, counter: Aabb) {
    let corners = counter.triangles().concat();
    let primitive = Primitive {
        positions: corners.iter().map(|p| p.as_vec3().to_array()).collect(),
        indices: (0..corners.len() as u32).collect(),
        ..Primitive::default()
    };
    world.details.push(DetailObject {
        name: "counter".into(),
        mesh: world.detail_meshes.len() as u32,
        transform: std::array::from_fn(|i| f32::from(u8::from(i % 5 == 0))),
        cells: vec![CellId(cell)],
        source: None,
        part_of: None,
    });
    world.detail_meshes.push(Mesh {
        primitives: vec![primitive],
        ..Mesh::default()
    });
}

/// Four rooms in a ring, three of the openings doorways; that between rooms 2 and 3 is high in the wall.
fn ring() -> World {
    let params = |seed| GridParams {
        size: [2, 1, 2],
        seed,
        doors: 0.6,
        windows: 1.0,
        ..GridParams::two_rooms()
    };
    let is_ring = |world: &World| {
        let portals = world.graph.portals.iter();
        let mut high = portals.filter(|p| p.kind == PortalKind::Window);
        let pair = high.next().map(|p| p.cells.map(|c| c.0));
        let door = (world.graph.portals.iter()).find(|p| p.cells.map(|c| c.0) == [0, 1]);
        let far = world.graph.cells[1].aabb[1][2];
        let is_clear = door.is_some_and(|p| p.outline.iter().all(|v| v[2] < far - 1.6));
        pair == Some([2, 3]) && high.next().is_none() && is_clear
    };
    let all = (0..2000).map(|seed| room_grid(&params(seed)));
    let mut world = all.into_iter().find(is_ring).unwrap();
    for portal in &mut world.graph.portals {
        portal.kind = PortalKind::Open;
    }
    world
}

#[test]
fn a_refusal_names_a_sill_rather_than_a_room_that_objects_divide() {
    let mut world = ring();
    let (known, _) = write("ring.glb", &world);
    let middle = |c: usize| {
        let [low, high] = world.graph.cells[c].aabb;
        format!(
            "{},0.1,{}",
            (low[0] + high[0]) / 2.0,
            (low[2] + high[2]) / 2.0
        )
    };
    let [from, to] = [middle(0), middle(3)];
    let done = enfilade(&["path", &known, "--from", &from, "--to", &to]);
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    // A counter before the doorway from room 1 to room 3.
    let [low, high] = world.graph.cells[1].aabb.map(|p| p.map(f64::from));
    let min = DVec3::new(low[0], low[1], high[2] - 1.0);
    let max = DVec3::new(high[0], low[1] + 1.0, high[2] - 0.7);
    add_counter(&mut world, 1, Aabb::new(min, max));
    let (divided, _) = write("divided.glb", &world);
    let args = ["path", &divided, "--from", &from, "--to", &to];
    let said = refusal(&[&args[..], &["--height", "1.4"]].concat());
    assert!(
        said.contains("an opening between cell-2 and cell-3 at ")
            && said.contains("is 0.90 m higher"),
        "{said}"
    );
}

#[test]
fn furniture_is_in_the_way_unless_it_is_left_out() {
    let mut world = room_grid(&GridParams::two_rooms());
    let [low, high] = world.graph.cells[0].aabb.map(|p| p.map(f64::from));
    // A counter across the first room, in front of the doorway.
    let end = DVec3::new(high[0] - 0.2, low[1] + 1.0, high[2]);
    let counter = Aabb::new(DVec3::new(high[0] - 0.6, low[1], low[2]), end);
    add_counter(&mut world, 0, counter);
    let (world, [from, to]) = write("counter.glb", &world);
    let args = ["path", &world, "--from", &from, "--to", &to];
    let said = refusal(&args);
    assert!(
        said.contains("objects stand between ") && said.contains("nearest 'counter' (--no-objects"),
        "{said}"
    );
    let done = enfilade(&[&args[..], &["--no-objects"]].concat());
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
}

#[test]
fn a_kept_map_is_used_where_it_fits_and_else_refused_with_the_reason() {
    let (world, [from, to]) = two_rooms("kept.glb");
    let map = PathBuf::from(&world).with_extension("walk");
    let _ = fs::remove_file(&map);
    let args = ["path", &world, "--from", &from, "--to", &to];
    let asked = |more: &[&str]| {
        let done = enfilade(&[&args[..], more].concat());
        assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
        (text(&done.stdout).to_owned(), text(&done.stderr).to_owned())
    };
    let (expected, silent) = asked(&[]);
    assert!(silent.is_empty() && !map.exists(), "{silent}");
    let (found, told) = asked(&["--keep"]);
    assert!(found == expected && told.contains("kept.walk"), "{told}");
    let kept = fs::read(&map).unwrap();
    assert_eq!(asked(&[]), (expected.clone(), String::new()));
    // For another walker, and with other objects, it is made anew.
    for (more, why) in [
        (&["--radius", "0.2"][..], "a walker of another size"),
        (&["--no-objects"], "other objects"),
    ] {
        let (_, told) = asked(more);
        assert!(
            told.contains("kept.walk is not used") && told.contains(why),
            "{told}"
        );
    }
    let mut damaged = kept.clone();
    damaged[100] ^= 1;
    fs::write(&map, &damaged).unwrap();
    let (found, told) = asked(&[]);
    assert!(found == expected && told.contains("damaged"), "{told}");
    // A world that has changed.
    fs::write(&map, &kept).unwrap();
    let changed = room_grid(&GridParams {
        windows: 1.0,
        outdoors: true,
        ..GridParams::two_rooms()
    });
    fs::write(&world, encode_glb(&changed).unwrap()).unwrap();
    let (_, told) = asked(&["--keep"]);
    assert!(told.contains("another world"), "{told}");
    assert_ne!(fs::read(&map).unwrap(), kept);
    assert_eq!(asked(&[]).1, "");
    let refused = enfilade(&["path", "-", "--keep", "--from", &from, "--to", &to]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(text(&refused.stderr).contains("--keep"));
}
