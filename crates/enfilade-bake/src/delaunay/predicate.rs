//! Exact signs of determinants: on which side of a plane, or inside which sphere, a point lies.
//!
//! Three steps, each taken only if the one before is not certain:
//! 1. floating point, with an error bound taken from the largest difference along each axis
//!    (Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric
//!    Predicates", 1997, table 4, with the permanent bounded from above);
//! 2. integers: coordinates are multiples of powers of two, and most differences need at most 40 bits, so that `i128`
//!    (and a sum of 256 bits) is exact. Cospherical vertices of buildings end here, in a tenth of the time that expansions
//!    take;
//! 3. the expansions of the `robust` crate.

use enfilade_geom::DVec3;
use robust::Coord3D;

/// Largest magnitude of a coordinate. A product of five differences must not overflow. [Units: wu]
pub(super) const LARGEST: f64 = 1e50;
/// Least magnitude of a coordinate that is not 0; a product of five differences, down to their last
/// bits, must not underflow. [Units: wu]
pub(super) const LEAST: f64 = 1e-40;

/// 6 products times Shewchuk's (7 + 56ε)ε, rounded up for the bound's own rounding.
const ORIENT_BOUND: f64 = 6.0 * 7.771_561_172_376_1e-16 * 1.001;
/// 4 × 6 products times Shewchuk's (16 + 224ε)ε, rounded up likewise.
const SPHERE_BOUND: f64 = 24.0 * 1.776_356_839_400_254e-15 * 1.001;

/// The predicates for one set of points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Predicates {
    /// Bound on differences below which the sphere's determinant is exact in `f64`: every coordinate is a multiple of
    /// one power of two, with few enough bits.
    small_sphere: f64,
    /// The same for the plane's determinant.
    small_orient: f64,
}

impl Predicates {
    pub(super) fn of(points: &[DVec3]) -> Self {
        let unit = points
            .iter()
            .flat_map(DVec3::to_array)
            .filter(|&x| x != 0.0)
            .map(last_bit)
            .min();
        // Only zeros: all differences are zero.
        let unit = power_of_two(unit.unwrap_or(0));
        Self {
            // 72 · 2^(5·9) < 2^53.
            small_sphere: unit * f64::from(1 << 9),
            // 6 · 2^(3·16) < 2^53.
            small_orient: unit * f64::from(1 << 16),
        }
    }

    /// Returns 1 if `a`, `b`, `c` run counter-clockwise seen from the side away from `d`, -1 if clockwise, 0 if
    /// coplanar.
    pub(super) fn orient(&self, a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> i32 {
        let (u, v, w) = (a - d, b - d, c - d);
        let det = u.dot(v.cross(w));
        let m = u.abs().max(v.abs()).max(w.abs());
        let bound = ORIENT_BOUND * m.x * m.y * m.z;
        if det > bound {
            return 1;
        }
        if det < -bound {
            return -1;
        }
        if m.max_element() < self.small_orient {
            return sign(det);
        }
        exact_orient(a, b, c, d)
    }

    /// Returns 1 if `e` is inside the sphere through `a`, `b`, `c`, `d`, which are oriented positively; 0 on it, -1
    /// outside.
    pub(super) fn in_sphere(&self, a: DVec3, b: DVec3, c: DVec3, d: DVec3, e: DVec3) -> i32 {
        let (p, q, r, s) = (a - e, b - e, c - e, d - e);
        let minor = |u: DVec3, v: DVec3| u.x * v.y - v.x * u.y;
        let (ab, bc, cd) = (minor(p, q), minor(q, r), minor(r, s));
        let (da, ac, bd) = (minor(s, p), minor(p, r), minor(q, s));
        let abc = p.z * bc - q.z * ac + r.z * ab;
        let bcd = q.z * cd - r.z * bd + s.z * bc;
        let cda = r.z * da + s.z * ac + p.z * cd;
        let dab = s.z * ab + p.z * bd + q.z * da;
        let det = (s.length_squared() * abc - r.length_squared() * dab)
            + (q.length_squared() * cda - p.length_squared() * bcd);
        let m = p.abs().max(q.abs()).max(r.abs()).max(s.abs());
        let bound = SPHERE_BOUND * m.x * m.y * m.z * m.length_squared();
        if det > bound {
            return 1;
        }
        if det < -bound {
            return -1;
        }
        if m.max_element() < self.small_sphere {
            return sign(det);
        }
        exact_in_sphere(a, b, c, d, e)
    }
}

fn sign(x: f64) -> i32 {
    i32::from(x > 0.0) - i32::from(x < 0.0)
}

/// Returns the exponent of the lowest bit set in a finite number other than 0.
fn last_bit(x: f64) -> i32 {
    let bits = x.to_bits();
    let exponent = ((bits >> 52) & 0x7ff) as i32;
    let mantissa = (bits & ((1 << 52) - 1)) | (1 << 52);
    exponent - 1075 + mantissa.trailing_zeros() as i32
}

/// Returns 2 to the `e`, for exponents of normal numbers.
fn power_of_two(e: i32) -> f64 {
    f64::from_bits(((e + 1023) as u64) << 52)
}

/// Returns differences to `origin` as integer multiples of one power of two, of at most `bits` bits; `None` if they are
/// not.
fn whole<const N: usize>(points: [DVec3; N], origin: DVec3, bits: i32) -> Option<[[i64; 3]; N]> {
    let mut differences = [[0.0; 3]; N];
    let (mut low, mut largest) = (i32::MAX, 0.0_f64);
    for (out, p) in differences.iter_mut().zip(points) {
        for (k, slot) in out.iter_mut().enumerate() {
            let (a, b) = (p[k], origin[k]);
            let d = a - b;
            // Knuth's two-sum: the part lost by rounding.
            let b_virtual = a - d;
            let tail = (a - (d + b_virtual)) + (b_virtual - b);
            if tail != 0.0 {
                return None;
            }
            if d != 0.0 {
                low = low.min(last_bit(d));
                largest = largest.max(d.abs());
            }
            *slot = d;
        }
    }
    if largest == 0.0 {
        return Some([[0; 3]; N]);
    }
    let high = ((largest.to_bits() >> 52) & 0x7ff) as i32 - 1023;
    if high - low >= bits {
        return None;
    }
    let scale = power_of_two(-low);
    Some(differences.map(|d| d.map(|x| (x * scale) as i64)))
}

fn coord(p: DVec3) -> Coord3D<f64> {
    Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    }
}

fn det3(u: [i64; 3], v: [i64; 3], w: [i64; 3]) -> i128 {
    let m = |a: i64, b: i64| i128::from(a) * i128::from(b);
    i128::from(u[0]) * (m(v[1], w[2]) - m(v[2], w[1]))
        + i128::from(u[1]) * (m(v[2], w[0]) - m(v[0], w[2]))
        + i128::from(u[2]) * (m(v[0], w[1]) - m(v[1], w[0]))
}

#[cold]
fn exact_orient(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> i32 {
    // 6 · 2^(3·40) < 2^127.
    if let Some([u, v, w]) = whole([a, b, c], d, 40) {
        return det3(u, v, w).signum() as i32;
    }
    sign(robust::orient3d(coord(a), coord(b), coord(c), coord(d)))
}

#[cold]
fn exact_in_sphere(a: DVec3, b: DVec3, c: DVec3, d: DVec3, e: DVec3) -> i32 {
    let Some([p, q, r, s]) = whole([a, b, c, d], e, 40) else {
        return sign(robust::insphere(
            coord(a),
            coord(b),
            coord(c),
            coord(d),
            coord(e),
        ));
    };
    let lift = |u: [i64; 3]| -> i128 { u.iter().map(|&x| i128::from(x) * i128::from(x)).sum() };
    // det = Σ ± lift · minor; minors have up to 123 bits and lifts 82, so limbs of 64 bits.
    let terms = [
        (lift(s), det3(p, q, r)),
        (lift(r), -det3(p, q, s)),
        (lift(q), det3(p, r, s)),
        (lift(p), -det3(q, r, s)),
    ];
    const LOW: i128 = (1 << 64) - 1;
    let mut limbs = [0_i128; 3];
    for (lift, minor) in terms {
        let (lift_high, lift_low) = (lift >> 64, lift & LOW);
        let (minor_high, minor_low) = (minor >> 64, minor & LOW);
        let low = lift_low as u128 * minor_low as u128;
        limbs[0] += (low & LOW as u128) as i128;
        limbs[1] += (low >> 64) as i128 + minor_high * lift_low + minor_low * lift_high;
        limbs[2] += minor_high * lift_high;
    }
    limbs[1] += limbs[0] >> 64;
    limbs[2] += limbs[1] >> 64;
    if limbs[2] != 0 {
        return limbs[2].signum() as i32;
    }
    i32::from((limbs[0] | limbs[1]) & LOW != 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn by_expansions(p: [DVec3; 5]) -> (i32, i32) {
        let [a, b, c, d, e] = p.map(coord);
        (
            sign(robust::orient3d(a, b, c, d)),
            sign(robust::insphere(a, b, c, d, e)),
        )
    }

    fn lattice(steps: i32, unit: f64) -> impl Strategy<Value = [DVec3; 5]> {
        let x = move || (-steps..=steps).prop_map(move |i| f64::from(i) * unit);
        let point = move || (x(), x(), x()).prop_map(|(x, y, z)| DVec3::new(x, y, z));
        [point(), point(), point(), point(), point()]
    }

    fn agrees(p: [DVec3; 5]) {
        let [a, b, c, d, e] = p;
        let (orient, sphere) = by_expansions(p);
        let predicates = Predicates::of(&p);
        assert_eq!(predicates.orient(a, b, c, d), orient);
        assert_eq!(exact_orient(a, b, c, d), orient);
        assert_eq!(predicates.in_sphere(a, b, c, d, e), sphere);
        assert_eq!(exact_in_sphere(a, b, c, d, e), sphere);
    }

    proptest! {
        #[test]
        fn small_lattices_agree_with_expansions(p in lattice(3, 0.25)) {
            agrees(p);
        }

        #[test]
        fn wide_lattices_agree_with_expansions(p in lattice(1 << 30, 1e-3)) {
            agrees(p);
        }

        #[test]
        fn lattices_of_no_binary_fraction_agree_with_expansions(p in lattice(4, 0.1)) {
            agrees(p);
        }

        #[test]
        fn cospherical_points_of_many_bits_agree_with_expansions(
            signs in prop::collection::vec(prop::sample::subsequence(vec![0, 1, 2], 0..=3), 5),
            corner in [1_i64 << 20..1 << 38, 1_i64 << 20..1 << 38, 1_i64 << 20..1 << 38],
            nudge in prop::option::of(0_usize..5),
        ) {
            let mut p: Vec<DVec3> = signs.iter().map(|s| {
                DVec3::from_array([0, 1, 2].map(|k| {
                    let x = corner[k] as f64;
                    if s.contains(&k) { -x } else { x }
                }))
            }).collect();
            if let Some(i) = nudge {
                p[i].x += 1.0;
            }
            agrees([p[0], p[1], p[2], p[3], p[4]]);
        }
    }
}
