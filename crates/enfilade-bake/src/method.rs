//! The methods that find cells, and the choice among them.

use enfilade_geom::scene::Scene;

use crate::Stage;

/// A method that finds cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Method {
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
            Self::Watershed => "watershed",
            Self::Bsp => "bsp",
            Self::Delaunay => "delaunay",
        }
    }

    /// Returns the stages of a bake with this method, in order. A level of brushes has no stages in voxels by
    /// [`Method::Bsp`].
    #[must_use]
    #[doc(hidden)]
    pub fn stages(self) -> &'static [Stage] {
        use Stage::{
            Candidates, Complex, Decimation, Distance, Flood, Geometry, Partition, Rooms,
            Separators, Structure, Tetrahedra, Tree, Voxelize,
        };
        match self {
            Self::Watershed => &[
                Structure, Voxelize, Distance, Flood, Rooms, Candidates, Complex, Partition,
                Geometry,
            ],
            Self::Bsp => &[
                Structure, Tree, Separators, Voxelize, Distance, Rooms, Candidates, Complex,
                Partition, Geometry,
            ],
            Self::Delaunay => &[
                Structure, Tetrahedra, Decimation, Candidates, Complex, Partition, Geometry,
            ],
        }
    }

    /// Returns the requested method, or else the one that fits the scene, and the reason.
    pub(crate) fn choose(requested: Option<Self>, scene: &Scene) -> (Self, String) {
        match requested {
            Some(method) => (method, "as requested".to_owned()),
            None if scene.solids.is_empty() => (
                Self::Watershed,
                "the structure is triangles, which may have cracks".to_owned(),
            ),
            None if scene.is_open_world => (
                Self::Watershed,
                "the structure is made of brushes in an open world".to_owned(),
            ),
            None => (
                Self::Bsp,
                format!("the structure is made of {} brushes", scene.solids.len()),
            ),
        }
    }
}
