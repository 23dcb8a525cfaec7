//! Packed worlds as assets: their heads are loaded, their pieces are streamed.

use std::collections::HashMap;
use std::io::SeekFrom;
use std::sync::{Arc, Mutex, PoisonError};

use bevy::asset::io::Reader;
use bevy::asset::{
    AssetLoader, AssetPath, AsyncReadExt, AsyncSeekExt, LoadContext, RenderAssetUsages,
};
use bevy::gltf::DefaultGltfImageSampler;
use bevy::gltf::extensions::GltfExtensionHandlers;
use bevy::gltf::{Gltf, GltfAssetLabel, GltfLoader, GltfLoaderSettings, GltfPlugin};
use bevy::image::{CompressedImageFormatSupport, CompressedImageFormats};
use bevy::prelude::*;
use bevy::tasks::block_on;
use enfilade::cpg::wire::encode_glb;
use enfilade::stream::{Fetch, HEAD, PackedHead, ThreadSource};

/// Label of the [`PackedWorld`] in its file: `asset_server.load("house.enf#PackedWorld")`.
pub const PACKED_LABEL: &str = "PackedWorld";

/// Name of the pieces beside a head.
const PIECES: &str = "pieces.enfp";
/// Threads that fetch pieces of a world.
const FETCHES: usize = 3;
/// Bytes that tell the size of a head.
const FRONT: u64 = 64;

/// A packed world of which the head was loaded: what `enfilade pack` writes. Loaded with the scene in it, under [`PACKED_LABEL`].
///
/// The file is `world.enf` if it is one, or `world.enf/head.enfp` in a folder. Its scene is an ordinary one, with all nodes, materials
/// and doors, and no triangles but those of door leaves: `asset_server.load("world.enf#Scene0")`. Spawned, its root has a
/// [`PackedRoot`], and pieces come and go by what cameras see; see [`PortalStream`](crate::PortalStream).
#[derive(Asset, TypePath)]
pub struct PackedWorld {
    /// The head: graph, catalog of pieces, and the world without triangles.
    pub head: Arc<PackedHead>,
    pub(crate) place: PiecePlace,
    pub(crate) materials: Vec<Handle<StandardMaterial>>,
    pub(crate) default_material: Handle<StandardMaterial>,
    pub(crate) textures: Vec<Handle<Image>>,
    /// Per texture, its picture.
    pub(crate) images: Vec<u32>,
    /// Per material: true if it needs tangents.
    pub(crate) needs_tangents: Vec<bool>,
    pub(crate) formats: CompressedImageFormats,
    pub(crate) mesh_usage: RenderAssetUsages,
    pub(crate) image_usage: RenderAssetUsages,
}

/// The root of a spawned world that is packed: put by the loader beside [`PortalRoot`](crate::PortalRoot).
#[derive(Component, Reflect, Clone, Debug)]
#[reflect(Component)]
pub struct PackedRoot {
    /// Its packed world.
    pub packed: Handle<PackedWorld>,
}

/// Heads whose scenes are being loaded, for the handler of the extension.
pub(crate) type Heads = Arc<Mutex<HashMap<AssetPath<'static>, Arc<PackedHead>>>>;

/// The heads, until the loader is made.
#[derive(Resource, Default)]
pub(crate) struct Loading(pub(crate) Heads);

/// Returns the head of the packed world that is being loaded from a path.
pub(crate) fn head_of(heads: &Heads, path: &AssetPath<'static>) -> Option<Arc<PackedHead>> {
    let heads = heads.lock().unwrap_or_else(PoisonError::into_inner);
    heads.get(&file_of(path)).cloned()
}

fn file_of(path: &AssetPath<'static>) -> AssetPath<'static> {
    path.without_label().clone_owned()
}

/// Reads heads of packed worlds, and their scenes by the engine's own glTF loader.
#[derive(TypePath)]
pub(crate) struct PackedLoader {
    gltf: GltfLoader,
    heads: Heads,
    server: AssetServer,
}

/// Extensions of files that hold the head of a packed world.
pub(crate) const EXTENSIONS: &[&str] = &["enf", "enfp"];

impl PackedLoader {
    /// Makes one that loads scenes as the program's glTF loader does.
    pub(crate) fn new(app: &mut App, heads: &Heads) -> Self {
        let world = app.world_mut();
        let formats = world.get_resource::<CompressedImageFormatSupport>();
        let formats = formats.map_or(CompressedImageFormats::NONE, |f| f.0);
        let sampler = world.get_resource::<DefaultGltfImageSampler>();
        let sampler = sampler.map(DefaultGltfImageSampler::get_internal);
        let extensions = world
            .get_resource_or_init::<GltfExtensionHandlers>()
            .0
            .clone();
        let server = world.resource::<AssetServer>().clone();
        let plugin = app.get_added_plugins::<GltfPlugin>();
        let attributes = plugin.first().map(|p| p.custom_vertex_attributes.clone());
        Self {
            gltf: GltfLoader {
                supported_compressed_formats: formats,
                custom_vertex_attributes: attributes.unwrap_or_default(),
                default_sampler: sampler.unwrap_or_default(),
                // Pieces are in the space of the file.
                default_convert_coordinates: default(),
                extensions,
                default_skinned_mesh_bounds_policy: default(),
            },
            heads: Arc::clone(heads),
            server,
        }
    }
}

impl AssetLoader for PackedLoader {
    type Asset = Gltf;
    type Settings = GltfLoaderSettings;
    type Error = BevyError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        settings: &GltfLoaderSettings,
        load_context: &mut LoadContext<'_>,
    ) -> Result<Gltf, BevyError> {
        let (head, size) = read_head(reader).await?;
        let (head, path) = (Arc::new(head), file_of(load_context.path()));
        let hollow = encode_glb(&head.world)?;
        let heads = || self.heads.lock().unwrap_or_else(PoisonError::into_inner);
        heads().insert(path.clone(), Arc::clone(&head));
        let loaded = GltfLoader::load_gltf(&self.gltf, &hollow, load_context, settings).await;
        heads().remove(&path);
        let loaded = loaded?;
        let place = PiecePlace::beside(&self.server, &path, size);
        let packed = self.packed(load_context, settings, head, &hollow, place)?;
        load_context.add_labeled_asset(PACKED_LABEL, packed);
        Ok(loaded)
    }

    fn extensions(&self) -> &[&str] {
        EXTENSIONS
    }
}

impl PackedLoader {
    /// Collects what meshes and pictures of the pieces will need.
    fn packed(
        &self,
        load_context: &mut LoadContext<'_>,
        settings: &GltfLoaderSettings,
        head: Arc<PackedHead>,
        hollow: &[u8],
        place: PiecePlace,
    ) -> Result<PackedWorld, BevyError> {
        let file = gltf::Gltf::from_slice_without_validation(hollow)?;
        let mut standard = |label: GltfAssetLabel| {
            load_context.get_label_handle::<StandardMaterial>(format!("{label}/std"))
        };
        let default_material = standard(GltfAssetLabel::DefaultMaterial);
        let materials = file.materials().filter_map(|m| m.index());
        let materials = materials.map(|index| {
            standard(GltfAssetLabel::Material {
                index,
                is_scale_inverted: false,
            })
        });
        let materials = materials.collect();
        let mut texture = |i| load_context.get_label_handle(GltfAssetLabel::Texture(i).to_string());
        let has_bumps = |material: gltf::Material| {
            let coat = material.extension_value("KHR_materials_clearcoat");
            let is_coat_bumpy = coat.is_some_and(|c| c.get("clearcoatNormalTexture").is_some());
            material.normal_texture().is_some() || is_coat_bumpy
        };
        Ok(PackedWorld {
            head,
            place,
            materials,
            default_material,
            textures: file.textures().map(|t| texture(t.index())).collect(),
            images: file.textures().map(|t| t.source().index() as u32).collect(),
            needs_tangents: file.materials().map(has_bumps).collect(),
            formats: self.gltf.supported_compressed_formats,
            mesh_usage: settings.load_meshes,
            image_usage: settings.load_materials,
        })
    }
}

/// Reads a head, and no more; returns it with its size.
async fn read_head(reader: &mut dyn Reader) -> Result<(PackedHead, u64), BevyError> {
    let mut bytes = Vec::new();
    (&mut *reader).take(FRONT).read_to_end(&mut bytes).await?;
    let size = PackedHead::size(&bytes)?;
    let more = size.saturating_sub(bytes.len() as u64);
    (&mut *reader).take(more).read_to_end(&mut bytes).await?;
    Ok((PackedHead::decode(&bytes)?, size))
}

/// The place of packed pieces in an asset source.
#[derive(Clone)]
pub(crate) struct PiecePlace {
    server: AssetServer,
    path: AssetPath<'static>,
    /// Offset of the first piece. [Units: bytes]
    offset: u64,
}

impl PiecePlace {
    /// Returns the place of the pieces that belong to the head at `path`.
    fn beside(server: &AssetServer, path: &AssetPath<'static>, size: u64) -> Self {
        let is_folder = path.path().file_name().is_some_and(|name| name == HEAD);
        let pieces = path.path().with_file_name(PIECES);
        let pieces = AssetPath::from(pieces).with_source(path.source().clone_owned());
        Self {
            server: server.clone(),
            path: if is_folder { pieces } else { path.clone() },
            offset: if is_folder { 0 } else { size },
        }
    }

    /// Returns a source of the pieces, with threads of its own.
    pub(crate) fn source(&self, head: &Arc<PackedHead>) -> ThreadSource {
        let fetches = vec![self.clone(); FETCHES];
        ThreadSource::new(head, &self.path.to_string(), fetches)
    }

    async fn read(&self, offset: u64, n: u64) -> Result<Vec<u8>, BevyError> {
        let source = self.server.get_source(self.path.source().clone_owned())?;
        let mut reader = source.reader().read(self.path.path()).await?;
        let start = self.offset.saturating_add(offset);
        let mut out = Vec::new();
        if let Ok(seekable) = reader.seekable() {
            seekable.seek(SeekFrom::Start(start)).await?;
            seekable.take(n).read_to_end(&mut out).await?;
            return Ok(out);
        }
        // All before it is read and dropped.
        let mut dropped = [0; 1 << 14];
        let mut left = start;
        while left > 0 {
            let most = left.min(dropped.len() as u64) as usize;
            let n_read = AsyncReadExt::read(&mut reader, &mut dropped[..most]).await?;
            if n_read == 0 {
                return Ok(out);
            }
            left -= n_read as u64;
        }
        reader.take(n).read_to_end(&mut out).await?;
        Ok(out)
    }
}

impl Fetch for PiecePlace {
    fn fetch(&mut self, offset: u64, n: u64) -> Result<Vec<u8>, String> {
        block_on(self.read(offset, n)).map_err(|error| error.to_string())
    }
}
