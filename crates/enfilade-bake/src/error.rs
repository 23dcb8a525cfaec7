//! Why a bake could not be done.

use std::time::Duration;

use crate::Stage;

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
    /// Within the budget, voxels would be wider than the narrowest opening that must be found.
    #[error(
        "the scene is {:.0} x {:.0} x {:.0} m large: the {max_voxels} voxels that are allowed would be {voxel:.2} m \
         wide, wider than the narrowest opening that must be found ({min_opening} m); if it is that large, \
         ask for less with a wider --voxel or --min-opening, or allow more with --max-memory and max_voxels (the {wanted:.2} m wanted take about \
         {:.0} GB of memory); if it is not, give the right --unit",
        .size[0], .size[1], .size[2], .bytes / 1e9
    )]
    TooLarge {
        /// Edges of the scene's box. [Units: wu]
        size: [f64; 3],
        /// Voxel size that fits into the budget. [Units: wu]
        voxel: f64,
        /// Voxel size that was wanted. [Units: wu]
        wanted: f64,
        /// Memory for voxels of that size.
        bytes: f64,
        /// The budget.
        max_voxels: usize,
        /// Width of the narrowest opening that must be found. [Units: wu]
        min_opening: f64,
    },
    /// Voxels that were asked for do not fit the budget, or are finer than the scene's corners.
    #[error(
        "voxels of {wanted:?} m would take {}; give --voxel {:.4} or wider, or leave it out, or allow more with --max-memory and \
         max_voxels",
        gigabytes(*.bytes), (.finest * 1e4).ceil() / 1e4
    )]
    TooFine {
        /// What was asked for. [Units: wu]
        wanted: f64,
        /// The finest that fit. [Units: wu]
        finest: f64,
        /// Memory for what was asked for.
        bytes: f64,
    },
    /// More work than the scene's triangles are worth, see [`crate::Budget`].
    #[error(
        "the stage '{}' has more to do than {n_triangles} triangles are worth: they cross each other, or lie so close, all \
         over; mark as detail what bounds no room, ask for less with a wider --min-opening, or give it as long as it takes with \
         --max-time 3600",
        .stage.name()
    )]
    TooMuchWork {
        /// The stage that was under way.
        stage: Stage,
        /// Structural triangles.
        n_triangles: usize,
        /// What was spent by then, in units of about 100 ns.
        spent: u64,
    },
    /// The time is up.
    #[error(
        "{} s were allowed (--max-time), and they ended in the stage '{}'; give it more, or ask for less with a wider \
         --min-opening or --voxel",
        .time.as_secs_f64(), .stage.name()
    )]
    TimeIsUp {
        /// The stage that was under way.
        stage: Stage,
        /// What was allowed.
        time: Duration,
    },
    /// More memory was taken than was allowed.
    #[error(
        "the stage '{}' took more memory than the {:.0} MB that are allowed (--max-memory); allow more, mark as detail what \
         bounds no room, or ask for less with a wider --min-opening or --voxel",
        .stage.name(), *.memory as f64 / 1e6
    )]
    TooMuchMemory {
        /// The stage that was under way.
        stage: Stage,
        /// What was allowed. [Units: bytes]
        memory: u64,
    },
    /// A cost is given for a material that the scene has not.
    #[error(transparent)]
    Material(#[from] crate::simplify::UnknownMaterial),
    /// The scene has no tetrahedra.
    #[error(transparent)]
    Tetrahedra(#[from] crate::delaunay::DelaunayError),
    /// The caller asked to stop.
    #[error("cancelled")]
    Cancelled,
}

/// Memory in words; of absurd numbers, nobody reads the digits.
fn gigabytes(bytes: f64) -> String {
    match bytes / 1e9 {
        n if n < 1e6 => format!("about {n:.0} GB of memory"),
        _ => "more memory than there is".to_owned(),
    }
}
