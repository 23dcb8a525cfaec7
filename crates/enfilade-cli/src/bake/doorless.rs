//! Advice on rooms without a doorway: most often, their door leaf was taken for a wall.

use std::io::{self, Write};

use enfilade::cpg::{Cell, CellPortalGraph, PortalKind};

use crate::screen::At;

/// Rooms with a line.
const SHOWN: usize = 5;

/// Reports the rooms that have only windows and cracks, largest first. Returns `true` if there are any.
pub(super) fn write_doorless(out: &mut impl Write, graph: &CellPortalGraph) -> io::Result<bool> {
    let mut rooms: Vec<&Cell> = graph
        .rooms()
        .map(|(_, c)| c)
        .filter(|c| c.holds_person() && !has_doorway(graph, c))
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
        let at = At::of([0, 1, 2].map(|k| 0.5 * (cell.aabb[0][k] + cell.aabb[1][k])));
        writeln!(out, "  {}: {:.1} m³ around {at}", cell.name, cell.volume)?;
    }
    if rooms.len() > SHOWN {
        writeln!(out, "  and {} more", rooms.len() - SHOWN)?;
    }
    Ok(true)
}

fn has_doorway(graph: &CellPortalGraph, cell: &Cell) -> bool {
    cell.portals
        .iter()
        .any(|p| matches!(graph[*p].kind, PortalKind::Open | PortalKind::Door))
}
