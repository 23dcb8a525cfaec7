//! The height of the ground around a building, and what is below it.

use enfilade_cpg::{PortalKind, World};
use enfilade_geom::DVec3;

/// Height above the ground up to which things are still in it. [Units: wu]
const TOLERANCE: f64 = 0.1;
/// Lowest height of an opening through which people step out. [Units: wu]
const STEP_OUT: f64 = 1.5;

/// Returns the height at which people step out of the building: that of the lowest door sill outdoors. Without any, the lowest floor
/// of a room that has an opening to the outdoors, or of any. `None` without rooms.
pub(crate) fn ground_level(world: &World) -> Option<f64> {
    let graph = &world.graph;
    let height = |p: &[f32; 3]| f64::from(p[1]);
    let sills = graph.portals.iter().filter_map(|portal| {
        let is_way = matches!(portal.kind, PortalKind::Door | PortalKind::Open);
        let leads_out = portal.cells.iter().any(|&c| graph[c].outdoor);
        let heights = portal.outline.iter().map(height);
        let (low, high) = heights.fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(y), h.max(y)));
        (is_way && leads_out && high - low >= STEP_OUT).then_some(low)
    });
    let floors = graph.rooms().map(|(_, cell)| height(&cell.aabb[0]));
    let lowest = |heights: &mut dyn Iterator<Item = f64>| heights.min_by(f64::total_cmp);
    lowest(&mut { sills }).or_else(|| lowest(&mut { floors }))
}

/// Returns `true` if a surface with the outdoors behind is in the ground.
pub(crate) fn is_ground(ground: Option<f64>, points: &[DVec3], normal: DVec3) -> bool {
    let Some(ground) = ground else { return false };
    let top = points.iter().map(|p| p.y).fold(f64::MIN, f64::max);
    normal.y < 0.5 && top <= ground + TOLERANCE
}
