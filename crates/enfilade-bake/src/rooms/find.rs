//! The stages from a division of the air to a proposal, the same for all builders that divide it: parts → rooms → candidate
//! portals and votes.
//!
//! A builder begins with [`prepare`](super::prepare), divides the air into [`Basins`] in its own way, and ends with [`propose`].

use std::borrow::Cow;

use enfilade_geom::{Allowance, DVec3, Triangle};

use super::air::{Solid, VoxelAir};
use super::basins::Basins;
use super::candidates::Openings;
use super::forks::{is_curved, split_forks};
use super::hollow::{Matter, find_matter};
use super::limb_rule::{LimbRule, LimbSettings};
use super::limbs::split_limbs;
use super::low::join_low;
use super::regions::Regions;
use super::sheltered::{Surfaces, sheltered};
use super::voids::{inside_stairs, shallow_voids};
use super::votes::{Ballots, inside_of};
use crate::proposal::{FoundPlace, Proposal};
use crate::structure::{Candidate, Frame, Structure};
use crate::tubes::Walls;
use crate::voxel::{DistanceField, Grid, Labels, SparseVolume};
use crate::{BakeConfig, BakeContext, BakeError, Stage};

/// Proposes the rooms that the given parts of the air make.
///
/// # Errors
/// If the caller cancels.
pub(crate) fn propose(
    structure: &Structure<'_>,
    air: VoxelAir,
    mut basins: Basins,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<Proposal, BakeError> {
    let allowance = context.allowance();
    let VoxelAir {
        grid,
        solid,
        slabs,
        share,
        resolution,
        ..
    } = air;
    let field = is_curved(&framed(structure)).then(|| solid.field(allowance));
    basins.refill(&solid.occupied);
    let (n_occupied, mut notes) = (solid.occupied.count(), solid.lids.notes(&grid));
    let Solid {
        shut,
        closures,
        lids,
        occupied,
    } = solid;
    drop(occupied);

    context.begin(Stage::Rooms)?;
    let (regions, tubes) = rooms_of(
        structure,
        &grid,
        &mut basins,
        FloodedAir::of(&shut, &slabs, field),
        config,
        context,
    )?;
    let Basins { labels, peaks, .. } = basins;
    let (bvh, least) = (&structure.bvh, config.merge.min_radius);
    let matter = find_matter(&grid, &labels, &regions, &peaks, bvh, least, allowance);
    notes.extend_from_slice(&matter.notes);
    let surfaces = Surfaces {
        bvh,
        face_air: matter.fronts_face_air,
    };
    let sheltered = sheltered(&grid, &labels, &regions, surfaces, allowance);

    context.begin(Stage::Candidates)?;
    let openings = Openings {
        grid: &grid,
        labels: &labels,
        peaks: &peaks,
        shut: &shut,
        allowance,
        regions: &regions,
        closures: &closures,
        lids: &lids,
        walls: &structure.walls,
        hole: structure.hole.gap(),
        settings: &config.merge,
    };
    let candidates = openings.candidates();
    drop((closures, lids, shut));
    let stairs = inside_of(&structure.stairs, &grid, &structure.bvh, allowance);
    let not_air = (&matter.regions[..], &stairs);
    let ballots = Ballots::cast(
        &grid, &labels, &regions, not_air.0, not_air.1, share, allowance,
    );
    drop(stairs);
    let region_at = |p| region_at(&grid, &labels, &regions, p);
    let voids = voids_of(structure, &matter, &region_at, allowance);
    drop(labels);
    // From here on, everything is in scene coordinates.
    let frame = &structure.frame;
    let spaces = matter.spaces.iter().chain(&sheltered);
    let places = places_of(&regions, spaces, frame, config);
    let found = [n_occupied, basins.n_basins, candidates.len()];
    let counts = counts_of(&grid, frame, found);
    Ok(Proposal {
        candidates: (candidates.into_iter())
            .map(|c| Candidate {
                winding: frame.winding_to_scene(&c.winding),
                ..c
            })
            .collect(),
        voids: (voids.into_iter())
            .map(|(p, region)| (frame.to_scene(p), region))
            .collect(),
        places,
        whys: matter.whys,
        counts,
        tubes,
        notes,
        settings: config.voxel_settings(),
        resolution,
        ..Proposal::new(
            frame.aabb_to_scene(&grid.aabb()),
            ballots.count(&grid, frame),
        )
    })
}

/// Returns the close joins of regions, and `spaces` that are not rooms, in scene coordinates.
fn places_of<'a>(
    regions: &Regions,
    spaces: impl Iterator<Item = &'a FoundPlace>,
    frame: &Frame,
    config: &BakeConfig,
) -> Vec<FoundPlace> {
    let joins = regions.joins.iter().map(|join| FoundPlace {
        at: join.at,
        why: join.why(&config.merge),
    });
    let all = joins.chain(spaces.cloned());
    let placed = all.map(|place| FoundPlace {
        at: frame.to_scene(place.at),
        ..place
    });
    placed.collect()
}

/// Returns all structural triangles in the axes of the grid.
fn framed<'a>(structure: &'a Structure<'_>) -> Cow<'a, [Triangle]> {
    structure.frame.triangles_to_grid(&structure.triangles)
}

/// The flooded air, besides its basins.
struct FloodedAir<'a> {
    /// Voxels that door leaves and panes fill.
    shut: &'a SparseVolume,
    /// Heights at which slabs end storeys.
    slabs: &'a [f64],
    /// Distances to look for forks in.
    field: Option<DistanceField>,
}

impl<'a> FloodedAir<'a> {
    fn of(shut: &'a SparseVolume, slabs: &'a [f64], field: Option<DistanceField>) -> Self {
        Self { shut, slabs, field }
    }
}

/// Makes rooms of basins; returns them with the volumes of tubes and of all rooms, see [`split_forks`]. Forks are looked for
/// where a `field` is given.
///
/// # Errors
/// If the caller cancels.
fn rooms_of(
    structure: &Structure<'_>,
    grid: &Grid,
    basins: &mut Basins,
    air: FloodedAir<'_>,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<(Regions, [f64; 2]), BakeError> {
    let FloodedAir { shut, slabs, field } = air;
    let allowance = context.allowance();
    let mut regions = basins.merge(grid, shut, slabs, config, allowance);
    context.check()?;
    split_limbs(
        grid,
        &mut basins.labels,
        &mut regions,
        &mut basins.peaks,
        shut,
        LimbSettings {
            merge: &config.merge,
            rule: LimbRule::ROOMS,
        },
        allowance,
    );
    join_low(grid, &basins.labels, &mut regions, allowance);
    let tubes = field.map_or([0.0; 2], |field| {
        let walls = Walls {
            triangles: &framed(structure),
            bvh: &structure.bvh,
        };
        split_forks(
            grid,
            basins,
            &mut regions,
            field,
            &walls,
            config.merge.min_radius,
            allowance,
        )
    });
    context.check()?;
    Ok((regions, tubes))
}

/// Returns points of air that no opening connects to its region: inside stairs, and in shallow voids.
fn voids_of(
    structure: &Structure<'_>,
    matter: &Matter,
    region_at: &(dyn Fn(DVec3) -> u32 + Sync),
    allowance: &Allowance,
) -> Vec<(DVec3, u32)> {
    let mut voids = inside_stairs(&structure.stairs, &structure.bvh, region_at, allowance);
    voids.retain(|(_, region)| matter.regions.binary_search(region).is_err());
    if matter.fronts_face_air {
        let (walls, bvh) = (&structure.walls, &structure.bvh);
        voids.extend(shallow_voids(walls, bvh, region_at, allowance));
    }
    voids
}

/// Names of the counts that [`propose`] makes for the file.
pub(crate) const COUNTS: [&str; 6] = [
    "voxel_size",
    "grid_turn_degrees",
    "voxels",
    "occupied_voxels",
    "basins",
    "screens",
];

/// Returns counts for the file: of the grid, and of its contents.
fn counts_of(grid: &Grid, frame: &Frame, found: [usize; 3]) -> Vec<(&'static str, f64)> {
    let [n_occupied, n_basins, n_screens] = found.map(|n| n as f64);
    let n_voxels = grid.n_voxels() as f64;
    let counts = [
        grid.voxel,
        frame.degrees(),
        n_voxels,
        n_occupied,
        n_basins,
        n_screens,
    ];
    COUNTS.into_iter().zip(counts).collect()
}

/// Returns the region of a point, 0 if there is none.
fn region_at(grid: &Grid, labels: &Labels, regions: &Regions, p: DVec3) -> u32 {
    grid.voxel_at(p)
        .map_or(0, |at| regions.region_of_basin[labels.at(at) as usize])
}
