//! Cells and portals as tables of comma-separated values (RFC 4180), with a line of names.

use std::borrow::Cow;
use std::fmt::Write;

use enfilade_cpg::{FittingPart, Portal, RoomFacts, World};

use super::{cell_kind, portal_kind};
use crate::room_facts;

/// Returns the cells of a world as a table: `id,name,kind,storey,floor_area,area_above_1_5,area_above_2_3,height,doors,windows,volume` and
/// the box. Other cells than rooms have no storey, areas, height, doors or windows.
#[must_use]
pub fn cells_csv(world: &World) -> String {
    let rooms = room_facts(world);
    cells_table(world, &rooms, |name| name.into())
}

/// Returns the table, given the facts of all rooms and what to write for a name.
pub(crate) fn cells_table(
    world: &World,
    rooms: &[RoomFacts],
    shown: impl Fn(&str) -> Cow<'_, str>,
) -> String {
    let mut out = String::from(
        "id,name,kind,storey,floor_area,area_above_1_5,area_above_2_3,height,doors,windows,volume,min_x,min_y,min_z,max_x,max_y,max_z\r\n",
    );
    for (id, cell) in world.graph.cells.iter().enumerate() {
        let (name, kind, volume) = (field(&shown(&cell.name)), cell_kind(cell), cell.volume);
        let [[x0, y0, z0], [x1, y1, z1]] = cell.aabb;
        let at = rooms.binary_search_by_key(&id, |r| r.cell.0 as usize);
        let room = at.ok().map(|at| &rooms[at]);
        let room = room.map_or(",,,,,,".to_owned(), |r| {
            let storeys = r.storeys.join(" ");
            format!(
                "{storeys},{:.3},{:.3},{:.3},{:.3},{},{}",
                r.floor_area, r.area_above_1_5, r.area_above_2_3, r.height, r.n_doors, r.n_windows
            )
        });
        let _ = write!(
            out,
            "{id},{name},{kind},{room},{volume},{x0},{y0},{z0},{x1},{y1},{z1}\r\n"
        );
    }
    out
}

/// Returns the portals of a world as a table: the two cells, the size, the middle and the normal, which points from the
/// first cell to the second; the names of the cells, and of the object that fills it: `IfcDoor/GlobalId` in models from IFC.
#[must_use]
pub fn portals_csv(world: &World) -> String {
    let mut out = String::from(
        "id,kind,cell_a,cell_b,width,height,area,x,y,z,nx,ny,nz,name_a,name_b,object\r\n",
    );
    for (id, portal) in world.graph.portals.iter().enumerate() {
        let [a, b] = portal.cells.map(|c| c.0);
        let (kind, [width, height]) = (portal_kind(portal.kind), portal.size());
        let ([x, y, z], [nx, ny, nz]) = (portal.center(), portal.normal);
        let area = portal.area;
        let [name_a, name_b] = portal.cells.map(|c| field(&world.graph[c].name));
        let object = field(filler(world, portal).unwrap_or_default());
        let _ = write!(
            out,
            "{id},{kind},{a},{b},{width},{height},{area},{x},{y},{z},{nx},{ny},{nz},{name_a},{name_b},{object}\r\n"
        );
    }
    out
}

/// Returns the name of the object that fills a portal: a leaf rather than a frame; that of the whole object if it was parted.
fn filler<'w>(world: &'w World, portal: &Portal) -> Option<&'w str> {
    let leaves = portal
        .fittings
        .iter()
        .filter(|f| f.part == FittingPart::Leaf);
    let first = leaves.chain(&portal.fittings).next()?;
    let object = world.details.get(first.detail as usize)?;
    let whole = object.part_of.and_then(|i| world.details.get(i as usize));
    Some(&whole.unwrap_or(object).name)
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
