//! Allowances: every source ends with the one that its limits carry, wherever its work is. Covers S3.

use std::f64::consts::TAU;
use std::io::Write as _;
use std::sync::Arc;

use enfilade_geom::{Allowance, DMat4, DVec3};
use enfilade_source::{
    AirSide, FreeformScene, HeightMap, HeightOptions, ImplicitScene, Level, Scan, ScanOptions,
    SourceError, SourceLimits, Volume, tessellate,
};

fn limits(work: u64) -> SourceLimits {
    SourceLimits {
        allowance: Some(Arc::new(Allowance::new(work, None))),
        ..SourceLimits::default()
    }
}

/// Checks that a source ends early with all allowances that are too small, and costs at least `least` units of work.
fn ends(name: &str, least: u64, run: impl Fn(&SourceLimits) -> Result<(), SourceError>) {
    let all = limits(u64::MAX);
    run(&all).unwrap_or_else(|e| panic!("{name}: {e}"));
    let spent = all.allowance.unwrap().spent();
    assert!(spent >= least, "{name}: {spent}");
    for share in [0, 1, 10, 30, 50, 70, 90, 98] {
        let few = limits(spent / 100 * share);
        let error = run(&few).unwrap_err();
        assert!(
            error.problem.contains("allowance"),
            "{name} {share}: {error}"
        );
        // Little more than allowed, though threads may be on their way.
        let spent_of_few = few.allowance.unwrap().spent();
        assert!(spent_of_few <= spent, "{name} {share}: {spent_of_few}");
    }
    run(&limits(spent)).unwrap_or_else(|e| panic!("{name}: {e}"));
}

#[test]
fn extractions_end_with_their_allowance() {
    let text = br#"{"enfilade":"implicit","step":0.1,"air":{"ball":{"at":[0,2,0],"radius":3}}}"#;
    let scene = ImplicitScene::parse(text, &SourceLimits::default()).unwrap();
    // About 17,000 cells, each with its vertex, its distance and its collapse.
    ends("implicit", 200_000, |limits| {
        scene.surface(limits).map(drop)
    });
    let n = 40;
    let value = |i: usize| {
        let at = [i % n, i / n % n, i / (n * n)].map(|c| c as f32 - 19.5);
        13.0 - at.iter().map(|c| c * c).sum::<f32>().sqrt()
    };
    let volume = Volume {
        size: [n; 3],
        values: (0..n * n * n).map(value).collect(),
        placement: DMat4::IDENTITY,
        unit: None,
        is_z_up: false,
    };
    let level = Level {
        value: 0.0,
        air: AirSide::Above,
    };
    ends("volume", 50_000, |limits| {
        volume.surface(level, limits).map(drop)
    });
}

#[test]
fn scans_end_with_their_allowance() {
    let n = 20_000;
    let point = |i: usize| {
        let y = 1.0 - 2.0 * (i as f64 + 0.5) / n as f64;
        let (turn, r) = (i as f64 * 2.399_963, (1.0 - y * y).sqrt());
        let d = DVec3::new(r * turn.cos(), y, r * turn.sin());
        // Glass on one side.
        let t = (DVec3::new(2.0, 1.25, 1.5) / d.abs()).min_element();
        (d.x < 0.98).then_some(d * t)
    };
    let points: Vec<DVec3> = (0..n).filter_map(point).collect();
    let scan = Scan {
        station_of: vec![0; points.len()],
        points,
        stations: vec![DVec3::ZERO],
    };
    let options = ScanOptions {
        step: 0.1,
        reach: 12.0,
        least_piece: 0.3,
    };
    ends("scan", 300_000, |limits| {
        scan.surface(&options, limits).map(drop)
    });
}

#[test]
fn patches_and_heights_end_with_their_allowance() {
    let star: Vec<String> = (0..=200)
        .map(|k| {
            let (turn, r) = (TAU * f64::from(k % 200) / 200.0, [0.4, 0.1][k as usize % 2]);
            format!("[{},{}]", 0.5 + r * turn.cos(), 0.5 + r * turn.sin())
        })
        .collect();
    let text = format!(
        r#"{{"enfilade":"patches","patches":[{{"degrees":[2,1],"points":[[[0,0,0],[2,3,0],[4,0,0]],[[0,0,6],[2,3,6],[4,0,6]]],
            "holes":[[{{"points":[{}]}}]]}}]}}"#,
        star.join(",")
    );
    let scene = FreeformScene::parse(text.as_bytes(), &SourceLimits::default()).unwrap();
    let surfaces: Vec<_> = scene.patches.into_iter().map(|p| p.surface).collect();
    let made = |limits: &SourceLimits| match tessellate(&surfaces, 1e-3, limits) {
        // Budgets of work and triangles share their words with an allowance that is over.
        Err(e) if limits.allowance.as_ref().is_some_and(|a| a.is_over()) => {
            Err(SourceError::new(e.place, "the allowance is over"))
        }
        made => made.map(drop),
    };
    ends("patches", 20_000, made);
    let dims = [200, 150];
    let samples = (0..dims[0] * dims[1])
        .map(|i| ((i * i) % 97) as f32)
        .collect();
    let map = HeightMap {
        dims,
        samples,
        white: None,
        cell: Some([1.0; 2]),
        place: None,
    };
    // Two triangles for each sample, and their errors.
    ends("heights", 60_000, |limits| {
        map.surface(&HeightOptions::default(), limits).map(drop)
    });
}

/// Few samples, and a hundred million bytes after them.
#[test]
fn of_compressed_samples_no_more_is_unpacked_than_the_head_tells() {
    let zip = |head: &[u8], body: &[&[u8]]| {
        let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        body.iter().for_each(|b| out.write_all(b).unwrap());
        [head, &out.finish().unwrap()].concat()
    };
    let zeros = vec![0; 100_000_000];
    let mut nifti = vec![0_u8; 352];
    nifti[..4].copy_from_slice(&348_i32.to_le_bytes());
    for (k, n) in [3_i16, 2, 2, 2].into_iter().enumerate() {
        nifti[40 + 2 * k..][..2].copy_from_slice(&n.to_le_bytes());
    }
    nifti[70] = 2;
    nifti[108..112].copy_from_slice(&352_f32.to_le_bytes());
    for k in 0..3 {
        nifti[80 + 4 * k..][..4].copy_from_slice(&1_f32.to_le_bytes());
    }
    nifti[344..348].copy_from_slice(b"n+1\0");
    let nrrd = b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: gzip\n\n";
    for file in [zip(&[], &[&nifti, &zeros]), zip(nrrd, &[&zeros])] {
        // Enough for a megabyte, not for a hundred.
        let few = limits(200_000);
        let mut none = |_: &str| Err(String::new());
        let volume = Volume::parse(&file, &mut none, &few).unwrap();
        assert_eq!(volume.values, [0.0; 8]);
    }
}
