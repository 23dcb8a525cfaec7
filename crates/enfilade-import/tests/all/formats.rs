//! OBJ, PLY and STL on hand-made files. Covers S1.

use crate::common;

use common::{f32_bytes, v, world};
use enfilade_geom::{DVec3, triangle_area_normal};
use enfilade_import::{
    ImportError, ImportOptions, Imported, decode_obj, decode_ply, decode_stl, import,
};
use proptest::prelude::*;

fn obj(text: &str) -> Imported {
    decode_obj(text.as_bytes(), &ImportOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

type Decode = fn(&[u8], &ImportOptions) -> Result<Imported, ImportError>;

fn error(decode: Decode, bytes: &[u8]) -> String {
    decode(bytes, &ImportOptions::default())
        .unwrap_err()
        .to_string()
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn obj_polygons_groups_and_indices_of_both_kinds() {
    let text = format!(
        "# comment\r\n{SQUARE}vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 2\no room\ng Chair\n\
         f 1/1/1 2/2/1 3/3/1 \\\n4/4/1\ng Wall\nusemtl red\nf -4 -3 -2\nl 1 2\ng Chair\nf 1 2 4\n"
    );
    let imported = obj(&text);
    let scene = &imported.scene;
    let names: Vec<_> = scene.objects.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["Chair", "Wall"]);
    assert_eq!(world(scene).len(), 4);
    let chair = &scene.meshes[0].primitives[0];
    assert_eq!((chair.indices.len(), chair.uvs.len()), (6, 1));
    assert_eq!(
        scene.meshes[0].primitives[1].material,
        Some(0),
        "red stays on"
    );
    assert_eq!(chair.uvs[0][0], [0.0, 1.0], "glTF's v runs down");
    assert_eq!(chair.normals, [[0.0, 0.0, 1.0]; 4], "made unit");
    assert_eq!(scene.materials[0].name, "red");
    let notes = imported.report.to_string();
    assert!(
        notes.contains("points or lines") && notes.contains("'red'"),
        "{notes}"
    );
}

#[test]
fn obj_errors_name_the_line() {
    for (text, wanted) in [
        (
            format!("{SQUARE}f 1 2 5"),
            "line 5: '5' points at nothing: 4 positions",
        ),
        (format!("{SQUARE}f 1 2 0"), "line 5: '0' points at nothing"),
        (format!("{SQUARE}f 1 2 -5"), "line 5"),
        (
            format!("{SQUARE}f 1/1 2 3"),
            "line 5: '1/1' points at nothing",
        ),
        (format!("{SQUARE}f /1 2 3"), "points at nothing"),
        ("v 1 2\n".into(), "line 1: 2 numbers where 3 are needed"),
        ("v 1 2 x\n".into(), "line 1: 'x' is not a number"),
        ("v 1 2 99999999999999999999x\n".into(), "is not a number"),
        (SQUARE.into(), "no triangles"),
        (String::new(), "no triangles"),
        (format!("{SQUARE}f 1 2"), "fewer than three vertices"),
        (
            format!("{SQUARE}f {}", "1 ".repeat(5000)),
            "vertices of one polygon",
        ),
    ] {
        let error = error(decode_obj, text.as_bytes());
        assert!(error.contains(wanted), "{wanted}: {error}");
    }
}

#[test]
fn obj_corners_that_are_no_numbers_lose_their_triangles_only() {
    let imported = obj(&format!(
        "{SQUARE}v nan 0 0\nf 1 2 3\nf 1 2 5\nf 1 2 3 5\nv 1e999 0 0"
    ));
    assert_eq!(world(&imported.scene).len(), 2);
    assert_eq!(imported.report.nonfinite_vertices.n, 1);
    assert_eq!(imported.report.n_nonfinite_triangles, 2);
}

#[test]
fn far_off_obj_keeps_its_shape() {
    // At four million, f32 cannot represent thirds of a meter.
    let text = "v 4000000.1 0 0\nv 4000001.4 0 0\nv 4000000.1 1.3 0\nf 1 2 3";
    let options = ImportOptions {
        origin: v(4e6, 0.0, 0.0),
        ..ImportOptions::default()
    };
    let scene = decode_obj(text.as_bytes(), &options).unwrap().scene;
    let [a, b, _] = world(&scene)[0];
    // 1e-6: an f32 near 1 is exact to 1e-7.
    assert!(
        a.distance(v(0.1, 0.0, 0.0)) < 1e-6 && b.distance(v(1.4, 0.0, 0.0)) < 1e-6,
        "{a} {b}"
    );
}

#[test]
fn obj_materials_and_pictures_come_from_beside_it() {
    let folder = std::env::temp_dir().join(format!("enfilade-obj-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("p q.png"), b"\x89PNG\r\n\x1a\n").unwrap();
    std::fs::write(
        folder.join("m.mtl"),
        "newmtl pic\nKd 1 1 1\nmap_Kd -s 1 1 C:\\art\\p q.png\nnewmtl glassy\nd 0.3\n",
    )
    .unwrap();
    let path = folder.join("a.obj");
    let text = "mtllib m.mtl\nusemtl pic\no a\nf 1 2 3\no b\nusemtl glassy\nf 1 2 4";
    std::fs::write(&path, format!("{SQUARE}{text}")).unwrap();
    let imported = import(&[path], &[], &ImportOptions::default());
    std::fs::remove_dir_all(&folder).unwrap();
    let scene = imported.unwrap_or_else(|e| panic!("{e}")).scene;
    assert_eq!(
        (
            scene.images.len(),
            scene.textures.len(),
            scene.materials.len()
        ),
        (1, 1, 2)
    );
    assert_eq!(scene.materials[0].name, "glassy");
    assert!(
        scene.materials[1]
            .gltf
            .contains(r#""baseColorTexture":{"index":0}"#)
    );
    assert_eq!(scene.objects[1].reason, "material: see-through");
    assert_eq!(
        scene.meshes[0].primitives[0].uvs[0].len(),
        3,
        "a picture needs coordinates"
    );
}

/// A square with a quad, a double and an unknown element, in any encoding.
fn ply(encoding: &str) -> Vec<u8> {
    let mut out = format!(
        "ply\nformat {encoding} 1.0\ncomment x\nelement vertex 4\nproperty double x\nproperty float y\n\
         property short z\nproperty uchar red\nelement odd 1\nproperty list uchar int junk\n\
         element face 1\nproperty uchar flags\nproperty list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    let is_ascii = encoding == "ascii";
    let is_big = encoding == "binary_big_endian";
    let mut put = |bytes: &[u8], text: String| {
        if is_ascii {
            out.extend(text.bytes().chain([b' ']));
        } else if is_big {
            out.extend(bytes.iter().rev());
        } else {
            out.extend(bytes);
        }
    };
    for (x, y, z) in [
        (0.0f64, 0.0f32, 0i16),
        (1.0, 0.0, 0),
        (1.0, 1.0, 0),
        (0.0, 1.0, 0),
    ] {
        put(&x.to_le_bytes(), x.to_string());
        put(&y.to_le_bytes(), y.to_string());
        put(&z.to_le_bytes(), z.to_string());
        put(&[255], "255".into());
    }
    put(&[2], "2".into());
    for n in [7i32, 8] {
        put(&n.to_le_bytes(), n.to_string());
    }
    put(&[1], "1".into());
    put(&[4], "4".into());
    for n in 0i32..4 {
        put(&n.to_le_bytes(), n.to_string());
    }
    out
}

#[test]
fn ply_reads_alike_in_every_encoding() {
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let imported = decode_ply(&ply(encoding), &ImportOptions::default())
            .unwrap_or_else(|e| panic!("{encoding}: {e}"));
        let expected = [
            [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 1.0, 0.0)],
            [v(0.0, 0.0, 0.0), v(1.0, 1.0, 0.0), v(0.0, 1.0, 0.0)],
        ];
        assert_eq!(world(&imported.scene), expected, "{encoding}");
        assert_eq!(
            imported.scene.meshes[0].primitives[0].colors[2],
            [1.0, 0.0, 0.0, 1.0]
        );
    }
}

#[test]
fn ply_headers_cannot_ask_for_memory() {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000000000000\n";
    let xyz = "property float x\nproperty float y\nproperty float z\n";
    let faces = "element face 1\nproperty list int int vertex_indices\nend_header\n";
    let promised = error(decode_ply, format!("{header}{xyz}{faces}").as_bytes());
    assert!(
        promised.contains("promises 4000000000000000000"),
        "{promised}"
    );
    // No properties: no bytes, however many.
    let empty = format!("{header}element vertex 3\n{xyz}{faces}");
    assert!(error(decode_ply, empty.as_bytes()).contains("promises 3"));
    let long = [
        b"ply\nformat binary_little_endian 1.0\n".as_slice(),
        b"element face 1\nproperty list int int vertex_indices\nend_header\n",
        &i32::MAX.to_le_bytes(),
    ]
    .concat();
    assert!(error(decode_ply, &long).contains("cut off"));
    let negative = [&long[..long.len() - 4], &(-1i32).to_le_bytes()].concat();
    assert!(error(decode_ply, &negative).contains("list of -1"));
}

#[test]
fn ply_strips_and_bad_indices() {
    let strips = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n\
        0 0 0 1 0 0 0 1 0 1 1 0 8 0 1 2 3 -1 0 1 2";
    let scene = decode_ply(strips.as_bytes(), &ImportOptions::default())
        .unwrap()
        .scene;
    let normals: Vec<DVec3> = world(&scene).iter().map(triangle_area_normal).collect();
    assert_eq!(normals, [DVec3::Z; 3]);
    let bad = strips.replace("8 0 1 2 3", "8 0 1 9 3");
    assert!(error(decode_ply, bad.as_bytes()).contains("vertex 9 is out of range"));
}

fn binary_stl(triangles: &[[f32; 9]]) -> Vec<u8> {
    let mut out = b"solid in name only".to_vec();
    out.resize(80, 0);
    out.extend((triangles.len() as u32).to_le_bytes());
    for t in triangles {
        out.extend(f32_bytes(&[0.0, 0.0, 1.0]));
        out.extend(f32_bytes(t));
        out.extend([0, 0]);
    }
    out
}

#[test]
fn stl_reads_alike_in_both_encodings() {
    let triangles = [
        [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.5, 0.0],
        [2.0, 0.0, 0.0, 2.0, 1.5, 0.0, 0.0, 1.5, -0.0],
    ];
    let mut text = "solid my part\n".to_owned();
    for t in triangles {
        text += "facet normal 0 0 1\nouter loop\n";
        for p in t.chunks(3) {
            text += &format!(" vertex {} {} {}\n", p[0], p[1], p[2]);
        }
        text += "endloop\nendfacet\n";
    }
    text += "endsolid my part\n";
    let read = |bytes: &[u8]| decode_stl(bytes, &ImportOptions::default()).unwrap().scene;
    let (ascii, binary) = (read(text.as_bytes()), read(&binary_stl(&triangles)));
    assert_eq!(world(&ascii), world(&binary));
    assert_eq!(ascii.objects[0].name, "my part");
    assert_eq!(
        binary.meshes[0].primitives[0].positions.len(),
        4,
        "equal corners are one"
    );
}

#[test]
fn stl_errors_say_where() {
    let mut cut = binary_stl(&[[0.0; 9]; 3]);
    cut.truncate(cut.len() - 1);
    cut[0] = b'x';
    assert!(error(decode_stl, &cut).contains("promises 3 facets and the file holds 2"));
    for (text, wanted) in [
        (
            "solid a\nvertex 1 2",
            "line 2: a vertex needs three numbers",
        ),
        (
            "solid a\nouter loop\nvertex 1 2 3\nendloop",
            "line 4: a facet with 1 vertices",
        ),
        ("solid a\nbogus", "line 2: 'bogus'"),
        ("solid a\n", "cut off"),
        ("solid a\nendsolid a", "no triangles"),
        ("junk", "neither"),
    ] {
        let error = error(decode_stl, text.as_bytes());
        assert!(error.contains(wanted), "{wanted}: {error}");
    }
}

/// Every prefix and some thousands of changed bytes give an answer, never a panic, in little time.
fn is_hardened(decode: Decode, bytes: &[u8]) {
    let options = ImportOptions {
        limits: enfilade_import::Limits::tiny(),
        ..ImportOptions::default()
    };
    assert!(decode(bytes, &options).is_ok());
    for n in 0..bytes.len() {
        let _ = decode(&bytes[..n], &options);
    }
    let mut n_read = 0;
    for i in 0..bytes.len() {
        for bit in 0..8 {
            let mut changed = bytes.to_vec();
            changed[i] ^= 1 << bit;
            if let Ok(imported) = decode(&changed, &options) {
                n_read += 1;
                // The result keeps the scene's promises.
                assert!(
                    world(&imported.scene)
                        .iter()
                        .flatten()
                        .all(|p| p.is_finite())
                );
            }
        }
    }
    assert!(n_read > 0, "nothing was read, so nothing was tested");
}

#[test]
fn broken_files_end_in_errors() {
    is_hardened(
        decode_obj,
        format!("{SQUARE}vt 0 1\nvn 0 0 1\no a\nf 1/1/1 2//1 3 4").as_bytes(),
    );
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        is_hardened(decode_ply, &ply(encoding));
    }
    is_hardened(
        decode_stl,
        &binary_stl(&[[0., 0., 0., 2., 0., 0., 0., 1., 0.]]),
    );
    is_hardened(
        decode_stl,
        b"solid a\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendsolid",
    );
    let glb = common::glb(
        &common::triangle_json(r#""nodes":[{"mesh":0,"scale":[1,2,3]}]"#),
        &common::triangle_bin(),
    );
    is_hardened(enfilade_import::decode_gltf, &glb);
    // The end of a GLB is never optional.
    for n in 0..glb.len() {
        assert!(
            enfilade_import::decode_gltf(&glb[..n], &ImportOptions::default()).is_err(),
            "{n}"
        );
    }
}

proptest! {
    /// Any text of OBJ's words is read or rejected.
    #[test]
    fn obj_soup_never_panics(words in prop::collection::vec(
        prop::sample::select(vec!["v", "vt", "vn", "f", "o", "g", "usemtl", "\n", "\\\n", "1", "-1",
            "0", "2/1", "1//1", "//", "1e40", "nan", "#", "3", "4", "99999999999999999999"]), 0..200))
    {
        let text = format!("{SQUARE}{}", words.join(" "));
        let _ = decode_obj(text.as_bytes(), &ImportOptions::default());
    }

    /// Grids of quads come back unchanged, whichever writer made them.
    #[test]
    fn obj_and_ply_agree(heights in prop::collection::vec(0i8..5, 16)) {
        let mut obj = String::new();
        let mut ply = "ply\nformat ascii 1.0\nelement vertex 16\nproperty float x\nproperty float y\n\
            property float z\nelement face 9\nproperty list uchar int vertex_index\nend_header\n".to_owned();
        for (i, h) in heights.iter().enumerate() {
            let (x, z) = (i % 4, i / 4);
            obj += &format!("v {x} {h} {z}\n");
            ply += &format!("{x} {h} {z}\n");
        }
        for i in (0..11).filter(|i| i % 4 != 3) {
            let q = [i, i + 4, i + 5, i + 1];
            obj += &format!("f {} {} {} {}\n", q[0] + 1, q[1] + 1, q[2] + 1, q[3] + 1);
            ply += &format!("4 {} {} {} {}\n", q[0], q[1], q[2], q[3]);
        }
        let from_obj = decode_obj(obj.as_bytes(), &ImportOptions::default()).unwrap();
        let from_ply = decode_ply(ply.as_bytes(), &ImportOptions::default()).unwrap();
        prop_assert_eq!(world(&from_obj.scene), world(&from_ply.scene));
        prop_assert_eq!(world(&from_obj.scene).len(), 18);
        prop_assert_eq!(
            from_obj.report.non_planar_polygons.n,
            from_ply.report.non_planar_polygons.n
        );
    }
}

#[test]
fn a_ply_with_vertices_twice_is_refused() {
    let bytes = b"ply\nformat ascii 1.0\n\
        element vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n\
        element vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n\
        0 0 0 255\n1 0 0 255\n0 1 0 255\n1e99 0 0\n3 0 1 2\n";
    let error = decode_ply(bytes, &ImportOptions::default()).unwrap_err();
    assert!(error.to_string().contains("twice"), "{error}");
}

#[test]
fn numbers_that_are_no_meters_are_doubted_before_the_work() {
    // A room of 10 x 3 x 8 m with the given number of units per meter.
    let room = |a_meter: f64| {
        let (x, y, z) = (10.0 * a_meter, 3.0 * a_meter, 8.0 * a_meter);
        format!("v 0 0 0\nv {x} 0 0\nv 0 {y} {z}\nf 1 2 3\n")
    };
    let doubt = |a_meter: f64, unit: Option<f64>| {
        let options = ImportOptions {
            unit,
            ..ImportOptions::default()
        };
        let read = decode_obj(room(a_meter).as_bytes(), &options).unwrap();
        read.report.unit_doubt
    };
    assert_eq!(doubt(1.0, None), None);
    assert_eq!(doubt(15.0, None), None, "a hall");
    let text = doubt(100.0, None).unwrap();
    assert!(
        text.contains("1000 x 300 x 800 m") && text.contains("--unit cm or --unit in"),
        "{text}"
    );
    assert!(doubt(39.37, None).unwrap().ends_with("--unit in"));
    assert_eq!(
        doubt(100.0, Some(1.0)),
        None,
        "whoever says meters means them"
    );
    // Millimeters exceed the limit and are rejected.
    let error = decode_obj(room(1000.0).as_bytes(), &ImportOptions::default()).unwrap_err();
    assert!(error.to_string().contains("--unit 0.001"), "{error}");
}
