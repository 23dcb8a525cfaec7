//! Filters of decoded attributes: unit vectors, rotations, floats and colors from fewer bits.
//!
//! `EXT_meshopt_compression`, appendix B; colors from `KHR_meshopt_compression`. Division and square root are exact
//! in IEEE 754, so the results are the same everywhere.

/// Applies a filter in place.
pub(super) fn apply(filter: &str, stride: usize, bytes: &mut [u8]) -> Result<(), String> {
    match (filter, stride) {
        ("NONE", _) => {}
        ("OCTAHEDRAL", 4) => each::<4>(bytes, |b| {
            octahedral(b.map(|c| i32::from(c as i8)), 127.0).map(|c| c as u8)
        }),
        ("OCTAHEDRAL", 8) => words(bytes, |w| {
            octahedral(w.map(|c| i32::from(c as i16)), 32767.0).map(|c| c as u16)
        }),
        ("QUATERNION", 8) => words(bytes, |w| quaternion(w.map(|c| c as i16)).map(|c| c as u16)),
        ("EXPONENTIAL", s) if s % 4 == 0 => {
            each::<4>(bytes, |b| exponential(u32::from_le_bytes(b)).to_le_bytes());
        }
        ("COLOR", 4) => each::<4>(bytes, |[y, co, cg, a]| {
            let signed = |c: u8| i32::from(c as i8);
            color([y.into(), signed(co), signed(cg), a.into()], 255.0).map(|c| c as u8)
        }),
        ("COLOR", 8) => words(bytes, |[y, co, cg, a]| {
            let signed = |c: u16| i32::from(c as i16);
            color([y.into(), signed(co), signed(cg), a.into()], 65535.0).map(|c| c as u16)
        }),
        _ => return Err(format!("the filter {filter} on elements of {stride} bytes")),
    }
    Ok(())
}

fn each<const N: usize>(bytes: &mut [u8], f: impl Fn([u8; N]) -> [u8; N]) {
    for element in bytes.as_chunks_mut::<N>().0 {
        *element = f(*element);
    }
}

/// Applies `f` to four 16-bit words at a time.
fn words(bytes: &mut [u8], f: impl Fn([u16; 4]) -> [u16; 4]) {
    each::<8>(bytes, |b| {
        let [x, y, z, w] =
            f([0, 2, 4, 6].map(|k| u16::from_le_bytes([b[k], b[k + 1]]))).map(u16::to_le_bytes);
        [x[0], x[1], y[0], y[1], z[0], z[1], w[0], w[1]]
    });
}

/// Rounds to the nearest integer, halves away from zero; NaN gives 0.
fn rounded(x: f32) -> i32 {
    (x + if x >= 0.0 { 0.5 } else { -0.5 }) as i32
}

/// Returns a unit vector from its point on an octahedron; the third number stands for 1, the fourth is kept.
fn octahedral([x, y, one, w]: [i32; 4], most: f32) -> [i32; 4] {
    let (x, y) = (x as f32, y as f32);
    let z = one as f32 - x.abs() - y.abs();
    let fold = z.min(0.0);
    let folded = |c: f32| c + if c >= 0.0 { fold } else { -fold };
    let (x, y) = (folded(x), folded(y));
    let scale = most / (x * x + y * y + z * z).sqrt();
    [
        rounded(x * scale),
        rounded(y * scale),
        rounded(z * scale),
        w,
    ]
}

/// Returns a rotation from its three smallest components. The lowest two bits of the fourth number are the index of
/// the omitted one; with both bits set, that number stands for `1/sqrt(2)`.
fn quaternion([x, y, z, w]: [i16; 4]) -> [i16; 4] {
    let one = f32::from(w | 3);
    let scale = 32767.0 / 2.0_f32.sqrt() / one;
    let [x, y, z] = [x, y, z].map(f32::from);
    let rest = (one * one * 2.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let mut out = [0; 4];
    let left_out = (w & 3) as usize;
    for (k, c) in [rest, x, y, z].into_iter().enumerate() {
        out[(left_out + k) & 3] = rounded(c * scale) as i16;
    }
    out
}

/// Returns a float from an exponent of 8 bits and a mantissa of 24.
fn exponential(v: u32) -> u32 {
    let mantissa = ((v << 8) as i32 >> 8) as f32;
    let exponent = (v as i32 >> 24) + 127;
    (f32::from_bits((exponent as u32) << 23) * mantissa).to_bits()
}

/// Returns a color from luma and two differences; the highest set bit of alpha gives the number of bits.
fn color([y, co, cg, alpha]: [i32; 4], most: f32) -> [i32; 4] {
    let mut all = alpha;
    for k in [1, 2, 4, 8] {
        all |= all >> k;
    }
    let scale = most / all as f32;
    let alpha = (alpha << 1 & all) | (alpha & 1);
    [y + co - cg, y + cg, y - co - cg, alpha].map(|c| (c as f32 * scale + 0.5) as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Directions spread over the sphere.
    fn directions() -> Vec<[f32; 4]> {
        (0..500)
            .map(|i| {
                let (z, turn) = (1.0 - 2.0 * (i as f32 + 0.5) / 500.0, i as f32 * 2.4);
                let r = (1.0 - z * z).sqrt();
                [r * turn.cos(), r * turn.sin(), z, 0.0]
            })
            .collect()
    }

    fn bytes16(values: &[[i16; 4]]) -> Vec<u8> {
        values
            .iter()
            .flatten()
            .flat_map(|c| c.to_le_bytes())
            .collect()
    }

    fn decoded(filter: &str, mut bytes: Vec<u8>) -> Vec<[f32; 4]> {
        apply(filter, 8, &mut bytes).unwrap();
        let word = |b: &[u8]| f32::from(i16::from_le_bytes([b[0], b[1]])) / 32767.0;
        bytes
            .as_chunks::<8>()
            .0
            .iter()
            .map(|b| [0, 2, 4, 6].map(|k| word(&b[k..])))
            .collect()
    }

    fn assert_near(a: &[f32; 4], b: &[f32; 4], by: f32) {
        assert!(
            a.iter().zip(b).all(|(a, b)| (a - b).abs() <= by),
            "{a:?} {b:?}"
        );
    }

    #[test]
    fn what_the_library_encodes_comes_back() {
        let vectors = directions();
        let packed: Vec<[i16; 4]> = meshopt::encode_filter_oct(&vectors, 16);
        for (a, b) in decoded("OCTAHEDRAL", bytes16(&packed)).iter().zip(&vectors) {
            assert_near(a, b, 2e-4);
        }
        let packed: Vec<[i8; 4]> = meshopt::encode_filter_oct(&vectors, 8);
        let mut bytes: Vec<u8> = packed.iter().flatten().map(|&c| c as u8).collect();
        apply("OCTAHEDRAL", 4, &mut bytes).unwrap();
        for (b, v) in bytes.as_chunks::<4>().0.iter().zip(&vectors) {
            let a = [0, 1, 2].map(|k| f32::from(b[k] as i8) / 127.0);
            assert_near(&[a[0], a[1], a[2], 0.0], v, 0.02);
        }
        let rotations: Vec<[f32; 4]> = vectors
            .iter()
            .map(|v| [v[1] * 0.6, v[2] * 0.6, 0.8, v[0] * 0.6])
            .collect();
        let packed = meshopt::encode_filter_quat(&rotations, 16);
        for (a, b) in decoded("QUATERNION", bytes16(&packed))
            .iter()
            .zip(&rotations)
        {
            let sign = a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>().signum();
            assert_near(&a.map(|c| c * sign), b, 2e-4);
        }
    }

    #[test]
    fn floats_and_colors_are_those_of_the_library() {
        for v in [
            0x0000_0001_u32,
            0xF512_3456,
            0xF5FF_FFFF,
            0x7F7F_FFFF,
            0x8000_0001,
            0x03AB_CDEF,
        ] {
            let mut theirs = [[v]];
            meshopt::decode_filter_exp(&mut theirs);
            assert_eq!(exponential(v), theirs[0][0], "{v:#x}");
        }
        let colors: Vec<[f32; 4]> = directions()
            .iter()
            .map(|v| v.map(|c| c * 0.5 + 0.5))
            .collect();
        let packed: Vec<[u8; 4]> = meshopt::encode_filter_color(&colors, 8);
        let mut bytes = packed.concat();
        apply("COLOR", 4, &mut bytes).unwrap();
        for (b, c) in bytes.as_chunks::<4>().0.iter().zip(&colors) {
            assert_near(&b.map(|c| f32::from(c) / 255.0), c, 0.02);
        }
    }

    #[test]
    fn filters_that_are_unknown_or_do_not_fit_are_refused() {
        for (filter, stride) in [
            ("OCTAHEDRAL", 12),
            ("QUATERNION", 4),
            ("COLOR", 16),
            ("ODD", 4),
        ] {
            assert!(
                apply(filter, stride, &mut [0; 48]).is_err(),
                "{filter} {stride}"
            );
        }
        // Nonsense gives numbers, too.
        let mut bytes = vec![0x80; 48];
        for (filter, stride) in [
            ("OCTAHEDRAL", 8),
            ("QUATERNION", 8),
            ("EXPONENTIAL", 12),
            ("COLOR", 8),
        ] {
            apply(filter, stride, &mut bytes).unwrap();
        }
    }
}
