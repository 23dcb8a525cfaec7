//! Untrusted bytes: every prefix is an error, every bit flip is an error or gives a world that satisfies its
//! invariants, and nothing takes more memory than the file justifies.

use crate::common;

use common::{two_rooms, two_rooms_with_parts, two_rooms_with_pvs, two_rooms_with_specials};
use enfilade_cpg::wire::{WireError, decode_glb, encode_glb};
use enfilade_cpg::{SourceRuns, SpecialShape, World};
use proptest::prelude::*;
use serde_json::{Value, json};

/// Makes a GLB of these chunks.
fn glb(json: &str, bin: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut out = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
    out.extend((json.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(json);
    if !bin.is_empty() {
        out.extend((bin.len() as u32).to_le_bytes());
        out.extend(b"BIN\0");
        out.extend(bin);
    }
    let len = out.len() as u32;
    out[8..12].copy_from_slice(&len.to_le_bytes());
    out
}

/// Returns the two rooms' JSON and binary chunk.
fn parts() -> (String, Vec<u8>) {
    parts_of(&two_rooms())
}

fn parts_of(world: &World) -> (String, Vec<u8>) {
    let bytes = encode_glb(world).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let end = 20 + word(12);
    (
        String::from_utf8(bytes[20..end].to_vec()).unwrap(),
        bytes[end + 8..].to_vec(),
    )
}

/// Decodes the two rooms with one part of the JSON replaced.
fn with(from: &str, to: &str) -> Result<World, WireError> {
    let (json, bin) = parts();
    assert!(json.contains(from), "{from} is not in {json}");
    decode_glb(&glb(&json.replacen(from, to, 1), &bin))
}

fn check(bytes: &[u8]) {
    if let Ok(world) = decode_glb(bytes) {
        world.validate().unwrap();
        // An accepted world can be written, and reads back as the same bytes from then on.
        let written = encode_glb(&world).unwrap();
        assert_eq!(encode_glb(&decode_glb(&written).unwrap()).unwrap(), written);
    }
}

#[test]
fn taking_a_file_apart_and_together_changes_nothing() {
    let (json, bin) = parts();
    assert_eq!(glb(&json, &bin), encode_glb(&two_rooms()).unwrap());
}

#[test]
fn files_of_builds_that_did_not_tell_voids_have_rooms_and_no_file_has_the_outdoors_for_a_void() {
    let mut world = two_rooms();
    world.graph.cells[1].is_void = true;
    let (json, bin) = parts_of(&world);
    assert_eq!(decode_glb(&glb(&json, &bin)).unwrap().graph, world.graph);
    let old = json.replacen(",\"void\":true", "", 1);
    assert_ne!(old, json);
    let read = decode_glb(&glb(&old, &bin)).unwrap();
    let rooms = read.graph.rooms().map(|(id, _)| id.0);
    assert_eq!(rooms.collect::<Vec<_>>(), [0, 1]);
    let both = with("\"outdoor\":true", "\"outdoor\":true,\"void\":true");
    assert!(matches!(both, Err(WireError::Invalid(_))));
    assert!(with("\"outdoor\":true", "\"outdoor\":true,\"void\":1").is_err());
}

#[test]
fn every_prefix_is_an_error() {
    every_prefix_of(&two_rooms_with_parts());
    every_prefix_of(&two_rooms_with_specials());
}

fn every_prefix_of(world: &World) {
    let bytes = encode_glb(world).unwrap();
    for n in 0..bytes.len() {
        assert!(decode_glb(&bytes[..n]).is_err(), "{n} bytes decoded");
        // With a corrected header, too.
        if n >= 12 {
            let mut cut = bytes[..n].to_vec();
            cut[8..12].copy_from_slice(&(n as u32).to_le_bytes());
            check(&cut);
        }
    }
    let mut longer = bytes;
    longer.push(0);
    assert!(decode_glb(&longer).is_err());
}

#[test]
fn every_bit_flip_is_an_error_or_a_valid_world() {
    let bytes = encode_glb(&two_rooms_with_parts()).unwrap();
    flip_every_bit(&bytes, 0..bytes.len());
}

#[test]
fn every_bit_flip_in_special_portals_is_an_error_or_a_valid_world() {
    let (text, bin) = parts_of(&two_rooms_with_specials());
    let bytes = glb(&text, &bin);
    let at = |key: &str| 20 + text.find(key).unwrap();
    flip_every_bit(&bytes, at("\"specials\":")..at("\"batches\":"));
    let root: Value = serde_json::from_str(&text).unwrap();
    let view = &root["extensions"]["ENFILADE_cell_portal_graph"]["specialCorners"];
    let view = &root["bufferViews"][view.as_u64().unwrap() as usize];
    let [first, len] = ["byteOffset", "byteLength"].map(|f| view[f].as_u64().unwrap() as usize);
    let first = 28 + text.len() + first;
    flip_every_bit(&bytes, first..first + len);
}

fn flip_every_bit(bytes: &[u8], range: std::ops::Range<usize>) {
    let mut n_accepted = 0;
    let n_bits = range.len() * 8;
    for i in range.start * 8..range.end * 8 {
        let mut flipped = bytes.to_vec();
        flipped[i / 8] ^= 1 << (i % 8);
        if let Ok(world) = decode_glb(&flipped) {
            world.validate().unwrap();
            n_accepted += 1;
        }
    }
    // Names and low bits of vertices may have any value; most of the rest may not.
    assert!((1..n_bits).contains(&n_accepted), "{n_accepted}");
}

#[test]
fn a_plain_glb_is_no_world_and_the_message_says_what_to_do() {
    let plain = decode_glb(&glb(
        r#"{"asset":{"version":"2.0"},"extensions":{"X_y":{}}}"#,
        &[],
    ));
    let error = plain.unwrap_err();
    assert_eq!(error, WireError::NotAWorld);
    assert!(error.to_string().contains("enfilade bake"), "{error}");
}

#[test]
fn text_is_no_glb() {
    assert!(matches!(
        decode_glb(b"{\"asset\":{}}"),
        Err(WireError::NotGlb(_))
    ));
    assert!(matches!(decode_glb(b""), Err(WireError::NotGlb(_))));
    assert!(matches!(
        decode_glb(b"glTF\x01\0\0\0\x14\0\0\0"),
        Err(WireError::NotGlb(_))
    ));
}

#[test]
fn another_version_is_named() {
    for found in [0, 3, 7] {
        let says = format!("\"version\":{found},\"cells\":7,");
        let error = with("\"version\":1,", &says).unwrap_err();
        assert_eq!(error, WireError::Version { found });
        assert!(
            error.to_string().contains(&format!("version {found}")),
            "{error}"
        );
    }
}

#[test]
fn a_count_beyond_the_file_is_an_error_before_anything_is_allocated() {
    for (from, to) in [
        ("\"count\":4", "\"count\":18446744073709551615"),
        ("\"count\":4", "\"count\":4000000000"),
        ("\"outline\":4", "\"outline\":4294967295"),
        ("\"byteOffset\":0", "\"byteOffset\":18446744073709551615"),
        ("\"byteStride\":12", "\"byteStride\":0"),
        ("\"byteStride\":12", "\"byteStride\":11"),
    ] {
        let result = with(from, to);
        assert!(
            matches!(result, Err(WireError::Structure { .. })),
            "{from} → {to}: {result:?}"
        );
    }
}

#[test]
fn the_same_bytes_cannot_be_decoded_a_thousand_times() {
    let (json, mut bin) = parts();
    let mut root: Value = serde_json::from_str(&json).unwrap();
    // The chair gets a megabyte of positions, and is used a thousand times.
    let from = bin.len();
    let rows = 87_000;
    bin.resize(from + rows * 12, 0);
    let push = |list: &mut Value, entry: Value| {
        list.as_array_mut().unwrap().push(entry);
        list.as_array().unwrap().len() - 1
    };
    root["buffers"][0]["byteLength"] = json!(bin.len());
    let view = json!({"buffer": 0, "byteOffset": from, "byteLength": rows * 12});
    let view = push(&mut root["bufferViews"], view);
    let accessor =
        json!({"bufferView": view, "componentType": 5126, "count": rows, "type": "VEC3"});
    let accessor = push(&mut root["accessors"], accessor);
    root["meshes"][5]["primitives"][0]["attributes"] = json!({"POSITION": accessor});
    let details = &mut root["extensions"]["ENFILADE_cell_portal_graph"]["details"];
    for detail in details.as_array_mut().unwrap() {
        detail.as_object_mut().unwrap().remove("aabb");
    }
    assert!(decode_glb(&glb(&root.to_string(), &bin)).is_ok());
    for times in [10, 1000] {
        root["extensions"]["ENFILADE_cell_portal_graph"]["detailMeshes"] = json!(vec![5; times]);
        let error = decode_glb(&glb(&root.to_string(), &bin)).unwrap_err();
        assert!(
            error.to_string().contains("far more than it holds"),
            "{error}"
        );
    }
}

#[test]
fn a_header_that_tells_another_length_is_an_error() {
    // A file of one chunk, in which nothing else contradicts the length.
    let mut bytes = encode_glb(&World::default()).unwrap();
    bytes[8] ^= 4;
    assert!(matches!(
        decode_glb(&bytes),
        Err(WireError::Damaged { at: 8, .. })
    ));
}

#[test]
fn corners_of_no_portal_are_an_error() {
    let result = with("\"pieces\":[4,4]", "\"pieces\":[4]");
    assert!(
        matches!(result, Err(WireError::Structure { .. })),
        "{result:?}"
    );
}

#[test]
fn deep_nesting_is_an_error() {
    let deep = "[".repeat(1_000_000);
    assert!(decode_glb(&glb(&format!("{{\"extras\":{deep}"), &[])).is_err());
    let balanced = format!("{}{}", deep, "]".repeat(1_000_000));
    let (json, bin) = parts();
    // Ignored in data of others, refused where we must parse it.
    let ignored = json.replacen('{', &format!("{{\"extras\":{balanced},"), 1);
    check(&glb(&ignored, &bin));
    let material = json.replacen("\"ior\":1.4", &format!("\"ior\":{balanced}"), 1);
    assert!(matches!(
        decode_glb(&glb(&material, &bin)),
        Err(WireError::Structure { .. })
    ));
}

#[test]
fn a_detail_whose_mesh_is_not_its_nodes_is_an_error() {
    assert!(matches!(
        with("\"detailMeshes\":[5]", "\"detailMeshes\":[4]"),
        Err(WireError::Structure { .. })
    ));
}

#[test]
fn a_cell_whose_node_has_another_name_is_an_error() {
    assert!(matches!(
        with(
            "{\"name\":\"cell-0\",\"node\"",
            "{\"name\":\"cell-7\",\"node\""
        ),
        Err(WireError::Structure { .. })
    ));
}

#[test]
fn a_detail_that_was_moved_out_of_its_box_is_an_error() {
    let (json, bin) = parts();
    let at = json.find("\"matrix\":[").unwrap() + 9;
    let end = at + json[at..].find(']').unwrap();
    let numbers: Vec<f64> = json[at + 1..end]
        .split(',')
        .map(|n| n.parse().unwrap())
        .collect();
    let moved = |by: f64| {
        let mut m = numbers.clone();
        m[12] += by;
        let m: Vec<String> = m.iter().map(f64::to_string).collect();
        decode_glb(&glb(
            &format!("{}[{}{}", &json[..at], m.join(","), &json[end..]),
            &bin,
        ))
    };
    // Differences by rounding pass.
    moved(1e-6).unwrap();
    for by in [0.001, -0.5, 1e30] {
        assert!(
            matches!(moved(by), Err(WireError::Structure { .. })),
            "{by}"
        );
    }
}

#[test]
fn a_transform_in_parts_is_read_as_a_matrix_is() {
    use enfilade_geom::{DMat4, DQuat};
    let mut world = two_rooms();
    let turn = DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(-0.3);
    let (scale, to) = ([1.5, 0.5, 2.0], [2.0, 0.25, 1.5]);
    let whole = DMat4::from_scale_rotation_translation(scale.into(), turn, to.into());
    for d in &mut world.details {
        d.transform = whole.to_cols_array().map(|v| v as f32);
    }
    let bytes = encode_glb(&world).unwrap();
    let len = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let (json, bin) = (
        str::from_utf8(&bytes[20..20 + len]).unwrap(),
        &bytes[28 + len..],
    );
    let in_parts = |turn: [f64; 4], more: &str| {
        let mut out = String::new();
        let mut n = 0;
        for (i, part) in json.split("\"matrix\":[").enumerate() {
            if i == 0 {
                out.push_str(part);
                continue;
            }
            n += 1;
            let rest = &part[part.find(']').unwrap() + 1..];
            let parts = format!(
                "\"translation\":{to:?},\"rotation\":{turn:?},\"scale\":{scale:?}{more}{rest}"
            );
            out.push_str(&parts);
        }
        assert!(n > 0);
        decode_glb(&glb(&out, bin))
    };
    let read = in_parts(turn.to_array(), "").unwrap();
    for (a, b) in read.details.iter().zip(&world.details) {
        for (x, y) in a.transform.iter().zip(b.transform) {
            assert!((x - y).abs() < 1e-6, "{:?}", a.transform);
        }
    }
    for bad in [
        in_parts([0.0; 4], ""),
        in_parts([2.0, 0.0, 0.0, 0.0], ""),
        in_parts(
            turn.to_array(),
            ",\"matrix\":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]",
        ),
    ] {
        assert!(matches!(bad, Err(WireError::Structure { .. })));
    }
}

#[test]
fn a_leak_path_that_is_no_line_is_an_error() {
    // Node 1 is a cell with triangles, node 0 has no mesh, and the last does not exist.
    for node in [1, 0, 999] {
        let bad = with(
            "\"provenance\":",
            &format!("\"leakPath\":{node},\"provenance\":"),
        );
        assert!(matches!(bad, Err(WireError::Structure { .. })), "{node}");
    }
}

#[test]
fn sources_that_do_not_hold_together_are_errors() {
    let bytes = encode_glb(&two_rooms()).unwrap();
    let n = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let text = String::from_utf8(bytes[20..20 + n].to_vec()).unwrap();
    let with = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}: {text}");
        decode_glb(&glb(&text.replacen(from, to, 1), &bytes[28 + n..]))
    };
    for (from, to) in [
        // Runs: more and fewer than exist, and a view of something else.
        ("\"cells\":[1],\"sources\":2", "\"cells\":[1],\"sources\":3"),
        ("\"cells\":[1],\"sources\":2", "\"cells\":[1],\"sources\":1"),
        ("\"cells\":[1],\"sources\":2", "\"cells\":[1]"),
        ("\"sourceRuns\":", "\"sourceRuns\":99"),
        ("\"source\":3", "\"source\":4"),
        // A parent that is not an earlier source, and a source as its own parent.
        ("{\"parent\":0,", "{\"parent\":2,"),
        ("{\"parent\":0,", "{\"parent\":77,"),
        // Fixtures: a missing node, a missing light, a light that is also a camera.
        ("\"fixtures\":[", "\"fixtures\":[999,"),
        ("{\"light\":0}", "{\"light\":7}"),
        ("\"camera\":0", "\"camera\":3"),
        (
            "\"camera\":0",
            "\"camera\":0,\"extensions\":{\"KHR_lights_punctual\":{\"light\":0}}",
        ),
        ("\"cameras\":[{", "\"cameras\":[3,{"),
    ] {
        assert!(with(from, to).is_err(), "{from} -> {to}");
    }
}

#[test]
fn a_world_of_version_2_may_have_no_special_portals() {
    let read = with("\"version\":1,", "\"version\":2,").unwrap();
    // It is written in the lowest version that holds it.
    assert_eq!(
        encode_glb(&read).unwrap(),
        encode_glb(&two_rooms()).unwrap()
    );
}

#[test]
fn special_portals_that_do_not_hold_together_are_errors() {
    let (text, bin) = parts_of(&two_rooms_with_specials());
    let root: Value = serde_json::from_str(&text).unwrap();
    let extension = &root["extensions"]["ENFILADE_cell_portal_graph"];
    let corners = extension["specialCorners"].as_u64().unwrap();
    let camera = "\"way\":\"monitor\",";
    for (from, to) in [
        // A reader of version 1 would not know of them.
        ("\"version\":2,", "\"version\":1,".to_owned()),
        // Shapes: of both kinds, of none, in half.
        (
            "\"cell\":0,\"portal\":0",
            "\"cell\":0,\"portal\":0,\"pieces\":[4]".to_owned(),
        ),
        ("\"cell\":0,\"portal\":0", "\"cell\":0".to_owned()),
        (
            "\"pieces\":[4],\"passes\":[{\"way\":\"mon",
            "\"passes\":[{\"way\":\"mon".to_owned(),
        ),
        // Vertices: more and fewer than there are, and a view of something else.
        (
            "\"pieces\":[4],\"passes\"",
            "\"pieces\":[5],\"passes\"".to_owned(),
        ),
        (
            "\"pieces\":[4],\"passes\"",
            "\"pieces\":[3],\"passes\"".to_owned(),
        ),
        (
            "\"pieces\":[4],\"passes\"",
            "\"pieces\":[4294967295],\"passes\"".to_owned(),
        ),
        ("\"specialCorners\":", "\"specialCorners\":9".to_owned()),
        // Fields of other ways, and fields that lack.
        ("\"way\":\"mirror\"", "\"way\":\"glass\"".to_owned()),
        (
            "\"way\":\"mirror\"",
            "\"way\":\"mirror\",\"to\":1".to_owned(),
        ),
        (
            "\"way\":\"mirror\"",
            "\"way\":\"mirror\",\"scale\":1".to_owned(),
        ),
        (
            "\"way\":\"mirror\"",
            "\"way\":\"mirror\",\"fovY\":1".to_owned(),
        ),
        (camera, format!("{camera}\"back\":1,")),
        ("\"fovY\":1.25", "\"fov\":1.25".to_owned()),
        ("\"way\":\"lead\",\"to\":1,", "\"way\":\"lead\",".to_owned()),
        // Values of a kind that JSON has but we do not.
        ("\"fovY\":1.25", "\"fovY\":1e999".to_owned()),
        ("\"scale\":-2.5", "\"scale\":[1,1,1]".to_owned()),
        ("\"back\":1", "\"back\":-1".to_owned()),
        ("\"specials\":[", "\"specials\":[7,".to_owned()),
        ("\"passes\":[", "\"passes\":[null,".to_owned()),
    ] {
        assert!(text.contains(from), "{from}: {text}");
        let result = decode_glb(&glb(&text.replacen(from, &to, 1), &bin));
        assert!(
            matches!(
                result,
                Err(WireError::Structure { .. } | WireError::Json(_))
            ),
            "{from} -> {to}: {result:?}"
        );
    }
    // The vertices of the portals instead.
    let other = extension["portalCorners"].as_u64().unwrap();
    let [own, other] = [corners, other].map(|view| format!("\"specialCorners\":{view}"));
    assert!(decode_glb(&glb(&text.replacen(&own, &other, 1), &bin)).is_err());
    // Each number of each vertex.
    let view = &root["bufferViews"][corners as usize];
    let at = |field: &str| view[field].as_u64().unwrap() as usize;
    for word in 0..at("byteLength") / 4 {
        let mut bin = bin.clone();
        let first = at("byteOffset") + 4 * word;
        bin[first..first + 4].fill(0xff);
        let result = decode_glb(&glb(&text, &bin));
        assert!(matches!(result, Err(WireError::Invalid(_))), "{word}");
    }
}

/// In a few bytes, many special portals that all lead back by one of many vertices.
#[test]
fn a_large_opening_is_not_compared_again_and_again() {
    let mut world = two_rooms_with_specials();
    let lead = world.graph.specials[1].clone();
    let SpecialShape::Surface { pieces, .. } = &mut world.graph.specials[2].shape else {
        panic!("a wardrobe is in a wall");
    };
    let [a, .., d] = pieces[0][..] else {
        panic!("of four vertices");
    };
    let n = 100_000;
    let along = (1..n).map(|i| i as f32 / n as f32);
    pieces[0].extend(along.map(|s| [0, 1, 2].map(|k| d[k] + (a[k] - d[k]) * s)));
    assert_eq!(world.validate(), Ok(()));
    world.graph.specials.extend(vec![lead; 100_000]);
    let from = std::time::Instant::now();
    let _ = world.validate().unwrap_err();
    let portrait = world.graph.specials[0].shape.clone();
    for special in &mut world.graph.specials[6..] {
        special.shape = portrait.clone();
    }
    let _ = world.validate().unwrap_err();
    // Days, if each were compared.
    assert!(from.elapsed().as_secs() < 60);
}

/// Objects of ours may have `extensions` and `extras` of others, which we ignore.
#[test]
fn what_others_add_is_accepted_anywhere() {
    let mut rich = two_rooms_with_specials();
    rich.leak_path = vec![[0.0; 3], [1.0; 3]];
    rich.pvs = two_rooms_with_parts().pvs;
    let (text, bin) = parts_of(&rich);
    let mut root: Value = serde_json::from_str(&text).unwrap();
    let mut n = 0;
    add_to_all(
        &mut root["extensions"]["ENFILADE_cell_portal_graph"],
        "",
        &mut n,
    );
    assert!(n > 40, "{n}");
    let read = decode_glb(&glb(&root.to_string(), &bin)).unwrap();
    // Nothing of ours is lost or changed: the same but for the order of keys in materials.
    let sorted = |text: &str| serde_json::from_str::<Value>(text).unwrap();
    let (own, own_bin) = parts_of(&read);
    assert_eq!(sorted(&own), sorted(&text));
    assert!(own_bin == bin);
}

/// Adds fields of others to an object and all objects in it, except where keys are names.
fn add_to_all(value: &mut Value, key: &str, n: &mut usize) {
    match value {
        Value::Object(fields) if !matches!(key, "extras" | "statistics" | "settings") => {
            for (key, inner) in fields.iter_mut() {
                add_to_all(inner, key, n);
            }
            let theirs = json!({"VENDOR_moss": {"passes": [{"way": 7}], "cell": "north"}});
            fields.insert("extensions".into(), theirs);
            if key != "sources" {
                fields.insert("extras".into(), json!([null, {"specials": 3}]));
            }
            *n += 1;
        }
        Value::Array(items) => items.iter_mut().for_each(|item| add_to_all(item, key, n)),
        _ => {}
    }
}

#[test]
fn broken_parts_and_volumes_are_errors() {
    let mut world = two_rooms_with_parts();
    // Makes the last five buffer views those of parts and volumes.
    world.batches[0].sources = SourceRuns::default();
    let bytes = encode_glb(&world).unwrap();
    assert_eq!(decode_glb(&bytes).unwrap().pvs, world.pvs);
    let n = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let text = String::from_utf8(bytes[20..20 + n].to_vec()).unwrap();
    let bin = &bytes[28 + n..];
    let root: Value = serde_json::from_str(&text).unwrap();
    let views = root["bufferViews"].as_array().unwrap();
    let at = |view: usize, field: &str| views[view][field].as_u64().unwrap_or_default() as usize;
    let first = views.len() - 5;
    for view in first..views.len() {
        let size = if view + 1 == views.len() { 8 } else { 4 };
        for word in 0..at(view, "byteLength") / size {
            let mut bin = bin.to_vec();
            let start = at(view, "byteOffset") + size * word;
            bin[start..start + size].fill(0xff);
            let result = decode_glb(&glb(&text, &bin));
            assert!(
                matches!(result, Err(WireError::Invalid(_))),
                "{view} {word}"
            );
        }
    }
    let named = format!("\"parts\":{{\"rows\":{first}");
    assert!(text.contains(&named), "{text}");
    for bad in ["\"parts\":{\"rows\":999", "\"parts\":{\"rows\":0"] {
        let result = decode_glb(&glb(&text.replacen(&named, bad, 1), bin));
        assert!(result.is_err(), "{bad}");
    }
}

#[test]
fn a_broken_set_of_what_is_seen_is_an_error() {
    let mut world = two_rooms_with_pvs();
    // Makes the last two buffer views those of the set.
    world.batches[0].sources = SourceRuns::default();
    let bytes = encode_glb(&world).unwrap();
    let n = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let text = String::from_utf8(bytes[20..20 + n].to_vec()).unwrap();
    let bin = &bytes[28 + n..];
    let root: Value = serde_json::from_str(&text).unwrap();
    let views = root["bufferViews"].as_array().unwrap();
    let (rows, runs) = (views.len() - 2, views.len() - 1);
    let named = format!("\"pvs\":{{\"rows\":{rows},\"runs\":{runs}}}");
    assert!(text.contains(&named), "{text}");
    for bad in [
        format!("\"pvs\":{{\"rows\":{runs},\"runs\":{rows}}}"),
        format!("\"pvs\":{{\"rows\":999,\"runs\":{runs}}}"),
        // The planes of the locator.
        format!("\"pvs\":{{\"rows\":{rows},\"runs\":{}}}", rows - 2),
        format!("\"pvs\":{{\"runs\":{runs}}}"),
        "\"pvs\":{}".to_owned(),
    ] {
        let result = decode_glb(&glb(&text.replacen(&named, &bad, 1), bin));
        assert!(
            matches!(
                result,
                Err(WireError::Structure { .. } | WireError::Invalid(_))
            ),
            "{bad}"
        );
    }
    // Make each word large.
    let at = |view: usize, field: &str| views[view][field].as_u64().unwrap_or_default() as usize;
    for view in [rows, runs] {
        for word in 0..at(view, "byteLength") / 4 {
            let mut bin = bin.to_vec();
            let first = at(view, "byteOffset") + 4 * word;
            bin[first..first + 4].fill(0xff);
            let result = decode_glb(&glb(&text, &bin));
            assert!(
                matches!(result, Err(WireError::Invalid(_))),
                "{view} {word}"
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn no_damage_panics(
        cut in any::<prop::sample::Index>(),
        paste in prop::collection::vec(any::<u8>(), 0..16),
        remove in 0usize..16,
    ) {
        let mut bytes = encode_glb(&two_rooms_with_specials()).unwrap();
        let at = cut.index(bytes.len());
        let end = (at + remove).min(bytes.len());
        bytes.splice(at..end, paste);
        if bytes.len() >= 12 {
            let len = bytes.len() as u32;
            bytes[8..12].copy_from_slice(&len.to_le_bytes());
        }
        check(&bytes);
    }
}
