//! Volumes: headers, orientation, units, levels, and what is refused. Covers S3.

use std::io::Write;
use std::sync::Arc;

use enfilade_geom::{Allowance, DVec3};
use enfilade_source::{AirSide, Level, SourceLimits, Volume};

const N: [usize; 3] = [24, 20, 16];
const SPACING: [f64; 3] = [0.5, 0.6, 0.75];

/// Distances from a sphere of radius 4 around (6, 6, 6), in the space of the file, as numbers of one type.
fn ball() -> Vec<f32> {
    let at = |i: usize| [i % N[0], i / N[0] % N[1], i / (N[0] * N[1])];
    let value = |i: usize| {
        let p = DVec3::from_array([0, 1, 2].map(|a| at(i)[a] as f64 * SPACING[a]));
        (p.distance(DVec3::splat(6.0)) - 4.0) as f32
    };
    (0..N.iter().product()).map(value).collect()
}

fn bytes_of(values: &[f32], is_big: bool) -> Vec<u8> {
    let one = |v: &f32| {
        if is_big {
            v.to_be_bytes()
        } else {
            v.to_le_bytes()
        }
    };
    values.iter().flat_map(one).collect()
}

/// A NIfTI-1 file in millimeters with its axes along those of space.
fn nifti(values: &[f32], is_big: bool) -> Vec<u8> {
    let mut head = vec![0_u8; 352];
    let mut put = |at: usize, b: &[u8]| {
        let mut b = b.to_vec();
        if is_big {
            b.reverse();
        }
        head[at..at + b.len()].copy_from_slice(&b);
    };
    put(0, &348_i32.to_le_bytes());
    for (i, n) in [3, N[0], N[1], N[2], 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * i, &(n as i16).to_le_bytes());
    }
    put(70, &16_i16.to_le_bytes());
    put(72, &32_i16.to_le_bytes());
    put(108, &352_f32.to_le_bytes());
    put(112, &1_f32.to_le_bytes());
    put(254, &1_i16.to_le_bytes());
    for (r, spacing) in SPACING.into_iter().enumerate() {
        put(280 + 16 * r + 4 * r, &(spacing as f32).to_le_bytes());
        put(280 + 16 * r + 12, &(r as f32 * 10.0).to_le_bytes());
    }
    head[123] = 2;
    head[344..347].copy_from_slice(b"n+1");
    head.extend(bytes_of(values, is_big));
    head
}

fn nrrd(encoding: &str, body: &[u8]) -> Vec<u8> {
    let head = format!(
        "NRRD0004\n# made by a test\ntype: float\ndimension: 3\nspace: left-posterior-superior\nsizes: {} {} {}\n\
         space directions: (-0.5,0,0) (0,-0.6,0) (0,0,0.75)\nkinds: domain domain domain\nendian: little\n\
         encoding: {encoding}\nspace origin: (0,-10,20)\n\n",
        N[0], N[1], N[2]
    );
    [head.as_bytes(), body].concat()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    out.write_all(bytes).unwrap();
    out.finish().unwrap()
}

fn parse(bytes: &[u8]) -> Result<Volume, enfilade_source::SourceError> {
    let mut beside = |name: &str| Err(format!("no file {name}"));
    Volume::parse(bytes, &mut beside, &SourceLimits::default())
}

const AIR_INSIDE: Level = Level {
    value: 0.0,
    air: AirSide::Below,
};

#[test]
fn a_ball_is_the_same_from_every_format_with_its_place_and_unit() {
    let values = ball();
    let plain = bytes_of(&values, false);
    let texts: Vec<String> = values.iter().map(ToString::to_string).collect();
    for (name, file) in [
        ("NIfTI", nifti(&values, false)),
        ("big-endian NIfTI", nifti(&values, true)),
        ("compressed NIfTI", gzip(&nifti(&values, false))),
        ("NRRD", nrrd("raw", &plain)),
        ("compressed NRRD", nrrd("gzip", &gzip(&plain))),
        ("NRRD as text", nrrd("ascii", texts.join(" ").as_bytes())),
    ] {
        assert!(Volume::is_one(&file), "{name}");
        let volume = parse(&file).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(
            (volume.size, volume.unit, volume.is_z_up),
            (N, Some(1e-3), true),
            "{name}"
        );
        let surface = volume
            .surface(AIR_INSIDE, &SourceLimits::default())
            .unwrap();
        // The center of the ball, moved by the origin of the file.
        let center = DVec3::new(6.0, 16.0, 26.0);
        for p in &surface.positions {
            let off = (p.distance(center) - 4.0).abs();
            assert!(off < 0.2, "{name}: {off} at {p}");
        }
        let volume_of = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| surface.positions[i as usize] - center);
            a.dot(b.cross(c)) / 6.0
        };
        // Faces look into the air, inside.
        let whole: f64 = surface.triangles.iter().map(volume_of).sum();
        assert!((whole + 268.1).abs() < 12.0, "{name}: {whole}");
        assert!(surface.distance < 0.2, "{name}: {}", surface.distance);
    }
}

#[test]
fn raw_samples_have_a_header_in_json() {
    let header = r#"{"enfilade":"volume","file":"ball.raw","size":[24,20,16],"type":"float32","spacing":[0.5,0.6,0.75],
        "unit":"cm","skip":4,"up":"z"}"#;
    let mut beside = |name: &str| match name {
        "ball.raw" => Ok([&[0; 4][..], &bytes_of(&ball(), false)].concat()),
        _ => Err("not there".to_owned()),
    };
    let limits = SourceLimits::default();
    let volume = Volume::parse(header.as_bytes(), &mut beside, &limits).unwrap();
    assert_eq!(volume.values, ball());
    assert_eq!((volume.unit, volume.is_z_up), (Some(0.01), true));
    for (from, to, place) in [
        ("[24,20,16]", "[24,20]", "size"),
        ("[24,20,16]", "[24,20,1e8]", "size"),
        ("[24,20,16]", "[25,20,16]", "samples"),
        ("float32", "float31", "type"),
        ("ball.raw", "other.raw", "file"),
        ("\"spacing\":[0.5,", "\"spacing\":[0,", "header"),
        ("\"skip\":4", "\"skop\":4", "header"),
        ("\"up\":\"z\"", "\"up\":\"x\"", "up"),
    ] {
        let text = header.replace(from, to);
        let error = Volume::parse(text.as_bytes(), &mut beside, &limits).unwrap_err();
        assert_eq!(error.place, place, "{to}: {error}");
    }
}

#[test]
fn truncated_and_wrong_headers_are_refused_at_their_place() {
    let whole = nifti(&ball(), false);
    for n in [0, 3, 100, 347, 351, 352, 5000, whole.len() - 1] {
        assert!(parse(&whole[..n]).is_err(), "{n}");
    }
    let changed = |at: usize, b: &[u8]| {
        let mut file = whole.clone();
        file[at..at + b.len()].copy_from_slice(b);
        parse(&file).unwrap_err().place
    };
    assert_eq!(changed(40, &9_i16.to_le_bytes()), "header.dim");
    assert_eq!(changed(42, &(-5_i16).to_le_bytes()), "header.dim");
    assert_eq!(changed(70, &128_i16.to_le_bytes()), "header.datatype");
    assert_eq!(changed(280, &f32::NAN.to_le_bytes()), "header");
    assert_eq!(changed(280, &0_f32.to_le_bytes()), "header");
    assert_eq!(changed(42, &30_000_i16.to_le_bytes()), "samples");
    let packed = gzip(&whole);
    assert!(
        parse(&packed[..packed.len() / 2])
            .unwrap_err()
            .problem
            .contains("cut off")
    );
    for (from, to) in [
        ("type: float", "type: block"),
        ("sizes: 24", "sizes: x"),
        ("encoding: raw", "encoding: bzip2"),
    ] {
        let file = nrrd("raw", &bytes_of(&ball(), false));
        let head = String::from_utf8_lossy(&file[..300]).replace(from, to);
        assert!(
            parse(&[head.as_bytes(), &file[300..]].concat()).is_err(),
            "{to}"
        );
    }
    let tiny = SourceLimits::tiny();
    let mut beside = |_: &str| Err(String::new());
    let mut large = nifti(&[], false);
    large[42..44].copy_from_slice(&3000_i16.to_le_bytes());
    let error = Volume::parse(&large, &mut beside, &tiny).unwrap_err();
    assert!(error.problem.contains("more than"), "{error}");
}

#[test]
fn samples_out_of_proportion_to_their_packed_bytes_are_refused() {
    // More than 2^27, and little of it is there: it is refused before it is unpacked.
    let zeros = gzip(&[0; 1 << 16]);
    let head = String::from_utf8(nrrd("gzip", &[])).unwrap();
    let head = head.replace("sizes: 24 20 16", "sizes: 1000 1000 200");
    let file = [head.as_bytes(), &zeros].concat();
    let why = parse(&file).unwrap_err();
    assert!(why.problem.contains("unpack from"), "{why}");
    let mut beside = |_: &str| Err(String::new());
    let held = SourceLimits {
        allowance: Some(Arc::new(Allowance::default().holding(1 << 62, || Some(0)))),
        ..SourceLimits::default()
    };
    let why = Volume::parse(&file, &mut beside, &held).unwrap_err();
    assert!(why.problem.contains("cut off"), "{why}");
}

#[test]
fn samples_without_a_value_are_matter_and_counted() {
    let mut values = ball();
    for z in 7..9 {
        for y in 9..11 {
            for x in 11..13 {
                values[x + N[0] * (y + N[1] * z)] = f32::NAN;
            }
        }
    }
    let volume = parse(&nifti(&values, false)).unwrap();
    let found = volume.summary();
    assert_eq!(
        (found.n_missing, found.first_missing),
        (8, Some([11, 9, 7]))
    );
    let surface = volume
        .surface(AIR_INSIDE, &SourceLimits::default())
        .unwrap();
    // A piece within the ball, too small to be noise along one axis only if it were left out.
    let inner = surface
        .positions
        .iter()
        .filter(|p| p.distance(DVec3::new(6.0, 16.0, 26.0)) < 2.0);
    assert!(inner.count() > 0 || surface.n_dropped == 1);
}

#[test]
fn masks_have_a_level_of_their_own_and_other_volumes_do_not() {
    let mask: Vec<f32> = ball()
        .iter()
        .map(|v| f32::from(u8::from(*v < 0.0)))
        .collect();
    let volume = parse(&nifti(&mask, false)).unwrap();
    let level = Volume::level_of_mask(&volume.summary()).unwrap();
    assert_eq!(
        level,
        Level {
            value: 0.5,
            air: AirSide::Above
        }
    );
    assert!(volume.surface(level, &SourceLimits::default()).is_ok());
    let volume = parse(&nifti(&ball(), false)).unwrap();
    assert_eq!(Volume::level_of_mask(&volume.summary()), None);
}

#[test]
fn specks_of_noise_are_left_out() {
    let mut values = ball();
    values[2 + N[0] * (2 + N[1] * 2)] = -3.0;
    let volume = parse(&nifti(&values, false)).unwrap();
    let surface = volume
        .surface(AIR_INSIDE, &SourceLimits::default())
        .unwrap();
    assert_eq!(surface.n_dropped, 1);
    assert!(
        surface
            .positions
            .iter()
            .all(|p| p.distance(DVec3::new(6.0, 16.0, 26.0)) < 4.5)
    );
}
