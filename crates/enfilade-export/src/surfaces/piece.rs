//! A convex piece of the boundary between a cell and what is beside it.

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::{DVec3, Plane, poly};

/// The thing that a boundary surface is made of, as the room sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum SurfaceCover {
    /// A portal: the opening itself, whatever fills it.
    Opening(PortalId),
    /// A part of the model.
    Object {
        /// Index into [`World::sources`](enfilade_cpg::World::sources), if the world tells it.
        source: Option<u32>,
        /// Index into [`World::materials`](enfilade_cpg::World::materials).
        material: Option<u32>,
    },
    /// No triangle of the model: a seal, or matter that is known only by its shape.
    Bare,
}

/// A convex polygon on the boundary of a cell.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    pub(crate) cell: CellId,
    /// The cell directly on the other side; `None` is matter.
    pub(crate) across: Option<CellId>,
    /// Counter-clockwise seen from outside of the cell. [Units: wu]
    pub(crate) points: Vec<DVec3>,
    /// Unit normal that leads out of the cell.
    pub(crate) normal: DVec3,
    pub(crate) cover: SurfaceCover,
    /// Number of its plane among those of the cell.
    pub(crate) plane: u32,
}

impl Piece {
    pub(crate) fn area(&self) -> f64 {
        poly::area(&self.points)
    }

    /// Returns its plane, facing out of the cell.
    pub(crate) fn plane_of(&self) -> Plane {
        Plane::through(mean(&self.points), self.normal)
    }
}

/// Returns the mean of the vertices; the origin if there is none.
pub(crate) fn mean(points: &[DVec3]) -> DVec3 {
    points.iter().sum::<DVec3>() / points.len().max(1) as f64
}
