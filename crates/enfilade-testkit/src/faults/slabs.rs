//! Walls, slabs and ceilings that do not meet, or meet in unexpected places.

use crate::faults::plan::{CEILING, OFFICE, Office, Plan, office};
use enfilade_demo::Generated;
use enfilade_demo::solid::aabb;

/// Height of a wall's lower end above its slab. [Units: wu]
const SLIT: f64 = 0.002;
/// Gap between a hung ceiling and the walls around it. [Units: wu]
const SHADOW_GAP: f64 = 0.107;
/// Thickness of the hung ceilings, and the underside of the slab above them. [Units: wu]
const BOARD: f64 = 0.02;
const SLAB: f64 = 3.4;

/// Walls begin 2 mm above the slab that they stand on, outer ones included.
pub(super) fn walls_above_slabs(name: &str) -> Generated {
    let mut plan = Plan::new(name);
    let how = Office {
        foot: SLIT,
        ..Office::default()
    };
    office(&mut plan, &how);
    plan.finish()
}

/// Walls from slab to slab; the ceiling of each room hangs free. The air above it belongs to the room.
pub(super) fn hung_ceilings(name: &str) -> Generated {
    let mut plan = Plan::new(name);
    let how = Office {
        inner: SLAB,
        slab: SLAB,
        ..Office::default()
    };
    for [low, high] in office(&mut plan, &how) {
        let b = aabb(
            [low[0] + SHADOW_GAP, CEILING, low[1] + SHADOW_GAP],
            [high[0] - SHADOW_GAP, CEILING + BOARD, high[1] - SHADOW_GAP],
        );
        plan.solid("hung ceiling", b);
    }
    plan.finish()
}

/// Inner walls end at one ceiling over all rooms. The closed plenum above it is not a room.
pub(super) fn walls_to_ceiling(name: &str) -> Generated {
    let mut plan = Plan::new(name);
    let how = Office {
        slab: SLAB,
        ..Office::default()
    };
    office(&mut plan, &how);
    let [length, depth] = OFFICE;
    plan.solid(
        "hung ceiling",
        aabb([0.0, CEILING, 0.0], [length, CEILING + BOARD, depth]),
    );
    plan.finish()
}
