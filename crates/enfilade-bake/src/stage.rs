//! The steps of a bake.

/// A step of a bake; which there are, [`Method::stages`](crate::Method::stages) says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Stage {
    /// Structural triangles, told from stairs; a bounding volume hierarchy of them.
    Structure,
    /// Watershed: triangles to voxels.
    Voxelize,
    /// Watershed: distance of each voxel of air from the next surface.
    Distance,
    /// Watershed: the flood, which ends with basins.
    Flood,
    /// Watershed: basins merged into rooms.
    Rooms,
    /// Partition: leaves and the portals between them.
    Tree,
    /// Partition: separators, and the cells that they part.
    Separators,
    /// Delaunay: tetrahedra between the surfaces.
    Tetrahedra,
    /// Delaunay: cells of tetrahedra joined into rooms.
    Decimation,
    /// A plane for each opening.
    Candidates,
    /// Space cut into convex leaves.
    Complex,
    /// Leaves divided among cells, and the portals between these.
    Partition,
    /// Geometry to the cells that see it.
    Geometry,
    /// After a bake or before: the way out of a room that leaks, see [`crate::leak`].
    WayOut,
}

impl Stage {
    /// Its name in tables of times.
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
            Self::Candidates => "fit candidates",
            Self::Complex => "cell complex",
            Self::Partition => "cells and portals",
            Self::Geometry => "hand out geometry",
            Self::WayOut => "way out",
        }
    }
}
