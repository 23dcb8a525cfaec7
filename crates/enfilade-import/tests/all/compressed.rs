//! glTF with compressed geometry, made by the reference encoders, reads as the original. Covers S1.

use crate::common;

use common::{box_primitive, f32_bytes, glb, triangle_bin, triangle_json, v, world};
use draco_core::{
    DataType, EncoderBuffer, EncoderOptions, FaceIndex, GeometryAttributeType, Mesh, MeshEncoder,
    PointAttribute, PointIndex,
};
use enfilade_geom::scene::Primitive;
use enfilade_geom::{DVec3, Triangle};
use enfilade_import::{ImportError, ImportOptions, Imported, Limits, decode_gltf};
use proptest::prelude::*;

fn read(json: &str, bin: &[u8]) -> Result<Imported, ImportError> {
    decode_gltf(&glb(json, bin), &ImportOptions::default())
}

/// Sixteen-bit positions of a box of `2 x 3 x 4` units, padded to eight bytes.
fn words(primitive: &Primitive) -> Vec<[u16; 4]> {
    let word = |p: &[f32; 3]| [p[0] as u16, p[1] as u16, p[2] as u16, 0];
    primitive.positions.iter().map(word).collect()
}

/// A document with a box whose positions and indices are compressed, and its binary chunk. The views' own buffer has
/// no data.
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

/// Triangles in canonical order: encoders rotate and reorder them.
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
    // The binary chunk's content does not matter: it is not the fallback's data.
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
            "needs 800000000 bytes",
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
            "needs bytes",
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

/// A Draco bitstream of a primitive: positions have the id 0, one color per vertex the id 1.
fn draco(primitive: &Primitive, speed: i32, bits: i32) -> Vec<u8> {
    let mut mesh = Mesh::new();
    let n = primitive.positions.len();
    let mut add = |kind, n_components: u8, data_type, bytes: &[u8]| {
        let mut attribute = PointAttribute::new();
        attribute.init(
            kind,
            n_components,
            data_type,
            kind == GeometryAttributeType::Color,
            n,
        );
        attribute.buffer_mut().write(0, bytes);
        mesh.add_attribute(attribute);
    };
    let positions = f32_bytes(primitive.positions.as_flattened());
    add(
        GeometryAttributeType::Position,
        3,
        DataType::Float32,
        &positions,
    );
    let colors: Vec<u8> = (0..n).flat_map(|i| [i as u8 * 30, 255, 0, 255]).collect();
    add(GeometryAttributeType::Color, 4, DataType::Uint8, &colors);
    let faces = primitive.indices.as_chunks::<3>().0;
    mesh.set_num_points(n);
    mesh.set_num_faces(faces.len());
    for (i, face) in faces.iter().enumerate() {
        mesh.set_face(FaceIndex(i as u32), face.map(PointIndex));
    }
    let mut options = EncoderOptions::new();
    options.set_global_int("encoding_speed", speed);
    options.set_global_int("decoding_speed", speed);
    if bits > 0 {
        options.set_attribute_int(0, "quantization_bits", bits);
    }
    let mut encoder = MeshEncoder::new();
    encoder.set_mesh(mesh);
    let mut out = EncoderBuffer::new();
    encoder.encode(&options, &mut out).unwrap();
    out.data().to_vec()
}

/// A document with a single primitive, a Draco bitstream.
fn draco_json(n_bytes: usize) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsRequired":["KHR_draco_mesh_compression"],
        "nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"COLOR_0":1}},"indices":2,
        "extensions":{{"KHR_draco_mesh_compression":
          {{"bufferView":0,"attributes":{{"POSITION":0,"COLOR_0":1}}}}}}}}]}}],
        "accessors":[{{"componentType":5126,"count":8,"type":"VEC3"}},
          {{"componentType":5121,"count":8,"type":"VEC4","normalized":true}},
          {{"componentType":5123,"count":36,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":{n_bytes}}}],
        "buffers":[{{"byteLength":{n_bytes}}}]}}"#
    )
}

#[test]
fn draco_reads_as_what_was_packed() {
    let plain = box_primitive([2.0, 3.0, 4.0]);
    // Speeds choose the codec: edgebreaker with valences, plain edgebreaker, sequential.
    for speed in [0, 5, 10] {
        let bytes = draco(&plain, speed, 0);
        let scene = read(&draco_json(bytes.len()), &bytes).unwrap().scene;
        assert_eq!(sorted(world(&scene)), corners_of(&plain, 1.0), "{speed}");
        let read = &scene.meshes[0].primitives[0];
        for (p, color) in read.positions.iter().zip(&read.colors) {
            let i = plain.positions.iter().position(|q| q == p).unwrap();
            assert_eq!(*color, [i as f32 * 30.0 / 255.0, 1.0, 0.0, 1.0]);
        }
    }
}

#[test]
fn draco_that_does_not_fit_ends_in_an_error() {
    let bytes = draco(&box_primitive([2.0, 3.0, 4.0]), 5, 0);
    let json = draco_json(bytes.len());
    for (from, to, text) in [
        (r#""bufferView":0"#, r#""bufferView":7"#, "no buffer view 7"),
        (
            r#"{"POSITION":0,"COLOR_0":1}}}"#,
            r#"{"POSITION":9,"COLOR_0":1}}}"#,
            "no attribute 9",
        ),
        (
            r#"{"POSITION":0,"COLOR_0":1}}}"#,
            r#"{"POSITION":1,"COLOR_0":1}}}"#,
            "4 components",
        ),
        (r#""byteLength":"#, r#""byteLength":10,"was":"#, "Draco"),
    ] {
        let changed = json.replacen(from, to, 1);
        assert_ne!(json, changed, "{from}");
        let error = read(&changed, &bytes).unwrap_err().to_string();
        assert!(
            error.contains("primitive 0") && error.contains(text),
            "{to}: {error}"
        );
    }
}

proptest! {
    #[test]
    fn damaged_draco_never_panics(
        speed in prop::sample::select(vec![0, 5, 10]),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        cut in any::<prop::sample::Index>(),
    ) {
        let mut bytes = draco(&box_primitive([2.0, 3.0, 4.0]), speed, 11);
        for (at, with) in changes {
            let at = at.index(bytes.len());
            bytes[at] = with;
        }
        let options = ImportOptions { limits: Limits::tiny(), ..ImportOptions::default() };
        let _ = decode_gltf(&glb(&draco_json(bytes.len()), &bytes), &options);
        let cut = &bytes[..cut.index(bytes.len())];
        let _ = decode_gltf(&glb(&draco_json(cut.len()), cut), &options);
    }
}

/// The triangle of `triangle_json` with two morph targets, the second one sparse: `+1 z` on all, `+5 y` on the last.
fn morph_json(mesh: &str, nodes: &str) -> (String, Vec<u8>) {
    let mut bin = triangle_bin();
    bin.extend(f32_bytes(&[
        0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 5.0, 0.0,
    ]));
    bin.push(2);
    let json = triangle_json(nodes)
        .replace(
            r#""indices":1}]"#,
            &format!(r#""indices":1,"targets":[{{"POSITION":2}},{{"POSITION":3}}]}}]{mesh}"#),
        )
        .replace(
            r#""type":"SCALAR"}]"#,
            r#""type":"SCALAR"},
            {"bufferView":2,"componentType":5126,"count":3,"type":"VEC3"},
            {"componentType":5126,"count":3,"type":"VEC3","sparse":{"count":1,
            "indices":{"bufferView":3,"componentType":5121},"values":{"bufferView":2,"byteOffset":36}}}]"#,
        )
        .replace(
            r#""byteLength":6}"#,
            r#""byteLength":6},{"buffer":0,"byteOffset":44,"byteLength":48},
            {"buffer":0,"byteOffset":92,"byteLength":1}"#,
        )
        .replace(r#"{"byteLength":44}"#, r#"{"byteLength":93}"#);
    (json, bin)
}

#[test]
fn morph_targets_rest_at_the_weights_of_the_node_or_else_of_the_mesh() {
    let nodes = r#""nodes":[{"mesh":0},{"mesh":0,"weights":[2,0]},{"mesh":0,"weights":[2,0]}]"#;
    let (json, bin) = morph_json(r#","weights":[1,0.5]"#, nodes);
    let imported = read(&json, &bin).unwrap();
    let world = world(&imported.scene);
    assert_eq!(
        world[0],
        [v(0.0, 0.0, 1.0), v(4.0, 0.0, 1.0), v(0.0, 5.5, 1.0)]
    );
    assert_eq!(
        world[1],
        [v(0.0, 0.0, 2.0), v(4.0, 0.0, 2.0), v(0.0, 3.0, 2.0)]
    );
    // Two shapes for three placements.
    assert_eq!(imported.scene.meshes.len(), 2);
    assert!(imported.report.to_string().contains("morph targets; fixed"));
    // Without weights they have no effect.
    let (json, bin) = morph_json("", r#""nodes":[{"mesh":0}]"#);
    assert_eq!(
        common::world(&read(&json, &bin).unwrap().scene)[0][2],
        v(0.0, 3.0, 0.0)
    );
    let (json, bin) = morph_json(r#","weights":[0,1]"#, r#""nodes":[{"mesh":0}]"#);
    let short = json.replace(
        r#"{"componentType":5126,"count":3"#,
        r#"{"componentType":5126,"count":4"#,
    );
    let error = read(&short, &bin).unwrap_err().to_string();
    assert!(
        error.contains("target 1") && error.contains("4 elements"),
        "{error}"
    );
}

/// Two boxes side by side, each on a grid of its own: 1 mm from `[0, 0, 0]`, 1.3 mm from `[2.0002, 0, 0]`.
fn quantized_boxes(scale: f64) -> (String, Vec<u8>) {
    let positions = |size: [f32; 3]| -> Vec<u8> {
        let positions = box_primitive(size).positions;
        positions
            .iter()
            .flatten()
            .flat_map(|&c| (c as u16).to_le_bytes())
            .collect()
    };
    let mut bin = positions([2000.0, 3000.0, 4000.0]);
    bin.extend(positions([1538.0, 2308.0, 3077.0]));
    bin.extend(box_primitive([1.0; 3]).indices.iter().map(|&i| i as u8));
    let node = |mesh: u32, x: f64, step: f64| {
        let (x, step) = (x * scale, step * scale);
        format!(r#"{{"mesh":{mesh},"translation":[{x},0,0],"scale":[{step},{step},{step}]}}"#)
    };
    let mesh = |k| format!(r#"{{"primitives":[{{"attributes":{{"POSITION":{k}}},"indices":2}}]}}"#);
    let positions = |offset| {
        format!(
            r#"{{"bufferView":0,"byteOffset":{offset},"componentType":5123,"count":8,"type":"VEC3"}}"#
        )
    };
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{},{}],"meshes":[{},{}],
        "accessors":[{},{},
          {{"bufferView":1,"componentType":5121,"count":36,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":96}},
          {{"buffer":0,"byteOffset":96,"byteLength":36}}],"buffers":[{{"byteLength":132}}]}}"#,
        node(0, 0.0, 0.001),
        node(1, 2.0002, 0.0013),
        mesh(0),
        mesh(1),
        positions(0),
        positions(48),
    );
    (json, bin)
}

/// Vertices of both objects in the plane between two boxes.
fn shared_corners(scene: &enfilade_geom::scene::Scene, x: f64) -> usize {
    let mut corners: Vec<[u64; 3]> = world(scene)
        .concat()
        .iter()
        .filter(|p| (p.x - x).abs() < 0.1)
        .map(|p| p.to_array().map(f64::to_bits))
        .collect();
    corners.sort_unstable();
    corners.dedup();
    corners.len()
}

#[test]
fn corners_that_quantization_parted_are_one_again() {
    let (json, bin) = quantized_boxes(1.0);
    let imported = read(&json, &bin).unwrap();
    // There were eight: 0.2 mm apart, and up to half a millimeter along the edges.
    assert_eq!(shared_corners(&imported.scene, 2.0), 4);
    assert!(
        imported.report.to_string().contains("4 vertices"),
        "{}",
        imported.report
    );
    // The finer grid decides.
    let farthest = world(&imported.scene)
        .concat()
        .iter()
        .filter(|p| p.x < 2.1)
        .fold(0.0, |m: f64, p| m.max(p.z));
    assert_eq!(farthest, f64::from(4.0_f32));
    // A grid of 6 cm does not come from rounding, and its vertices stay.
    let (json, bin) = quantized_boxes(60.0);
    assert_eq!(shared_corners(&read(&json, &bin).unwrap().scene, 120.0), 8);
    // Unrounded numbers stay apart, however near.
    let (json, bin) = quantized_boxes(1.0);
    let floats: Vec<f32> = bin[..96]
        .as_chunks::<2>()
        .0
        .iter()
        .map(|b| u16::from_le_bytes(*b).into())
        .collect();
    let floats = [f32_bytes(&floats), bin[96..].to_vec()].concat();
    let json = json
        .replace("5123", "5126")
        .replace(r#""byteOffset":48"#, r#""byteOffset":96"#);
    let json = json.replace(
        r#"{"buffer":0,"byteLength":96}"#,
        r#"{"buffer":0,"byteLength":192}"#,
    );
    let json = json.replace(
        r#""byteOffset":96,"byteLength":36"#,
        r#""byteOffset":192,"byteLength":36"#,
    );
    let json = json.replace(r#"[{"byteLength":132}]"#, r#"[{"byteLength":228}]"#);
    assert_eq!(shared_corners(&read(&json, &floats).unwrap().scene, 2.0), 8);
}

#[test]
fn corners_of_one_mesh_never_become_one() {
    // A sheet as thin as a step of its grid, with the vertices of a finer mesh in the middle.
    let (json, _) = quantized_boxes(1.0);
    let mut bin = Vec::new();
    for size in [[2000.0, 3000.0, 4000.0], [1.0, 2308.0, 3077.0]] {
        let positions = box_primitive(size).positions;
        bin.extend(
            positions
                .iter()
                .flatten()
                .flat_map(|&c| (c as u16).to_le_bytes()),
        );
    }
    bin.extend(box_primitive([1.0; 3]).indices.iter().map(|&i| i as u8));
    let scene = read(&json.replace("2.0002", "1.99935"), &bin)
        .unwrap()
        .scene;
    let thin = &world(&scene)[12..];
    assert!(
        thin.iter()
            .all(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
    );
}
