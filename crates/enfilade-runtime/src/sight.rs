//! What is made once from a world, to be asked many times.

use enfilade_cpg::{CellId, Locator, Portal, PortalId, World};
use enfilade_geom::{Aabb, DMat4, DVec2, DVec3, Plane, Winding, world_tolerance};

use crate::boxes::{BoxTrees, Boxed, Root};
use crate::chunks::{Chunk, chunks_of};
use crate::exits::{Exit, Group, Runs, group};
use crate::occluder::{Occluders, occluders_of};
use crate::options::SightOptions;
use crate::point::point;
use crate::region::{MAX_CORNERS, reduced_around};

/// Why a world cannot be asked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SightError {
    /// A portal joins a cell to itself or to one that does not exist.
    #[error("portal {portal} joins cells {cells:?}; they must differ and lie below {n_cells}")]
    PortalCells {
        /// The portal.
        portal: u32,
        /// The cells that it names.
        cells: [u32; 2],
        /// How many cells there are.
        n_cells: usize,
    },
    /// A portal's outline is not finite, or has no area.
    #[error("portal {portal}: its outline of {n_corners} corners is no polygon with an area")]
    PortalOutline {
        /// The portal.
        portal: u32,
        /// Corners of its outline.
        n_corners: usize,
    },
    /// A batch or detail names a cell, mesh or corner that does not exist, or a corner that is not
    /// finite.
    #[error("{what} {index} names a cell, mesh or corner that does not exist or is not finite")]
    Geometry {
        /// `batch` or `detail`.
        what: &'static str,
        /// Which one.
        index: u32,
    },
}

/// A detail object, placed.
#[derive(Clone, Debug)]
pub(crate) struct Detail {
    pub(crate) bounds: Aabb,
    pub(crate) n_triangles: u32,
}

/// A world made ready for questions: portals side by side, exits by cell, boxes in trees.
///
/// Built once; shared by any number of [`Viewer`](crate::Viewer)s on any threads.
#[derive(Clone, Debug)]
pub struct Sight {
    pub(crate) locator: Locator,
    /// Exits of cell `c` are `exits[first_exit[c]..first_exit[c + 1]]`.
    first_exit: Vec<u32>,
    exits: Vec<Exit>,
    /// Groups of the exits of cell `c` are `groups[first_group[c]..first_group[c + 1]]`.
    first_group: Vec<u32>,
    groups: Vec<Group>,
    pub(crate) corners: Vec<[f32; 3]>,
    pub(crate) trees: BoxTrees,
    /// By cell: its chunks, then its details (from `chunks.len()` on).
    pub(crate) cell_roots: Vec<Root>,
    /// What no cell sees: the insides of walls. For eyes that are there.
    pub(crate) unlisted_root: Root,
    /// Over the boxes of cells with all that is listed in them.
    pub(crate) world_root: Root,
    pub(crate) chunks: Vec<Chunk>,
    pub(crate) details: Vec<Detail>,
    pub(crate) occluders: Occluders,
    /// By batch: its triangles as index triples, sorted so that chunks are ranges.
    indices: Vec<Vec<u32>>,
    pub(crate) n_portals: usize,
    pub(crate) n_triangles: u64,
    /// How far a stored outline may be off. [Units: wu]
    pub(crate) tolerance: f64,
    /// Largest absolute coordinate. [Units: wu]
    pub(crate) extent: f64,
}

/// Pieces are used instead of the outline where there are at most so many.
const MAX_PIECES: usize = 4;
/// ... and where they fill less of the outline than this.
const PIECES_SHARE: f64 = 0.75;

impl Sight {
    /// Makes `world` ready, with default options.
    ///
    /// # Errors
    ///
    /// A world that [`World::validate`] would refuse; decoded worlds never are.
    pub fn build(world: &World) -> Result<Self, SightError> {
        Self::build_with(world, &SightOptions::default())
    }

    /// Makes `world` ready. O(n log n) in its triangles, details and portals.
    ///
    /// # Errors
    ///
    /// As [`Sight::build`].
    pub fn build_with(world: &World, options: &SightOptions) -> Result<Self, SightError> {
        let n_cells = world.graph.cells.len();
        let lists = |cells: &[CellId]| cells.iter().all(|c| (c.0 as usize) < n_cells);

        let mut chunks = Vec::new();
        let mut indices = Vec::new();
        let mut extent = 1.0_f64;
        for (index, batch) in world.batches.iter().enumerate() {
            let index = index as u32;
            let broken = || SightError::Geometry {
                what: "batch",
                index,
            };
            let positions = &batch.primitive.positions;
            let used = &batch.primitive.indices;
            let is_good = lists(&batch.cells)
                && used.iter().all(|&i| (i as usize) < positions.len())
                && positions.iter().flatten().all(|x| x.is_finite());
            if !is_good {
                return Err(broken());
            }
            for p in positions {
                extent = extent.max(point(*p).abs().max_element());
            }
            let size = options.chunk_triangles.max(1);
            indices.push(chunks_of(index, &batch.primitive, size, &mut chunks));
        }

        let mut details = Vec::new();
        for (index, detail) in world.details.iter().enumerate() {
            let broken = || SightError::Geometry {
                what: "detail",
                index: index as u32,
            };
            let mesh = world.detail_meshes.get(detail.mesh as usize);
            let mesh = mesh.filter(|_| lists(&detail.cells)).ok_or_else(broken)?;
            let transform = DMat4::from_cols_array(&detail.transform.map(f64::from));
            let mut bounds = Aabb::EMPTY;
            let mut n_triangles = 0;
            for primitive in &mesh.primitives {
                n_triangles += primitive.indices.len() as u32 / 3;
                for p in &primitive.positions {
                    let p = transform.transform_point3(point(*p));
                    if !p.is_finite() {
                        return Err(broken());
                    }
                    bounds = bounds.including(p);
                    extent = extent.max(p.abs().max_element());
                }
            }
            details.push(Detail {
                bounds,
                n_triangles,
            });
        }

        let mut portals = Portals::default();
        for (i, portal) in world.graph.portals.iter().enumerate() {
            portals.add(PortalId(i as u32), portal, n_cells)?;
        }
        extent = extent.max(portals.extent);
        // What a builder may snap and a file may round, of outline and wall each; `enfilade-verify`
        // judges by the same measure.
        let tolerance = (2.0 * world_tolerance(extent)).max(portals.off_plane);
        let (first_exit, mut exits) = portals.by_cell(n_cells);
        let (mut first_group, mut groups) = (vec![0], Vec::new());
        for c in 0..n_cells {
            let own = &mut exits[first_exit[c] as usize..first_exit[c + 1] as usize];
            let size = options.portal_group;
            group(own, &portals.corners, size, tolerance, &mut groups);
            first_group.push(groups.len() as u32);
        }

        let mut listed: Vec<Vec<Boxed>> = (0..n_cells).map(|_| Vec::new()).collect();
        let mut unlisted = Vec::new();
        for (i, chunk) in chunks.iter().enumerate() {
            if world.batches[chunk.batch as usize].cells.is_empty() {
                unlisted.push(Boxed {
                    bounds: chunk.bounds(),
                    item: i as u32,
                });
            }
            for c in &world.batches[chunk.batch as usize].cells {
                listed[c.0 as usize].push(Boxed {
                    bounds: chunk.bounds(),
                    item: i as u32,
                });
            }
        }
        for (i, detail) in details.iter().enumerate() {
            if world.details[i].cells.is_empty() {
                unlisted.push(Boxed {
                    bounds: detail.bounds,
                    item: (chunks.len() + i) as u32,
                });
            }
            for c in &world.details[i].cells {
                listed[c.0 as usize].push(Boxed {
                    bounds: detail.bounds,
                    item: (chunks.len() + i) as u32,
                });
            }
        }
        let mut trees = BoxTrees::default();
        let mut boxes = Vec::new();
        let mut cell_roots = Vec::new();
        for (c, items) in listed.iter_mut().enumerate() {
            let [low, high] = world.graph.cells[c].aabb.map(point);
            let mut bounds = Aabb::EMPTY;
            if low.is_finite() && high.is_finite() {
                bounds = bounds.union(Aabb::new(low, high));
            }
            let bounds = items.iter().fold(bounds, |b, i| b.union(i.bounds));
            if !bounds.is_empty() {
                extent = extent.max(bounds.min.abs().max(bounds.max.abs()).max_element());
                boxes.push(Boxed {
                    bounds,
                    item: c as u32,
                });
            }
            cell_roots.push(trees.add(items, tolerance));
        }
        let world_root = trees.add(&mut boxes, tolerance);
        let unlisted_root = trees.add(&mut unlisted, tolerance);
        let occluders = occluders_of(world, options, tolerance);
        let n_triangles = chunks
            .iter()
            .map(|c| u64::from(c.n_triangles()))
            .sum::<u64>()
            + details
                .iter()
                .map(|d| u64::from(d.n_triangles))
                .sum::<u64>();
        Ok(Self {
            locator: world.graph.locator.clone(),
            first_exit,
            exits,
            first_group,
            groups,
            corners: portals.corners,
            trees,
            cell_roots,
            unlisted_root,
            world_root,
            chunks,
            details,
            occluders,
            indices,
            n_portals: world.graph.portals.len(),
            n_triangles,
            tolerance,
            extent,
        })
    }

    /// How many cells there are.
    #[must_use]
    pub fn n_cells(&self) -> usize {
        self.cell_roots.len()
    }

    /// How many portals there are.
    #[must_use]
    pub fn n_portals(&self) -> usize {
        self.n_portals
    }

    /// How many structural batches there are.
    #[must_use]
    pub fn n_batches(&self) -> usize {
        self.indices.len()
    }

    /// Structural triangles and those of placed details.
    #[must_use]
    pub fn n_triangles(&self) -> u64 {
        self.n_triangles
    }

    /// The chunks that structural batches are divided into, by [`ChunkId`](crate::ChunkId).
    #[must_use]
    pub fn chunks(&self) -> &[Chunk] {
        &self.chunks
    }

    /// The triangles of a batch, as triples of indices into its positions, in an order in which every
    /// [`Chunk`] is a range. To be drawn instead of the batch's own; empty for a batch that does not
    /// exist.
    #[must_use]
    pub fn indices(&self, batch: u32) -> &[u32] {
        self.indices.get(batch as usize).map_or(&[], Vec::as_slice)
    }

    /// Triangles of a detail object; 0 for one that does not exist.
    #[must_use]
    pub fn detail_triangles(&self, detail: u32) -> u32 {
        self.details
            .get(detail as usize)
            .map_or(0, |d| d.n_triangles)
    }

    /// The cell of a point; `None` in solid matter. About 100 ns.
    #[must_use]
    pub fn locate(&self, p: [f32; 3]) -> Option<CellId> {
        self.locator.locate(point(p))
    }

    /// How far a stored outline may be off the true opening: all answers allow for it. [Units: wu]
    #[must_use]
    pub fn tolerance(&self) -> f64 {
        self.tolerance
    }

    #[inline]
    pub(crate) fn exits_of(&self, cell: u32) -> &[Exit] {
        let c = cell as usize;
        &self.exits[self.first_exit[c] as usize..self.first_exit[c + 1] as usize]
    }

    /// The same, without those in groups that the caller skips.
    #[inline]
    pub(crate) fn runs_of(&self, cell: u32) -> Runs<'_> {
        let c = cell as usize;
        let groups = self.first_group[c] as usize..self.first_group[c + 1] as usize;
        Runs::new(self.exits_of(cell), &self.groups[groups])
    }

    /// Whether a point of an exit's plane lies in its outline, or within `near` of each edge's line.
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

/// Exits while they are collected.
#[derive(Default)]
struct Portals {
    /// With the cell that each leaves.
    exits: Vec<(u32, Exit)>,
    corners: Vec<[f32; 3]>,
    extent: f64,
    off_plane: f64,
}

impl Portals {
    fn add(&mut self, id: PortalId, portal: &Portal, n_cells: usize) -> Result<(), SightError> {
        let cells = portal.cells.map(|c| c.0);
        if cells[0] == cells[1] || cells.iter().any(|&c| c as usize >= n_cells) {
            return Err(SightError::PortalCells {
                portal: id.0,
                cells,
                n_cells,
            });
        }
        let outline = || SightError::PortalOutline {
            portal: id.0,
            n_corners: portal.outline.len(),
        };
        let normal = point(portal.normal).try_normalize().ok_or_else(outline)?;
        let whole = convex(&portal.outline, normal).ok_or_else(outline)?;
        let pieces: Vec<Winding> = portal
            .pieces
            .iter()
            .filter_map(|p| convex(p, normal))
            .collect();
        // A piece that is no polygon may be a sliver by rounding, and light passes it all the same.
        let is_whole = pieces.len() != portal.pieces.len();
        let area: f64 = pieces.iter().map(Winding::area).sum();
        let openings = if is_whole
            || pieces.is_empty()
            || pieces.len() > MAX_PIECES
            || area > PIECES_SHARE * whole.area()
        {
            vec![whole]
        } else {
            pieces
        };
        for opening in openings {
            self.add_opening(id, cells, &opening, normal);
        }
        Ok(())
    }

    fn add_opening(&mut self, id: PortalId, cells: [u32; 2], opening: &Winding, normal: DVec3) {
        // Bounds are rounded to the `f32` in which they are read.
        let center = opening.aabb().center().as_vec3();
        let middle = center.as_dvec3();
        let first_corner = self.corners.len() as u32;
        let (mut radius, n_corners) = (0.0_f64, opening.points.len() as u32);
        for &p in &opening.points {
            radius = radius.max(p.distance(middle));
            self.off_plane = self.off_plane.max(normal.dot(p - middle).abs());
            self.extent = self.extent.max(p.abs().max_element());
            self.corners.push(p.as_vec3().to_array());
        }
        let n = normal.as_vec3();
        for (from, to, normal, is_turned) in [
            (cells[0], cells[1], n, true),
            (cells[1], cells[0], -n, false),
        ] {
            self.exits.push((
                from,
                Exit {
                    center: center.to_array(),
                    radius: (radius as f32).next_up(),
                    normal: normal.to_array(),
                    to,
                    portal: id.0,
                    first_corner,
                    n_corners,
                    is_turned,
                },
            ));
        }
    }

    fn by_cell(&mut self, n_cells: usize) -> (Vec<u32>, Vec<Exit>) {
        self.exits.sort_by_key(|(from, _)| *from);
        let mut first = vec![0; n_cells + 1];
        for (from, _) in &self.exits {
            first[*from as usize + 1] += 1;
        }
        for c in 0..n_cells {
            first[c + 1] += first[c];
        }
        (first, self.exits.iter().map(|(_, e)| *e).collect())
    }
}

/// The convex polygon around corners of a plane, counter-clockwise about `normal`, of at most
/// `MAX_CORNERS`; `None` without an area, or with a corner that is not finite.
fn convex(corners: &[[f32; 3]], normal: DVec3) -> Option<Winding> {
    if corners.len() < 3 || corners.iter().flatten().any(|x| !x.is_finite()) {
        return None;
    }
    let points: Vec<DVec3> = corners.iter().map(|p| point(*p)).collect();
    let middle = points.iter().sum::<DVec3>() / points.len() as f64;
    let plane = Plane::through(middle, normal);
    let hull = Winding::hull_in_plane(&plane, &points);
    // Corners that rounding put off the hull are what the tolerance is for.
    if hull.points.len() < 3 {
        return None;
    }
    if hull.points.len() <= MAX_CORNERS {
        return Some(hull);
    }
    let (u, v) = plane.basis();
    let flat: Vec<DVec2> = hull
        .points
        .iter()
        .map(|&p| DVec2::new(u.dot(p - middle), v.dot(p - middle)))
        .collect();
    let around = reduced_around(&flat, MAX_CORNERS);
    Some(Winding::new(
        around.iter().map(|p| middle + u * p.x + v * p.y).collect(),
    ))
}
