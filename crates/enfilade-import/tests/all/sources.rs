//! Sources that are not triangles become surfaces, alone or beside models. Covers S3.

use enfilade_geom::scene::Role;
use std::io::Cursor;

use e57::{E57Writer, Quaternion, Record, RecordValue, Transform, Translation};
use enfilade_geom::{Aabb, DVec3};
use enfilade_import::{
    HeightOptions, ImportOptions, Limits, SceneSource, decode_e57, decode_heights, decode_implicit,
    decode_las, decode_ply, import_sources,
};

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
    let step = surface.step.unwrap();
    assert!((step - 4.0 / 128.0).abs() < 1e-6, "{surface:?}");
    let told = &imported.report.settings;
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
    assert!(alone.report.settings.is_empty());
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

/// A PLY file of the walls of a room of 4 by 2.5 by 3 m around the origin.
fn room_ply(head: &str) -> Vec<u8> {
    let n = 40_000;
    let mut text = format!(
        "ply\nformat ascii 1.0\n{head}element vertex {n}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    );
    for i in 0..n {
        let y = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(n);
        let (turn, r) = (f64::from(i) * 2.399_963, (1.0 - y * y).sqrt());
        let d = DVec3::new(r * turn.cos(), y, r * turn.sin());
        let p = d * (DVec3::new(2.0, 1.25, 1.5) / d.abs()).min_element();
        text += &format!("{} {} {}\n", p.x, p.y, p.z);
    }
    text.into_bytes()
}

#[test]
fn a_cloud_of_points_is_a_scan_if_its_station_is_known() {
    let plain = ImportOptions::default();
    let error = decode_ply(&room_ply(""), &plain).unwrap_err().to_string();
    assert!(error.contains("--station"), "{error}");
    let given = ImportOptions {
        stations: vec![DVec3::ZERO],
        ..plain.clone()
    };
    let by_option = decode_ply(&room_ply(""), &given).unwrap();
    let by_file = decode_ply(&room_ply("comment station 0 0 0\n"), &plain).unwrap();
    assert_eq!(
        by_option.report.files[0].n_triangles,
        by_file.report.files[0].n_triangles
    );
    let text = &by_file.report.files[0].surface.as_ref().unwrap().text;
    assert_eq!(
        text,
        "a scan of 40000 points, stations: 1; what no station saw is matter"
    );
    let two = "comment station 0 0 0\ncomment station 1 0 0\n";
    let error = decode_ply(&room_ply(two), &plain).unwrap_err().to_string();
    assert!(error.contains("property 'station'"), "{error}");
    let error = decode_ply(&room_ply("comment station 0 x 0\n"), &plain)
        .unwrap_err()
        .to_string();
    assert!(error.contains("line 3"), "{error}");
}

/// An E57 file with one scan of a room of 4 by 3 by 2.5 m, z up, 10 m east of the origin.
fn room_e57(has_pose: bool, n: u32) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, "file").unwrap();
    let records = vec![
        Record::CARTESIAN_X_F64,
        Record::CARTESIAN_Y_F64,
        Record::CARTESIAN_Z_F64,
    ];
    let mut cloud = writer.add_pointcloud("scan", records).unwrap();
    let translation = Translation {
        x: 10.0,
        y: 0.0,
        z: 0.0,
    };
    let rotation = Quaternion::default();
    cloud.set_transform(has_pose.then_some(Transform {
        rotation,
        translation,
    }));
    for i in 0..n {
        let y = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(n);
        let (turn, r) = (f64::from(i) * 2.399_963, (1.0 - y * y).sqrt());
        let d = DVec3::new(r * turn.cos(), r * turn.sin(), y);
        let p = d * (DVec3::new(2.0, 1.5, 1.25) / d.abs()).min_element();
        cloud
            .add_point(p.to_array().map(RecordValue::Double).to_vec())
            .unwrap();
    }
    cloud.finalize().unwrap();
    writer.finalize().unwrap();
    drop(writer);
    bytes.into_inner()
}

#[test]
fn scans_in_e57_stand_where_their_poses_say_with_z_up() {
    let plain = ImportOptions::default();
    let imported = decode_e57(&room_e57(true, 40_000), &plain).unwrap();
    let bounds = imported.scene.object_aabb(0);
    let middle = (bounds.min + bounds.max) * 0.5;
    assert!(
        middle.distance(DVec3::new(10.0, 0.0, 0.0)) < 0.1,
        "{bounds:?}"
    );
    // A block of matter around the room, with its height along y.
    let size = bounds.size();
    assert!(size.x > size.z + 0.9 && size.z > size.y + 0.4, "{size}");
    let error = decode_e57(&room_e57(false, 40_000), &plain)
        .unwrap_err()
        .to_string();
    assert!(error.contains("without a pose"), "{error}");
    let whole = room_e57(true, 40_000);
    for n in [10, 48, 500, whole.len() / 2, whole.len() - 1] {
        assert!(decode_e57(&whole[..n], &plain).is_err(), "{n}");
    }
    let mut broken = whole.clone();
    let at = broken.len() / 2;
    broken[at] ^= 0xff;
    let error = decode_e57(&broken, &plain).unwrap_err().to_string();
    assert!(error.contains("scan 0"), "{error}");
}

/// Gray of 16 bits, 9 × 7 samples.
const GRAY: &[u8] = include_bytes!("../../../../fuzz/seeds/heights/gray16.png");
/// Real numbers, 6 × 5 samples 2 m apart, with a place.
const GEOTIFF: &[u8] = include_bytes!("../../../../fuzz/seeds/heights/geotiff.tif");

// Covers V11.
#[test]
fn a_height_map_is_land_in_meters_alone_or_beside_models() {
    let mut options = ImportOptions {
        heights: HeightOptions {
            cell: Some(2.0),
            heights: Some([100.0, 110.0]),
        },
        ..ImportOptions::default()
    };
    let imported = decode_heights(GRAY, &options).unwrap();
    let bounds: Aabb = imported.scene.object_aabb(0);
    assert!((bounds.size().x - 16.0).abs() < 1e-3 && (bounds.size().z - 12.0).abs() < 1e-3);
    assert!((100.0..110.0).contains(&bounds.min.y) && bounds.min.y < bounds.max.y);
    options.heights = HeightOptions::default();
    let problem = decode_heights(GRAY, &options).unwrap_err().to_string();
    assert!(problem.contains("--cell"), "{problem}");
    // The file tells how far its samples are apart, and where they are.
    let bounds = decode_heights(GEOTIFF, &options)
        .unwrap()
        .scene
        .object_aabb(0);
    assert!((bounds.size().x - 10.0).abs() < 1e-3 && bounds.center().x.abs() < 1e-3);
    options.origin = DVec3::new(500_000.0, 0.0, -4_000_000.0);
    let placed = decode_heights(GEOTIFF, &options)
        .unwrap()
        .scene
        .object_aabb(0);
    assert!(
        (placed.min.x).abs() < 1e-3 && (placed.min.z).abs() < 1e-3,
        "{placed:?}"
    );
    let house = b"o house\nv 5 0 0\nv 9 0 0\nv 9 3 0\nv 5 3 0\nf 1 2 3 4\n";
    let source = |name: &str, bytes: &'static [u8]| SceneSource {
        path: name.into(),
        stream: Some(Box::new(bytes)),
        is_detail: false,
    };
    let both = [source("land.tif", GEOTIFF), source("house.obj", house)];
    let imported = import_sources(both, &ImportOptions::default()).unwrap();
    let formats: Vec<_> = imported.report.files.iter().map(|f| f.format).collect();
    assert_eq!(formats, ["TIFF", "OBJ"]);
}

/// Points of two rooms beside each other, z up, with the sources 5 and 9 seen from the middle of each.
fn rooms_las(is_compressed: bool, n: u32) -> Vec<u8> {
    let mut header = las::Builder::from((1, 4));
    header.point_format = las::point::Format::new(1).unwrap();
    header.point_format.is_compressed = is_compressed;
    let header = header.into_header().unwrap();
    let mut writer = las::Writer::new(Cursor::new(Vec::new()), header).unwrap();
    for (source, middle) in [(9, 4.2), (5, 0.0)] {
        for i in 0..n {
            let y = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(n);
            let (turn, r) = (f64::from(i) * 2.399_963, (1.0 - y * y).sqrt());
            let d = DVec3::new(r * turn.cos(), r * turn.sin(), y);
            let p = d * (DVec3::new(2.0, 1.5, 1.25) / d.abs()).min_element();
            let point = las::Point {
                x: p.x + middle,
                y: p.y,
                z: p.z,
                point_source_id: source,
                gps_time: Some(0.0),
                ..las::Point::default()
            };
            writer.write_point(point).unwrap();
        }
    }
    writer.close().unwrap();
    writer.into_inner().unwrap().into_inner()
}

#[test]
fn las_and_laz_are_scans_if_the_stations_of_their_sources_are_given() {
    let stations = |all: &[[f64; 3]]| ImportOptions {
        stations: all.iter().map(|p| DVec3::from_array(*p)).collect(),
        ..ImportOptions::default()
    };
    let both = stations(&[[0.0; 3], [4.2, 0.0, 0.0]]);
    let las = rooms_las(false, 40_000);
    let imported = decode_las(&las, &both).unwrap();
    let size = imported.scene.object_aabb(0).size();
    // A block of matter around both rooms, with its height along y.
    assert!(size.x > 8.2 && size.x < 9.0, "{size}");
    assert!(size.z > size.y + 0.4, "{size}");
    let compressed = decode_las(&rooms_las(true, 40_000), &both).unwrap();
    let all = |i: &enfilade_import::Imported| i.scene.meshes[0].primitives[0].positions.clone();
    assert!(all(&compressed) == all(&imported));
    let said =
        |bytes: &[u8], options: &ImportOptions| decode_las(bytes, options).unwrap_err().to_string();
    assert!(said(&las, &stations(&[])).contains("--station"));
    let error = said(&las, &stations(&[[0.0; 3], [1.0; 3], [2.0; 3]]));
    assert!(
        error.contains("2 sources") && error.contains("3 stations"),
        "{error}"
    );
    let laz = rooms_las(true, 40_000);
    for (whole, cuts) in [(&las, [3, 100, 300]), (&laz, [3, 100, 2000])] {
        for n in cuts.into_iter().chain([whole.len() / 2, whole.len() - 9]) {
            assert!(decode_las(&whole[..n], &both).is_err(), "{n}");
        }
    }
    // A thousand million points that are not there.
    let mut many = las.clone();
    many[107..111].copy_from_slice(&1_000_000_000_u32.to_le_bytes());
    many[247..255].copy_from_slice(&1_000_000_000_u64.to_le_bytes());
    let error = said(&many, &both);
    assert!(error.contains("promises 1000000000"), "{error}");
    let mut many = laz.clone();
    many[107..111].copy_from_slice(&1_000_000_000_u32.to_le_bytes());
    many[247..255].copy_from_slice(&1_000_000_000_u64.to_le_bytes());
    let error = said(&many, &both);
    assert!(
        error.contains("vertices") && error.contains("1000000000"),
        "{error}"
    );
}

#[test]
fn lengths_in_a_las_are_not_believed_beyond_its_end() {
    let options = ImportOptions {
        stations: vec![DVec3::ZERO],
        ..ImportOptions::default()
    };
    let said = |bytes: &[u8]| decode_las(bytes, &options).unwrap_err().to_string();
    // An extended record of 2^46 bytes, for which no process gets memory.
    let mut las = rooms_las(false, 100);
    let start = (las.len() as u64).to_le_bytes();
    las.extend([0; 60]);
    let at = las.len() - 40;
    las[at..at + 8].copy_from_slice(&(1_u64 << 46).to_le_bytes());
    las[235..243].copy_from_slice(&start);
    las[243..247].copy_from_slice(&1_u32.to_le_bytes());
    assert!(said(&las).contains("extended record 0"), "{}", said(&las));
    // As many chunks as a number can tell, of 16 bytes each in memory.
    let mut laz = rooms_las(true, 100);
    let to_points = u32::from_le_bytes(laz[96..100].try_into().unwrap()) as usize;
    let table = u64::from_le_bytes(laz[to_points..to_points + 8].try_into().unwrap()) as usize;
    laz[table + 4..table + 8].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(said(&laz).contains("4294967295 chunks"), "{}", said(&laz));
    for whole in [rooms_las(false, 40_000), rooms_las(true, 40_000)] {
        assert!(decode_las(&whole, &options).is_ok());
    }
}

#[test]
fn damaged_scans_never_panic() {
    let options = ImportOptions {
        stations: vec![DVec3::ZERO],
        limits: Limits {
            min_extent: 0.0,
            ..Limits::tiny()
        },
        ..ImportOptions::default()
    };
    let mut seed = 1_u64;
    let mut random = |n: usize| {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as usize % n
    };
    let files = [
        room_e57(true, 200),
        rooms_las(false, 100),
        rooms_las(true, 100),
    ];
    for (kind, whole) in files.iter().enumerate() {
        for _ in 0..40 {
            let mut bytes = whole.clone();
            for _ in 0..=random(4) {
                // Headers are at the start, and those of E57 at the end, too.
                let far = if random(2) == 0 {
                    bytes.len()
                } else {
                    bytes.len().min(400)
                };
                let at = random(far);
                bytes[at] = [0, 0xff, random(256) as u8][random(3)];
            }
            bytes.truncate(if random(4) == 0 {
                1 + random(bytes.len())
            } else {
                bytes.len()
            });
            let read = if kind == 0 {
                decode_e57(&bytes, &options)
            } else {
                decode_las(&bytes, &options)
            };
            drop(read);
        }
    }
}
