//! Textures that show what changed lamps light.

use enfilade_cpg::CellId;
use enfilade_world::{PartId, Space};

use crate::lamps::{LampLight, MOST_LAMPS};
use crate::portal_textures::PortalTextures;
use crate::studio::Studio;

impl Studio {
    /// Drops the textures that show what lamps light that have changed since the last frame. Those made ahead wait until the
    /// lamps are as they were.
    pub(super) fn follow_texture_lamps(&mut self, own: &mut PortalTextures, space: Option<&Space>) {
        if own.lamps == self.lamps.lights {
            return;
        }
        let before = std::mem::replace(&mut own.lamps, self.lamps.lights.clone());
        match self.relit_cells(space, &before) {
            Some(cells) => own.drop_in(&cells),
            None => own.clear(),
        }
        if let Some(mut ahead) = own.ahead.take() {
            ahead.relit = self.relit_cells(space, &ahead.lamps);
            own.ahead = Some(ahead);
        }
    }

    /// Returns the cells of the first world that lamps reach which differ from those before; `None` if all may look different.
    fn relit_cells(&mut self, space: Option<&Space>, before: &[LampLight]) -> Option<Vec<CellId>> {
        let now = self.lamps.lights.clone();
        let mut cells = Vec::new();
        let n_parts = space.map_or(1, Space::n_parts) as u32;
        let most = self.lamps.options.most.min(MOST_LAMPS);
        for (some, others) in [(before, &now[..]), (&now[..], before)] {
            for lamp in some.iter().filter(|lamp| !others.contains(lamp)) {
                // A lamp that becomes brighter than others takes the place of one of them.
                if before.len().max(now.len()) > most {
                    return None;
                }
                if lamp.part.0 >= n_parts {
                    continue;
                }
                let (_, reach) = self.reached(space, lamp);
                let of_root = reach.into_iter().filter(|(id, _)| *id == PartId::ROOT);
                cells.extend(of_root.flat_map(|(_, cells)| cells));
            }
        }
        Some(cells)
    }
}
