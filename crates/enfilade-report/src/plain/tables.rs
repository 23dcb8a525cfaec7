//! Cells and portals as tables of comma-separated values (RFC 4180), with a line of names.

use std::fmt::Write;

use enfilade_cpg::World;

use super::{cell_kind, portal_kind};

/// Returns the cells of a world as a table: `id,name,kind,volume` and the box.
#[must_use]
pub fn cells_csv(world: &World) -> String {
    let mut out = String::from("id,name,kind,volume,min_x,min_y,min_z,max_x,max_y,max_z\r\n");
    for (id, cell) in world.graph.cells.iter().enumerate() {
        let (name, kind, volume) = (field(&cell.name), cell_kind(cell), cell.volume);
        let [[x0, y0, z0], [x1, y1, z1]] = cell.aabb;
        let _ = write!(
            out,
            "{id},{name},{kind},{volume},{x0},{y0},{z0},{x1},{y1},{z1}\r\n"
        );
    }
    out
}

/// Returns the portals of a world as a table: the two cells, the size, the middle and the normal, which points from the
/// first cell to the second.
#[must_use]
pub fn portals_csv(world: &World) -> String {
    let mut out = String::from("id,kind,cell_a,cell_b,width,height,area,x,y,z,nx,ny,nz\r\n");
    for (id, portal) in world.graph.portals.iter().enumerate() {
        let [a, b] = portal.cells.map(|c| c.0);
        let (kind, [width, height]) = (portal_kind(portal.kind), portal.size());
        let ([x, y, z], [nx, ny, nz]) = (portal.center(), portal.normal);
        let area = portal.area;
        let _ = write!(
            out,
            "{id},{kind},{a},{b},{width},{height},{area},{x},{y},{z},{nx},{ny},{nz}\r\n"
        );
    }
    out
}

/// Returns text as one field.
fn field(text: &str) -> String {
    // A spreadsheet takes what begins with these signs for a formula.
    let text = if text.starts_with(['=', '+', '-', '@']) {
        format!("'{text}")
    } else {
        text.to_owned()
    };
    if text.contains(['"', ',', '\r', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text
    }
}
