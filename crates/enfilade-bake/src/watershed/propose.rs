//! The stages of the watershed builder: structure → voxels → basins, and from there as all builders do.

use enfilade_geom::Allowance;

use crate::proposal::Proposal;
use crate::rooms::{self, Basins, VoxelAir};
use crate::structure::Structure;
use crate::voxel::{BitVolume, Grid, WatershedOptions, border, watershed};
use crate::{BakeConfig, BakeContext, BakeError, Stage};

/// Finds rooms by a flood of the distance field.
///
/// Time is linear in voxels and about linear in triangles; memory about 3.6 bytes a voxel plus the scene.
///
/// # Errors
/// If a setting is invalid, the scene is too large for the voxel budget, or the caller cancels.
pub(crate) fn propose(
    structure: &Structure<'_>,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<Proposal, BakeError> {
    let VoxelAir {
        grid,
        solid,
        distances,
        far,
    } = rooms::prepare(structure, config, context)?;
    context.begin(Stage::Flood)?;
    let basins = flood(&grid, distances, &far, config, context.allowance());
    context.check()?;
    drop(far);
    let mut proposal = rooms::propose(structure, (grid, solid, basins), config, context)?;
    let noise = ("noise".to_owned(), config.noise.to_string());
    proposal.settings.extend([noise]);
    Ok(proposal)
}

/// Floods the air. Air that is `far` from everything is known to be outdoors.
fn flood(
    grid: &Grid,
    distances: Vec<u16>,
    far: &BitVolume,
    config: &BakeConfig,
    allowance: &Allowance,
) -> Basins {
    let mut outdoors = border(grid.dims); // the padding keeps it empty
    outdoors.union_with(far);
    let options = WatershedOptions {
        h: config.noise / grid.voxel,
        outdoors: Some(outdoors),
    };
    let flood = watershed(grid.dims, distances, &options, allowance);
    let peaks = flood.basins.iter().map(|b| b.peak as f32);
    let saddles = flood.saddles.iter();
    Basins {
        peaks: std::iter::once(0.0).chain(peaks).collect(),
        saddles: saddles.map(|s| ((s.a, s.b), s.distance as f32)).collect(),
        n_basins: flood.basins.len(),
        labels: flood.labels,
    }
}
