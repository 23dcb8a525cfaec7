//! Errors of building a [`Sight`](crate::Sight).

/// Reason why a world cannot be queried.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SightError {
    /// A portal joins a cell to itself or to one that does not exist.
    #[error("portal {portal} joins cells {cells:?}; they must differ and lie below {n_cells}")]
    PortalCells {
        /// The portal.
        portal: u32,
        /// The cells that it joins.
        cells: [u32; 2],
        /// Number of cells.
        n_cells: usize,
    },
    /// A portal's outline is not finite, or has no area.
    #[error("portal {portal}: its outline of {n_corners} vertices has no area or is not finite")]
    PortalOutline {
        /// The portal.
        portal: u32,
        /// Number of its vertices.
        n_corners: usize,
    },
    /// A special portal refers to a cell or portal that it is not at, leads nowhere, or its polygon has no area.
    #[error(
        "special portal {special} refers to a cell or portal that it is not at, leads nowhere, or its polygon has no area"
    )]
    Special {
        /// The special portal.
        special: u32,
    },
    /// A batch or detail refers to a cell, mesh or vertex that does not exist, or to a vertex that is not
    /// finite.
    #[error(
        "{what} {index} refers to a cell, mesh or vertex that does not exist, or to a vertex that is not finite"
    )]
    Geometry {
        /// `batch`, `detail`, or `portal` for its fittings.
        what: &'static str,
        /// Its index.
        index: u32,
    },
    /// A skeleton is not that of the hollow world.
    #[error(
        "the skeleton of sight has {skeleton} {what}, the hollow world {world}; take the skeleton packed with this world"
    )]
    OtherSkeleton {
        /// The kind of thing that differs in number.
        what: &'static str,
        /// Its number in the skeleton.
        skeleton: usize,
        /// Its number in the world.
        world: usize,
    },
    /// Triangles are not those of the batch for which they came.
    #[error(
        "the triangles of batch {batch} are not those that the world was packed with; fetch the piece again, or pack the world again"
    )]
    OtherBatch {
        /// The batch.
        batch: u32,
    },
}
