//! Walls with columns, posts or leaves, and walls without floors.

use crate::faults::plan::{
    BESIDE, BETWEEN, CEILING, Hole, OFFICE, OUT, OUTER, Office, Plan, door, office, window,
};
use enfilade_demo::Generated;
use enfilade_demo::Side;
use enfilade_demo::solid::aabb;

/// Columns of 40 cm in walls of 12 and 30 cm, in their middle, at their ends and where they meet.
pub(super) fn columns_in_walls(name: &str) -> Generated {
    const HALF: f64 = 0.2;
    let mut plan = Plan::new(name);
    let [length, depth] = OFFICE;
    let middle = |faces: [f64; 2]| f64::midpoint(faces[0], faces[1]);
    let beside = BESIDE.map(middle);
    let between = BETWEEN.map(middle);
    let places = [
        [3.2, beside[0]],
        [between[0], beside[0]],
        [8.4, beside[0]],
        [0.8, beside[1]],
        [between[1], beside[1]],
        [9.0, beside[1]],
        [between[0], 0.0],
        [between[1], depth],
        [0.0, 0.0],
        [length, depth],
        [length, 4.0],
    ];
    for [x, z] in places {
        let b = aabb([x - HALF, 0.0, z - HALF], [x + HALF, CEILING, z + HALF]);
        plan.obstacle("column", b);
    }
    office(&mut plan, &Office::default());
    plan.finish()
}

/// Four rooms around a post of 15 cm, with a doorway between each two of them that begins at the post.
pub(super) fn corner_doors(name: &str) -> Generated {
    const POST: [f64; 2] = [4.0, 4.15];
    const END: f64 = 8.15;
    const WIDTH: f64 = 0.9;
    let mut plan = Plan::new(name);
    let halves = [[0.0, POST[0]], [POST[1], END]];
    let mut room = |name: &str, x: usize, z: usize| {
        let (x, z) = (halves[x], halves[z]);
        plan.room(name, [x[0], 0.0, z[0]], [x[1], CEILING, z[1]])
    };
    let (nw, ne) = (room("north west", 0, 0), room("north east", 1, 0));
    let (sw, se) = (room("south west", 0, 1), room("south east", 1, 1));
    let up = [0.0, CEILING];
    let before = [POST[0] - WIDTH, POST[0]];
    let behind = [POST[1], POST[1] + WIDTH];
    let doorway = |along: [f64; 2], rooms: [Side; 2]| Hole {
        along,
        ..door(0.0, rooms)
    };
    plan.wall(0, POST, halves[0], up, &[doorway(before, [nw, ne])]);
    plan.wall(0, POST, halves[1], up, &[doorway(behind, [sw, se])]);
    plan.wall(2, POST, halves[0], up, &[doorway(before, [nw, sw])]);
    plan.wall(2, POST, halves[1], up, &[doorway(behind, [ne, se])]);
    plan.solid(
        "column",
        aabb([POST[0], 0.0, POST[0]], [POST[1], CEILING, POST[1]]),
    );
    let (low, high) = ([-OUTER, 0.0], [END, END + OUTER]);
    let all = [-OUTER, END + OUTER];
    plan.wall(
        2,
        low,
        all,
        up,
        &[door(1.5, [OUT, nw]), window(6.0, [OUT, ne])],
    );
    plan.wall(
        2,
        high,
        all,
        up,
        &[window(2.0, [sw, OUT]), window(6.0, [se, OUT])],
    );
    plan.wall(0, low, [0.0, END], up, &[window(2.0, [OUT, nw])]);
    plan.wall(0, high, [0.0, END], up, &[window(6.0, [se, OUT])]);
    for y in [[-0.3, 0.0], [CEILING, CEILING + 0.3]] {
        plan.solid(
            "floor slab",
            aabb([all[0], y[0], all[0]], [all[1], y[1], all[1]]),
        );
    }
    plan.finish()
}

/// Ten walls of 4 m height around a corridor and three rooms on either side, without floors and ceilings,
/// as in extruded plans.
pub(super) fn walls_alone(name: &str) -> Generated {
    const LENGTH: f64 = 13.6;
    const DEPTH: f64 = 10.0;
    const UP: [f64; 2] = [0.0, 4.0];
    const INNER: f64 = 0.2;
    const CORRIDOR: [f64; 2] = [4.2, 5.8];
    let mut plan = Plan::new(name);
    let columns = [[0.0, 4.4], [4.4 + INNER, 9.0], [9.0 + INNER, LENGTH]];
    let rows = [[0.0, CORRIDOR[0] - INNER], [CORRIDOR[1] + INNER, DEPTH]];
    let corridor = plan.room(
        "corridor",
        [0.0, UP[0], CORRIDOR[0]],
        [LENGTH, UP[1], CORRIDOR[1]],
    );
    let all = [-OUTER, LENGTH + OUTER];
    for (side, z) in rows.into_iter().enumerate() {
        let rooms: Vec<Side> = columns
            .iter()
            .enumerate()
            .map(|(i, x)| {
                let name = format!("{} {i}", ["north", "south"][side]);
                plan.room(&name, [x[0], UP[0], z[0]], [x[1], UP[1], z[1]])
            })
            .collect();
        let order = |room: Side, other: Side| {
            if side == 0 {
                [room, other]
            } else {
                [other, room]
            }
        };
        let middle = |i: usize| f64::midpoint(columns[i][0], columns[i][1]);
        let mut doors: Vec<Hole> = (0..3)
            .map(|i| door(middle(i) + 0.5, order(rooms[i], corridor)))
            .collect();
        if side == 0 {
            // Into the rooms, like those of the other side.
            doors.iter_mut().for_each(|d| d.swing = -d.swing);
        }
        let windows: Vec<Hole> = (0..3)
            .map(|i| window(middle(i), order(OUT, rooms[i])))
            .collect();
        let (beside, outer) = if side == 0 {
            ([z[1], CORRIDOR[0]], [-OUTER, 0.0])
        } else {
            ([CORRIDOR[1], z[0]], [DEPTH, DEPTH + OUTER])
        };
        plan.wall(2, beside, [0.0, LENGTH], UP, &doors);
        plan.wall(2, outer, all, UP, &windows);
        for i in 1..3 {
            plan.wall(0, [columns[i - 1][1], columns[i][0]], z, UP, &[]);
        }
    }
    plan.wall(
        0,
        [-OUTER, 0.0],
        [0.0, DEPTH],
        UP,
        &[door(5.0, [OUT, corridor])],
    );
    plan.wall(0, [LENGTH, LENGTH + OUTER], [0.0, DEPTH], UP, &[]);
    plan.finish()
}

/// A sound building, except that open leaves take up most of the corridor's width.
pub(super) fn leaves_in_corridor(name: &str) -> Generated {
    let mut plan = Plan::new(name);
    let how = Office {
        has_leaves_in_corridor: true,
        ..Office::default()
    };
    office(&mut plan, &how);
    plan.finish()
}
