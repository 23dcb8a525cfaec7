//! Errors of a bake.

use std::time::Duration;

use crate::Stage;

/// The reason why a bake failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BakeError {
    /// No structural triangle with an area.
    #[error(
        "no structural triangles: all {n_objects} objects are detail or empty; mark walls and floors \
         as structural"
    )]
    NothingStructural {
        /// Number of objects in the scene.
        n_objects: usize,
    },
    /// A setting is out of its limits.
    #[error("setting {name} is {value}, must be {limit}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: String,
        /// The allowed values.
        limit: &'static str,
    },
    /// Within the budget, voxels would be wider than the narrowest opening that must be found.
    #[error(
        "the scene is {:.0} x {:.0} x {:.0} m: the {max_voxels} voxels that are allowed would be {voxel:.2} m \
         wide, wider than the narrowest opening that must be found ({min_opening} m); if the size is right, \
         set a wider --voxel or --min-opening, or raise --max-memory and max_voxels (voxels of {wanted:.2} m take \
         about {:.0} GB of memory); if it is wrong, set --unit",
        .size[0], .size[1], .size[2], .bytes / 1e9
    )]
    TooLarge {
        /// Edges of the scene's box. [Units: wu]
        size: [f64; 3],
        /// Voxel size that fits into the budget. [Units: wu]
        voxel: f64,
        /// Requested voxel size. [Units: wu]
        wanted: f64,
        /// Memory for voxels of that size.
        bytes: f64,
        /// Greatest number of voxels within the budget.
        max_voxels: usize,
        /// Width of the narrowest opening that must be found. [Units: wu]
        min_opening: f64,
    },
    /// Requested voxels do not fit the budget, or are finer than the precision of the scene's vertices.
    #[error(
        "voxels of {wanted:?} m would take {}; give --voxel {:.4} or wider, or omit it, or raise --max-memory and \
         max_voxels",
        gigabytes(*.bytes), (.finest * 1e4).ceil() / 1e4
    )]
    TooFine {
        /// Requested voxel size. [Units: wu]
        wanted: f64,
        /// The finest size that fits. [Units: wu]
        finest: f64,
        /// Memory for the requested voxels. [Units: bytes]
        bytes: f64,
    },
    /// More work than the scene's triangles are worth, see [`crate::Budget`].
    #[error(
        "the stage '{}' takes more work than {n_triangles} triangles are worth: they cross each other, or lie \
         close together, everywhere; mark objects that bound no room as detail, set a wider --min-opening, or limit \
         only the time, with --max-time 3600",
        .stage.name()
    )]
    TooMuchWork {
        /// The stage that was running.
        stage: Stage,
        /// Structural triangles.
        n_triangles: usize,
        /// Work spent by then, in units of about 100 ns.
        spent: u64,
    },
    /// The time is up.
    #[error(
        "{} s were allowed (--max-time), and they ran out in the stage '{}'; allow more, or set a wider \
         --min-opening or --voxel",
        .time.as_secs_f64(), .stage.name()
    )]
    TimeIsUp {
        /// The stage that was running.
        stage: Stage,
        /// The allowed time.
        time: Duration,
    },
    /// The bake took more memory than allowed.
    #[error(
        "the stage '{}' took more memory than the {:.0} MB that are allowed (--max-memory); allow more, mark \
         objects that bound no room as detail, or set a wider --min-opening or --voxel",
        .stage.name(), *.memory as f64 / 1e6
    )]
    TooMuchMemory {
        /// The stage that was running.
        stage: Stage,
        /// The allowed memory. [Units: bytes]
        memory: u64,
    },
    /// A cost names a material that the scene does not have.
    #[error(transparent)]
    Material(#[from] crate::simplify::UnknownMaterial),
    /// The scene has no tetrahedra.
    #[error(transparent)]
    Tetrahedra(#[from] DelaunayError),
    /// The caller canceled the bake.
    #[error("cancelled")]
    Cancelled,
}

/// Errors of [`tetrahedralize`](crate::delaunay::tetrahedralize).
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DelaunayError {
    /// A coordinate is not finite, or too large or too small for exact products.
    #[error(
        "point {index} has the coordinate {value}; coordinates must be 0 or between 1e-40 and 1e50"
    )]
    Coordinate {
        /// Index of the point.
        index: usize,
        /// The coordinate.
        value: f64,
    },
    /// All points lie in one plane, or there are fewer than four.
    #[error("all {n_points} points lie in one plane, so there is no volume to divide")]
    Flat {
        /// Number of points.
        n_points: usize,
    },
    /// More points than indices.
    #[error("{n_points} points are more than the 100 million that indices of 32 bits allow")]
    TooMany {
        /// Number of points.
        n_points: usize,
    },
}

/// Formats an amount of memory; omits the digits of absurd numbers.
fn gigabytes(bytes: f64) -> String {
    match bytes / 1e9 {
        n if n < 1e6 => format!("about {n:.0} GB of memory"),
        _ => "more memory than exists".to_owned(),
    }
}
