//! Shared code of OBJ, PLY and STL: numbers in text, coordinates far from the origin, placing.

use crate::ImportError;
use crate::builder::{Builder, Placement};
use enfilade_geom::scene::Mesh;
use enfilade_geom::{DMat4, DVec3};

/// Moves coordinates that are far off near the origin, and returns the offset.
///
/// A mesh holds `f32`. Where coordinates are many times larger than the mesh itself, as in map coordinates, rounding
/// them would destroy its shape. The placement adds the offset again.
pub(crate) fn recenter(positions: &mut [[f64; 3]]) -> DVec3 {
    let finite = positions.iter().filter(|p| p.iter().all(|c| c.is_finite()));
    let (min, max) = finite.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), &p| {
        let p = DVec3::from_array(p);
        (min.min(p), max.max(p))
    });
    let size = (max - min).max_element();
    let reach = min.abs().max(max.abs()).max_element();
    // 16: up to there, at most 4 of the 24 bits are lost, which such files usually lack already.
    if !reach.is_finite() || size <= 0.0 || reach <= 16.0 * size {
        return DVec3::ZERO;
    }
    let offset = ((min + max) * 0.5).round();
    for p in positions {
        *p = (DVec3::from_array(*p) - offset).to_array();
    }
    offset
}

/// Places a mesh that has no node of its own.
pub(crate) fn place(
    builder: &mut Builder<'_>,
    mesh: Mesh,
    names: [&str; 2],
    offset: DVec3,
    place: &str,
) -> Result<(), ImportError> {
    let transform = builder.base
        * if offset == DVec3::ZERO {
            DMat4::IDENTITY
        } else {
            DMat4::from_translation(offset)
        };
    let mesh = builder.push_mesh(mesh);
    builder.place(&Placement {
        mesh,
        names,
        ancestors: &[],
        transforms: &[transform],
        moves: None,
        place,
        source: None,
    })
}

/// Converts a color channel, 0 to 1, from display values to linear ones (IEC 61966-2-1).
pub(crate) fn srgb_to_linear(c: f32) -> f32 {
    if c <= 0.040_45 {
        c / 12.92
    } else {
        ((c + 0.055) / 1.055).powf(2.4)
    }
}

/// Returns the file's name without its ending.
pub(crate) fn stem(builder: &Builder<'_>) -> String {
    builder
        .path
        .file_stem()
        .map(|s| s.to_string_lossy().into_owned())
        .unwrap_or_default()
}

/// Returns meters per input unit.
pub(crate) fn unit(builder: &Builder<'_>) -> f64 {
    builder.options.unit.unwrap_or(1.0)
}

/// Returns a word short enough for a message.
pub(crate) fn shortened(word: &str) -> String {
    if word.chars().count() <= 60 {
        word.to_owned()
    } else {
        word.chars().take(57).chain("...".chars()).collect()
    }
}

/// Returns an index from 0 for one from 1, or from the end if negative.
pub(crate) fn resolve(field: &str, n: usize) -> Option<u32> {
    let index: i64 = field.parse().ok()?;
    let index = match index {
        1.. => index - 1,
        0 => return None,
        _ => index.checked_add(i64::try_from(n).ok()?)?,
    };
    u32::try_from(index).ok().filter(|&i| (i as usize) < n)
}
