//! Tests of planes with random lines and points.

use super::*;
use crate::clip::Arena;
use crate::rng::Rng;

/// A convex polygon with 3 to 8 vertices around a point, facing roughly up the z axis, and its normal.
fn polygon(rng: &mut Rng, center: DVec3) -> (Vec<DVec3>, DVec3) {
    let mut unit = || 2.0 * rng.unit() - 1.0;
    let turn = DVec3::new(unit() * 0.5, unit() * 0.5, 1.0).normalize();
    let across = turn.cross(DVec3::X).normalize();
    let along = across.cross(turn);
    let n = 3 + rng.below(6);
    let corner = |k: usize| {
        let angle = k as f64 / n as f64 * std::f64::consts::TAU;
        center + along * angle.cos() * 2.0 + across * angle.sin()
    };
    let mut points: Vec<DVec3> = (0..n).map(corner).collect();
    let normal = (points[1] - points[0]).cross(points[2] - points[0]);
    if normal.dot(turn) < 0.0 {
        points.reverse();
    }
    (points, turn)
}

fn facing(turn: DVec3) -> Facing {
    Facing { turn, normal: turn }
}

fn tolerance() -> Tolerance {
    Tolerance::new(10.0, 1e-7)
}

fn pair(seed: u64) -> [(Vec<DVec3>, DVec3); 2] {
    let mut rng = Rng::new(seed);
    let first = polygon(&mut rng, DVec3::ZERO);
    let side = DVec3::new(6.0 * rng.unit(), 6.0 * rng.unit(), 5.0);
    let second = polygon(&mut rng, side);
    [first, second]
}

fn between(seed: u64) -> Vec<Four> {
    let [(a, a_turn), (b, b_turn)] = pair(seed);
    let mut planes = Vec::new();
    let (a, b) = (
        FacedOutline::new(&a, facing(a_turn)),
        FacedOutline::new(&b, facing(b_turn)),
    );
    separators(a, b, &tolerance(), &mut planes);
    planes
}

/// The lanes that hold a plane.
fn lanes(planes: &[Four]) -> impl Iterator<Item = (&Four, usize)> {
    planes
        .iter()
        .flat_map(|four| (0..LANES).map(move |lane| (four, lane)))
        .filter(|(four, lane)| four.front[*lane] > f64::NEG_INFINITY)
}

#[test]
fn planes_have_the_first_polygon_behind_and_the_second_in_front() {
    let mut n_planes = 0;
    for seed in 0..500 {
        let [(a, _), (b, _)] = pair(seed);
        for (four, lane) in lanes(&between(seed)) {
            let [before, after] =
                [Side::Before, Side::After].map(|side| four.half_space(side, lane));
            // Sums of three products have another order here.
            let least = |h: HalfSpace, points: &[DVec3]| {
                let heights = points.iter().map(|&p| h.normal.dot(p) - h.offset);
                heights.fold(f64::INFINITY, f64::min)
            };
            assert!(least(before, &a) >= -1e-13, "{seed} {lane}");
            assert!(least(after, &b) >= -1e-13, "{seed} {lane}");
            assert!(-before.offset <= after.offset + 1e-12, "{seed} {lane}");
            n_planes += 1;
        }
    }
    // Two polygons in general position have at least two planes through edges of each, mostly one per edge.
    assert!(n_planes > 500 * 4, "{n_planes}");
}

#[test]
fn all_processors_round_alike() {
    for seed in 0..200 {
        let [(a, a_turn), (b, b_turn)] = pair(seed);
        let (a, b) = (
            FacedOutline::new(&a, facing(a_turn)),
            FacedOutline::new(&b, facing(b_turn)),
        );
        let mut plain = Vec::new();
        dispatch!(Level::baseline(), simd => separators_by(simd, a, b, &tolerance(), &mut plain));
        let bits = |planes: &[Four]| -> Vec<u64> {
            let rows = planes
                .iter()
                .flat_map(|f| [f.x, f.y, f.z, f.behind, f.front]);
            rows.flatten().map(f64::to_bits).collect()
        };
        assert_eq!(bits(&plain), bits(&between(seed)), "{seed}");
    }
}

#[test]
fn clips_by_four_planes_are_those_by_one_after_the_other() {
    let mut n_cut = 0;
    for seed in 0..500 {
        let planes = between(seed);
        let mut rng = Rng::new(seed + 1000);
        let center = DVec3::new(8.0 * rng.unit() - 2.0, 8.0 * rng.unit() - 2.0, 8.0);
        let (points, turn) = polygon(&mut rng, center);
        let ball = [center.x, center.y, center.z, 2.0 + 1e-9];
        for side in [Side::Before, Side::After] {
            let mut arena = Arena::default();
            let whole = arena.push(&points, 0);
            let all = arena.clip_all(whole, &planes, side, ball, turn, &tolerance());
            let all = all.map(|poly| arena.get(poly).to_vec());
            let one = lanes(&planes).try_fold(whole, |poly, (four, lane)| {
                arena.clip(poly, four.half_space(side, lane), turn, &tolerance())
            });
            let one = one.map(|poly| arena.get(poly).to_vec());
            n_cut += usize::from(one.as_ref() != Some(&points));
            assert_eq!(all, one, "{seed} {side:?}");
            if hide(&planes, ball) && side == Side::After {
                assert_eq!(all, None, "{seed}");
            }
        }
    }
    assert!(n_cut > 200, "{n_cut}");
}

#[test]
fn packed_planes_hide_the_same() {
    for seed in 0..500 {
        let planes = between(seed);
        let mut packed = planes.clone();
        pack(&mut packed, &tolerance());
        assert!(packed.len() <= planes.len());
        let mut rng = Rng::new(seed + 2000);
        for _ in 0..20 {
            let [x, y, z] = [(); 3].map(|()| 10.0 * rng.unit() - 2.0);
            let ball = [x, y, z, rng.unit()];
            assert_eq!(hide(&planes, ball), hide(&packed, ball), "{seed}");
        }
    }
}
