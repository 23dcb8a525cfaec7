//! Low spaces that nobody walks into: above hung ceilings, below raised floors, among rafters.
//!
//! Beams, ribs and ducts divide such a space into dozens of regions, and lamps and grilles open it to the rooms below. As it
//! is one space to whoever crawls there, its regions are joined across everything that is open between them, before
//! candidates are fitted to what lies between. They are never joined with a room.
//!
//! A region is low if nobody can stand anywhere in it, and if no doorway leads into it from a region in which somebody can:
//! the rule of [`crate::void`], which decides in the end, as far as voxels show it.
//!
//! Cost: linear in voxels.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_geom::{Allowance, Sets};
use rayon::prelude::*;

use super::flooded::Faces;
use super::regions::Regions;
use super::slabs::LAYERS;
use crate::judge::DOORWAY;
use crate::structure::OUTDOORS;
use crate::void::{STANDING, STEP, WIDTH};
use crate::voxel::{Grid, Labels};

/// Joins the regions of low spaces that touch, in the labels of a flooded volume.
pub(super) fn join_low(grid: &Grid, labels: &Labels, regions: &mut Regions, allowance: &Allowance) {
    let low = low_regions(grid, labels, regions, allowance);
    let mut sets = Sets::new(regions.region_of_basin.len());
    for (a, b) in regions.contacts.keys() {
        if low.contains(a) && low.contains(b) {
            sets.join(*a, *b);
        }
    }
    let stands_for = sets.into_least();
    regions.rename(|region| stands_for[region as usize]);
}

/// Returns the regions in which nobody stands and into which no doorway leads.
fn low_regions(
    grid: &Grid,
    labels: &Labels,
    regions: &Regions,
    allowance: &Allowance,
) -> BTreeSet<u32> {
    let headroom = headroom(grid, labels, regions, allowance);
    let all = 0..headroom.len() as u32;
    let mut low: BTreeSet<u32> = all
        .filter(|&r| r > OUTDOORS && headroom[r as usize] > 0)
        .filter(|&r| !is_high(grid, headroom[r as usize]))
        .collect();
    let leads_in = |(&(a, b), faces): (&(u32, u32), &Faces)| {
        let is_any_low = low.contains(&a) || low.contains(&b);
        (is_any_low && is_doorway(grid, labels, faces)).then_some((a, b))
    };
    let doorways: Vec<(u32, u32)> = regions.contacts.par_iter().filter_map(leads_in).collect();
    loop {
        let n = low.len();
        for &(a, b) in &doorways {
            if !(low.contains(&a) && low.contains(&b)) {
                low.remove(&a);
                low.remove(&b);
            }
        }
        if low.len() == n {
            return low;
        }
    }
}

/// Returns `true` if one can stand in so many voxels one above the other.
fn is_high(grid: &Grid, n_voxels: usize) -> bool {
    n_voxels as f64 * grid.voxel >= STANDING
}

/// Returns the greatest number of voxels one above the other in each region but the outdoors, at least of those that are not
/// high.
fn headroom(grid: &Grid, labels: &Labels, regions: &Regions, allowance: &Allowance) -> Vec<usize> {
    let [nx, ny, nz] = grid.dims;
    let region_of = |label: u32| regions.region_of_basin[label as usize];
    let n = regions.region_of_basin.len();
    let zero = || vec![0_usize; n];
    let of_layer = |mut most: Vec<usize>, z: usize| {
        // The region of each column so far, and for how many voxels.
        let mut column = vec![(0_u32, 0_usize); nx];
        for y in 0..ny {
            if !allowance.spend(1 + nx as u64 / 16) {
                break;
            }
            let from = grid.index(0, y, z);
            labels.for_runs(from..from + nx, |run, label| {
                let here = region_of(label);
                let columns = &mut column[run.start - from..run.end - from];
                let most = &mut most[here as usize];
                if here <= OUTDOORS || is_high(grid, *most) {
                    columns.fill((here, 0));
                    return;
                }
                for (region, height) in columns {
                    *height = if here == *region { *height + 1 } else { 1 };
                    *region = here;
                    *most = (*most).max(*height);
                }
            });
        }
        most
    };
    let greater = |mut a: Vec<usize>, b: Vec<usize>| {
        for (a, b) in a.iter_mut().zip(b) {
            *a = (*a).max(b);
        }
        a
    };
    let layers = (0..nz).into_par_iter().with_min_len(LAYERS);
    layers.fold(zero, of_layer).reduce(zero, greater)
}

/// Returns `true` if an upright opening among `faces` begins at the floor of both its sides and is large enough.
fn is_doorway(grid: &Grid, labels: &Labels, faces: &Faces) -> bool {
    let mut columns: BTreeMap<[usize; 3], Vec<usize>> = BTreeMap::new();
    for &face in faces {
        let axis = (face % 4) as usize;
        if axis != 1 {
            let [x, y, z] = grid.coords((face / 4) as usize);
            columns.entry([axis, x, z]).or_default().push(y);
        }
    }
    let has_floor = |[axis, x, z]: [usize; 3], y: usize| {
        let below = (STEP / grid.voxel).round() as usize + 1;
        let mut beside = [x, z];
        beside[axis / 2] += 1;
        [[x, z], beside]
            .iter()
            .all(|&[x, z]| (1..=below.min(y)).any(|d| labels.at([x, y - d, z]) == 0))
    };
    let least = (DOORWAY / grid.voxel).round() as usize;
    let is_wide = |(at, heights): (&[usize; 3], &mut Vec<usize>)| {
        heights.sort_unstable();
        let runs = heights.chunk_by(|a, b| a + 1 == *b);
        let mut high = runs.filter(|run| run.len() >= least);
        high.any(|run| has_floor(*at, run[0]))
    };
    let n_wide = columns.iter_mut().map(is_wide).filter(|w| *w).count();
    n_wide as f64 * grid.voxel >= WIDTH
}
