use proptest::prelude::*;

use super::*;
use crate::ray::{hit_triangle, segment_to_triangle_distance};

fn coordinate() -> impl Strategy<Value = f64> {
    // Integers make shared vertices, coplanar triangles and axis-parallel rays common.
    prop_oneof![(-8..8).prop_map(f64::from), -8.0..8.0]
}

fn point() -> impl Strategy<Value = DVec3> {
    [coordinate(), coordinate(), coordinate()].prop_map(DVec3::from_array)
}

fn soup() -> impl Strategy<Value = Vec<Triangle>> {
    proptest::collection::vec([point(), point(), point()], 0..60)
}

/// Exact sign of the volume of `a b c d`, or 0 within the rounding of the tested code: determinants of
/// coordinates up to 16 apart are rounded by about 1e-12; 1e-9 leaves a margin.
fn side(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> i32 {
    let at = |p: DVec3| robust::Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    };
    let volume = robust::orient3d(at(a), at(b), at(c), at(d));
    if volume.abs() < 1e-9 {
        0
    } else {
        volume.signum() as i32
    }
}

/// Returns `true` if the segment meets the triangle, by exact predicates; `None` if too close to decide.
fn oracle(a: DVec3, b: DVec3, t: &Triangle) -> Option<bool> {
    let ends = [side(t[0], t[1], t[2], a), side(t[0], t[1], t[2], b)];
    let edges = [
        side(a, b, t[0], t[1]),
        side(a, b, t[1], t[2]),
        side(a, b, t[2], t[0]),
    ];
    if ends[0] * ends[1] > 0 || (edges.contains(&1) && edges.contains(&-1)) {
        return Some(false);
    }
    if ends.contains(&0) || edges.contains(&0) {
        None
    } else {
        Some(true)
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, ..ProptestConfig::default() })]

    #[test]
    fn hits_are_those_of_exact_predicates(t in [point(), point(), point()], a in point(), b in point()) {
        // A random segment, which misses more often than not, and one through the middle of the triangle.
        let middle = (t[0] + t[1] + t[2]) / 3.0;
        for b in [b, middle * 2.0 - a] {
            let found = hit_triangle(&Ray::segment(a, b), &t);
            if let Some(expected) = oracle(a, b, &t) {
                prop_assert_eq!(found.is_some(), expected);
            }
            if let Some(hit) = found {
                // The front is where the volume of triangle and start is negative (orient3d of `robust`).
                let start = side(t[0], t[1], t[2], a);
                prop_assert!(start == 0 || hit.front == (start < 0));
            }
        }
    }

    #[test]
    fn rays_equal_a_test_of_every_triangle(soup in soup(), a in point(), b in point(), skip in 0..4u32) {
        prop_assume!(a != b);
        let bvh = Bvh::build(&soup);
        for t_max in [1.0, f64::INFINITY] {
            let ray = Ray { origin: a, direction: b - a, t_max };
            let mut all: Vec<RayHit> = soup.iter().enumerate()
                .filter_map(|(i, t)| hit_triangle(&ray, t).map(|h| RayHit { triangle: i as u32, ..h }))
                .collect();
            let mut found = Vec::new();
            bvh.for_each_hit(&ray, |h| found.push(h));
            found.sort_by_key(|h| h.triangle);
            prop_assert_eq!(&found, &all);
            all.retain(|h| h.triangle % 4 != skip);
            let first = all.iter().copied()
                .min_by(|x, y| x.t.total_cmp(&y.t).then(x.triangle.cmp(&y.triangle)));
            prop_assert_eq!(bvh.closest_hit(&ray, |i| i % 4 == skip), first);
            if t_max == 1.0 {
                prop_assert_eq!(bvh.any_hit(a, b, |i| i % 4 == skip), !all.is_empty());
            }
        }
    }

    #[test]
    fn far_origins_and_tiny_directions_lose_no_hit(soup in soup(), target in point(), away in 1.0..1e6f64, scale in 1e-30..1e-3f64) {
        let bvh = Bvh::build(&soup);
        let direction = DVec3::new(0.3, 1.0, -1e-14);
        let ray = Ray { origin: target - direction * away, direction: direction * scale, t_max: f64::INFINITY };
        let expected = soup.iter().filter(|t| hit_triangle(&ray, t).is_some()).count();
        let mut found = 0;
        bvh.for_each_hit(&ray, |_| found += 1);
        prop_assert_eq!(found, expected);
    }

    #[test]
    fn the_nearest_triangle_is_nearest_by_fine_sampling(soup in soup(), p in point(), limit in 0.0..6.0f64) {
        let bvh = Bvh::build(&soup);
        let all: Vec<f64> = soup.iter().map(|t| closest_point_on_triangle(p, t).distance(p)).collect();
        let least = all.iter().copied().fold(f64::INFINITY, f64::min);
        let found = bvh.nearest(p, f64::INFINITY);
        prop_assert_eq!(found.map_or(f64::INFINITY, |n| n.distance), least);
        prop_assert_eq!(bvh.nearest(p, limit).is_some(), least <= limit);
        // No point on any triangle is nearer; the point returned is on its triangle.
        if let Some(found) = found {
            for t in &soup {
                for (i, j) in (0..=8).flat_map(|i| (0..=8 - i).map(move |j| (i, j))) {
                    let q = t[0] + (t[1] - t[0]) * (f64::from(i) / 8.0) + (t[2] - t[0]) * (f64::from(j) / 8.0);
                    prop_assert!(q.distance(p) >= found.distance - 1e-12);
                }
            }
            let on = closest_point_on_triangle(found.point, &soup[found.triangle as usize]);
            prop_assert!(on.distance(found.point) < 1e-7, "slivers lose half the digits");
        }
    }

    #[test]
    fn boxes_find_every_triangle_that_has_a_sample_inside(soup in soup(), a in point(), b in point()) {
        let query = Aabb::new(a.min(b), a.max(b));
        let mut found = Vec::new();
        Bvh::build(&soup).for_each_in_box(&query, |i| found.push(i));
        found.sort_unstable();
        for (i, t) in soup.iter().enumerate() {
            let samples = (0..=12).flat_map(|i| (0..=12 - i).map(move |j| (f64::from(i) / 12.0, f64::from(j) / 12.0)));
            let has_sample = samples.into_iter().any(|(u, v)| query.contains(t[0] + (t[1] - t[0]) * u + (t[2] - t[0]) * v));
            let is_found = found.contains(&(i as u32));
            prop_assert!(is_found || !has_sample);
            // And no triangle is found that misses the box by a clear margin.
            if is_found {
                let mut w = Some(crate::Winding::new(t.to_vec()));
                let grown = query.expanded(1e-6);
                for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                    w = w.filter(|w| w.points.iter().any(|p| (*p - grown.min).dot(axis) >= 0.0));
                    w = w.and_then(|w| w.clipped(&crate::Plane::through(grown.min, axis), 0.0));
                    w = w.and_then(|w| w.clipped(&crate::Plane::through(grown.max, -axis), 0.0));
                }
                prop_assert!(w.is_some());
            }
        }
    }

    #[test]
    fn a_moving_box_finds_every_triangle_that_it_touches_on_its_way(
        soup in soup(), a in point(), b in point(), half in [0.0..2.0f64, 0.0..2.0, 0.0..2.0],
    ) {
        let half = DVec3::from_array(half);
        let bvh = Bvh::build(&soup);
        for end in [a, b] {
            let mut found = Vec::new();
            bvh.for_each_swept(&Ray::segment(a, end), half, |i, _, _| found.push(i));
            for step in 0..=20 {
                let p = a.lerp(end, f64::from(step) / 20.0);
                bvh.for_each_in_box(&Aabb::new(p - half, p + half), |i| assert!(found.contains(&i), "{i}"));
            }
        }
    }

    #[test]
    fn triangles_near_a_segment_are_those_within_the_radius(soup in soup(), a in point(), b in point(), radius in 0.0..2.0f64) {
        let bvh = Bvh::build(&soup);
        let mut found = Vec::new();
        let _ = bvh.for_each_around_segment(a, b, radius, |i, t| {
            let d = segment_to_triangle_distance(a, b, t);
            found.extend((d < radius).then_some((i, d)));
            ControlFlow::Continue(())
        });
        found.sort_by_key(|f| f.0);
        for (i, t) in soup.iter().enumerate() {
            // Upper bound by sampling the segment; the distance to a convex body is convex along
            // a line, so a golden-section search finds its least to about 1e-8.
            let at = |s: f64| { let p = a.lerp(b, s); closest_point_on_triangle(p, t).distance(p) };
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..60 {
                let (m1, m2) = (low + (high - low) * 0.382, low + (high - low) * 0.618);
                if at(m1) <= at(m2) { high = m2 } else { low = m1 }
            }
            let least = at(low).min(at(0.0)).min(at(1.0));
            let hit = found.iter().find(|f| f.0 == i as u32);
            if least < radius - 1e-5 { prop_assert!(hit.is_some(), "{i} at {least}") }
            if let Some((_, d)) = hit { prop_assert!((d - least).abs() < 1e-5, "{d} {least}") }
        }
    }
}

/// A closed bumpy sphere with rotated rows, so that no vertex has a special position.
fn bumpy_sphere(n: usize) -> Vec<Triangle> {
    let at = |i: usize, j: usize| {
        let (theta, phi) = (
            std::f64::consts::PI * i as f64 / n as f64,
            std::f64::consts::TAU * ((j % (2 * n)) as f64 + 0.3) / (2 * n) as f64,
        );
        let r = 3.0 + 0.2 * (5.0 * phi).sin() * (4.0 * theta).sin();
        // Vertices are shared exactly, poles included.
        let ring = if i == 0 || i == n { 0.0 } else { theta.sin() };
        DVec3::new(
            r * ring * phi.cos(),
            3.0 * theta.cos(),
            r * ring * phi.sin(),
        )
    };
    let mut out = Vec::new();
    for i in 0..n {
        for j in 0..2 * n {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            out.extend([[a, b, c], [a, c, d]]);
        }
    }
    out
}

#[test]
fn no_ray_leaves_a_closed_surface_between_its_triangles() {
    let mesh = bumpy_sphere(24);
    let bvh = Bvh::build(&mesh);
    let eye = DVec3::new(0.123, -0.456, 0.0789);
    for t in &mesh {
        for k in 0..=16 {
            // Through vertices and along edges, where rounding decides.
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                let through = a.lerp(b, f64::from(k) / 16.0);
                assert!(bvh.any_hit(eye, eye + (through - eye) * 3.0, |_| false));
            }
        }
    }
}

#[test]
fn hostile_triangles_neither_panic_nor_hide_the_others() {
    let good = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let mut soup = vec![
        [DVec3::NAN; 3],
        [DVec3::INFINITY; 3],
        [DVec3::splat(1e300); 3],
        [DVec3::ONE; 3],
        good,
    ];
    soup.extend(std::iter::repeat_n(
        [DVec3::ONE, DVec3::ONE, DVec3::X],
        1000,
    ));
    // Centers that shrink towards a vertex make the heuristic peel off one triangle per level.
    // Their boxes all contain the origin, so that a query there visits the whole depth.
    soup.extend((0..2000).map(|i| {
        let s = 0.5f64.powi(i / 2) * 1e12;
        [
            DVec3::splat(s),
            DVec3::new(-0.5, 1.0, -0.5) * s,
            DVec3::new(1.0, -0.5, -0.5) * s,
        ]
    }));
    let bvh = Bvh::build(&soup);
    assert_eq!(bvh.len(), soup.len() - 3);
    let (a, b) = (DVec3::new(0.2, 0.2, 1e-290), DVec3::new(0.2, 0.2, -1.0));
    assert_eq!(
        bvh.closest_hit(&Ray::segment(a, b), |_| false)
            .map(|h| h.triangle),
        Some(4)
    );
    assert!(!bvh.any_hit(a, DVec3::NAN, |_| false));
    let tiny = Aabb::new(DVec3::splat(-1e-9), DVec3::splat(1e-9));
    let mut in_box = 0;
    bvh.for_each_in_box(&tiny, |_| in_box += 1);
    let finite = |t: &&Triangle| t.iter().all(|p| p.abs().max_element() < 1e15);
    let expected = soup
        .iter()
        .filter(finite)
        .filter(|t| triangle_touches_box(t, &tiny))
        .count();
    assert_eq!(in_box, expected);
    assert!(bvh.nearest(DVec3::NAN, 1.0).is_none());
    assert!(bvh.nearest(DVec3::splat(1e200), f64::INFINITY).is_some());
    let none = Bvh::build(&[]);
    assert!(
        none.is_empty()
            && none.nearest(a, f64::INFINITY).is_none()
            && !none.any_hit(a, b, |_| false)
    );
}

proptest! {
    #[test]
    fn specks_are_hit_from_far_away(
        specks in proptest::collection::vec((point(), [point(), point(), point()]), 1..80),
        away in 1.0..1e5f64,
        direction in point(),
    ) {
        // Boxes thinner than the rounding of the origin to `f32`.
        let soup: Vec<Triangle> =
            specks.iter().map(|(at, shape)| shape.map(|p| *at + p * 1e-5)).collect();
        let bvh = Bvh::build(&soup);
        prop_assume!(direction.length() > 0.1);
        for t in &soup {
            let target = (t[0] + t[1] + t[2]) / 3.0;
            let ray = Ray { origin: target - direction * away, direction, t_max: f64::INFINITY };
            let expected = soup.iter().filter(|t| hit_triangle(&ray, t).is_some()).count();
            let mut found = 0;
            bvh.for_each_hit(&ray, |_| found += 1);
            prop_assert_eq!(found, expected);
        }
    }
}

#[test]
fn of_equal_triangles_the_first_is_hit_and_nearest() {
    let t = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let far = |i: usize| t.map(|p| p + DVec3::Z * -(1.0 + i as f64));
    let mut soup: Vec<Triangle> = (0..40).map(far).collect();
    soup.extend([t; 50]);
    let bvh = Bvh::build(&soup);
    let p = DVec3::new(0.25, 0.25, 1.0);
    let hit = bvh.closest_hit(&Ray::segment(p, p - DVec3::Z * 9.0), |i| i == 40);
    assert_eq!(hit.map(|h| h.triangle), Some(41));
    assert_eq!(bvh.nearest(p, 2.0).map(|n| n.triangle), Some(40));
}

#[test]
fn each_triangle_of_a_large_tree_is_in_it_once() {
    // Larger than what is built in one go, with many in one place.
    let at = |k: u32| {
        let h = f64::from(k.wrapping_mul(2_654_435_761) >> 16);
        let p = DVec3::new(h % 251.0, h % 67.0, (h / 16_000.0).floor());
        [p, p + DVec3::X, p + DVec3::Y]
    };
    let triangles: Vec<Triangle> = (0..30_000).map(at).collect();
    let bvh = Bvh::build(&triangles);
    let mut found = Vec::new();
    bvh.for_each_in_box(&Aabb::of_points(triangles.as_flattened()), |t| {
        found.push(t);
    });
    found.sort_unstable();
    assert!(found.iter().copied().eq(0..30_000));
    for t in (0..30_000).step_by(997) {
        let [a, b, c] = triangles[t as usize];
        let middle = (a + b + c) / 3.0;
        let mut here = Vec::new();
        bvh.for_each_in_box(&Aabb::of_points(&[middle]), |t| here.push(t));
        assert!(here.contains(&t), "{t} is not at {middle}");
    }
}
