//! Events of packed worlds: rooms that have come or gone, and pieces that did not come.

use bevy::prelude::*;
use enfilade::CellId;
use enfilade::stream::PieceId;

/// All pieces of a cell are there: it is drawn as from a whole file. For observers and for message readers.
#[derive(EntityEvent, Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellLoaded {
    /// The entity with the [`PortalRoot`](crate::PortalRoot).
    pub entity: Entity,
    /// The cell.
    pub cell: CellId,
}

/// A cell is no longer complete: one of its pieces is gone. For observers and for message readers.
#[derive(EntityEvent, Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellUnloaded {
    /// The entity with the [`PortalRoot`](crate::PortalRoot).
    pub entity: Entity,
    /// The cell.
    pub cell: CellId,
}

/// A piece could not be fetched, or cannot be drawn. All else is drawn. For observers and for message readers.
#[derive(EntityEvent, Message, Clone, Debug, PartialEq, Eq)]
pub struct PieceFailed {
    /// The entity with the [`PortalRoot`](crate::PortalRoot).
    pub entity: Entity,
    /// The piece.
    pub piece: PieceId,
    /// The reason, for people.
    pub reason: String,
    /// True if it is asked for again.
    pub is_retried: bool,
}
