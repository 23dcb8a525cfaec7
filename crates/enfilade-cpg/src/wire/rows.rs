//! Rows of numbers as stored in a buffer: little-endian, tightly packed.

use super::{WireError, broken};

/// A row of an accessor.
pub(super) trait Row: Sized {
    const KIND: &'static str;
    const SIZE: usize;
    fn of_bytes(bytes: &[u8]) -> Self;
}

macro_rules! float_rows {
    ($($n:literal $kind:literal),*) => {$(
        impl Row for [f32; $n] {
            const KIND: &'static str = $kind;
            const SIZE: usize = 4 * $n;
            fn of_bytes(bytes: &[u8]) -> Self {
                std::array::from_fn(|i| f32::from_le_bytes(four(bytes, 4 * i)))
            }
        }
    )*};
}
float_rows!(2 "VEC2", 3 "VEC3", 4 "VEC4");

/// Returns four bytes from `at` on. Callers pass slices of checked length.
pub(super) fn four(bytes: &[u8], at: usize) -> [u8; 4] {
    std::array::from_fn(|i| bytes[at + i])
}

pub(super) fn eight(bytes: &[u8], at: usize) -> [u8; 8] {
    std::array::from_fn(|i| bytes[at + i])
}

/// Returns all bytes as pairs of `u32`; `None` if they end within one.
pub(super) fn pairs(bytes: &[u8]) -> Option<Vec<[u32; 2]>> {
    let (pairs, rest) = bytes.as_chunks::<8>();
    let pair = |p: &[u8; 8]| [0, 4].map(|at| u32::from_le_bytes(four(p, at)));
    rest.is_empty().then(|| pairs.iter().map(pair).collect())
}

/// Takes a polygon of `n` vertices from the front of `corners`; `owner` names its owner.
pub(super) fn take_polygon(
    corners: &mut &[[u8; 12]],
    n: u32,
    owner: impl Fn() -> String,
) -> Result<Vec<[f32; 3]>, WireError> {
    let (polygon, rest) = corners
        .split_at_checked(n as usize)
        .ok_or_else(|| broken(owner(), "has more vertices than the file holds"))?;
    *corners = rest;
    Ok(polygon.iter().map(|c| <[f32; 3]>::of_bytes(c)).collect())
}
