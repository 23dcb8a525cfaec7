//! Detail objects for lines of sight: one tree per mesh, and one over the boxes of the objects.
//!
//! The segment is transformed into the space of each mesh whose object's box it meets; `t` is the same there. So objects
//! that share a mesh share its tree, and no line passes between triangles of a mesh that share vertices.

use enfilade_cpg::World;
use enfilade_geom::{Aabb, Bvh, DMat4, DVec3, Ray, Triangle};

use crate::boxes::{BoxRay, BoxTrees, Boxed, Root};
use crate::doors::Doors;
use crate::seen::DetailId;
use crate::state::SightState;

/// The triangles of a mesh, in its own space or, for a flattened object, in world space.
#[derive(Clone, Debug)]
struct Shape {
    bvh: Bvh,
    triangles: Vec<Triangle>,
    /// Index of the first triangle of each primitive.
    first: Vec<u32>,
}

#[derive(Clone, Debug)]
struct Placed {
    shape: u32,
    to_shape: DMat4,
    to_world: DMat4,
}

/// All detail objects of a world.
#[derive(Clone, Debug)]
pub(crate) struct Details {
    shapes: Vec<Shape>,
    placed: Vec<Placed>,
    trees: BoxTrees,
    root: Root,
    bounds: Aabb,
}

/// Intersection of a segment with a detail object.
pub(crate) struct DetailHit {
    pub(crate) t: f64,
    pub(crate) detail: DetailId,
    pub(crate) primitive: u32,
    pub(crate) triangle: u32,
    pub(crate) front: bool,
    /// In world space.
    pub(crate) corners: Triangle,
}

impl Details {
    /// Builds the trees. O(n log n) in the triangles of the meshes and in the objects.
    pub(crate) fn build(world: &World) -> Self {
        // A world with invalid fittings has no answers about doors; the rest is unaffected.
        let doors = Doors::of(world).unwrap_or_default();
        let mut shapes: Vec<Shape> = (0..world.detail_meshes.len())
            .map(|mesh| Shape::of_mesh(world, mesh as u32, &DMat4::IDENTITY))
            .collect();
        let mut placed = Vec::new();
        let mut boxes = Vec::new();
        for (i, object) in world.details.iter().enumerate() {
            let to_world = object.placement();
            let inverse = to_world.inverse();
            let shape = &shapes[object.mesh as usize];
            let mut bounds = shape.bounds_under(&to_world);
            if let Some((swept, _)) = doors.way(i as u32) {
                bounds = bounds.union(swept);
            }
            if !bounds.is_empty() {
                let item = i as u32;
                boxes.push(Boxed { bounds, item });
            }
            if inverse.is_finite() {
                placed.push(Placed {
                    shape: object.mesh,
                    to_shape: inverse,
                    to_world,
                });
            } else {
                placed.push(Placed {
                    shape: shapes.len() as u32,
                    to_shape: DMat4::IDENTITY,
                    to_world: DMat4::IDENTITY,
                });
                shapes.push(Shape::of_mesh(world, object.mesh, &to_world));
            }
        }
        let bounds = boxes.iter().fold(Aabb::EMPTY, |b, x| b.union(x.bounds));
        let extent = if bounds.is_empty() {
            0.0
        } else {
            bounds.min.abs().max(bounds.max.abs()).max_element()
        };
        let mut trees = BoxTrees::default();
        // Rounding of `f32` in a segment clipped to the bounds.
        let margin = 1e-4_f64.max(extent * (1.0 / 1_048_576.0));
        let root = trees.add(&mut boxes, margin);
        Self {
            shapes,
            placed,
            trees,
            root,
            bounds: if bounds.is_empty() {
                bounds
            } else {
                bounds.expanded(margin)
            },
        }
    }

    /// Returns the first hit on the segment `origin + t · direction`, `t` from 0 to `t_max`, among objects for which `counts`
    /// returns `true`. Leaves of doors are where `state` puts them.
    pub(crate) fn first_hit(
        &self,
        state: &SightState,
        ray: &Ray,
        mut counts: impl FnMut(DetailId) -> bool,
    ) -> Option<DetailHit> {
        let (enter, leave) = overlap(ray, &self.bounds)?;
        let part = BoxRay::new(ray.at(enter), ray.direction);
        // Boxes are grown, so that a limit in `f32` excludes none.
        let limit = |t: f64| ((t - enter) * (1.0 + 1e-6)) as f32 + 1e-6;
        let mut t_max = leave;
        let mut best: Option<DetailHit> = None;
        self.trees
            .for_each_on_ray(self.root, &part, limit(t_max), |item| {
                let id = DetailId(item);
                let placed = &self.placed[item as usize];
                let shape = &self.shapes[placed.shape as usize];
                let moved = state.pose(id);
                let to_shape = moved.map_or(placed.to_shape, |m| placed.to_shape * m.inverse());
                let local = Ray {
                    origin: to_shape.transform_point3(ray.origin),
                    direction: to_shape.transform_vector3(ray.direction),
                    t_max,
                };
                let hit = shape.bvh.closest_hit(&local, |_| false);
                let nearer = hit.filter(|h| {
                    best.as_ref()
                        .is_none_or(|b| h.t < b.t || (h.t == b.t && id < b.detail))
                        && counts(id)
                });
                if let Some(hit) = nearer {
                    t_max = hit.t;
                    let to_world = moved.map_or(placed.to_world, |m| m * placed.to_world);
                    best = Some(shape.named(id, &hit, &to_world));
                }
                limit(t_max)
            });
        best
    }
}

impl Shape {
    fn of_mesh(world: &World, mesh: u32, transform: &DMat4) -> Self {
        let mut triangles = Vec::new();
        let mut first = Vec::new();
        for p in &world.detail_meshes[mesh as usize].primitives {
            first.push(triangles.len() as u32);
            triangles.extend(p.placed_triangles(*transform));
        }
        Self {
            bvh: Bvh::build(&triangles),
            triangles,
            first,
        }
    }

    fn bounds_under(&self, transform: &DMat4) -> Aabb {
        let corners = self.triangles.iter().flatten();
        corners.fold(Aabb::EMPTY, |b, &p| {
            b.including(transform.transform_point3(p))
        })
    }

    fn named(&self, detail: DetailId, hit: &enfilade_geom::RayHit, to_world: &DMat4) -> DetailHit {
        let primitive = self.first.partition_point(|&f| f <= hit.triangle) - 1;
        let corners = self.triangles[hit.triangle as usize];
        DetailHit {
            t: hit.t,
            detail,
            primitive: primitive as u32,
            triangle: hit.triangle - self.first[primitive],
            front: hit.front,
            corners: corners.map(|p| to_world.transform_point3(p)),
        }
    }
}

/// Returns the first and last `t` of a segment within a box; `None` if it misses the box.
fn overlap(ray: &Ray, bounds: &Aabb) -> Option<(f64, f64)> {
    let (mut enter, mut leave) = (0.0_f64, ray.t_max);
    let DVec3 { x, y, z } = ray.direction;
    for (k, d) in [x, y, z].into_iter().enumerate() {
        let (low, high) = (bounds.min[k] - ray.origin[k], bounds.max[k] - ray.origin[k]);
        if d == 0.0 {
            if low > 0.0 || high < 0.0 {
                return None;
            }
            continue;
        }
        let (a, b) = (low / d, high / d);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    (enter <= leave).then_some((enter, leave))
}
