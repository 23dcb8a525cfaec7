//! The rooms that a decimation leaves, and which of its cells are not rooms.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_geom::{Allowance, Bvh, DVec3, Sets};
use rayon::prelude::*;

use super::cells::{Cells, OUTDOOR_CELL};
use super::space::{Space, connected};
use crate::structure::{BACKS, POINTS, count_backs, is_crevice};

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
        space: &Space,
        cells: &Cells,
        room_of_cell: &[u32],
        bvh: &Bvh,
        min_radius: f64,
        allowance: &Allowance,
    ) -> Self {
        let room_of_cell = void_joined(space, cells, room_of_cell, bvh, allowance);
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
        let hollow = hollow_rooms(
            space,
            cells,
            &room_of_cell,
            &patches,
            (bvh, min_radius),
            allowance,
        );
        Self {
            room_of_cell,
            patches,
            hollow,
        }
    }
}

/// Returns the number of rooms that a decimation left, and of other cells: crevices, and interiors of walls.
pub(super) fn count_rooms(
    space: &Space,
    cells: &Cells,
    room_of_cell: &[u32],
    bvh: &Bvh,
    min_radius: f64,
) -> [usize; 2] {
    let all = Allowance::default();
    let standing = Standing::of(space, cells, room_of_cell, bvh, min_radius, &all);
    let mut all: BTreeSet<u32> = standing.room_of_cell.into_iter().collect();
    all.remove(&OUTDOOR_CELL);
    let n_hollow = all.intersection(&standing.hollow).count();
    [all.len() - n_hollow, n_hollow]
}

/// Returns the room of each cell, with the void joined to the outdoors. If the outdoors sees backs, the model has
/// interiors only, and every other space that sees backs is part of the same void.
fn void_joined(
    space: &Space,
    cells: &Cells,
    room_of_cell: &[u32],
    bvh: &Bvh,
    allowance: &Allowance,
) -> Vec<u32> {
    let mut members: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (t, &c) in cells.cell_of_part.iter().enumerate() {
        members
            .entry(room_of_cell[c as usize])
            .or_default()
            .push(t as u32);
    }
    let void: BTreeSet<u32> = members
        .into_par_iter()
        .filter_map(|(room, mut tets)| {
            (share_of_backs(space, bvh, &mut tets, allowance) > BACKS).then_some(room)
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
/// backs of surfaces. Crevices are those of the watershed, too (`structure/backs.rs`).
fn hollow_rooms(
    space: &Space,
    cells: &Cells,
    room_of_cell: &[u32],
    patches: &[((u32, u32), Vec<u32>)],
    (bvh, min_radius): (&Bvh, f64),
    allowance: &Allowance,
) -> BTreeSet<u32> {
    let mut sets = Sets::new(room_of_cell.len());
    for ((a, b), _) in patches {
        sets.join(*a, *b);
    }
    let group_of = sets.into_least();
    let group_at = |t: usize| group_of[room_of_cell[cells.cell_of_part[t] as usize] as usize];
    let mut members: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    let mut radius: BTreeMap<u32, f64> = BTreeMap::new();
    for t in 0..space.middles.len() {
        let g = group_at(t);
        members.entry(g).or_default().push(t as u32);
        let r = radius.entry(g).or_insert(0.0);
        *r = r.max(space.radii[t]);
    }
    let share = |tets: &mut Vec<u32>| share_of_backs(space, bvh, tets, allowance);
    let (mut hollow, mut doubtful) = (BTreeSet::new(), Vec::new());
    let outdoor_group = group_of[OUTDOOR_CELL as usize];
    let mut outdoors = members.remove(&outdoor_group).unwrap_or_default();
    let trusted = share(&mut outdoors) < 0.1;
    let mut any_room = room_of_cell
        .iter()
        .any(|&r| group_of[r as usize] == outdoor_group && r != OUTDOOR_CELL);
    for (g, mut tets) in members {
        let widest = radius[&g];
        let back = share(&mut tets);
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

/// Returns the share of the rays from the largest of some tetrahedra that meet backs.
fn share_of_backs(space: &Space, bvh: &Bvh, tets: &mut [u32], allowance: &Allowance) -> f64 {
    // The largest represent a region: those at its surface are many and see little.
    tets.sort_by(|&a, &b| {
        space.volumes[b as usize]
            .total_cmp(&space.volumes[a as usize])
            .then(a.cmp(&b))
    });
    let largest = tets.iter().take(POINTS);
    let points: Vec<DVec3> = largest.map(|&t| space.middles[t as usize]).collect();
    let (back, all) = count_backs(bvh, &points, allowance);
    if all == 0.0 { 0.0 } else { back / all }
}
