//! The surfaces of a world, divided by the cells that see them, for programs that load scenes and not parts of them.
//!
//! Each surface is in exactly one scene, so that whoever loads the scenes of some cells draws nothing twice. Door leaves
//! and furniture are objects with their names; walls are one object for each set of cells.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_cpg::{CellId, World, used_textures};
use enfilade_geom::DMat4;
use enfilade_geom::scene::{Image, Material, Mesh, Object, Role, Scene};
use serde::Serialize;

/// The surfaces of a world, divided by the cells that see them. [`graph_json`](super::graph_json) lists them.
pub struct SceneFiles<'a> {
    world: &'a World,
    files: Vec<SceneFile>,
    surfaces: Vec<Surfaces>,
}

/// A file, and the cells that show it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SceneFile {
    /// Name of the file: `cell-3.glb` for what only cell 3 sees, `shared-0.glb`, … for what several do, `unseen.glb`.
    pub file: String,
    /// Ids of all cells that see what is in it, ascending.
    pub cells: Vec<u32>,
}

/// Indices of batches and of detail objects.
#[derive(Default)]
struct Surfaces {
    batches: Vec<usize>,
    details: Vec<usize>,
}

impl<'a> SceneFiles<'a> {
    /// Divides the surfaces of a world. Time: linear in the batches and objects, but for sorting.
    #[must_use]
    pub fn of(world: &'a World) -> Self {
        let mut by_cells: BTreeMap<&[CellId], Surfaces> = BTreeMap::new();
        for (i, batch) in world.batches.iter().enumerate() {
            by_cells.entry(&batch.cells).or_default().batches.push(i);
        }
        for (i, detail) in world.details.iter().enumerate() {
            by_cells.entry(&detail.cells).or_default().details.push(i);
        }
        let mut n_shared = 0;
        let mut name = |cells: &[CellId]| match cells {
            [] => "unseen.glb".to_owned(),
            [cell] => format!("cell-{}.glb", cell.0),
            _ => {
                n_shared += 1;
                format!("shared-{}.glb", n_shared - 1)
            }
        };
        let files = by_cells.keys().map(|cells| SceneFile {
            file: name(cells),
            cells: cells.iter().map(|c| c.0).collect(),
        });
        Self {
            world,
            files: files.collect(),
            surfaces: by_cells.into_values().collect(),
        }
    }

    /// Returns the files, in the order of the sets of cells.
    #[must_use]
    pub fn files(&self) -> &[SceneFile] {
        &self.files
    }

    /// Returns each file's name and scene, made one by one. A scene has only the materials and pictures that it shows.
    pub fn scenes(&self) -> impl Iterator<Item = (&str, Scene)> {
        let each = self.files.iter().zip(&self.surfaces);
        each.map(|(file, surfaces)| (file.file.as_str(), self.scene(file, surfaces)))
    }

    fn scene(&self, file: &SceneFile, surfaces: &Surfaces) -> Scene {
        let world = self.world;
        let mut scene = Scene::default();
        let name = file.file.trim_end_matches(".glb");
        let batches = surfaces.batches.iter().map(|&b| &world.batches[b]);
        scene.meshes.push(Mesh {
            name: name.to_owned(),
            primitives: batches.map(|b| b.primitive.clone()).collect(),
        });
        scene.objects.push(object(name, 0, DMat4::IDENTITY));
        let mut meshes: BTreeMap<u32, u32> = BTreeMap::new();
        for &d in &surfaces.details {
            let detail = &world.details[d];
            let mesh = *meshes.entry(detail.mesh).or_insert_with(|| {
                scene
                    .meshes
                    .push(world.detail_meshes[detail.mesh as usize].clone());
                scene.meshes.len() as u32 - 1
            });
            let transform = DMat4::from_cols_array(&detail.transform.map(f64::from));
            scene.objects.push(object(&detail.name, mesh, transform));
        }
        let primitives = scene.meshes.iter().flat_map(|m| &m.primitives);
        let materials: BTreeSet<usize> = primitives
            .filter_map(|p| p.material.map(|m| m as usize))
            .collect();
        let textures = materials
            .iter()
            .flat_map(|&m| used_textures(&world.materials[m].gltf));
        let images: BTreeSet<usize> = textures
            .filter_map(|t| world.textures.get(t as usize)?.image)
            .map(|i| i as usize)
            .collect();
        // Numbers stay as they are: what the scene doesn't show is empty.
        scene.materials = kept(&world.materials, &materials, Material::default);
        scene.images = kept(&world.images, &images, Image::default);
        scene.textures.clone_from(&world.textures);
        scene
    }
}

fn kept<T: Clone>(all: &[T], used: &BTreeSet<usize>, empty: impl Fn() -> T) -> Vec<T> {
    let each = all.iter().enumerate();
    each.map(|(i, one)| {
        if used.contains(&i) {
            one.clone()
        } else {
            empty()
        }
    })
    .collect()
}

fn object(name: &str, mesh: u32, transform: DMat4) -> Object {
    Object {
        name: name.to_owned(),
        mesh,
        transform,
        role: Role::Detail,
        reason: String::new(),
        filling: None,
        node: None,
    }
}
