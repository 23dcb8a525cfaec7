//! The scene as pieces of packed worlds change it: meshes spawned, pictures of textures exchanged.

use std::collections::HashMap;

use bevy::asset::{AssetMut, VisitAssetDependencies};
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::render::render_resource::Face;
use bevy::time::Real;

use crate::arrivals::{CellLoaded, CellUnloaded, PieceFailed};
use crate::labels::{WorldCell, WorldDetail, WorldPart};
use crate::packed::PackedWorld;
use crate::pieces::{MadeMesh, PieceMaker};

/// Number of streams that show the picture of a texture: worlds that are spawned twice share textures.
#[derive(Resource, Default)]
pub(crate) struct ShownPictures(HashMap<AssetId<Image>, u32>);

/// Materials whose front is the other side, for mirrored objects.
pub(crate) type Mirrored = HashMap<Option<u32>, Handle<StandardMaterial>>;

/// All that a piece changes.
#[derive(SystemParam)]
pub(crate) struct Site<'w, 's> {
    pub(crate) commands: Commands<'w, 's>,
    pub(crate) meshes: ResMut<'w, Assets<Mesh>>,
    pub(crate) images: ResMut<'w, Assets<Image>>,
    materials: ResMut<'w, Assets<StandardMaterial>>,
    pictures: ResMut<'w, ShownPictures>,
    details: Query<'w, 's, &'static WorldDetail>,
    cells: Query<'w, 's, (), With<WorldCell>>,
    pub(crate) time: Res<'w, Time<Real>>,
    pub(crate) loaded: MessageWriter<'w, CellLoaded>,
    pub(crate) unloaded: MessageWriter<'w, CellUnloaded>,
    pub(crate) failed: MessageWriter<'w, PieceFailed>,
}

impl Site<'_, '_> {
    /// Spawns a mesh below `parent`.
    pub(crate) fn spawn(
        &mut self,
        parent: Entity,
        part: WorldPart,
        mesh: &Handle<Mesh>,
        material: Handle<StandardMaterial>,
        made: &MadeMesh,
    ) -> Entity {
        let drawn = (Mesh3d(mesh.clone()), MeshMaterial3d(material));
        let mut entity = self.commands.spawn((drawn, part, ChildOf(parent)));
        if let Some(aabb) = made.aabb {
            entity.insert(aabb);
        }
        entity.id()
    }

    /// Returns the node of a cell, if it is there.
    pub(crate) fn cell(&self, node: Option<Entity>) -> Option<Entity> {
        node.filter(|node| self.cells.contains(*node))
    }

    /// Returns the node of a detail object, if it is there, and whether it is mirrored.
    pub(crate) fn detail(&self, node: Option<Entity>) -> Option<(Entity, bool)> {
        let node = node?;
        let scale = self.details.get(node).ok()?.rest.scale;
        Some((node, scale.is_negative_bitmask().count_ones() % 2 == 1))
    }

    /// Returns a material as the glTF loader chooses it.
    pub(crate) fn material(
        &mut self,
        packed: &PackedWorld,
        material: Option<u32>,
        mirrored: Option<&mut Mirrored>,
    ) -> Handle<StandardMaterial> {
        let own = material.and_then(|m| packed.materials.get(m as usize));
        let own = own.unwrap_or(&packed.default_material);
        let Some(mirrored) = mirrored else {
            return own.clone();
        };
        let turned = mirrored.entry(material).or_insert_with(|| {
            let mut turned = self.materials.get(own).cloned().unwrap_or_default();
            turned.cull_mode = turned.cull_mode.map(|_| Face::Front);
            self.materials.add(turned)
        });
        turned.clone()
    }

    /// Gives a texture its picture.
    pub(crate) fn show(&mut self, texture: &Handle<Image>, picture: Image) {
        let n_shown = self.pictures.0.entry(texture.id()).or_default();
        *n_shown += 1;
        if *n_shown == 1 {
            self.exchange(texture, picture);
        }
    }

    /// Takes the picture from a texture, unless another stream shows it.
    pub(crate) fn hide(&mut self, texture: &Handle<Image>, index: u32, maker: &PieceMaker) {
        let id = texture.id();
        let n_shown = self.pictures.0.get(&id).copied().unwrap_or(0);
        if n_shown > 1 {
            self.pictures.0.insert(id, n_shown - 1);
            return;
        }
        self.pictures.0.remove(&id);
        self.exchange(texture, maker.blank(index));
    }

    fn exchange(&mut self, texture: &Handle<Image>, picture: Image) {
        let id = texture.id();
        if self.images.insert(id, picture).is_err() {
            return;
        }
        // The engine holds on to the old picture until a material is written to.
        let shows = |material: &StandardMaterial| {
            let mut is_shown = false;
            material.visit_dependencies(&mut |d| is_shown |= d == id.untyped());
            is_shown
        };
        let stale = self.materials.iter().filter(|(_, m)| shows(m));
        let stale: Vec<_> = stale.map(|(id, _)| id).collect();
        for id in stale {
            // Marks it as changed.
            let _ = self.materials.get_mut(id).map(AssetMut::into_inner);
        }
    }
}
