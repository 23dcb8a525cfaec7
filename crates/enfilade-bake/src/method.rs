//! The methods that find cells, and the choice among them.

use enfilade_geom::Allowance;
use enfilade_geom::scene::Scene;

use crate::structure::{Frame, Stairs, Structure};
use crate::{BakeError, Stage};

/// A method that finds cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// BSP if all structure is made of brushes, else the watershed. Delaunay if the watershed finds at most one cell in
    /// a vessel: a curved surface, closed except at its ends, that may branch.
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
    /// Returns the name in files and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Watershed => "watershed",
            Self::Bsp => "bsp",
            Self::Delaunay => "delaunay",
        }
    }

    /// Returns the stages of a bake with this method, in order; none for [`Method::Auto`], which chooses first.
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

    /// Returns this method, or the one that fits the scene for [`Method::Auto`], and the reason.
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
            asked => (asked, "as requested".to_owned()),
        }
    }

    /// Returns the structure of a scene as this method uses it.
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
            // Voxels follow the walls, however the building is turned.
            Self::Watershed | Self::Auto => Structure::of(scene, Frame::of, stairs, allowance),
            Self::Bsp | Self::Delaunay => Structure::of(scene, |_| Frame::SCENE, stairs, allowance),
        }
    }
}
