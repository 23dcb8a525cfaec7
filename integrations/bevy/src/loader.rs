//! Reading of worlds from glTF files, and the labels of their entities.

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

use bevy::asset::LoadContext;
use bevy::gltf::GltfLoaderSettings;
use bevy::gltf::extensions::{ErasedGltfExtensionHandler, GltfExtensionHandler};
use bevy::prelude::*;
use gltf::binary::{Glb, Header};
use gltf::json::Value;

use crate::labels::{PartKind, PortalRoot, WorldCell, WorldDetail, WorldPart};
use crate::packed::{Heads, PACKED_LABEL, PackedRoot, head_of};
use crate::world::{PortalWorld, WORLD_LABEL};

/// Name of the extension in a world file.
pub const EXTENSION: &str = "ENFILADE_cell_portal_graph";

/// Reads the extension while Bevy's own loader reads the rest of the file. Each load works on its own clone.
#[derive(Clone)]
pub(crate) struct PortalExtension {
    /// Heads of packed worlds that are being loaded.
    heads: Heads,
    loaded: Option<Arc<Loaded>>,
}

impl PortalExtension {
    pub(crate) fn new(heads: &Heads) -> Self {
        Self {
            heads: Arc::clone(heads),
            loaded: None,
        }
    }
}

/// The parts of the file that entities are labelled by.
struct Loaded {
    world: Handle<PortalWorld>,
    /// Batches by the indices of their mesh and primitive.
    batches: HashMap<(usize, usize), u32>,
    /// Detail objects by the indices of their nodes.
    details: HashMap<usize, u32>,
    /// Cells by the indices of their nodes.
    cells: HashMap<usize, u32>,
    is_packed: bool,
}

/// Returns the array of objects of that name in the extension, each with its position.
fn rows<'a>(extension: &'a Value, name: &str) -> impl Iterator<Item = (u32, &'a Value)> {
    let rows = extension.get(name).and_then(Value::as_array);
    (0..).zip(rows.into_iter().flatten())
}

fn index(row: &Value, name: &str) -> Option<usize> {
    row.get(name)?.as_u64().map(|i| i as usize)
}

fn batches_of(extension: &Value) -> HashMap<(usize, usize), u32> {
    let key = |row: &Value| Some((index(row, "mesh")?, index(row, "primitive")?));
    rows(extension, "batches")
        .filter_map(|(i, row)| Some((key(row)?, i)))
        .collect()
}

/// Returns the rows of that name by the indices of their nodes.
fn by_node(extension: &Value, name: &str) -> HashMap<usize, u32> {
    rows(extension, name)
        .filter_map(|(i, row)| Some((index(row, "node")?, i)))
        .collect()
}

/// Decodes the world. The loader hands over the parsed file, and enfilade's reader checks bytes, so they are put together
/// again: on the loader's thread, beside the game.
fn decode(file: &gltf::Gltf) -> Result<PortalWorld, BevyError> {
    let json = gltf::json::serialize::to_vec(file.document.as_json())?;
    let bytes = Glb {
        header: Header {
            magic: *b"glTF",
            version: 2,
            length: 0,
        },
        json: Cow::Owned(json),
        bin: file.blob.as_deref().map(Cow::Borrowed),
    }
    .to_vec()?;
    let world = enfilade::cpg::wire::decode_glb(&bytes)?;
    Ok(PortalWorld::new(world)?)
}

impl GltfExtensionHandler for PortalExtension {
    fn dyn_clone(&self) -> Box<dyn ErasedGltfExtensionHandler> {
        Box::new(self.clone())
    }

    fn on_root(
        &mut self,
        load_context: &mut LoadContext<'_>,
        gltf: &gltf::Gltf,
        _: &GltfLoaderSettings,
    ) {
        let Some(extension) = gltf.extension_value(EXTENSION) else {
            return;
        };
        let head = head_of(&self.heads, load_context.path());
        let world = match &head {
            Some(head) => PortalWorld::hollow(head).map_err(BevyError::from),
            None => decode(gltf),
        };
        match world {
            Ok(world) => {
                self.loaded = Some(Arc::new(Loaded {
                    world: load_context.add_labeled_asset(WORLD_LABEL, world),
                    batches: batches_of(extension),
                    details: by_node(extension, "details"),
                    cells: by_node(extension, "cells"),
                    is_packed: head.is_some(),
                }));
            }
            Err(error) => {
                let path = load_context.path();
                error!("the rooms of {path} cannot be read, so all of it is drawn: {error}");
            }
        }
    }

    fn on_spawn_mesh_and_material(
        &mut self,
        _: &mut LoadContext<'_>,
        primitive: &gltf::Primitive,
        mesh: &gltf::Mesh,
        _: &gltf::Material,
        entity: &mut EntityWorldMut,
        _: &str,
    ) {
        let key = (mesh.index(), primitive.index());
        if let Some(&batch) = self.loaded.as_ref().and_then(|l| l.batches.get(&key)) {
            entity.insert(WorldPart {
                root: Entity::PLACEHOLDER,
                kind: PartKind::Batch(batch),
            });
        }
    }

    fn on_gltf_node(
        &mut self,
        _: &mut LoadContext<'_>,
        node: &gltf::Node,
        entity: &mut EntityWorldMut,
    ) {
        let Some(loaded) = &self.loaded else {
            return;
        };
        if let Some(&cell) = loaded.cells.get(&node.index()) {
            let root = Entity::PLACEHOLDER;
            entity.insert(WorldCell { root, cell });
        }
        if let Some(&detail) = loaded.details.get(&node.index()) {
            let rest = entity.get::<Transform>().copied().unwrap_or_default();
            entity.insert(WorldDetail {
                root: Entity::PLACEHOLDER,
                detail,
                rest,
            });
        }
    }

    fn on_scene_completed(
        &mut self,
        load_context: &mut LoadContext<'_>,
        _: &gltf::Scene,
        root: Entity,
        scene: &mut World,
    ) {
        let Some(loaded) = &self.loaded else {
            return;
        };
        scene.entity_mut(root).insert(PortalRoot {
            world: loaded.world.clone(),
        });
        if loaded.is_packed {
            let packed = load_context.get_label_handle(PACKED_LABEL);
            scene.entity_mut(root).insert(PackedRoot { packed });
        }
        let mut cells = scene.query::<&mut WorldCell>();
        cells.iter_mut(scene).for_each(|mut cell| cell.root = root);
        let mut details = scene.query::<(&mut WorldDetail, Option<&Children>)>();
        let mut meshes = Vec::new();
        for (mut detail, children) in details.iter_mut(scene) {
            detail.root = root;
            let part = WorldPart {
                root,
                kind: PartKind::Detail(detail.detail),
            };
            meshes.extend(children.into_iter().flatten().map(|child| (*child, part)));
        }
        for (child, part) in meshes {
            // Children are its primitives; nodes below a detail are not part of it.
            if scene.get::<Mesh3d>(child).is_some() {
                scene.entity_mut(child).insert(part);
            }
        }
        let mut parts = scene.query::<&mut WorldPart>();
        for mut part in parts.iter_mut(scene) {
            part.root = root;
        }
    }
}
