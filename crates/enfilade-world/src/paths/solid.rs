//! The triangles that stop walkers.

use enfilade_cpg::{FittingPart, PortalId, World};
use enfilade_geom::{DMat4, Triangle};
use enfilade_runtime::DetailId;

pub(crate) type Leaves = Vec<(PortalId, Vec<Triangle>)>;

/// Returns the triangles that stop walkers, of the structure and the objects that count, and apart those of leaves in their open
/// pose.
pub(crate) fn solid_of(
    world: &World,
    mut counts: impl FnMut(DetailId) -> bool,
) -> (Vec<Triangle>, Leaves) {
    let mut solid: Vec<Triangle> = Vec::new();
    for batch in &world.batches {
        solid.extend(batch.primitive.triangles());
    }
    let counts: Vec<bool> = (0..world.details.len() as u32)
        .map(|i| counts(DetailId(i)))
        .collect();
    let mut moves = vec![false; counts.len()];
    let mut leaves = Vec::new();
    for (i, portal) in (0..).zip(&world.graph.portals) {
        let parts = portal.fittings.iter();
        for part in parts.filter(|f| f.part == FittingPart::Leaf && counts[f.detail as usize]) {
            let Some(motion) = part.motion else {
                continue;
            };
            moves[part.detail as usize] = true;
            let mut leaf = Vec::new();
            add_object(world, part.detail, motion.at(1.0), &mut leaf);
            leaves.push((PortalId(i), leaf));
        }
    }
    for i in (0..).take(counts.len()) {
        if counts[i as usize] && !moves[i as usize] {
            add_object(world, i, DMat4::IDENTITY, &mut solid);
        }
    }
    (solid, leaves)
}

/// Adds the triangles of an object after a motion.
fn add_object(world: &World, detail: u32, motion: DMat4, triangles: &mut Vec<Triangle>) {
    let object = &world.details[detail as usize];
    for primitive in &world.detail_meshes[object.mesh as usize].primitives {
        triangles.extend(primitive.placed_triangles(motion * object.placement()));
    }
}
