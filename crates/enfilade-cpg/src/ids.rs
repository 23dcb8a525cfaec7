//! Ids of cells and portals, and their printed names.

use std::fmt;

/// Index of a cell in `CellPortalGraph::cells`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CellId(pub u32);

/// Index of a portal in `CellPortalGraph::portals`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PortalId(pub u32);

impl CellId {
    /// Returns its index in [`CellPortalGraph::cells`](crate::CellPortalGraph::cells).
    #[inline]
    #[must_use]
    pub fn idx(self) -> usize {
        self.0 as usize
    }
}

impl PortalId {
    /// Returns its index in [`CellPortalGraph::portals`](crate::CellPortalGraph::portals).
    #[inline]
    #[must_use]
    pub fn idx(self) -> usize {
        self.0 as usize
    }
}

/// `cell-3`: the name that builders give the cell, unless it is the outdoors.
impl fmt::Display for CellId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "cell-{}", self.0)
    }
}

/// `portal-3`. Portals have no names of their own.
impl fmt::Display for PortalId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "portal-{}", self.0)
    }
}
