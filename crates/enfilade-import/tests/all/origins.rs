//! Names and metadata of the input are kept: names, extras, lights, cameras, markers, copyright.

use enfilade_geom::DVec3;
use enfilade_geom::scene::{FixtureKind, Scene};
use enfilade_import::{ImportOptions, ImportReport, decode_gltf, decode_map};
use serde_json::{Value, json};

fn house() -> Value {
    json!({
        "asset": { "version": "2.0", "copyright": "2026 A. Mason" },
        "scene": 0,
        "scenes": [{ "nodes": [0], "extras": { "project": 7 } }],
        "nodes": [
            { "name": "house", "children": [1, 4, 5, 6, 7, 8], "scale": [2, 2, 2] },
            { "name": "storey", "children": [2, 3], "extras": { "level": 1 } },
            { "name": "wall", "mesh": 0, "extras": { "fire": [60] } },
            { "mesh": 0 },
            { "name": "lamp", "translation": [1, 2, 3], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
            { "name": "entrance", "camera": 0 },
            { "name": "start", "translation": [4, 0, 0], "extras": { "team": 1 } },
            { "name": "hidden", "extensions": { "KHR_lights_punctual": { "light": 3 } } },
            { "translation": [9, 9, 9] }
        ],
        "meshes": [{ "name": "panel", "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 10.0 } }],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point", "range": 500.0 }] } },
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "buffers": [{
            "byteLength": 36,
            "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"
        }]
    })
}

fn load(document: &Value, options: &ImportOptions) -> (Scene, ImportReport) {
    let read = decode_gltf(document.to_string().as_bytes(), options);
    let read = read.expect("a document that loads");
    (read.scene, read.report)
}

#[test]
fn objects_know_their_nodes_and_all_above_them() {
    let (scene, _) = load(&house(), &ImportOptions::default());
    let names: Vec<_> = scene.nodes.iter().map(|n| n.name.as_str()).collect();
    assert_eq!(names, ["house", "storey", "panel", "wall"]);
    let parents: Vec<_> = scene.nodes.iter().map(|n| n.parent).collect();
    assert_eq!(parents, [None, Some(0), Some(1), Some(1)]);
    assert_eq!(scene.nodes[3].extras, r#"{"fire":[60]}"#);
    let of_objects: Vec<_> = scene.objects.iter().map(|o| o.node).collect();
    assert_eq!(of_objects, [Some(2), Some(3)]);
    assert_eq!(scene.about.copyright, "2026 A. Mason");
    assert_eq!(scene.about.extras, r#"{"project":7}"#);
}

#[test]
fn lights_cameras_and_marked_places_are_where_they_were_in_meters() {
    let options = ImportOptions {
        unit: Some(0.1),
        ..ImportOptions::default()
    };
    let (scene, report) = load(&house(), &options);
    let [lamp, entrance, start] = &scene.fixtures[..] else {
        panic!("{:?}", scene.fixtures);
    };
    let kinds = [lamp, entrance, start].map(|f| f.kind);
    assert_eq!(
        kinds,
        [FixtureKind::Light, FixtureKind::Camera, FixtureKind::Marker]
    );
    let near = |m: &enfilade_geom::DMat4, p: [f64; 3]| {
        m.transform_point3(DVec3::ZERO).distance(p.into()) < 1e-6
            && (m.determinant() - 1.0).abs() < 1e-6
    };
    assert!(near(&lamp.transform, [0.2, 0.4, 0.6]));
    assert!(near(&start.transform, [0.8, 0.0, 0.0]));
    let of =
        |f: &enfilade_geom::scene::Fixture| -> Value { serde_json::from_str(&f.gltf).unwrap() };
    assert_eq!(of(lamp)["range"], 50.0);
    assert_eq!(of(entrance)["perspective"]["znear"], 1.0);
    assert_eq!(
        (start.gltf.as_str(), start.extras.as_str()),
        ("", r#"{"team":1}"#)
    );
    assert!(report.notes.iter().any(|n| n.place.contains("hidden")));
}

#[test]
fn extras_too_deep_for_a_world_are_left_out_and_named() {
    let mut document = house();
    let deep: Value = (0..110).fold(Value::Null, |inner, _| json!([inner]));
    document["nodes"][2]["extras"] = deep;
    let (scene, report) = load(&document, &ImportOptions::default());
    assert_eq!(scene.nodes[2].extras, "");
    assert!(report.notes.iter().any(|n| n.place.contains("wall")));
}

#[test]
fn entities_of_a_map_are_names_and_places() {
    let map = r#"
{ "classname" "worldspawn" "message" "attic"
{ ( 0 0 0 ) ( 0 1 0 ) ( 0 0 1 ) wall 0 0 0 1 1
( 64 0 0 ) ( 64 0 1 ) ( 64 1 0 ) wall 0 0 0 1 1
( 0 0 0 ) ( 0 0 1 ) ( 1 0 0 ) wall 0 0 0 1 1
( 0 64 0 ) ( 1 64 0 ) ( 0 64 1 ) wall 0 0 0 1 1
( 0 0 0 ) ( 1 0 0 ) ( 0 1 0 ) wall 0 0 0 1 1
( 0 0 64 ) ( 0 1 64 ) ( 1 0 64 ) wall 0 0 0 1 1 } }
{ "classname" "info_player_start" "origin" "32 0 128" "angle" "90" }
"#;
    let read = decode_map(map.as_bytes(), &ImportOptions::default());
    let scene = read.expect("a map").scene;
    let node = &scene.nodes[scene.objects[0].node.unwrap() as usize];
    assert!(
        node.extras.contains(r#""message":"attic""#),
        "{}",
        node.extras
    );
    let [start] = &scene.fixtures[..] else {
        panic!("{:?}", scene.fixtures);
    };
    assert_eq!(start.name, "info_player_start");
    assert_eq!(
        scene.entities[0].position,
        Some(start.transform.transform_point3(DVec3::ZERO))
    );
    assert!(start.extras.contains(r#""angle":"90""#));
}
