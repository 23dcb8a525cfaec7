//! The rooms that a decimation leaves, and which of its cells are not rooms.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Mutex;

use enfilade_geom::{Allowance, Bvh, DVec3, Sets};
use rayon::prelude::*;

use super::cells::{Cells, OUTDOOR_CELL};
use super::space::{Space, connected};
use crate::judge::{BACKS, is_crevice};
use crate::structure::{POINTS, count_backs};

/// The rooms that decimation left, and the cells that are not rooms.
pub(super) struct Standing {
    /// Room of each cell; the void belongs to the outdoors.
    pub(super) room_of_cell: Vec<u32>,
    /// Openings between two rooms: links that touch each other.
    pub(super) patches: Vec<((u32, u32), Vec<u32>)>,
    /// Rooms that are interiors of walls and solids.
    pub(super) hollow: BTreeSet<u32>,
}

impl Standing {
    pub(super) fn of(
        air: &CellSpace<'_>,
        room_of_cell: &[u32],
        min_radius: f64,
        allowance: &Allowance,
    ) -> Self {
        let CellSpace { space, cells, .. } = *air;
        let room_of_cell = void_joined(air, room_of_cell, None, allowance);
        let mut between: BTreeMap<(u32, u32), Vec<u32>> = BTreeMap::new();
        for (&(a, b), portal) in &cells.portals {
            let (a, b) = (room_of_cell[a as usize], room_of_cell[b as usize]);
            if a != b {
                // Slivers cut off by tetrahedra are ignored.
                let wide = |l: &&u32| !space.is_crack(&space.links[**l as usize]);
                between
                    .entry((a.min(b), a.max(b)))
                    .or_default()
                    .extend(portal.links.iter().filter(wide));
            }
        }
        let patches: Vec<((u32, u32), Vec<u32>)> = between
            .into_iter()
            .flat_map(|(pair, links)| {
                connected(space, &links)
                    .into_iter()
                    .map(move |patch| (pair, patch))
            })
            .collect();
        let pairs = patches.iter().map(|(pair, _)| *pair);
        let hollow = hollow_rooms(air, &room_of_cell, pairs, min_radius, None, allowance);
        Self {
            room_of_cell,
            patches,
            hollow,
        }
    }
}

/// The air, its cells and the surfaces around, with what counting asks of each cell again and again.
#[derive(Clone, Copy)]
pub(super) struct CellSpace<'a> {
    pub(super) space: &'a Space,
    pub(super) cells: &'a Cells,
    pub(super) bvh: &'a Bvh,
    pub(super) largest: &'a LargestParts,
}

/// The largest parts of each cell, largest first, which represent it: those at its surface are many and see little.
pub(super) struct LargestParts(Vec<Vec<u32>>);

impl LargestParts {
    pub(super) fn of(space: &Space, cells: &Cells) -> Self {
        let mut parts = vec![Vec::new(); cells.radii.len()];
        for (t, &c) in cells.cell_of_part.iter().enumerate() {
            parts[c as usize].push(t as u32);
        }
        for of_cell in &mut parts {
            keep_largest(space, of_cell);
            of_cell.shrink_to_fit();
        }
        Self(parts)
    }

    /// Returns the largest parts of each group of cells.
    fn of_groups(&self, space: &Space, group_of_cell: &[u32]) -> BTreeMap<u32, Vec<u32>> {
        let mut groups: Vec<Vec<u32>> = vec![Vec::new(); self.0.len()];
        for (parts, &group) in self.0.iter().zip(group_of_cell) {
            let all = &mut groups[group as usize];
            all.extend(parts);
            // The largest of all are among the largest of some.
            if all.len() > MANY * POINTS {
                keep_largest(space, all);
            }
        }
        let is_group: BTreeSet<u32> = group_of_cell.iter().copied().collect();
        let largest = is_group.into_iter().map(|group| {
            let mut parts = std::mem::take(&mut groups[group as usize]);
            keep_largest(space, &mut parts);
            (group, parts)
        });
        largest.collect()
    }
}

/// Parts that are sorted at once, in units of those that are kept.
const MANY: usize = 32;

fn keep_largest(space: &Space, parts: &mut Vec<u32>) {
    parts.sort_by(|&a, &b| {
        space.volumes[b as usize]
            .total_cmp(&space.volumes[a as usize])
            .then(a.cmp(&b))
    });
    parts.truncate(POINTS);
}

/// Shares of backs that were counted before, by the parts from which they were: most rooms are the same at the next
/// step.
#[derive(Default)]
pub(super) struct KnownBacks(Mutex<BTreeMap<Vec<u32>, f64>>);

/// Returns the number of rooms that a decimation left, and of other cells: crevices, and interiors of walls.
pub(super) fn count_rooms(
    air: &CellSpace<'_>,
    room_of_cell: &[u32],
    min_radius: f64,
    known: &KnownBacks,
) -> [usize; 2] {
    let unlimited = Allowance::default();
    let room_of_cell = void_joined(air, room_of_cell, Some(known), &unlimited);
    let room = |c: u32| room_of_cell[c as usize];
    let portals = air.cells.portals.iter();
    let pairs = portals.filter_map(|(&(a, b), portal)| {
        let [a, b] = [room(a), room(b)];
        let is_wide = |l: &u32| !air.space.is_crack(&air.space.links[*l as usize]);
        (a != b && portal.links.iter().any(is_wide)).then_some((a, b))
    });
    let pairs: BTreeSet<(u32, u32)> = pairs.collect();
    let rooms = (&room_of_cell[..], pairs.into_iter());
    let hollow = hollow_rooms(air, rooms.0, rooms.1, min_radius, Some(known), &unlimited);
    let mut all: BTreeSet<u32> = room_of_cell.into_iter().collect();
    all.remove(&OUTDOOR_CELL);
    let n_hollow = all.intersection(&hollow).count();
    [all.len() - n_hollow, n_hollow]
}

/// Returns the room of each cell, with the void joined to the outdoors. If the outdoors sees backs, the model has
/// interiors only, and every other space that sees backs is part of the same void.
fn void_joined(
    air: &CellSpace<'_>,
    room_of_cell: &[u32],
    known: Option<&KnownBacks>,
    allowance: &Allowance,
) -> Vec<u32> {
    let members = air.largest.of_groups(air.space, room_of_cell);
    let void: BTreeSet<u32> = members
        .into_par_iter()
        .filter_map(|(room, parts)| {
            (share_of_backs(air, parts, known, allowance) > BACKS).then_some(room)
        })
        .collect();
    let room = |&r: &u32| {
        if void.contains(&OUTDOOR_CELL) && void.contains(&r) {
            OUTDOOR_CELL
        } else {
            r
        }
    };
    room_of_cell.iter().map(room).collect()
}

/// Returns the rooms that are not rooms but interiors of walls and solids: nothing can enter them, and they see the
/// backs of surfaces. Crevices are those of the watershed, too (`structure/backs.rs`). `pairs` are the rooms that an
/// opening joins.
fn hollow_rooms(
    air: &CellSpace<'_>,
    room_of_cell: &[u32],
    pairs: impl Iterator<Item = (u32, u32)>,
    min_radius: f64,
    known: Option<&KnownBacks>,
    allowance: &Allowance,
) -> BTreeSet<u32> {
    let mut sets = Sets::new(room_of_cell.len());
    for (a, b) in pairs {
        sets.join(a, b);
    }
    let group_of = sets.into_least();
    let group_of_cell: Vec<u32> = room_of_cell.iter().map(|r| group_of[*r as usize]).collect();
    let mut members = air.largest.of_groups(air.space, &group_of_cell);
    let mut radius: BTreeMap<u32, f64> = BTreeMap::new();
    for (group, own) in group_of_cell.iter().zip(&air.cells.radii) {
        let r = radius.entry(*group).or_insert(0.0);
        *r = r.max(*own);
    }
    let share = |parts: Vec<u32>| share_of_backs(air, parts, known, allowance);
    let (mut hollow, mut doubtful) = (BTreeSet::new(), Vec::new());
    let outdoor_group = group_of[OUTDOOR_CELL as usize];
    let outdoors = members.remove(&outdoor_group).unwrap_or_default();
    let trusted = share(outdoors) < 0.1;
    let mut any_room = room_of_cell
        .iter()
        .any(|&r| group_of[r as usize] == outdoor_group && r != OUTDOOR_CELL);
    for (g, parts) in members {
        let widest = radius[&g];
        let back = share(parts);
        if is_crevice(widest, min_radius, back) {
            hollow.insert(g);
        } else if back > 0.9 && trusted {
            doubtful.push(g);
        } else {
            any_room = true;
        }
    }
    // A closed shell of a building with nothing modeled inside is a building, not a boulder.
    if any_room {
        hollow.extend(doubtful);
    }
    let rooms = room_of_cell.iter().copied();
    rooms
        .filter(|&r| hollow.contains(&group_of[r as usize]))
        .collect()
}

/// Returns the share of the rays from some parts that meet backs. What is `known` was counted without limits.
fn share_of_backs(
    air: &CellSpace<'_>,
    parts: Vec<u32>,
    known: Option<&KnownBacks>,
    allowance: &Allowance,
) -> f64 {
    let locked = || known.and_then(|known| known.0.lock().ok());
    if let Some(share) = locked().and_then(|known| known.get(&parts).copied()) {
        return share;
    }
    let points = parts.iter().map(|&t| air.space.middles[t as usize]);
    let points: Vec<DVec3> = points.collect();
    let (back, all) = count_backs(air.bvh, &points, allowance);
    let share = if all == 0.0 { 0.0 } else { back / all };
    if let Some(mut known) = locked() {
        known.insert(parts, share);
    }
    share
}
