//! The steps of a bake.

/// A step of a bake; [`Method::stages`](crate::Method::stages) lists the steps of each method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Stage {
    /// Structural triangles, separated from stairs, with a bounding volume hierarchy.
    Structure,
    /// Triangles to voxels.
    Voxelize,
    /// Distance of each air voxel to the nearest surface.
    Distance,
    /// Watershed: the flood, which yields basins.
    Flood,
    /// Parts of the air merged into rooms.
    Rooms,
    /// BSP: leaves and the portals between them.
    Tree,
    /// BSP: separators, and the cells between them.
    Separators,
    /// Delaunay: tetrahedra between the surfaces.
    Tetrahedra,
    /// Delaunay: tetrahedral cells joined into rooms.
    Decimation,
    /// Open land divided in plan.
    Land,
    /// A plane for each opening.
    Candidates,
    /// Space cut into convex leaves.
    Complex,
    /// Leaves divided among cells, and the portals between the cells.
    Partition,
    /// Geometry assigned to the cells that see it.
    Geometry,
    /// Before or after a bake: the way out of a room that leaks, see [`crate::leak`].
    WayOut,
}

impl Stage {
    /// Returns the name in tables of times.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Structure => "structure",
            Self::Voxelize => "voxelize",
            Self::Distance => "distance",
            Self::Flood => "flood",
            Self::Rooms => "merge basins",
            Self::Tree => "tree",
            Self::Separators => "separators",
            Self::Tetrahedra => "tetrahedra",
            Self::Decimation => "decimation",
            Self::Land => "divide land",
            Self::Candidates => "fit candidates",
            Self::Complex => "cell complex",
            Self::Partition => "cells and portals",
            Self::Geometry => "hand out geometry",
            Self::WayOut => "way out",
        }
    }
}
