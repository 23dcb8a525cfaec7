//! The order in which points are inserted: rounds of growing size, each along a Hilbert curve.
//!
//! Amenta, Choi & Rote, "Incremental constructions con BRIO" (SoCG 2003): enough randomness between rounds to keep the
//! expected cost low, enough locality within a round to keep the walk short.
//! The curve is Skilling's, "Programming the Hilbert curve" (AIP 707, 2004).

use enfilade_geom::{Aabb, DVec3};

/// Bits of the curve's index per axis.
const BITS: u32 = 19;

/// Returns the indices of `points` in the order of insertion, equal points next to each other.
///
/// Depends on the coordinates only, not on the order of the input.
pub(super) fn insertion_order(points: &[DVec3]) -> Vec<u32> {
    let bounds = Aabb::of_points(points);
    let size = bounds.size().max_element();
    let cells = f64::from((1_u32 << BITS) - 1);
    let scale = if size > 0.0 { cells / size } else { 0.0 };
    // Each round is about an eighth of the next; the last contains seven eighths of all.
    let n_rounds = (points.len() as f64 / 64.0).max(1.0).log(8.0).ceil() as u32;
    let mut keys: Vec<(u64, u32)> = points
        .iter()
        .enumerate()
        .map(|(i, &p)| {
            let earlier = (hash(p).trailing_zeros() / 3).min(n_rounds);
            let at = ((p - bounds.min) * scale).to_array().map(|x| x as u32);
            let round = u64::from(n_rounds - earlier);
            (round << (3 * BITS) | hilbert(at), i as u32)
        })
        .collect();
    let bits = |i: u32| points[i as usize].to_array();
    keys.sort_unstable_by(|a, b| {
        a.0.cmp(&b.0).then_with(|| {
            let (p, q) = (bits(a.1), bits(b.1));
            let order = |k: usize| p[k].total_cmp(&q[k]);
            order(0)
                .then_with(|| order(1))
                .then_with(|| order(2))
                .then(a.1.cmp(&b.1))
        })
    });
    keys.into_iter().map(|k| k.1).collect()
}

/// Returns a hash of a point (the finalizer of splitmix64, for each coordinate).
fn hash(p: DVec3) -> u64 {
    p.to_array().iter().fold(0x9e37_79b9_7f4a_7c15, |h, x| {
        let mut z = h ^ x.to_bits();
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    })
}

/// Returns the index of a lattice cell along the curve.
fn hilbert(mut x: [u32; 3]) -> u64 {
    let mut q = 1 << (BITS - 1);
    while q > 1 {
        let p = q - 1;
        for i in 0..3 {
            if x[i] & q != 0 {
                x[0] ^= p;
            } else {
                let t = (x[0] ^ x[i]) & p;
                x[0] ^= t;
                x[i] ^= t;
            }
        }
        q >>= 1;
    }
    x[1] ^= x[0];
    x[2] ^= x[1];
    let mut t = 0;
    let mut q = 1 << (BITS - 1);
    while q > 1 {
        if x[2] & q != 0 {
            t ^= q - 1;
        }
        q >>= 1;
    }
    let [a, b, c] = x.map(|v| spread(v ^ t));
    a << 2 | b << 1 | c
}

/// Inserts two zeros before each bit.
fn spread(x: u32) -> u64 {
    let mut x = u64::from(x) & 0x1f_ffff;
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_steps_from_neighbor_to_neighbor() {
        // The first 8³ cells of the finest level fill a cube, each one step from the last.
        let mut cells: Vec<([i64; 3], u64)> = (0..512_u32)
            .map(|i| {
                let at = [i % 8, i / 8 % 8, i / 64];
                (at.map(i64::from), hilbert(at))
            })
            .collect();
        cells.sort_by_key(|c| c.1);
        for w in cells.windows(2) {
            let step: i64 = (0..3).map(|k| (w[0].0[k] - w[1].0[k]).abs()).sum();
            assert_eq!(step, 1, "{w:?}");
        }
    }

    #[test]
    fn the_order_of_the_input_has_no_say() {
        let points: Vec<DVec3> = (0..500_u32)
            .map(|i| {
                let f = f64::from(i);
                DVec3::new((f * 0.37).fract(), (f * 0.73).fract(), (f * 0.11).fract())
            })
            .collect();
        let reversed: Vec<DVec3> = points.iter().rev().copied().collect();
        let list = |p: &[DVec3]| -> Vec<DVec3> {
            insertion_order(p)
                .into_iter()
                .map(|i| p[i as usize])
                .collect()
        };
        assert_eq!(list(&points), list(&reversed));
    }
}
