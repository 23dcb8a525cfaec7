//! The air of a scene in voxels, before it is divided.

use std::borrow::Cow;

use enfilade_geom::{Allowance, Triangle};

use super::lids::{Lids, find_lids};
use super::rims::rim_caps;
use super::votes::n_votes;
use crate::complex::Vote;
use crate::structure::{Site, Structure};
use crate::voxel::{
    BitVolume, DistanceField, Grid, SparseVolume, add_voxels, bytes_of_slabs, far_outdoors,
    voxelize,
};
use crate::{BakeConfig, BakeContext, BakeError, Resolution, Stage};

/// The air of a scene in voxels, before it is divided.
pub(crate) struct VoxelAir {
    pub(crate) grid: Grid,
    pub(crate) solid: Solid,
    /// Heights at which storeys end, ascending. [Units: wu]
    pub(crate) slabs: Vec<f64>,
    /// Share of all voxels of the scene.
    pub(crate) share: f64,
    /// Resolution of the whole scene.
    pub(crate) resolution: Resolution,
}

/// A grid over a part of a scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plot {
    site: Site,
    pub(super) grid: Grid,
    /// Share of all voxels of the scene.
    share: f64,
    /// Resolution of the whole scene.
    pub(crate) resolution: Resolution,
}

/// Most memory of a bake in voxels, by which a limit on memory bounds their number. [Units: bytes/vx]
pub(crate) const FLOODED: f64 = 2.2;

/// Memory of the distances, labels and bits of a flood, beside its slabs: from bakes of 20 buildings of 1 to 326 million voxels.
/// [Units: bytes/vx]
const KEPT: f64 = 0.9;

/// Triangles of detail objects that are voxelized at once: all of a building's would take more memory than its voxels.
const BATCH: usize = 1 << 18;

/// Memory of a vote: itself, and its leaf. [Units: bytes]
const BYTES_A_VOTE: usize = size_of::<Vote>() + size_of::<Option<u32>>();

/// Lays grids over parts of a structure, and reports the work ahead.
///
/// # Errors
/// If a setting is invalid, or the scene is too large for the voxel budget.
pub(crate) fn plots(
    structure: &Structure<'_>,
    sites: Vec<Site>,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<Vec<Plot>, BakeError> {
    config.check_opening()?;
    let grid = |site: Site| {
        let grid = config.grid(&site.bounds, structure.triangles.len(), FLOODED)?;
        Ok::<_, BakeError>((site, grid))
    };
    let grids: Vec<(Site, Grid)> = sites
        .into_iter()
        .map(grid)
        .collect::<Result<_, BakeError>>()?;
    let n_voxels: usize = grids.iter().map(|(_, grid)| grid.n_voxels()).sum();
    let largest = grids.iter().map(|g| &g.1).max_by_key(|g| g.n_voxels());
    let resolution = Resolution::Voxels {
        edge: grids.iter().map(|g| g.1.voxel).fold(0.0, f64::max),
        dims: largest.map_or([0; 3], |grid| grid.dims),
        n_grids: grids.len(),
        n_voxels: n_voxels as u64,
    };
    // Grids are held one after the other.
    let n_threads = rayon::current_num_threads();
    let of_flood =
        |grid: &Grid| KEPT * grid.n_voxels() as f64 + bytes_of_slabs(grid.dims, n_threads) as f64;
    let of_flood = grids.iter().map(|g| of_flood(&g.1)).fold(0.0, f64::max);
    let of_votes = BYTES_A_VOTE * n_votes(n_voxels);
    context.tell(resolution, of_flood, of_votes as f64);
    let plot = |(site, grid): (Site, Grid)| Plot {
        site,
        share: grid.n_voxels() as f64 / n_voxels as f64,
        grid,
        resolution,
    };
    Ok(grids.into_iter().map(plot).collect())
}

/// Measures the air of a structure in voxels, all its sites in one grid.
///
/// # Errors
/// As [`plots`] and [`measure`].
pub(crate) fn prepare(
    structure: &Structure<'_>,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<VoxelAir, BakeError> {
    let sites = structure.sites(config.min_opening);
    let all = sites.into_iter().reduce(Site::union);
    let mut plots = plots(structure, all.into_iter().collect(), config, context)?;
    measure(structure, plots.swap_remove(0), config, context)
}

/// Measures the air of a part of a structure in voxels.
///
/// Time is linear in voxels and about linear in triangles.
///
/// # Errors
/// If the caller cancels.
pub(crate) fn measure(
    structure: &Structure<'_>,
    plot: Plot,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<VoxelAir, BakeError> {
    let Plot {
        site,
        grid,
        share,
        resolution,
    } = plot;
    context.begin(Stage::Voxelize)?;
    let solid = Solid::of(structure, &grid, config);
    context.begin(Stage::Distance)?;
    Ok(VoxelAir {
        slabs: structure.slabs(&site.core),
        grid,
        solid,
        share,
        resolution,
    })
}

/// Voxels that are not air, or are closed to the flood.
pub(crate) struct Solid {
    pub(super) occupied: SparseVolume,
    /// Voxels that door leaves and panes fill.
    pub(super) closures: SparseVolume,
    pub(super) lids: Lids,
    /// Closures, lids, caps of open tubes, and missing wall triangles.
    pub(super) shut: SparseVolume,
}

impl Solid {
    pub(super) fn of(structure: &Structure<'_>, grid: &Grid, config: &BakeConfig) -> Self {
        let allowance = structure.allowance;
        let occupied = SparseVolume::of(&voxelize(grid, &structure.walls, allowance));
        // Lids and caps replace missing roofs, floors and ends of tubes.
        let lids = find_lids(grid, &occupied, allowance);
        let mut shut = BitVolume::new(grid.dims);
        let mut batch: Vec<Triangle> = Vec::new();
        structure.for_blockers(&structure.bvh, |plate| {
            batch.extend(plate);
            if batch.len() >= BATCH {
                add_voxels(&mut shut, grid, &batch, allowance);
                batch.clear();
            }
        });
        add_voxels(&mut shut, grid, &batch, allowance);
        let closures = SparseVolume::of(&shut);
        let mut caps = rim_caps(&structure.rims, config.min_opening.powi(2));
        caps.extend(&structure.missing);
        add_voxels(&mut shut, grid, &caps, allowance);
        for voxels in lids.lids.iter().chain(&lids.floors) {
            voxels.add_to(&mut shut);
        }
        Self {
            occupied,
            closures,
            lids,
            shut: SparseVolume::of(&shut),
        }
    }

    /// Returns the distance of air voxels to the nearest surface. Door leaves count as surfaces here.
    pub(crate) fn field(&self, allowance: &Allowance) -> DistanceField {
        let (blocked, far) = self.blocked(allowance);
        DistanceField::of(&blocked, &far, allowance)
    }

    /// Returns all voxels that stop a flood, and the outdoor voxels far from them.
    pub(super) fn blocked(&self, allowance: &Allowance) -> (Cow<'_, SparseVolume>, SparseVolume) {
        let blocked = if self.shut.is_empty() {
            Cow::Borrowed(&self.occupied)
        } else {
            Cow::Owned(self.occupied.union(&self.shut))
        };
        let far = far_outdoors(&*blocked, allowance);
        (blocked, far)
    }
}
