//! The doors of a space: each setter records the change for those who depend on it.

use enfilade_cpg::{CellId, PortalId};
use enfilade_runtime::SightState;

use super::{Change, PartId, Space};
use crate::saved::{SavedError, SavedPose, SavedSpace};

impl Space {
    /// Returns the changes after number `known`, oldest first, or `None` if some are no longer kept; sets `known` to the number
    /// of all so far.
    pub(crate) fn changes_since(
        &self,
        known: &mut u64,
    ) -> Option<impl Iterator<Item = Change> + use<'_>> {
        self.changes.since(known)
    }

    /// Marks the parts that have moved after change number `known`, with all that stand in them; all parts if these changes were
    /// dropped, or `known` is `None`. Sets `known` to the number of all so far; returns `true` if any has moved.
    pub(crate) fn moved_since(&self, known: &mut Option<u64>, moved: &mut Vec<bool>) -> bool {
        if *known == Some(self.changes.number()) {
            return false;
        }
        let is_new = known.is_none();
        moved.clear();
        moved.resize(self.n_parts(), is_new);
        match self.changes_since(known.get_or_insert(0)) {
            None => moved.fill(true),
            Some(changes) => {
                for change in changes {
                    if let Change::Part(part) = change {
                        self.mark(part, moved);
                    }
                }
            }
        }
        moved.contains(&true)
    }

    fn mark(&self, part: PartId, moved: &mut [bool]) {
        moved[part.idx()] = true;
        for &child in &self.parts[part.idx()].children {
            self.mark(child, moved);
        }
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

    /// Answers a question with the leaves of a portal elsewhere; they stay where they are.
    pub(crate) fn with_leaves<T>(
        &mut self,
        part: PartId,
        portal: PortalId,
        share: f32,
        question: impl FnOnce(&Self) -> T,
    ) -> T {
        let before = self.state(part).leaves(portal);
        self.parts[part.idx()].state.set_leaves(portal, share);
        let answer = question(self);
        if let Some(before) = before {
            self.parts[part.idx()].state.set_leaves(portal, before);
        }
        answer
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

    /// Replaces the state of all doors of a part, such as by one kept from before.
    ///
    /// # Panics
    ///
    /// If the state is not of the part's world.
    #[doc(hidden)]
    pub fn set_state(&mut self, part: PartId, state: SightState) {
        let known = &mut self.parts[part.idx()].state;
        assert_eq!(
            known.shares().len(),
            state.shares().len(),
            "a state of another world"
        );
        *known = state;
        self.changes.reset();
    }

    /// Returns the poses and doors of all parts as plain values.
    #[must_use]
    pub fn saved(&self) -> SavedSpace {
        let parts = self.parts.iter();
        let parts = parts.map(|p| (SavedPose::new(&p.local), p.state.saved()));
        SavedSpace {
            parts: parts.collect(),
        }
    }

    /// Restores poses and doors; the parts themselves must have been added.
    ///
    /// # Errors
    ///
    /// If the state is of another space, or a pose is not a rigid motion.
    pub fn restore(&mut self, saved: &SavedSpace) -> Result<(), SavedError> {
        let (n, own) = (saved.parts.len(), self.parts.len());
        if n != own {
            return Err(SavedError::Parts { saved: n, own });
        }
        for (part, (pose, doors)) in (0..).zip(&saved.parts) {
            let index = part as usize;
            let state = &mut self.parts[index].state;
            let known = state.restore(doors);
            known.map_err(|source| SavedError::Doors { part, source })?;
            let what = "part";
            let bad = |_| SavedError::NotFinite { what, index };
            if part > 0 {
                self.set_pose(PartId(part), pose.pose()).map_err(bad)?;
            }
        }
        self.changes.reset();
        Ok(())
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
