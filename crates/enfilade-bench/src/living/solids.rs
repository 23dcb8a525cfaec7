//! All triangles of parts, without cells, each with what it belongs to.

use enfilade::World;
use enfilade::geom::{Aabb, DVec3, Triangle};
use enfilade::internals::geom::Bvh;
use enfilade::runtime::{ChunkId, DetailId};
use enfilade::world::{PartId, Space};

use super::rooms::point;

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
        let (world, sight) = (space.world(part), space.sight(part));
        let (mut triangles, mut items): (Vec<Triangle>, Vec<PartItem>) = (Vec::new(), Vec::new());
        for (id, chunk) in (0..).map(ChunkId).zip(sight.chunks()) {
            let positions = &world.batches[chunk.batch as usize].primitive.positions;
            let first = chunk.first_index as usize;
            let indices = &sight.indices(chunk.batch)[first..first + chunk.n_indices as usize];
            for t in indices.chunks_exact(3) {
                triangles.push([0, 1, 2].map(|k| point(positions[t[k] as usize])));
                items.push(PartItem::Chunk(id));
            }
        }
        for (id, object) in (0..).map(DetailId).zip(&world.details) {
            for primitive in &world.detail_meshes[object.mesh as usize].primitives {
                triangles.extend(primitive.placed_triangles(object.placement()));
                items.resize(triangles.len(), PartItem::Detail(id));
            }
        }
        Self {
            tree: Bvh::build(&triangles),
            items,
        }
    }

    pub(super) fn is_free(&self, bounds: &Aabb) -> bool {
        !self.tree.any_in_box(bounds, |_| true)
    }
}

/// Returns the box of a cabin's room and of its walls.
pub(super) fn hull(world: &World) -> Aabb {
    let positions = world.batches.iter().flat_map(|b| &b.primitive.positions);
    let positions: Vec<DVec3> = positions.map(|p| point(*p)).collect();
    Aabb::of_points(&positions)
}
