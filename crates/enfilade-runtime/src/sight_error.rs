//! What a world can have that no question could be answered with.

/// Why a world cannot be asked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SightError {
    /// A portal joins a cell to itself or to one that does not exist.
    #[error("portal {portal} joins cells {cells:?}; they must differ and lie below {n_cells}")]
    PortalCells {
        /// The portal.
        portal: u32,
        /// The cells that it names.
        cells: [u32; 2],
        /// How many cells there are.
        n_cells: usize,
    },
    /// A portal's outline is not finite, or has no area.
    #[error("portal {portal}: its outline of {n_corners} corners is no polygon with an area")]
    PortalOutline {
        /// The portal.
        portal: u32,
        /// Corners of its outline.
        n_corners: usize,
    },
    /// A batch or detail names a cell, mesh or corner that does not exist, or a corner that is not
    /// finite.
    #[error("{what} {index} names a cell, mesh or corner that does not exist or is not finite")]
    Geometry {
        /// `batch`, `detail`, or `portal` for what fills it.
        what: &'static str,
        /// Which one.
        index: u32,
    },
}
