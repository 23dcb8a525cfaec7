//! The state of spawned worlds.

use bevy::prelude::*;
use enfilade::{CellId, SightState};

use crate::labels::PortalRoot;

/// State of a spawned world: doors, and the entities of its detail objects and cells. On the entity of the [`PortalRoot`], once the world
/// has been loaded.
#[derive(Component, Debug)]
pub struct PortalState {
    /// The state of doors; everything is open at first. [`Door`](crate::Door)s write to it.
    pub doors: SightState,
    pub(crate) details: Vec<Option<Entity>>,
    pub(crate) cells: Vec<Option<Entity>>,
    /// Grows with each set-up of any world, so that caches of older versions of a file are known.
    pub(crate) revision: u32,
}

impl PortalState {
    /// Returns the entity of a detail object, if it is spawned.
    #[must_use]
    pub fn detail(&self, detail: u32) -> Option<Entity> {
        self.details.get(detail as usize).copied().flatten()
    }

    /// Returns the entity of a cell's node, if it is spawned.
    #[must_use]
    pub fn cell(&self, cell: CellId) -> Option<Entity> {
        self.cells.get(cell.idx()).copied().flatten()
    }
}

/// A spawned world that is ready, as systems ask for it.
pub(crate) type Roots<'a> = (Entity, &'a PortalRoot, &'a PortalState, &'a GlobalTransform);
