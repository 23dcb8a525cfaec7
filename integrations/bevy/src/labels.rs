//! Labels of the entities of spawned worlds.

use bevy::prelude::*;

use crate::world::PortalWorld;

/// The root of a spawned world: put by the loader on the entity of a glTF scene, below that of the `WorldAssetRoot`.
///
/// It may be moved and turned, and a world may be spawned several times; each has doors of its own.
#[derive(Component, Reflect, Clone, Debug)]
#[reflect(Component)]
#[require(Transform, Visibility)]
pub struct PortalRoot {
    /// Its world.
    pub world: Handle<PortalWorld>,
}

/// Part of a world that a mesh entity draws.
#[derive(Reflect, Clone, Copy, Debug, PartialEq, Eq)]
pub enum PartKind {
    /// Structural triangles, as an index into `World::batches`.
    Batch(u32),
    /// A detail object, as an index into `World::details`.
    Detail(u32),
}

/// Label of a mesh entity that draws a part of a world. Put by the loader.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Component)]
pub struct WorldPart {
    /// The entity with the [`PortalRoot`].
    #[entities]
    pub root: Entity,
    /// The part.
    pub kind: PartKind,
}

/// Label of the node of a detail object: a piece of furniture, a door leaf. Its meshes are its children.
#[derive(Component, Reflect, Clone, Copy, Debug)]
#[reflect(Component)]
pub struct WorldDetail {
    /// The entity with the [`PortalRoot`].
    #[entities]
    pub root: Entity,
    /// The object, as an index into `World::details`.
    pub detail: u32,
    /// Its transform in the file.
    pub rest: Transform,
}

/// Label of the node of a cell. Meshes of structure that no other cell sees are its children.
#[derive(Component, Reflect, Clone, Copy, Debug)]
#[reflect(Component)]
pub struct WorldCell {
    /// The entity with the [`PortalRoot`].
    #[entities]
    pub root: Entity,
    /// Index of the cell.
    pub cell: u32,
}
