//! Parts of a piece: its attachments, and the space that it takes up.

use enfilade_cpg::{CellId, PortalId, PortalKind};
use enfilade_geom::Aabb;

use crate::body::Body;
use crate::fit::Mouth;

/// An opening of a piece to its outdoors that may be attached to that of another piece.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Attachment {
    /// Name, unique in the piece.
    pub name: String,
    /// The opening, in the piece's world.
    pub portal: PortalId,
    /// The cell inside.
    pub cell: CellId,
    /// Its kind: open, or a door.
    pub kind: PortalKind,
    /// Its frame and outline.
    pub mouth: Mouth,
}

/// The space that a piece takes up, in convex parts.
#[derive(Clone, Debug)]
pub(crate) struct PieceShape {
    /// Leaves of its cells.
    pub(crate) air: Vec<Body>,
    /// Solid leaves, what is outdoors, and boxes around objects there.
    pub(crate) matter: Vec<Body>,
    /// Box around its air.
    pub(crate) air_bounds: Aabb,
    /// Box around its air and solid leaves.
    pub(crate) bounds: Aabb,
    /// Box around all bodies.
    pub(crate) hull: Aabb,
}
