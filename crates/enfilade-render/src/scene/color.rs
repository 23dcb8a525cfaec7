//! Colors that distinguish cells.

use enfilade_cpg::CellId;

/// Returns the color of a cell in pictures and drawings; consecutive ids differ most. sRGB, 0 to 1.
#[must_use]
pub fn cell_color(cell: CellId) -> [f32; 3] {
    let hue = (cell.0 as f32 * 0.618_034 + 0.08).fract() * 6.0;
    let (saturation, value) = ([0.55, 0.42][cell.0 as usize / 2 % 2], 0.92);
    [5.0_f32, 3.0, 1.0].map(|n| {
        let k = (n + hue) % 6.0;
        value - value * saturation * k.min(4.0 - k).clamp(0.0, 1.0)
    })
}

pub(super) fn packed(c: [f32; 3]) -> u32 {
    let [r, g, b] = c.map(|x| (x.clamp(0.0, 1.0) * 255.0) as u32);
    r | g << 8 | b << 16 | 0xff << 24
}

/// Returns the color of a cell in the layout that shaders unpack.
pub(crate) fn packed_cell_color(cell: CellId) -> u32 {
    packed(cell_color(cell))
}

pub(super) fn color_of(cells: &[CellId]) -> u32 {
    packed(cells.first().map_or([0.35; 3], |&c| cell_color(c)))
}
