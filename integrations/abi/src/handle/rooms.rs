//! Cells, and the facts of rooms.

use enfilade_cpg::CellId;

use super::{EnfWorld, item, refill, six};
use crate::answers::{EnfCell, EnfRoom};
use crate::status as s;
use crate::status::Failure;

impl EnfWorld {
    /// Describes a cell.
    ///
    /// # Errors
    ///
    /// If it does not exist.
    pub fn cell(&mut self, cell: u32) -> Result<EnfCell, Failure> {
        let c = item(&self.world.graph.cells, cell, "cell")?;
        refill(&mut self.cell_portals, &c.portals, |p| p.0);
        Ok(EnfCell {
            name: c.name.as_ptr().cast(),
            portals: self.cell_portals.as_ptr(),
            name_length: c.name.len() as u32,
            n_portals: self.cell_portals.len() as u32,
            kind: match (c.outdoor, c.is_void) {
                (true, _) => s::ENF_OUTDOORS,
                (false, true) => s::ENF_VOID,
                (false, false) => s::ENF_ROOM,
            },
            aabb: six(c.aabb),
            volume: c.volume,
        })
    }

    /// Returns the facts of a cell; `None` if it is not a room, or the file has no facts.
    ///
    /// # Errors
    ///
    /// If it does not exist.
    pub fn room(&mut self, cell: u32) -> Result<Option<EnfRoom>, Failure> {
        item(&self.world.graph.cells, cell, "cell")?;
        let facts = self.world.room_facts.as_deref().unwrap_or_default();
        let Ok(at) = facts.binary_search_by_key(&CellId(cell), |room| room.cell) else {
            return Ok(None);
        };
        let room = &facts[at];
        self.storeys = room.storeys.join(" ");
        Ok(Some(EnfRoom {
            storeys: self.storeys.as_ptr().cast(),
            storeys_length: self.storeys.len() as u32,
            floor_area: room.floor_area as f32,
            area_above_1_5: room.area_above_1_5 as f32,
            area_above_2_3: room.area_above_2_3 as f32,
            height: room.height as f32,
            n_doors: room.n_doors as u32,
            n_windows: room.n_windows as u32,
        }))
    }
}
