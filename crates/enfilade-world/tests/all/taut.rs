//! Taut strings, against a second-order cone program.

use crate::cone;

use cone::least_length;
use enfilade_geom::DVec3;
use enfilade_testkit::Rng;
use enfilade_world::TautString;

/// A convex polygon of 3 to 6 vertices about `center`.
fn polygon(rng: &mut Rng, center: DVec3) -> Vec<DVec3> {
    let normal = direction(rng);
    let (u, v) = normal.any_orthonormal_pair();
    let n = 3 + rng.below(4);
    let turn = rng.range(0.0, 6.0);
    let (wide, high) = (rng.range(0.05, 2.0), rng.range(0.05, 2.0));
    let at = |k: usize| {
        let (sin, cos) = (turn + k as f64 * std::f64::consts::TAU / n as f64).sin_cos();
        center + u * cos * wide + v * sin * high
    };
    (0..n).map(at).collect()
}

fn direction(rng: &mut Rng) -> DVec3 {
    DVec3::from([0; 3].map(|_| rng.range(-1.0, 1.0))).normalize_or(DVec3::X)
}

fn point(rng: &mut Rng, reach: f64) -> DVec3 {
    DVec3::from([0; 3].map(|_| rng.range(-reach, reach)))
}

fn check(from: DVec3, to: DVec3, polygons: &[Vec<DVec3>], string: &mut TautString) {
    let length = string.pull(from, to, polygons.len(), |i| {
        std::iter::once(polygons[i].as_slice())
    });
    let least = least_length(from, to, polygons);
    assert!(length >= least * (1.0 - 1e-6), "{length} below {least}");
    assert!(
        length <= least * (1.0 + 2e-6) + 1e-9,
        "{length}, {least}: {polygons:?} {from} {to}"
    );
    assert!(
        string.bound() <= least * (1.0 + 1e-7) + 1e-9,
        "{} above {least}",
        string.bound()
    );
    assert!(
        length - string.bound() <= 1.1e-6 * length,
        "gap {} of {length}",
        length - string.bound()
    );
    for (p, polygon) in string.points()[1..].iter().zip(polygons) {
        let hull = enfilade_geom::Winding::new(polygon.clone());
        assert!(
            hull.contains_in_plane(*p, 1e-9),
            "{p} is not in {polygon:?}"
        );
    }
}

/// W11: lengths and bounds, in chains of polygons at random poses.
#[test]
fn strings_are_as_short_as_cone_programmes_find() {
    let mut rng = Rng::new(5);
    let mut string = TautString::new();
    for round in 0..400 {
        let n = round % 13;
        let spread = rng.range(0.5, 4.0);
        let polygons: Vec<_> = (0..n)
            .map(|i| {
                let center = DVec3::X * i as f64 * spread + point(&mut rng, 2.0);
                polygon(&mut rng, center)
            })
            .collect();
        let (from, to) = (
            point(&mut rng, 3.0),
            DVec3::X * n as f64 * spread + point(&mut rng, 3.0),
        );
        check(from, to, &polygons, &mut string);
    }
}

/// W11: doorways that share jambs or vertices, doorways back and forth, a start in an opening: legs of zero length.
#[test]
fn strings_that_bend_where_openings_meet_are_as_short() {
    let mut rng = Rng::new(8);
    let mut string = TautString::new();
    let fan = |k: usize| {
        let (sin, cos) = (k as f64 * 0.7).sin_cos();
        let out = DVec3::new(cos, 0.0, sin) * 2.0;
        vec![DVec3::ZERO, out, out + DVec3::Y * 2.0, DVec3::Y * 2.0]
    };
    for n in 1..8 {
        for _ in 0..12 {
            let polygons: Vec<_> = (0..n).map(fan).collect();
            let (from, to) = (point(&mut rng, 3.0), point(&mut rng, 3.0));
            check(from, to, &polygons, &mut string);
            let twice: Vec<_> = polygons
                .iter()
                .flat_map(|p| [p.clone(), p.clone()])
                .collect();
            check(from, to, &twice, &mut string);
            check(polygons[0][1] * 0.5, to, &polygons, &mut string);
        }
    }
}

/// W11.
#[test]
fn pulling_allocates_nothing_once_warm() {
    let mut rng = Rng::new(1);
    let polygons: Vec<_> = (0..20)
        .map(|i| polygon(&mut rng, DVec3::X * i as f64))
        .collect();
    let mut string = TautString::new();
    let mut pull = |from: DVec3| {
        string.pull(from, DVec3::X * 20.0, 20, |i| {
            std::iter::once(polygons[i].as_slice())
        })
    };
    pull(DVec3::ZERO);
    let counted = allocation_counter::measure(|| {
        pull(DVec3::Y);
    });
    assert_eq!(counted.count_total, 0);
}

/// W11: an opening of two pieces acts as one.
#[test]
fn a_string_finds_the_piece_it_passes() {
    let whole = [(0.0, 4.0)].map(|(low, high)| doorway(low, high));
    let parts = [(0.0, 1.0), (1.0, 2.5), (2.5, 4.0)].map(|(low, high)| doorway(low, high));
    let mut rng = Rng::new(2);
    let mut string = TautString::new();
    for _ in 0..100 {
        let from = DVec3::new(-1.0, 1.0, 0.0) + point(&mut rng, 0.9) * DVec3::new(1.0, 1.0, 8.0);
        let to = DVec3::new(1.0, 1.0, 0.0) + point(&mut rng, 0.9) * DVec3::new(1.0, 1.0, 8.0);
        let one = string.pull(from, to, 1, |_| whole.iter().map(Vec::as_slice));
        let three = string.pull(from, to, 1, |_| parts.iter().map(Vec::as_slice));
        assert!((one - three).abs() < 1e-6 * one, "{one} {three}");
    }
}

fn doorway(low: f64, high: f64) -> Vec<DVec3> {
    [[0.0, low], [2.0, low], [2.0, high], [0.0, high]]
        .map(|[y, z]| DVec3::new(0.0, y, z))
        .to_vec()
}
