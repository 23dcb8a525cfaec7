//! The result of a rebake, and the reasons for it.

use std::fmt;
use std::time::Duration;

use enfilade_cpg::{CellId, World};
use enfilade_geom::Aabb;

use crate::{BakeError, Stage};

/// A world after a change of its scene.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Rebaked {
    /// The world.
    pub world: World,
    /// The new number of each old cell; `None` for those that are gone.
    pub cell_of: Vec<Option<CellId>>,
    /// Cells that are new or in which something changed, ascending.
    pub changed: Vec<CellId>,
    /// The box that was replaced, in world space; empty if no room could have changed. [Units: wu]
    pub block: Aabb,
    /// The reason why the whole scene was baked; `None` if only a part of it was.
    pub whole: Option<WholeBecause>,
    /// Assumptions and doubtful decisions, one sentence each.
    pub notes: Vec<String>,
    /// Wall time of each stage.
    pub times: Vec<(Stage, Duration)>,
}

/// The reason why a whole scene was baked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum WholeBecause {
    /// Only worlds of the watershed are baked in parts.
    Method,
    /// Bounds on costs apply to the whole world.
    Costs,
    /// People decided about its rooms.
    Decisions,
    /// The scene or the world has special portals.
    Specials,
    /// The outdoors is or was several cells.
    Land,
    /// There is one room, or the scene is made of brushes.
    Kind,
    /// The triangles of the scene fit together better or worse than before.
    Misfit,
    /// The scene has several buildings, or ceilings or floors are missing, or other parts of it are built up than before.
    Site,
    /// Most walls now run along other axes.
    Frame,
    /// The scene is larger or smaller than before.
    Bounds,
    /// Voxels are of another size.
    Grid,
    /// Storeys end elsewhere.
    Storeys,
    /// The part to bake is a fifth of the scene's voxels or more.
    Extent,
    /// The part and the world do not agree at the seam.
    Seam,
}

impl fmt::Display for WholeBecause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Method => "only worlds of the watershed are baked in parts",
            Self::Costs => "bounds on costs apply to the whole world",
            Self::Decisions => "people decided about its rooms, as the whole bake made them",
            Self::Specials => "it has special portals",
            Self::Land => "its outdoors is divided by the lie of all the land",
            Self::Kind => "it has a single room, or is made of brushes",
            Self::Misfit => "its triangles fit together otherwise than before",
            Self::Site => "it has several buildings, or ceilings or floors are missing",
            Self::Frame => "most walls now run along other axes",
            Self::Bounds => "it is larger or smaller than before",
            Self::Grid => "its voxels are of another size than before",
            Self::Storeys => "storeys end elsewhere than before",
            Self::Extent => "the change reaches a fifth of it or more",
            Self::Seam => "the changed part does not fit what is around it",
        })
    }
}

/// The reason why a world could not be rebaked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RebakeError {
    /// The bake failed.
    #[error(transparent)]
    Bake(BakeError),
    /// The old world was baked by other settings.
    #[error(
        "the old world was baked with {name} {was}, and now {name} is {now}: give the settings of its bake, or bake the \
         new scene whole",
        was = if .was.is_empty() { "unknown" } else { was }
    )]
    Setting {
        /// Name of the setting.
        name: String,
        /// Its value in the old world.
        was: String,
        /// Its value now.
        now: String,
    },
    /// The old world has no triangle of the scene.
    #[error(
        "no structural triangle of the new scene is in the old world: it was baked from something else; bake the new \
         scene whole"
    )]
    Stranger,
    /// The old world has no triangles.
    #[error(
        "the old world has no structural triangles to compare the new scene with; bake the new scene whole"
    )]
    NoGeometry,
    /// Cells or portals of the old world are not those of a bake.
    #[error(
        "the old world was {by} after its bake, and that would be lost; rebake the world as it was before, then change it \
         again"
    )]
    Changed {
        /// How it was changed.
        by: &'static str,
    },
}

impl From<BakeError> for RebakeError {
    fn from(error: BakeError) -> Self {
        Self::Bake(error)
    }
}
