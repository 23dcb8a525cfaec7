//! Scaling of a finished world.

use std::sync::Arc;

use enfilade_cpg::World;

/// Scales `world` about the origin, with its graph, locator and geometry. Leaves of doors lose their motion.
#[must_use]
pub fn scaled_world(mut world: World, factor: f32) -> World {
    let scale = |p: &mut [f32; 3]| *p = p.map(|x| x * factor);
    for cell in &mut world.graph.cells {
        cell.aabb.iter_mut().for_each(scale);
        cell.volume *= factor.powi(3);
    }
    for portal in &mut world.graph.portals {
        portal.outline.iter_mut().for_each(scale);
        portal.pieces.iter_mut().flatten().for_each(scale);
        portal.area *= factor.powi(2);
        portal.fittings.clear();
    }
    let locator = Arc::make_mut(&mut world.graph.locator);
    locator.bounds.min *= f64::from(factor);
    locator.bounds.max *= f64::from(factor);
    for plane in &mut locator.planes {
        plane[3] *= f64::from(factor);
    }
    for batch in &mut world.batches {
        batch.primitive.positions.iter_mut().for_each(scale);
    }
    for object in &mut world.details {
        for (i, x) in object.transform.iter_mut().enumerate() {
            if i % 4 != 3 {
                *x *= factor;
            }
        }
    }
    world
}
