//! BSP-only settings.

use super::guide::Guide;
use super::tree::Heuristic;

/// BSP-only settings.
#[derive(Clone, Debug, Default)]
pub struct BspConfig {
    /// The heuristic that chooses planes.
    pub heuristic: Heuristic,
    /// Planes to begin with.
    pub guide: Guide,
    /// Use of the shape of openings to decide which cells are rooms.
    pub rooms: Rooms,
}

/// Choice of the separators to keep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rooms {
    /// [`Rooms::Always`] for a structure of triangles, [`Rooms::Never`] for one of brushes: a level is a chain
    /// of passages as wide as the spaces that they join, and would be one room.
    #[default]
    Auto,
    /// Keeps separators that are narrower than the space beside them.
    Always,
    /// Keeps all separators that cross no other (Lefebvre & Hornus 2003, §2.1 step 2).
    Never,
}
