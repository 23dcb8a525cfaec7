//! Tests the tetrahedra against exact arithmetic on integers of any length.

use std::collections::BTreeSet;

use enfilade_geom::DVec3;
use num_bigint::BigInt;
use proptest::prelude::*;

use super::*;

/// Returns a coordinate as an exact multiple of 2^-220; enough for 1e-40 with its last bits.
fn whole(x: f64) -> BigInt {
    let bits = x.to_bits();
    let exponent = ((bits >> 52) & 0x7ff) as i64;
    let mantissa = (bits & ((1 << 52) - 1)) | u64::from(exponent != 0) << 52;
    let shift = exponent.max(1) - 1075 + 220;
    let magnitude = if shift >= 0 {
        BigInt::from(mantissa) << shift
    } else {
        let kept = BigInt::from(mantissa) >> -shift;
        assert_eq!(&kept << -shift, BigInt::from(mantissa), "{x} is too fine");
        kept
    };
    if x < 0.0 { -magnitude } else { magnitude }
}

/// Returns the determinant, by expansion along the first row.
fn det(m: &[Vec<BigInt>]) -> BigInt {
    if m.len() == 1 {
        return m[0][0].clone();
    }
    let mut sum = BigInt::ZERO;
    for c in 0..m.len() {
        let minor: Vec<Vec<BigInt>> = m[1..]
            .iter()
            .map(|row| {
                let mut row = row.clone();
                row.remove(c);
                row
            })
            .collect();
        let term = &m[0][c] * det(&minor);
        sum += if c % 2 == 0 { term } else { -term };
    }
    sum
}

fn row(p: DVec3, origin: DVec3, lifted: bool) -> Vec<BigInt> {
    let mut row: Vec<BigInt> = (0..3).map(|k| whole(p[k]) - whole(origin[k])).collect();
    if lifted {
        row.push(row.iter().map(|x| x * x).sum());
    }
    row
}

/// Returns six times the volume, by definition.
fn volume(c: [DVec3; 4]) -> BigInt {
    det(&[
        row(c[0], c[3], false),
        row(c[1], c[3], false),
        row(c[2], c[3], false),
    ])
}

/// Returns a number above 0 if `e` is inside the sphere of a tetrahedron of positive volume.
fn in_sphere(c: [DVec3; 4], e: DVec3) -> BigInt {
    let rows: Vec<_> = c.iter().map(|&p| row(p, e, true)).collect();
    // The lift comes last, which flips the sign compared with a lift that comes first.
    det(&rows)
}

/// Checks all properties of a Delaunay triangulation of the hull of the points.
fn check(points: &[DVec3], d: &Delaunay) {
    let zero = BigInt::ZERO;
    let distinct: BTreeSet<[u64; 3]> = points
        .iter()
        .map(|p| p.to_array().map(|x| (x + 0.0).to_bits()))
        .collect();
    assert_eq!(d.vertices.len(), distinct.len());
    for (i, &p) in points.iter().enumerate() {
        assert_eq!(d.vertices[d.vertex_of_point[i] as usize], p);
    }
    let mut used = vec![false; d.vertices.len()];
    let mut boundary_volume = BigInt::ZERO;
    let mut total = BigInt::ZERO;
    let origin = d.vertices[0];
    for (t, tet) in d.tetrahedra.iter().enumerate() {
        assert_eq!(t < d.n_finite, !tet.vertices.contains(&INFINITE));
        for i in 0..4 {
            let code = tet.neighbors[i];
            let (o, j) = ((code >> 2) as usize, (code & 3) as usize);
            assert_eq!(d.tetrahedra[o].neighbors[j], (t * 4 + i) as u32);
            let mut mine = tet.facet(i);
            let mut other = d.tetrahedra[o].facet(j);
            mine.sort_unstable();
            other.sort_unstable();
            assert_eq!(mine, other);
        }
        if t >= d.n_finite {
            let slot = tet.vertices.iter().position(|&v| v == INFINITE).unwrap();
            // The hull is convex: across each of its edges the next facet does not rise above.
            let inner = tet.neighbors[slot];
            let facet = d.tetrahedra[(inner >> 2) as usize].facet((inner & 3) as usize);
            let [a, b, c] = facet.map(|v| d.vertices[v as usize]);
            boundary_volume += volume([a, b, c, origin]);
            for i in (0..4).filter(|&i| i != slot) {
                let next = tet.neighbors[i];
                let apex = d.tetrahedra[(next >> 2) as usize].vertices[(next & 3) as usize];
                assert_ne!(apex, INFINITE);
                assert!(volume([a, b, c, d.vertices[apex as usize]]) >= zero);
            }
            continue;
        }
        let corners = d.corners(t as u32);
        let v = volume(corners);
        assert!(v > zero, "flat or turned: {corners:?}");
        total += v;
        for i in 0..4 {
            used[tet.vertices[i] as usize] = true;
            let code = tet.neighbors[i];
            let apex = d.tetrahedra[(code >> 2) as usize].vertices[(code & 3) as usize];
            if apex != INFINITE {
                // Locally Delaunay everywhere is Delaunay (Delaunay 1934).
                assert!(in_sphere(corners, d.vertices[apex as usize]) <= zero);
            }
        }
    }
    assert!(used.iter().all(|&u| u), "a point is not a vertex");
    // The pieces fill the hull exactly.
    assert_eq!(total, boundary_volume);
}

fn is_flat(points: &[DVec3]) -> bool {
    let Some(&a) = points.first() else {
        return true;
    };
    points.iter().all(|&b| {
        points
            .iter()
            .all(|&c| points.iter().all(|&d| volume([a, b, c, d]) == BigInt::ZERO))
    })
}

fn valid_or_flat(points: &[DVec3]) {
    match tetrahedralize(points) {
        Ok(d) => check(points, &d),
        Err(e) => {
            assert_eq!(
                e,
                DelaunayError::Flat {
                    n_points: points.len()
                }
            );
            assert!(is_flat(points));
        }
    }
}

fn points(x: impl Strategy<Value = f64> + Clone, n: usize) -> impl Strategy<Value = Vec<DVec3>> {
    prop::collection::vec(
        (x.clone(), x.clone(), x).prop_map(|(x, y, z)| DVec3::new(x, y, z)),
        0..n,
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    // Covers T1.
    #[test]
    fn random_points_at_any_scale(p in points(-1.0..1.0_f64, 60), scale in -9..7_i32) {
        let p: Vec<DVec3> = p.iter().map(|&p| p * 10_f64.powi(scale)).collect();
        valid_or_flat(&p);
    }

    #[test]
    fn lattices_full_of_cospherical_coplanar_and_equal_points(
        p in points((-2..3_i32).prop_map(f64::from), 60),
        scale in prop::sample::select(vec![1.0, 0.1, 1e-9, 1e6, 1.0 / 3.0]),
    ) {
        let p: Vec<DVec3> = p.iter().map(|&p| p * scale + DVec3::splat(scale * 7.0)).collect();
        valid_or_flat(&p);
    }

    #[test]
    fn few_points_in_few_places(p in points((0..2_i32).prop_map(f64::from), 9)) {
        valid_or_flat(&p);
    }

    #[test]
    fn points_nearly_in_a_plane(p in points(-1.0..1.0_f64, 40), tilt in -1.0..1.0_f64) {
        // Rounding alone lifts them off the plane.
        let p: Vec<DVec3> = p.iter().map(|p| DVec3::new(p.x, p.y, p.x * tilt + p.y / 3.0)).collect();
        if let Ok(d) = tetrahedralize(&p) {
            check(&p, &d);
        }
    }

    #[test]
    fn the_holder_of_a_point_holds_it(p in points(-1.0..1.0_f64, 40), q in points(-1.0..1.0_f64, 10)) {
        if let Ok(d) = tetrahedralize(&p) {
            for &q in &q {
                let t = d.locate(q, 0);
                if (t as usize) < d.n_finite {
                    for i in 0..4 {
                        let mut c = d.corners(t);
                        c[i] = q;
                        assert!(volume(c) >= BigInt::ZERO);
                    }
                }
            }
        }
    }
}

#[test]
fn a_sphere_s_equator_and_a_fan_too_large_for_the_table() {
    // Every point on one sphere with few distinct planes; then the middle, which conflicts with all.
    let mut p: Vec<DVec3> = Vec::new();
    for i in 0..300 {
        let angle = f64::from(i) * 2.399_963;
        let y = 1.0 - (f64::from(i) + 0.5) / 150.0;
        let r = (1.0 - y * y).sqrt();
        p.push(DVec3::new(r * angle.cos(), y, r * angle.sin()));
    }
    p.push(DVec3::ZERO);
    check(&p, &tetrahedralize(&p).unwrap());
}

#[test]
fn a_full_lattice_has_no_flat_tetrahedra() {
    let p: Vec<DVec3> = (0..343)
        .map(|i| DVec3::new(f64::from(i % 7), f64::from(i / 7 % 7), f64::from(i / 49)) * 0.1)
        .collect();
    check(&p, &tetrahedralize(&p).unwrap());
}

#[test]
fn the_order_of_points_has_no_say() {
    let p: Vec<DVec3> = (0..125)
        .map(|i| DVec3::new(f64::from(i % 5), f64::from(i / 5 % 5), f64::from(i / 25)))
        .collect();
    let reversed: Vec<DVec3> = p.iter().rev().copied().collect();
    let (a, b) = (
        tetrahedralize(&p).unwrap(),
        tetrahedralize(&reversed).unwrap(),
    );
    assert_eq!(a.vertices, b.vertices);
    assert_eq!(a.tetrahedra, b.tetrahedra);
}

#[test]
fn what_has_no_volume_or_no_place_is_an_error() {
    let flat = |p: &[DVec3]| {
        assert_eq!(
            tetrahedralize(p).unwrap_err(),
            DelaunayError::Flat { n_points: p.len() }
        );
    };
    flat(&[]);
    flat(&[DVec3::ONE; 7]);
    flat(&[0.0, 1.0, 2.0, 3.0, 3.0].map(|t| DVec3::new(0.1, 0.2, 0.3) * t));
    flat(&[0, 1, 2, 3, 4, 5, 6].map(|i| DVec3::new(f64::from(i * i), f64::from(i % 3), 1.0)));
    for bad in [f64::NAN, f64::INFINITY, 1e51, 1e-41] {
        let mut p = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        p[2].y = bad;
        let e = tetrahedralize(&p).unwrap_err();
        assert!(
            e.to_string().starts_with("point 2 has the coordinate"),
            "{e}"
        );
    }
}
