//! Boxes written in the formats that are read.

use std::fmt::Write as _;
use std::io::Write as _;

use flate2::write::ZlibEncoder;
use flate2::{Compression, Crc};
use serde_json::json;

use super::nasty::{self, Triangle, cuboid};

pub(super) type Corners = [[f64; 3]; 2];

pub(super) fn triangles(boxes: &[(&str, Corners)]) -> Vec<Triangle> {
    boxes
        .iter()
        .flat_map(|(_, [a, b])| cuboid(*a, *b))
        .collect()
}

pub(super) fn obj(boxes: &[(&str, Corners)]) -> String {
    let mut text = "mtllib two.mtl\n".to_owned();
    for (name, [low, high]) in boxes {
        let _ = writeln!(text, "o {name}\nusemtl wall");
        text += &nasty::obj(&cuboid(*low, *high));
    }
    text
}

pub(super) fn ply(boxes: &[(&str, Corners)]) -> String {
    let all = triangles(boxes);
    let n = all.len();
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {n}\nproperty list uchar int vertex_indices\nend_header\n",
        3 * n
    );
    for [x, y, z] in all.as_flattened() {
        let _ = writeln!(text, "{x} {y} {z}");
    }
    for i in 0..n {
        let _ = writeln!(text, "3 {} {} {}", 3 * i, 3 * i + 1, 3 * i + 2);
    }
    text
}

/// Big-endian.
pub(super) fn binary_ply(boxes: &[(&str, Corners)]) -> Vec<u8> {
    let all = triangles(boxes);
    let mut bytes = format!(
        "ply\nformat binary_big_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty double z\n\
         property uchar red\nelement face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        3 * all.len(),
        all.len()
    )
    .into_bytes();
    for [x, y, z] in all.as_flattened() {
        bytes.extend((*x as f32).to_be_bytes());
        bytes.extend((*y as f32).to_be_bytes());
        bytes.extend(z.to_be_bytes());
        bytes.push(200);
    }
    for i in (0..3 * all.len() as u32).step_by(3) {
        bytes.push(3);
        bytes.extend([i, i + 1, i + 2].into_iter().flat_map(u32::to_be_bytes));
    }
    bytes
}

/// Returns a tone of a tenth of a second, in 16 bits.
pub(super) fn wav() -> Vec<u8> {
    let samples = (0..800).map(|i| (f64::from(i) * 0.3).sin() * 20_000.0);
    let body: Vec<u8> = samples.flat_map(|s| (s as i16).to_le_bytes()).collect();
    let mut bytes = b"RIFF".to_vec();
    bytes.extend((36 + body.len() as u32).to_le_bytes());
    bytes.extend(b"WAVEfmt \x10\0\0\0\x01\0\x01\0");
    bytes.extend(8000_u32.to_le_bytes());
    bytes.extend(16_000_u32.to_le_bytes());
    bytes.extend(b"\x02\0\x10\0data");
    bytes.extend((body.len() as u32).to_le_bytes());
    bytes.extend(body);
    bytes
}

pub(super) fn stl(boxes: &[(&str, Corners)]) -> Vec<u8> {
    let all = triangles(boxes);
    let mut bytes = vec![b' '; 80];
    bytes.extend((all.len() as u32).to_le_bytes());
    for triangle in all {
        bytes.extend([0; 12]);
        bytes.extend(floats(&triangle));
        bytes.extend([0; 2]);
    }
    bytes
}

pub(super) fn floats(triangle: &Triangle) -> impl Iterator<Item = u8> + use<'_> {
    let all = triangle.as_flattened().iter();
    all.flat_map(|&x| (x as f32).to_le_bytes())
}

/// Returns a document with a mesh and a node per box, but without the buffer's address; and the buffer.
pub(super) fn gltf(boxes: &[(&str, Corners)]) -> (serde_json::Value, Vec<u8>) {
    let mut bin = Vec::new();
    let (mut views, mut accessors, mut meshes, mut nodes) = (vec![], vec![], vec![], vec![]);
    for (i, (name, [low, high])) in boxes.iter().enumerate() {
        let begin = bin.len();
        let all = cuboid(*low, *high);
        bin.extend(all.iter().flat_map(floats));
        views.push(json!({"buffer": 0, "byteOffset": begin, "byteLength": bin.len() - begin}));
        accessors.push(
            json!({"bufferView": i, "componentType": 5126, "type": "VEC3", "count": 3 * all.len(),
            "min": low, "max": high}),
        );
        meshes.push(json!({"primitives": [{"attributes": {"POSITION": i}, "material": 0}]}));
        nodes.push(json!({"mesh": i, "name": name, "translation": [0, 0, 0]}));
    }
    let roots: Vec<usize> = (0..nodes.len()).collect();
    let json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": roots}], "nodes": nodes, "meshes": meshes,
        "accessors": accessors, "bufferViews": views, "images": [{"uri": "picture.png"}], "textures": [{"source": 0}],
        "materials": [{"name": "wall", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    });
    (json, bin)
}

/// Returns brushes, z up, 32 units per meter; the window is filled, since a map must not leak.
pub(super) fn map(boxes: &[(&str, Corners)]) -> String {
    let mut text = "{\n\"classname\" \"worldspawn\"\n".to_owned();
    let pane = ("pane", [[8.2, 1.0, 2.0], [8.4, 2.0, 3.0]]);
    for (_, corners) in boxes.iter().chain([&pane]) {
        // East, north, up. North is -z.
        let [a, b] = corners.map(|[x, y, z]| [x, -z, y].map(|v| (v * 32.0).round()));
        let low = [0, 1, 2].map(|k| f64::min(a[k], b[k]));
        let high = [0, 1, 2].map(|k| f64::max(a[k], b[k]));
        text.push_str("{\n");
        for k in 0..3 {
            let (u, v) = ((k + 1) % 3, (k + 2) % 3);
            for (corner, first, last) in [(low, v, u), (high, u, v)] {
                let moved = |axis: usize| {
                    let mut p = corner;
                    p[axis] += 64.0;
                    p
                };
                for [x, y, z] in [moved(first), corner, moved(last)] {
                    let _ = write!(text, "( {x} {y} {z} ) ");
                }
                text.push_str("stone 0 0 0 1 1\n");
            }
        }
        text.push_str("}\n");
    }
    text.push_str("}\n{\n\"classname\" \"info_player_start\"\n\"origin\" \"64 -64 48\"\n}\n");
    text
}

/// Returns 3 × 3 rooms of 64 units, with an opening in each wall between two.
pub(super) fn prt() -> String {
    let mut portals = Vec::new();
    for a in 0..9 {
        let (x, y) = (f64::from(a % 3) * 64.0, f64::from(a / 3) * 64.0);
        if a % 3 < 2 {
            let x = x + 64.0;
            let corners = [
                [x, y + 8.0, 8.0],
                [x, y + 40.0, 8.0],
                [x, y + 40.0, 40.0],
                [x, y + 8.0, 40.0],
            ];
            portals.push((a, a + 1, corners));
        }
        if a / 3 < 2 {
            let y = y + 64.0;
            let corners = [
                [x + 8.0, y, 8.0],
                [x + 8.0, y, 40.0],
                [x + 40.0, y, 40.0],
                [x + 40.0, y, 8.0],
            ];
            portals.push((a, a + 3, corners));
        }
    }
    let mut text = format!("PRT1\n9\n{}\n", portals.len());
    for (a, b, corners) in portals {
        let _ = write!(text, "4 {a} {b} ");
        for [x, y, z] in corners {
            let _ = write!(text, "({x} {y} {z} ) ");
        }
        text.push('\n');
    }
    text
}

/// Returns a PNG of this size, depth and color, whose rows are given as bytes with the filter of each.
pub(in crate::input) fn png<'a>(
    [w, h]: [u32; 2],
    kind: [u8; 2],
    level: Compression,
    rows: impl IntoIterator<Item = &'a [u8]>,
) -> Vec<u8> {
    let mut packed = ZlibEncoder::new(Vec::new(), level);
    for row in rows {
        // Writing to memory cannot fail.
        let _ = packed.write_all(row);
    }
    let head = [&w.to_be_bytes()[..], &h.to_be_bytes(), &kind, &[0; 3]].concat();
    let mut out = b"\x89PNG\r\n\x1a\n".to_vec();
    let data = packed.finish().unwrap_or_default();
    for (name, data) in [(b"IHDR", head), (b"IDAT", data), (b"IEND", Vec::new())] {
        let mut sum = Crc::new();
        sum.update(name);
        sum.update(&data);
        out.extend((data.len() as u32).to_be_bytes());
        out.extend_from_slice(name);
        out.extend(data);
        out.extend(sum.sum().to_be_bytes());
    }
    out
}
