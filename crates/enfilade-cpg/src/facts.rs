//! Facts of rooms that people ask for, as kept in worlds.

use crate::{CellId, CellPortalGraph, PortalKind};

/// Facts of a room that people ask for. [Units: wu, wu²]
#[derive(Clone, Debug, PartialEq)]
pub struct RoomFacts {
    /// The room.
    pub cell: CellId,
    /// Names of the storeys that it stands on, from below.
    pub storeys: Vec<String>,
    /// Area of its floors as seen from above, without the recesses of doors and windows.
    pub floor_area: f64,
    /// The part of that area where the room is 1.5 m high or more: half of what lies between this and 2.3 m counts as living
    /// space, under sloped ceilings.
    pub area_above_1_5: f64,
    /// The part where it is 2.3 m high or more.
    pub area_above_2_3: f64,
    /// Clear height over half of that area or more.
    pub height: f64,
    /// Number of its doors.
    pub n_doors: usize,
    /// Number of its windows.
    pub n_windows: usize,
}

/// Room for rounding: to the square millimeter. [Units: wu, wu²]
const ROUNDING: f64 = 1e-6;

impl RoomFacts {
    /// Returns the number of portals of a kind of a cell.
    #[doc(hidden)]
    #[must_use]
    pub fn n_portals(graph: &CellPortalGraph, cell: CellId, kind: PortalKind) -> usize {
        // A graph that is not checked yet may list portals that it lacks.
        let portals = (graph[cell].portals.iter()).filter_map(|p| graph.portals.get(p.idx()));
        portals.filter(|p| p.kind == kind).count()
    }

    /// Returns what is wrong with the facts of a graph's rooms, and the cell; `None` if nothing is. Areas and heights are not
    /// measured again.
    pub(crate) fn problem(
        facts: &[Self],
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
            let problem = own.own_problem(graph, room)?;
            Some((room, problem))
        })
    }

    fn own_problem(&self, graph: &CellPortalGraph, room: CellId) -> Option<&'static str> {
        if self.cell != room {
            return Some("they are not those of the rooms, ascending");
        }
        let areas = [self.floor_area, self.area_above_1_5, self.area_above_2_3];
        if !areas.iter().all(|a| a.is_finite() && *a >= 0.0) {
            return Some("an area is no area");
        }
        if !areas.is_sorted_by(|a, b| *a + ROUNDING >= *b) {
            return Some("the area of its high parts is larger than that of all");
        }
        let [min, max] = graph[room].aabb;
        // Boxes are of 32 bits, heights rounded to the millimeter.
        let highest = f64::from(max[1] - min[1]) + 0.01;
        if !(0.0..=highest).contains(&self.height) {
            return Some("the height is no height in its box");
        }
        let counts =
            [PortalKind::Door, PortalKind::Window].map(|k| Self::n_portals(graph, room, k));
        if counts != [self.n_doors, self.n_windows] {
            return Some("its doors and windows are not those of the graph");
        }
        None
    }
}
