//! A scene as it was read: meshes with materials, placed as objects, each structural or detail.
//!
//! Importers fill it, the builders read its structural triangles, and the writer carries its
//! materials and textures through to the output unchanged.

use crate::{Aabb, ConvexSolid, DMat4, DVec3, Triangle};

/// Everything that an input file, or several of them, held.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Meshes in their own space; several objects may place the same one.
    pub meshes: Vec<Mesh>,
    /// Placed meshes.
    pub objects: Vec<Object>,
    /// Materials that primitives refer to.
    pub materials: Vec<Material>,
    /// Textures that materials refer to, by glTF's `textures` index.
    pub textures: Vec<Texture>,
    /// Pictures that textures refer to.
    pub images: Vec<Image>,
    /// The convex solids that structural objects are made of, where the input says so (brushes), in
    /// world space.
    pub solids: Vec<ConvexSolid>,
    /// Named things that are no meshes, as the input had them.
    pub entities: Vec<Entity>,
    /// The input's own tree of names. A node comes after the one above it.
    pub nodes: Vec<SourceNode>,
    /// Lights, cameras and marked places, as the input had them.
    pub fixtures: Vec<Fixture>,
    /// What the input says of itself as a whole.
    pub about: About,
}

/// What an input says of itself as a whole.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct About {
    /// Whose work it is and under which terms, one line a file; may be empty.
    pub copyright: String,
    /// What the scene's root carries for applications: a JSON value as text, or empty.
    pub extras: String,
}

/// A node of the input's own tree: what it calls a thing, and what it says of it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SourceNode {
    /// Name, may be empty; names need not be unique.
    pub name: String,
    /// The node above. Index into the same list, less than the node's own.
    pub parent: Option<u32>,
    /// What the input attaches for applications: a JSON value as text, or empty.
    pub extras: String,
}

/// A light, a camera or a marked place, carried through as it was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Fixture {
    /// What it is.
    pub kind: FixtureKind,
    /// Name of the node that places it, may be empty.
    pub name: String,
    /// Its own space, which looks along -z, to world space: a rotation and a translation. [Units: wu]
    pub transform: DMat4,
    /// The light (`KHR_lights_punctual`) or camera as a glTF 2.0 JSON object, lengths in meters; empty for a marker.
    pub gltf: String,
    /// What the input attaches for applications: a JSON value as text, or empty.
    pub extras: String,
}

/// What a [`Fixture`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FixtureKind {
    /// A point, spot or directional light.
    Light,
    /// A perspective or orthographic camera.
    Camera,
    /// A place that the input names and puts nothing at: a start, a spawn point, an anchor.
    Marker,
}

/// Something that an input names and places without giving it a shape here: a light, a start.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Entity {
    /// What it is, e.g. `info_player_start`.
    pub class: String,
    /// Where it is, if it says so. [Units: wu]
    pub position: Option<DVec3>,
    /// Everything it says, in its order, as text.
    pub properties: Vec<(String, String)>,
    /// The object made of its shapes. Index into [`Scene::objects`].
    pub object: Option<u32>,
}

/// A mesh in its own space.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name, may be empty.
    pub name: String,
    /// Parts by material.
    pub primitives: Vec<Primitive>,
}

/// Triangles of one material.
#[derive(Clone, Debug, Default)]
pub struct Primitive {
    /// Corner positions. [Units: wu]
    pub positions: Vec<[f32; 3]>,
    /// Unit normals, one a position, or empty.
    pub normals: Vec<[f32; 3]>,
    /// Tangents as in glTF, one a position, or empty.
    pub tangents: Vec<[f32; 4]>,
    /// Texture coordinate sets, each with one entry a position.
    pub uvs: Vec<Vec<[f32; 2]>>,
    /// Linear RGBA vertex colors, one a position, or empty.
    pub colors: Vec<[f32; 4]>,
    /// Triangles as triples of position indices, each in range.
    pub indices: Vec<u32>,
    /// Index into [`Scene::materials`].
    pub material: Option<u32>,
}

/// A placed mesh.
#[derive(Clone, Debug)]
pub struct Object {
    /// Name, unique names not required.
    pub name: String,
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// Mesh space to world space (meters, +Y up).
    pub transform: DMat4,
    /// What the object is to the decomposition.
    pub role: Role,
    /// Why it has that role, as shown to the user.
    pub reason: String,
    /// What the input says it is. Index into [`Scene::nodes`]; several objects may come from one node.
    pub node: Option<u32>,
}

/// What an object is to the decomposition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Role {
    /// Bounds rooms: walls, floors, roofs.
    Structural,
    /// Stands in rooms: furniture, plants, door leaves. Left out of the decomposition.
    Detail,
}

/// A surface's look. Carried through as it was read.
#[derive(Clone, Debug, Default)]
pub struct Material {
    /// Name, may be empty.
    pub name: String,
    /// The material as a glTF 2.0 JSON object, texture indices referring to [`Scene::textures`].
    pub gltf: String,
    /// Seen from both sides.
    pub double_sided: bool,
    /// Lets light through (`alphaMode` `BLEND`, or transmission): it does not block sight.
    pub transparent: bool,
    /// Linear base color factor.
    pub base_color: [f32; 4],
}

/// A texture: a picture and how to sample it.
#[derive(Clone, Debug, Default)]
pub struct Texture {
    /// Index into [`Scene::images`].
    pub image: Option<u32>,
    /// The sampler as a glTF 2.0 JSON object; empty for the default.
    pub sampler: String,
}

/// A picture as encoded bytes.
#[derive(Clone, Debug, Default)]
pub struct Image {
    /// Name, may be empty.
    pub name: String,
    /// MIME type, e.g. `image/png`.
    pub mime: String,
    /// The encoded file.
    pub bytes: Vec<u8>,
}

/// Where a triangle came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TriangleSource {
    /// Index into [`Scene::objects`].
    pub object: u32,
    /// Index into [`Mesh::primitives`].
    pub primitive: u32,
    /// Index of the triangle in the primitive.
    pub triangle: u32,
}

impl Scene {
    /// Corners of one triangle in world space, rounded to the `f32` that files hold.
    ///
    /// Builder, file and checks must all mean the same triangle, so that rounding is done here,
    /// once, and never again.
    #[must_use]
    pub fn world_triangle(&self, source: TriangleSource) -> Triangle {
        let object = &self.objects[source.object as usize];
        let primitive = &self.meshes[object.mesh as usize].primitives[source.primitive as usize];
        let first = source.triangle as usize * 3;
        [0, 1, 2].map(|i| {
            let p = primitive.positions[primitive.indices[first + i] as usize];
            let local = DVec3::new(p[0].into(), p[1].into(), p[2].into());
            object
                .transform
                .transform_point3(local)
                .as_vec3()
                .as_dvec3()
        })
    }

    /// All triangles of objects with `role`, in order of object, primitive and triangle.
    pub fn triangle_sources(&self, role: Role) -> impl Iterator<Item = TriangleSource> + '_ {
        self.objects
            .iter()
            .enumerate()
            .filter(move |(_, o)| o.role == role)
            .flat_map(move |(object, o)| {
                self.meshes[o.mesh as usize]
                    .primitives
                    .iter()
                    .enumerate()
                    .flat_map(move |(primitive, p)| {
                        (0..p.indices.len() / 3).map(move |triangle| TriangleSource {
                            object: object as u32,
                            primitive: primitive as u32,
                            triangle: triangle as u32,
                        })
                    })
            })
    }

    /// World box of one object.
    #[must_use]
    pub fn object_aabb(&self, object: usize) -> Aabb {
        let o = &self.objects[object];
        let mut bounds = Aabb::EMPTY;
        for primitive in &self.meshes[o.mesh as usize].primitives {
            for p in &primitive.positions {
                let local = DVec3::new(p[0].into(), p[1].into(), p[2].into());
                bounds = bounds.including(o.transform.transform_point3(local));
            }
        }
        bounds
    }
}
