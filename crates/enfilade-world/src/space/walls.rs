//! The triangles that bodies can hit, by cell, made once from a world.
//!
//! Each cell has a tree over the structural triangles that it sees, seals included, and the pieces of its portals, which lead
//! the flood on and are walls when shut. Detail objects share the trees of their meshes, in the meshes' own space, and are listed
//! by the cells that they touch, leaves of doors by all cells that they sweep. A structural triangle that several cells see is in
//! the tree of each: 76 bytes and a share of a node.

use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::{Aabb, BoxTree, Bvh, DMat4, DVec3, Triangle};
use enfilade_runtime::{DetailId, Sight};

use crate::layout::Layout;

/// Poses between shut and open at which the box of a leaf's sweep is measured.
const POSES: u32 = 16;

/// Obstacles of a world by cell: walls, seals, objects, leaves of doors, shut portals. Made once.
#[derive(Clone, Debug)]
pub(crate) struct Walls {
    pub(crate) cells: Vec<CellWalls>,
    pub(crate) meshes: Vec<MeshWalls>,
    /// Per detail object; `None` for those without triangles.
    pub(crate) placed: Vec<Option<Placed>>,
    /// Per portal and cell, the way there; the second cell is the first's way.
    pub(crate) ways: Vec<[PortalWay; 2]>,
}

/// A portal from one of its cells.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PortalWay {
    pub(crate) from: CellId,
    /// The cell behind it; `None` where a special portal is in its place.
    pub(crate) to: Option<CellId>,
    /// True if the special portal in its place leads nowhere: a mirror, a monitor.
    pub(crate) is_solid: bool,
}

/// Obstacles of one cell.
#[derive(Clone, Debug)]
pub(crate) struct CellWalls {
    pub(crate) bvh: Bvh,
    /// Per triangle of the tree.
    pub(crate) surfaces: Vec<TriangleOf>,
    /// Tree over the boxes of the objects that touch the cell, and their indices.
    pub(crate) tree: BoxTree,
    pub(crate) details: Vec<u32>,
}

/// Owner of a triangle of a cell.
#[derive(Clone, Copy, Debug)]
pub(crate) enum TriangleOf {
    Wall {
        batch: u32,
        triangle: u32,
    },
    /// A part of an opening; if `is_panel`, a wall while it is shut.
    Opening {
        portal: u32,
        is_panel: bool,
    },
    /// A part of the panel that fills an opening while it is shut, at the depth of its leaves.
    Panel {
        portal: u32,
    },
}

/// The triangles of a mesh.
#[derive(Clone, Debug)]
pub(crate) struct MeshWalls {
    pub(crate) bvh: Bvh,
    /// Index of the first triangle of each primitive.
    pub(crate) first: Vec<u32>,
}

/// A detail object in the model's pose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    pub(crate) mesh: u32,
    pub(crate) to_world: DMat4,
    pub(crate) to_mesh: DMat4,
    /// Its bounding box; for a leaf, that of its sweep. [Units: wu]
    pub(crate) bounds: Aabb,
    pub(crate) is_leaf: bool,
}

impl Walls {
    /// Prepares a world. O(n log n) in triangles, each counted once for each cell that sees it.
    pub(crate) fn new(world: &World, sight: &Sight, layout: &Layout) -> Self {
        let n_cells = layout.n_cells();
        let mut triangles: Vec<Vec<Triangle>> = vec![Vec::new(); n_cells];
        let mut surfaces: Vec<Vec<TriangleOf>> = vec![Vec::new(); n_cells];
        for (batch, b) in (0..).zip(&world.batches) {
            for cell in &b.cells {
                for (triangle, t) in (0..).zip(b.primitive.placed_triangles(DMat4::IDENTITY)) {
                    triangles[cell.idx()].push(t);
                    surfaces[cell.idx()].push(TriangleOf::Wall { batch, triangle });
                }
            }
        }
        let mut ways = Vec::new();
        for portal in (0..layout.n_portals() as u32).map(PortalId) {
            let cells = layout.opening(portal).cells();
            ways.push([0, 1].map(|side| {
                let from = cells[side];
                let special = world.graph.special_side(portal, from);
                let replaced = special.filter(|s| !world.graph.specials[s.idx()].is_through());
                PortalWay {
                    from,
                    to: replaced.is_none().then_some(cells[1 - side]),
                    is_solid: replaced.is_some_and(|s| layout.passage(s).is_none()),
                }
            }));
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
            ways,
            placed,
        }
    }
}

/// Returns the triangles of a portal's opening, and of its panel at the depth of its leaves.
fn openings(
    layout: &Layout,
    sight: &Sight,
    portal: PortalId,
) -> impl Iterator<Item = (Triangle, TriangleOf)> {
    let opening = layout.opening(portal);
    // The leaves hide a panel at this depth: bodies stop at the leaf, not in front of it.
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

/// Returns all meshes, all objects, and per cell the objects that touch it.
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

/// Returns the box of a leaf's sweep, given the vertices of its box in the model's pose.
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
        // Between two poses, no point is farther from the first pose than the second pose is.
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
            triangles.extend(primitive.placed_triangles(*place));
        }
        let bvh = Bvh::build(&triangles);
        Self { bvh, first }
    }

    /// Returns the primitive of a triangle, and the triangle's index there.
    pub(crate) fn named(&self, triangle: u32) -> (u32, u32) {
        let primitive = self.first.partition_point(|&f| f <= triangle) - 1;
        (primitive as u32, triangle - self.first[primitive])
    }
}
