//! Worlds as plain data, for programs that read neither GLB nor our extension: the graph as JSON, GraphML, DOT or tables,
//! the surfaces as OBJ or as a scene for each set of cells.
//!
//! Lengths are in meters, +Y is up, right-handed, as in the world. Special portals, materials and light are left out.

mod files;
mod json;
mod obj;
mod tables;
mod text_graphs;

use enfilade_cpg::{Cell, CellId, CellPortalGraph, PortalKind};

pub use files::{SceneFile, SceneFiles};
pub use json::graph_json;
pub use obj::surfaces_obj;
#[cfg(feature = "page")]
pub(crate) use tables::cells_table;
pub use tables::{cells_csv, portals_csv};
pub use text_graphs::{graph_dot, graph_graphml};

/// Returns the name of a kind of portal, as all outputs write it.
fn portal_kind(kind: PortalKind) -> &'static str {
    match kind {
        PortalKind::Open => "open",
        PortalKind::Door => "door",
        PortalKind::Window => "window",
        PortalKind::Crack => "crack",
    }
}

/// Returns the name of a cell's kind.
fn cell_kind(cell: &Cell) -> &'static str {
    match cell {
        _ if cell.outdoor => "outdoors",
        _ if cell.is_void => "void",
        _ if cell.is_land => "land",
        _ => "room",
    }
}

/// Returns the cells on the other sides of a cell's portals, ascending, each once.
fn neighbors(graph: &CellPortalGraph, cell: CellId) -> Vec<CellId> {
    let portals = graph[cell].portals.iter();
    let others = portals.flat_map(|&p| graph[p].cells).filter(|&c| c != cell);
    let mut out: Vec<CellId> = others.collect();
    out.sort_unstable();
    out.dedup();
    out
}

#[cfg(test)]
mod tests;
