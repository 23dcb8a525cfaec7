//! The stages from a division of the air to a proposal, the same for all builders that divide it: parts → rooms → candidate
//! portals and votes.
//!
//! A builder begins with [`prepare`](super::prepare), divides the air into [`Basins`] in its own way, and ends with [`propose`].

use std::borrow::Cow;

use enfilade_geom::{Allowance, Bvh, DVec3, Triangle};

use super::air::{Solid, VoxelAir};
use super::basins::Basins;
use super::candidates::Openings;
use super::forks::{is_curved, split_forks};
use super::hollow::{Matter, find_matter};
use super::lids::Lids;
use super::limb_rule::LimbRule;
use super::limbs::split_limbs;
use super::low::join_low;
use super::regions::Regions;
use super::sheltered::sheltered;
use super::voids::{inside_stairs, shallow_voids};
use super::votes::{Ballots, inside_of};
use crate::proposal::{FoundPlace, Proposal};
use crate::structure::{Candidate, Frame, Structure};
use crate::tubes::Walls;
use crate::voxel::{DistanceField, Grid, Labels, SparseVolume};
use crate::{BakeConfig, BakeContext, BakeError, MergeSettings, Resolution, Stage};

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
    let field = field_for_forks(structure, &air, allowance);
    basins.refill(&air.solid.occupied);
    basins.cut(&air.grid, &air.slabs);
    context.begin(Stage::Rooms)?;
    let regions = basins.merge(&air, config, allowance);
    let mut rooms = VoxelRooms::of(air, basins, regions);
    context.check()?;
    rooms.split_limbs(&config.merge, allowance);
    join_low(&rooms.grid, &rooms.labels, &mut rooms.regions, allowance);
    rooms.split_forks(structure, field, config, allowance);
    context.check()?;
    rooms.propose(structure, config, context)
}

/// Returns all structural triangles in the axes of the grid.
fn framed<'a>(structure: &'a Structure<'_>) -> Cow<'a, [Triangle]> {
    structure.frame.triangles_to_grid(&structure.triangles)
}

/// Returns the distances among which forks of tubes are looked for; `None` if there are no tubes.
pub(crate) fn field_for_forks(
    structure: &Structure<'_>,
    air: &VoxelAir,
    allowance: &Allowance,
) -> Option<DistanceField> {
    is_curved(&framed(structure)).then(|| air.solid.field(allowance))
}

/// The air of a volume divided into rooms.
#[derive(Clone)]
pub(crate) struct VoxelRooms {
    pub(crate) grid: Grid,
    /// Basin of each voxel.
    pub(crate) labels: Labels,
    /// Largest distance in each basin. [Units: vx]
    pub(crate) peaks: Vec<f32>,
    pub(crate) regions: Regions,
    /// Its regions are final: the openings between them are kept whatever their shape.
    pub(crate) are_final: bool,
    /// Volume of the regions in which tubes meet, and of all. [Units: wu³]
    tubes: [f64; 2],
    closures: SparseVolume,
    shut: SparseVolume,
    lids: Lids,
    share: f64,
    resolution: Resolution,
    n_occupied: usize,
    n_basins: usize,
}

impl VoxelRooms {
    /// Drops the occupied voxels.
    pub(crate) fn of(air: VoxelAir, basins: Basins, regions: Regions) -> Self {
        let Basins {
            labels,
            peaks,
            n_basins,
            ..
        } = basins;
        let Solid {
            occupied,
            closures,
            lids,
            shut,
        } = air.solid;
        Self {
            grid: air.grid,
            labels,
            peaks,
            regions,
            are_final: false,
            tubes: [0.0; 2],
            closures,
            shut,
            lids,
            share: air.share,
            resolution: air.resolution,
            n_occupied: occupied.count(),
            n_basins,
        }
    }

    /// Splits corridors off.
    pub(crate) fn split_limbs(&mut self, settings: &MergeSettings, allowance: &Allowance) {
        split_limbs(
            &self.grid,
            &mut self.labels,
            &mut self.regions,
            &mut self.peaks,
            &self.shut,
            (settings, LimbRule::ROOMS),
            allowance,
        );
    }

    /// Splits the arms of forks off, where a `field` is given.
    pub(crate) fn split_forks(
        &mut self,
        structure: &Structure<'_>,
        field: Option<DistanceField>,
        config: &BakeConfig,
        allowance: &Allowance,
    ) {
        let Some(field) = field else {
            return;
        };
        let walls = Walls {
            triangles: &framed(structure),
            bvh: &structure.bvh,
        };
        self.tubes = split_forks(
            &self.grid,
            &mut self.labels,
            &mut self.regions,
            &mut self.peaks,
            field,
            (&walls, config.merge.min_radius),
            allowance,
        );
    }

    /// Returns the regions that are not rooms. `surfaces` are all structural triangles.
    pub(crate) fn matter(&self, surfaces: &Bvh, min_radius: f64, allowance: &Allowance) -> Matter {
        find_matter(
            &self.grid,
            &self.labels,
            &self.regions,
            &self.peaks,
            surfaces,
            min_radius,
            allowance,
        )
    }

    /// Returns the region of a point, 0 if there is none.
    pub(crate) fn region_at(&self, p: DVec3) -> u32 {
        let label = |at| self.regions.region_of_basin[self.labels.at(at) as usize];
        self.grid.voxel_at(p).map_or(0, label)
    }

    /// Fits a candidate to each opening, and votes.
    ///
    /// # Errors
    /// If the caller cancels.
    pub(crate) fn propose(
        self,
        structure: &Structure<'_>,
        config: &BakeConfig,
        context: &BakeContext<'_>,
    ) -> Result<Proposal, BakeError> {
        let allowance = context.allowance();
        let matter = self.matter(&structure.bvh, config.merge.min_radius, allowance);
        let (regions, bvh) = (&self.regions, &structure.bvh);
        let sheltered = sheltered(&self.grid, &self.labels, regions, bvh, allowance);
        context.begin(Stage::Candidates)?;
        let candidates = self.openings(structure, config, allowance).candidates();
        let stairs = inside_of(&structure.stairs, &self.grid, &structure.bvh, allowance);
        let not_air = (&matter.regions[..], &stairs);
        let ballots = Ballots::cast(
            &self.grid,
            &self.labels,
            &self.regions,
            not_air,
            self.share,
            allowance,
        );
        drop(stairs);
        let region_at = |p| self.region_at(p);
        let voids = voids_of(structure, &matter, &region_at, allowance);
        let Self {
            grid,
            labels,
            regions,
            closures,
            shut,
            lids,
            ..
        } = self;
        let mut notes = lids.notes(&grid);
        drop((labels, closures, shut, lids));
        notes.extend_from_slice(&matter.notes);
        // From here on, everything is in scene coordinates.
        let frame = &structure.frame;
        let spaces = matter.spaces.iter().chain(&sheltered);
        let places = places_of(&regions, spaces, frame, config);
        let found = [self.n_occupied, self.n_basins, candidates.len()];
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
            tubes: self.tubes,
            notes,
            settings: config.voxel_settings(),
            resolution: self.resolution,
            ..Proposal::new(
                frame.aabb_to_scene(&grid.aabb()),
                ballots.count(&grid, frame),
            )
        })
    }

    fn openings<'a>(
        &'a self,
        structure: &'a Structure<'_>,
        config: &'a BakeConfig,
        allowance: &'a Allowance,
    ) -> Openings<'a> {
        Openings {
            grid: &self.grid,
            labels: &self.labels,
            peaks: &self.peaks,
            shut: &self.shut,
            allowance,
            regions: &self.regions,
            are_final: self.are_final,
            closures: &self.closures,
            lids: &self.lids,
            walls: &structure.walls,
            hole: structure.hole.gap(),
            settings: &config.merge,
        }
    }
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
