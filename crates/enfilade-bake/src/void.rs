//! Tells voids from rooms: spaces in which nobody can stand and into which no doorway leads, such as those above hung
//! ceilings, among rafters, in shafts, ducts and hollow walls.
//!
//! Measured on the finished partition, so it is the same for all builders. A cellar with a low ceiling and a door is a room,
//! a crawl space with a hatch is a void.
//!
//! Where nobody can stand in any cell, the scene is not a building on the scale of people (a vessel, a model in another
//! unit), and none is a void. Nor is one where most of the air is in tubes that meet.
//!
//! Cost: up to `MAX_COLUMNS`² walks down the locator's tree for each cell.

use enfilade_cpg::{CellId, Locator, Reason, Why};
use enfilade_geom::{Aabb, Allowance, DVec3, Sets, is_rather_level};
use rayon::prelude::*;

use crate::budget::WORK_A_LOOK;
use crate::complex::{Label, Partition, PartitionPortal};
use crate::judge::SpaceFacts;

/// Least height in which somebody stands: that of a low door. [Units: wu]
pub(crate) const STANDING: f64 = 2.0;
/// Least width of a doorway. [Units: wu]
pub(crate) const WIDTH: f64 = 0.4;
/// Greatest step up or down at a doorway. [Units: wu]
pub(crate) const STEP: f64 = 0.4;
/// Distance from a doorway's plane, beyond the face of a thick wall, at which its floor is looked for. [Units: wu]
const BEYOND: f64 = 0.6;
/// Spacing of the columns in which heights are measured. Somebody stands on two by two: half a meter. [Units: wu]
const SPACING: f64 = 0.25;
/// Most columns along a side of a cell; larger cells have wider spacing.
const MAX_COLUMNS: f64 = 128.0;

/// Labels the voids of a partition as such, and returns for each cell why it is a room or a void. Cells of one region that open to each other are one space, since slits and
/// hatches divide what is one to a builder.
pub(crate) fn mark_voids(partition: &mut Partition, allowance: &Allowance) -> Vec<Why> {
    let n = partition.label_of_cell.len();
    let mut sets = Sets::new(n);
    for portal in &partition.portals {
        let [a, b] = portal.cells;
        if partition.label_of_cell[a as usize] == partition.label_of_cell[b as usize] {
            sets.join(a, b);
        }
    }
    let space_of = sets.into_least();
    let measured = (0..n).into_par_iter().map(|c| {
        let (cell, bounds) = (CellId(c as u32), &partition.aabbs[c]);
        let is_outside = partition.outside == Some(c as u32);
        (!is_outside).then(|| facts_of(&partition.locator, cell, bounds, allowance))
    });
    let mut facts = vec![Some(SpaceFacts::default()); n];
    for (found, &space) in measured.collect::<Vec<_>>().into_iter().zip(&space_of) {
        let sum = facts[space as usize].take();
        facts[space as usize] = sum.zip(found).map(|(sum, found)| sum.and(&found));
    }
    if facts.iter().flatten().all(SpaceFacts::is_low) {
        let unscaled =
            |f: &Option<SpaceFacts>| Why::given(f.map_or(Reason::Outside, |_| Reason::Unscaled));
        return space_of
            .iter()
            .map(|&s| unscaled(&facts[s as usize]))
            .collect();
    }
    let doorways = partition.portals.iter().filter_map(|p| {
        let (height, stands) = doorway_of(p, &partition.locator)?;
        Some(Doorway {
            spaces: p.cells.map(|c| space_of[c as usize] as usize),
            height,
            stands,
        })
    });
    settle(&mut facts, &doorways.collect::<Vec<_>>(), allowance);
    for (label, &space) in partition.label_of_cell.iter_mut().zip(&space_of) {
        if let Some(region) = label.region()
            && facts[space as usize].is_some_and(|f| f.is_void())
        {
            *label = Label::Void(region);
        }
    }
    let why = |&space: &u32| {
        let facts = facts[space as usize];
        facts.map_or(Why::given(Reason::Outside), |f| f.why())
    };
    space_of.iter().map(why).collect()
}

/// An upright opening that begins at a floor on both sides.
struct Doorway {
    spaces: [usize; 2],
    /// [Units: wu]
    height: f64,
    /// `true` for a side on which somebody can stand before it. A hall may reach up beside the space above its neighbors.
    stands: [bool; 2],
}

/// Enters the doorways between spaces in their facts, over any number of low rooms in a row. Outdoors has no facts.
fn settle(facts: &mut [Option<SpaceFacts>], doorways: &[Doorway], allowance: &Allowance) {
    let mut is_settled = false;
    while !is_settled && allowance.spend(1 + doorways.len() as u64 / 16) {
        is_settled = true;
        for doorway in doorways {
            for side in 0..2 {
                let from = facts[doorway.spaces[side]];
                let comes = match from {
                    Some(from) if from.is_low() => !from.is_void(),
                    _ => doorway.stands[side],
                };
                if let Some(to) = &mut facts[doorway.spaces[1 - side]]
                    && comes
                    && to.doorway < doorway.height
                {
                    to.doorway = doorway.height;
                    is_settled = false;
                }
            }
        }
    }
}

/// Measures a cell, all but its doorways.
fn facts_of(locator: &Locator, cell: CellId, bounds: &Aabb, allowance: &Allowance) -> SpaceFacts {
    let size = bounds.size();
    let spacing = SPACING.max(size.x.max(size.z) / MAX_COLUMNS);
    // A little more, since boxes are rounded.
    let along = |side: f64| ((side / spacing + 0.01) as usize).max(1);
    let [nx, nz] = [along(size.x), along(size.z)];
    let first =
        bounds.center() - DVec3::new(nx as f64 - 1.0, 0.0, nz as f64 - 1.0) * (spacing / 2.0);
    let mut heights = vec![0.0; nx * nz];
    for (k, height) in heights.iter_mut().enumerate() {
        if !allowance.spend(2 * WORK_A_LOOK) {
            break;
        }
        let p = first + DVec3::new((k % nx) as f64, 0.0, (k / nx) as f64) * spacing;
        *height = headroom(locator, cell, p, [bounds.min.y, bounds.max.y]);
    }
    let is_high = |x: usize, z: usize| heights[x + z * nx] >= STANDING;
    let mut stands = vec![false; nx * nz];
    for z in 1..nz {
        for x in 1..nx {
            let square = [(x - 1, z - 1), (x, z - 1), (x - 1, z), (x, z)];
            if square.iter().all(|&(x, z)| is_high(x, z)) {
                square.iter().for_each(|(x, z)| stands[x + z * nx] = true);
            }
        }
    }
    let area = |n: usize| n as f64 * spacing * spacing;
    SpaceFacts {
        floor: area(heights.iter().filter(|h| **h > 0.0).count()),
        standing: area(stands.iter().filter(|s| **s).count()),
        doorway: 0.0,
    }
}

/// Returns the length of the longest part of a vertical line, through `p` and between two heights, that lies in a cell.
/// [Units: wu]
fn headroom(locator: &Locator, cell: CellId, p: DVec3, [low, high]: [f64; 2]) -> f64 {
    let wanted = Locator::leaf(Some(cell));
    let (mut longest, mut run) = (0.0_f64, [f64::NEG_INFINITY; 2]);
    // Parts of the line, the lowest last.
    let mut stack = vec![(locator.root, low, high)];
    while let Some((at, low, high)) = stack.pop() {
        if at < 0 {
            if at == wanted {
                let begin = if run[1] == low { run[0] } else { low };
                run = [begin, high];
                longest = longest.max(high - begin);
            }
            continue;
        }
        let node = &locator.nodes[at as usize];
        let [x, y, z, d] = locator.planes[node.plane as usize];
        let level = x * p.x + z * p.z + d;
        let [below, above] = [low, high].map(|h| usize::from(level + y * h < 0.0));
        if below == above {
            stack.push((node.children[below], low, high));
        } else {
            let cut = (-level / y).clamp(low, high);
            stack.push((node.children[above], cut, high));
            stack.push((node.children[below], low, cut));
        }
    }
    longest
}

/// Returns the height of a doorway, an upright opening, wide enough, that begins at a floor on both sides, and on which of
/// them somebody can stand; `None` for all other portals. [Units: wu]
fn doorway_of(portal: &PartitionPortal, locator: &Locator) -> Option<(f64, [bool; 2])> {
    let along = DVec3::Y.cross(portal.plane.normal);
    let range = |d: DVec3| {
        let at = portal.outline.points.iter().map(|q| d.dot(*q));
        at.fold([f64::MAX, f64::MIN], |[lo, hi], t| [lo.min(t), hi.max(t)])
    };
    let ([left, right], [low, high]) = (range(along.normalize_or_zero()), range(DVec3::Y));
    if is_rather_level(portal.plane.normal) || right - left < WIDTH {
        return None;
    }
    let ahead = along.cross(DVec3::Y).normalize() * BEYOND;
    let sides = |share: f64| {
        let aside = along.normalize() * ((share - 0.5) * (right - left));
        let foot = (portal.outline.centroid() + aside).with_y(low);
        [(0, foot - ahead), (1, foot + ahead)].map(|(k, p)| (CellId(portal.cells[k]), p))
    };
    let has_floor = |&(cell, p): &(CellId, DVec3)| {
        let cell_at = |h: f64| locator.locate(p + DVec3::Y * h);
        cell_at(STEP) == Some(cell) && cell_at(-STEP) != Some(cell)
    };
    let mut at = [0.25, 0.5, 0.75].into_iter().map(sides);
    let sides = at.find(|sides| sides.iter().all(has_floor))?;
    let about = [low - STEP, low + STANDING + STEP];
    let stands = sides.map(|(cell, p)| headroom(locator, cell, p, about) >= STANDING);
    Some((high - low, stands))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_doorway_makes_a_room_of_a_low_space_only_from_where_somebody_comes() {
        let low = SpaceFacts {
            floor: 9.0,
            standing: 0.0,
            doorway: 0.0,
        };
        let high = SpaceFacts {
            standing: 9.0,
            ..low
        };
        // Cells 1 and 2 in a row from room 0, 3 and 4 apart from it, 5 through a hatch.
        let mut facts = [high, low, low, low, low, low].map(Some);
        let doorway = |spaces, height| Doorway {
            spaces,
            height,
            stands: [true; 2],
        };
        let doorways = [
            doorway([2, 1], 1.6),
            doorway([0, 1], 1.5),
            doorway([3, 4], 1.6),
            doorway([0, 5], 0.8),
        ];
        let voids = |facts: [Option<SpaceFacts>; 6]| facts.map(|f| f.is_some_and(|f| f.is_void()));
        settle(&mut facts, &doorways, &Allowance::default());
        assert_eq!(voids(facts), [false, false, false, true, true, true]);
        // Nobody stands in the high room where it meets the low ones: it reaches over its neighbors.
        let mut facts = [high, low, low, low, low, low].map(Some);
        let reaching = doorways.map(|d| Doorway {
            stands: [false; 2],
            ..d
        });
        settle(&mut facts, &reaching, &Allowance::default());
        assert_eq!(voids(facts), [false, true, true, true, true, true]);
        // The outdoors has no facts, and people.
        let mut facts = [None, Some(low)];
        settle(&mut facts, &[doorway([0, 1], 1.3)], &Allowance::default());
        assert!(facts[1].is_some_and(|f| !f.is_void()));
    }
}
