//! Spaces beside a closed one, on the other side of its sheets.
//!
//! Where surfaces face either way, a box that stands in a hall and a suite without a way out look alike from within: sheets all
//! around. From without they do not: all around the box is the one hall, and the suite lies between other rooms, or between a room
//! and the outdoors.
//!
//! Cost: four walks through the voxels from each sample point.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_geom::{Allowance, DVec3};

use super::regions::Regions;
use crate::judge::BETWEEN;
use crate::voxel::{Grid, Labels};

/// Spaces farther than this behind a surface are not beside it. [Units: wu]
const REACH: f64 = 0.5;

/// Number of level walks out of a region that end in each region beside it, on the other side of a surface.
pub(super) type Beside = BTreeMap<u32, usize>;

/// Walks from points of a group of regions, ascending, in the axes of the grid, level and both ways.
pub(super) fn beside<'p>(
    grid: &Grid,
    labels: &Labels,
    regions: &Regions,
    group: &[u32],
    points: impl Iterator<Item = &'p DVec3>,
    allowance: &Allowance,
) -> Beside {
    let region_at = |at: [usize; 3]| regions.region_of_basin[labels.at(at) as usize];
    let reach = (REACH / grid.voxel).ceil() as usize;
    let mut beside = Beside::new();
    for p in points {
        for (axis, forward) in [(0, true), (0, false), (2, true), (2, false)] {
            let Some(mut at) = grid.voxel_at(*p) else {
                continue;
            };
            let (mut n_solid, mut own) = (0, region_at(at));
            while n_solid <= reach && allowance.spend(1) {
                let next = if forward {
                    Some(at[axis] + 1).filter(|&c| c < grid.dims[axis])
                } else {
                    at[axis].checked_sub(1)
                };
                let Some(next) = next else { break };
                at[axis] = next;
                let region = region_at(at);
                if region == 0 {
                    n_solid += 1;
                } else if group.binary_search(&region).is_ok() && (n_solid == 0 || region == own) {
                    (n_solid, own) = (0, region);
                } else {
                    *beside.entry(region).or_default() += 1;
                    break;
                }
            }
        }
    }
    beside
}

/// Returns the share of the walks that do not end where most do, of those that end in known air, or in another region of the
/// group itself: a wall with an opening is in no solid.
fn others(group: &[u32], beside: &Beside, air: &BTreeSet<u32>) -> f64 {
    let is_known = |region: &u32| air.contains(region) || group.binary_search(region).is_ok();
    let known = beside.iter().filter(|b| is_known(b.0)).map(|b| *b.1);
    let (all, most) = known.fold((0, 0), |(all, most), n| (all + n, most.max(n)));
    (all - most) as f64 / all.max(1) as f64
}

/// Returns for each closed group the share of its walks that do not end where most do, of those that end in air. A group that so
/// lies between spaces is air, which others may lie beside in turn.
pub(super) fn between(groups: &[(&[u32], &Beside)], mut air: BTreeSet<u32>) -> Vec<f64> {
    let mut share = vec![0.0; groups.len()];
    loop {
        let mut found: Vec<u32> = Vec::new();
        for (of, (group, beside)) in share.iter_mut().zip(groups) {
            if *of < BETWEEN {
                *of = others(group, beside, &air);
                if *of >= BETWEEN {
                    found.extend(*group);
                }
            }
        }
        if found.is_empty() {
            return share;
        }
        air.extend(found);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suites_between_known_spaces_make_those_beyond_them_known() {
        // A corridor (2) and the outdoors (1) are air. A suite lies between them, the next between it and the outdoors; a crate
        // stands in the corridor, and another in the first crate. Below, two rooms with a doorway have but the outdoors around them.
        let walks = |of: &[(u32, usize)]| of.iter().copied().collect::<Beside>();
        let beside = [
            walks(&[(1, 60), (2, 20)]),
            walks(&[(1, 60), (3, 10)]),
            walks(&[(2, 80)]),
            walks(&[(5, 40)]),
            walks(&[(1, 92), (2, 8)]),
            walks(&[]),
            walks(&[(1, 60), (9, 12), (10, 12)]),
        ];
        let regions: [&[u32]; 7] = [&[3], &[4], &[5], &[6], &[7], &[8], &[9, 10]];
        let groups: Vec<_> = regions.into_iter().zip(&beside).collect();
        let share = between(&groups, BTreeSet::from([1, 2]));
        let are_between: Vec<bool> = share.iter().map(|s| *s >= BETWEEN).collect();
        assert_eq!(
            are_between,
            [true, true, false, false, false, false, true],
            "{share:?}"
        );
    }
}
