//! Advice on scenes without rooms, and on rooms without a doorway: most often, their door leaf was taken for a wall.

use std::io::{self, Write};

use enfilade::cpg::{Cell, CellPortalGraph, PortalKind};

/// Rooms with a line.
const SHOWN: usize = 5;
/// Lower or narrower cells are ducts and hollow walls: too small for a person. [Units: wu]
const PERSON: [f32; 3] = [0.6, 1.8, 0.6];

/// Reports the rooms that have only windows and cracks, largest first. Returns `true` if there are any.
pub(super) fn write_doorless(out: &mut impl Write, graph: &CellPortalGraph) -> io::Result<bool> {
    let mut rooms: Vec<&Cell> = graph
        .rooms()
        .map(|(_, c)| c)
        .filter(|c| is_room(c) && !has_doorway(graph, c))
        .collect();
    if rooms.is_empty() {
        return Ok(false);
    }
    rooms.sort_by(|a, b| b.volume.total_cmp(&a.volume));
    let (n, noun) = match rooms.len() {
        1 => (1, "room has"),
        n => (n, "rooms have"),
    };
    writeln!(
        out,
        "{n} {noun} no doorway: if door leaves are objects of their own, \
         use --detail-name 'PATTERN' (-v prints names)"
    )?;
    for cell in rooms.iter().take(SHOWN) {
        let [x, y, z] = [0, 1, 2].map(|k| 0.5 * (cell.aabb[0][k] + cell.aabb[1][k]));
        writeln!(
            out,
            "  {}: {:.1} m³ around {x:.2} {y:.2} {z:.2}",
            cell.name, cell.volume
        )?;
    }
    if rooms.len() > SHOWN {
        writeln!(out, "  and {} more", rooms.len() - SHOWN)?;
    }
    Ok(true)
}

/// Reports that a scene has no room, with the usual reasons. Returns `true` if so.
pub(super) fn write_roomless(out: &mut impl Write, graph: &CellPortalGraph) -> io::Result<bool> {
    if graph.indoor_cells().next().is_some() {
        return Ok(false);
    }
    let size = graph
        .cells
        .first()
        .map_or([0.0; 3], |c| [0, 1, 2].map(|k| c.aabb[1][k] - c.aabb[0][k]));
    let [x, y, z] = size;
    writeln!(
        out,
        "no room was found: all air in these {x:.1} × {y:.1} × {z:.1} m is open to the outdoors. If that size is wrong, give \
         --unit or --up; if rooms have openings as wide as they are, nothing divides them; if their walls \
         were taken for furniture, look with -v and use --structural-name 'PATTERN'"
    )?;
    Ok(true)
}

fn is_room(cell: &Cell) -> bool {
    (0..3).all(|k| cell.aabb[1][k] - cell.aabb[0][k] >= PERSON[k])
}

fn has_doorway(graph: &CellPortalGraph, cell: &Cell) -> bool {
    cell.portals
        .iter()
        .any(|p| matches!(graph[*p].kind, PortalKind::Open | PortalKind::Door))
}
