//! Colors in the layout of shaders.

use enfilade_cpg::{CellId, CellPortalGraph, cell_paint};

/// Color of surfaces that no cell sees.
const GRAY: u8 = 89;
/// Color of what lies outdoors: paint tells rooms apart.
pub(crate) const OUTDOORS: u32 = u32::from_le_bytes([0xa8, 0xac, 0xa6, 0xff]);

pub(super) fn packed([r, g, b]: [u8; 3]) -> u32 {
    u32::from_le_bytes([r, g, b, 0xff])
}

/// Returns the color of a cell in the layout that shaders unpack.
pub(crate) fn packed_cell_color(cell: CellId) -> u32 {
    packed(cell_paint(cell))
}

/// Returns the color of the first room among some cells.
pub(super) fn color_of(graph: &CellPortalGraph, cells: &[CellId]) -> u32 {
    match cells.iter().find(|c| !graph[**c].outdoor) {
        Some(&room) => packed_cell_color(room),
        None if cells.is_empty() => packed([GRAY; 3]),
        None => OUTDOORS,
    }
}
