//! Why a bake could not be done.

/// Why a bake could not be done.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BakeError {
    /// No structural triangle with an area.
    #[error(
        "no structural triangles: all {n_objects} objects are detail or empty; mark walls and floors \
         as structural"
    )]
    NothingStructural {
        /// Objects in the scene.
        n_objects: usize,
    },
    /// A setting is out of its limits.
    #[error("setting {name} is {value}, must be {limit}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// What it was.
        value: String,
        /// What is allowed.
        limit: &'static str,
    },
    /// The scene cannot be divided finely enough to hold even the largest rooms.
    #[error(
        "the scene is {size:?} meters large, so voxels would be {voxel:.2} m wide and doors could not \
         be found; give the right unit, raise max_voxels or set the voxel size"
    )]
    TooLarge {
        /// Edges of the scene's box. [Units: wu]
        size: [f64; 3],
        /// Voxel size that fits into the budget. [Units: wu]
        voxel: f64,
    },
    /// The scene has no tetrahedra.
    #[error(transparent)]
    Tetrahedra(#[from] crate::delaunay::DelaunayError),
    /// The caller asked to stop.
    #[error("cancelled")]
    Cancelled,
}
