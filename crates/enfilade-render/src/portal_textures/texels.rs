//! Texels of one texture, compressed without loss but for the depths, which get 16 bits.
//!
//! Depths are linear along the rows and columns of a flat surface, so the sum of two neighbors less the third foretells them
//! but for rounding. Colors are foretold by the median of the neighbors and that sum (Weinberger, Seroussi & Sapiro, "LOCO-I",
//! 1996), red and blue as differences from green. The errors are written plane by plane and compressed.

/// The texels of a texture as the adapter has them, row by row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Texels {
    /// 4 bytes each; the last is not used.
    pub(crate) colors: Vec<u8>,
    /// 32-bit floats from 0 to 1, little-endian.
    pub(crate) depths: Vec<u8>,
}

/// Level of compression: higher ones take longer and gain a few percent.
const LEVEL: i32 = 9;

/// Planes of a texture: three of color, and two for the bytes of depth.
const PLANES: usize = 5;

/// Compresses the texels of a texture of `side` × `side`. `None` only if the compressor fails.
pub(crate) fn pack(texels: &Texels, side: usize, is_blue_first: bool) -> Option<Vec<u8>> {
    let n = side * side;
    let (red, blue) = if is_blue_first { (2, 0) } else { (0, 2) };
    let channel = |k: usize| -> Vec<u8> { texels.colors.chunks_exact(4).map(|c| c[k]).collect() };
    let [red, green, blue] = [red, 1, blue].map(|k| color_errors(&channel(k), side));
    let mut planes = Vec::with_capacity(n * PLANES);
    planes.extend_from_slice(&green);
    for own in [red, blue] {
        planes.extend(own.iter().zip(&green).map(|(a, b)| a.wrapping_sub(*b)));
    }
    let depths: Vec<u16> = (texels.depths.chunks_exact(4))
        .map(|d| f32::from_le_bytes([d[0], d[1], d[2], d[3]]))
        .map(|d| (d.clamp(0.0, 1.0) * 65535.0).round() as u16)
        .collect();
    let errors: Vec<u16> = (0..n)
        .map(|i| folded(depths[i].wrapping_sub(plane_guess(&depths, i, side))))
        .collect();
    planes.extend(errors.iter().map(|e| *e as u8));
    planes.extend(errors.iter().map(|e| (e >> 8) as u8));
    zstd::bulk::compress(&planes, LEVEL).ok()
}

/// Returns the texels of a texture of `side` × `side`; `None` if the bytes are not one. Allocates what such a texture takes.
pub(crate) fn unpack(packed: &[u8], side: usize, is_blue_first: bool) -> Option<Texels> {
    let n = side * side;
    let planes = zstd::bulk::decompress(packed, n * PLANES).ok()?;
    if planes.len() != n * PLANES {
        return None;
    }
    let plane = |k: usize| &planes[k * n..(k + 1) * n];
    let green = plane(0);
    let sum = |own: &[u8]| -> Vec<u8> {
        let pairs = own.iter().zip(green);
        pairs.map(|(a, b)| a.wrapping_add(*b)).collect()
    };
    let [red, green, blue] = [sum(plane(1)), green.to_vec(), sum(plane(2))].map(|mut own| {
        for i in 0..n {
            own[i] = own[i].wrapping_add(color_guess(&own, i, side));
        }
        own
    });
    let (first, last) = if is_blue_first {
        (&blue, &red)
    } else {
        (&red, &blue)
    };
    let mut colors = Vec::with_capacity(n * 4);
    for i in 0..n {
        colors.extend([first[i], green[i], last[i], 255]);
    }
    let errors = plane(3).iter().zip(plane(4));
    let mut depths: Vec<u16> = (errors.map(|(low, high)| u16::from_le_bytes([*low, *high])))
        .map(unfolded)
        .collect();
    for i in 0..n {
        depths[i] = depths[i].wrapping_add(plane_guess(&depths, i, side));
    }
    let as_float = |d: &u16| (f32::from(*d) / 65535.0).to_le_bytes();
    Some(Texels {
        colors,
        depths: depths.iter().flat_map(as_float).collect(),
    })
}

fn color_errors(own: &[u8], side: usize) -> Vec<u8> {
    let error = |i: usize| own[i].wrapping_sub(color_guess(own, i, side));
    (0..own.len()).map(error).collect()
}

/// Returns the neighbors of a texel that come before it: left, above, and left above. Outside, the nearest one inside counts.
fn neighbors<T: Copy + Default>(own: &[T], i: usize, side: usize) -> [T; 3] {
    let is_first = i.is_multiple_of(side);
    match (is_first, i < side) {
        (true, true) => [T::default(); 3],
        (false, true) => [own[i - 1]; 3],
        (true, false) => [own[i - side]; 3],
        (false, false) => [own[i - 1], own[i - side], own[i - side - 1]],
    }
}

fn color_guess(own: &[u8], i: usize, side: usize) -> u8 {
    let [a, b, c] = neighbors(own, i, side).map(i16::from);
    (a + b - c).clamp(a.min(b), a.max(b)) as u8
}

fn plane_guess(own: &[u16], i: usize, side: usize) -> u16 {
    let [a, b, c] = neighbors(own, i, side);
    a.wrapping_add(b).wrapping_sub(c)
}

/// Maps 0, -1, 1, -2, … to 0, 1, 2, 3, …
fn folded(error: u16) -> u16 {
    (error << 1) ^ ((error as i16) >> 15) as u16
}

fn unfolded(folded: u16) -> u16 {
    (folded >> 1) ^ (folded & 1).wrapping_neg()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texels(side: usize) -> Texels {
        let at = |i: usize| (i % side, i / side);
        let color = |i: usize| {
            let (x, y) = at(i);
            [(x * 7) as u8, (x * y) as u8, (y * 31 % 13) as u8, 255]
        };
        let depth = |i: usize| {
            let (x, y) = at(i);
            let sky = x + y > side;
            if sky {
                0.0
            } else {
                (x * 3 + y) as f32 / (4 * side) as f32
            }
        };
        Texels {
            colors: (0..side * side).flat_map(color).collect(),
            depths: (0..side * side)
                .flat_map(|i| depth(i).to_le_bytes())
                .collect(),
        }
    }

    #[test]
    fn texels_come_back_with_depths_of_16_bits() {
        for side in [16, 37] {
            let own = texels(side);
            for is_blue_first in [false, true] {
                let packed = pack(&own, side, is_blue_first).unwrap();
                assert!(packed.len() < side * side * 3);
                let back = unpack(&packed, side, is_blue_first).unwrap();
                assert_eq!(back.colors, own.colors);
                let float = |d: &[u8]| f32::from_le_bytes(d.try_into().unwrap());
                for (a, b) in own.depths.chunks(4).zip(back.depths.chunks(4)) {
                    assert!((float(a) - float(b)).abs() <= 0.6 / 65535.0);
                    assert_eq!(float(a) == 0.0, float(b) == 0.0, "sky stays sky");
                }
                // Red and blue change places for adapters that have them the other way round.
                let other = unpack(&packed, side, !is_blue_first).unwrap();
                for (a, b) in own.colors.chunks(4).zip(other.colors.chunks(4)) {
                    assert_eq!([a[2], a[1], a[0]], b[..3]);
                }
            }
        }
    }

    #[test]
    fn bytes_that_are_not_a_texture_are_refused() {
        let packed = pack(&texels(16), 16, false).unwrap();
        assert!(unpack(&packed, 17, false).is_none());
        assert!(unpack(&packed, 15, false).is_none());
        for end in 0..packed.len() {
            assert!(unpack(&packed[..end], 16, false).is_none());
        }
        for i in 0..packed.len() {
            let mut bad = packed.clone();
            bad[i] ^= 0x41;
            // Some decode, to other texels of the right number.
            if let Some(texels) = unpack(&bad, 16, false) {
                assert_eq!(texels.colors.len(), 16 * 16 * 4);
            }
        }
    }
}
