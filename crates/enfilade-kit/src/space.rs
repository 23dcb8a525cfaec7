//! Levels as spaces: instances that share worlds, and everything prepared from them.

use std::collections::BTreeMap;

use enfilade_cpg::{Cell, CellId, Locator, World};
use enfilade_world::{PartId, Space, SpaceError};

use crate::assembly::Assembly;
use crate::instance::{InstanceId, Link};

/// A level as a space: each instance is a part in an empty world that is all outdoors.
pub struct LevelSpace {
    /// The parts; each docks where its attachments are joined.
    pub space: Space,
    /// The part of each instance.
    pub parts: BTreeMap<InstanceId, PartId>,
    /// Per piece, its first part, which later instances copy.
    first: BTreeMap<usize, PartId>,
}

impl LevelSpace {
    /// Makes a space without instances.
    ///
    /// # Errors
    ///
    /// None for the empty world; as [`Space::new`].
    pub fn new() -> Result<Self, SpaceError> {
        let mut open = World::default();
        open.graph.cells.push(Cell {
            name: "outdoors".into(),
            outdoor: true,
            ..Cell::default()
        });
        open.graph.locator = Locator {
            outside: Some(CellId(0)),
            ..Locator::default()
        };
        Ok(Self {
            space: Space::new(open)?,
            parts: BTreeMap::new(),
            first: BTreeMap::new(),
        })
    }

    /// Adds an instance of a level. The first one of a piece prepares it; others take O(cells and portals of the piece). Doorways in
    /// front of walls are closed.
    ///
    /// # Errors
    ///
    /// As [`Space::add_part`].
    ///
    /// # Panics
    ///
    /// If there never was such an instance.
    pub fn add(&mut self, level: &Assembly, id: InstanceId) -> Result<PartId, SpaceError> {
        let instance = level.instance(id);
        let part = match self.first.get(&instance.piece) {
            Some(&first) => (self.space).add_copy(first, PartId::ROOT, instance.pose)?,
            None => {
                let world = level.piece(id).world().clone();
                let part = self.space.add_part(world, PartId::ROOT, instance.pose)?;
                self.first.insert(instance.piece, part);
                part
            }
        };
        self.parts.insert(id, part);
        for other in level.beside(id).into_iter().chain([id]) {
            let Some(&part) = self.parts.get(&other) else {
                continue;
            };
            let links = level
                .piece(other)
                .attachments()
                .iter()
                .zip(&level.instance(other).links);
            for (attachment, _) in links.filter(|l| matches!(l.1, Link::Blocked(_))) {
                self.space.close(part, attachment.portal);
            }
        }
        Ok(part)
    }
}

impl Assembly {
    /// Returns the level as a space, in which sight, sound, paths and things pass from instance to instance.
    ///
    /// # Errors
    ///
    /// As [`Space::add_part`].
    pub fn space(&self) -> Result<LevelSpace, SpaceError> {
        let mut level = LevelSpace::new()?;
        for (id, _) in self.instances() {
            level.add(self, id)?;
        }
        Ok(level)
    }
}
