//! Cost of the complex: copies of triangles, and bounds by an allowance.

use enfilade_complex::{ComplexInput, Label, LabelSettings, Vote, build_complex_within};
use enfilade_geom::{Aabb, Allowance, DVec3, Triangle};

/// Deterministic numbers in `0..1` (SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f64 / f64::from(1 << 24)
    }
}

/// A quad that is not parallel to any axis.
fn tilted() -> Vec<Triangle> {
    let corner = |x: f32, y: f32, z: f32| DVec3::new(x.into(), y.into(), z.into());
    let [a, b, c, d] = [
        corner(0.0, 0.0, 0.0),
        corner(4.0, 0.3, 0.0),
        corner(4.0, 2.3, 4.0),
        corner(0.0, 2.0, 4.0),
    ];
    vec![[a, b, c], [a, c, d]]
}

#[test]
fn copies_of_a_triangle_cost_next_to_nothing_and_are_seen_like_it() {
    let few = tilted();
    let bounds = Aabb::new(DVec3::splat(-2.0), DVec3::splat(6.0));
    let votes = [Vote {
        point: DVec3::splat(5.5),
        label: Label::Region(1),
        weight: 1.0,
    }];
    let input = ComplexInput {
        triangles: &few,
        candidates: &[],
        missing: &[],
        bounds,
        gap: 0.01,
        has_seals: true,
    };
    let partition = |triangles: &[Triangle]| {
        let allowance = Allowance::new(100_000, None);
        let complex = build_complex_within(&ComplexInput { triangles, ..input }, &allowance);
        assert!(!allowance.is_over(), "{}", allowance.spent());
        complex.partition(&votes, &LabelSettings::default())
    };
    let (one, many) = (partition(&few), partition(&few.repeat(5000)));
    assert_eq!(many.triangle_cells.len(), 10_000);
    for t in 0..10_000 {
        assert_eq!(
            many.triangle_cells.front(t),
            one.triangle_cells.front(t % 2)
        );
        assert_eq!(many.triangle_cells.back(t), one.triangle_cells.back(t % 2));
    }
}

#[test]
fn an_allowance_ends_the_work_soon() {
    let mut random = Random(3);
    let space = Aabb::new(DVec3::ZERO, DVec3::splat(10.0));
    let mut corner = |_| DVec3::from_array([0; 3].map(|_| 10.0 * random.next()));
    let triangles: Vec<Triangle> = (0..120).map(|_| [0; 3].map(&mut corner)).collect();
    let input = ComplexInput {
        triangles: &triangles,
        candidates: &[],
        missing: &[],
        bounds: space,
        gap: 0.01,
        has_seals: true,
    };
    let spent = |most: u64| {
        let allowance = Allowance::new(most, None);
        let _ = build_complex_within(&input, &allowance);
        (allowance.is_over(), allowance.spent())
    };
    let (is_over, all) = spent(u64::MAX);
    assert!(!is_over && all > 500_000, "{all}");
    // The sum is the same for any number of threads, so whether it suffices is too.
    assert_eq!(spent(all), (false, all));
    assert!(spent(all - 1).0);
    for most in [0, 1000, all / 4] {
        let (is_over, spent) = spent(most);
        assert!(is_over && spent < most + all / 10, "{spent} of {most}");
    }
}
