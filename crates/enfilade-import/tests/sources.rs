//! Sources that are not triangles become surfaces, alone or beside models. Covers S3.

use enfilade_geom::Aabb;
use enfilade_geom::scene::Role;
use enfilade_import::{ImportOptions, SceneSource, decode_implicit, import_sources};

const BALL: &str = r#"{ "enfilade": "implicit", "unit": "cm", "air": { "ball": { "at": [100, 0, 0], "radius": 200 } } }"#;

#[test]
fn an_implicit_scene_is_one_structural_object_in_meters_with_its_distance() {
    let imported = decode_implicit(BALL.as_bytes(), &ImportOptions::default()).unwrap();
    let scene = &imported.scene;
    assert_eq!(scene.objects.len(), 1);
    assert_eq!(scene.objects[0].role, Role::Structural);
    let bounds: Aabb = scene.object_aabb(0);
    assert!(
        (bounds.max.x - 3.0).abs() < 0.05 && (bounds.min.x + 1.0).abs() < 0.05,
        "{bounds:?}"
    );
    let surface = imported.report.files[0].surface.as_ref().unwrap();
    assert!(
        surface.distance > 0.0 && surface.distance < 0.05,
        "{surface:?}"
    );
    assert!((surface.step - 4.0 / 128.0).abs() < 1e-6, "{surface:?}");
    let told = imported.report.surface_settings();
    assert_eq!(
        told.keys().collect::<Vec<_>>(),
        ["surface.distance", "surface.step"]
    );
    // An option replaces the unit of the file.
    let options = ImportOptions {
        unit: Some(0.001),
        ..ImportOptions::default()
    };
    let bounds = decode_implicit(BALL.as_bytes(), &options)
        .unwrap()
        .scene
        .object_aabb(0);
    assert!((bounds.size().x - 0.4).abs() < 0.01, "{bounds:?}");
}

#[test]
fn sources_and_models_are_read_in_one_call() {
    let annex = "o annex\nv 5 0 0\nv 9 0 0\nv 9 3 0\nv 5 3 0\nf 1 2 3 4\n";
    let source = |name: &str, text: &'static str| SceneSource {
        path: name.into(),
        stream: Some(Box::new(text.as_bytes())),
        is_detail: false,
    };
    let both = [source("cave.json", BALL), source("annex.obj", annex)];
    let imported = import_sources(both, &ImportOptions::default()).unwrap();
    assert_eq!(imported.scene.objects.len(), 2);
    let formats: Vec<_> = imported.report.files.iter().map(|f| f.format).collect();
    assert_eq!(formats, ["implicit", "OBJ"]);
    // A model alone tells nothing of surfaces.
    let alone = import_sources([source("annex.obj", annex)], &ImportOptions::default()).unwrap();
    assert!(alone.report.surface_settings().is_empty());
}

#[test]
fn a_broken_source_names_its_file_and_place() {
    let text = r#"{ "enfilade": "implicit", "air": { "ball": { "at": [0, 0, 0] } } }"#;
    let error = decode_implicit(text.as_bytes(), &ImportOptions::default()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "memory.json: air.ball: \"radius\" is missing"
    );
}
