//! Ids of parts and of their cells.

use enfilade_cpg::CellId;

/// Index of a part of a [`Space`](crate::Space).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PartId(pub u32);

impl PartId {
    /// The part at rest that contains all others.
    pub const ROOT: Self = Self(0);

    pub(crate) fn idx(self) -> usize {
        self.0 as usize
    }
}

/// A cell of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Place {
    /// The part.
    pub part: PartId,
    /// The cell, of the part's own graph.
    pub cell: CellId,
}
