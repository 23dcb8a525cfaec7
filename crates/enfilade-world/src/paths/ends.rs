//! Ends and limits of enumerations of sequences.

use enfilade_cpg::CellId;
use enfilade_geom::DVec3;

/// An end of sequences, with lengths within its cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct End<'a> {
    pub(crate) cell: CellId,
    pub(crate) at: DVec3,
    /// To the [points of the cell](Ways::points_of). [Units: wu]
    pub(crate) lengths: &'a [f64],
}

/// Limits of an enumeration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limit {
    /// Maximum number of sequences.
    pub(crate) n: usize,
    /// Maximum length as a multiple of the best, and added to it. [Units: 1, wu]
    pub(crate) longest: [f64; 2],
    /// Maximum number of steps.
    pub(crate) steps: usize,
}
