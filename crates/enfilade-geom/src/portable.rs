//! Functions with the same bits on all systems, where the last bit would reach a file: the standard library leaves that bit to
//! the C library, and WebAssembly has another one.

/// Returns the length of a direction, with the bits of `f64::hypot` on Linux: C. Borges 2019, *An Improved Algorithm for
/// hypot(a,b)*, as the GNU C library has it.
#[must_use]
pub fn hypot(x: f64, y: f64) -> f64 {
    let (x, y) = (x.abs(), y.abs());
    let (long, short) = if x >= y { (x, y) } else { (y, x) };
    // Squares of others overflow, or lose bits.
    if !(1e-130..1e150).contains(&short) || long >= 1e150 || short <= long * 2_f64.powi(-53) {
        return x.hypot(y);
    }
    let rough = (long * long + short * short).sqrt();
    let excess = if rough <= 2.0 * short {
        let beyond = rough - short;
        long * (2.0 * beyond - long) + (beyond - 2.0 * (long - short)) * beyond
    } else {
        let beyond = rough - long;
        2.0 * beyond * (long - 2.0 * short) + ((4.0 * beyond - short) * short + beyond * beyond)
    };
    rough - excess / (2.0 * rough)
}

/// Returns the angle of a direction in the first quadrant, as `f64::atan2` does. [Units: rad]
#[cfg(not(all(target_family = "wasm", target_os = "unknown")))]
#[must_use]
pub fn angle(sin: f64, cos: f64) -> f64 {
    sin.atan2(cos)
}

/// Returns the angle of a direction in the first quadrant, as `f64::atan2` does on Linux. [Units: rad]
#[cfg(all(target_family = "wasm", target_os = "unknown"))]
#[must_use]
pub fn angle(sin: f64, cos: f64) -> f64 {
    twice::angle(sin, cos)
}

/// Numbers of twice the precision, as sums of two: what WebAssembly needs to round an angle as the C library of Linux does, but
/// for one in a thousand.
#[cfg(any(test, all(target_family = "wasm", target_os = "unknown")))]
mod twice {
    type Twice = (f64, f64);

    fn sum(a: f64, b: f64) -> Twice {
        let s = a + b;
        let t = s - a;
        (s, (a - (s - t)) + (b - t))
    }

    fn plus(a: Twice, b: Twice) -> Twice {
        let (s, rest) = sum(a.0, b.0);
        sum(s, rest + (a.1 + b.1))
    }

    fn times(a: Twice, b: f64) -> Twice {
        let p = a.0 * b;
        sum(p, a.0.mul_add(b, -p) + a.1 * b)
    }

    fn over(a: Twice, b: f64) -> Twice {
        let q = a.0 / b;
        sum(q, ((-q).mul_add(b, a.0) + a.1) / b)
    }

    /// Returns the angle of a direction in the first quadrant. [Units: rad]
    pub(super) fn angle(sin: f64, cos: f64) -> f64 {
        let rough = sin.atan2(cos);
        // The series of the cosine and the sine of the rough angle.
        let (mut term, mut series) = ((1.0, 0.0), [(1.0, 0.0), (0.0, 0.0)]);
        for k in 1..34_u32 {
            term = over(times(term, rough), f64::from(k));
            let sign = if k % 4 < 2 { 1.0 } else { -1.0 };
            let own = &mut series[k as usize % 2];
            *own = plus(*own, (sign * term.0, sign * term.1));
        }
        let across = plus(times(series[0], sin), times(series[1], -cos)).0;
        rough + across / (sin * sin + cos * cos).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Directions whose lengths have all sizes that occur.
    fn directions() -> impl Iterator<Item = [f64; 2]> {
        let mut state = 0x9e37_79b9_7f4a_7c15_u64;
        let mut next = move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..100_000).map(move |k| [next(), next() * 10_f64.powi(k % 40 - 20)])
    }

    #[test]
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    fn lengths_and_angles_have_the_bits_of_linux() {
        let mut off = 0;
        for [x, y] in directions() {
            assert_eq!(hypot(x, y).to_bits(), x.hypot(y).to_bits(), "{x} {y}");
            off += u32::from(twice::angle(y, x) != angle(y, x));
        }
        assert!(off < 500, "{off}");
        assert_eq!(hypot(0.0, -3.0), 3.0);
        assert!(hypot(f64::MAX, f64::MAX).is_infinite());
    }

    #[test]
    fn angles_are_those_of_their_directions() {
        for degrees in 0..90 {
            let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
            let off = twice::angle(sin, cos) - f64::from(degrees).to_radians();
            assert!(off.abs() < 1e-15, "{degrees}");
        }
    }
}
