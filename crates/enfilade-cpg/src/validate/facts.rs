//! Facts of rooms that contradict each other or the graph.

use crate::{CellId, CellPortalGraph, PortalKind, RoomFacts};

/// Room for rounding: to the square millimeter. [Units: wu, wu²]
const ROUNDING: f64 = 1e-6;

/// Returns what is wrong with the facts of a graph's rooms, and the cell; `None` if nothing is. Areas and heights are not
/// measured again.
pub(super) fn problem(
    facts: &[RoomFacts],
    graph: &CellPortalGraph,
) -> Option<(CellId, &'static str)> {
    let rooms: Vec<CellId> = graph.rooms().map(|r| r.0).collect();
    if facts.len() != rooms.len() {
        let missing = rooms
            .iter()
            .zip(facts)
            .find(|(room, own)| own.cell != **room);
        let cell = missing.map_or(CellId(0), |(room, _)| *room);
        return Some((cell, "there are not as many as rooms"));
    }
    facts.iter().zip(rooms).find_map(|(own, room)| {
        let problem = own_problem(own, graph, room)?;
        Some((room, problem))
    })
}

/// Returns what is wrong with the facts of one room.
fn own_problem(own: &RoomFacts, graph: &CellPortalGraph, room: CellId) -> Option<&'static str> {
    if own.cell != room {
        return Some("they are not those of the rooms, ascending");
    }
    let areas = [own.floor_area, own.area_above_1_5, own.area_above_2_3];
    if !areas.iter().all(|a| a.is_finite() && *a >= 0.0) {
        return Some("an area is no area");
    }
    if !areas.is_sorted_by(|a, b| *a + ROUNDING >= *b) {
        return Some("the area of its high parts is larger than that of all");
    }
    let [min, max] = graph[room].aabb;
    // Boxes are of 32 bits, heights rounded to the millimeter.
    let highest = f64::from(max[1] - min[1]) + 0.01;
    if !(0.0..=highest).contains(&own.height) {
        return Some("the height is no height in its box");
    }
    let counts = [PortalKind::Door, PortalKind::Window].map(|k| graph.n_portals(room, k));
    if counts != [own.n_doors, own.n_windows] {
        return Some("its doors and windows are not those of the graph");
    }
    None
}
