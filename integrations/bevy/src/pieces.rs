//! Meshes and pictures from the bytes of pieces, on threads beside the game.

use bevy::asset::RenderAssetUsages;
use bevy::camera::primitives::{Aabb, MeshAabb};
use bevy::image::{CompressedImageFormats, ImageSampler, ImageType};
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use enfilade::cpg::wire::{PieceContent, read_piece};
use enfilade::geom::scene::Primitive;

use crate::packed::PackedWorld;

/// All that is needed to make what pieces hold.
pub(crate) struct PieceMaker {
    /// Per texture: its picture, and how it is read.
    textures: Vec<(u32, TextureKind)>,
    /// Per mesh: true if it is there from the beginning, as those of door leaves are.
    is_there: Vec<bool>,
    /// Per picture, its type.
    mimes: Vec<String>,
    /// Per material.
    needs_tangents: Vec<bool>,
    formats: CompressedImageFormats,
    mesh_usage: RenderAssetUsages,
    image_usage: RenderAssetUsages,
}

/// Reading of a texture's picture.
struct TextureKind {
    is_srgb: bool,
    sampler: ImageSampler,
}

/// A mesh to draw.
pub(crate) struct MadeMesh {
    pub(crate) mesh: Mesh,
    pub(crate) aabb: Option<Aabb>,
    /// Index of its material.
    pub(crate) material: Option<u32>,
}

impl MadeMesh {
    /// Moves the mesh out.
    pub(crate) fn take_mesh(&mut self) -> Mesh {
        let empty = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::empty());
        std::mem::replace(&mut self.mesh, empty)
    }
}

/// The contents of a piece, ready for the scene.
pub(crate) enum Made {
    /// Meshes of batches.
    Batches(Vec<(u32, MadeMesh)>),
    /// A mesh of detail objects, and its parts.
    Details(u32, Vec<MadeMesh>),
    /// Pictures of textures, all of the same file.
    Textures(Vec<(u32, Image)>),
}

impl Made {
    /// Returns its size in memory, once. [Units: bytes]
    pub(crate) fn n_bytes(&self) -> u64 {
        let of_mesh = |made: &MadeMesh| {
            let indices = made.mesh.get_index_buffer_bytes().map_or(0, <[u8]>::len);
            (made.mesh.get_vertex_buffer_size() + indices) as u64
        };
        match self {
            Self::Batches(meshes) => meshes.iter().map(|(_, made)| of_mesh(made)).sum(),
            Self::Details(_, meshes) => meshes.iter().map(of_mesh).sum(),
            Self::Textures(images) => {
                let sizes = images.iter().filter_map(|(_, image)| image.data.as_ref());
                sizes.map(|data| data.len() as u64).sum()
            }
        }
    }
}

impl PieceMaker {
    /// Makes the maker of a packed world, from its textures as the head has them: white, and each read in its own way.
    pub(crate) fn new(packed: &PackedWorld, images: &Assets<Image>) -> Self {
        let kind = |(texture, &image): (&Handle<Image>, &u32)| {
            let known = images.get(texture);
            let kind = TextureKind {
                is_srgb: known.is_none_or(|i| i.texture_descriptor.format.is_srgb()),
                sampler: known.map_or(ImageSampler::Default, |i| i.sampler.clone()),
            };
            (image, kind)
        };
        let textures = packed.textures.iter().zip(&packed.images);
        let world = &packed.head.world;
        let meshes = world.detail_meshes.iter();
        let mimes = world.images.iter().map(|i| i.mime.clone());
        Self {
            textures: textures.map(kind).collect(),
            is_there: meshes.map(|m| !m.primitives.is_empty()).collect(),
            mimes: mimes.collect(),
            needs_tangents: packed.needs_tangents.clone(),
            formats: packed.formats,
            mesh_usage: packed.mesh_usage,
            image_usage: packed.image_usage,
        }
    }

    /// Makes the contents of a piece.
    pub(crate) fn make(&self, bytes: &[u8]) -> Result<Made, String> {
        Ok(match read_piece(bytes).map_err(|e| e.to_string())? {
            PieceContent::Batches(batches) => {
                let made = batches.into_iter().filter(|(_, p)| !p.indices.is_empty());
                Made::Batches(made.map(|(i, p)| (i, self.mesh(p))).collect())
            }
            PieceContent::Mesh { mesh, primitives } => {
                let is_there = self.is_there.get(mesh as usize) == Some(&true);
                let drawn = primitives.into_iter();
                let drawn = drawn.filter(|p| !is_there && !p.indices.is_empty());
                Made::Details(mesh, drawn.map(|p| self.mesh(p)).collect())
            }
            PieceContent::Image { image, bytes } => Made::Textures(self.textures(image, &bytes)?),
        })
    }

    /// Makes a mesh as the glTF loader does.
    fn mesh(&self, primitive: Primitive) -> MadeMesh {
        let mut mesh = Mesh::new(PrimitiveTopology::TriangleList, self.mesh_usage);
        mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, primitive.positions);
        if !primitive.normals.is_empty() {
            mesh.insert_attribute(Mesh::ATTRIBUTE_NORMAL, primitive.normals);
        }
        if !primitive.tangents.is_empty() {
            mesh.insert_attribute(Mesh::ATTRIBUTE_TANGENT, primitive.tangents);
        }
        if !primitive.colors.is_empty() {
            mesh.insert_attribute(Mesh::ATTRIBUTE_COLOR, primitive.colors);
        }
        let attributes = [Mesh::ATTRIBUTE_UV_0, Mesh::ATTRIBUTE_UV_1];
        let sets = primitive.uvs.into_iter().zip(attributes);
        for (uvs, attribute) in sets.filter(|(uvs, _)| !uvs.is_empty()) {
            mesh.insert_attribute(attribute, uvs);
        }
        mesh.insert_indices(Indices::U32(primitive.indices));
        if mesh.attribute(Mesh::ATTRIBUTE_NORMAL).is_none() {
            mesh.duplicate_vertices();
            mesh.compute_flat_normals();
        }
        let material = primitive.material;
        let is_bumpy = material.and_then(|m| self.needs_tangents.get(m as usize));
        if is_bumpy == Some(&true)
            && !mesh.contains_attribute(Mesh::ATTRIBUTE_TANGENT)
            && let Err(error) = mesh.generate_tangents()
        {
            warn!("a mesh gets no tangents: {error}");
        }
        MadeMesh {
            aabb: mesh.compute_aabb(),
            mesh,
            material,
        }
    }

    /// Makes the picture of each texture that shows an image.
    fn textures(&self, image: u32, bytes: &[u8]) -> Result<Vec<(u32, Image)>, String> {
        let mime = self.mimes.get(image as usize);
        let mime = mime.map_or("", String::as_str);
        let shown = (0..).zip(&self.textures).filter(|(_, (i, _))| *i == image);
        let pictures = shown.map(|(texture, (_, kind))| {
            let picture = Image::from_buffer(
                bytes,
                ImageType::MimeType(mime),
                self.formats,
                kind.is_srgb,
                kind.sampler.clone(),
                self.image_usage,
            );
            let picture = picture.map_err(|e| format!("picture {image} cannot be read: {e}"))?;
            Ok((texture, picture))
        });
        pictures.collect()
    }

    /// Returns a white picture of a texture, as the head has it.
    pub(crate) fn blank(&self, texture: u32) -> Image {
        let kind = self.textures.get(texture as usize).map(|(_, kind)| kind);
        let format = match kind.is_none_or(|k| k.is_srgb) {
            true => TextureFormat::Rgba8UnormSrgb,
            false => TextureFormat::Rgba8Unorm,
        };
        let mut image = Image::new(
            Extent3d::default(),
            TextureDimension::D2,
            vec![u8::MAX; 4],
            format,
            self.image_usage,
        );
        image.sampler = kind.map_or(ImageSampler::Default, |k| k.sampler.clone());
        image
    }
}
