//! Scans: the air that stations saw, walls between rooms, the unknown, noise. Covers S3.

use enfilade_geom::DVec3;
use enfilade_source::{Scan, ScanOptions, SourceLimits, Surface};

const OPTIONS: ScanOptions = ScanOptions {
    step: 0.05,
    reach: 12.0,
    least_piece: 0.3,
};

/// Points on the walls of the box from `min` to `max`, seen from its middle, with noise.
fn room(scan: &mut Scan, min: DVec3, max: DVec3, noise: f64) {
    let station = scan.stations.len() as u16;
    let middle = (min + max) * 0.5;
    scan.stations.push(middle);
    let half = (max - min) * 0.5;
    let mut seed = 7_u64;
    for i in 0..60_000 {
        // A spiral over all directions.
        let y = 1.0 - 2.0 * (f64::from(i) + 0.5) / 60_000.0;
        let turn = f64::from(i) * 2.399_963;
        let r = (1.0 - y * y).sqrt();
        let d = DVec3::new(r * turn.cos(), y, r * turn.sin());
        let t = (half / d.abs()).min_element();
        seed = seed.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(1);
        let off = ((seed >> 40) as f64 / f64::from(1 << 24) - 0.5) * 2.0 * noise;
        scan.points.push(middle + d * (t + off));
        scan.station_of.push(station);
    }
}

/// Returns the volume behind the faces with wanted vertices.
fn volume_of(surface: &Surface, wants: impl Fn(DVec3) -> bool) -> f64 {
    let corners = |t: &[u32; 3]| t.map(|i| surface.positions[i as usize]);
    let wanted = surface
        .triangles
        .iter()
        .map(corners)
        .filter(|t| t.iter().all(|p| wants(*p)));
    wanted.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

fn rooms(noise: f64) -> Scan {
    let mut scan = Scan::default();
    room(
        &mut scan,
        DVec3::new(0.0, 0.0, 0.0),
        DVec3::new(4.0, 2.5, 3.0),
        noise,
    );
    room(
        &mut scan,
        DVec3::new(4.12, 0.0, 0.0),
        DVec3::new(7.0, 2.5, 3.0),
        noise,
    );
    scan
}

#[test]
fn noisy_rooms_become_flat_walls_with_the_wall_between_them() {
    let scan = rooms(0.01);
    let surface = scan.surface(&OPTIONS, &SourceLimits::default()).unwrap();
    // Without the outer sides of the block of matter around the rooms.
    let near = scan.bounds(&OPTIONS).expanded(0.1);
    let air = -volume_of(&surface, |p| near.contains(p));
    let truth = 4.0 * 2.5 * 3.0 + 2.88 * 2.5 * 3.0;
    assert!((air / truth - 1.0).abs() < 0.05, "{air} {truth}");
    // Nothing of the wall is missing: the surface does not cross its middle.
    let is_in_wall =
        |p: &&DVec3| (p.x - 4.06).abs() < 0.02 && p.y > 0.2 && p.y < 2.3 && p.z > 0.2 && p.z < 2.8;
    assert_eq!(surface.positions.iter().find(is_in_wall), None);
    // Noise is averaged: the floor is flat.
    let is_floor = |p: &&DVec3| p.y.abs() < 0.1 && p.x > 0.5 && p.x < 3.5 && p.z > 0.5 && p.z < 2.5;
    let worst = surface
        .positions
        .iter()
        .filter(is_floor)
        .map(|p| p.y.abs())
        .fold(0.0, f64::max);
    assert!(worst < 0.02, "{worst}");
    assert!(
        surface.triangles.len() < 4000,
        "{}",
        surface.triangles.len()
    );
}

/// Leaves out points.
fn without(scan: &mut Scan, is_lost: impl Fn(&DVec3) -> bool) {
    let seen: Vec<usize> = (0..scan.points.len())
        .filter(|&i| !is_lost(&scan.points[i]))
        .collect();
    scan.station_of = seen.iter().map(|&i| scan.station_of[i]).collect();
    scan.points = seen.iter().map(|&i| scan.points[i]).collect();
}

#[test]
fn a_gap_in_a_view_is_closed_by_its_rim() {
    // Nothing was seen through a window, and none of the floor below the scanner.
    let mut scan = rooms(0.0);
    let is_window = |p: &DVec3| p.x < 0.01 && (p.y - 1.2).abs() < 0.5 && (p.z - 1.5).abs() < 0.5;
    let is_below = |p: &DVec3| p.y < 0.01 && (p.x - 2.0).hypot(p.z - 1.5) < 0.7;
    without(&mut scan, |p| is_window(p) || is_below(p));
    let surface = scan.surface(&OPTIONS, &SourceLimits::default()).unwrap();
    // No wedge towards the window, and no cone below the scanner.
    let is_wedge =
        |p: &&DVec3| p.x > 0.2 && p.x < 1.5 && (p.y - 1.2).abs() < 0.3 && (p.z - 1.5).abs() < 0.4;
    assert_eq!(surface.positions.iter().find(is_wedge), None);
    let near = scan.bounds(&OPTIONS).expanded(0.1);
    let air = -volume_of(&surface, |p| near.contains(p));
    let truth = 4.0 * 2.5 * 3.0 + 2.88 * 2.5 * 3.0;
    assert!((air / truth - 1.0).abs() < 0.05, "{air} {truth}");
}

#[test]
fn a_wall_seen_from_both_sides_is_whole() {
    // Thicker than what planes of both sides reach, with a dark patch on both sides, of which no point came back.
    let mut scan = Scan::default();
    room(&mut scan, DVec3::ZERO, DVec3::new(3.0, 2.5, 3.0), 0.005);
    let (min, max) = (DVec3::new(3.26, 0.0, 0.0), DVec3::new(6.0, 2.5, 3.0));
    room(&mut scan, min, max, 0.005);
    let is_dark = |p: &DVec3| {
        let is_on_wall = (p.x - 3.0).abs() < 0.02 || (p.x - 3.26).abs() < 0.02;
        is_on_wall && (p.y - 1.2).abs() < 0.4 && (p.z - 1.4).abs() < 0.4
    };
    without(&mut scan, is_dark);
    let surface = scan.surface(&OPTIONS, &SourceLimits::default()).unwrap();
    let is_inside =
        |p: &&DVec3| (p.x - 3.13).abs() < 0.09 && p.y > 0.2 && p.y < 2.3 && p.z > 0.2 && p.z < 2.8;
    assert_eq!(surface.positions.iter().find(is_inside), None);
}

#[test]
fn the_unknown_is_not_free() {
    // Behind a box in the middle of the room, nothing was seen.
    let mut scan = rooms(0.0);
    let station = scan.stations[0];
    let (min, max) = (DVec3::new(1.0, 0.6, 1.1), DVec3::new(1.3, 1.6, 1.9));
    for (p, s) in scan.points.iter_mut().zip(&scan.station_of) {
        let way = *p - station;
        let share = (max.x - station.x) / way.x;
        let on = station + way * share;
        let is_hit = *s == 0 && share > 0.0 && share < 1.0;
        if is_hit && on.y > min.y && on.y < max.y && on.z > min.z && on.z < max.z {
            *p = on;
        }
    }
    let surface = scan.surface(&OPTIONS, &SourceLimits::default()).unwrap();
    let near = scan.bounds(&OPTIONS).expanded(0.1);
    let air = -volume_of(&surface, |p| near.contains(p));
    // The shadow of 0.8 m² at 0.7 m ends at 2 m, 8 times as large.
    // Its sides are not in the steps of voxels.
    assert!(
        surface.triangles.len() < 1500,
        "{}",
        surface.triangles.len()
    );
    let shadow = 0.8 / (0.7 * 0.7) * (8.0 - 0.7_f64.powi(3)) / 3.0;
    let truth = 4.0 * 2.5 * 3.0 + 2.88 * 2.5 * 3.0 - shadow;
    assert!((air / truth - 1.0).abs() < 0.05, "{air} {truth}");
}

#[test]
fn what_is_missing_is_named() {
    let limits = SourceLimits::default();
    let said = |scan: &Scan| scan.surface(&OPTIONS, &limits).unwrap_err().to_string();
    let mut scan = Scan::default();
    assert!(said(&scan).contains("no station"));
    scan.stations.push(DVec3::ZERO);
    assert!(said(&scan).contains("needs points"));
    scan.points.push(DVec3::new(f64::NAN, 0.0, 0.0));
    scan.station_of.push(0);
    assert!(said(&scan).starts_with("point 0"));
    scan.points[0] = DVec3::X;
    scan.station_of[0] = 3;
    assert!(said(&scan).contains("station that does not exist"));
}

#[test]
fn distant_points_make_the_voxels_no_smaller_than_the_limit_allows() {
    let mut scan = rooms(0.0);
    scan.points.push(DVec3::new(1e7, 1e7, 1e7));
    scan.station_of.push(0);
    let limits = SourceLimits {
        max_voxels: 200_000,
        ..SourceLimits::default()
    };
    assert!(scan.step(&OPTIONS, &limits) > 0.1);
    scan.surface(&OPTIONS, &limits).unwrap();
}

#[test]
fn a_damaged_point_does_not_make_a_small_scan_large() {
    let mut scan = Scan {
        points: (0..200)
            .map(|i| DVec3::new(f64::from(i % 5), f64::from(i % 7), f64::from(i % 3)) * 0.1)
            .collect(),
        station_of: vec![0; 200],
        stations: vec![DVec3::ZERO],
    };
    let limits = SourceLimits::default();
    assert_eq!(scan.step(&OPTIONS, &limits), 0.05);
    scan.points[0] = DVec3::splat(1e30);
    scan.points[1] = DVec3::splat(-1e30);
    let n = (scan.bounds(&OPTIONS).size() / scan.step(&OPTIONS, &limits)).element_product();
    assert!(n <= 200.0 * 10_000.0, "{n}");
    assert_eq!(scan.bounds(&OPTIONS).size(), DVec3::splat(24.0));
}
