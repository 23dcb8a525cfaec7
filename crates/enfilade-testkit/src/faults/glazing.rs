//! Glass from wall to wall, between mullions.

use crate::faults::plan::{Hole, OUT, OUTER, Plan, door, span, window};
use enfilade_demo::Generated;
use enfilade_demo::furniture::glaze;
use enfilade_demo::solid::aabb;
use enfilade_demo::{OpeningKind, Side};

/// Start of the bays of [`curtain_wall`] along the long sides, end of the last one, and position of the
/// partition between hall and gallery. [Units: wu]
const BAY: f64 = 3.0;
const SIZE: [f64; 2] = [18.0, 9.0];
const PARTITION: f64 = 12.0;
const UPPER: [f64; 2] = [3.3, 6.6];
/// Depth of mullions and transoms, and half their width. [Units: wu]
const DEEP: f64 = 0.15;
const HALF: f64 = 0.025;

/// Two rooms below; above them a hall and a gallery, glazed on all sides from slab to slab in bays
/// of 3 m between mullions, each of four panes between transoms. A bay is one window.
pub(super) fn curtain_wall(name: &str) -> Generated {
    const GROUND: [f64; 2] = [0.0, 3.0];
    let mut plan = Plan::new(name);
    let [length, depth] = SIZE;
    for y in [[-0.3, GROUND[0]], [GROUND[1], UPPER[0]], [UPPER[1], 6.9]] {
        let b = aabb(
            [-OUTER, y[0], -OUTER],
            [length + OUTER, y[1], depth + OUTER],
        );
        plan.solid("floor slab", b);
    }
    let west = plan.room("west", [0.0, GROUND[0], 0.0], [8.9, GROUND[1], depth]);
    let east = plan.room("east", [9.1, GROUND[0], 0.0], [length, GROUND[1], depth]);
    let all = [-OUTER, length + OUTER];
    plan.wall(
        2,
        [-OUTER, 0.0],
        all,
        GROUND,
        &[door(3.0, [OUT, west]), window(14.0, [OUT, east])],
    );
    plan.wall(
        2,
        [depth, depth + OUTER],
        all,
        GROUND,
        &[window(3.0, [west, OUT]), window(14.0, [east, OUT])],
    );
    plan.wall(0, [-OUTER, 0.0], [0.0, depth], GROUND, &[]);
    plan.wall(0, [length, length + OUTER], [0.0, depth], GROUND, &[]);
    plan.wall(
        0,
        [8.9, 9.1],
        [0.0, depth],
        GROUND,
        &[door(4.0, [west, east])],
    );

    plan.storey = plan.site.storey("upper floor", UPPER[0]);
    let (before, behind) = (PARTITION - 2.0 * HALF, PARTITION + 2.0 * HALF);
    let hall = plan.room("hall", [0.0, UPPER[0], 0.0], [before, UPPER[1], depth]);
    let gallery = plan.room(
        "gallery",
        [behind, UPPER[0], 0.0],
        [length, UPPER[1], depth],
    );
    let between = Hole {
        up: [UPPER[0], UPPER[0] + 2.05],
        ..door(6.0, [hall, gallery])
    };
    plan.wall(0, [before, behind], [0.0, depth], UPPER, &[between]);
    for x in [[-DEEP, 0.0], [length, length + DEEP]] {
        for z in [[-DEEP, 0.0], [depth, depth + DEEP]] {
            plan.solid("mullion", span(0, x, z, UPPER));
        }
    }
    for axis in [0, 2] {
        // Façades across x run along z, and the other way round.
        let (end, far) = (SIZE[1 - axis / 2], SIZE[axis / 2]);
        for (is_high, faces) in [(false, [-DEEP, 0.0]), (true, [far, far + DEEP])] {
            facade(&mut plan, axis, faces, end, |at| {
                let is_hall = if axis == 2 { at < PARTITION } else { !is_high };
                let room = if is_hall { hall } else { gallery };
                if is_high { [room, OUT] } else { [OUT, room] }
            });
        }
    }
    plan.finish()
}

/// Adds bays of glass from 0 to `end` across `axis` between `faces`, with the rooms at each place.
fn facade(
    plan: &mut Plan,
    axis: usize,
    faces: [f64; 2],
    end: f64,
    rooms: impl Fn(f64) -> [Side; 2],
) {
    const PANES: u8 = 4;
    let n = (end / BAY).round() as u8;
    // The partition ends at a mullion of its own width; posts stand where two facades meet.
    let half = |at: f64| match at {
        at if at <= 0.0 || at >= end => 0.0,
        at if axis == 2 && at == PARTITION => 2.0 * HALF,
        _ => HALF,
    };
    for at in (1..n).map(|i| f64::from(i) * BAY) {
        plan.solid(
            "mullion",
            span(axis, faces, [at - half(at), at + half(at)], UPPER),
        );
    }
    for at in (0..n).map(|i| f64::from(i) * BAY) {
        let along = [at + half(at), at + BAY - half(at + BAY)];
        let bay = span(axis, faces, along, UPPER);
        plan.site.opening(OpeningKind::Window, bay, axis, rooms(at));
        let height = (UPPER[1] - UPPER[0]) / f64::from(PANES);
        for k in 0..PANES {
            let low = UPPER[0] + f64::from(k) * height;
            if k > 0 {
                plan.solid(
                    "mullion",
                    span(axis, faces, along, [low - HALF, low + HALF]),
                );
            }
            let from = if k > 0 { low + HALF } else { low };
            let to = low + height - if k + 1 < PANES { HALF } else { 0.0 };
            let pane = span(axis, faces, along, [from, to]);
            glaze(&mut plan.site, &plan.palette, &pane, axis);
        }
    }
}

/// Three offices behind a partition of panes in bays of 1.2 m between mullions of 6 cm, with a door below
/// a pane in the second bay of each; outside, windows divided into three by mullions of 5 cm.
pub(super) fn mullions(name: &str) -> Generated {
    const CEILING: f64 = 2.8;
    const BAY: f64 = 1.2;
    const BAYS: u8 = 4;
    const HALF: f64 = 0.03;
    const WALL: f64 = 0.12;
    const GLASS: [f64; 2] = [1.8, 1.9];
    const DEPTH: f64 = 6.4;
    const UP: [f64; 2] = [0.0, CEILING];
    let mut plan = Plan::new(name);
    let pitch = f64::from(BAYS) * BAY;
    let ends = [0.0, 1.0, 2.0].map(|i: f64| {
        let low = i * (pitch + WALL);
        [low, low + pitch]
    });
    let length = ends[2][1];
    let corridor = plan.room("corridor", [0.0; 3], [length, CEILING, GLASS[0]]);
    let all = [-OUTER, length + OUTER];
    let mut outside = Vec::new();
    for (i, x) in ends.into_iter().enumerate() {
        let low = [x[0], 0.0, GLASS[1]];
        let office = plan.room(&format!("office {i}"), low, [x[1], CEILING, DEPTH]);
        glass_partition(
            &mut plan,
            GLASS,
            x[0],
            BAY,
            [HALF, CEILING],
            [corridor, office],
        );
        if i > 0 {
            // It runs up to the corridor and divides the panes.
            plan.wall(0, [ends[i - 1][1], x[0]], [GLASS[0], DEPTH], UP, &[]);
        }
        // A window of 3 m, divided into three.
        outside.extend((0..3_u8).map(|k| {
            let at = f64::midpoint(x[0], x[1]) - 1.5 + f64::from(k);
            Hole {
                kind: OpeningKind::Window,
                along: [at + 0.025, at + 0.975],
                up: [0.9, 2.4],
                rooms: [office, OUT],
                swing: 0.0,
            }
        }));
    }
    plan.wall(2, [DEPTH, DEPTH + 0.2], all, UP, &outside);
    plan.wall(2, [-OUTER, 0.0], all, UP, &[window(4.0, [OUT, corridor])]);
    plan.wall(
        0,
        [-OUTER, 0.0],
        [0.0, DEPTH],
        UP,
        &[door(0.9, [OUT, corridor])],
    );
    plan.wall(0, [length, length + OUTER], [0.0, DEPTH], UP, &[]);
    for y in [[-0.3, 0.0], [CEILING, CEILING + 0.3]] {
        plan.solid(
            "floor slab",
            aabb([all[0], y[0], -OUTER], [all[1], y[1], DEPTH + 0.2]),
        );
    }
    plan.finish()
}

/// Adds four bays across z from `low` on: panes from floor to ceiling, in the second one a door of 2.1 m
/// below a rail of 6 cm and a pane. `half` is half the width of a mullion, then comes the height.
fn glass_partition(
    plan: &mut Plan,
    faces: [f64; 2],
    low: f64,
    bay: f64,
    [half, height]: [f64; 2],
    rooms: [Side; 2],
) {
    const DOOR: f64 = 2.1;
    const RAIL: f64 = 0.06;
    for i in 0..=4_u8 {
        // At the walls beside, half a mullion.
        let at = low + f64::from(i) * bay;
        let along = [
            at - if i == 0 { 0.0 } else { half },
            at + if i == 4 { 0.0 } else { half },
        ];
        plan.solid("mullion", span(2, faces, along, [0.0, height]));
    }
    for i in 0..4_u8 {
        let at = low + f64::from(i) * bay;
        let along = [at + half, at + bay - half];
        if i == 1 {
            plan.solid("mullion", span(2, faces, along, [DOOR, DOOR + RAIL]));
            let way = span(2, faces, along, [0.0, DOOR]);
            plan.opening(OpeningKind::Door, way, 2, rooms, 80.0);
            let above = span(2, faces, along, [DOOR + RAIL, height]);
            plan.opening(OpeningKind::Window, above, 2, rooms, 0.0);
        } else {
            let pane = span(2, faces, along, [0.0, height]);
            plan.opening(OpeningKind::Window, pane, 2, rooms, 0.0);
        }
    }
}
