//! Colors that tell cells apart, the same in every drawing, picture and window.

use crate::CellId;

/// A lightness and a chroma, for two purposes. [Units: OKLab, 0 to 1]
struct Tone {
    lightness: [f64; 3],
    chroma: f64,
}

/// On paper: clear beside each other, and quiet under names and furniture.
const PAPER: Tone = Tone {
    // Consecutive cells differ, so that hues that recur do, too.
    lightness: [0.87, 0.81, 0.92],
    chroma: 0.065,
};
/// On surfaces in the light, which washes colors out.
const PAINT: Tone = Tone {
    lightness: [0.80, 0.75, 0.85],
    chroma: 0.12,
};

/// Returns the light color of a cell in drawings, as sRGB bytes; consecutive ids are far apart in hue, and equal ids are
/// equal everywhere.
///
/// Hues advance by the golden angle, which spreads any run of ids evenly, in OKLCH (Ottosson, "A perceptual color space
/// for image processing", 2020), where equal steps look equal.
#[must_use]
pub fn cell_color(cell: CellId) -> [u8; 3] {
    toned(cell, &PAPER)
}

/// Returns the color of a cell painted on surfaces in the light, as sRGB bytes: the hue of [`cell_color`], deeper.
#[must_use]
pub fn cell_paint(cell: CellId) -> [u8; 3] {
    toned(cell, &PAINT)
}

fn toned(cell: CellId, tone: &Tone) -> [u8; 3] {
    let hue = (f64::from(cell.0) * 137.507_764 + 70.0).to_radians();
    let (a, b) = (tone.chroma * hue.cos(), tone.chroma * hue.sin());
    let lightness = tone.lightness[cell.idx() % tone.lightness.len()];
    let cone = |a_share: f64, b_share: f64| (lightness + a_share * a + b_share * b).powi(3);
    let (l, m, s) = (
        cone(0.396_337_777_4, 0.215_803_757_3),
        cone(-0.105_561_345_8, -0.063_854_172_8),
        cone(-0.089_484_177_5, -1.291_485_548),
    );
    [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701 * s,
    ]
    .map(|linear| {
        let linear = linear.clamp(0.0, 1.0);
        let shown = if linear <= 0.003_130_8 {
            12.92 * linear
        } else {
            1.055 * linear.powf(1.0 / 2.4) - 0.055
        };
        (shown * 255.0).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbors_in_number_look_different_and_none_is_dark() {
        let distance = |a: [u8; 3], b: [u8; 3]| {
            (0..3)
                .map(|k| (i32::from(a[k]) - i32::from(b[k])).pow(2))
                .sum::<i32>()
        };
        for id in 0..60 {
            let color = cell_color(CellId(id));
            assert!(color.iter().all(|&c| c > 120), "{id}: {color:?}");
            for ahead in 1..5 {
                let other = cell_color(CellId(id + ahead));
                assert!(
                    distance(color, other) > 400,
                    "{id} and {ahead} on: {color:?}, {other:?}"
                );
            }
        }
    }
}
