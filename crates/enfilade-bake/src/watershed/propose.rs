//! The stages of the watershed builder: structure → voxels → basins → rooms → candidate portals and votes.

use std::collections::BTreeMap;

use enfilade_geom::{Allowance, DVec3};

use super::candidates::fit_candidates;
use super::flooded::Flooded;
use super::hollow::{Matter, find_matter};
use super::lids::{Lids, find_lids};
use super::limbs::split_limbs;
use super::low::join_low;
use super::refill::flood_closures;
use super::regions::{Regions, merge_basins};
use super::rims::rim_caps;
use super::slabs::cut_at_slabs;
use super::voids::{inside_stairs, shallow_voids};
use super::votes::{Ballots, inside_of};
use crate::config::BYTES_A_VOXEL;
use crate::proposal::Proposal;
use crate::structure::{Frame, Structure};
use crate::voxel::{
    BitVolume, Grid, Labels, WatershedOptions, border, distance_squared_near, far_outdoors,
    voxelize, watershed,
};
use crate::{BakeConfig, BakeContext, BakeError, Resolution, Stage};

/// Finds rooms by a flood of the distance field.
///
/// Time is linear in voxels and about linear in triangles; memory about 3 bytes a voxel plus the scene.
///
/// # Errors
/// If a setting is invalid, the scene is too large for the voxel budget, or the caller cancels.
pub(crate) fn propose(
    structure: &Structure<'_>,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<Proposal, BakeError> {
    let allowance = context.allowance();
    let grid = config.grid(&structure.bounds(), structure.triangles.len())?;
    let resolution = resolution_of(&grid);
    context.tell(resolution, BYTES_A_VOXEL * grid.n_voxels() as f64);
    context.begin(Stage::Voxelize)?;
    let solid = Solid::of(structure, &grid, config);
    let mut notes = solid.lids.notes(&grid);
    context.begin(Stage::Distance)?;
    let (distances, far) = solid.distances(allowance);
    context.begin(Stage::Flood)?;
    let mut basins = Basins::flood(&grid, distances, &far, config, allowance);
    context.check()?;
    drop(far);
    basins.refill(&grid, &solid.occupied);
    let slabs = structure.slabs();
    basins.cut(&grid, &slabs);
    let n_occupied = solid.occupied.count();
    let Solid {
        shut,
        closures,
        lids,
        ..
    } = solid;

    context.begin(Stage::Rooms)?;
    let mut regions = basins.merge(&grid, &shut, &slabs, config, allowance);
    context.check()?;
    split_limbs(
        &grid,
        &mut basins.labels,
        &mut regions,
        &mut basins.peaks,
        &shut,
        &config.merge,
        allowance,
    );
    join_low(&grid, &basins.labels, &mut regions, allowance);
    context.check()?;
    drop(shut);
    let Basins { labels, peaks, .. } = basins;
    let matter = find_matter(
        &grid,
        &labels,
        &regions,
        &peaks,
        &structure.bvh,
        config.merge.min_radius,
        allowance,
    );
    notes.extend_from_slice(&matter.notes);

    context.begin(Stage::Candidates)?;
    let mut candidates = fit_candidates(
        &grid,
        &labels,
        &regions,
        (&closures, &lids),
        &structure.walls,
        [config.merge.closed_share, structure.hole.gap()],
        allowance,
    );
    drop((closures, lids));
    let stairs = inside_of(&structure.stairs, &grid, &structure.bvh, allowance);
    let not_air = (&matter.regions[..], &stairs);
    let ballots = Ballots::cast(&grid, &labels, &regions, not_air, allowance);
    drop(stairs);
    let region_at = |p| region_at(&grid, &labels, &regions, p);
    let voids = voids_of(structure, &matter, &region_at, allowance);
    drop(labels);
    // From here on, everything is in scene coordinates.
    let frame = &structure.frame;
    for candidate in &mut candidates {
        candidate.winding = frame.winding_to_scene(&candidate.winding);
    }
    let voids = voids.into_iter().map(|(p, r)| (frame.to_scene(p), r));
    let voids = voids.collect();
    let found = [n_occupied, basins.n_basins, candidates.len()];
    let counts = counts_of(&grid, frame, found);
    Ok(Proposal {
        candidates,
        voids,
        counts,
        notes,
        settings: config.watershed_settings(),
        resolution,
        ..Proposal::new(
            frame.aabb_to_scene(&grid.aabb()),
            ballots.count(&grid, frame),
        )
    })
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

/// Returns counts for the file: of the grid, and of its contents.
fn counts_of(
    grid: &Grid,
    frame: &Frame,
    [n_occupied, n_basins, n_screens]: [usize; 3],
) -> Vec<(&'static str, f64)> {
    vec![
        ("voxel_size", grid.voxel),
        ("grid_turn_degrees", frame.degrees()),
        ("voxels", grid.n_voxels() as f64),
        ("occupied_voxels", n_occupied as f64),
        ("basins", n_basins as f64),
        ("screens", n_screens as f64),
    ]
}

fn resolution_of(grid: &Grid) -> Resolution {
    Resolution::Voxels {
        edge: grid.voxel,
        dims: grid.dims,
    }
}

/// Returns the region of a point, 0 if there is none.
fn region_at(grid: &Grid, labels: &Labels, regions: &Regions, p: DVec3) -> u32 {
    grid.voxel_at(p).map_or(0, |[x, y, z]| {
        regions.region_of_basin[labels.get(grid.index(x, y, z)) as usize]
    })
}

/// Voxels that are not air, or are closed to the flood.
struct Solid {
    occupied: BitVolume,
    /// Voxels that door leaves and panes fill.
    closures: BitVolume,
    lids: Lids,
    /// Closures, lids, caps of open tubes, and missing wall triangles.
    shut: BitVolume,
}

impl Solid {
    fn of(structure: &Structure<'_>, grid: &Grid, config: &BakeConfig) -> Self {
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
    fn distances(&self, allowance: &Allowance) -> (Vec<u16>, BitVolume) {
        let mut blocked = self.occupied.clone();
        blocked.union_with(&self.shut);
        let far = far_outdoors(&blocked, allowance);
        (distance_squared_near(&blocked, &far, allowance), far)
    }
}

/// The basins of the flood.
struct Basins {
    labels: Labels,
    /// Largest distance in each basin, by label. [Units: vx]
    peaks: Vec<f32>,
    saddles: BTreeMap<(u32, u32), f32>,
    n_basins: usize,
}

impl Basins {
    /// Floods the air. Air that is `far` from everything is known to be outdoors.
    fn flood(
        grid: &Grid,
        distances: Vec<u16>,
        far: &BitVolume,
        config: &BakeConfig,
        allowance: &Allowance,
    ) -> Self {
        let mut outdoors = border(grid.dims); // the padding keeps it empty
        outdoors.union_with(far);
        let options = WatershedOptions {
            h: config.noise / grid.voxel,
            outdoors: Some(outdoors),
        };
        let flood = watershed(grid.dims, distances, options, allowance);
        let peaks = flood.basins.iter().map(|b| b.peak as f32);
        let saddles = flood.saddles.iter();
        Self {
            peaks: std::iter::once(0.0).chain(peaks).collect(),
            saddles: saddles.map(|s| ((s.a, s.b), s.distance as f32)).collect(),
            n_basins: flood.basins.len(),
            labels: flood.labels,
        }
    }

    /// Gives the air inside closures to the basins beside it.
    fn refill(&mut self, grid: &Grid, occupied: &BitVolume) {
        flood_closures(grid.dims, &mut self.labels, occupied);
    }

    /// Cuts basins where a slab ends a storey.
    fn cut(&mut self, grid: &Grid, slabs: &[f64]) {
        for parent in cut_at_slabs(grid, &mut self.labels, self.peaks.len(), slabs) {
            self.peaks.push(self.peaks[parent as usize]);
        }
    }

    fn merge(
        &self,
        grid: &Grid,
        shut: &BitVolume,
        slabs: &[f64],
        config: &BakeConfig,
        allowance: &Allowance,
    ) -> Regions {
        let flooded = Flooded {
            grid,
            labels: &self.labels,
            peaks: &self.peaks,
            closures: Some(shut),
            slabs,
            allowance,
        };
        merge_basins(flooded, &self.saddles, &config.merge)
    }
}
