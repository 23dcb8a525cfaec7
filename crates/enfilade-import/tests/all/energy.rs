//! Energy models: gbXML and HBJSON.

use std::fmt::Write;

use enfilade_geom::DVec3;
use enfilade_geom::scene::{Filling, Role};
use enfilade_import::{HeldFiles, ImportOptions, Imported, import_held};

/// A point: x, y, z with Z up.
type Point = [f64; 3];

/// Length of the unit of these files. [Units: m]
const FOOT: f64 = 0.3048;

fn imported(name: &str, bytes: Vec<u8>) -> Result<Imported, String> {
    let mut files = HeldFiles::default();
    files.add(name.to_owned(), bytes, false);
    import_held(&files, &ImportOptions::default()).map_err(|e| e.to_string())
}

/// The six sides of a box.
fn sides([from, to]: [Point; 2]) -> [Vec<Point>; 6] {
    let at = |k: [usize; 3]| std::array::from_fn(|i| [from, to][k[i]][i]);
    let side = |loops: [[usize; 3]; 4]| loops.map(at).to_vec();
    [
        side([[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]]),
        side([[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]),
        side([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]]),
        side([[0, 1, 0], [0, 1, 1], [1, 1, 1], [1, 1, 0]]),
        side([[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]]),
        side([[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]]),
    ]
}

/// Two rooms of 20 by 10 by 10 feet, far from the origin, with a door between them and a window in each.
const ROOMS: [[Point; 2]; 2] = [
    [[3000.0, 0.0, 0.0], [3020.0, 10.0, 10.0]],
    [[3020.0, 0.0, 0.0], [3040.0, 10.0, 10.0]],
];

fn door() -> Vec<Point> {
    [[4.0, 0.0], [7.0, 0.0], [7.0, 7.0], [4.0, 7.0]]
        .map(|[y, z]| [3020.0, y, z])
        .to_vec()
}

fn window(room: usize) -> Vec<Point> {
    let x = ROOMS[room][0][0] + 5.0;
    [[0.0, 3.0], [4.0, 3.0], [4.0, 6.0], [0.0, 6.0]]
        .map(|[dx, z]| [x + dx, 0.0, z])
        .to_vec()
}

fn poly_loop(points: &[Point]) -> String {
    let mut out = String::from("<PolyLoop>");
    for point in points {
        out += "<CartesianPoint>";
        for c in point {
            let _ = write!(out, "<Coordinate>{c}</Coordinate>");
        }
        out += "</CartesianPoint>";
    }
    out + "</PolyLoop>"
}

/// `wall` is the thickness of walls: surfaces lie on their middle, shells end at their faces.
fn gbxml(wall: f64) -> String {
    let mut out = String::from(
        r#"<?xml version="1.0"?><gbXML xmlns="http://www.gbxml.org/schema" lengthUnit="Feet"><Campus id="c"><Building id="b">"#,
    );
    let faces = |[from, to]: [Point; 2]| [from.map(|c| c + 0.5 * wall), to.map(|c| c - 0.5 * wall)];
    for (i, room) in ROOMS.iter().enumerate() {
        let _ = write!(
            out,
            "<Space id=\"sp{i}\"><Name>10{i} Office &amp; more</Name><ShellGeometry><ClosedShell>{}</ClosedShell></ShellGeometry></Space>",
            sides(faces(*room)).map(|s| poly_loop(&s)).concat()
        );
    }
    out += "</Building>";
    for (i, room) in ROOMS.iter().enumerate() {
        for (k, side) in sides(*room).iter().enumerate() {
            // The wall between them is there once, with both.
            if (i, k) == (1, 4) {
                continue;
            }
            let kind = ["SlabOnGrade", "Roof"].get(k).unwrap_or(&"ExteriorWall");
            let _ = write!(
                out,
                "<Surface id=\"su{i}{k}\" surfaceType=\"{kind}\"><AdjacentSpaceId spaceIdRef=\"sp{i}\"/>{}<PlanarGeometry>{}</PlanarGeometry>",
                ["", "<AdjacentSpaceId spaceIdRef=\"sp1\"/>"][usize::from((i, k) == (0, 5))],
                poly_loop(side)
            );
            let opening = match (i, k) {
                (0, 5) => Some(("NonSlidingDoor", door())),
                (_, 2) => Some(("OperableWindow", window(i))),
                _ => None,
            };
            if let Some((kind, outline)) = opening {
                let _ = write!(
                    out,
                    "<Opening id=\"op{i}{k}\" openingType=\"{kind}\"><PlanarGeometry>{}</PlanarGeometry></Opening>",
                    poly_loop(&outline)
                );
            }
            out += "</Surface>";
        }
    }
    // A plane of air, and a roof over the entrance.
    let air = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 1.0]];
    for kind in ["Air", "Shade"] {
        let _ = write!(
            out,
            "<Surface id=\"{kind}\" surfaceType=\"{kind}\"><PlanarGeometry>{}</PlanarGeometry></Surface>",
            poly_loop(&air)
        );
    }
    out + "</Campus></gbXML>"
}

/// `wall` is the thickness of the wall between the rooms.
fn hbjson(wall: f64) -> String {
    let rooms = ROOMS.iter().enumerate().map(|(i, room)| {
        let mut room = *room;
        room[0][0] += wall * i as f64;
        let faces = sides(room).into_iter().enumerate().map(|(k, side)| {
            let piece = |id: &str, mut outline: Vec<Point>, other: &str| {
                if id == "door" {
                    outline.iter_mut().for_each(|p| p[0] += wall * i as f64);
                }
                serde_json::json!({ "type": "Aperture", "identifier": format!("{id}{i}"), "geometry": { "boundary": outline },
                    "boundary_condition": { "boundary_condition_objects": [other] } })
            };
            let other = match (i, k) {
                (0, 5) => vec!["f14", "r1"],
                (1, 4) => vec!["f05", "r0"],
                _ => Vec::new(),
            };
            let doors: Vec<_> = other.iter().take(1).map(|_| piece("door", door(), ["door1", "door0"][i])).collect();
            let apertures: Vec<_> = (k == 2).then(|| piece("window", window(i), "")).into_iter().collect();
            let kind = ["Floor", "RoofCeiling"].get(k).unwrap_or(&"Wall");
            serde_json::json!({
                "type": "Face", "identifier": format!("f{i}{k}"), "face_type": kind,
                "geometry": { "type": "Face3D", "boundary": side },
                "boundary_condition": { "type": "Surface", "boundary_condition_objects": other },
                "apertures": apertures, "doors": doors,
            })
        });
        let faces: Vec<_> = faces.collect();
        serde_json::json!({ "type": "Room", "identifier": format!("r{i}"), "display_name": format!("10{i} Office & more"), "faces": faces })
    });
    let rooms: Vec<_> = rooms.collect();
    serde_json::json!({ "type": "Model", "identifier": "m", "units": "Feet", "rooms": rooms })
        .to_string()
}

fn holds(imported: &Imported, format: &str) {
    let scene = &imported.scene;
    assert_eq!(imported.report.files[0].format, format);
    let of = |filling| scene.objects.iter().filter(move |o| o.filling == filling);
    assert_eq!(of(Some(Filling::Door)).count(), 1);
    assert_eq!(of(Some(Filling::Window)).count(), 2);
    let walls = scene.objects.iter().filter(|o| o.role == Role::Structural);
    assert_eq!(walls.clone().count(), 11);
    // Cut where openings are, and in meters.
    let area: f64 = walls
        .flat_map(|o| {
            let primitives = scene.meshes[o.mesh as usize].primitives.iter();
            primitives.flat_map(move |p| p.placed_triangles(o.transform))
        })
        .map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length())
        .sum();
    let right = (8.0 * 200.0 + 3.0 * 100.0 - 21.0 - 2.0 * 12.0) * FOOT * FOOT;
    assert!((area - right).abs() < 1e-3, "{area} {right}");
    // Names stand in their rooms, with Y up.
    let mut rooms: Vec<_> = scene.rooms.iter().collect();
    rooms.sort_by(|a, b| a.name.cmp(&b.name));
    assert_eq!(rooms.len(), 2);
    for (i, room) in rooms.into_iter().enumerate() {
        assert_eq!(room.name, format!("10{i} Office & more"));
        let mean = room.points.iter().sum::<DVec3>() / room.points.len() as f64;
        let middle = DVec3::new(3010.0 + 20.0 * i as f64, 5.0, -5.0) * FOOT;
        assert!(mean.distance(middle) < 0.1, "{mean} {middle}");
    }
}

#[test]
fn both_formats_give_sheets_with_openings_and_names_of_rooms() {
    holds(
        &imported("house.xml", gbxml(0.0).into_bytes()).unwrap(),
        "gbXML",
    );
    holds(
        &imported("house.hbjson", hbjson(0.0).into_bytes()).unwrap(),
        "HBJSON",
    );
}

#[test]
fn a_surface_of_air_is_an_opening_that_its_author_marked() {
    let read = imported("house.xml", gbxml(0.0).into_bytes()).unwrap();
    let [air] = &read.scene.given_portals[..] else {
        panic!("{:?}", read.scene.given_portals);
    };
    assert_eq!(air.name, "air Air");
    assert!((air.normal.x.abs() - 1.0).abs() < 1e-9);
    // With Y up, in meters.
    // It reaches into the walls around it by a centimeter.
    let away = air.outline[2].distance(DVec3::new(0.0, 1.0, -1.0) * FOOT);
    assert!((away - 0.01).abs() < 1e-9, "{away}");
}

#[test]
fn a_wall_with_two_sides_is_thick_and_its_door_leads_through_it() {
    let thick = imported("house.hbjson", hbjson(1.0).into_bytes()).unwrap();
    let objects = &thick.scene.objects;
    let n = |has: &dyn Fn(&str) -> bool| objects.iter().filter(|o| has(&o.name)).count();
    assert_eq!(n(&|name| name.starts_with("IfcDoor/")), 1);
    assert_eq!(n(&|name| name.contains("door0-reveal-")), 4);
    assert_eq!(n(&|name| name == "IfcWall/f05" || name == "IfcWall/f14"), 2);
}

#[test]
fn walls_of_gbxml_are_as_thick_as_the_shells_of_spaces_are_apart() {
    let thick = imported("house.gbxml", gbxml(1.0).into_bytes())
        .unwrap()
        .scene;
    let n = |start: &str| {
        thick
            .objects
            .iter()
            .filter(|o| o.name.starts_with(start))
            .count()
    };
    // The wall between the two is there no more; those to the outdoors are.
    assert_eq!(
        [n("IfcWall/su05"), n("IfcWall/su04"), n("IfcWall/su15")],
        [0, 1, 1]
    );
    // Door and windows lead through.
    for id in ["op05", "op02", "op12"] {
        assert_eq!(n(&format!("IfcWall/{id}-reveal-")), 4, "{id}");
    }
    let walls = thick
        .objects
        .iter()
        .find(|o| o.name == "IfcWall/sp0")
        .unwrap();
    let triangles =
        thick.meshes[walls.mesh as usize].primitives[0].placed_triangles(walls.transform);
    let area: f64 = triangles
        .map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length())
        .sum();
    // A box without the window, and without what is left of the door above the floor.
    let right = 2.0 * (19.0 * 9.0 + 19.0 * 9.0 + 9.0 * 9.0) - 12.0 - 3.0 * 6.5;
    assert!((area / FOOT / FOOT - right).abs() < 1e-3, "{area}");
}

#[test]
fn files_in_sixteen_bits_are_read() {
    let utf_16 = gbxml(0.0).replace("\"1.0\"?", "\"1.0\" encoding=\"utf-16\"?");
    for to_bytes in [u16::to_le_bytes, u16::to_be_bytes] {
        let units = std::iter::once(0xfeff).chain(utf_16.encode_utf16());
        let bytes = units.flat_map(to_bytes).collect();
        holds(&imported("house.xml", bytes).unwrap(), "gbXML");
    }
}

#[test]
fn what_is_wrong_is_said_with_its_place() {
    let cut = gbxml(0.0);
    let cut = &cut[..cut.len() / 2];
    let fact = |text: &str, from: &str, to: &str| text.replacen(from, to, 1);
    for (name, text, said) in [
        ("a.xml", cut.to_owned(), "line 1"),
        ("a.xml", fact(&gbxml(0.0), "Feet", "Cubits"), "'Cubits'"),
        (
            "a.xml",
            fact(&gbxml(0.0), "<Coordinate>3000", "<Coordinate>x"),
            "three Coordinates",
        ),
        (
            "a.xml",
            fact(&gbxml(0.0), "<Coordinate>3000", "<Coordinate>NaN"),
            "three Coordinates",
        ),
        ("a.hbjson", fact(&hbjson(0.0), "Feet", "Cubits"), "'Cubits'"),
        ("a.hbjson", hbjson(0.0)[..1000].to_owned(), "line 1"),
        ("a.hbjson", fact(&hbjson(0.0), "3000.0", "true"), "line 1"),
        ("a.hbjson", "[]".to_owned(), "energy model"),
    ] {
        let error = imported(name, text.into_bytes()).unwrap_err();
        assert!(error.contains(said) && error.contains(name), "{error}");
    }
    // An element in another, a hundred thousand times; a polygon with more vertices than are cut.
    let deep = format!("<gbXML>{}", "<Campus>".repeat(100_000));
    assert!(imported("a.xml", deep.into_bytes()).is_err());
    let many = fact(
        &gbxml(0.0),
        "<PolyLoop>",
        &format!(
            "<PolyLoop>{}",
            poly_loop(&[[0.0; 3]; 5000])[10..].replace("</PolyLoop>", "")
        ),
    );
    assert!(
        imported("a.xml", many.into_bytes())
            .unwrap_err()
            .contains("vertices")
    );
}

#[test]
fn a_surface_without_a_place_is_left_out_with_a_note() {
    let text = gbxml(0.0).replacen("</Campus>", "<Surface id=\"odd\"/></Campus>", 1);
    let imported = imported("house.xml", text.into_bytes()).unwrap();
    let notes = imported.report.notes.iter().map(ToString::to_string);
    let notes: Vec<String> = notes.collect();
    assert!(notes.iter().any(|n| n.contains("'odd'")), "{notes:?}");
}
