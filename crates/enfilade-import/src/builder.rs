//! Fills one [`Scene`] from several files: merging, limits, mirrored placements, roles.

mod naming;
mod openings;
mod variants;

use crate::files::Beside;
use crate::groups::name_groups;
use crate::left_out::leave_out;
use crate::order::sort;
use crate::origins::Origins;
use crate::{ImportError, ImportOptions, ImportReport, Limits};
use enfilade_geom::scene::{
    Entity, Filling, Image, Material, Mesh, Object, Primitive, Role, Scene, Texture,
};
use enfilade_geom::{ConvexSolid, DMat4, DVec3, Triangle};
use enfilade_prepare::{GridSteps, RoleFacts, RoleVerdict, weld_quantized};
use enfilade_source::SourceError;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// The scene under construction and the file that is being read.
pub(crate) struct Builder<'a> {
    pub(crate) options: &'a ImportOptions,
    pub(crate) report: ImportReport,
    /// The file being read.
    pub(crate) path: PathBuf,
    /// The files to which it may refer.
    pub(crate) beside: Beside<'a>,
    pub(crate) base: DMat4,
    scene: Scene,
    pub(crate) is_detail_file: bool,
    n_triangles: u64,
    n_placements: u64,
    n_vertices: u64,
    n_image_bytes: u64,
    /// Bytes read from files.
    n_read_bytes: u64,
    /// Memory that the input takes, here or when it is baked. [Units: bytes]
    n_held_bytes: u64,
    /// Meshes made from other meshes: source, mirrored or not, primitives.
    variants: HashMap<(u32, bool, MeshPart), u32>,
    /// Grid steps of the meshes so far.
    steps: GridSteps,
    origins: Origins,
}

/// The primitives of a mesh that a variant keeps.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum MeshPart {
    All,
    Opaque,
    SeeThrough,
}

/// A mesh to be placed.
pub(crate) struct Placement<'n> {
    pub(crate) mesh: u32,
    /// Names that decide the role: the node's own, its mesh's.
    pub(crate) names: [&'n str; 2],
    /// Names of the nodes above, nearest first.
    pub(crate) ancestors: &'n [&'n str],
    /// One object each.
    pub(crate) transforms: &'n [DMat4],
    /// The reason why it moves, if it does.
    pub(crate) moves: Option<&'static str>,
    pub(crate) place: &'n str,
    /// Its node in the tree of names, from [`Builder::add_source`].
    pub(crate) source: Option<u32>,
}

impl<'a> Builder<'a> {
    pub(crate) fn new(options: &'a ImportOptions) -> Result<Self, ImportError> {
        Ok(Self {
            base: options.base_transform()?,
            options,
            report: ImportReport::default(),
            path: PathBuf::new(),
            beside: Beside::Nothing,
            scene: Scene::default(),
            is_detail_file: false,
            n_triangles: 0,
            n_placements: 0,
            n_vertices: 0,
            n_image_bytes: 0,
            n_read_bytes: 0,
            n_held_bytes: 0,
            variants: HashMap::new(),
            steps: GridSteps::new(),
            origins: Origins::default(),
        })
    }

    /// Starts a file.
    pub(crate) fn begin_file(&mut self, path: &Path, beside: Beside<'a>, is_detail: bool) {
        self.path = path.to_path_buf();
        self.beside = beside;
        self.is_detail_file = is_detail;
        self.report.files.push(crate::FileReport {
            path: path.to_path_buf(),
            ..Default::default()
        });
    }

    pub(crate) fn set_format(&mut self, format: &'static str) {
        if let Some(file) = self.report.files.last_mut() {
            file.format = format;
        }
    }

    pub(crate) fn malformed(
        &self,
        place: impl Into<String>,
        problem: impl Into<String>,
    ) -> ImportError {
        ImportError::malformed(&self.path, place, problem)
    }

    pub(crate) fn note(&mut self, place: impl Into<String>, text: impl Into<String>) {
        let path = std::mem::take(&mut self.path);
        self.report.note(&path, place, text);
        self.path = path;
    }

    /// Reads a file that the current one refers to.
    pub(crate) fn read_reference(
        &mut self,
        reference: &str,
        limit: u64,
    ) -> Result<Vec<u8>, String> {
        let may_leave = self.options.allow_outside;
        let (path, bytes) = (self.beside).read(&self.path, reference, may_leave, limit)?;
        if !self.report.references.contains(&path) {
            self.report.references.push(path);
        }
        Ok(bytes)
    }

    /// Returns the error of a source: that of the allowance if this is why it ended.
    pub(crate) fn failed(&self, e: SourceError) -> ImportError {
        self.ended(&e.place)
            .unwrap_or_else(|| self.malformed(e.place, e.problem))
    }

    /// Returns the error of the allowance, if it is over; looks at clock and memory.
    fn ended(&self, place: &str) -> Option<ImportError> {
        let end = self.options.allowance.as_ref()?.end()?;
        Some(ImportError::Ended {
            path: self.path.clone(),
            place: place.into(),
            end,
        })
    }

    /// Spends work of the allowance, in units of about 100 ns.
    pub(crate) fn spend(&self, place: &str, work: u64) -> Result<(), ImportError> {
        let allowance = self.options.allowance.as_deref();
        match allowance.is_none_or(|a| a.spend(work)) {
            true => Ok(()),
            false => self.go_on(place),
        }
    }

    /// Checks that the allowance is not over, before or after what does not spend from it.
    pub(crate) fn go_on(&self, place: &str) -> Result<(), ImportError> {
        self.ended(place).map_or(Ok(()), Err)
    }

    pub(crate) fn limits(&self) -> &'a Limits {
        &self.options.limits
    }

    fn too_much(&self, place: &str, what: &'static str, n: u64, limit: u64) -> ImportError {
        ImportError::TooMuch {
            path: self.path.clone(),
            place: place.into(),
            what,
            n,
            limit,
        }
    }

    /// Places a mesh whose format decides its role, and returns its index. The transform must not mirror.
    pub(crate) fn place_as(
        &mut self,
        mesh: u32,
        transform: DMat4,
        name: &str,
        role: Role,
        reason: &str,
    ) -> Result<u32, ImportError> {
        self.check_objects(name, 1)?;
        self.n_placements += 1;
        let primitives = &self.scene.meshes[mesh as usize].primitives;
        let n_triangles: usize = primitives.iter().map(|p| p.indices.len() / 3).sum();
        self.n_triangles = self.n_triangles.saturating_add(n_triangles as u64);
        self.check_triangles(name, self.n_triangles)?;
        let n_bytes = OBJECT_BYTES + (name.len() + reason.len()) as u64;
        self.charge_memory(name, 1, n_bytes)?;
        let facts = RoleFacts {
            names: [name, ""],
            ancestors: &[],
            materials: &[],
            is_see_through: false,
            moves: None,
            is_detail_file: false,
            thickness_if_plain: None,
        };
        self.charge_memory(name, n_triangles as u64, TRIANGLE_BYTES)?;
        self.scene.objects.push(Object {
            name: name.to_owned(),
            mesh,
            transform,
            role,
            reason: reason.to_owned(),
            filling: facts.filling(),
            node: None,
        });
        if let Some(file) = self.report.files.last_mut() {
            file.n_objects += 1;
            file.n_triangles += n_triangles as u64;
        }
        Ok(self.scene.objects.len() as u32 - 1)
    }

    /// Keeps the solids that structural objects are made of.
    pub(crate) fn add_solids(&mut self, solids: impl Iterator<Item = ConvexSolid>) {
        self.scene.solids.extend(solids);
    }

    /// Keeps the solids of a sky around an open world.
    pub(crate) fn add_sky(&mut self, solids: Vec<ConvexSolid>) {
        self.scene.sky.extend(solids);
        self.scene.is_open_world = true;
    }

    /// Puts an object at a node of the tree of names.
    pub(crate) fn put_at(&mut self, object: u32, node: Option<u32>) {
        self.scene.objects[object as usize].node = node;
    }

    /// Keeps an entity.
    pub(crate) fn add_entity(&mut self, entity: Entity) {
        self.scene.entities.push(entity);
    }

    /// Counts vertices before they are allocated.
    pub(crate) fn charge_vertices(&mut self, place: &str, n: u64) -> Result<(), ImportError> {
        self.n_vertices = self.n_vertices.saturating_add(n);
        let limit = self.limits().max_vertices;
        if self.n_vertices > limit {
            return Err(self.too_much(place, "vertices", self.n_vertices, limit));
        }
        self.spend(place, n)
    }

    /// Adds to the bytes read, of this file or one that it refers to.
    pub(crate) fn add_read_bytes(&mut self, n: u64) {
        self.n_read_bytes = self.n_read_bytes.saturating_add(n);
    }

    /// Adds the unpacked size of compressed bytes, so that a compressed file may hold as much as an uncompressed one.
    ///
    /// At most [`MAX_UNPACKING`] times the packed size: bytes that unpack further hold no more numbers, only more
    /// zeros.
    pub(crate) fn add_unpacked_bytes(&mut self, packed: u64, plain: u64) {
        let most = packed.saturating_mul(MAX_UNPACKING);
        self.add_read_bytes(plain.min(most).saturating_sub(packed));
    }

    /// Counts `n` pieces of `size` bytes before they are allocated.
    pub(crate) fn charge_memory(
        &mut self,
        place: &str,
        n: u64,
        size: u64,
    ) -> Result<(), ImportError> {
        self.n_held_bytes = self.n_held_bytes.saturating_add(n.saturating_mul(size));
        let limit = self.max_held_bytes();
        if self.n_held_bytes > limit {
            return Err(ImportError::Bomb {
                path: self.path.clone(),
                place: place.into(),
                n: self.n_held_bytes,
                limit,
            });
        }
        Ok(())
    }

    #[cfg(feature = "draco")]
    /// Returns the memory left before [`ImportError::Bomb`]. [Units: bytes]
    pub(crate) fn memory_left(&self) -> u64 {
        self.max_held_bytes().saturating_sub(self.n_held_bytes)
    }

    fn max_held_bytes(&self) -> u64 {
        let limits = self.limits();
        let explained = self.n_read_bytes.saturating_mul(limits.max_expansion);
        limits.max_bytes_of_small.max(explained)
    }

    /// Checks a number of placements before they are made; placing them counts them.
    pub(crate) fn check_objects(&self, place: &str, n: u64) -> Result<(), ImportError> {
        let (n, limit) = (
            self.n_placements.saturating_add(n),
            self.limits().max_objects,
        );
        if n > limit {
            return Err(self.too_much(place, "objects", n, limit));
        }
        Ok(())
    }

    /// Checks a number of triangles before they are allocated; placing them counts them.
    pub(crate) fn check_triangles(&self, place: &str, n: u64) -> Result<(), ImportError> {
        let limit = self.limits().max_triangles;
        if n > limit {
            return Err(self.too_much(place, "triangles", n, limit));
        }
        Ok(())
    }

    /// Counts picture bytes before they are kept.
    pub(crate) fn charge_image(&mut self, place: &str, n: u64) -> Result<(), ImportError> {
        self.n_image_bytes = self.n_image_bytes.saturating_add(n);
        let limit = self.limits().max_image_bytes;
        if self.n_image_bytes > limit {
            return Err(self.too_much(place, "picture bytes", self.n_image_bytes, limit));
        }
        self.charge_memory(place, n, 1)
    }

    pub(crate) fn n_textures(&self) -> u32 {
        self.scene.textures.len() as u32
    }

    pub(crate) fn material(&self, index: u32) -> Option<&Material> {
        self.scene.materials.get(index as usize)
    }

    pub(crate) fn push_material(&mut self, material: Material) -> u32 {
        self.scene.materials.push(material);
        self.scene.materials.len() as u32 - 1
    }

    pub(crate) fn push_texture(&mut self, texture: Texture) -> u32 {
        self.scene.textures.push(texture);
        self.scene.textures.len() as u32 - 1
    }

    pub(crate) fn push_image(&mut self, image: Image) -> u32 {
        self.scene.images.push(image);
        self.scene.images.len() as u32 - 1
    }

    pub(crate) fn image_mime(&self, index: u32) -> &str {
        self.scene
            .images
            .get(index as usize)
            .map_or("", |image| &image.mime)
    }

    pub(crate) fn push_mesh(&mut self, mesh: Mesh) -> u32 {
        self.scene.meshes.push(mesh);
        self.scene.meshes.len() as u32 - 1
    }

    /// As [`Builder::push_mesh`], for a mesh with positions rounded to a grid; `steps` as in [`GridSteps`].
    pub(crate) fn push_quantized_mesh(&mut self, mesh: Mesh, steps: Vec<f32>) -> u32 {
        let made = self.push_mesh(mesh);
        if steps.iter().any(|&s| s > 0.0) {
            self.steps.insert(made, steps);
        }
        made
    }

    /// Drops vertices with a coordinate that is not finite, and their triangles.
    ///
    /// A NaN would make every box that it enters meaningless.
    pub(crate) fn drop_nonfinite(&mut self, place: &str, primitive: &mut Primitive) {
        let is_good = |p: &[f32; 3]| p.iter().all(|c| c.is_finite());
        if primitive.positions.iter().all(is_good) {
            return;
        }
        let mut remap = vec![u32::MAX; primitive.positions.len()];
        let mut kept = Vec::new();
        for (i, p) in primitive.positions.iter().enumerate() {
            if is_good(p) {
                remap[i] = kept.len() as u32;
                kept.push(i);
            } else {
                let shown = p.map(|c| if c.is_finite() { c.into() } else { 0.0 });
                self.report
                    .nonfinite_vertices
                    .add(DVec3::from_array(shown), || format!("{place} vertex {i}"));
            }
        }
        let n_before = primitive.indices.len() / 3;
        primitive.indices = primitive
            .triples()
            .iter()
            .map(|t| t.map(|i| remap[i as usize]))
            .filter(|t| !t.contains(&u32::MAX))
            .flatten()
            .collect();
        let n_dropped = n_before - primitive.indices.len() / 3;
        self.report.n_nonfinite_triangles += n_dropped as u64;
        fn pick<T: Copy>(values: &mut Vec<T>, kept: &[usize]) {
            if !values.is_empty() {
                *values = kept.iter().map(|&i| values[i]).collect();
            }
        }
        pick(&mut primitive.positions, &kept);
        pick(&mut primitive.normals, &kept);
        pick(&mut primitive.tangents, &kept);
        pick(&mut primitive.colors, &kept);
        for set in &mut primitive.uvs {
            pick(set, &kept);
        }
        self.note(
            place,
            "coordinates that are not finite; their triangles are dropped",
        );
    }

    /// Places a mesh: decides its role, splits off see-through parts, and keeps the placement's determinant positive.
    ///
    /// A mirroring placement turns front faces into back faces. So the mesh itself is mirrored (`x` negated and the
    /// winding reversed, once for all its mirrored placements) and the placement mirrored back: every vertex stays
    /// exactly in place, and no reader of the scene needs the determinant's sign.
    pub(crate) fn place(&mut self, placement: &Placement<'_>) -> Result<(), ImportError> {
        // Counts first, so that placements that are left out cost bounded time, too.
        let n_placed = placement.transforms.len() as u64;
        self.check_objects(placement.place, n_placed)?;
        self.n_placements = self.n_placements.saturating_add(n_placed);
        let mesh = &self.scene.meshes[placement.mesh as usize];
        let n_triangles: usize = mesh.primitives.iter().map(|p| p.indices.len() / 3).sum();
        if n_triangles == 0 {
            self.note(placement.place, "an object without triangles; left out");
            return Ok(());
        }
        let source = self.origins.node(placement.source).cloned();
        let source = source.unwrap_or_default();
        if let Some(room) = self.room_of(placement.names[0], &source.extras) {
            self.check_triangles(placement.place, n_placed.saturating_mul(n_triangles as u64))?;
            return self.place_room(&room, placement, &source);
        }
        let mesh = &self.scene.meshes[placement.mesh as usize];
        let (verdict, filling, is_mixed) = self.decide(placement, mesh);
        let is_mark = matches!(verdict, RoleVerdict::Mark(_));
        let (role, reason) = match verdict {
            RoleVerdict::Ignore(reason) | RoleVerdict::Mark(reason) => {
                if is_mark {
                    self.mark_openings(placement)?;
                }
                let [own, of_mesh] = placement.names;
                let name = if own.is_empty() { of_mesh } else { own };
                self.report.leave_out(&reason, name, n_placed);
                self.note(placement.place, format!("left out: {reason}"));
                return Ok(());
            }
            RoleVerdict::Void(reason) => {
                self.note(placement.place, format!("left out: {reason}"));
                return Ok(());
            }
            RoleVerdict::Keep(role, reason) => (role, reason),
        };
        let limits = self.limits();
        self.spend(placement.place, n_placed)?;
        let n_placed_triangles = n_placed.saturating_mul(n_triangles as u64);
        self.n_triangles = self.n_triangles.saturating_add(n_placed_triangles);
        if self.n_triangles > limits.max_triangles {
            let (n, limit) = (self.n_triangles, limits.max_triangles);
            return Err(self.too_much(placement.place, "triangles", n, limit));
        }
        let name = placement
            .names
            .into_iter()
            .find(|n| !n.is_empty())
            .unwrap_or("");
        let n_text_bytes = (name.len() + reason.len()) as u64;
        self.charge_memory(placement.place, n_placed, OBJECT_BYTES + n_text_bytes)?;
        if role == Role::Structural {
            self.charge_memory(placement.place, n_placed_triangles, TRIANGLE_BYTES)?;
        }
        let parts: &[(MeshPart, Role, &str)] = if is_mixed && role == Role::Structural {
            &[
                (MeshPart::Opaque, role, ""),
                (MeshPart::SeeThrough, Role::Detail, "see-through part of: "),
            ]
        } else {
            &[(MeshPart::All, role, "")]
        };
        for &transform in placement.transforms {
            let (transform, is_mirrored) = self.unmirrored(placement, transform)?;
            for &(part, role, why) in parts {
                let mesh = self.variant(placement, is_mirrored, part)?;
                self.scene.objects.push(Object {
                    name: name.to_owned(),
                    mesh,
                    transform,
                    role,
                    reason: format!("{why}{reason}"),
                    filling,
                    node: placement.source,
                });
            }
        }
        let n_objects = self.scene.objects.len() as u64;
        if n_objects > limits.max_objects {
            return Err(self.too_much(placement.place, "objects", n_objects, limits.max_objects));
        }
        if let Some(file) = self.report.files.last_mut() {
            file.n_objects += n_placed * parts.len() as u64;
            file.n_triangles += n_placed_triangles;
        }
        Ok(())
    }

    /// Returns the verdict on a placed mesh, the opening that it says it fills, and `true` if it has both opaque and
    /// see-through parts.
    fn decide(
        &self,
        placement: &Placement<'_>,
        mesh: &Mesh,
    ) -> (RoleVerdict, Option<Filling>, bool) {
        let drawn = || mesh.primitives.iter().filter(|p| !p.indices.is_empty());
        let is_clear: Vec<bool> = drawn().map(|p| self.is_see_through(p)).collect();
        let is_mixed = is_clear.contains(&true) && is_clear.contains(&false);
        let material = |p: &Primitive| p.material.and_then(|m| self.material(m));
        let materials: Vec<&str> = drawn()
            .map(|p| material(p).map_or("", |m| &m.name))
            .collect();
        let facts = RoleFacts {
            names: placement.names,
            ancestors: placement.ancestors,
            materials: &materials,
            is_see_through: is_clear.iter().all(|&c| c),
            moves: placement.moves,
            is_detail_file: self.is_detail_file,
            thickness_if_plain: (drawn().map(|p| p.indices.len() / 3).sum::<usize>()
                <= BOX_TRIANGLES)
                .then(|| openings::thickness(mesh, placement.transforms)),
        };
        let verdict = self.options.roles.decide(&facts);
        (verdict, facts.filling(), is_mixed)
    }

    fn is_see_through(&self, primitive: &Primitive) -> bool {
        primitive
            .material
            .and_then(|m| self.material(m))
            .is_some_and(|m| m.transparent || self.options.roles.is_clear_material(&m.name))
    }

    /// Ends the import: leaves out skies and copies, drops unplaced meshes, sorts the scene, and joins vertices that quantization separated.
    pub(crate) fn finish(mut self) -> (Scene, ImportReport) {
        if !self.options.roles.is_manual {
            leave_out(&mut self.scene, &mut self.report);
        }
        let mut remap = vec![u32::MAX; self.scene.meshes.len()];
        let mut kept = Vec::new();
        for object in &mut self.scene.objects {
            let slot = &mut remap[object.mesh as usize];
            if *slot == u32::MAX {
                *slot = kept.len() as u32;
                kept.push(std::mem::take(&mut self.scene.meshes[object.mesh as usize]));
            }
            object.mesh = *slot;
        }
        self.scene.meshes = kept;
        let steps = std::mem::take(&mut self.steps).into_iter();
        let steps = steps.map(|(mesh, steps)| (remap[mesh as usize], steps));
        let mut steps = steps.collect();
        self.origins.move_into(&mut self.scene);
        if !self.options.ignores_marks {
            name_groups(&mut self.scene);
        }
        sort(&mut self.scene, &mut steps);
        let n_welded = weld_quantized(&mut self.scene, &steps);
        if n_welded > 0 {
            let text = format!(
                "quantized positions: joined {n_welded} vertices less than half a step of their grids apart"
            );
            self.report.note(&self.path, "meshes", text);
        }
        (self.scene, self.report)
    }
}

/// Largest ratio of unpacked to packed bytes that counts as read. Triangles of buildings take 18 bytes or more
/// uncompressed, and one or two compressed.
const MAX_UNPACKING: u64 = 16;
/// Most triangles of a plain object.
const BOX_TRIANGLES: usize = 12;
/// Memory of an object without its texts.
const OBJECT_BYTES: u64 = 2 * size_of::<Object>() as u64;
/// Memory of a world-space triangle in the decomposition.
const TRIANGLE_BYTES: u64 = size_of::<Triangle>() as u64;
