//! Scans: files of points made by code, and what is wrong with some.

use std::io::Cursor;

use e57::{E57Writer, Quaternion, Record, RecordValue, Transform, Translation};
use enfilade_testkit::Rng;

use super::cases::BadSource;
use super::pages::unpaged;

/// Points on the walls of a room of 4 by 3 by 2.5 m around the origin, z up.
fn room(n: usize) -> Vec<[f64; 3]> {
    let point = |i: usize| {
        let y = 1.0 - 2.0 * (i as f64 + 0.5) / n as f64;
        let (turn, r) = (i as f64 * 2.399_963, (1.0 - y * y).sqrt());
        let d = [r * turn.cos(), r * turn.sin(), y];
        let by = [2.0, 1.5, 1.25].iter().zip(d).map(|(h, d)| h / d.abs());
        let by = by.fold(f64::INFINITY, f64::min);
        d.map(|c| c * by)
    };
    (0..n).map(point).collect()
}

/// A cloud in PLY with a station.
pub(super) fn ply(points: &[[f64; 3]], n_told: usize, station: &str) -> Vec<u8> {
    let mut file = format!(
        "ply\nformat binary_little_endian 1.0\n{station}element vertex {n_told}\nproperty float x\nproperty float y\n\
         property float z\nend_header\n"
    )
    .into_bytes();
    let all = points.iter().flatten();
    file.extend(all.flat_map(|&c| (c as f32).to_le_bytes()));
    file
}

pub(super) fn las(points: &[[f64; 3]], is_compressed: bool) -> anyhow::Result<Vec<u8>> {
    let mut header = las::Builder::from((1, 4));
    header.point_format = las::point::Format::new(1)?;
    header.point_format.is_compressed = is_compressed;
    let mut writer = las::Writer::new(Cursor::new(Vec::new()), header.into_header()?)?;
    for &[x, y, z] in points {
        writer.write_point(las::Point {
            x,
            y,
            z,
            gps_time: Some(0.0),
            ..las::Point::default()
        })?;
    }
    writer.close()?;
    Ok(writer.into_inner()?.into_inner())
}

pub(super) fn e57(points: &[[f64; 3]]) -> anyhow::Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, "file")?;
    let records = vec![
        Record::CARTESIAN_X_F64,
        Record::CARTESIAN_Y_F64,
        Record::CARTESIAN_Z_F64,
    ];
    let mut cloud = writer.add_pointcloud("scan", records)?;
    cloud.set_transform(Some(Transform {
        rotation: Quaternion::default(),
        translation: Translation::default(),
    }));
    for point in points {
        cloud.add_point(point.map(RecordValue::Double).to_vec())?;
    }
    cloud.finalize()?;
    writer.finalize()?;
    drop(writer);
    Ok(bytes.into_inner())
}

pub(super) const STATION: [&str; 2] = ["--station", "0,0,0"];
pub(super) const ORIGIN: &str = "comment station 0 0 0\n";

/// Points told of that are not there.
const HUGE: usize = 1_000_000_000;

/// Few points: a bake of the whole takes a second.
pub(super) fn small() -> Vec<[f64; 3]> {
    room(1500)
}

/// Points that are not there, are not numbers, lie all at one place or far away, or were seen from nowhere.
pub(super) fn cases() -> Vec<BadSource> {
    let points = small();
    let n = points.len();
    let mut all: Vec<BadSource> = Vec::new();
    let mut add =
        |name: &str, bytes: Vec<u8>| all.push(BadSource::new(format!("ply {name}"), "ply", bytes));
    add("of 1e9 points", ply(&points, HUGE, ORIGIN));
    let text = ply(&points, HUGE, ORIGIN);
    let text = String::from_utf8_lossy(&text).replace("binary_little_endian", "ascii");
    add("of 1e9 points as text", text.into_bytes());
    add("of 2^64 points", ply(&points, usize::MAX, ORIGIN));
    add("of no points", ply(&[], 0, ORIGIN));
    add("of one point", ply(&points[..1], 1, ORIGIN));
    add("without a station", ply(&points, n, ""));
    for station in [
        "1e9 0 0",
        "1e38 0 0",
        "nan 0 0",
        "0 0",
        "x y z",
        "1e999 0 0",
        "2 0 0",
    ] {
        add(
            &format!("seen from {station}"),
            ply(&points, n, &format!("comment station {station}\n")),
        );
    }
    add(
        "seen from 5,000 places",
        ply(&points, n, &ORIGIN.repeat(5000)),
    );
    add(
        "seen from 70,000 places",
        ply(&points, n, &ORIGIN.repeat(70_000)),
    );
    let moved = |of: &dyn Fn(usize, [f64; 3]) -> [f64; 3]| -> Vec<[f64; 3]> {
        points.iter().enumerate().map(|(i, p)| of(i, *p)).collect()
    };
    for (name, points) in [
        ("all NaN", moved(&|_, _| [f64::NAN; 3])),
        (
            "with a NaN",
            moved(&|i, p| if i == 700 { [f64::NAN; 3] } else { p }),
        ),
        (
            "with infinity",
            moved(&|i, p| if i == 700 { [f64::INFINITY; 3] } else { p }),
        ),
        ("all at one place", moved(&|_, _| [1.0; 3])),
        ("all at the station", moved(&|_, _| [0.0; 3])),
        ("in a line", moved(&|i, _| [i as f64 * 0.01, 0.0, 0.0])),
        ("in a plane", moved(&|_, [x, y, _]| [x, y, 0.0])),
        ("far away", moved(&|_, p| p.map(|c| c + 1e7))),
        ("of a planet", moved(&|_, p| p.map(|c| c * 1e6))),
        ("of a grain", moved(&|_, p| p.map(|c| c * 1e-6))),
        ("of the least", moved(&|_, p| p.map(|c| c * 1e-44))),
        (
            "with one on the moon",
            moved(&|i, p| if i == 0 { [4e8; 3] } else { p }),
        ),
        (
            "along the reach",
            moved(&|i, p| p.map(|c| c * if i % 9 == 0 { 9.0 } else { 1.0 })),
        ),
    ] {
        add(name, ply(&points, n, ORIGIN));
    }
    let mut rng = Rng::new(11);
    let cloud: Vec<[f64; 3]> = (0..200_000)
        .map(|_| [0; 3].map(|_| rng.range(-12.0, 12.0)))
        .collect();
    add("of noise", ply(&cloud, cloud.len(), ORIGIN));
    all.extend(heads(n));
    all
}

/// Heads of LAS, LAZ and E57 that tell of points that are not there.
fn heads(n: usize) -> Vec<BadSource> {
    let mut all: Vec<BadSource> = Vec::new();
    let Ok([plain, packed, pages]) = files() else {
        return Vec::new();
    };
    for (ending, whole) in [("las", &plain), ("laz", &packed)] {
        let mut many = whole.clone();
        many[107..111].copy_from_slice(&(HUGE as u32).to_le_bytes());
        many[247..255].copy_from_slice(&(HUGE as u64).to_le_bytes());
        all.push(BadSource::new(format!("{ending} of 1e9 points"), ending, many).with(&STATION));
        let mut some = whole.clone();
        some[247..255].copy_from_slice(&50_000_000_u64.to_le_bytes());
        all.push(BadSource::new(format!("{ending} of 5e7 points"), ending, some).with(&STATION));
        all.push(BadSource::new(
            format!("{ending} without a station"),
            ending,
            whole.clone(),
        ));
    }
    // Points that the compressed vector does not have.
    for n_told in ["1000000000", "18446744073709551615", "50000000", "-1"] {
        let told = format!("recordCount=\"{n}\"");
        let bytes = unpaged(&pages).with_text(&told, &format!("recordCount=\"{n_told}\""));
        all.push(BadSource::new(
            format!("e57 of {n_told} points"),
            "e57",
            bytes,
        ));
    }
    all
}

/// The room in LAS, LAZ and E57.
pub(super) fn files() -> anyhow::Result<[Vec<u8>; 3]> {
    let points = small();
    Ok([las(&points, false)?, las(&points, true)?, e57(&points)?])
}
