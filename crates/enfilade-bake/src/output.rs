//! The result of a bake.

use std::time::Duration;

use enfilade_cpg::World;

use crate::complex::Leak;
use crate::{Method, Stage};

/// The world and a report on how it was made.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct BakeOutput {
    /// Cells, portals, geometry.
    pub world: World,
    /// The method that found the cells.
    pub method: Method,
    /// The builder's resolution.
    pub resolution: Resolution,
    /// Wall time of each stage.
    pub times: Vec<(Stage, Duration)>,
    /// Work that each stage spent from the [`Budget`](crate::Budget), in units of about 100 ns. Uses no clock.
    pub work: Vec<(Stage, u64)>,
    /// Places where cells meet without a designed opening: cracks and holes of the model.
    pub leaks: Vec<Leak>,
    /// Assumptions and doubtful decisions of the builder, one sentence each.
    pub notes: Vec<String>,
}

impl BakeOutput {
    /// Returns the number of indoor cells.
    #[must_use]
    pub fn n_indoors(&self) -> usize {
        self.world.graph.indoor_cells().count()
    }
}

/// Resolution of a builder.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Resolution {
    /// The watershed: cubes.
    Voxels {
        /// Edge of a voxel. [Units: wu]
        edge: f64,
        /// Voxels along each axis of the largest grid.
        dims: [usize; 3],
        /// Number of grids: one for each building of a site.
        n_grids: usize,
        /// Voxels of all grids.
        n_voxels: u64,
    },
    /// The binary space partition: planes of the model, exactly.
    Planes,
    /// Tetrahedra: surfaces have vertices for all balls of air of at least this radius. [Units: wu]
    Balls {
        /// The radius.
        radius: f64,
    },
}
