//! glTF: nodes, placements, materials, and every kind of accessor, on hand-made files. Covers S1.

use crate::common;

use common::{f32_bytes, glb, material, scene_of, sorted, triangle_bin, triangle_json, v, world};
use enfilade_geom::scene::{Image, Role, Texture};
use enfilade_geom::{DMat4, DVec3, triangle_area_normal};
use enfilade_import::{
    ImportError, ImportOptions, Imported, Limits, RoleRules, Up, decode_gltf, export_glb, import,
};
use proptest::prelude::*;

fn read(json: &str, bin: &[u8]) -> Result<Imported, ImportError> {
    decode_gltf(&glb(json, bin), &ImportOptions::default())
}

fn read_nodes(members: &str) -> Imported {
    read(&triangle_json(members), &triangle_bin()).unwrap_or_else(|e| panic!("{members}: {e}"))
}

fn error_of(members: &str) -> String {
    match read(&triangle_json(members), &triangle_bin()) {
        Ok(_) => panic!("{members} was read"),
        Err(e) => e.to_string(),
    }
}

#[test]
fn nested_nodes_are_flattened() {
    let scene = read_nodes(
        r#""nodes":[{"translation":[1,2,3],"scale":[2,2,2],"children":[1]},
        {"mesh":0,"name":"leaf","rotation":[0,0,0.70710678118654752,0.70710678118654752]}]"#,
    )
    .scene;
    let [a, b, c] = world(&scene)[0];
    // A quarter turn about z takes x to y; rounding to f32 hides the sine's last bit.
    assert_eq!(a, v(1.0, 2.0, 3.0));
    assert!(b.distance(v(1.0, 10.0, 3.0)) < 1e-6, "{b}");
    assert!(c.distance(v(-5.0, 2.0, 3.0)) < 1e-6, "{c}");
    assert_eq!(scene.objects[0].name, "leaf");
}

#[test]
fn a_mirrored_placement_keeps_its_corners_and_faces_front() {
    let mirrored = read_nodes(r#""nodes":[{"mesh":0,"scale":[-1,1,1]},{"mesh":0}]"#).scene;
    let [first, second] = [world(&mirrored)[0], world(&mirrored)[1]];
    assert_eq!(
        first,
        [v(-4.0, 0.0, 0.0), v(0.0, 0.0, 0.0), v(0.0, 3.0, 0.0)]
    );
    // glTF 2.0, 3.7.4: a negative determinant reverses the winding, so the front still faces +z.
    assert!(triangle_area_normal(&first).z > 0.0 && triangle_area_normal(&second).z > 0.0);
    assert!(
        mirrored
            .objects
            .iter()
            .all(|o| o.transform.determinant() > 0.0)
    );
    assert_eq!(mirrored.meshes.len(), 2);
}

#[test]
fn instances_share_one_mesh() {
    let mut bin = triangle_bin();
    bin.extend(f32_bytes(&[10.0, 0.0, 0.0, 20.0, 0.0, 0.0]));
    let json = triangle_json(
        r#""extensionsRequired":["EXT_mesh_gpu_instancing"],
        "nodes":[{"mesh":0,"translation":[0,5,0],"extensions":{"EXT_mesh_gpu_instancing":
        {"attributes":{"TRANSLATION":2}}}}]"#,
    )
    .replace(
        "\"type\":\"SCALAR\"}]",
        "\"type\":\"SCALAR\"},{\"bufferView\":2,\"componentType\":5126,\"count\":2,\"type\":\"VEC3\"}]",
    )
    .replace("\"byteLength\":6}", "\"byteLength\":6},{\"buffer\":0,\"byteOffset\":44,\"byteLength\":24}")
    .replace("\"byteLength\":44", "\"byteLength\":68");
    let scene = read(&json, &bin).unwrap().scene;
    assert_eq!((scene.meshes.len(), scene.objects.len()), (1, 2));
    assert_eq!(world(&scene)[1][0], v(20.0, 5.0, 0.0));
}

#[test]
fn quantized_sparse_and_unindexed_positions_are_read() {
    // Normalized i16 positions without a base, one of them set by the sparse part.
    let mut bin = Vec::new();
    for c in [32767i16, 0, 0, 0, 16384, -32768] {
        bin.extend(c.to_le_bytes());
    }
    bin.extend([1u8, 2, 0, 0]);
    let json = r#"{"asset":{"version":"2.0"},"extensionsRequired":["KHR_mesh_quantization"],
        "nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
        "accessors":[{"componentType":5122,"normalized":true,"count":3,"type":"VEC3",
        "sparse":{"count":2,"indices":{"bufferView":1,"componentType":5121},
        "values":{"bufferView":0}}}],
        "bufferViews":[{"buffer":0,"byteLength":12},{"buffer":0,"byteOffset":12,"byteLength":2}],
        "buffers":[{"byteLength":16}]}"#;
    let scene = read(json, &bin).unwrap().scene;
    let half = f64::from(16384.0f32 / 32767.0f32);
    assert_eq!(
        world(&scene)[0],
        [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, half, -1.0)]
    );
}

#[test]
fn sparse_indices_out_of_order_and_overlapping_elements_are_errors() {
    let sparse = |indices: [u8; 2]| {
        let mut bin = vec![0; 24];
        bin.extend(indices);
        let json = r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":0}],
            "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
            "accessors":[{"componentType":5126,"count":3,"type":"VEC3",
            "sparse":{"count":2,"indices":{"bufferView":1,"componentType":5121},
            "values":{"bufferView":0}}}],
            "bufferViews":[{"buffer":0,"byteLength":24},
            {"buffer":0,"byteOffset":24,"byteLength":2}],"buffers":[{"byteLength":26}]}"#;
        read(json, &bin).unwrap_err().to_string()
    };
    for bad in [[2, 1], [1, 1], [1, 3]] {
        assert!(
            sparse(bad).contains("do not increase or are out of range"),
            "{bad:?}"
        );
    }
    assert!(sparse([1, 2]).contains("one point"), "all corners are zero");
    let json = triangle_json(r#""nodes":[{"mesh":0}]"#)
        .replace("\"byteLength\":36}", "\"byteLength\":36,\"byteStride\":4}");
    let error = read(&json, &triangle_bin()).unwrap_err().to_string();
    assert!(error.contains("stride 4 is less than"), "{error}");
}

#[test]
fn bad_node_trees_are_errors() {
    for (members, text) in [
        (
            r#""nodes":[{"mesh":0,"children":[0]}],"scenes":[{"nodes":[0]}]"#,
            "cycle",
        ),
        (
            r#""nodes":[{"mesh":0,"children":[1]},{"children":[0]}],"scenes":[{"nodes":[1]}]"#,
            "cycle",
        ),
        (
            r#""nodes":[{"children":[2]},{"children":[2]},{"mesh":0}]"#,
            "another parent",
        ),
        (r#""nodes":[{"children":[7]}]"#, "no child node 7"),
        (r#""nodes":[{"mesh":9}]"#, "no mesh 9"),
        (
            r#""nodes":[{"mesh":0}],"scenes":[{"nodes":[5]}]"#,
            "no node 5",
        ),
        (
            r#""nodes":[{"mesh":0}],"scenes":[{"nodes":[0]}],"scene":3"#,
            "no scene 3",
        ),
        (
            r#""nodes":[{"mesh":0,"scale":[1e300,1e300,1e300]}]"#,
            "larger",
        ),
        (
            r#""nodes":[{"scale":[1e300,1,1],"children":[1]},{"mesh":0,"scale":[1e300,1,1]}]"#,
            "overflows",
        ),
    ] {
        let error = error_of(members);
        assert!(error.contains(text), "{members}: {error}");
    }
}

#[test]
fn a_deep_tree_is_refused_without_deep_recursion() {
    let nodes: Vec<String> = (1..100_000)
        .map(|i| format!("{{\"children\":[{i}]}}"))
        .collect();
    let error = error_of(&format!("\"nodes\":[{},{{\"mesh\":0}}]", nodes.join(",")));
    assert!(
        error.contains("levels of nodes") && error.contains("1024"),
        "{error}"
    );
}

#[test]
fn what_is_not_supported_says_what_to_do() {
    let error = error_of(r#""extensionsRequired":["VENDOR_odd"],"nodes":[{"mesh":0}]"#);
    assert!(
        error.contains("VENDOR_odd") && error.contains("export without it"),
        "{error}"
    );
    let old = r#"{"asset":{"version":"1.0"}}"#;
    assert!(read(old, &[]).unwrap_err().to_string().contains("2.0"));
}

#[test]
fn counts_beyond_the_data_are_refused() {
    let json = triangle_json(r#""nodes":[{"mesh":0}]"#);
    for (from, to, text) in [
        (
            "\"count\":3,\"type\":\"VEC3\"",
            "\"count\":4,\"type\":\"VEC3\"",
            "do not fit",
        ),
        (
            "\"count\":3,\"type\":\"VEC3\"",
            "\"count\":4294967295,\"type\":\"VEC3\"",
            "do not fit",
        ),
        (
            "\"count\":3,\"type\":\"VEC3\"",
            "\"count\":18446744073709551615,\"type\":\"VEC3\"",
            "elements",
        ),
        (
            "\"count\":3,\"type\":\"VEC3\"",
            "\"count\":2,\"type\":\"VEC3\"",
            "index 2 is out of range",
        ),
        ("\"bufferView\":0,", "", "smaller than"),
        ("\"byteLength\":36", "\"byteLength\":99999", "needs bytes"),
        (
            "\"byteLength\":36",
            "\"byteLength\":18446744073709551615",
            "needs bytes",
        ),
        (
            "\"byteOffset\":36",
            "\"byteOffset\":18446744073709551615",
            "needs bytes",
        ),
        (
            "\"componentType\":5123",
            "\"componentType\":5122",
            "indices are I16",
        ),
        (
            "\"componentType\":5123",
            "\"componentType\":1",
            "component type 1",
        ),
        ("\"indices\":1", "\"indices\":99", "no accessor 99"),
        ("\"type\":\"VEC3\"", "\"type\":\"MAT4\"", "MAT4"),
        (
            "\"indices\":1",
            "\"indices\":1,\"material\":0",
            "no material 0",
        ),
        (
            "\"indices\":1",
            "\"indices\":1,\"mode\":1",
            "points or lines",
        ),
        ("\"indices\":1", "\"indices\":1,\"mode\":77", "mode 77"),
    ] {
        let changed = json.replacen(from, to, 1);
        assert_ne!(json, changed, "{from}");
        match read(&changed, &triangle_bin()) {
            Err(error) => assert!(error.to_string().contains(text), "{to}: {error}"),
            Ok(_) => panic!("{to} was read"),
        }
    }
}

#[test]
fn a_small_file_cannot_ask_for_much_memory() {
    // No bytes behind the accessor: any number of zeros by definition.
    let json = r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":0}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
        "accessors":[{"componentType":5126,"count":4000000000,"type":"VEC3"}]}"#;
    let error = read(json, &[]).unwrap_err().to_string();
    assert!(
        error.contains("vertices") && error.contains("limit"),
        "{error}"
    );
}

#[test]
fn roles_limits_units_and_axes_come_from_the_options() {
    let json = triangle_json(r#""nodes":[{"mesh":0,"name":"Chair"},{"mesh":0,"name":"x"}]"#);
    let bytes = glb(&json, &triangle_bin());
    let with = |options: &ImportOptions| decode_gltf(&bytes, options);
    let plain = with(&ImportOptions::default()).unwrap().scene;
    let roles: Vec<Role> = plain.objects.iter().map(|o| o.role).collect();
    assert_eq!(roles, [Role::Detail, Role::Structural]);
    let options = ImportOptions {
        unit: Some(0.5),
        up: Some(Up::Z),
        origin: v(1.0, 0.0, 0.0),
        roles: RoleRules {
            structural: vec!["*".into()],
            ..RoleRules::default()
        },
        ..ImportOptions::default()
    };
    let turned = with(&options).unwrap().scene;
    assert_eq!(
        world(&turned)[0],
        [v(-1.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(-1.0, 0.0, -1.5)]
    );
    assert!(turned.objects.iter().all(|o| o.role == Role::Structural));
    for limits in [
        Limits {
            max_triangles: 1,
            ..Limits::default()
        },
        Limits {
            max_vertices: 2,
            ..Limits::default()
        },
        Limits {
            max_objects: 1,
            ..Limits::default()
        },
        Limits {
            max_json_bytes: 10,
            ..Limits::default()
        },
    ] {
        let error = with(&ImportOptions {
            limits,
            ..ImportOptions::default()
        });
        assert!(
            matches!(error, Err(ImportError::TooMuch { .. })),
            "{error:?}"
        );
    }
    for unit in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let options = ImportOptions {
            unit: Some(unit),
            ..ImportOptions::default()
        };
        assert!(matches!(with(&options), Err(ImportError::BadOption { .. })));
    }
}

#[test]
fn a_wrong_unit_is_named_with_the_right_one() {
    let millimeters = error_of(r#""nodes":[{"mesh":0,"scale":[1000,1000,1000]}]"#);
    assert!(millimeters.contains("4000.0000 x 3000.0000") && millimeters.contains("--unit 0.001"));
    let tiny = error_of(r#""nodes":[{"mesh":0,"scale":[0.001,0.001,0.001]}]"#);
    assert!(
        tiny.contains("smaller than 0.1 m") && tiny.contains("--unit 1000"),
        "{tiny}"
    );
    let stray = error_of(
        r#""nodes":[{"mesh":0},{"mesh":0,"name":"stray","translation":[9000,0,0]},{"mesh":0}]"#,
    );
    assert!(stray.contains("'stray' sticks out"), "{stray}");
    let far = error_of(r#""nodes":[{"mesh":0,"translation":[5e6,0,0]}]"#);
    assert!(far.contains("--origin 5000002,2,0"), "{far}");
}

#[test]
fn a_sky_dome_may_be_large_if_it_is_detail() {
    let members =
        r#""nodes":[{"mesh":0,"name":"x"},{"mesh":0,"name":"sky","scale":[9e3,9e3,9e3]}]"#;
    assert!(error_of(members).contains("'sky' sticks out"));
    let roles = RoleRules {
        detail: vec!["sky".into()],
        ..RoleRules::default()
    };
    let options = ImportOptions {
        roles,
        ..ImportOptions::default()
    };
    assert!(decode_gltf(&glb(&triangle_json(members), &triangle_bin()), &options).is_ok());
}

#[test]
fn moving_hidden_and_helper_nodes_are_told_apart() {
    let imported = read_nodes(
        r#""animations":[{"channels":[{"sampler":0,"target":{"node":0,"path":"rotation"}}]}],
        "nodes":[{"children":[1]},{"mesh":0,"name":"a"},{"mesh":0,"name":"b"},
        {"name":"c-noimp","children":[4]},{"mesh":0},{"mesh":0,"name":"d-colonly"},
        {"mesh":0,"extensions":{"KHR_node_visibility":{"visible":false}}}]"#,
    );
    let found: Vec<_> = imported
        .scene
        .objects
        .iter()
        .map(|o| (o.name.as_str(), o.reason.as_str()))
        .collect();
    assert_eq!(found, [("a", "moves: animated"), ("b", "default")]);
    assert_eq!(imported.report.notes.len(), 3, "{}", imported.report);
}

#[test]
fn see_through_parts_of_a_wall_become_detail() {
    let json = triangle_json(
        r#""nodes":[{"mesh":0,"name":"Wall"}],
        "materials":[{"name":"brick"},{"alphaMode":"BLEND","name":"pane"}]"#,
    )
    .replace(
        r#"{"attributes":{"POSITION":0},"indices":1}"#,
        r#"{"attributes":{"POSITION":0},"indices":1,"material":0},
           {"attributes":{"POSITION":0},"indices":1,"material":1}"#,
    );
    let scene = read(&json, &triangle_bin()).unwrap().scene;
    let found: Vec<_> = scene
        .objects
        .iter()
        .map(|o| {
            let material = scene.meshes[o.mesh as usize].primitives[0]
                .material
                .unwrap();
            (o.role, scene.materials[material as usize].name.as_str())
        })
        .collect();
    assert_eq!(found, [(Role::Structural, "brick"), (Role::Detail, "pane")]);
}

#[test]
fn nonfinite_corners_are_dropped_and_reported() {
    let mut bin = f32_bytes(&[0., 0., 0., 4., 0., 0., 0., 3., 0., f32::NAN, 0., 0.]);
    bin.extend([0u8, 0, 1, 0, 2, 0, 2, 0, 1, 0, 3, 0]);
    let json = triangle_json(r#""nodes":[{"mesh":0}]"#)
        .replace(
            "\"count\":3,\"type\":\"VEC3\"",
            "\"count\":4,\"type\":\"VEC3\"",
        )
        .replace(
            "\"count\":3,\"type\":\"SCALAR\"",
            "\"count\":6,\"type\":\"SCALAR\"",
        )
        .replace("\"byteLength\":36", "\"byteLength\":48")
        .replace(
            "\"byteOffset\":36,\"byteLength\":6",
            "\"byteOffset\":48,\"byteLength\":12",
        )
        .replace("\"byteLength\":44", "\"byteLength\":60");
    let imported = read(&json, &bin).unwrap();
    assert_eq!(world(&imported.scene).len(), 1);
    assert_eq!(imported.report.nonfinite_vertices.n, 1);
    assert_eq!(imported.report.n_nonfinite_triangles, 1);
}

#[test]
fn a_texture_is_named_by_a_number_that_is_there_wherever_a_material_names_it() {
    for index in ["1", "1e-7", "-1", "\"0\"", "null"] {
        for reference in [
            format!(r#""normalTexture":{{"index":{index}}}"#),
            format!(r#""extensions":{{"X":[{{"aTexture":{{"index":{index}}}}}]}}"#),
        ] {
            let error = error_of(&format!(
                r#""nodes":[{{"mesh":0}}],"textures":[{{}}],"materials":[{{{reference}}}]"#
            ));
            assert!(error.contains(&format!("no texture {index}")), "{error}");
        }
    }
}

#[test]
fn textures_of_several_files_keep_their_materials() {
    const PNG: &[u8] = b"\x89PNG\r\n\x1a\nrest";
    let folder = std::env::temp_dir().join(format!("enfilade-import-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let make = |name: &str, picture: &str| {
        let json = triangle_json(&format!(
            r#""nodes":[{{"mesh":0,"name":"{name}"}}],
            "images":[{{"uri":"{picture}"}}],"samplers":[{{"wrapS":33071}}],
            "textures":[{{"source":0,"sampler":0}}],
            "materials":[{{"name":"{name}","extras":{{"x":1}},"extensions":{{
              "KHR_materials_specular":{{"specularTexture":{{"index":0}}}}}},
              "pbrMetallicRoughness":{{"baseColorTexture":{{"index":0,"extensions":
              {{"KHR_texture_transform":{{"scale":[2,2]}}}}}}}}}}]"#
        ))
        .replace("\"indices\":1", "\"indices\":1,\"material\":0")
        .replace(
            "\"buffers\":[{",
            "\"buffers\":[{\"uri\":\"tri%20angle.bin\",",
        );
        let path = folder.join(format!("{name}.gltf"));
        std::fs::write(&path, json).unwrap();
        path
    };
    std::fs::write(folder.join("tri angle.bin"), triangle_bin()).unwrap();
    std::fs::write(folder.join("a.png"), PNG).unwrap();
    std::fs::write(folder.join("secret.txt"), b"not a picture").unwrap();
    let paths = [
        make("one", "a.png"),
        make("two", "missing.png"),
        make("three", "a.png"),
    ];
    let detail = [make("four", "secret.txt")];
    let Imported { scene, report, .. } =
        import(&paths, &detail, &ImportOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    std::fs::remove_dir_all(&folder).unwrap();
    assert_eq!(
        (
            scene.materials.len(),
            scene.textures.len(),
            scene.images.len()
        ),
        (4, 2, 1),
        "equal ones are one, also of several files"
    );
    assert!(
        scene
            .images
            .iter()
            .all(|i| i.bytes == PNG && i.mime == "image/png")
    );
    for (name, n) in [("one", 1), ("two", 0), ("three", 1), ("four", 0)] {
        let material = scene.materials.iter().find(|m| m.name == name).unwrap();
        let text = &material.gltf;
        let base = format!(
            r#""baseColorTexture":{{"extensions":{{"KHR_texture_transform":{{"scale":[2,2]}}}},"index":{n}}}"#
        );
        let specular = format!(r#""specularTexture":{{"index":{n}}}"#);
        assert!(text.contains(&base) && text.contains(&specular), "{text}");
        assert!(text.contains(r#""extras":{"x":1}"#), "{text}");
        let reason = &scene
            .objects
            .iter()
            .find(|o| o.name == name)
            .unwrap()
            .reason;
        assert_eq!(reason == "from a detail file", name == "four");
    }
    assert_eq!([None, Some(0)], [0, 1].map(|i| scene.textures[i].image));
    assert_eq!(scene.textures[1].sampler, r#"{"wrapS":33071}"#);
    assert_eq!(report.notes.len(), 2, "{report}");
}

#[test]
fn a_missing_file_is_named() {
    let path = std::path::PathBuf::from("/no/such/place.glb");
    let error = import(&[path], &[], &ImportOptions::default()).unwrap_err();
    assert!(error.to_string().contains("/no/such/place.glb"));
}

#[test]
fn a_scene_survives_export_and_import() {
    let mut scene = scene_of(
        common::box_primitive([2.0, 3.0, 4.0]),
        &[
            DMat4::IDENTITY,
            DMat4::from_translation(v(7.0, 0.1, 0.0)),
            // A shear, which a node cannot hold.
            DMat4::from_scale(v(1.0, 3.0, 1.0)) * DMat4::from_rotation_z(0.3),
        ],
    );
    scene.materials = vec![material(
        "paint",
        r#"{"name":"paint","alphaMode":"BLEND","pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}"#,
    )];
    scene.images = vec![Image {
        name: "p".into(),
        mime: "image/png".into(),
        bytes: b"\x89PNG\r\n\x1a\n0".to_vec(),
    }];
    scene.textures = vec![Texture {
        image: Some(0),
        sampler: r#"{"wrapT":33071}"#.into(),
    }];
    let primitive = &mut scene.meshes[0].primitives[0];
    primitive.material = Some(0);
    primitive.normals = vec![[0.0, 1.0, 0.0]; 8];
    primitive.uvs = vec![vec![[0.25, 0.5]; 8]];
    primitive.colors = vec![[0.1, 0.2, 0.3, 1.0]; 8];
    let bytes = export_glb(&scene);
    assert_eq!(bytes, export_glb(&scene));
    let again = decode_gltf(&bytes, &ImportOptions::default())
        .unwrap()
        .scene;
    assert_eq!(sorted(world(&scene)), sorted(world(&again)));
    let n_placed = |m: u32| again.objects.iter().filter(|o| o.mesh == m).count();
    let shared = (0..2).find(|&m| n_placed(m) == 2).unwrap();
    let p = &again.meshes[shared as usize].primitives[0];
    let q = &scene.meshes[0].primitives[0];
    assert_eq!(
        (&p.normals, &p.uvs, &p.colors),
        (&q.normals, &q.uvs, &q.colors)
    );
    assert_eq!(again.images[0].bytes, scene.images[0].bytes);
    assert_eq!(again.textures[0].sampler, scene.textures[0].sampler);
    let json = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap();
    assert_eq!(
        json(&again.materials[0].gltf),
        json(&scene.materials[0].gltf)
    );
    assert_eq!(
        again.meshes.len(),
        2,
        "two placements share, the sheared one cannot"
    );
}

proptest! {
    /// Any mix of placements of a mesh survives to the last bit.
    #[test]
    fn placements_survive_export_and_import(
        columns in prop::collection::vec(prop::array::uniform12(-2.0f64..2.0), 1..5),
        is_tidy in any::<bool>(),
    ) {
        let transforms: Vec<DMat4> = columns.iter().map(|c| {
            let shift = DVec3::new(c[9], c[10], c[11]);
            if is_tidy {
                let scale = DVec3::new(c[0].abs() + 0.5, c[1] + 2.5, c[2].signum());
                DMat4::from_scale_rotation_translation(
                    scale, DMat4::from_rotation_y(c[3]).to_scale_rotation_translation().1, shift)
            } else {
                DMat4::from_cols(
                    DVec3::new(c[0], c[1], c[2]).extend(0.0),
                    DVec3::new(c[3], c[4], c[5]).extend(0.0),
                    DVec3::new(c[6], c[7], c[8]).extend(0.0),
                    shift.extend(1.0),
                )
            }
        }).collect();
        let scene = scene_of(common::box_primitive([1.0, 2.0, 3.0]), &transforms);
        let mut again = decode_gltf(&export_glb(&scene), &ImportOptions::default()).unwrap().scene;
        // Ignores roles, which a box may lose by its shape: `world` lists details last, and this is about placements.
        again.objects.iter_mut().for_each(|o| o.role = Role::Structural);
        prop_assert!(again.objects.iter().all(|o| o.transform.determinant() > 0.0));
        // A mirrored placement faces front again: its vertices come in the other order.
        let before = world(&scene).into_iter().enumerate().map(|(i, [a, b, c])| {
            let is_mirrored = transforms[i / 12].determinant() < 0.0;
            if is_mirrored { [a, c, b] } else { [a, b, c] }
        });
        prop_assert_eq!(sorted(before), sorted(world(&again)));
    }
}

#[test]
fn ktx2_pictures_pass_through_as_they_are() {
    let picture = b"\xABKTX 20\xBB\r\n\x1A\nBasis and whatever else it holds";
    let data: String = picture.iter().map(|b| format!("%{b:02x}")).collect();
    let json = triangle_json(&format!(
        r#""nodes":[{{"mesh":0}}],"extensionsRequired":["KHR_texture_basisu"],
        "images":[{{"uri":"data:image/ktx2,{data}"}}],
        "textures":[{{"extensions":{{"KHR_texture_basisu":{{"source":0}}}}}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}]"#
    ))
    .replace(r#""indices":1"#, r#""indices":1,"material":0"#);
    let first = read(&json, &triangle_bin()).unwrap().scene;
    let written = export_glb(&first);
    let text = String::from_utf8_lossy(&written);
    assert!(text.contains(r#""KHR_texture_basisu":{"source":0}"#));
    let again = decode_gltf(&written, &ImportOptions::default())
        .unwrap()
        .scene;
    for scene in [first, again] {
        assert_eq!(scene.images[0].mime, "image/ktx2");
        assert_eq!(scene.images[0].bytes, picture);
        assert_eq!(scene.textures[0].image, Some(0));
    }
}
