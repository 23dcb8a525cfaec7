//! Preparation of worlds that were just spawned.

use bevy::prelude::*;
use enfilade::{PortalId, SightState};

use crate::doors::Door;
use crate::labels::{PortalRoot, WorldCell, WorldDetail};
use crate::state::PortalState;
use crate::world::PortalWorld;

/// Prepares the roots of worlds that were just loaded, spawned or changed on disk.
pub(crate) fn set_up_roots(
    mut commands: Commands,
    roots: Query<(Entity, Ref<PortalRoot>, Has<PortalState>)>,
    details: Query<(Entity, &WorldDetail)>,
    cells: Query<(Entity, &WorldCell)>,
    doors: Query<(Entity, &Door)>,
    worlds: Res<Assets<PortalWorld>>,
    mut changes: MessageReader<AssetEvent<PortalWorld>>,
    mut revision: Local<u32>,
) {
    let changed: Vec<AssetId<PortalWorld>> = changes
        .read()
        .filter_map(|event| match event {
            AssetEvent::Modified { id } => Some(*id),
            _ => None,
        })
        .collect();
    for (root, own, is_ready) in &roots {
        let is_stale = own.is_changed() || changed.contains(&own.world.id());
        let Some(world) = worlds.get(&own.world) else {
            continue;
        };
        if is_ready && !is_stale {
            continue;
        }
        let own = details.iter().filter(|(_, d)| d.root == root);
        let details = entities(world.world.details.len(), own.map(|(e, d)| (e, d.detail)));
        let own = cells.iter().filter(|(_, c)| c.root == root);
        let cells = entities(world.world.graph.cells.len(), own.map(|(e, c)| (e, c.cell)));
        *revision += 1;
        let state = PortalState {
            doors: SightState::new(&world.sight),
            details,
            cells,
            revision: *revision,
        };
        for (door, _) in doors.iter().filter(|(_, d)| d.root == root) {
            commands.entity(door).despawn();
        }
        for portal in world.world.graph.portal_ids() {
            spawn_door(&mut commands, root, world, &state, portal);
        }
        commands.entity(root).insert(state);
    }
}

/// Lists `n` entities by their numbers.
fn entities(n: usize, numbered: impl Iterator<Item = (Entity, u32)>) -> Vec<Option<Entity>> {
    let mut out = vec![None; n];
    for (entity, i) in numbered {
        if let Some(slot) = out.get_mut(i as usize) {
            *slot = Some(entity);
        }
    }
    out
}

/// Spawns the [`Door`] of a portal that has leaves.
fn spawn_door(
    commands: &mut Commands,
    root: Entity,
    world: &PortalWorld,
    state: &PortalState,
    portal: PortalId,
) {
    let Some(share) = state.doors.leaves(portal) else {
        return;
    };
    let at = Vec3::from(world.world.graph[portal].center());
    commands.spawn((
        Name::new(format!("door of {portal}")),
        Door::new(root, portal, share),
        Transform::from_translation(at),
        Visibility::default(),
        ChildOf(root),
    ));
}
