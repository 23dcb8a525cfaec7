//! Closed solids whose insides are not air, however much they look like rooms.

use enfilade_geom::{Aabb, DVec2};

use crate::faults::plan::{CEILING, OFFICE, OUT, OUTER, Office, Plan, at, door, office, window};
use enfilade_demo::Generated;
use enfilade_demo::solid::{MeshBuilder, aabb};
use enfilade_demo::{Convex, Room};

/// Blocks of houses on open land: streets of 5 m, two blocks that touch, one sunk a little into the
/// ground and one hovering a little above it.
pub(super) fn city_blocks(name: &str) -> Generated {
    let mut plan = Plan::new(name);
    plan.solid("ground", aabb([-20.0, -0.5, -20.0], [56.0, 0.0, 56.0]));
    for i in 0..9_u8 {
        let (x, z) = (f64::from(i % 3) * 13.0, f64::from(i / 3) * 13.0);
        let top = 5.0 + f64::from(i * 7 % 5) * 2.0;
        let foot = match i {
            3 => -0.2,
            5 => 0.01,
            _ => 0.0,
        };
        plan.obstacle("block", aabb([x, foot, z], [x + 8.0, top, z + 8.0]));
    }
    plan.obstacle("block", aabb([34.0, 0.0, 2.0], [38.0, 4.0, 6.0]));
    plan.finish()
}

/// A hall with two rows of round columns, and a store beside it.
pub(super) fn columns(name: &str) -> Generated {
    const LENGTH: f64 = 16.0;
    const DEPTH: f64 = 12.0;
    const STORE: [f64; 2] = [LENGTH + 0.2, LENGTH + 4.2];
    const UP: [f64; 2] = [0.0, 4.0];
    const RADIUS: f64 = 0.3;
    const SIDES: usize = 12;
    let mut plan = Plan::new(name);
    let mut inside: Vec<(Aabb, f64)> = Vec::new();
    for i in 0..8_u8 {
        let (x, z) = (3.2 + f64::from(i % 4) * 3.2, 4.0 + f64::from(i / 4) * 4.0);
        let mut mesh = MeshBuilder::new(plan.plaster);
        mesh.column(DVec2::new(x, z), RADIUS, SIDES, UP[0], UP[1]);
        plan.site.structure("column", mesh);
        plan.site.matter(at(x, 2.0, z));
        let n = SIDES as f64;
        let area = 0.5 * n * RADIUS * RADIUS * (std::f64::consts::TAU / n).sin();
        let b = aabb(
            [x - RADIUS, UP[0], z - RADIUS],
            [x + RADIUS, UP[1], z + RADIUS],
        );
        inside.push((b, area * (UP[1] - UP[0])));
    }
    let hall = aabb([0.0, UP[0], 0.0], [LENGTH, UP[1], DEPTH]);
    let hall = plan.site.add_room(Room::new(
        "hall",
        plan.storey,
        vec![Convex::of_aabb(&hall)],
        &inside,
    ));
    let store = plan.room("store", [STORE[0], UP[0], 0.0], [STORE[1], UP[1], DEPTH]);
    let all = [-OUTER, STORE[1] + OUTER];
    plan.wall(
        2,
        [-OUTER, 0.0],
        all,
        UP,
        &[window(4.0, [OUT, hall]), door(10.0, [OUT, hall])],
    );
    plan.wall(
        2,
        [DEPTH, DEPTH + OUTER],
        all,
        UP,
        &[window(4.0, [hall, OUT]), window(18.2, [store, OUT])],
    );
    plan.wall(0, [-OUTER, 0.0], [0.0, DEPTH], UP, &[]);
    plan.wall(
        0,
        [LENGTH, STORE[0]],
        [0.0, DEPTH],
        UP,
        &[door(6.0, [hall, store])],
    );
    plan.wall(0, [STORE[1], STORE[1] + OUTER], [0.0, DEPTH], UP, &[]);
    for y in [[-0.3, 0.0], [UP[1], UP[1] + 0.3]] {
        let b = aabb([all[0], y[0], -OUTER], [all[1], y[1], DEPTH + OUTER]);
        plan.solid("floor slab", b);
    }
    plan.finish()
}

/// Boxes in an office: free, against walls, between two walls, stacked, below the ceiling, and from floor
/// to ceiling. Their names carry no information.
pub(super) fn boxes(name: &str) -> Generated {
    let mut plan = Plan::new(name);
    let [length, depth] = OFFICE;
    let places = [
        // A table, free; a cupboard at a wall; one between two walls.
        aabb([2.0, 0.0, 0.9], [3.6, 0.75, 1.7]),
        aabb([3.0, 0.0, 2.48], [4.8, 2.0, 3.08]),
        aabb([0.0, 0.0, 0.0], [0.6, 1.8, 1.2]),
        // A shaft, from floor to ceiling at a wall.
        aabb([length - 0.8, 0.0, 0.0], [length, CEILING, 0.9]),
        // Two stacked.
        aabb([7.4, 0.0, 0.8], [8.6, 1.0, 1.8]),
        aabb([7.5, 1.0, 0.9], [8.4, 1.7, 1.7]),
        // Below the ceiling, as large as an air conditioner.
        aabb([9.2, 2.3, 6.0], [10.4, CEILING, 7.2]),
        // Side by side at a wall, touching.
        aabb([4.6, 0.0, depth - 0.5], [5.6, 1.9, depth]),
        aabb([5.6, 0.0, depth - 0.5], [6.6, 1.9, depth]),
        // In the corridor.
        aabb([7.6, 0.0, 3.2], [8.8, 1.1, 3.6]),
    ];
    for b in places {
        plan.obstacle("block", b);
    }
    office(&mut plan, &Office::default());
    plan.finish()
}
