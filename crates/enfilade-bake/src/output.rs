//! What a bake gives.

use std::time::Duration;

use enfilade_cpg::World;

use crate::complex::Leak;
use crate::{Method, Stage};

/// What a bake gives besides the world.
#[derive(Clone, Debug)]
pub struct BakeOutput {
    /// Cells, portals, geometry.
    pub world: World,
    /// What found the cells.
    pub method: Method,
    /// How fine it looked.
    pub resolution: Resolution,
    /// Wall time of each stage.
    pub times: Vec<(Stage, Duration)>,
    /// Work that each stage spent from the [`Budget`](crate::Budget), in units of about 100 ns. Depends on no clock.
    pub work: Vec<(Stage, u64)>,
    /// Where cells meet though no opening was foreseen: cracks and holes of the model.
    pub leaks: Vec<Leak>,
    /// What the builder assumed or decided in doubt, one sentence each.
    pub notes: Vec<String>,
}

impl BakeOutput {
    /// How many cells are indoors.
    #[must_use]
    pub fn n_indoors(&self) -> usize {
        self.world.graph.indoor_cells().count()
    }
}

/// How fine a builder looked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resolution {
    /// The watershed: cubes.
    Voxels {
        /// Edge of a voxel. [Units: wu]
        edge: f64,
        /// Voxels along each axis.
        dims: [usize; 3],
    },
    /// The binary space partition: planes of the model, exactly.
    Planes,
    /// Tetrahedra: surfaces have vertices for all balls of air of at least this radius. [Units: wu]
    Balls {
        /// The radius.
        radius: f64,
    },
}
