//! Forks of tubes: each arm is a room, though nothing is narrower at its mouth.
//!
//! At the fork of an airway, of a vessel or of a burrow, balls of the tubes pass from arm to arm, so that no opening parts them.
//! The rule of [`crate::tubes`] finds the forks among balls of air in blocks of voxels. There, a ball is taken out of the
//! region, so large that walls part what it leaves: the arms, each a region of its own, except that the widest keeps the ball.
//!
//! Cost: nothing where most walls are flat and along the axes, else another distance transform; the search is linear in the blocks along
//! tubes.

use std::collections::BTreeMap;

use enfilade_geom::{Allowance, Triangle, triangle_area_normal};

use super::basins::Basins;
use super::flooded::contact_faces;
use super::fork_pieces::ForkPieces;
use super::fork_place::{ForkArm, ForkPlace};
use super::limbs::contacts_of;
use super::regions::Regions;
use super::voxel_balls::BlockBalls;
use crate::structure::OUTDOORS;
use crate::tubes::{Balls, Fork, Walls, find_forks};
use crate::voxel::{DistanceField, Grid, Labels};

/// Radius of the widest tubes that are looked for in blocks of one size: wider ones are, in blocks twice as large. [Units: blocks]
const BLOCKS: f64 = 5.0;

/// Least sine of the angle between the normal of a curved wall and the nearest axis: 15°. Two thirds of a round tube are curved,
/// wherever it leads.
const CURVED: f64 = 0.26;

/// Returns `true` if most of a scene is curved or oblique, given triangles in the axes of the grid, so that there may be tubes. Most
/// of a building is flat and along the axes, even of one with vaults, and the search would take a quarter of its time.
pub(super) fn is_curved(triangles: &[Triangle]) -> bool {
    let (mut curved, mut all) = (0.0, 0.0);
    for t in triangles {
        let normal = triangle_area_normal(t);
        let (along, area) = (normal.abs().max_element(), normal.length());
        all += area;
        if area * area - along * along > (CURVED * area).powi(2) {
            curved += area;
        }
    }
    2.0 * curved > all
}

/// Splits the arms of forks off, in the labels of a flooded volume; returns the volume of the regions that had forks, and of all
/// rooms, zero if none had. Radii count from `least` on. [Units: wu]
pub(super) fn split_forks(
    grid: &Grid,
    Basins { labels, peaks, .. }: &mut Basins,
    regions: &mut Regions,
    field: DistanceField,
    walls: &Walls<'_>,
    least: f64,
    allowance: &Allowance,
) -> [f64; 2] {
    let places = find_places(grid, labels, regions, field, walls, least, allowance);
    let mut by_region: BTreeMap<u32, Vec<ForkPlace>> = BTreeMap::new();
    for place in places {
        let at = grid.voxel_at(place.center);
        let region = at.map_or(0, |at| regions.region_of_basin[labels.at(at) as usize]);
        if region > OUTDOORS {
            by_region.entry(region).or_default().push(place);
        }
    }
    let mut n_in_tubes = 0;
    for (region, mut places) in by_region {
        let is_in = |at: [usize; 3]| regions.region_of_basin[labels.at(at) as usize] == region;
        places.iter_mut().for_each(|p| p.widen(grid, &is_in));
        let pieces = ForkPieces::of(grid, labels, regions, region, &places);
        let (n_voxels, rooms) = pieces.rooms(grid, &places);
        if !rooms.is_empty() {
            n_in_tubes += n_voxels;
        }
        for (radius, voxels) in rooms {
            let basin = peaks.len() as u32;
            for (at, to) in voxels {
                for x in at[0]..to {
                    labels.set([x, at[1], at[2]], basin);
                }
            }
            peaks.push((radius / grid.voxel) as f32);
            regions.region_of_basin.push(basin);
            regions.limbs.insert(basin, None);
        }
    }
    if n_in_tubes == 0 {
        return [0.0; 2];
    }
    regions.contacts = contacts_of(regions, contact_faces(labels));
    let mut n_in_rooms = 0;
    labels.for_runs(0..labels.len(), |run, label| {
        if regions.region_of_basin[label as usize] > OUTDOORS {
            n_in_rooms += run.len();
        }
    });
    [n_in_tubes, n_in_rooms].map(|n| n as f64 * grid.voxel.powi(3))
}

/// Returns all forks; the balls to take out are disjoint.
fn find_places(
    grid: &Grid,
    labels: &Labels,
    regions: &Regions,
    field: DistanceField,
    walls: &Walls<'_>,
    least: f64,
    allowance: &Allowance,
) -> Vec<ForkPlace> {
    let mut found: Vec<ForkPlace> = Vec::new();
    if allowance.is_over() {
        return found;
    }
    let mut widest = field.widest_of_blocks();
    drop(field);
    let mut edge = 2;
    let mut least = least / grid.voxel;
    while widest.dims.iter().any(|&n| n > 1) {
        let most = BLOCKS * edge as f64;
        let balls = BlockBalls::of(
            grid,
            &widest,
            edge,
            [least, most],
            labels,
            regions,
            allowance,
        );
        let middles = balls.middles([least, most].map(|r| r * grid.voxel));
        for fork in find_forks(&balls, middles.into_iter(), walls) {
            let place = place_of(&balls, &fork);
            let is_near =
                |p: &ForkPlace| p.center.distance(place.center) < p.removed + place.removed;
            if !found.iter().any(is_near) {
                found.push(place);
            }
        }
        widest = widest.coarser();
        edge *= 2;
        least = most;
    }
    found
}

fn place_of(balls: &BlockBalls<'_>, fork: &Fork) -> ForkPlace {
    let center = balls.center(fork.part);
    let arms = fork.arms.iter().map(|arm| ForkArm {
        kind: arm.kind,
        radius: arm.radius,
        points: arm.parts.iter().map(|&t| balls.center(t)).collect(),
    });
    ForkPlace {
        center,
        radius: fork.radius,
        removed: fork.removed,
        arms: arms.collect(),
    }
}
