//! Which triangles and objects of each cell may be seen from each other cell: those that its visible volume meets.
//!
//! After Dirkse 2002, section 7.6.2 (objects by cell), by the triangles themselves rather than by boxes.
//! Errs to visible: a triangle counts as seen where it touches a piece of the volume; all in a cell counts as seen from the cell itself.

use enfilade_cpg::{PartNumbers, Pvs, VisibleParts, VisibleVolumes, World};
use enfilade_geom::{Aabb, DMat4, DVec3, Plane, Triangle};
use rayon::prelude::*;

use crate::polytope::clip;

/// Rounding of what is computed here. [Units: wu] The volumes hold the world's tolerance themselves.
const EPS: f64 = 1e-9;

/// What of each cell's triangles and objects its volumes meet, by pair of cells in the order of `pvs`.
///
/// `volumes` are those of [`visible_volumes`](crate::visible_volumes) for the same `pvs`. Time: pairs of cells, times what is in the second; threads come from the
/// current rayon pool.
#[must_use]
pub fn visible_parts(world: &World, pvs: &Pvs, volumes: &VisibleVolumes) -> VisibleParts {
    let (all, by_cell) = (all_parts(world), by_cell(world));
    let pairs: Vec<(u32, u32)> = pvs.pairs().map(|(a, b)| (a.0, b.0)).collect();
    let rows: Vec<Vec<u32>> = (pairs.par_iter().enumerate())
        .with_min_len(4)
        .map(|(pair, &(from, to))| {
            let numbers = by_cell.get(to as usize).map_or(&[][..], |n| n);
            if from == to {
                return numbers.to_vec();
            }
            let pieces: Vec<Vec<Plane>> = volumes.pieces_of(pair).map(planes).collect();
            let is_seen = |&&i: &&u32| pieces.iter().any(|piece| all[i as usize].meets(piece));
            numbers.iter().filter(is_seen).copied().collect()
        })
        .collect();
    VisibleParts::of_ascending(rows)
}

/// A triangle of a batch, or those of a detail object.
struct Part {
    bounds: Aabb,
    triangles: Vec<Triangle>,
}

impl Part {
    fn new(triangles: Vec<Triangle>) -> Self {
        Self {
            bounds: Aabb::of_points(triangles.iter().flatten()),
            triangles,
        }
    }

    /// Whether it touches what lies in front of all planes.
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

/// By [`PartNumbers`], all parts.
fn all_parts(world: &World) -> Vec<Part> {
    let triangles = world.batches.iter().flat_map(|batch| {
        let positions = &batch.primitive.positions;
        let corners = move |t: &[u32]| [0, 1, 2].map(|k| point(positions[t[k] as usize]));
        batch.primitive.indices.chunks_exact(3).map(corners)
    });
    let objects = world.details.iter().map(|object| {
        let to_world = DMat4::from_cols_array(&object.transform.map(f64::from));
        let mut triangles = Vec::new();
        for primitive in &world.detail_meshes[object.mesh as usize].primitives {
            let at = |i: u32| to_world.transform_point3(point(primitive.positions[i as usize]));
            let corners = primitive.indices.chunks_exact(3);
            triangles.extend(corners.map(|t| [at(t[0]), at(t[1]), at(t[2])]));
        }
        triangles
    });
    let triangles = triangles.map(|t| vec![t]);
    triangles.chain(objects).map(Part::new).collect()
}

/// By cell: what is seen from it without passing a portal, ascending.
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

fn point(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}
