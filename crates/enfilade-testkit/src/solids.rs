//! All triangles of worlds where they stand, without cells, each with what it belongs to: the judge of views.

use enfilade_cpg::World;
use enfilade_geom::{Bvh, DMat4, DVec3, Triangle};

/// Triangles and their items, such as chunks and objects of parts.
#[derive(Clone, Debug)]
pub struct Solids<T> {
    triangles: Vec<Triangle>,
    items: Vec<T>,
}

impl<T> Default for Solids<T> {
    fn default() -> Self {
        Self {
            triangles: Vec::new(),
            items: Vec::new(),
        }
    }
}

impl<T: Copy> Solids<T> {
    /// Adds triangles of a batch by the indices of their vertices, each mapped by `place`.
    pub fn add(
        &mut self,
        world: &World,
        batch: u32,
        indices: &[u32],
        place: impl Fn(DVec3) -> DVec3,
        item: T,
    ) {
        let positions = &world.batches[batch as usize].primitive.positions;
        let vertex = |i: u32| place(DVec3::from_array(positions[i as usize].map(f64::from)));
        let triples = indices.chunks_exact(3);
        self.triangles
            .extend(triples.map(|t| [t[0], t[1], t[2]].map(vertex)));
        self.items.resize(self.triangles.len(), item);
    }

    /// Adds all objects of a world that stands at a pose; `item` gets their indices.
    pub fn add_objects(&mut self, world: &World, pose: DMat4, item: impl Fn(u32) -> T) {
        for (id, object) in (0..).zip(&world.details) {
            let place = pose * object.placement();
            for primitive in &world.detail_meshes[object.mesh as usize].primitives {
                self.triangles.extend(primitive.placed_triangles(place));
                self.items.resize(self.triangles.len(), item(id));
            }
        }
    }

    /// Returns a tree of the triangles, and the item of each.
    #[must_use]
    pub fn built(self) -> (Bvh, Vec<T>) {
        (Bvh::build(&self.triangles), self.items)
    }
}
