//! The changes of a space, for those who keep something derived from it: things, lamps.
//!
//! Changes are numbered. A reader keeps the number up to which it is current, and reads the later ones at its next query, so
//! nobody needs to be told. The last ones are kept, as many as there are parts and some; a reader that is further behind starts
//! anew. O(1) for a change.

use std::collections::VecDeque;

use enfilade_cpg::{CellId, PortalId};

use super::{PartId, Space};

/// Changes kept besides one per part: more than doors move in a frame.
const MARGIN: usize = 4_096;

/// Something that has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    /// A part was added or moved, with everything that stands in it.
    Part(PartId),
    /// A portal was opened, closed or narrowed, or its leaves moved.
    Door(PartId, PortalId),
}

/// The last changes of a space.
#[derive(Clone, Debug, Default)]
pub(super) struct Changes {
    last: VecDeque<Change>,
    /// Number of all so far.
    n: u64,
}

impl Changes {
    pub(super) fn add(&mut self, change: Change, n_parts: usize) {
        let most = n_parts + MARGIN;
        while self.last.len() >= most {
            self.last.pop_front();
        }
        // At once, so that later changes allocate nothing.
        self.last.reserve(most - self.last.len());
        self.last.push_back(change);
        self.n += 1;
    }

    /// Records a change of everything.
    pub(super) fn reset(&mut self) {
        self.last.clear();
        self.n += 1;
    }
}

impl Space {
    /// Returns the changes after number `known`, the number of all so far, oldest first, or `None` if some are no longer kept;
    /// sets `known`.
    pub(crate) fn changes_since(
        &self,
        known: &mut u64,
    ) -> Option<impl Iterator<Item = Change> + use<'_>> {
        let last = &self.changes.last;
        let n_new = self.changes.n.checked_sub(*known);
        *known = self.changes.n;
        let n_new = n_new.filter(|n| *n <= last.len() as u64)?;
        Some(last.range(last.len() - n_new as usize..).copied())
    }

    /// Opens a portal of a part fully, and its leaves. As the other setters of doors, takes effect with the next query of
    /// anything, and ignores portals that do not exist.
    pub fn open(&mut self, part: PartId, portal: PortalId) {
        self.parts[part.idx()].state.open(portal);
        self.door_changed(part, portal);
    }

    /// Closes a portal of a part and shuts its leaves: nothing passes, not even light through leaves of glass.
    pub fn close(&mut self, part: PartId, portal: PortalId) {
        self.parts[part.idx()].state.close(portal);
        self.door_changed(part, portal);
    }

    /// Moves the leaves of a portal to a position between shut (0) and fully open (1). As
    /// [`SightState::set_leaves`](enfilade_runtime::SightState::set_leaves).
    pub fn set_leaves(&mut self, part: PartId, portal: PortalId, share: f32) {
        self.parts[part.idx()].state.set_leaves(portal, share);
        self.door_changed(part, portal);
    }

    /// Narrows a portal to one side of a plane. As [`SightState::narrow`](enfilade_runtime::SightState::narrow).
    pub fn narrow(&mut self, part: PartId, portal: PortalId, normal: [f32; 3], through: [f32; 3]) {
        self.parts[part.idx()].state.narrow(portal, normal, through);
        self.door_changed(part, portal);
    }

    /// Locks or unlocks a cell: nothing is seen in a locked cell from outside it.
    pub fn lock(&mut self, part: PartId, cell: CellId, locked: bool) {
        self.parts[part.idx()].state.lock(cell, locked);
        for i in 0..self.parts[part.idx()].layout.exits(cell).len() {
            let exit = self.parts[part.idx()].layout.exits(cell)[i];
            self.door_changed(part, exit.portal);
        }
    }

    fn door_changed(&mut self, part: PartId, portal: PortalId) {
        if portal.idx() < self.layout(part).n_portals() {
            self.changed(Change::Door(part, portal));
        }
    }

    pub(super) fn changed(&mut self, change: Change) {
        self.changes.add(change, self.parts.len());
    }
}
