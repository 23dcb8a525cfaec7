//! Parts that are taken out of a space, and come back: rooms of a level that is edited.
//!
//! Numbers of parts do not change, so that whoever keeps something by part goes on.

use std::sync::Arc;

use enfilade_cpg::World;
use enfilade_geom::Aabb;
use enfilade_runtime::SightState;

use super::{Change, Model, PartId, Space, SpaceError, sight_of};

impl Space {
    /// Takes a part out of the space: nothing sees, meets or hears it, and its doors lead nowhere, until
    /// [`Space::set_pose`] places it again. Its doors stay as they are. O(cells that it touches, parts beside it).
    ///
    /// # Errors
    ///
    /// If the part does not exist, is the root, or has parts that stand in it.
    pub fn withdraw(&mut self, part: PartId) -> Result<(), SpaceError> {
        self.check(part)?;
        if part == PartId::ROOT {
            return Err(SpaceError::RootMoved);
        }
        if let Some(guest) = self.parts[part.idx()].children.first() {
            return Err(SpaceError::HasGuests {
                part: part.0,
                guest: guest.0,
            });
        }
        let list = self.unsettle(part);
        self.part_from_all(part);
        let own = &mut self.parts[part.idx()];
        own.stands_in = list;
        own.is_present = false;
        for door in &mut own.doors {
            door.leads_to.clear();
        }
        let host = own.host;
        (self.parts[host.idx()].children).retain(|child| *child != part);
        self.neighbors.set(part.0, Aabb::EMPTY);
        self.changed(Change::Part(part));
        Ok(())
    }

    /// Withdraws a part for good: its world, and what was prepared from it, are dropped unless copies use them. Its number stays,
    /// with an empty world. O(parts); whoever keeps something derived from the space makes all of it again.
    ///
    /// # Errors
    ///
    /// As [`Space::withdraw`].
    pub fn forget(&mut self, part: PartId) -> Result<(), SpaceError> {
        self.withdraw(part)?;
        let nothing = Arc::new(World::default());
        let sight = sight_of(&nothing, part.0)?;
        let model = Model::new(nothing, sight);
        let own = &mut self.parts[part.idx()];
        own.state = SightState::new(&model.sight);
        (own.world, own.layout, own.sight) = (model.world, model.layout, model.sight);
        (own.walls, own.lines, own.hull) = (model.walls, model.lines, model.hull);
        own.border = None;
        (own.doors, own.guests, own.has_guests) = (Vec::new(), Vec::new(), Vec::new());
        self.n_cells = 0;
        for part in &mut self.parts {
            part.first_cell = self.n_cells as u32;
            self.n_cells += part.layout.n_cells();
        }
        self.changes.reset();
        Ok(())
    }

    /// Returns `false` for a part that is [withdrawn](Space::withdraw).
    #[must_use]
    pub fn is_present(&self, part: PartId) -> bool {
        self.parts[part.idx()].is_present
    }

    /// Makes a part present again that is about to be placed.
    pub(super) fn bring_back(&mut self, part: PartId) {
        let own = &mut self.parts[part.idx()];
        if std::mem::replace(&mut own.is_present, true) {
            return;
        }
        let host = own.host;
        let children = &mut self.parts[host.idx()].children;
        if let Err(at) = children.binary_search(&part) {
            children.insert(at, part);
        }
    }
}
