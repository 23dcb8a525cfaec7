//! The stages of the watershed builder: structure → voxels → basins, and from there as all builders do.

use crate::pieces::{Kept, PieceKind};
use crate::proposal::Proposal;
use crate::rooms::{self, Basins, Plot};
use crate::structure::Structure;
use crate::{BakeConfig, BakeContext, BakeError, Outdoors, Stage};

/// Finds rooms by a flood of the distance field.
///
/// Time is linear in voxels and about linear in triangles; memory about 2.2 bytes a voxel plus the scene.
///
/// # Errors
/// If a setting is invalid, the scene is too large for the voxel budget, or the caller cancels.
pub(crate) fn propose(
    structure: &Structure<'_>,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<Proposal, BakeError> {
    if config.outdoors != Outdoors::Whole && structure.is_bare(config.min_opening) {
        // Land alone is divided in plan.
        let bounds = structure.frame.aabb_to_scene(&structure.bounds());
        return Ok(Proposal {
            settings: config.voxel_settings(),
            ..Proposal::new(bounds, Vec::new())
        });
    }
    let kept = Kept::of(structure.scene, config, context.pieces());
    let mut proposal: Option<Proposal> = None;
    // One after the other: each has a grid of its own, and threads share the work on it.
    for plot in sites_of(structure, config, context)? {
        let here = propose_site(structure, plot, kept, config, context)?;
        proposal = Some(match proposal {
            Some(before) => before.beside(here),
            None => here,
        });
    }
    let mut proposal = proposal.ok_or(BakeError::NothingStructural {
        n_objects: structure.scene.objects.len(),
    })?;
    let noise = ("noise".to_owned(), config.noise.to_string());
    proposal.settings.extend([noise]);
    Ok(proposal)
}

/// Lays a grid over each site of a scene.
///
/// # Errors
/// If a setting is invalid, or the scene is too large for the voxel budget.
pub(crate) fn sites_of(
    structure: &Structure<'_>,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<Vec<Plot>, BakeError> {
    let sites = structure.sites(config.min_opening);
    rooms::plots(structure, sites, config, context)
}

/// Finds the rooms of a site, from its pieces as far as they are there.
///
/// # Errors
/// If the caller cancels.
pub(crate) fn propose_site(
    structure: &Structure<'_>,
    plot: Plot,
    kept: Kept<'_>,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<Proposal, BakeError> {
    let make = || {
        let air = rooms::measure(structure, plot, config, context)?;
        let basins = kept.or_make(PieceKind::Basins, &plot, || {
            let field = air.solid.field(context.allowance());
            context.begin(Stage::Flood)?;
            let basins = Basins::flooded(&air, &field, config, context.allowance());
            context.check()?;
            Ok(basins)
        })?;
        let found = rooms::propose(structure, air, basins, config, context)?;
        context.check()?;
        Ok(found)
    };
    let found = kept.or_make(PieceKind::Rooms, &plot, make)?;
    Ok(Proposal {
        resolution: plot.resolution,
        ..found
    })
}
