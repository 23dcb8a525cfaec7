//! Triangles and objects of each cell that may be seen from each other cell: those that its visible volume meets.
//!
//! After Dirkse 2002, section 7.6.2 (objects by cell), but by the triangles themselves rather than by boxes. Errs to
//! visible: a triangle counts as seen if it touches a piece of the volume, and everything in a cell counts as seen
//! from the cell itself.

use std::sync::OnceLock;

use enfilade_cpg::{
    Batch, CellId, PartNumbers, Pvs, SightGraph, SightGraphError, VisibleParts, VisibleVolumes,
    World,
};
use enfilade_geom::{Aabb, Bvh, DVec3, Plane, Triangle, world_tolerance};
use rayon::prelude::*;

use crate::hourglass::Hourglasses;
use crate::polytope::clip;
use crate::shade::Shade;
use crate::sheets::Sheets;
use crate::volumes::{ANY_PORTAL, volumes_of};

/// Rounding of computations here. The volumes already include the world's tolerance. [Units: wu]
const EPS: f64 = 1e-9;

/// Returns the visible volumes for each pair of cells, in the order of `pvs`, and the triangles and objects that they
/// meet, less those that walls hide from the first or the last portal on the way.
///
/// `pvs` is the answer of [`see_world`](crate::see_world) for the world's graph, or any superset of the truth. A cell
/// that sees a cell with a special portal sees all of what it sees; [`see_parts_through`] knows better. Walls are
/// the world's opaque structural triangles; details hide nothing, as they may be moved.
///
/// Time grows with the sequences of portals that lines may pass, and with the pairs of portals and parts in front of
/// them; a building of 300 portals takes seconds. Threads come from the current rayon pool; the result does not
/// depend on their number.
///
/// # Errors
///
/// A broken graph.
pub fn see_parts(
    world: &World,
    pvs: &Pvs,
) -> Result<(VisibleVolumes, VisibleParts), SightGraphError> {
    // Whoever sees a cell with a special portal may see anything of its row through it.
    let has_special = |c: CellId| world.graph.specials.iter().any(|s| s.cell == c);
    let rows = (0..pvs.n_cells() as u32).map(CellId).map(|cell| {
        let sees_special = pvs.visible_from(cell).any(has_special);
        let row = pvs.visible_from(cell).filter(move |_| sees_special);
        row.map(|c| c.0)
    });
    see_parts_through(world, pvs, &Pvs::of_ascending(rows))
}

/// Does [`see_parts`] for a world with special portals, given the cells that each cell sees through them
/// ([`WorldVis::through`](crate::WorldVis::through)): of those, everything counts as seen.
///
/// # Errors
///
/// A broken graph.
pub fn see_parts_through(
    world: &World,
    pvs: &Pvs,
    through: &Pvs,
) -> Result<(VisibleVolumes, VisibleParts), SightGraphError> {
    let glasses = Hourglasses::new(&SightGraph::of_graph(&world.graph))?;
    let (volumes, ends) = volumes_of(world, (pvs, through), &glasses);
    let (all, by_cell) = (all_parts(world), by_cell(world));
    let candidates = candidates(pvs, &volumes, &ends, &all, &by_cell);
    let both = |&(ends, part): &([u32; 2], u32)| ends.map(|portal| (portal, part));
    let mut asked: Vec<(u32, u32)> = candidates.iter().flatten().flat_map(both).collect();
    asked.par_sort_unstable();
    asked.dedup();
    asked.retain(|&(portal, _)| portal != ANY_PORTAL);
    let walls = walls(world);
    let bvh = Bvh::build(&walls);
    let sheets = Sheets::new(&walls, &bvh);
    let slack = world_tolerance(glasses.dirs().scale);
    let shade = Shade {
        sheets: &sheets,
        dirs: glasses.dirs(),
        inset: glasses.clearance(),
        rounding: glasses.tolerance().rounding,
        slack,
    };
    // Asked only if no other way shows the part.
    let is_hidden: Vec<OnceLock<bool>> = asked.iter().map(|_| OnceLock::new()).collect();
    let is_open = |portal: u32, part: u32| {
        portal == ANY_PORTAL || {
            let at = asked.binary_search(&(portal, part));
            let shape = &all[part as usize];
            let hides = || shade.hides(glasses.place(portal), &shape.triangles, &shape.bounds);
            at.is_ok_and(|at| !*is_hidden[at].get_or_init(hides))
        }
    };
    let is_seen = |ways: &[(u32, [u32; 2])]| {
        let is_free = |&(part, ends): &(u32, [u32; 2])| ends.iter().all(|&p| is_open(p, part));
        ways.iter().any(is_free)
    };
    let rows: Vec<Vec<u32>> = (candidates.into_par_iter())
        .map(|row| {
            let mut ways: Vec<(u32, [u32; 2])> =
                row.into_iter().map(|(e, part)| (part, e)).collect();
            ways.sort_unstable();
            ways.dedup();
            let of_parts = ways.chunk_by(|a, b| a.0 == b.0);
            let seen = of_parts.filter(|ways| is_seen(ways));
            seen.map(|ways| ways[0].0).collect()
        })
        .collect();
    let parts = VisibleParts::of_ascending(rows);
    Ok((volumes, parts))
}

/// Returns for each pair of cells the parts of the second that its pieces meet, each with the first and the last
/// portal through which the piece is seen.
fn candidates(
    pvs: &Pvs,
    volumes: &VisibleVolumes,
    ends: &[[u32; 2]],
    all: &[Shape],
    by_cell: &[Vec<u32>],
) -> Vec<Vec<([u32; 2], u32)>> {
    let mut first_piece = 0;
    let pairs: Vec<(usize, u32)> = (pvs.pairs().enumerate())
        .map(|(pair, (_, to))| {
            let first = first_piece;
            first_piece += volumes.pieces_of(pair).count();
            (first, to.0)
        })
        .collect();
    (pairs.par_iter().enumerate())
        .with_min_len(4)
        .map(|(pair, &(first, to))| {
            let mut out = Vec::new();
            for (piece, &ends) in volumes.pieces_of(pair).zip(&ends[first..]) {
                let planes = planes(piece);
                let met = by_cell[to as usize].iter().copied();
                let met = met.filter(|&part| all[part as usize].meets(&planes));
                out.extend(met.map(|part| (ends, part)));
            }
            out
        })
        .collect()
}

/// Returns the structural triangles that block sight.
fn walls(world: &World) -> Vec<Triangle> {
    let blocks = |batch: &&Batch| {
        let material = batch.primitive.material;
        let material = material.and_then(|m| world.materials.get(m as usize));
        material.is_none_or(|m| !m.transparent)
    };
    let batches = world.batches.iter().filter(blocks);
    let triangles = batches.flat_map(|batch| batch.primitive.triangles());
    triangles.collect()
}

/// The triangle of a batch, or the triangles of a detail object.
struct Shape {
    bounds: Aabb,
    triangles: Vec<Triangle>,
}

impl Shape {
    fn new(triangles: Vec<Triangle>) -> Self {
        Self {
            bounds: Aabb::of_points(triangles.iter().flatten()),
            triangles,
        }
    }

    /// Returns `true` if it touches the space in front of all planes.
    fn meets(&self, planes: &[Plane]) -> bool {
        let middle = self.bounds.center();
        let half = self.bounds.size() * 0.5;
        let mut cutting = Vec::new();
        for plane in planes {
            let height = plane.signed_distance(middle);
            let reach = plane.normal.abs().dot(half) + EPS;
            if height < -reach {
                return false;
            }
            if height < reach {
                cutting.push(plane);
            }
        }
        let touches = |triangle: &Triangle| {
            let mut points = triangle.to_vec();
            cutting.iter().all(|plane| {
                clip(&mut points, plane, EPS);
                !points.is_empty()
            })
        };
        self.triangles.iter().any(touches)
    }
}

fn planes(piece: &[[f64; 4]]) -> Vec<Plane> {
    let plane = |&[x, y, z, d]: &[f64; 4]| Plane {
        normal: DVec3::new(x, y, z),
        d,
    };
    piece.iter().map(plane).collect()
}

/// Returns all parts in the order of [`PartNumbers`].
fn all_parts(world: &World) -> Vec<Shape> {
    let batches = world.batches.iter();
    let triangles = batches.flat_map(|batch| batch.primitive.triangles());
    let objects = world.details.iter().map(|object| {
        let primitives = world.detail_meshes[object.mesh as usize].primitives.iter();
        let placement = object.placement();
        primitives
            .flat_map(|p| p.placed_triangles(placement))
            .collect()
    });
    let triangles = triangles.map(|t| vec![t]);
    triangles.chain(objects).map(Shape::new).collect()
}

/// Returns for each cell the parts that are seen from it without passing a portal, ascending.
fn by_cell(world: &World) -> Vec<Vec<u32>> {
    let numbers = PartNumbers::new(world);
    let mut by_cell = vec![Vec::new(); world.graph.cells.len()];
    for (i, batch) in world.batches.iter().enumerate() {
        for cell in &batch.cells {
            by_cell[cell.idx()].extend(numbers.of_batch(i));
        }
    }
    for (i, object) in (0..).zip(&world.details) {
        for cell in &object.cells {
            by_cell[cell.idx()].push(numbers.of_detail(i));
        }
    }
    by_cell
}
