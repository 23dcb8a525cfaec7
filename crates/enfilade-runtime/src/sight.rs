//! A world prepared for visibility queries.

mod drawn;
mod portals;
mod skeleton;
mod skeleton_bytes;
mod trees;

use std::sync::Arc;

use enfilade_cpg::{CellId, Locator, PortalId, World};
use enfilade_geom::DVec3;
use enfilade_geom::scene::Primitive;

use crate::boxes::{BoxTrees, Root};
use crate::chunks::{Chunk, chunks_of};
use crate::doors::{Doors, Leaf};
use crate::exits::{Exit, Group, Runs, group};
use crate::occluder::occluders_of;
use crate::options::SightOptions;
use crate::point::point;
use crate::seen::DetailId;
use drawn::{Drawn, is_drawable};
use portals::Portals;
use trees::Boxes;

use crate::sight_error::SightError;

pub use skeleton::SightSkeleton;
pub use skeleton_bytes::SkeletonError;

/// A world prepared for visibility queries: contiguous portals, exits by cell, boxes in trees.
///
/// Build it once; any number of [`Viewer`](crate::Viewer)s on any threads can share it.
#[derive(Clone, Debug)]
pub struct Sight {
    pub(crate) locator: Arc<Locator>,
    /// Exits of cell `c` are `exits[first_exit[c]..first_exit[c + 1]]`.
    first_exit: Vec<u32>,
    exits: Vec<Exit>,
    /// Groups of the exits of cell `c` are `groups[first_group[c]..first_group[c + 1]]`.
    first_group: Vec<u32>,
    groups: Vec<Group>,
    pub(crate) corners: Vec<[f32; 3]>,
    pub(crate) trees: BoxTrees,
    /// Per cell: its chunks, then its details (from `chunks.len()` on).
    pub(crate) cell_roots: Vec<Root>,
    /// Items that no cell sees, inside walls; for eyes that are there.
    pub(crate) unlisted_root: Root,
    /// Over the boxes of cells, each with everything listed in it.
    pub(crate) world_root: Root,
    pub(crate) drawn: SightSkeleton,
    /// Per batch: its triangles as index triples, sorted so that chunks are ranges; empty in a hollow world.
    indices: Vec<Vec<u32>>,
    pub(crate) doors: Arc<Doors>,
    pub(crate) n_portals: usize,
    n_specials: usize,
    n_triangles: u64,
    /// Largest error of a stored outline. [Units: wu]
    pub(crate) tolerance: f64,
    /// Largest absolute coordinate. [Units: wu]
    pub(crate) extent: f64,
}

impl Sight {
    /// Prepares `world` with default options.
    ///
    /// # Errors
    ///
    /// If [`World::validate`] would refuse the world; decoded worlds always pass.
    pub fn build(world: &World) -> Result<Self, SightError> {
        Self::build_with(world, &SightOptions::default())
    }

    /// Prepares `world`. O(n log n) in its triangles, details and portals.
    ///
    /// # Errors
    ///
    /// As [`Sight::build`].
    pub fn build_with(world: &World, options: &SightOptions) -> Result<Self, SightError> {
        let doors = Doors::of(world)?;
        let drawn = Drawn::of(world, options)?;
        let portals = Portals::of(&world.graph)?;
        let tolerance = portals.tolerance(drawn.extent);
        let skeleton = SightSkeleton {
            options: *options,
            n_cells: world.graph.cells.len(),
            occluders: occluders_of(world, options, tolerance),
            seen_from: drawn.seen_from(world, &doors),
            chunks: drawn.chunks,
            details: drawn.details,
            areas: drawn.areas,
            sizes: drawn.sizes,
            extent: drawn.extent,
        };
        Ok(Self::assemble(
            world,
            skeleton,
            drawn.indices,
            doors,
            portals,
        ))
    }

    /// Prepares a *hollow* world, whose triangles come and go: see [`SightSkeleton`]. Answers exactly as the `Sight` of the
    /// whole world that `skeleton` is of; only [`Sight::indices`] are empty. O(n log n) in chunks, details and portals.
    ///
    /// # Errors
    ///
    /// As [`Sight::build`], and if the skeleton does not fit the world.
    pub fn build_hollow(world: &World, skeleton: SightSkeleton) -> Result<Self, SightError> {
        let doors = Doors::of(world)?;
        skeleton.check(world, &doors)?;
        let portals = Portals::of(&world.graph)?;
        let indices = vec![Vec::new(); skeleton.areas.len()];
        Ok(Self::assemble(world, skeleton, indices, doors, portals))
    }

    fn assemble(
        world: &World,
        drawn: SightSkeleton,
        indices: Vec<Vec<u32>>,
        doors: Doors,
        mut portals: Portals,
    ) -> Self {
        let n_cells = world.graph.cells.len();
        let extent = drawn.extent.max(portals.extent);
        let tolerance = portals.tolerance(drawn.extent);
        let (first_exit, mut exits) = portals.by_cell(n_cells);
        let (mut first_group, mut groups) = (vec![0], Vec::new());
        for c in 0..n_cells {
            let own = &mut exits[first_exit[c] as usize..first_exit[c + 1] as usize];
            let size = drawn.options.portal_group;
            group(own, &portals.corners, size, tolerance, &mut groups);
            first_group.push(groups.len() as u32);
        }
        let boxes = Boxes::of(world, &drawn, &doors, tolerance);
        let n_triangles = drawn.n_triangles();
        Self {
            locator: world.graph.locator.clone(),
            first_exit,
            exits,
            first_group,
            groups,
            corners: portals.corners,
            trees: boxes.trees,
            cell_roots: boxes.cell_roots,
            unlisted_root: boxes.unlisted_root,
            world_root: boxes.world_root,
            drawn,
            indices,
            doors: Arc::new(doors),
            n_portals: world.graph.portals.len(),
            n_specials: world.graph.specials.len(),
            n_triangles,
            tolerance,
            extent: extent.max(boxes.extent),
        }
    }

    /// Returns all that this took from the world's triangles, to be stored beside a hollow world.
    #[must_use]
    pub fn skeleton(&self) -> &SightSkeleton {
        &self.drawn
    }

    /// Returns the number of cells.
    #[must_use]
    pub fn n_cells(&self) -> usize {
        self.cell_roots.len()
    }

    /// Returns the number of portals.
    #[must_use]
    pub fn n_portals(&self) -> usize {
        self.n_portals
    }

    /// Returns the number of special portals.
    #[must_use]
    #[doc(hidden)]
    pub fn n_specials(&self) -> usize {
        self.n_specials
    }

    /// Returns the number of structural batches.
    #[must_use]
    #[doc(hidden)]
    pub fn n_batches(&self) -> usize {
        self.indices.len()
    }

    /// Returns the number of triangles, those of placed details included.
    #[must_use]
    pub fn n_triangles(&self) -> u64 {
        self.n_triangles
    }

    /// Returns the chunks of the structural batches, indexed by [`ChunkId`](crate::ChunkId).
    #[must_use]
    pub fn chunks(&self) -> &[Chunk] {
        &self.drawn.chunks
    }

    /// Returns the chunks of a batch as a range of [`Sight::chunks`]; empty for a batch that does not exist. O(log n).
    #[must_use]
    #[doc(hidden)]
    pub fn chunks_of(&self, batch: u32) -> std::ops::Range<u32> {
        let chunks = &self.drawn.chunks;
        let first = chunks.partition_point(|c| c.batch < batch);
        let n = chunks[first..].partition_point(|c| c.batch == batch);
        first as u32..(first + n) as u32
    }

    /// Returns the area of a batch's triangles; 0 for a batch that does not exist. [Units: wu²]
    #[must_use]
    #[doc(hidden)]
    pub fn batch_area(&self, batch: u32) -> f32 {
        self.drawn.areas.get(batch as usize).copied().unwrap_or(0.0)
    }

    /// Returns minimum and maximum of a detail object in the model's pose; `None` without vertices, or if it does not exist.
    /// [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn detail_box(&self, detail: DetailId) -> Option<[DVec3; 2]> {
        let bounds = self.drawn.details.get(detail.0 as usize)?.bounds;
        (!bounds.is_empty()).then_some([bounds.min, bounds.max])
    }

    /// Returns the triangles of a batch that has arrived, as [`Sight::indices`] of the whole world has them.
    /// O(n log n) in them; independent of what else is there, so that it may run beside a frame.
    ///
    /// # Errors
    ///
    /// If `primitive` is not the batch's.
    #[doc(hidden)]
    pub fn chunk_order(&self, batch: u32, primitive: &Primitive) -> Result<Vec<u32>, SightError> {
        let own = self.chunks_of(batch);
        let own = &self.drawn.chunks[own.start as usize..own.end as usize];
        let mut found = Vec::new();
        let mut order = Vec::new();
        if is_drawable(primitive) {
            let size = self.drawn.options.chunk_triangles.max(1);
            order = chunks_of(batch, primitive, size, &mut found).indices;
        }
        let is_same = (batch as usize) < self.n_batches() && found == own;
        is_same
            .then_some(order)
            .ok_or(SightError::OtherBatch { batch })
    }

    /// Returns the triangles of a batch as triples of indices into its positions, ordered so that every
    /// [`Chunk`] is a range. Draw these instead of the batch's own indices. Empty for a batch that does not
    /// exist, and in a hollow world: see [`Sight::chunk_order`].
    #[must_use]
    pub fn indices(&self, batch: u32) -> &[u32] {
        self.indices.get(batch as usize).map_or(&[], Vec::as_slice)
    }

    /// Returns the number of triangles of a detail object; 0 for one that does not exist.
    #[must_use]
    #[doc(hidden)]
    pub fn detail_triangles(&self, detail: u32) -> u32 {
        let details = &self.drawn.details;
        details.get(detail as usize).map_or(0, |d| d.n_triangles)
    }

    /// Returns the leaves of a portal: the objects that shut it, and their motions. Empty if the world records none.
    #[must_use]
    pub fn leaves(&self, portal: PortalId) -> &[Leaf] {
        self.doors.leaves(portal)
    }

    /// Returns the portals of which an object is a leaf, in ascending order; empty for all other objects.
    pub fn portals_of(&self, detail: DetailId) -> impl Iterator<Item = PortalId> {
        let slot = self.doors.slot(detail);
        let portals = slot.map_or(&[][..], |s| self.doors.portals(s));
        portals.iter().map(|&p| PortalId(p))
    }

    /// Returns the cells that an object is in, in ascending order; for a leaf, all that it sweeps.
    ///
    /// # Panics
    ///
    /// If `world` is not the one that this was built from.
    #[must_use]
    pub fn cells_of_detail(&self, world: &World, detail: DetailId) -> Vec<CellId> {
        let mut cells = world[detail].cells.clone();
        if let Some((_, way)) = self.doors.way(detail.0) {
            cells.extend_from_slice(way);
            cells.sort_unstable();
            cells.dedup();
        }
        cells
    }

    /// Returns the distance of the middle of a portal's shut leaves from its plane, along its normal: a panel at that distance
    /// that fills the opening is hidden by them. 0 without leaves. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn depth_of_leaves(&self, portal: PortalId) -> f32 {
        self.doors.depth(portal)
    }

    /// Returns the cell of a point; `None` in solid matter. Takes about 100 ns.
    #[must_use]
    pub fn locate(&self, p: [f32; 3]) -> Option<CellId> {
        self.locator.locate(point(p))
    }

    /// Returns the largest error of a stored outline; all answers allow for it. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn tolerance(&self) -> f64 {
        self.tolerance
    }

    #[inline]
    pub(crate) fn exits_of(&self, cell: u32) -> &[Exit] {
        let c = cell as usize;
        &self.exits[self.first_exit[c] as usize..self.first_exit[c + 1] as usize]
    }

    /// As [`Sight::exits_of`], without the exits in groups that the caller skips.
    #[inline]
    pub(crate) fn runs_of(&self, cell: u32) -> Runs<'_> {
        let c = cell as usize;
        let groups = self.first_group[c] as usize..self.first_group[c + 1] as usize;
        Runs::new(self.exits_of(cell), &self.groups[groups])
    }

    /// Returns `true` if a point of an exit's plane lies in its outline, or within `near` of the line of each edge.
    pub(crate) fn is_in_outline(&self, exit: &Exit, p: DVec3, near: f64) -> bool {
        let normal = point(exit.normal);
        let corners = self.corners_of(exit);
        let turn = if exit.is_turned { 1.0 } else { -1.0 };
        (0..corners.len()).all(|i| {
            let a = point(corners[i]);
            let along = point(corners[(i + 1) % corners.len()]) - a;
            let inward = normal.cross(along) * turn;
            inward.dot(p - a) >= -near * inward.length()
        })
    }

    #[inline]
    pub(crate) fn corners_of(&self, exit: &Exit) -> &[[f32; 3]] {
        &self.corners[exit.first_corner as usize..(exit.first_corner + exit.n_corners) as usize]
    }
}
