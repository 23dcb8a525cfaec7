//! How cells are found, and what chooses.

use enfilade_geom::Allowance;
use enfilade_geom::scene::Scene;

use crate::structure::{Frame, Stairs, Structure};
use crate::{BakeError, Stage};

/// How cells are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// The partition where all structure is made of brushes, the watershed for everything else; tetrahedra where that finds
    /// one cell or none in a vessel: a surface that is curved and closed but for its ends, which may have branches.
    #[default]
    Auto,
    /// Voxels, distances, watershed: [`crate::watershed`].
    Watershed,
    /// Binary space partition and separators, for brushes and clean architectural models: [`crate::bsp`].
    Bsp,
    /// Tetrahedra between the surfaces, decimated, for caves, vessels and other irregular scenes: [`crate::delaunay`].
    Delaunay,
}

impl Method {
    /// Its name in files and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Watershed => "watershed",
            Self::Bsp => "bsp",
            Self::Delaunay => "delaunay",
        }
    }

    /// What a bake by it goes through, in order; nothing before [`Method::Auto`] has chosen.
    #[must_use]
    pub fn stages(self) -> &'static [Stage] {
        use Stage::{
            Candidates, Complex, Decimation, Distance, Flood, Geometry, Partition, Rooms,
            Separators, Structure, Tetrahedra, Tree, Voxelize,
        };
        match self {
            Self::Auto => &[],
            Self::Watershed => &[
                Structure, Voxelize, Distance, Flood, Rooms, Candidates, Complex, Partition,
                Geometry,
            ],
            Self::Bsp => &[Structure, Tree, Separators, Complex, Partition, Geometry],
            Self::Delaunay => &[
                Structure, Tetrahedra, Decimation, Candidates, Complex, Partition, Geometry,
            ],
        }
    }

    /// The method that is asked for or fits a scene, and why.
    pub(crate) fn choose(self, scene: &Scene) -> (Self, String) {
        match self {
            Self::Auto if scene.solids.is_empty() => (
                Self::Watershed,
                "the structure is triangles, which may have cracks".to_owned(),
            ),
            Self::Auto => (
                Self::Bsp,
                format!("the structure is made of {} brushes", scene.solids.len()),
            ),
            asked => (asked, "asked for".to_owned()),
        }
    }

    /// The structure of a scene as this method sees it.
    pub(crate) fn structure_of<'a>(
        self,
        scene: &'a Scene,
        allowance: &'a Allowance,
    ) -> Result<Structure<'a>, BakeError> {
        let stairs = if self == Self::Bsp && !scene.solids.is_empty() {
            Stairs::AreWalls
        } else {
            Stairs::Apart
        };
        match self {
            // Voxels lie along the walls, however the building is turned.
            Self::Watershed | Self::Auto => Structure::of(scene, Frame::of, stairs, allowance),
            Self::Bsp | Self::Delaunay => Structure::of(scene, |_| Frame::SCENE, stairs, allowance),
        }
    }
}
