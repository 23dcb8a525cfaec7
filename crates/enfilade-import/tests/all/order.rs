//! The order of items in files does not matter: the scene is the same list.

use std::path::PathBuf;

use enfilade_import::{ImportOptions, decode_gltf, decode_map, decode_obj, export_glb, import};
use enfilade_testkit::{
    TowerParams, furnished_house, mixed, office_tower, shuffled_glb, shuffled_map, shuffled_obj,
};
use serde_json::{Value, json};

use crate::common;
use common::{f32_bytes, glb};

/// Returns the whole imported scene as text.
fn read(glb: &[u8]) -> String {
    let read = decode_gltf(glb, &ImportOptions::default()).expect("a scene");
    format!("{:?}", read.scene)
}

#[test]
fn any_order_of_a_generated_scene_is_the_same_scene() {
    let mut scenes = mixed::all();
    scenes.push(furnished_house());
    scenes.push(office_tower(&TowerParams::with_rooms(8, 3)));
    for g in scenes {
        let glb = export_glb(&g.scene);
        let plain = read(&glb);
        for seed in 0..5 {
            let shuffled = shuffled_glb(&glb, seed);
            assert_ne!(shuffled, glb);
            assert!(read(&shuffled) == plain, "{}, seed {seed}", g.truth.scene);
        }
    }
}

/// A panel in the plane z = 0 as two primitives of two materials; some vertices are equal.
fn panel() -> (Vec<Value>, Vec<f32>) {
    let square = [[0, 0], [2, 0], [2, 2], [0, 0], [2, 2], [0, 2]];
    let positions: Vec<f32> = square
        .iter()
        .flat_map(|&[x, y]| [x as f32, y as f32, 0.0])
        .collect();
    let uvs: Vec<f32> = square.iter().flatten().map(|&x| x as f32).collect();
    let primitive = |material: u32| json!({ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "material": material });
    (vec![primitive(0), primitive(1)], [positions, uvs].concat())
}

/// Storeys with equal names and walls with equal names: some differ only in their descendants, some not at all.
fn twins() -> Vec<u8> {
    let (primitives, floats) = panel();
    let wall =
        |mesh: u32, x: u32| json!({ "name": "wall", "mesh": mesh, "translation": [x, 0, 0] });
    let storey = |children: [u32; 2]| json!({ "name": "storey", "children": children });
    let lamp = json!({ "name": "lamp", "extensions": { "KHR_lights_punctual": { "light": 0 } } });
    let material = |texture: u32| json!({ "name": "m", "pbrMetallicRoughness": { "baseColorTexture": { "index": texture } } });
    let texture = |image: u32| json!({ "source": image });
    let image = |n: u32| json!({ "uri": format!("data:image/png;base64,iVBORw0KGgo{n}") });
    let document = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0, 1, 2, 9] }],
        "nodes": [
            storey([3, 4]), storey([5, 6]), storey([7, 8]),
            wall(0, 0), wall(1, 0), wall(0, 0), wall(1, 5), wall(1, 5), wall(0, 0), lamp
        ],
        "meshes": [
            { "name": "panel", "primitives": primitives },
            { "name": "panel", "primitives": [primitives[1], primitives[0]] }
        ],
        "materials": [material(0), material(1)],
        "textures": [texture(0), texture(1)],
        "images": [image(1), image(2)],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point" }] } },
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3" },
            { "bufferView": 1, "componentType": 5126, "count": 6, "type": "VEC2" }
        ],
        "bufferViews": [{ "buffer": 0, "byteLength": 72 }, { "buffer": 0, "byteOffset": 72, "byteLength": 48 }],
        "buffers": [{ "byteLength": 120 }]
    });
    glb(&document.to_string(), &f32_bytes(&floats))
}

#[test]
fn what_has_one_name_is_told_apart_by_what_is_below_it() {
    let options = ImportOptions::default();
    let glb = twins();
    let scene = decode_gltf(&glb, &options).expect("a scene").scene;
    // Six walls under three storeys stay, and equal ones share their mesh.
    assert_eq!(scene.objects.len(), 6);
    assert_eq!(scene.nodes.len(), 9);
    assert_eq!(scene.meshes.len(), 1);
    assert_eq!(
        [
            scene.materials.len(),
            scene.textures.len(),
            scene.images.len()
        ],
        [2; 3]
    );
    assert_eq!(scene.meshes[0].primitives[0].positions.len(), 4);
    let places = |storey: u32| -> Vec<f64> {
        let walls = scene
            .objects
            .iter()
            .filter(|o| o.node.and_then(|n| scene.nodes[n as usize].parent) == Some(storey));
        walls.map(|o| o.transform.w_axis.x).collect()
    };
    let storeys = (0..9).filter(|&n| scene.nodes[n].name == "storey");
    let places: Vec<_> = storeys.map(|n| places(n as u32)).collect();
    assert_eq!(places, [vec![0.0, 0.0], vec![0.0, 5.0], vec![0.0, 5.0]]);
    let plain = format!("{scene:?}");
    for seed in 0..100 {
        assert!(read(&shuffled_glb(&glb, seed)) == plain, "seed {seed}");
    }
}

#[test]
fn files_may_come_in_any_order() {
    let dir = std::env::temp_dir().join(format!("enfilade-order-{}", std::process::id()));
    std::fs::create_dir_all(&dir).expect("a folder");
    let said = |glb: &[u8], copyright: &str, extras: u32| -> Vec<u8> {
        let n = u32::from_le_bytes(glb[12..16].try_into().expect("four bytes")) as usize;
        let mut root: Value = serde_json::from_slice(&glb[20..20 + n]).expect("JSON");
        root["asset"]["copyright"] = copyright.into();
        root["scenes"][0]["extras"] = json!({ "level": extras });
        common::glb(&root.to_string(), &glb[20 + n + 8..])
    };
    let files = [
        (
            "a.glb",
            said(&export_glb(&furnished_house().scene), "B. Mason", 2),
        ),
        ("b.glb", said(&twins(), "A. Mason", 1)),
        (
            "c.obj",
            b"o wall\nv 0 0 0\nv 4 0 0\nv 4 3 0\nv 0 3 0\nf 1 2 3 4\n".to_vec(),
        ),
    ];
    let paths: Vec<PathBuf> = files.iter().map(|f| dir.join(f.0)).collect();
    for (path, (_, bytes)) in paths.iter().zip(&files) {
        std::fs::write(path, bytes).expect("a file");
    }
    let read = |order: [usize; 3]| {
        let paths = order.map(|i| paths[i].clone());
        let scene = import(&paths, &[], &ImportOptions::default())
            .expect("a scene")
            .scene;
        assert_eq!(scene.about.copyright, "A. Mason\nB. Mason");
        assert_eq!(scene.about.extras, r#"{"level":1}"#);
        format!("{scene:?}")
    };
    let plain = read([0, 1, 2]);
    for order in [[0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        assert!(read(order) == plain, "{order:?}");
    }
    std::fs::remove_dir_all(&dir).expect("the folder");
}

/// Returns the planes of a box as a brush.
fn brush(min: [i32; 3], max: [i32; 3], texture: &str) -> String {
    let sides = (0..6).map(|side| {
        let (axis, high) = (side / 2, side % 2 == 1);
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let base = if high { max } else { min };
        let (mut a, mut c) = (base, base);
        a[if high { u } else { v }] += 16;
        c[if high { v } else { u }] += 16;
        let point = |p: [i32; 3]| format!("( {} {} {} )", p[0], p[1], p[2]);
        format!(
            "{} {} {} {texture} 0 0 0 1 1\n",
            point(a),
            point(base),
            point(c)
        )
    });
    format!("{{\n{}}}\n", sides.collect::<String>())
}

#[test]
fn brushes_sides_and_entities_may_come_in_any_order() {
    // Two brushes overlap, one occurs twice, and one has a slanted cut.
    let slanted = "{\n( 0 0 64 ) ( 0 64 0 ) ( 64 0 0 ) steel 0 0 0 1 1\n( 0 0 0 ) ( 0 16 0 ) ( 0 0 16 ) steel 0 0 0 1 1\n( 0 0 0 ) ( 0 0 16 ) ( 16 0 0 ) steel 0 0 0 1 1\n( 0 0 0 ) ( 16 0 0 ) ( 0 16 0 ) steel 0 0 0 1 1\n}\n";
    let boxes = [
        brush([0, 0, 0], [128, 128, 16], "brick"),
        brush([64, 0, 0], [256, 128, 16], "wood"),
        brush([64, 0, 0], [256, 128, 16], "wood"),
        brush([0, 0, 16], [16, 128, 96], "brick"),
    ];
    let door = |x| {
        format!(
            "{{\n\"classname\" \"func_door\"\n{}}}\n",
            brush([x, 0, 0], [x + 8, 8, 64], "door")
        )
    };
    let map = format!(
        "{{\n\"classname\" \"worldspawn\"\n{}{slanted}}}\n{}{}{}{{\n\"classname\" \"light\"\n\"origin\" \"64 64 48\"\n}}\n",
        boxes.concat(),
        door(300),
        door(400),
        door(300)
    );
    let read = |map: &str| {
        let read = decode_map(map.as_bytes(), &ImportOptions::default()).expect("a map");
        format!("{:?}", read.scene)
    };
    let plain = read(&map);
    for seed in 0..50 {
        let shuffled = shuffled_map(&map, seed);
        assert_ne!(shuffled, map);
        assert!(read(&shuffled) == plain, "seed {seed}");
    }
}

#[test]
fn vertices_and_faces_of_obj_may_come_in_any_order() {
    let mut obj = String::from("vt 0 0\nvn 0 0 1\n");
    for (x, y) in (0..4).flat_map(|x| (0..4).map(move |y| (x, y))) {
        obj += &format!("v {x} {y} {}\n", x * y);
    }
    for (name, x) in [("o wall", 0), ("usemtl brick", 1), ("g floor", 2)] {
        obj += &format!("{name}\n");
        for y in 1..4 {
            let a = 4 * x + y;
            obj += &format!("f {a}/1/1 {}/1/1 {}/1/1\n", a + 4, a + 5);
            obj += &format!("f {a} {} {}\n", a + 5, a + 1);
        }
    }
    let read = |obj: &str| {
        let read = decode_obj(obj.as_bytes(), &ImportOptions::default()).expect("a scene");
        format!("{:?}", read.scene)
    };
    let plain = read(&obj);
    for seed in 0..50 {
        let shuffled = shuffled_obj(&obj, seed);
        assert_ne!(shuffled, obj);
        assert!(read(&shuffled) == plain, "seed {seed}");
    }
}
