//! All triangles of parts, without cells, each with what it belongs to.

use std::collections::HashSet;

use enfilade::World;
use enfilade::geom::{Aabb, DVec3};
use enfilade::internals::geom::{Bvh, Ray};
use enfilade::runtime::{ChunkId, DetailId};
use enfilade::world::{PartId, Pose, Space, SpaceSeen};
use enfilade_testkit::Solids;

use crate::measure::point;

/// A chunk or an object of a part.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum PartItem {
    Chunk(ChunkId),
    Detail(DetailId),
}

/// All triangles of a part in its own frame, and the item of each.
pub(super) struct Solid {
    pub(super) tree: Bvh,
    pub(super) items: Vec<PartItem>,
}

impl Solid {
    pub(super) fn of(space: &Space, part: PartId) -> Self {
        let mut all = Solids::default();
        add(&mut all, space, part, &Pose::IDENTITY, |item| item);
        let (tree, items) = all.built();
        Self { tree, items }
    }

    pub(super) fn is_free(&self, bounds: &Aabb) -> bool {
        !self.tree.any_in_box(bounds, |_| true)
    }
}

/// Adds the triangles of a part that stands at a pose.
fn add<T: Copy>(
    all: &mut Solids<T>,
    space: &Space,
    part: PartId,
    pose: &Pose,
    item: impl Fn(PartItem) -> T,
) {
    let (world, sight) = (space.world(part), space.sight(part));
    for (id, chunk) in (0..).map(ChunkId).zip(sight.chunks()) {
        let indices = &sight.indices(chunk.batch)[chunk.first_index as usize..];
        let indices = &indices[..chunk.n_indices as usize];
        let place = |p| pose.point(p);
        all.add(
            world,
            chunk.batch,
            indices,
            place,
            item(PartItem::Chunk(id)),
        );
    }
    let detail = |id| item(PartItem::Detail(DetailId(id)));
    all.add_objects(world, pose.matrix(), detail);
}

/// Returns all triangles of the first parts where they are now, as one model, and the item of each.
pub(super) fn model(space: &Space, n_parts: usize) -> (Bvh, Vec<(PartId, PartItem)>) {
    let mut all = Solids::default();
    for part in (0..n_parts as u32).map(PartId) {
        add(&mut all, space, part, space.pose(part), |item| (part, item));
    }
    all.built()
}

/// Returns the item that a ray, given by origin and direction in the frame of a part, meets first among all parts.
pub(super) fn first_item(
    space: &Space,
    solids: &[(PartId, Solid)],
    frame: PartId,
    [origin, direction]: [DVec3; 2],
) -> Option<(PartId, PartItem)> {
    let mut best = (f64::INFINITY, None);
    for (part, solid) in solids {
        let to = space.between(frame, *part);
        let ray = Ray {
            origin: to.point(origin),
            direction: to.direction(direction),
            t_max: best.0,
        };
        if let Some(hit) = solid.tree.closest_hit(&ray, |_| false)
            && hit.t < best.0
        {
            best = (hit.t, Some((*part, solid.items[hit.triangle as usize])));
        }
    }
    best.1
}

/// Returns all that a view answers.
pub(super) fn items_of(seen: &SpaceSeen<'_>) -> HashSet<(PartId, PartItem)> {
    let mut known = HashSet::new();
    for (part, seen) in seen.parts() {
        known.extend(seen.chunks().iter().map(|c| (part, PartItem::Chunk(*c))));
        known.extend(seen.details().iter().map(|d| (part, PartItem::Detail(*d))));
    }
    known
}

/// Returns the box of a cabin's room and of its walls.
pub(super) fn hull(world: &World) -> Aabb {
    let positions = world.batches.iter().flat_map(|b| &b.primitive.positions);
    let positions: Vec<DVec3> = positions.map(|p| point(*p)).collect();
    Aabb::of_points(&positions)
}
