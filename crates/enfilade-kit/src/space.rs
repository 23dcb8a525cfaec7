//! Levels as spaces: instances that share worlds, and everything prepared from them.

use std::collections::BTreeMap;

use enfilade_cpg::{Cell, CellId, Locator, World};
use enfilade_world::{PartId, Space, SpaceError};

use crate::assembly::Assembly;
use crate::instance::{Instance, InstanceId};
use crate::kit::Kit;

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

    /// Adds an instance. The first one of a piece prepares it; others take O(cells and portals of the piece).
    ///
    /// # Errors
    ///
    /// As [`Space::add_part`].
    pub fn add(
        &mut self,
        kit: &Kit,
        id: InstanceId,
        instance: &Instance,
    ) -> Result<PartId, SpaceError> {
        let part = match self.first.get(&instance.piece) {
            Some(&first) => self.space.add_copy(first, PartId::ROOT, instance.pose)?,
            None => {
                let world = kit.pieces()[instance.piece].world().clone();
                let part = self.space.add_part(world, PartId::ROOT, instance.pose)?;
                self.first.insert(instance.piece, part);
                part
            }
        };
        self.parts.insert(id, part);
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
        for (id, instance) in self.instances() {
            level.add(self.kit(), id, instance)?;
        }
        Ok(level)
    }
}
