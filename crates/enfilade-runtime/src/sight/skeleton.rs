//! Information about the triangles of a world that answers of a sight need.

use enfilade_cpg::{Batch, FittingPart, SourceRuns, VisibleParts, World};
use enfilade_geom::scene::{Image, Mesh, Primitive};

use super::drawn::Detail;
use crate::chunks::Chunk;
use crate::doors::Doors;
use crate::occluder::Occluders;
use crate::options::SightOptions;
use crate::sight_error::SightError;

/// All that a [`Sight`](crate::Sight) takes from the triangles of a world: boxes and sizes of chunks and objects, large polygons
/// that hide, and precomputed visibility by chunk. About 28 bytes per chunk, 52 per object, 100 to 270 per polygon.
///
/// A *hollow* world is one whose triangles and pictures come and go. It has the graph, materials, placed objects, and as many
/// batches, meshes and images as the whole, but these may be empty at any time; [`SightSkeleton::hollow`] makes one.
/// [`Sight::build_hollow`](crate::Sight::build_hollow) answers for it exactly as for the whole world.
///
/// ```
/// use enfilade_runtime::{Sight, SightSkeleton};
/// use enfilade_testkit::{GridParams, room_grid};
///
/// // Once, by who stores the world in pieces.
/// let whole = room_grid(&GridParams::offices(20, 1));
/// let bytes = Sight::build(&whole)?.skeleton().encode();
/// let hollow = SightSkeleton::hollow(&whole);
///
/// // By who loads it.
/// let sight = Sight::build_hollow(&hollow, SightSkeleton::decode(&bytes)?)?;
/// assert!(sight.indices(3).is_empty());
/// // When the triangles of a batch arrive:
/// let order = sight.chunk_order(3, &whole.batches[3].primitive)?;
/// assert_eq!(order.len(), whole.batches[3].primitive.indices.len());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # What needs the triangles themselves
///
/// Everything that meets surfaces answers from the triangles that its world has when it is built: picking and lines of sight
/// ([`Sightlines`](crate::Sightlines)), contacts of bodies, walkers and casts (`enfilade_world`). In a hollow world,
/// absent walls stop nothing there. Shut portals and leaves of doors do: their shapes are in the graph, and leaves are kept.
#[derive(Clone, Debug)]
pub struct SightSkeleton {
    pub(super) options: SightOptions,
    pub(super) n_cells: usize,
    pub(crate) chunks: Vec<Chunk>,
    pub(crate) details: Vec<Detail>,
    /// Per batch: the area of its triangles. [Units: wu²]
    pub(super) areas: Vec<f32>,
    pub(crate) occluders: Occluders,
    /// Per cell of the eye: the chunks and details (from `chunks.len()` on) that may be seen from it, if the world has that
    /// information.
    pub(crate) seen_from: Option<VisibleParts>,
    /// Number of vertices and of indices of all batches and meshes, each mesh once.
    pub(super) sizes: [u64; 2],
    /// Largest absolute coordinate of what is drawn, or 1. [Units: wu]
    pub(super) extent: f64,
}

impl SightSkeleton {
    /// Returns a world without triangles and pictures: its batches, meshes and images are there, but empty. Leaves of doors keep
    /// their meshes, since their sweep is part of every answer. Materials of batches stay, names of their triangles do not;
    /// precomputed visibility stays by cell, that by triangle is in the skeleton.
    #[must_use]
    pub fn hollow(world: &World) -> World {
        let mut is_leaf = vec![false; world.detail_meshes.len()];
        let fittings = world.graph.portals.iter().flat_map(|p| &p.fittings);
        for fitting in fittings.filter(|f| f.part == FittingPart::Leaf) {
            let object = world.details.get(fitting.detail as usize);
            if let Some(is_leaf) = object.and_then(|o| is_leaf.get_mut(o.mesh as usize)) {
                *is_leaf = true;
            }
        }
        let batch = |batch: &Batch| Batch {
            cells: batch.cells.clone(),
            primitive: Primitive {
                material: batch.primitive.material,
                ..Primitive::default()
            },
            sources: SourceRuns::default(),
            is_seal: batch.is_seal,
        };
        let mesh = |(mesh, is_leaf): (&Mesh, bool)| Mesh {
            name: mesh.name.clone(),
            primitives: if is_leaf {
                mesh.primitives.clone()
            } else {
                Vec::new()
            },
        };
        let image = |image: &Image| Image {
            bytes: Vec::new(),
            name: image.name.clone(),
            mime: image.mime.clone(),
        };
        let mut pvs = world.pvs.clone();
        if let Some(pvs) = &mut pvs {
            pvs.parts = None;
        }
        World {
            graph: world.graph.clone(),
            batches: world.batches.iter().map(batch).collect(),
            details: world.details.clone(),
            detail_meshes: world.detail_meshes.iter().zip(is_leaf).map(mesh).collect(),
            materials: world.materials.clone(),
            textures: world.textures.clone(),
            images: world.images.iter().map(image).collect(),
            leak_path: world.leak_path.clone(),
            sources: world.sources.clone(),
            fixtures: world.fixtures.clone(),
            about: world.about.clone(),
            pvs,
            room_facts: world.room_facts.clone(),
        }
    }

    /// Returns the options that the sight was built with; chunks follow from them.
    #[must_use]
    #[doc(hidden)]
    pub fn options(&self) -> &SightOptions {
        &self.options
    }

    /// Returns the number of vertices and of indices of all batches and meshes of the whole world, each mesh once.
    #[must_use]
    pub fn sizes(&self) -> [u64; 2] {
        self.sizes
    }

    /// Returns the number of triangles, those of placed details included. O(chunks and details).
    pub(super) fn n_triangles(&self) -> u64 {
        let chunks = self.chunks.iter().map(|c| u64::from(c.n_triangles()));
        let details = self.details.iter().map(|d| u64::from(d.n_triangles));
        chunks.sum::<u64>() + details.sum::<u64>()
    }

    /// Checks that this may be the skeleton of a hollow world.
    pub(super) fn check(&self, world: &World, doors: &Doors) -> Result<(), SightError> {
        let same = |what, skeleton: usize, world: usize| {
            let other = SightError::OtherSkeleton {
                what,
                skeleton,
                world,
            };
            (skeleton == world).then_some(()).ok_or(other)
        };
        same("cells", self.n_cells, world.graph.cells.len())?;
        same("batches", self.areas.len(), world.batches.len())?;
        same("objects", self.details.len(), world.details.len())?;
        let n_cells = world.graph.cells.len();
        for (index, batch) in (0..).zip(&world.batches) {
            if batch.cells.iter().any(|c| c.idx() >= n_cells) {
                let what = "batch";
                return Err(SightError::Geometry { what, index });
            }
        }
        for (index, (object, known)) in (0..).zip(world.details.iter().zip(&self.details)) {
            let mesh = world.detail_meshes.get(object.mesh as usize);
            let is_good = object.cells.iter().all(|c| c.idx() < n_cells);
            let Some(mesh) = mesh.filter(|_| is_good) else {
                let what = "detail";
                return Err(SightError::Geometry { what, index });
            };
            if doors.way(index).is_some() {
                let n: usize = mesh.primitives.iter().map(|p| p.triples().len()).sum();
                same("triangles in a leaf", known.n_triangles as usize, n)?;
            }
        }
        Ok(())
    }
}
