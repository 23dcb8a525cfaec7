//! Plugs of shut portals: ordinary triangles, so that they are drawn the same whatever is culled.

use enfilade_cpg::{PortalId, World};
use enfilade_geom::scene::Primitive;
use enfilade_runtime::Sight;
use glam::Vec3;

/// Old oak, in linear light.
pub(crate) const COLOR: [f32; 4] = [0.043, 0.015, 0.006, 1.0];

/// Returns the outline of a portal, moved to its shut leaves, and the strips from there to the portal's plane:
/// every line through the outline meets one of them. Leaves that fill the outline hide it; without leaves, it lies in
/// the portal's plane.
///
/// Empty if there is no such portal.
pub(crate) fn plug(world: &World, sight: &Sight, portal: PortalId) -> Primitive {
    let Some(p) = world.graph.portals.get(portal.0 as usize) else {
        return Primitive::default();
    };
    let depth = sight.depth_of_leaves(portal);
    let by = Vec3::from(p.normal) * depth;
    let n = p.outline.len() as u32;
    let moved = (p.outline.iter()).map(|&q| (Vec3::from(q) + by).to_array());
    let mut positions: Vec<[f32; 3]> = moved.collect();
    let mut indices: Vec<u32> = (2..n).flat_map(|i| [0, i - 1, i]).collect();
    if depth != 0.0 {
        positions.extend(&p.outline);
        for i in 0..n {
            let j = (i + 1) % n;
            indices.extend([i, j, n + j, i, n + j, n + i]);
        }
    }
    Primitive {
        positions,
        indices,
        ..Primitive::default()
    }
}
