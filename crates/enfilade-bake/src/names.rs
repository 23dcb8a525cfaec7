//! Names of cells, from those of the rooms that the scene names ([`Scene::rooms`](enfilade_geom::scene::Scene::rooms)), or
//! one by one in a finished world.
//!
//! Rooms of a model and cells rarely agree: an open kitchen and a living room are one cell, a hall with a doorway in its middle
//! is two. A name holds in a cell if half of its room lies there, or if half of the cell lies in its room.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use enfilade_cpg::{CellId, CellPortalGraph, World};
use enfilade_geom::scene::RoomName;
use enfilade_geom::shown;

/// Share of a room in a cell, or of a cell in a room, from which on the room's name holds in the cell.
const HOLDS: f64 = 0.5;
/// Least volume of a room that a cell is named after, beside a larger one, as a share of the larger.
const BESIDE: f64 = 0.1;
/// Most rooms in the name of one cell.
const MAX_JOINED: usize = 3;

/// Names the cells in which rooms lie, and notes their number and the names left over. Other cells keep their names.
///
/// A cell of several rooms has up to three of their names, the largest first: `Living / Kitchen`. A name that several cells would
/// have gets numbers: `Hall`, `Hall 2`. Outdoors has no name but one that someone set there.
pub(crate) fn name_cells(world: &mut World, notes: &mut Vec<String>, rooms: &[RoomName]) {
    let mut left_over = Vec::new();
    let mut parts: BTreeMap<CellId, BTreeMap<&str, f64>> = BTreeMap::new();
    for room in rooms.iter().filter(|r| !r.name.trim().is_empty()) {
        let mut shares: BTreeMap<CellId, f64> = BTreeMap::new();
        for point in &room.points {
            if let Some(cell) = world.graph.locator.locate(*point) {
                *shares.entry(cell).or_default() += room.volume;
            }
        }
        let whole = room.volume * room.points.len() as f64;
        let mut holds = false;
        for (cell, share) in shares {
            let known = &world.graph[cell];
            let is_in_cell = !known.outdoor && share >= HOLDS * whole;
            if is_in_cell || share >= HOLDS * f64::from(known.volume) {
                let names = parts.entry(cell).or_default();
                *names.entry(room.name.trim()).or_default() += share;
                holds = true;
            }
        }
        if !holds && room.volume < RoomName::BY_HAND {
            left_over.push(room.name.trim());
        }
    }
    let mut named: Vec<(f64, CellId, String)> = Vec::new();
    for (cell, names) in parts {
        let mut names: Vec<(&str, f64)> = names.into_iter().collect();
        names.sort_by(|a, b| b.1.total_cmp(&a.1).then_with(|| a.0.cmp(b.0)));
        let largest = names[0].1;
        names.retain(|n| n.1 >= BESIDE * largest);
        names.truncate(MAX_JOINED);
        let joined: Vec<&str> = names.iter().map(|n| n.0).collect();
        named.push((largest, cell, joined.join(" / ")));
    }
    named.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
    let n_named = named.len();
    let named: Vec<(CellId, String)> = named.into_iter().map(|(_, c, n)| (c, n)).collect();
    rename_cells(&mut world.graph, &named);
    let n_cells = world.graph.cells.len();
    if n_named > 0 {
        notes.push(format!("{n_named} of {n_cells} cells named after rooms"));
    }
    note_given(&world.graph, rooms, notes);
    if let Some(first) = left_over.first() {
        let n = left_over.len();
        notes.push(format!(
            "{n} of {} names of rooms left over, where a room and a cell differ too much: {}{}",
            rooms.len(),
            shown(first),
            if n > 1 { " and others" } else { "" }
        ));
    }
}

/// Renames cells, and returns the name of each in the same order.
///
/// Names in a world are unique: a name that another cell has, or that is the number of another cell (`cell-7`), gets a number
/// itself: `Hall 2`. Cells that are all renamed may exchange their names. O(cells + names).
///
/// # Panics
///
/// If a cell does not exist.
pub fn rename_cells(graph: &mut CellPortalGraph, names: &[(CellId, String)]) -> Vec<String> {
    let renamed: HashSet<CellId> = names.iter().map(|n| n.0).collect();
    let others = graph.cell_ids().filter(|c| !renamed.contains(c));
    let mut taken: HashSet<String> = others.map(|c| graph[c].name.clone()).collect();
    // Equal names continue where the last one ended, so that a thousand rooms of one name take no million tries.
    let mut next: BTreeMap<&str, usize> = BTreeMap::new();
    let mut given = Vec::with_capacity(names.len());
    for (cell, name) in names {
        let from = next.entry(name).or_insert(1);
        let free = loop {
            let numbered = match *from {
                1 => name.clone(),
                n => format!("{name} {n}"),
            };
            *from += 1;
            if !is_number_of_other(&numbered, *cell) && taken.insert(numbered.clone()) {
                break numbered;
            }
        };
        graph[*cell].name.clone_from(&free);
        given.push(free);
    }
    given
}

/// Tests if a name is the number of another cell.
pub(crate) fn is_number_of_other(name: &str, cell: CellId) -> bool {
    let number = name.strip_prefix("cell-");
    number.is_some_and(|n| n.parse::<u32>().is_ok_and(|n| n != cell.0))
}

/// Notes names for single points, which someone set, that do not name a room of their own.
fn note_given(graph: &CellPortalGraph, rooms: &[RoomName], notes: &mut Vec<String>) {
    let mut in_cell: BTreeMap<CellId, BTreeSet<&str>> = BTreeMap::new();
    let given = |r: &&RoomName| r.volume >= RoomName::BY_HAND && !r.name.trim().is_empty();
    for room in rooms.iter().filter(given) {
        for point in &room.points {
            let name = room.name.trim();
            let says = |place: &str| {
                let [x, y, z] = point.to_array();
                let name = shown(name);
                format!("the name '{name}' is for the point {x:.2} {y:.2} {z:.2}, {place}")
            };
            let Some(cell) = graph.locator.locate(*point) else {
                notes.push(says("which is in a wall or another solid, in no room"));
                continue;
            };
            if graph[cell].outdoor {
                notes.push(says("which is in no room: it names the outdoors"));
            } else if graph[cell].is_void {
                notes.push(says(
                    "which is in no room: it names a void, in which nobody can stand",
                ));
            }
            in_cell.entry(cell).or_default().insert(name);
        }
    }
    for (cell, names) in in_cell.into_iter().filter(|(_, names)| names.len() > 1) {
        let names: Vec<String> = names.iter().map(|n| format!("'{}'", shown(n))).collect();
        notes.push(format!(
            "{} are names for points in one room, {cell}, which is called '{}'",
            names.join(" and "),
            shown(&graph[cell].name)
        ));
    }
}
