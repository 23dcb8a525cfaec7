//! The demo of special portals: a house that does not fit in space.

use enfilade_geom::{DVec2, DVec3};

use crate::site::{Generated, Site};
use crate::solid::{MeshBuilder, aabb};
use crate::truth::OpeningKind;

/// Height of the rooms, and thickness of walls. [Units: wu]
const HEIGHT: f64 = 3.0;
const WALL: f64 = 0.2;
/// Distance of special portals from their walls. [Units: wu]
const OFF: f64 = 0.002;
/// Width and height of the doors. [Units: wu]
const DOOR: [f64; 2] = [1.0, 2.1];

/// A house, and the places of its special portals: polygons on its walls; those across z counter-clockwise as
/// seen from lower z, where their rooms are.
pub struct ImpossibleHouse {
    /// The model.
    pub house: Generated,
    /// Mirrors, facing each other.
    pub mirrors: Vec<Vec<DVec3>>,
    /// Pairs of doors that lead into each other.
    pub links: Vec<[Vec<DVec3>; 2]>,
    /// A screen, and the position and direction of its camera.
    pub monitor: (Vec<DVec3>, DVec3, DVec3),
    /// The middle of a window that reflects. [Units: wu]
    pub window: DVec3,
    /// Where to begin, and a point to look at. [Units: wu]
    pub start: [DVec3; 2],
}

/// A rectangle on a wall across x or z, at `at` of that axis, from and to along the other one, and from and to in height;
/// one across z is counter-clockwise as seen from lower z.
fn on_wall(axis: usize, at: f64, along: [f64; 2], up: [f64; 2]) -> Vec<DVec3> {
    let place = |(a, y): (f64, f64)| {
        if axis == 0 {
            DVec3::new(at, y, a)
        } else {
            DVec3::new(a, y, at)
        }
    };
    let [a, b] = along;
    let corners = [(a, up[0]), (a, up[1]), (b, up[1]), (b, up[0])];
    corners.map(place).to_vec()
}

/// Makes the house: a hall; a room of 10 m whose end doors lead back into itself (Gjørup 1999, section 3.4.2); a cabinet of 2 m
/// that holds a ballroom of 12 m; two mirrors that face each other; a screen; a window that reflects.
#[must_use]
pub fn impossible_house() -> ImpossibleHouse {
    let mut site = Site::new("impossible-house");
    let plaster = site.material("plaster", [0.82, 0.80, 0.76]);
    let floor = site.material("floor", [0.45, 0.32, 0.22]);
    let colors = [
        ("red", [0.75, 0.15, 0.12]),
        ("green", [0.15, 0.55, 0.2]),
        ("blue", [0.15, 0.25, 0.7]),
        ("yellow", [0.85, 0.7, 0.1]),
    ];
    let colors = colors.map(|(name, color)| site.material(name, color));
    let ground = site.storey("ground floor", 0.0);
    let room = |x: [f64; 2], z: [f64; 2]| aabb([x[0], 0.0, z[0]], [x[1], HEIGHT, z[1]]);
    let hall = room([0.0, 6.0], [0.0, 6.0]);
    let endless = room([6.2, 16.2], [0.0, 6.0]);
    let ballroom = room([0.0, 12.0], [6.2, 14.2]);
    let sides = [
        ("hall", hall),
        ("endless room", endless),
        ("ballroom", ballroom),
    ];
    let [hall_side, endless_side, ballroom_side] =
        sides.map(|(name, air)| site.room(name, ground, air));
    // Ordinary openings: hall to the endless room, endless room to the ballroom, and the front door.
    let door = aabb([6.0, 0.0, 1.0], [6.2, DOOR[1], 1.0 + DOOR[0]]);
    let window = aabb([8.0, 0.9, 6.0], [10.0, 2.2, 6.2]);
    let front = aabb([2.5, 0.0, -WALL], [2.5 + DOOR[0], DOOR[1], 0.0]);
    let out = aabb(
        [-WALL, -WALL, -WALL],
        [16.2 + WALL, HEIGHT + WALL, 14.2 + WALL],
    );
    let mut shell = MeshBuilder::new(plaster);
    shell.paint_top(floor);
    shell.carved(&[out], &[hall, endless, ballroom, door, window, front]);
    site.structure("shell", shell);
    let mut lawn = MeshBuilder::new(colors[1]);
    lawn.cuboid(aabb([-8.0, -0.4, -8.0], [24.0, -WALL, 22.0]));
    site.structure("lawn", lawn);
    // The cabinet stands in the hall.
    let mut cabinet = MeshBuilder::new(colors[2]);
    cabinet.cuboid(aabb([0.8, 0.0, 3.4], [2.8, 2.5, 5.4]));
    site.structure("cabinet", cabinet);
    for (b, axis, rooms, kind) in [
        (door, 0, [hall_side, endless_side], OpeningKind::Door),
        (
            window,
            2,
            [endless_side, ballroom_side],
            OpeningKind::Window,
        ),
    ] {
        site.opening(kind, b, axis, rooms);
    }
    // Something to tell places and directions by.
    for (i, (x, z)) in [(8.0, 4.8), (11.0, 1.2), (14.0, 4.0)]
        .into_iter()
        .enumerate()
    {
        let mut column = MeshBuilder::new(colors[i]);
        column.column(DVec2::new(x, z), 0.25, 8, 0.0, 1.2 + 0.4 * i as f64);
        site.detail(&format!("column {i}"), column);
    }
    for (i, x) in [2.0, 4.0, 8.0, 10.0].into_iter().enumerate() {
        let mut plinth = MeshBuilder::new(colors[i]);
        plinth.cuboid(aabb(
            [x - 0.3, 0.0, 9.7],
            [x + 0.3, 0.9 + 0.2 * i as f64, 10.3],
        ));
        site.detail(&format!("plinth {i}"), plinth);
    }
    let up = [0.0, DOOR[1]];
    ImpossibleHouse {
        house: site.finish(),
        mirrors: vec![
            on_wall(0, OFF, [8.0, 12.0], [0.3, 2.7]),
            on_wall(0, 12.0 - OFF, [8.0, 12.0], [0.3, 2.7]),
        ],
        links: vec![
            [
                on_wall(0, 6.2 + OFF, [3.0, 4.0], up),
                on_wall(0, 16.2 - OFF, [3.0, 4.0], up),
            ],
            [
                on_wall(2, 3.4 - OFF, [1.3, 2.3], up),
                on_wall(2, 14.2 - OFF, [5.5, 6.5], up),
            ],
        ],
        monitor: (
            on_wall(2, 6.0 - OFF, [3.6, 5.2], [1.2, 2.1]),
            DVec3::new(11.0, 2.6, 13.6),
            DVec3::new(-1.0, -0.3, -0.8),
        ),
        window: DVec3::new(9.0, 1.55, 6.1),
        start: [DVec3::new(4.5, 1.6, 1.0), DVec3::new(3.0, 1.3, 5.0)],
    }
}
