//! Which regions are rooms, and which are the insides of walls.
//!
//! The hollow between the two faces of a wall is as empty as a room. It is told apart by two things:
//! nothing can get in, and from inside one sees the backs of the surfaces. What is connected with the
//! outdoors through openings is always air. Closed models with their faces turned inside out, and
//! models without consistent faces, must not lose their rooms: a region that nothing can get into is
//! dropped only when it is narrow, or when the scene's faces can be trusted because the outdoors sees
//! fronts.
//!
//! Cost: 14 rays from up to 32 points of each region that nothing can get into.

use std::collections::BTreeMap;

use enfilade_geom::{Bvh, DVec3, Ray, Sets};
use rayon::prelude::*;

use crate::voxel::{Grid, Labels};

use super::regions::{OUTDOORS, Regions};

/// Regions in which no ball of this radius fits are dropped when most rays see backs. [Units: wu]
const NARROW: f64 = 0.5;
/// Points that ask around in each region.
const POINTS: usize = 32;

/// The region labels that are no rooms, ascending: solid matter, and closed-off spaces in which no
/// ball of `min_radius` fits (bays between rafters, gaps in the construction). What of the latter
/// leaks into a room is part of that room after all: the cell complex sees to it.
#[must_use]
pub fn hollow_regions(
    grid: &Grid,
    labels: &Labels,
    regions: &Regions,
    peaks: &[f32],
    bvh: &Bvh,
    min_radius: f64,
) -> Vec<u32> {
    let enclosed = enclosed_groups(regions);
    let mut radius: BTreeMap<u32, f32> = BTreeMap::new();
    for (basin, &region) in regions.region_of_basin.iter().enumerate() {
        let r = radius.entry(region).or_insert(0.0);
        *r = r.max(peaks[basin]);
    }
    let wanted: Vec<u32> = enclosed
        .iter()
        .flatten()
        .copied()
        .chain([OUTDOORS])
        .collect();
    let points = sample_points(grid, labels, regions, &wanted);
    let backs: BTreeMap<u32, (f64, f64)> = points
        .par_iter()
        .map(|(&region, at)| (region, count_backs(bvh, at)))
        .collect::<Vec<_>>()
        .into_iter()
        .collect();
    let share = |group: &[u32]| {
        let (back, all) = group
            .iter()
            .filter_map(|r| backs.get(r))
            .fold((0.0, 0.0), |(b, a), &(back, all)| (b + back, a + all));
        if all == 0.0 { 0.0 } else { back / all }
    };
    let trusted = share(&[OUTDOORS]) < 0.1;
    let mut hollow: Vec<u32> = Vec::new();
    let mut doubtful: Vec<u32> = Vec::new();
    let mut any_room = enclosed.len() < n_groups(regions);
    for group in &enclosed {
        // A voxel center next to a wall is already half a voxel away from it at least.
        let widest = group
            .iter()
            .map(|r| f64::from(radius[r]) - 0.5)
            .fold(0.0, f64::max)
            * grid.voxel;
        let back = share(group);
        if widest < min_radius || (back > 0.6 && widest < NARROW) {
            hollow.extend(group);
        } else if back > 0.9 && trusted {
            doubtful.extend(group);
        } else {
            any_room = true;
        }
    }
    // A closed shell of a building, with nothing modelled inside, is a building and not a boulder.
    if any_room {
        hollow.extend(doubtful);
    }
    hollow.sort_unstable();
    hollow
}

/// Groups of regions that open to each other but not, over any number of openings, to outdoors.
fn enclosed_groups(regions: &Regions) -> Vec<Vec<u32>> {
    groups(regions)
        .into_iter()
        .filter(|g| g[0] != OUTDOORS)
        .collect()
}

/// Number of groups besides the one of the outdoors alone.
fn n_groups(regions: &Regions) -> usize {
    groups(regions)
        .iter()
        .filter(|g| g.as_slice() != [OUTDOORS])
        .count()
}

fn groups(regions: &Regions) -> Vec<Vec<u32>> {
    let n = regions.region_of_basin.len();
    let mut sets = Sets::new(n);
    for &(a, b) in regions.contacts.keys() {
        sets.join(a, b);
    }
    let mut groups: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    let mut seen = vec![false; n];
    for &region in &regions.region_of_basin {
        if region != 0 && !std::mem::replace(&mut seen[region as usize], true) {
            groups.entry(sets.find(region)).or_default().push(region);
        }
    }
    groups.into_values().collect()
}

/// Up to [`POINTS`] voxel centers of each wanted region, evenly picked in scan order.
fn sample_points(
    grid: &Grid,
    labels: &Labels,
    regions: &Regions,
    wanted: &[u32],
) -> BTreeMap<u32, Vec<DVec3>> {
    let mut is_wanted = vec![false; regions.region_of_basin.len()];
    for &r in wanted {
        is_wanted[r as usize] = true;
    }
    let mut count: BTreeMap<u32, usize> = BTreeMap::new();
    let region_at = |i: usize| regions.region_of_basin[labels.get(i) as usize];
    for i in 0..labels.len() {
        let region = region_at(i);
        if is_wanted[region as usize] {
            *count.entry(region).or_default() += 1;
        }
    }
    let mut seen: BTreeMap<u32, usize> = BTreeMap::new();
    let mut points: BTreeMap<u32, Vec<DVec3>> = BTreeMap::new();
    for i in 0..labels.len() {
        let region = region_at(i);
        if !is_wanted[region as usize] {
            continue;
        }
        let step = count[&region].div_ceil(POINTS);
        let k = seen.entry(region).or_default();
        if *k % step == step / 2 {
            let [x, y, z] = grid.coords(i);
            points.entry(region).or_default().push(grid.center(x, y, z));
        }
        *k += 1;
    }
    points
}

/// Rays that meet a back, and rays that meet anything.
pub(super) fn count_backs(bvh: &Bvh, points: &[DVec3]) -> (f64, f64) {
    let mut directions = Vec::new();
    for x in -1..=1 {
        for y in -1..=1 {
            for z in -1..=1 {
                let d = DVec3::new(f64::from(x), f64::from(y), f64::from(z));
                if d.length_squared() == 1.0 || d.length_squared() == 3.0 {
                    // Off the axes a little, so that rays do not run along edges.
                    directions.push(d + DVec3::new(0.013, 0.007, -0.011));
                }
            }
        }
    }
    let (mut back, mut all) = (0.0, 0.0);
    for &p in points {
        for &direction in &directions {
            let ray = Ray {
                origin: p,
                direction,
                t_max: f64::INFINITY,
            };
            if let Some(hit) = bvh.closest_hit(&ray, |_| false) {
                all += 1.0;
                back += f64::from(u8::from(!hit.front));
            }
        }
    }
    (back, all)
}
