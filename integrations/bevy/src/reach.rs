//! Cells that moving objects and lights reach into, found again when they move.

use bevy::camera::primitives::Aabb;
use bevy::prelude::*;

use crate::labels::PortalRoot;
use crate::space::{Extent, into_root, stretch};
use crate::state::PortalState;
use crate::world::PortalWorld;

/// Marks an entity that moves through worlds: a character, a thrown cup, a car. Found by the bounds of its meshes, in whatever
/// cells they are, and not drawn while these cells are out of sight.
///
/// Put it on a mesh or above meshes, such as on a `WorldAssetRoot`; meshes below get it, too. Without it, an entity that is not part
/// of a world is always drawn, as before. A detail object of a world, such as furniture, is known by where it stands in the
/// file: give it a `Mover` when it begins to move.
#[derive(Component, Reflect, Default, Clone, Copy, Debug)]
#[reflect(Component, Default)]
#[require(Reach)]
pub struct Mover;

/// Cells of a mover or light in each world; required by [`Mover`], `PointLight` and `SpotLight`.
#[derive(Component, Default, Clone, Debug)]
pub struct Reach {
    pub(crate) worlds: Vec<(Entity, Extent)>,
}

impl Reach {
    /// Returns the cells that it may touch in a world, ascending.
    #[must_use]
    pub fn cells(&self, root: Entity) -> &[enfilade::CellId] {
        let own = self.worlds.iter().find(|(r, _)| *r == root);
        own.map_or(&[], |(_, extent)| &extent.cells)
    }
}

/// Gives `Mover` to meshes that were spawned below one.
pub(crate) fn pass_on_movers(
    mut commands: Commands,
    movers: Query<Entity, (With<Mover>, Without<Mesh3d>)>,
    children: Query<&Children>,
    meshes: Query<(), (With<Mesh3d>, Without<Mover>)>,
) {
    for mover in &movers {
        for entity in children.iter_descendants(mover) {
            if meshes.contains(entity) {
                commands.entity(entity).insert(Mover);
            }
        }
    }
}

type Moved = Or<(
    Changed<GlobalTransform>,
    Changed<Aabb>,
    Changed<PointLight>,
    Changed<SpotLight>,
    Added<Mover>,
)>;

type Bodies<'a> = (
    Entity,
    &'a GlobalTransform,
    Option<&'a Aabb>,
    Option<&'a PointLight>,
    Option<&'a SpotLight>,
);

type WatchedRoots<'a> = (
    Entity,
    &'a PortalRoot,
    &'a PortalState,
    Ref<'a, GlobalTransform>,
);

/// Finds the cells of movers and lights that have moved, and of all after a world has.
pub(crate) fn find_reaches(
    roots: Query<WatchedRoots>,
    mut gone: RemovedComponents<PortalState>,
    worlds: Res<Assets<PortalWorld>>,
    moved: Query<Entity, (With<Reach>, Moved)>,
    placed: Query<Bodies, With<Reach>>,
    mut reaches: Query<&mut Reach>,
    mut known_revision: Local<u32>,
) {
    let newest = roots.iter().map(|r| r.2.revision).max().unwrap_or(0);
    let is_new = newest > *known_revision;
    *known_revision = newest.max(*known_revision);
    let is_all = gone.read().count() > 0 || is_new || roots.iter().any(|r| r.3.is_changed());
    let mut update = |placed: Bodies| {
        let Ok(mut reach) = reaches.get_mut(placed.0) else {
            return;
        };
        reach.worlds.clear();
        for (root, own, _, place) in &roots {
            let world = worlds.get(&own.world);
            let extent = world.and_then(|w| extent_in(w, &place, placed));
            reach.worlds.extend(extent.map(|e| (root, e)));
        }
    };
    if is_all {
        placed.iter().for_each(&mut update);
    } else {
        placed.iter_many(&moved).for_each(&mut update);
    }
}

/// Returns the space that a mover or light takes up in a world; `None` if it has none yet, or the world is flattened.
fn extent_in(world: &PortalWorld, root: &GlobalTransform, placed: Bodies) -> Option<Extent> {
    let (_, place, aabb, point, spot) = placed;
    let into = into_root(root)?;
    let locator = &world.world.graph.locator;
    let range = point.map(|p| p.range).or(spot.map(|s| s.range));
    let sphere = range.map(|range| {
        let center = into.transform_point3a(place.affine().translation);
        Extent::of_sphere(locator, range, center, stretch(&into))
    });
    let body = aabb.map(|aabb| Extent::of_box(locator, aabb, &(into * place.affine())));
    match (sphere, body) {
        (Some(sphere), Some(body)) => Some(sphere.joined(&body)),
        (sphere, body) => sphere.or(body),
    }
}
