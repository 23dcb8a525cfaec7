//! Corridors as high as the rooms that they join, without a lintel or a frame at their mouths.

use enfilade_geom::Aabb;

use crate::faults::plan::OUT;
use enfilade_demo::OpeningKind::{Door, Window};
use enfilade_demo::solid::{MeshBuilder, aabb};
use enfilade_demo::{Convex, Room, Side};
use enfilade_demo::{Generated, Site};

/// Height of all rooms and corridors. [Units: wu]
const CEILING: f64 = 2.7;
/// Thickness of walls and slabs. [Units: wu]
const WALL: f64 = 0.3;

/// Rooms and corridors, carved out of shells around them.
struct Shells {
    site: Site,
    storey: usize,
    air: Vec<Aabb>,
    holes: Vec<Aabb>,
}

/// The air above an area of the plan.
fn air(x: [f64; 2], z: [f64; 2]) -> Aabb {
    aabb([x[0], 0.0, z[0]], [x[1], CEILING, z[1]])
}

impl Shells {
    fn new(name: &str) -> Self {
        let mut site = Site::new(name);
        let storey = site.storey("ground floor", 0.0);
        Self {
            site,
            storey,
            air: Vec::new(),
            holes: Vec::new(),
        }
    }

    /// Adds a room of boxes that do not overlap.
    fn room(&mut self, name: &str, boxes: &[Aabb]) -> Side {
        self.air.extend_from_slice(boxes);
        let parts = boxes.iter().map(Convex::of_aabb).collect();
        self.site.add_room(Room::new(name, self.storey, parts, &[]))
    }

    /// Adds the mouth of a corridor: in the plane of the room's wall, across `axis` at `at`.
    fn mouth(&mut self, axis: usize, at: f64, along: [f64; 2], rooms: [Side; 2]) {
        let hole = if axis == 0 {
            air([at, at], along)
        } else {
            air(along, [at, at])
        };
        self.site.opening(Door, hole, axis, rooms);
    }

    /// Adds a front door of 1.0 × 2.1 m through the wall across x that ends at `high`.
    fn front_door(&mut self, high: f64, z: f64, room: Side) {
        let hole = aabb([high - WALL, 0.0, z - 0.5], [high, 2.1, z + 0.5]);
        self.holes.push(hole);
        self.site.opening(Door, hole, 0, [OUT, room]);
    }

    /// Adds a window of 1.4 × 1.3 m through the wall across x that begins at `low`.
    fn window(&mut self, low: f64, z: f64, room: Side) {
        let hole = aabb([low, 0.9, z - 0.7], [low + WALL, 2.2, z + 0.7]);
        self.holes.push(hole);
        self.site.opening(Window, hole, 0, [room, OUT]);
    }

    fn finish(mut self) -> Generated {
        let plaster = self.site.material("plaster", [0.82, 0.79, 0.72]);
        let shells: Vec<Aabb> = self.air.iter().map(|b| b.expanded(WALL)).collect();
        let mut voids = self.air;
        voids.extend(self.holes);
        let mut mesh = MeshBuilder::new(plaster);
        mesh.carved(&shells, &voids);
        self.site.structure("building", mesh);
        self.site.finish()
    }
}

/// Two rooms of 6 × 6 m, and between them 20 m of corridor.
pub(super) fn straight(name: &str, width: f64) -> Generated {
    let mut s = Shells::new(name);
    let z = [3.0 - width * 0.5, 3.0 + width * 0.5];
    let west = s.room("west", &[air([0.0, 6.0], [0.0, 6.0])]);
    let corridor = s.room("corridor", &[air([6.0, 26.0], z)]);
    let east = s.room("east", &[air([26.0, 32.0], [0.0, 6.0])]);
    s.mouth(0, 6.0, z, [west, corridor]);
    s.mouth(0, 26.0, z, [corridor, east]);
    s.front_door(0.0, 2.0, west);
    s.window(32.0, 3.0, east);
    s.finish()
}

/// Width of corridors that bend or meet, half of it, and the size of the rooms at their ends.
/// [Units: wu]
const WIDTH: f64 = 1.6;
const HALF: f64 = WIDTH * 0.5;
const ROOM: f64 = 5.0;
/// Distance from the middle of a bend or crossing to the rooms. [Units: wu]
const ARM: f64 = 8.0;

/// Directions in which corridors run from the middle of a crossing.
#[derive(Clone, Copy)]
enum Way {
    West,
    East,
    North,
    South,
}

/// Corridors from a square in the middle to one room each; together they are one corridor.
fn star(name: &str, ways: &[Way]) -> Generated {
    let mut s = Shells::new(name);
    let across = [-HALF, HALF];
    let sides = [-ROOM * 0.5, ROOM * 0.5];
    let (low, high) = ([-ARM, -HALF], [HALF, ARM]);
    let mut arms = vec![air(across, across)];
    arms.extend(ways.iter().map(|way| match way {
        Way::West => air(low, across),
        Way::East => air(high, across),
        Way::North => air(across, low),
        Way::South => air(across, high),
    }));
    let corridor = s.room("corridor", &arms);
    let (before, behind) = ([-ARM - ROOM, -ARM], [ARM, ARM + ROOM]);
    for way in ways {
        match way {
            Way::West => {
                let room = s.room("west", &[air(before, sides)]);
                s.mouth(0, -ARM, across, [room, corridor]);
                s.front_door(-ARM - ROOM, 1.0, room);
            }
            Way::East => {
                let room = s.room("east", &[air(behind, sides)]);
                s.mouth(0, ARM, across, [corridor, room]);
                s.window(ARM + ROOM, 0.5, room);
            }
            Way::North => {
                let room = s.room("north", &[air(sides, before)]);
                s.mouth(2, -ARM, across, [room, corridor]);
            }
            Way::South => {
                let room = s.room("south", &[air(sides, behind)]);
                s.mouth(2, ARM, across, [corridor, room]);
            }
        }
    }
    s.finish()
}

pub(super) fn bend(name: &str) -> Generated {
    star(name, &[Way::West, Way::South])
}

pub(super) fn junction(name: &str) -> Generated {
    star(name, &[Way::West, Way::East, Way::South])
}

pub(super) fn crossing(name: &str) -> Generated {
    star(name, &[Way::West, Way::East, Way::North, Way::South])
}
