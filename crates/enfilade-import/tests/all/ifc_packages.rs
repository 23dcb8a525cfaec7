//! IFC through scripts that drive ifcopenshell and web-ifc, where these are installed, and through stand-ins. Covers S1.
#![cfg(unix)]
#![allow(clippy::print_stdout, reason = "skips itself aloud")]

use crate::common;

use std::path::{Path, PathBuf};
use std::process::Command;

use common::{glb, triangle_bin, triangle_json};
use enfilade_geom::scene::{FixtureKind, Role, Scene};
use enfilade_import::{IfcConverter, ImportError, ImportOptions, Imported, import, import_sources};

/// Two rooms with a door, a way out, a window and two stools, in millimeters.
const HOUSE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/two-rooms.ifc");

fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(folder.join("temporary")).unwrap();
    folder
}

fn read(folder: &Path, programs: Vec<PathBuf>) -> Result<Imported, ImportError> {
    let mut converter = IfcConverter::new("", folder.join("temporary"));
    converter.programs = programs;
    let options = ImportOptions {
        ifc: Some(converter),
        ..ImportOptions::default()
    };
    let read = import(&[HOUSE.into()], &[], &options);
    let left = std::fs::read_dir(folder.join("temporary")).unwrap().count();
    assert_eq!(left, 0, "temporary files are removed");
    read
}

/// Writes a program of this name. It is called with a script, the input and the output.
fn program(folder: &Path, name: &str, script: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(folder.join("text"), format!("#!/bin/sh\n{script}\n")).unwrap();
    // Copied by another process: one that this process has open for writing cannot be run.
    let copied = Command::new("install")
        .args(["-m", "755"])
        .args([&folder.join("text"), &path])
        .status();
    assert!(copied.unwrap().success());
    path
}

/// Object by object: name, role, box, names of materials, and what the model says of it.
fn told(scene: &Scene) -> Vec<String> {
    let objects = scene.objects.iter().enumerate();
    objects
        .map(|(i, o)| {
            let b = scene.object_aabb(i);
            let sides = [b.min, b.max].map(|p| format!("{:.3}", p + 0.0001));
            let primitives = scene.meshes[o.mesh as usize].primitives.iter();
            let materials = primitives.filter_map(|p| p.material);
            let materials: Vec<_> = materials
                .map(|m| {
                    let m = &scene.materials[m as usize];
                    format!("{} {:.3?} {}", m.name, m.base_color, m.transparent)
                })
                .collect();
            let mut path = Vec::new();
            let mut at = o.node;
            while let Some(node) = at.map(|n| &scene.nodes[n as usize]) {
                path.push(format!("{} {}", node.name, node.extras));
                at = node.parent;
            }
            format!("{} {:?} {sides:?} {materials:?} {path:?}", o.name, o.role)
        })
        .collect()
}

fn check_house(scene: &Scene) {
    let rooms: Vec<_> = scene.rooms.iter().map(|r| r.name.as_str()).collect();
    assert_eq!(rooms, ["1 Küche", "2 Hall"]);
    for (room, from) in scene.rooms.iter().zip([0.2, 4.4]) {
        let whole = room.volume * room.points.len() as f64;
        assert!((whole - 60.0).abs() < 0.1, "{whole}");
        let is_inside = |x: f64| (from..from + 4.0).contains(&x);
        assert!(
            room.points
                .iter()
                .all(|p| is_inside(p.x) && (p.y - 1.5).abs() < 1e-3)
        );
    }
    let n = |class: &str, role| {
        let objects = scene.objects.iter();
        let named = objects.filter(|o| o.name.starts_with(class) && o.role == role);
        named.count()
    };
    let counts = ["IfcWall/", "IfcSlab/"].map(|c| n(c, Role::Structural));
    assert_eq!(counts, [5, 2]);
    let counts = ["IfcDoor/", "IfcWindow/", "IfcFurniture/"].map(|c| n(c, Role::Detail));
    assert_eq!(counts, [2, 1, 2]);
    assert_eq!(scene.objects.len(), 12, "spaces and holes are no objects");
    let stools = scene
        .objects
        .iter()
        .filter(|o| o.name.starts_with("IfcFurniture"));
    let meshes: Vec<u32> = stools.map(|o| o.mesh).collect();
    assert_eq!(meshes[0], meshes[1], "equal bodies are one mesh");
    let named: Vec<&str> = scene.nodes.iter().map(|n| n.name.as_str()).collect();
    assert_eq!(named[..3], ["Site", "House", "Ground floor"]);
    let spaces: Vec<_> = scene
        .fixtures
        .iter()
        .map(|f| (f.kind, f.extras.as_str()))
        .collect();
    let marker = FixtureKind::Marker;
    assert_eq!(spaces[0].0, marker);
    assert!(spaces[0].1.contains("Küche"), "{spaces:?}");
    let window = told(scene)
        .into_iter()
        .find(|o| o.starts_with("IfcWindow/"))
        .unwrap();
    for said in ["Glass", "0.300] true", "GlazingAreaFraction", "IsExternal"] {
        assert!(window.contains(said), "{window}");
    }
    let middle = told(scene)
        .into_iter()
        .find(|o| o.contains("42 dB"))
        .unwrap();
    // The hole of the door cuts the wall, and other properties than those that part rooms are left out.
    assert!(middle.contains("[4.200, 0.000, -5.200]"), "{middle}");
    assert!(!told(scene).join("").contains("Reference"));
}

#[test]
fn both_packages_read_the_same_house() {
    let folder = folder("ifc-packages");
    let mut read_by = Vec::new();
    for (name, package) in [("python3", "ifcopenshell"), ("node", "web-ifc")] {
        match read(&folder, vec![name.into()]) {
            Ok(imported) => {
                check_house(&imported.scene);
                assert_eq!(imported.report.files[0].format, "IFC");
                read_by.push(told(&imported.scene));
            }
            Err(ImportError::Unsupported { .. }) => println!("skipped: {package} is not installed"),
            // A machine without the program at all.
            Err(error) if error.to_string().contains("cannot be run") => {
                println!("skipped: {error}");
            }
            Err(error) => panic!("{error}"),
        }
    }
    if let [one, other] = &read_by[..] {
        assert_eq!(one, other);
    }
}

#[test]
fn the_first_program_that_has_its_package_decides() {
    let folder = folder("ifc-first");
    let space = r#"{"mesh":0,"name":"IfcSpace/0iEHWY1$XA8eQeeULq4jE6","extras":{"ifc":{"LongName":"Hall"}}}"#;
    let nodes =
        format!(r#""nodes":[{{"mesh":0,"name":"IfcWall/1iEHWY1$XA8eQeeULq4jE6"}},{space}]"#);
    let made = folder.join("made.glb");
    std::fs::write(&made, glb(&triangle_json(&nodes), &triangle_bin())).unwrap();
    let made = made.display();
    let lacks = program(&folder, "python3", "exit 127");
    let script = format!(
        "grep -q web-ifc \"$1\" && grep -q IFCDOOR \"$2\" && echo 'note: IfcWall/x: bad' && cp {made} \"$3\""
    );
    let has = program(&folder, "node", &script);
    let never = program(&folder, "IfcConvert", "exit 1");
    let imported = read(&folder, vec![lacks.clone(), has, never.clone()]).unwrap();
    assert_eq!(imported.scene.objects.len(), 1);
    assert_eq!(imported.scene.rooms[0].name, "Hall");
    let notes = imported.report.to_string();
    assert!(
        notes.contains("web-ifc") && notes.contains("IfcWall/x: bad"),
        "{notes}"
    );
    // IfcConvert has no package, and its failures are errors.
    let error = read(&folder, vec![lacks.clone(), never]).unwrap_err();
    assert!(error.to_string().contains("made no GLB"), "{error}");
}

#[test]
fn without_a_package_the_error_has_the_command_that_installs_one() {
    let folder = folder("ifc-lacks");
    let python = program(&folder, "python3", "exit 127");
    let node = program(&folder, "node", "exit 127");
    for (programs, command) in [
        (
            vec![python.clone(), node.clone()],
            "`pip install ifcopenshell`",
        ),
        (vec![node], "`npm install web-ifc`"),
        (vec![], "`pip install ifcopenshell`"),
    ] {
        let error = read(&folder, programs).unwrap_err().to_string();
        assert!(
            error.contains(command) && error.contains("--ifc-convert"),
            "{error}"
        );
        assert!(
            error.contains("two-rooms.ifc") && error.lines().count() == 1,
            "{error}"
        );
    }
    let fails = "echo 'ifcopenshell cannot read it:' >&2; echo 'bad line' >&2; exit 1";
    let error = read(&folder, vec![program(&folder, "python3", fails)]).unwrap_err();
    let error = error.to_string();
    assert!(error.contains("cannot read it: | bad line"), "{error}");
    assert_eq!(error.lines().count(), 1, "{error}");
    assert!(python.exists());
}

#[test]
fn half_a_file_is_an_error_whatever_would_read_it() {
    let folder = folder("ifc-half");
    let whole = std::fs::read(HOUSE).unwrap();
    let half = folder.join("half.ifc");
    std::fs::write(&half, &whole[..whole.len() / 2]).unwrap();
    let options = ImportOptions {
        ifc: Some(IfcConverter::new("IfcConvert", folder.join("temporary"))),
        ..ImportOptions::default()
    };
    let error = import(&[half], &[], &options).unwrap_err().to_string();
    assert!(
        error.contains("half.ifc") && error.contains("cut off"),
        "{error}"
    );
}

#[test]
fn bodies_and_empty_nodes_called_rooms_name_them_and_are_no_objects() {
    let nodes = r#""nodes":[{"mesh":0,"name":"wall"},{"mesh":0,"name":"room:Hall"},
        {"name":"room:Kitchen","translation":[1,2,3]},{"name":"start","translation":[1,2,3]}]"#;
    let file = folder("rooms").join("rooms.glb");
    std::fs::write(&file, glb(&triangle_json(nodes), &triangle_bin())).unwrap();
    let read = |ignores_marks| {
        let options = ImportOptions {
            ignores_marks,
            ..ImportOptions::default()
        };
        let sources = [enfilade_import::SceneSource::file(&file)];
        import_sources(sources, &options).unwrap().scene
    };
    let scene = read(false);
    let rooms: Vec<_> = scene
        .rooms
        .iter()
        .map(|r| (r.name.as_str(), r.points[0]))
        .collect();
    assert_eq!(rooms[0].0, "Hall");
    assert_eq!(rooms[1], ("Kitchen", [1.0, 2.0, 3.0].into()));
    assert!(scene.rooms[1].volume > 1e9 * scene.rooms[0].volume);
    let objects: Vec<_> = scene.objects.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(objects, ["wall"]);
    // The body's place is kept as well.
    assert_eq!(scene.fixtures.len(), 3);
    let plain = read(true);
    assert!(plain.rooms.is_empty());
    assert_eq!(plain.objects.len(), 2);
}
