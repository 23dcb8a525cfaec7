//! Spaces beside a closed one, on the other side of its sheets.
//!
//! Where surfaces face either way, a box that stands in a hall and a suite without a way out look alike from within: sheets all
//! around. From without they do not: all around the box is the one hall, and the suite lies between other rooms, or between a room
//! and the outdoors. What is on the other side of one single sheet is a space if a person fits into it, though nothing more be known of
//! it: matter has no sheet inside, and two boxes side by side have one each. A sheet of a closed shell does not count: a solid that
//! reaches into another has one there.
//!
//! Cost: four walks through the voxels from each sample point, each with a ray through the sheet at its end.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_geom::{Allowance, Bvh, DVec3, Ray, in_closed_shells};

use super::regions::Regions;
use crate::judge::BETWEEN;
use crate::voxel::{Grid, Labels};

/// Spaces farther than this behind a surface are not beside it. [Units: wu]
const REACH: f64 = 0.5;

/// The surfaces of a scene.
pub(super) struct SheetTree<'a> {
    bvh: &'a Bvh,
    /// Triangles of closed shells.
    is_closed: Vec<bool>,
}

impl<'a> SheetTree<'a> {
    /// Tells closed shells from sheets. `n log n`.
    pub(super) fn of(bvh: &'a Bvh) -> Self {
        let is_closed = in_closed_shells(&bvh.to_triangles());
        Self { bvh, is_closed }
    }
}

/// Level walks out of a region that end in a region beside it, on the other side of a surface.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Walks {
    all: usize,
    /// Through one single sheet.
    single: usize,
}

/// The walks into each region.
pub(super) type Beside = BTreeMap<u32, Walks>;

/// Walks from points of a group of regions, ascending, in the axes of the grid, level and both ways.
pub(super) fn beside<'p>(
    grid: &Grid,
    labels: &Labels,
    SheetTree { bvh, is_closed }: &SheetTree<'_>,
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
            let (mut n_solid, mut own, mut last) = (0, region_at(at), at);
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
                    (n_solid, own, last) = (0, region, at);
                } else {
                    let [from, to] = [last, at].map(|[i, j, k]| grid.center(i, j, k));
                    let (mut n_sheets, mut n_closed) = (0, 0);
                    bvh.for_each_hit(&Ray::segment(from, to), |hit| {
                        n_sheets += 1;
                        n_closed += usize::from(is_closed[hit.triangle as usize]);
                    });
                    let walks = beside.entry(region).or_default();
                    walks.all += 1;
                    walks.single += usize::from((n_sheets, n_closed) == (1, 0));
                    break;
                }
            }
        }
    }
    beside
}

/// Spaces by what is known of them.
#[derive(Default)]
pub(super) struct Known {
    pub(super) air: BTreeSet<u32>,
    /// Closed ones that a person fits into.
    pub(super) sized: BTreeSet<u32>,
}

/// Returns the share of the walks that do not end where most do, of those that end in known air, in another region of the
/// group itself (a wall with an opening is in no solid), or behind one single sheet in a space that a person fits into.
fn others(group: &[u32], beside: &Beside, known: &Known) -> f64 {
    let counted = |(region, walks): (&u32, &Walks)| {
        if known.air.contains(region) || group.binary_search(region).is_ok() {
            walks.all
        } else if known.sized.contains(region) {
            walks.single
        } else {
            0
        }
    };
    let known = beside.iter().map(counted);
    let (all, most) = known.fold((0, 0), |(all, most), n| (all + n, most.max(n)));
    (all - most) as f64 / all.max(1) as f64
}

/// Returns for each closed group the share of its walks that do not end where most do, of those that end in air. A group that so
/// lies between spaces is air, which others may lie beside in turn.
pub(super) fn between(groups: &[(&[u32], &Beside)], mut known: Known) -> Vec<f64> {
    let mut share = vec![0.0; groups.len()];
    loop {
        let mut found: Vec<u32> = Vec::new();
        for (of, (group, beside)) in share.iter_mut().zip(groups) {
            if *of < BETWEEN {
                *of = others(group, beside, &known);
                if *of >= BETWEEN {
                    found.extend(*group);
                }
            }
        }
        if found.is_empty() {
            return share;
        }
        known.air.extend(found);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suites_between_known_spaces_make_those_beyond_them_known() {
        // A corridor (2) and the outdoors (1) are air. A suite lies between them, the next between it and the outdoors; a crate
        // stands in the corridor, and another in the first crate. Below, two rooms with a doorway have but the outdoors around them.
        let walks = |of: &[(u32, usize)]| {
            let of = of
                .iter()
                .map(|&(region, all)| (region, Walks { all, single: 0 }));
            of.collect::<Beside>()
        };
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
        let air = BTreeSet::from([1, 2]);
        let known = Known {
            air,
            ..Known::default()
        };
        let share = between(&groups, known);
        let are_between: Vec<bool> = share.iter().map(|s| *s >= BETWEEN).collect();
        assert_eq!(
            are_between,
            [true, true, false, false, false, false, true],
            "{share:?}"
        );
    }

    #[test]
    fn spaces_that_share_a_single_sheet_are_rooms_and_boxes_side_by_side_are_not() {
        // Outdoors (1), two closed spaces (2 and 3) with 20 of 80 walks from each into the other, and a crate (4) in the first.
        let of = |region, all, single| (region, Walks { all, single });
        let count = |single, sized: &[u32]| {
            let beside = [
                Beside::from([of(1, 60, 60), of(3, 20, single)]),
                Beside::from([of(1, 60, 60), of(2, 20, single)]),
                Beside::from([of(2, 80, 80)]),
            ];
            let regions: [&[u32]; 3] = [&[2], &[3], &[4]];
            let groups: Vec<_> = regions.into_iter().zip(&beside).collect();
            let known = Known {
                air: BTreeSet::from([1]),
                sized: sized.iter().copied().collect(),
            };
            let share = between(&groups, known);
            share.iter().filter(|s| **s >= BETWEEN).count()
        };
        assert_eq!(count(20, &[2, 3, 4]), 2, "one sheet between them");
        assert_eq!(count(2, &[2, 3, 4]), 0, "each has its own");
        assert_eq!(count(20, &[]), 0, "nobody fits into them");
    }
}
