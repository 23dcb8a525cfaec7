//! A shuffled file has the same contents in another order.

use enfilade_geom::Triangle;
use enfilade_geom::scene::{Role, Scene};
use enfilade_testkit::{furnished_house, shuffled_glb, shuffled_map, shuffled_obj};
use serde_json::Value;

fn document(glb: &[u8]) -> Value {
    let n = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&glb[20..20 + n]).unwrap()
}

/// Returns the names in a list of the document, in order.
fn names(glb: &[u8], list: &str) -> Vec<String> {
    let document = document(glb);
    let items = document[list].as_array().unwrap().iter();
    items.map(|item| item["name"].to_string()).collect()
}

/// An object: its name, its material, and its triangles as the bits of their vertices.
type Content = (String, String, Vec<[[u64; 3]; 3]>);

/// Returns each object's triangles as bits, from the least vertex on, sorted, with its name and material.
fn content(scene: &Scene) -> Vec<Content> {
    let mut out = Vec::new();
    for object in &scene.objects {
        let mut only = scene.clone();
        only.objects = vec![object.clone()];
        let sources = [Role::Structural, Role::Detail].map(|r| only.triangle_sources(r));
        let mut triangles: Vec<[[u64; 3]; 3]> = (sources.into_iter().flatten())
            .map(|s| {
                let t: Triangle = only.world_triangle(s);
                let t = t.map(|p| p.to_array().map(f64::to_bits));
                let [a, b, c] = t;
                [a, b, c].min([b, c, a]).min([c, a, b])
            })
            .collect();
        triangles.sort_unstable();
        let looks = scene.meshes[object.mesh as usize].primitives.iter();
        let mut looks: Vec<_> = looks
            .map(|p| p.material.map_or("", |m| &scene.materials[m as usize].name))
            .collect();
        looks.sort_unstable();
        out.push((object.name.clone(), looks.join(" "), triangles));
    }
    out.sort();
    out
}

#[test]
fn a_shuffled_glb_is_the_same_scene_in_another_order() {
    use enfilade_import::{ImportOptions, decode_gltf, export_glb};
    let glb = export_glb(&furnished_house().scene);
    let read = |glb: &[u8]| decode_gltf(glb, &ImportOptions::default()).unwrap().scene;
    let shuffled = shuffled_glb(&glb, 1);
    assert_eq!(shuffled, shuffled_glb(&glb, 1));
    assert_ne!(shuffled, shuffled_glb(&glb, 2));
    for list in ["nodes", "meshes", "materials"] {
        let (mut before, mut after) = (names(&glb, list), names(&shuffled, list));
        assert_ne!(before, after, "{list}");
        before.sort();
        after.sort();
        assert_eq!(before, after, "{list}");
    }
    assert!(content(&read(&glb)) == content(&read(&shuffled)));
    // Positions of the largest part, in the order of the file.
    let positions = |glb: &[u8]| -> Vec<[u8; 12]> {
        let root = document(glb);
        let n_json = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
        let bin = &glb[28 + n_json..];
        let meshes = root["meshes"].as_array().unwrap().iter();
        let all = meshes.flat_map(|m| m["primitives"].as_array().unwrap());
        let accessors = all.map(|p| p["attributes"]["POSITION"].as_u64().unwrap() as usize);
        let largest = accessors.max_by_key(|&a| root["accessors"][a]["count"].as_u64());
        let accessor = &root["accessors"][largest.unwrap()];
        let view = &root["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let offset = |v: &Value| v["byteOffset"].as_u64().unwrap_or(0) as usize;
        let at = offset(view) + offset(accessor);
        let n = accessor["count"].as_u64().unwrap() as usize;
        let stride = view["byteStride"].as_u64().unwrap_or(12) as usize;
        let one = |i: usize| {
            bin[at + i * stride..at + i * stride + 12]
                .try_into()
                .unwrap()
        };
        (0..n).map(one).collect()
    };
    let (mut before, mut after) = (positions(&glb), positions(&shuffled));
    assert_ne!(before, after);
    before.sort_unstable();
    after.sort_unstable();
    assert_eq!(before, after);
}

#[test]
fn shuffled_text_has_the_same_lines_in_another_order() {
    let obj = "o a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1//1 2//1 4//1\nf 1 3 4\nf 2 3 4\nusemtl b\nf 1 2 3 4\n";
    // Returns positions by index, and the faces as sets of them, by material.
    fn read(obj: &str) -> Vec<(&str, Vec<&str>)> {
        let positions: Vec<&str> = obj.lines().filter(|l| l.starts_with("v ")).collect();
        let mut faces: Vec<(&str, Vec<&str>)> = Vec::new();
        let mut material = "";
        for line in obj.lines() {
            if line.starts_with("usemtl") {
                material = line;
            } else if let Some(corners) = line.strip_prefix("f ") {
                let number = |c: &str| c.split('/').next().unwrap().parse::<usize>().unwrap();
                let mut at: Vec<&str> = corners
                    .split(' ')
                    .map(|c| positions[number(c) - 1])
                    .collect();
                let least = (0..at.len()).min_by_key(|&k| at[k]).unwrap();
                at.rotate_left(least);
                faces.push((material, at));
            }
        }
        faces.sort();
        faces
    }
    let map = "{\n\"classname\" \"worldspawn\"\n{\n( 1\n( 2\n( 3\n}\n{\n( 4\n( 5\n}\n}\n{\n\"classname\" \"light\"\n}\n{\n\"classname\" \"door\"\n{\npatchDef2\n{\n( 6\n( 7\n}\n}\n}\n";
    let sorted = |text: &str| {
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        lines.sort();
        lines
    };
    let mut n_moved = 0;
    for seed in 0..20 {
        let other = shuffled_obj(obj, seed);
        n_moved += usize::from(other != shuffled_obj(obj, seed + 1));
        assert_eq!(read(&other), read(obj), "{other}");
        let other = shuffled_map(map, seed);
        n_moved += usize::from(other != map.trim_end());
        assert_eq!(sorted(&other), sorted(map), "{other}");
        assert!(other.contains("patchDef2\n{\n( 6\n( 7\n}"), "{other}");
    }
    assert!(n_moved > 30, "{n_moved}");
}
