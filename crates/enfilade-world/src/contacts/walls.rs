//! The triangles that bodies meet, by cell, made once from a world.
//!
//! Each cell has a tree over the structural triangles that it sees, seals among them, and the pieces of its portals, which tell
//! the flood where to go and are walls when shut. Detail objects share the trees of their meshes, in the meshes' own space, and
//! are listed by the cells that they touch, leaves of doors by all cells on their way. A structural triangle that several cells
//! see stands in the tree of each: 76 bytes and a share of a node.

use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::scene::Primitive;
use enfilade_geom::{Aabb, BoxTree, Bvh, DMat4, DVec3, Triangle};
use enfilade_runtime::{DetailId, Sight};

use crate::layout::Layout;

/// Poses of a leaf between shut and open that the box around its way is measured at.
const POSES: u32 = 16;

/// What bodies meet in a world: walls, seals, objects, leaves of doors, shut portals; by cell. Made once, shared by any number
/// of [`Caster`](crate::Caster)s.
#[derive(Clone, Debug)]
pub struct Contacts {
    pub(super) cells: Vec<CellWalls>,
    pub(super) meshes: Vec<MeshWalls>,
    /// By detail object; `None` for those without triangles.
    pub(super) placed: Vec<Option<Placed>>,
    /// By portal.
    pub(super) portal_cells: Vec<[CellId; 2]>,
    /// Openings are grown by it when they are touched. [Units: wu]
    pub(super) tolerance: f64,
}

/// What bodies meet in one cell.
#[derive(Clone, Debug)]
pub(super) struct CellWalls {
    pub(super) bvh: Bvh,
    /// By triangle of the tree.
    pub(super) surfaces: Vec<TriangleOf>,
    /// Over the boxes of the objects that touch the cell, and which these are.
    pub(super) tree: BoxTree,
    pub(super) details: Vec<u32>,
}

/// What a triangle of a cell belongs to.
#[derive(Clone, Copy, Debug)]
pub(super) enum TriangleOf {
    Wall {
        batch: u32,
        triangle: u32,
    },
    /// A part of an opening; where `is_panel`, a wall while it is shut.
    Opening {
        portal: u32,
        is_panel: bool,
    },
    /// A part of what fills an opening while it is shut, where its leaves are.
    Panel {
        portal: u32,
    },
}

/// The triangles of a mesh.
#[derive(Clone, Debug)]
pub(super) struct MeshWalls {
    pub(super) bvh: Bvh,
    /// By primitive: its first triangle.
    pub(super) first: Vec<u32>,
}

/// A detail object as the model has it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    pub(super) mesh: u32,
    pub(super) to_world: DMat4,
    pub(super) to_mesh: DMat4,
    /// Around it, of a leaf around all its way. [Units: wu]
    pub(super) bounds: Aabb,
    pub(super) is_leaf: bool,
}

impl Contacts {
    /// O(n log n) in triangles, each counted once for each cell that sees it.
    ///
    /// # Panics
    ///
    /// When `sight` or `layout` is not of this world.
    #[must_use]
    pub fn new(world: &World, sight: &Sight, layout: &Layout) -> Self {
        let n_cells = layout.n_cells();
        let mut triangles: Vec<Vec<Triangle>> = vec![Vec::new(); n_cells];
        let mut surfaces: Vec<Vec<TriangleOf>> = vec![Vec::new(); n_cells];
        for (batch, b) in (0..).zip(&world.batches) {
            for cell in &b.cells {
                for (triangle, t) in (0..).zip(triangles_of(&b.primitive, &DMat4::IDENTITY)) {
                    triangles[cell.idx()].push(t);
                    surfaces[cell.idx()].push(TriangleOf::Wall { batch, triangle });
                }
            }
        }
        let mut portal_cells = Vec::new();
        for portal in (0..layout.n_portals() as u32).map(PortalId) {
            let cells = layout.opening(portal).cells();
            portal_cells.push(cells);
            for (t, surface) in openings(layout, sight, portal) {
                for cell in cells {
                    triangles[cell.idx()].push(t);
                    surfaces[cell.idx()].push(surface);
                }
            }
        }
        let (meshes, placed, listed) = objects(world, sight, n_cells);
        let built = triangles.iter().zip(surfaces).zip(listed);
        let cells = built.map(|((triangles, surfaces), details)| {
            let bounds = |d: &u32| placed[*d as usize].map_or(Aabb::EMPTY, |p: Placed| p.bounds);
            let boxes: Vec<Aabb> = details.iter().map(bounds).collect();
            CellWalls {
                bvh: Bvh::build(triangles),
                surfaces,
                tree: BoxTree::new(&boxes),
                details,
            }
        });
        Self {
            cells: cells.collect(),
            meshes,
            portal_cells,
            tolerance: layout.tolerance(),
            placed,
        }
    }

    /// How many cells there are.
    #[must_use]
    pub fn n_cells(&self) -> usize {
        self.cells.len()
    }

    /// Triangles in the trees of all cells, portals' among them; one that several cells see counts for each.
    #[must_use]
    pub fn n_triangles(&self) -> usize {
        self.cells.iter().map(|c| c.surfaces.len()).sum()
    }
}

/// The triangles of a portal's opening, and of what fills it where its leaves are.
fn openings(
    layout: &Layout,
    sight: &Sight,
    portal: PortalId,
) -> impl Iterator<Item = (Triangle, TriangleOf)> {
    let opening = layout.opening(portal);
    // Its leaves hide a panel at this depth: bodies stop at the leaf, not before it.
    let off = opening.normal() * f64::from(sight.depth_of_leaves(portal));
    let is_panel = off == DVec3::ZERO;
    let own = TriangleOf::Opening {
        portal: portal.0,
        is_panel,
    };
    opening.pieces().flat_map(move |piece| {
        (2..piece.len()).flat_map(move |k| {
            let t = [piece[0], piece[k - 1], piece[k]];
            let panel = TriangleOf::Panel { portal: portal.0 };
            let moved = (!is_panel).then(|| (t.map(|p| p + off), panel));
            [Some((t, own)), moved].into_iter().flatten()
        })
    })
}

type Objects = (Vec<MeshWalls>, Vec<Option<Placed>>, Vec<Vec<u32>>);

/// All meshes, all objects, and by cell the objects that touch it.
fn objects(world: &World, sight: &Sight, n_cells: usize) -> Objects {
    let mut listed = vec![Vec::new(); n_cells];
    let whole = |mesh: usize| MeshWalls::new(world, mesh, &DMat4::IDENTITY);
    let mut meshes: Vec<MeshWalls> = (0..world.detail_meshes.len()).map(whole).collect();
    let mut placed = Vec::new();
    for (i, object) in (0..).zip(&world.details) {
        let mut at = Placed {
            mesh: object.mesh,
            to_world: object.placement(),
            to_mesh: object.placement().inverse(),
            bounds: Aabb::EMPTY,
            is_leaf: sight.portals_of(DetailId(i)).next().is_some(),
        };
        if !at.to_mesh.is_finite() {
            // Flattened: it has no space of its own.
            meshes.push(MeshWalls::new(world, object.mesh as usize, &at.to_world));
            at.mesh = meshes.len() as u32 - 1;
            (at.to_world, at.to_mesh) = (DMat4::IDENTITY, DMat4::IDENTITY);
        }
        let own = meshes[at.mesh as usize].bvh.bounds();
        if own.is_empty() {
            placed.push(None);
            continue;
        }
        let corners = own.corners();
        let here = corners.map(|p| at.to_world.transform_point3(p));
        at.bounds = Aabb::of_points(&here);
        if let Some(way) = way_of(sight, DetailId(i), &here) {
            at.bounds = at.bounds.union(way);
        }
        placed.push(Some(at));
        for cell in sight.cells_of_detail(world, DetailId(i)) {
            listed[cell.idx()].push(i);
        }
    }
    (meshes, placed, listed)
}

/// The box around all that a leaf passes through, given the corners of a box around it as the model has it.
fn way_of(sight: &Sight, detail: DetailId, corners: &[DVec3; 8]) -> Option<Aabb> {
    let portal = sight.portals_of(detail).next()?;
    let leaf = sight.leaves(portal).iter().find(|l| l.detail == detail)?;
    let at = |pose: u32| {
        let by = leaf.motion.at(pose as f32 / POSES as f32);
        corners.map(|p| by.transform_point3(p))
    };
    let mut way = Aabb::EMPTY;
    let mut here = at(0);
    for pose in 1..=POSES {
        let next = at(pose);
        // Between two poses nothing is farther from the first than it is at the second.
        let moved = here.iter().zip(&next).map(|(a, b)| a.distance(*b));
        way = way.union(Aabb::of_points(&here).expanded(moved.fold(0.0, f64::max)));
        here = next;
    }
    Some(way.union(Aabb::of_points(&here)))
}

impl MeshWalls {
    fn new(world: &World, mesh: usize, place: &DMat4) -> Self {
        let mut triangles = Vec::new();
        let mut first = Vec::new();
        for primitive in &world.detail_meshes[mesh].primitives {
            first.push(triangles.len() as u32);
            triangles.extend(triangles_of(primitive, place));
        }
        let bvh = Bvh::build(&triangles);
        Self { bvh, first }
    }

    /// The primitive of a triangle, and its number there.
    pub(super) fn named(&self, triangle: u32) -> (u32, u32) {
        let primitive = self.first.partition_point(|&f| f <= triangle) - 1;
        (primitive as u32, triangle - self.first[primitive])
    }
}

fn triangles_of(primitive: &Primitive, place: &DMat4) -> impl Iterator<Item = Triangle> {
    primitive.indices.chunks_exact(3).map(move |t| {
        [t[0], t[1], t[2]].map(|i| {
            let p = primitive.positions[i as usize].map(f64::from);
            place.transform_point3(DVec3::from_array(p))
        })
    })
}
