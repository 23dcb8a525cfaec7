//! glTF with compressed geometry, made here with the reference encoders: it reads as what it was made of. Covers S1.

mod common;

use common::{box_primitive, glb, world};
use enfilade_geom::scene::Primitive;
use enfilade_geom::{DVec3, Triangle};
use enfilade_import::{ImportError, ImportOptions, Imported, decode_gltf};

fn read(json: &str, bin: &[u8]) -> Result<Imported, ImportError> {
    decode_gltf(&glb(json, bin), &ImportOptions::default())
}

/// Sixteen-bit positions of a box of `2 x 3 x 4` units, padded to eight bytes.
fn words(primitive: &Primitive) -> Vec<[u16; 4]> {
    let word = |p: &[f32; 3]| [p[0] as u16, p[1] as u16, p[2] as u16, 0];
    primitive.positions.iter().map(word).collect()
}

/// A document with a box whose positions and indices are compressed, and its binary chunk. The buffer behind its views is
/// one without data.
fn meshopt_box(name: &str, normalized: bool) -> (String, Vec<u8>) {
    let primitive = box_primitive([2.0, 3.0, 4.0]);
    let version = if name.starts_with("KHR") { 1 } else { 0 };
    let mut bin =
        meshopt::encode_vertex_buffer_level(&words(&primitive), 2, Some(version)).unwrap();
    let n_positions = bin.len();
    let indices = meshopt::encode_index_buffer(&primitive.indices, 8).unwrap();
    bin.extend(&indices);
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsRequired":["{name}","KHR_mesh_quantization"],
        "nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "accessors":[
          {{"bufferView":0,"componentType":5123,"count":8,"type":"VEC3","normalized":{normalized}}},
          {{"bufferView":1,"componentType":5123,"count":36,"type":"SCALAR"}}],
        "bufferViews":[
          {{"buffer":1,"byteLength":64,"byteStride":8,"extensions":{{"{name}":
            {{"buffer":0,"byteLength":{n_positions},"byteStride":8,"count":8,"mode":"ATTRIBUTES"}}}}}},
          {{"buffer":1,"byteOffset":64,"byteLength":72,"extensions":{{"{name}":
            {{"buffer":0,"byteOffset":{n_positions},"byteLength":{},"byteStride":2,"count":36,
            "mode":"TRIANGLES"}}}}}}],
        "buffers":[{{"byteLength":{}}},
          {{"byteLength":136,"extensions":{{"{name}":{{"fallback":true}}}}}}]}}"#,
        indices.len(),
        bin.len(),
    );
    (json, bin)
}

/// Triangles in an order of their own: encoders turn them and put them elsewhere.
fn sorted(mut triangles: Vec<Triangle>) -> Vec<Triangle> {
    let key = |p: &DVec3| p.to_array().map(f64::to_bits);
    for t in &mut triangles {
        let first = (0..3).min_by_key(|&k| key(&t[k])).unwrap();
        t.rotate_left(first);
    }
    triangles.sort_by_key(|t| t.map(|p| key(&p)));
    triangles
}

fn corners_of(primitive: &Primitive, scale: f32) -> Vec<Triangle> {
    let corner = |&i: &u32| {
        let p = primitive.positions[i as usize].map(|c| c * scale);
        DVec3::from_array(p.map(f64::from))
    };
    let triangles = primitive.indices.as_chunks::<3>().0;
    sorted(triangles.iter().map(|t| t.each_ref().map(corner)).collect())
}

#[test]
fn meshopt_with_a_fallback_that_is_not_there_reads_as_plain() {
    let plain = box_primitive([2.0, 3.0, 4.0]);
    for name in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        let (json, bin) = meshopt_box(name, false);
        let scene = read(&json, &bin).unwrap().scene;
        assert_eq!(sorted(world(&scene)), corners_of(&plain, 1.0), "{name}");
    }
    let (json, bin) = meshopt_box("EXT_meshopt_compression", true);
    let json = json.replace(
        r#""nodes":[{"mesh":0}]"#,
        r#""nodes":[{"mesh":0,"scale":[65535,65535,65535]}]"#,
    );
    let scene = read(&json, &bin).unwrap().scene;
    assert_eq!(sorted(world(&scene)), corners_of(&plain, 1.0));
}

#[test]
fn the_first_buffer_may_be_the_fallback() {
    let (json, bin) = meshopt_box("EXT_meshopt_compression", false);
    let data: String = bin.iter().map(|b| format!("%{b:02x}")).collect();
    let json = json
        .replace(r#""buffer":0"#, r#""buffer":9"#)
        .replace(r#""buffer":1"#, r#""buffer":0"#)
        .replace(r#""buffer":9"#, r#""buffer":1"#)
        .replace(
            &format!(
                r#""buffers":[{{"byteLength":{}}},
          {{"byteLength":136,"extensions":{{"EXT_meshopt_compression":{{"fallback":true}}}}}}]"#,
                bin.len()
            ),
            &format!(
                r#""buffers":[{{"byteLength":136,
                "extensions":{{"EXT_meshopt_compression":{{"fallback":true}}}}}},
                {{"byteLength":{},"uri":"data:,{data}"}}]"#,
                bin.len()
            ),
        );
    // What the binary chunk holds is no matter: it is not the fallback's data.
    let scene = read(&json, &[0; 8]).unwrap().scene;
    let plain = box_primitive([2.0, 3.0, 4.0]);
    assert_eq!(sorted(world(&scene)), corners_of(&plain, 1.0));
}

#[test]
fn compressed_views_that_do_not_fit_are_errors_with_their_place() {
    let (json, bin) = meshopt_box("EXT_meshopt_compression", false);
    for (from, to, text) in [
        (
            r#""count":8,"mode""#,
            r#""count":7,"mode""#,
            "7 elements of 8 bytes for a view of 64",
        ),
        (
            r#""count":8,"mode""#,
            r#""count":4294967295,"mode""#,
            "4294967295 elements",
        ),
        (
            r#""count":8,"mode""#,
            r#""count":100000000,"mode""#,
            "asks for 800000000 bytes",
        ),
        (
            r#""count":8,"mode""#,
            r#""count":10000000,"mode""#,
            "meshopt: the data is cut off",
        ),
        (
            r#""byteStride":2,"count":36"#,
            r#""byteStride":2,"count":33"#,
            "for a view of 72",
        ),
        (
            r#""byteStride":2,"count":36"#,
            r#""byteStride":2,"count":37"#,
            "do not make triangles",
        ),
        (
            r#""byteStride":2,"count""#,
            r#""byteStride":3,"count""#,
            "indices of 3 bytes",
        ),
        ("\"TRIANGLES\"", "\"INDICES\"", "begins with 0xe1"),
        ("\"TRIANGLES\"", "\"LINES\"", "unknown mode LINES"),
        (
            "\"TRIANGLES\"",
            "\"TRIANGLES\",\"filter\":\"OCTAHEDRAL\"",
            "the filter OCTAHEDRAL on",
        ),
        (
            "\"ATTRIBUTES\"",
            "\"ATTRIBUTES\",\"filter\":\"ODD\"",
            "the filter ODD",
        ),
        (
            r#"{"buffer":0,"byteLength""#,
            r#"{"buffer":1,"byteLength""#,
            "buffer 1 has no data",
        ),
        (
            r#"{"buffer":0,"byteLength""#,
            r#"{"buffer":5,"byteLength""#,
            "no buffer 5",
        ),
        (
            r#"{"buffer":0,"byteOffset":"#,
            r#"{"buffer":0,"byteOffset":9"#,
            "wants bytes",
        ),
    ] {
        let changed = json.replacen(from, to, 1);
        assert_ne!(json, changed, "{from}");
        let error = read(&changed, &bin).unwrap_err().to_string();
        assert!(
            error.contains("buffer view") && error.contains(text),
            "{to}: {error}"
        );
    }
}
