//! The cell that an entity is in, and events when it enters and leaves one.

use bevy::prelude::*;
use enfilade::{CellId, Follower, PortalId, Step};

use crate::labels::PortalRoot;
use crate::space::into_root;
use crate::state::{PortalState, Roots};
use crate::world::PortalWorld;

/// The cell that an entity is in, kept up to date. Put it on cameras, characters, sounds: anything with a `Transform`.
///
/// Triggers [`CellEntered`] and [`CellLeft`]. In solid matter, it keeps the last cell.
#[derive(Component, Default, Debug)]
#[require(Transform)]
pub struct CurrentCell {
    /// The entity with the [`PortalRoot`] of the world that it is in.
    pub root: Option<Entity>,
    /// The cell; `None` before it is first in one.
    pub cell: Option<CellId>,
    follower: Option<Follower>,
    revision: u32,
}

/// An entity with a [`CurrentCell`] entered a cell. For observers and for message readers.
#[derive(EntityEvent, Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellEntered {
    /// The entity.
    pub entity: Entity,
    /// The entity with the [`PortalRoot`].
    pub root: Entity,
    /// The cell.
    pub cell: CellId,
    /// The portal that it came through; `None` if it began there, or came through a wall or from nowhere.
    pub portal: Option<PortalId>,
}

/// An entity with a [`CurrentCell`] left a cell. For observers and for message readers.
#[derive(EntityEvent, Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellLeft {
    /// The entity.
    pub entity: Entity,
    /// The entity with the [`PortalRoot`].
    pub root: Entity,
    /// The cell.
    pub cell: CellId,
    /// The portal that it left through; `None` if it went through a wall or was put elsewhere.
    pub portal: Option<PortalId>,
}

/// Follows entities from cell to cell.
pub(crate) fn track_cells(
    mut commands: Commands,
    mut tracked: Query<(Entity, &GlobalTransform, &mut CurrentCell)>,
    roots: Query<Roots>,
    worlds: Res<Assets<PortalWorld>>,
    mut entered: MessageWriter<CellEntered>,
    mut left: MessageWriter<CellLeft>,
) {
    for (entity, place, mut current) in &mut tracked {
        let before = (current.root, current.cell);
        let own = current.bypass_change_detection();
        let crossed = own.follow(place.translation(), &roots, &worlds);
        let after = (own.root, own.cell);
        if before == after {
            continue;
        }
        current.set_changed();
        if let (Some(root), Some(cell)) = before {
            let portal = crossed.map(|c| c.0);
            let event = CellLeft {
                entity,
                root,
                cell,
                portal,
            };
            left.write(event);
            commands.trigger(event);
        }
        if let (Some(root), Some(cell)) = after {
            let portal = crossed.map(|c| c.1);
            let event = CellEntered {
                entity,
                root,
                cell,
                portal,
            };
            entered.write(event);
            commands.trigger(event);
        }
    }
}

impl CurrentCell {
    /// Moves to a point of the engine's space; returns the first and last portals passed.
    fn follow(
        &mut self,
        at: Vec3,
        roots: &Query<Roots>,
        worlds: &Assets<PortalWorld>,
    ) -> Option<(PortalId, PortalId)> {
        let in_root =
            |(root, own, state, place): (Entity, &PortalRoot, &PortalState, &GlobalTransform)| {
                let p = into_root(place)?.transform_point3(at).to_array();
                Some((root, state.revision, worlds.get(&own.world)?, p))
            };
        let known = self.root.and_then(|r| roots.get(r).ok()).and_then(in_root);
        if let (Some((_, revision, world, p)), Some(follower)) = (known, &mut self.follower)
            && revision == self.revision
        {
            let step = follower.step(&world.sight, p);
            self.cell = follower.cell();
            let crossed = follower.crossed();
            let ends = crossed.first().copied().zip(crossed.last().copied());
            if step != Step::Lost {
                return ends;
            }
        }
        let found = roots.iter().filter_map(in_root);
        let mut found = found.filter(|(.., world, p)| world.sight.locate(*p).is_some());
        if let Some((root, revision, world, p)) = found.next() {
            let follower = Follower::new(&world.sight, p);
            (self.root, self.cell) = (Some(root), follower.cell());
            (self.follower, self.revision) = (Some(follower), revision);
        }
        None
    }
}
