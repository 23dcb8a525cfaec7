//! What only the binary space partition asks.

use super::guide::Guide;
use super::tree::Heuristic;

/// What only the binary space partition asks.
#[derive(Clone, Debug, Default)]
pub struct BspConfig {
    /// How planes are chosen.
    pub heuristic: Heuristic,
    /// Planes to begin with.
    pub guide: Guide,
    /// Whether cells become rooms by the shape of the openings between them.
    pub rooms: Rooms,
}

/// Which separators are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rooms {
    /// Those of [`Rooms::Always`] where structure is triangles, those of [`Rooms::Never`] where it is
    /// brushes: a level is a chain of passages as wide as what they join, and would be one room.
    #[default]
    Auto,
    /// Those that are narrower than what lies beside them.
    Always,
    /// All that cross no other (Lefebvre & Hornus 2003, §2.1 step 2).
    Never,
}
