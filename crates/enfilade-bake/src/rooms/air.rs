//! The air of a scene in voxels, before it is divided.

use enfilade_geom::Allowance;

use super::lids::{Lids, find_lids};
use super::rims::rim_caps;
use crate::config::BYTES_A_VOXEL;
use crate::structure::Structure;
use crate::voxel::{BitVolume, Grid, distance_squared_near, far_outdoors, voxelize};
use crate::{BakeConfig, BakeContext, BakeError, Resolution, Stage};

/// The air of a scene in voxels, before it is divided.
pub(crate) struct VoxelAir {
    pub(crate) grid: Grid,
    pub(crate) solid: Solid,
    /// Squared distance of each air voxel to the nearest surface. [Units: vx²]
    pub(crate) distances: Vec<u16>,
    /// Outdoor voxels so far from everything that their distances do not matter.
    pub(crate) far: BitVolume,
}

/// Measures the air of a structure in voxels.
///
/// Time is linear in voxels and about linear in triangles; memory about 3.6 bytes a voxel plus the scene.
///
/// # Errors
/// If a setting is invalid, the scene is too large for the voxel budget, or the caller cancels.
pub(crate) fn prepare(
    structure: &Structure<'_>,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<VoxelAir, BakeError> {
    config.check_opening()?;
    let bounds = structure.built_up(config.min_opening);
    let grid = config.grid(&bounds, structure.triangles.len())?;
    context.tell(resolution_of(&grid), BYTES_A_VOXEL * grid.n_voxels() as f64);
    context.begin(Stage::Voxelize)?;
    let solid = Solid::of(structure, &grid, config);
    context.begin(Stage::Distance)?;
    let (distances, far) = solid.distances(context.allowance());
    Ok(VoxelAir {
        grid,
        solid,
        distances,
        far,
    })
}

pub(super) fn resolution_of(grid: &Grid) -> Resolution {
    Resolution::Voxels {
        edge: grid.voxel,
        dims: grid.dims,
    }
}

/// Voxels that are not air, or are closed to the flood.
pub(crate) struct Solid {
    pub(super) occupied: BitVolume,
    /// Voxels that door leaves and panes fill.
    pub(super) closures: BitVolume,
    pub(super) lids: Lids,
    /// Closures, lids, caps of open tubes, and missing wall triangles.
    pub(super) shut: BitVolume,
}

impl Solid {
    pub(super) fn of(structure: &Structure<'_>, grid: &Grid, config: &BakeConfig) -> Self {
        let allowance = structure.allowance;
        let occupied = voxelize(grid, &structure.walls, allowance);
        let closures = voxelize(grid, &structure.blockers(&structure.bvh), allowance);
        // Lids and caps replace missing roofs, floors and ends of tubes.
        let lids = find_lids(grid, &occupied, allowance);
        let mut caps = rim_caps(&structure.rims, config.min_opening.powi(2));
        caps.extend(&structure.missing);
        let mut shut = voxelize(grid, &caps, allowance);
        shut.union_with(&closures);
        for voxels in lids.lids.iter().chain(&lids.floors) {
            shut.union_with(voxels);
        }
        Self {
            occupied,
            closures,
            lids,
            shut,
        }
    }

    /// Returns the squared distance of air voxels to the nearest surface, and the outdoor voxels so far away that
    /// theirs do not matter. Door leaves count as surfaces here.
    pub(super) fn distances(&self, allowance: &Allowance) -> (Vec<u16>, BitVolume) {
        let mut blocked = self.occupied.clone();
        blocked.union_with(&self.shut);
        let far = far_outdoors(&blocked, allowance);
        (distance_squared_near(&blocked, &far, allowance), far)
    }
}
