//! BSP-only settings.

use enfilade_geom::scene::Scene;
use enfilade_geom::{Aabb, Plane};

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

impl Rooms {
    /// Returns `true` if shape decides on the rooms of a scene.
    pub(crate) fn are_wanted(self, scene: &Scene) -> bool {
        match self {
            Self::Auto => scene.solids.is_empty(),
            Self::Always => true,
            Self::Never => false,
        }
    }
}

/// The rule that chooses the plane to cut a region.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Heuristic {
    /// Few cuts and a balanced tree, judged by a sample of surfaces: fewest cuts in all.
    #[default]
    Default,
    /// The plane that cuts fewest surfaces (Lefebvre & Hornus 2003); quadratic.
    MinCut,
    /// The plane with most surface in it.
    MaxArea,
    /// The plane most orthogonal to the surfaces that it cuts; quadratic.
    MaxOrtho,
}

/// Planes that cut space before any surface's (Lefebvre & Hornus 2003, notes after §3.0.2).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Guide {
    /// Edge of a regular grid. [Units: wu] [Limit: above 0]
    pub grid: Option<f64>,
    /// Distance between planes of a tetrahedral grid, which has four families. [Units: wu] [Limit: above 0]
    pub tetrahedra: Option<f64>,
    /// Single planes.
    pub planes: Vec<Plane>,
    /// Boxes whose sides give planes. [Units: wu]
    pub boxes: Vec<Aabb>,
}
