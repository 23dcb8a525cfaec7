//! Doors: a portal, its leaves, and how far they are open.

use bevy::prelude::*;
use enfilade::{DetailId, PortalId};

use crate::labels::{PortalRoot, WorldDetail};
use crate::state::PortalState;
use crate::world::PortalWorld;

/// The door of a portal. One is spawned for each portal with leaves, at the middle of its opening.
///
/// Set [`Door::target`], and the leaves turn or slide there at [`Door::speed`]. A shut door hides what is behind, unless one
/// sees through a leaf. Until a door has moved, its leaves stand as modeled and it hides nothing, as doors are mostly modeled
/// shut and gaps around their leaves may show the room behind.
///
/// For a portal without leaves, such as a curtain or a force field, spawn one yourself: at 0 the portal is closed.
#[derive(Component, Reflect, Clone, Debug)]
#[reflect(Component)]
pub struct Door {
    /// The entity with the [`PortalRoot`].
    #[entities]
    pub root: Entity,
    /// Index of the portal.
    pub portal: u32,
    /// Position of the leaves, from shut (0) to fully open (1).
    pub share: f32,
    /// Position that the leaves move to.
    pub target: f32,
    /// Shares of the whole way per second.
    pub speed: f32,
}

impl Door {
    /// Makes the door of a portal, at rest at `share`.
    #[must_use]
    pub fn new(root: Entity, portal: PortalId, share: f32) -> Self {
        Self {
            root,
            portal: portal.0,
            share,
            target: share,
            speed: 1.5,
        }
    }

    /// Returns the portal.
    #[must_use]
    pub fn id(&self) -> PortalId {
        PortalId(self.portal)
    }

    /// Opens it if it is shut or closing, otherwise shuts it.
    pub fn toggle(&mut self) {
        self.target = if self.target < 0.5 { 1.0 } else { 0.0 };
    }
}

/// Moves doors to their targets, and their leaves with them.
pub(crate) fn move_doors(
    time: Res<Time>,
    mut doors: Query<&mut Door>,
    mut roots: Query<(&PortalRoot, &mut PortalState)>,
    worlds: Res<Assets<PortalWorld>>,
    mut leaves: Query<(&WorldDetail, &mut Transform)>,
) {
    for mut door in &mut doors {
        let goal = door.target.clamp(0.0, 1.0);
        if door.share == goal || goal.is_nan() {
            continue;
        }
        let Ok((root, mut state)) = roots.get_mut(door.root) else {
            continue;
        };
        let step = door.speed.max(0.0) * time.delta_secs();
        door.share += (goal - door.share).clamp(-step, step);
        let (portal, share) = (door.id(), door.share);
        let Some(world) = worlds.get(&root.world) else {
            continue;
        };
        if world.sight.leaves(portal).is_empty() {
            match share > 0.0 {
                true => state.doors.open(portal),
                false => state.doors.close(portal),
            }
        } else {
            state.doors.set_leaves(portal, share);
        }
        for leaf in world.sight.leaves(portal) {
            place_leaf(&state, leaf.detail, &mut leaves);
        }
    }
}

/// Puts a leaf where the state of its door has it. Nodes above details have no transforms, so the space of the world is that of
/// the leaf's own transform.
fn place_leaf(
    state: &PortalState,
    leaf: DetailId,
    leaves: &mut Query<(&WorldDetail, &mut Transform)>,
) {
    let entity = state.detail(leaf.0);
    let Some((detail, mut transform)) = entity.and_then(|e| leaves.get_mut(e).ok()) else {
        return;
    };
    if let Some(pose) = state.doors.pose(leaf) {
        let pose = Mat4::from_cols_array(&pose.to_cols_array().map(|x| x as f32));
        *transform = Transform::from_matrix(pose * detail.rest.to_matrix());
    }
}
