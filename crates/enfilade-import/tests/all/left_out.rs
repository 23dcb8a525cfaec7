//! Objects that are left out and named: helpers of engines, tool textures, skies, copies; and the choice of a scene.

use crate::common;

use common::{glb, triangle_bin, triangle_json};
use enfilade_geom::{Aabb, DVec3};
use enfilade_import::{ImportOptions, RoleRules, decode_gltf, decode_obj};
use std::fmt::Write;

/// Returns a text of boxes, each with a name, a material and two vertices.
fn boxes(all: &[(&str, &str, [f64; 3], [f64; 3])]) -> String {
    let mut text = String::new();
    let mut n = 0;
    for (name, material, min, max) in all {
        writeln!(text, "o {name}\nusemtl {material}").unwrap();
        for t in Aabb::new(DVec3::from(*min), DVec3::from(*max)).triangles() {
            for p in t {
                writeln!(text, "v {} {} {}", p.x, p.y, p.z).unwrap();
            }
            writeln!(text, "f {} {} {}", n + 1, n + 2, n + 3).unwrap();
            n += 3;
        }
    }
    text
}

/// Returns the names of the objects read, and of those left out.
fn read(text: &str, options: &ImportOptions) -> [Vec<String>; 2] {
    let imported = decode_obj(text.as_bytes(), options).unwrap();
    let kept = imported.scene.objects.into_iter().map(|o| o.name);
    let left_out = imported.report.left_out.into_iter().flat_map(|l| l.names);
    [kept.collect(), left_out.collect()]
}

const SHELL: [[f64; 3]; 2] = [[0.0, 0.0, 0.0], [8.0, 3.0, 5.0]];

#[test]
fn helpers_skies_and_copies_are_left_out_and_named() {
    let inside = [[1.0, 0.1, 1.0], [3.0, 2.0, 3.0]];
    let text = boxes(&[
        ("Cube", "stone", SHELL[0], SHELL[1]),
        ("TriggerVolume_01", "helper", inside[0], inside[1]),
        ("Cube.002", "common/clip", inside[0], inside[1]),
        ("Pier_LOD0", "stone", inside[0], inside[1]),
        ("Pier_LOD1", "stone", inside[0], inside[1]),
        ("Cube.009", "stone", [-300.0; 3], [300.0; 3]),
    ]);
    let [kept, left_out] = read(&text, &ImportOptions::default());
    assert_eq!(kept, ["Cube", "Pier_LOD0"]);
    let names = ["TriggerVolume_01", "Cube.002", "Pier_LOD1", "Cube.009"];
    assert_eq!(left_out, names);
    let rules = |structural: &[&str], is_manual| ImportOptions {
        roles: RoleRules {
            structural: structural.iter().map(|&s| s.to_owned()).collect(),
            is_manual,
            ..RoleRules::default()
        },
        ..ImportOptions::default()
    };
    let [kept, left_out] = read(&text, &rules(&["*"], false));
    assert!(kept.len() == 6 && left_out.is_empty(), "{kept:?}");
    let [kept, left_out] = read(&text, &rules(&[], true));
    assert!(kept.len() == 6 && left_out.is_empty(), "{kept:?}");
}

#[test]
fn neither_node_nor_mesh_of_what_is_left_out_stays() {
    let json = triangle_json(
        r#""scenes":[{"nodes":[0,1]}],
        "nodes":[{"mesh":0,"name":"Wall_LOD0"},{"mesh":0,"name":"Wall_LOD1"}]"#,
    );
    let bytes = glb(&json, &triangle_bin());
    let scene = decode_gltf(&bytes, &ImportOptions::default())
        .unwrap()
        .scene;
    assert_eq!((scene.objects.len(), scene.meshes.len()), (1, 1));
    let names: Vec<&str> = scene.nodes.iter().map(|n| &*n.name).collect();
    assert_eq!(names, ["Wall_LOD0"]);
}

#[test]
fn a_scene_is_chosen_by_name_or_number() {
    let json = triangle_json(
        r#""scene":0,"scenes":[{"name":"Empty","nodes":[1]},{"name":"Level","nodes":[0]}],
        "nodes":[{"mesh":0,"name":"Wall"},{"name":"nothing"}]"#,
    );
    let bytes = glb(&json, &triangle_bin());
    let read = |scene: Option<&str>| {
        let options = ImportOptions {
            scene: scene.map(str::to_owned),
            ..ImportOptions::default()
        };
        decode_gltf(&bytes, &options).map_err(|e| e.to_string())
    };
    for scene in ["Level", "1"] {
        assert_eq!(read(Some(scene)).unwrap().scene.objects[0].name, "Wall");
    }
    let refused = read(None).unwrap_err();
    assert!(
        refused.contains("1 'Level'") && refused.contains("--scene"),
        "{refused}"
    );
    let unknown = read(Some("2")).unwrap_err();
    assert!(
        unknown.contains("no scene '2'; it has 0 'Empty', 1 'Level'"),
        "{unknown}"
    );
}

#[test]
fn marks_of_openings_and_groups_of_rooms_are_read_by_the_names_of_engines() {
    let sheet = [[4.0, 0.0, 1.0], [4.2, 2.1, 2.0]];
    for (name, is_mark) in [
        ("Portal_kitchen", true),
        ("hall-portal", true),
        ("OcclusionPortal.002", true),
        ("Portal frame", false),
        ("TriggerVolume", false),
    ] {
        let text = boxes(&[
            ("Cube", "stone", SHELL[0], SHELL[1]),
            (name, "stone", sheet[0], sheet[1]),
        ]);
        let scene = decode_obj(text.as_bytes(), &ImportOptions::default())
            .unwrap()
            .scene;
        let marks = &scene.given_portals;
        assert_eq!(marks.len(), usize::from(is_mark), "{name}");
        if let [mark] = &marks[..] {
            assert_eq!(
                mark.name.trim_end_matches(".002"),
                name.trim_end_matches(".002")
            );
            assert!(mark.outline.iter().all(|p| (p.x - 4.1).abs() < 1e-6));
            assert!(mark.outline.len() == 4 && (mark.thickness - 0.2).abs() < 1e-6);
        }
    }
    let json = |group: &str| {
        triangle_json(&format!(
            r#""scenes":[{{"nodes":[0,2]}}],"nodes":[{{"name":"{group}","children":[1]}},
            {{"mesh":0,"name":"Floor"}},{{"mesh":0,"name":"Other-room","translation":[9,0,0]}}]"#
        ))
    };
    for (group, name) in [
        ("hall-room", "hall"),
        ("Room_hall.001", "hall"),
        ("Rooms", ""),
    ] {
        let bytes = glb(&json(group), &triangle_bin());
        let read = decode_gltf(&bytes, &ImportOptions::default()).unwrap();
        // A mesh of such a name is not a group.
        let named: Vec<&str> = read.scene.rooms.iter().map(|r| &*r.name).collect();
        assert_eq!(named.join(" "), name, "{group}");
    }
}

#[test]
fn a_file_of_nothing_but_helpers_is_refused_with_the_option_that_keeps_them() {
    let text = boxes(&[("NavMesh", "stone", SHELL[0], SHELL[1])]);
    let error = decode_obj(text.as_bytes(), &ImportOptions::default()).unwrap_err();
    let said = error.to_string();
    let keeps = "a navigation mesh, by its name (--structural-name 'NavMesh' keeps it)";
    assert!(said.contains(keeps), "{said}");
}
