//! The input scene: meshes with materials, placed as objects, each structural or detail.
//!
//! Importers fill it, builders read its structural triangles, and the writer carries its materials and
//! textures through to the output unchanged.

use crate::{Aabb, ConvexSolid, DMat4, DVec3, Triangle};

/// The contents of one or more input files.
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
    /// Images that textures refer to.
    pub images: Vec<Image>,
    /// Convex solids of structural objects in world space, if the input is made of them (brushes).
    pub solids: Vec<ConvexSolid>,
    /// Solids of a sky around an open world: its compiler takes them for walls, but they bound no rooms.
    pub sky: Vec<ConvexSolid>,
    /// The solids bound no sealed level, but stand below an open sky.
    pub is_open_world: bool,
    /// Named things without a mesh, as in the input.
    pub entities: Vec<Entity>,
    /// The input's tree of names. Each node comes after its parent.
    pub nodes: Vec<SourceNode>,
    /// Lights, cameras and markers, as in the input.
    pub fixtures: Vec<Fixture>,
    /// The input's metadata as a whole.
    pub about: About,
    /// Objects that are to become mirrors or linked portals.
    pub marks: Vec<Mark>,
    /// Names of rooms, as in the input.
    pub rooms: Vec<RoomName>,
    /// Openings that a designer marked.
    pub given_portals: Vec<GivenPortal>,
}

/// An opening that the input marks as a portal between rooms.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GivenPortal {
    /// Kind and number: `visportal 3`.
    pub name: String,
    /// Its outline in the plane of the opening. [Units: wu]
    pub outline: Vec<DVec3>,
    /// Unit normal of the plane.
    pub normal: DVec3,
    /// Thickness of the solid that marks it. [Units: wu]
    pub thickness: f64,
}

/// A name of a room, and where it holds.
///
/// The cells in which the points lie take the name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RoomName {
    /// Name; several rooms may share one.
    pub name: String,
    /// Points in the room. [Units: wu]
    pub points: Vec<DVec3>,
    /// Volume of the room that each point stands for, or [`RoomName::BY_HAND`]. [Units: wu³]
    pub volume: f64,
}

impl RoomName {
    /// Volume that is larger than that of any room: a point which someone set to name the room around it counts more
    /// than all volumes. [Units: wu³]
    pub const BY_HAND: f64 = 1e15;

    /// Returns a name for the room around a point that someone chose.
    #[must_use]
    pub fn at(name: impl Into<String>, point: DVec3) -> Self {
        Self {
            name: name.into(),
            points: vec![point],
            volume: Self::BY_HAND,
        }
    }
}

/// An object, or one of its parts, that the input marks as a special portal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mark {
    /// Index into [`Scene::objects`].
    pub object: u32,
    /// Index into [`Mesh::primitives`]; all of them if absent.
    pub primitive: Option<u32>,
    /// Kind of the special portal.
    pub kind: MarkKind,
}

/// Kind of a [`Mark`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MarkKind {
    /// A mirror.
    Mirror,
    /// One of two portals of this name, each of which leads to the other.
    Portal(String),
}

/// Metadata of an input as a whole.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct About {
    /// Authors and license, one line per file; may be empty.
    pub copyright: String,
    /// Application data of the scene's root: a JSON value as text, or empty.
    pub extras: String,
}

/// A node of the input's tree: a name, and application data.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SourceNode {
    /// Name; may be empty or repeated.
    pub name: String,
    /// Parent, as an index into the same list, less than the node's own.
    pub parent: Option<u32>,
    /// Application data: a JSON value as text, or empty.
    pub extras: String,
}

/// A light, a camera or a marker, carried through as read.
#[derive(Clone, Debug, PartialEq)]
pub struct Fixture {
    /// Its kind.
    pub kind: FixtureKind,
    /// Name of the node that places it; may be empty.
    pub name: String,
    /// Transform to world space from its own, which looks along -z: a rotation and a translation. [Units: wu]
    pub transform: DMat4,
    /// The light (`KHR_lights_punctual`) or camera as a glTF 2.0 JSON object, lengths in meters; empty for a marker.
    pub gltf: String,
    /// Application data: a JSON value as text, or empty.
    pub extras: String,
}

/// Kind of a [`Fixture`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FixtureKind {
    /// A point, spot or directional light.
    Light,
    /// A perspective or orthographic camera.
    Camera,
    /// A named place without an object: a start, a spawn point, an anchor.
    Marker,
}

/// A named and placed thing of the input without a shape of its own here: a light, a start.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Entity {
    /// Its class, e.g. `info_player_start`.
    pub class: String,
    /// Its position, if given. [Units: wu]
    pub position: Option<DVec3>,
    /// All its properties in order, as text.
    pub properties: Vec<(String, String)>,
    /// The object made of its shapes, as an index into [`Scene::objects`].
    pub object: Option<u32>,
}

/// A mesh in its own space.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name; may be empty.
    pub name: String,
    /// Parts by material.
    pub primitives: Vec<Primitive>,
}

/// Triangles of one material.
#[derive(Clone, Debug, Default)]
pub struct Primitive {
    /// Vertex positions. [Units: wu]
    pub positions: Vec<[f32; 3]>,
    /// Unit normals, one per position, or empty.
    pub normals: Vec<[f32; 3]>,
    /// Tangents as in glTF, one per position, or empty.
    pub tangents: Vec<[f32; 4]>,
    /// Sets of texture coordinates, each with one entry per position.
    pub uvs: Vec<Vec<[f32; 2]>>,
    /// Linear RGBA vertex colors, one per position, or empty.
    pub colors: Vec<[f32; 4]>,
    /// Triangles as triples of position indices, each in range.
    pub indices: Vec<u32>,
    /// Index into [`Scene::materials`].
    pub material: Option<u32>,
}

impl Primitive {
    /// Returns the triangles as triples of position indices.
    #[must_use]
    pub fn triples(&self) -> &[[u32; 3]] {
        self.indices.as_chunks().0
    }

    /// Returns the triangles in the space of the positions.
    ///
    /// # Panics
    ///
    /// If an index is out of range, as [`Primitive::placed_triangles`] does.
    pub fn triangles(&self) -> impl ExactSizeIterator<Item = Triangle> {
        let vertex = |i: u32| DVec3::from_array(self.positions[i as usize].map(f64::from));
        self.triples().iter().map(move |t| t.map(vertex))
    }

    /// Returns the triangles moved by `placement`, without rounding them as [`Scene::world_triangle`] does.
    pub fn placed_triangles(&self, placement: DMat4) -> impl ExactSizeIterator<Item = Triangle> {
        let placed = move |p| placement.transform_point3(p);
        self.triangles().map(move |t| t.map(placed))
    }
}

/// A placed mesh.
#[derive(Clone, Debug)]
pub struct Object {
    /// Name; may be repeated.
    pub name: String,
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// Mesh space to world space (meters, +Y up).
    pub transform: DMat4,
    /// Its role in the decomposition.
    pub role: Role,
    /// Reason for the role, as shown to the user.
    pub reason: String,
    /// The opening that it fills, according to its class or name; `None` if these do not tell.
    pub filling: Option<Filling>,
    /// The input node that it comes from, as an index into [`Scene::nodes`]; several objects may share one.
    pub node: Option<u32>,
}

/// Role of an object in the decomposition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Role {
    /// Bounds rooms: walls, floors, roofs.
    Structural,
    /// Stands in rooms: furniture, plants, door leaves. Left out of the decomposition.
    Detail,
}

/// Thing in an opening, as an object's names say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Filling {
    /// A door: its leaf, its frame, or both.
    Door,
    /// A window.
    Window,
}

/// The appearance of a surface, carried through as read.
#[derive(Clone, Debug, Default)]
pub struct Material {
    /// Name; may be empty.
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

/// A texture: an image and a sampler.
#[derive(Clone, Debug, Default)]
pub struct Texture {
    /// Index into [`Scene::images`].
    pub image: Option<u32>,
    /// The sampler as a glTF 2.0 JSON object; empty for the default.
    pub sampler: String,
}

/// An image as encoded bytes.
#[derive(Clone, Debug, Default)]
pub struct Image {
    /// Name; may be empty.
    pub name: String,
    /// MIME type, e.g. `image/png`.
    pub mime: String,
    /// The encoded file.
    pub bytes: Vec<u8>,
}

/// Origin of a triangle.
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
    /// Returns the vertices of a triangle in world space, rounded to the `f32` that files hold.
    ///
    /// Builder, file and checks must all use the same triangle, so this is the only place that rounds it.
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

    /// Returns the triangles of an object, as [`Scene::world_triangle`] does each, in order of primitive and triangle.
    #[must_use]
    pub fn world_triangles_of(&self, object: u32) -> Vec<Triangle> {
        let primitives = &self.meshes[self.objects[object as usize].mesh as usize].primitives;
        let mut triangles = Vec::with_capacity(primitives.iter().map(|p| p.triples().len()).sum());
        for (primitive, p) in (0..).zip(primitives) {
            triangles.extend((0..p.triples().len() as u32).map(|triangle| {
                self.world_triangle(TriangleSource {
                    object,
                    primitive,
                    triangle,
                })
            }));
        }
        triangles
    }

    /// Returns all triangles of objects with `role`, in order of object, primitive and triangle.
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

    /// Returns the box of one object in world space.
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
