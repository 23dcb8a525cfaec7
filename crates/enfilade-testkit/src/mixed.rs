//! Small buildings, each with one feature that simple methods get wrong.
//!
//! All stand in the open: closed solids with outer faces, walls of 10-30 cm, slabs above and below. Floors
//! are at height 0 unless a scene has storeys.

use enfilade_geom::{Aabb, DVec3};

use enfilade_demo::OpeningKind::{Door, Opening, Window};
use enfilade_demo::furniture::{Palette, glaze};
use enfilade_demo::roof::GableRoof;
use enfilade_demo::solid::{MeshBuilder, Steps, aabb};
use enfilade_demo::{Convex, OpeningKind, Room, Side};
use enfilade_demo::{Generated, Site};

/// A building carved out of solid boxes.
struct Carver {
    site: Site,
    storey: usize,
    material: u32,
    solids: Vec<Aabb>,
    voids: Vec<Aabb>,
}

/// The side without a room.
const OUT: Side = Side::Outside;

impl Carver {
    /// Makes a building without parts, its first storey at height 0.
    fn new(name: &str) -> Self {
        let mut site = Site::new(name);
        let material = site.material("plaster", [0.8, 0.78, 0.72]);
        let storey = site.storey("ground floor", 0.0);
        Self {
            site,
            storey,
            material,
            solids: Vec::new(),
            voids: Vec::new(),
        }
    }

    fn solid(&mut self, min: [f64; 3], max: [f64; 3]) {
        self.solids.push(aabb(min, max));
    }

    /// Adds a room that fills a box.
    fn room(&mut self, name: &str, min: [f64; 3], max: [f64; 3]) -> Side {
        self.rooms(name, &[aabb(min, max)], &[])
    }

    /// Adds a room of several boxes, with solids in it that are modelled elsewhere.
    fn rooms(&mut self, name: &str, air: &[Aabb], inside: &[(Aabb, f64)]) -> Side {
        self.voids.extend_from_slice(air);
        let parts = air.iter().map(Convex::of_aabb).collect();
        self.site
            .add_room(Room::new(name, self.storey, parts, inside))
    }

    /// Adds an opening across `axis` through the box from `min` to `max`.
    fn hole(
        &mut self,
        kind: OpeningKind,
        axis: usize,
        min: [f64; 3],
        max: [f64; 3],
        rooms: [Side; 2],
    ) {
        let hole = aabb(min, max);
        self.voids.push(hole);
        self.site.opening(kind, hole, axis, rooms);
    }

    /// Adds a door of 0.9 × 2.05 m at floor level, across `axis` between the faces of a wall, its middle `at`
    /// along the wall.
    fn door(&mut self, axis: usize, faces: [f64; 2], at: f64, rooms: [Side; 2]) {
        self.wide_door(axis, faces, at, [0.9, 2.05], rooms);
    }

    fn wide_door(
        &mut self,
        axis: usize,
        faces: [f64; 2],
        at: f64,
        [width, height]: [f64; 2],
        rooms: [Side; 2],
    ) {
        let (low, high) = (at - width * 0.5, at + width * 0.5);
        let floor = self.floor();
        let (min, max) = if axis == 0 {
            ([faces[0], floor, low], [faces[1], floor + height, high])
        } else {
            ([low, floor, faces[0]], [high, floor + height, faces[1]])
        };
        self.hole(Door, axis, min, max, rooms);
    }

    /// Adds a window of 1.2 × 1.3 m, its sill 0.9 m above the floor.
    fn window(&mut self, axis: usize, faces: [f64; 2], at: f64, rooms: [Side; 2]) {
        let (low, high, sill) = (at - 0.6, at + 0.6, self.floor() + 0.9);
        let (min, max) = if axis == 0 {
            ([faces[0], sill, low], [faces[1], sill + 1.3, high])
        } else {
            ([low, sill, faces[0]], [high, sill + 1.3, faces[1]])
        };
        self.hole(Window, axis, min, max, rooms);
    }

    fn floor(&self) -> f64 {
        if self.storey == 0 { 0.0 } else { UPPER_FLOOR }
    }

    /// Models everything collected so far as one object, and starts another.
    fn flush(&mut self, name: &str) {
        let mut mesh = MeshBuilder::new(self.material);
        mesh.carved(
            &std::mem::take(&mut self.solids),
            &std::mem::take(&mut self.voids),
        );
        self.site.structure(name, mesh);
    }

    fn finish(mut self) -> Generated {
        self.flush("building");
        self.site.finish()
    }
}

/// Floor of the second storey of [`stair_hall`]. [Units: wu]
const UPPER_FLOOR: f64 = 3.1;

fn two_rooms_carved(name: &str) -> (Carver, [Side; 2]) {
    let mut c = Carver::new(name);
    c.solid([-0.2, -0.3, -0.2], [9.4, 3.0, 4.2]);
    let west = c.room("west", [0.0, 0.0, 0.0], [5.0, 2.7, 4.0]);
    let east = c.room("east", [5.2, 0.0, 0.0], [9.2, 2.7, 4.0]);
    c.door(0, [5.0, 5.2], 1.5, [west, east]);
    (c, [west, east])
}

/// Two rooms and the door between them, without a way out.
#[must_use]
pub fn two_rooms() -> Generated {
    two_rooms_carved("two-rooms").0.finish()
}

/// [`two_rooms`], with a gap of `width` all along the top of the wall between them. The gap is a fault of
/// the model and not an opening in the truth. [Units: wu] [Limit: 0.0001 <= width <= 0.5]
#[must_use]
pub fn two_rooms_crack(width: f64) -> Generated {
    let (mut c, _) = two_rooms_carved("two-rooms-crack");
    c.voids.push(aabb([5.0, 2.7 - width, 0.0], [5.2, 2.7, 4.0]));
    c.finish()
}

/// Two rooms, a door and a window; every wall, floor and ceiling is a single rectangle without thickness.
/// Vertices of the door meet the floor in the middle of its edge.
#[must_use]
pub fn zero_thickness_rooms() -> Generated {
    let mut site = Site::new("zero-thickness-rooms");
    let material = site.sheet_material("paper", [0.8, 0.78, 0.72]);
    let storey = site.storey("ground floor", 0.0);
    let boxes = [
        aabb([0.0; 3], [5.0, 2.7, 4.0]),
        aabb([5.0, 0.0, 0.0], [9.0, 2.7, 4.0]),
    ];
    let west = site.room("west", storey, boxes[0]);
    let east = site.room("east", storey, boxes[1]);
    let door = aabb([5.0, 0.0, 1.0], [5.0, 2.05, 1.9]);
    let window = aabb([6.0, 0.9, 0.0], [7.5, 2.2, 0.0]);
    site.opening(Door, door, 0, [west, east]);
    site.opening(Window, window, 2, [OUT, east]);
    let face = |b: &Aabb, axis: usize, high: bool| {
        let mut f = *b;
        let at = if high { b.max[axis] } else { b.min[axis] };
        (f.min[axis], f.max[axis]) = (at, at);
        f
    };
    let mut mesh = MeshBuilder::new(material);
    for (i, b) in boxes.iter().enumerate() {
        for axis in 0..3 {
            for high in [false, true] {
                // The wall between the rooms is added once, with the west room.
                if i == 1 && axis == 0 && !high {
                    continue;
                }
                let holes: &[Aabb] = match (i, axis, high) {
                    (0, 0, true) => &[door],
                    (1, 2, false) => &[window],
                    _ => &[],
                };
                mesh.sheet(face(b, axis, high), axis, !high, holes);
            }
        }
    }
    site.structure("walls", mesh);
    site.finish()
}

/// Four rooms around a courtyard that is open to the sky: part of the outside.
#[must_use]
pub fn open_courtyard() -> Generated {
    let mut c = Carver::new("open-courtyard");
    c.solid([-0.3, -0.3, -0.3], [16.3, 3.1, 14.3]);
    c.voids.push(aabb([4.6, 0.0, 4.6], [11.4, 3.1, 9.4]));
    let west = c.room("west", [0.0; 3], [4.3, 2.8, 14.0]);
    let east = c.room("east", [11.7, 0.0, 0.0], [16.0, 2.8, 14.0]);
    let north = c.room("north", [4.5, 0.0, 0.0], [11.5, 2.8, 4.3]);
    let south = c.room("south", [4.5, 0.0, 9.7], [11.5, 2.8, 14.0]);
    c.door(0, [4.3, 4.5], 2.0, [west, north]);
    c.door(0, [4.3, 4.5], 12.0, [west, south]);
    c.door(0, [11.5, 11.7], 2.0, [north, east]);
    c.door(0, [11.5, 11.7], 12.0, [south, east]);
    c.wide_door(2, [9.4, 9.7], 8.0, [1.6, 2.1], [OUT, south]);
    c.door(2, [14.0, 14.3], 8.0, [south, OUT]);
    c.window(2, [4.3, 4.6], 6.5, [north, OUT]);
    c.window(2, [4.3, 4.6], 9.5, [north, OUT]);
    c.window(0, [4.3, 4.6], 7.0, [west, OUT]);
    c.window(0, [11.4, 11.7], 7.0, [OUT, east]);
    c.finish()
}

/// A booth with walls and a roof of its own inside a hall.
#[must_use]
pub fn room_within_room() -> Generated {
    let mut c = Carver::new("room-within-room");
    c.solid([-0.3, -0.3, -0.3], [12.3, 4.3, 10.3]);
    let booth_box = aabb([4.0, 0.0, 3.0], [8.2, 2.7, 6.2]);
    // The hall without the booth, as boxes around and above it.
    let around = [
        aabb([0.0; 3], [4.0, 4.0, 10.0]),
        aabb([8.2, 0.0, 0.0], [12.0, 4.0, 10.0]),
        aabb([4.0, 0.0, 0.0], [8.2, 4.0, 3.0]),
        aabb([4.0, 0.0, 6.2], [8.2, 4.0, 10.0]),
        aabb([4.0, 2.7, 3.0], [8.2, 4.0, 6.2]),
    ];
    let hall = c.rooms("hall", &around, &[]);
    c.voids.push(booth_box);
    c.wide_door(2, [-0.3, 0.0], 2.0, [1.2, 2.1], [OUT, hall]);
    c.window(2, [-0.3, 0.0], 8.0, [OUT, hall]);
    c.flush("hall");
    c.solids.push(booth_box);
    let booth = c.room("booth", [4.1, 0.0, 3.1], [8.1, 2.6, 6.1]);
    c.door(2, [6.1, 6.2], 5.0, [booth, hall]);
    c.finish()
}

/// A corridor in the shape of an L, 1.6 m wide, with five rooms along it.
#[must_use]
pub fn l_corridor() -> Generated {
    let mut c = Carver::new("l-corridor");
    c.solid([-0.3, -0.3, -4.5], [10.3, 2.9, 9.3]);
    let arms = [
        aabb([0.0; 3], [10.0, 2.6, 1.6]),
        aabb([8.4, 0.0, 1.6], [10.0, 2.6, 9.0]),
    ];
    let corridor = c.rooms("corridor", &arms, &[]);
    let a = c.room("a", [0.0, 0.0, 1.75], [4.0, 2.6, 6.0]);
    let b = c.room("b", [4.15, 0.0, 1.75], [8.25, 2.6, 6.0]);
    let d = c.room("d", [4.15, 0.0, 6.15], [8.25, 2.6, 9.0]);
    let e = c.room("e", [0.0, 0.0, -4.2], [4.9, 2.6, -0.15]);
    let f = c.room("f", [5.05, 0.0, -4.2], [10.0, 2.6, -0.15]);
    c.door(2, [1.6, 1.75], 3.2, [corridor, a]);
    c.door(2, [1.6, 1.75], 4.9, [corridor, b]);
    c.door(0, [8.25, 8.4], 7.5, [d, corridor]);
    c.door(2, [-0.15, 0.0], 4.2, [e, corridor]);
    c.door(2, [-0.15, 0.0], 8.0, [f, corridor]);
    c.door(2, [9.0, 9.3], 9.2, [corridor, OUT]);
    c.window(0, [-0.3, 0.0], 4.0, [OUT, a]);
    c.window(0, [-0.3, 0.0], -2.0, [OUT, e]);
    c.window(0, [10.0, 10.3], -2.0, [f, OUT]);
    c.window(2, [9.0, 9.3], 6.0, [d, OUT]);
    c.finish()
}

/// Two storeys joined by a stair hole of 2.4 × 1.8 m with a flight of stairs in it; a side room
/// on each.
#[must_use]
pub fn stair_hall() -> Generated {
    let mut c = Carver::new("stair-hall");
    c.solid([-0.3, -0.3, -0.3], [8.5, 6.2, 8.3]);
    let steps = Steps {
        n: 17,
        riser: UPPER_FLOOR / 17.0,
        going: 0.26,
        waist: 0.18,
    };
    let hole = [[2.0, 2.8, 1.0], [3.8, UPPER_FLOOR, 3.4]];
    let flight = aabb([2.45, 0.0, 1.0], [3.35, 2.8, 1.0 + steps.run()]);
    let solids = [(flight, steps.volume_below(0.9, 2.8))];
    let lower = c.rooms("lower hall", &[aabb([0.0; 3], [5.5, 2.8, 8.0])], &solids);
    let store = c.room("store", [5.65, 0.0, 0.0], [8.2, 2.8, 8.0]);
    c.door(0, [5.5, 5.65], 6.0, [lower, store]);
    c.wide_door(2, [8.0, 8.3], 1.5, [1.0, 2.1], [lower, OUT]);
    c.storey = c.site.storey("upper floor", UPPER_FLOOR);
    let upper = c.room("upper hall", [0.0, UPPER_FLOOR, 0.0], [5.5, 5.9, 8.0]);
    let office = c.room("office", [5.65, UPPER_FLOOR, 0.0], [8.2, 5.9, 8.0]);
    c.door(0, [5.5, 5.65], 5.0, [upper, office]);
    c.window(0, [8.2, 8.5], 4.0, [office, OUT]);
    c.window(2, [8.0, 8.3], 3.0, [upper, OUT]);
    c.hole(Opening, 1, hole[0], hole[1], [lower, upper]);
    let mut stairs = MeshBuilder::new(c.material);
    stairs.flight(
        DVec3::new(2.9, 0.0, 1.0 + steps.run()),
        -DVec3::Z,
        0.9,
        &steps,
    );
    c.site.structure("stairs", stairs);
    c.finish()
}

/// A bedroom with a closet that is 0.93 m deep behind a door of 0.9 m; across a passage a toilet
/// 1.14 m deep and a store.
#[must_use]
pub fn rooms_with_closet() -> Generated {
    let mut c = Carver::new("rooms-with-closet");
    c.solid([-0.3, -0.3, -0.3], [6.86, 2.8, 5.83]);
    let bedroom = c.room("bedroom", [0.0; 3], [4.0, 2.5, 4.5]);
    let closet = c.room("closet", [0.0, 0.0, 4.6], [1.8, 2.5, 5.53]);
    let passage = c.room("passage", [4.12, 0.0, 0.0], [5.32, 2.5, 4.5]);
    let toilet = c.room("toilet", [5.42, 0.0, 0.0], [6.56, 2.5, 1.9]);
    let store = c.room("store", [5.42, 0.0, 2.0], [6.56, 2.5, 4.5]);
    c.door(2, [4.5, 4.6], 0.9, [bedroom, closet]);
    c.door(0, [4.0, 4.12], 3.6, [bedroom, passage]);
    c.wide_door(0, [5.32, 5.42], 0.9, [0.8, 2.05], [passage, toilet]);
    c.door(0, [5.32, 5.42], 3.2, [passage, store]);
    c.window(0, [-0.3, 0.0], 2.0, [OUT, bedroom]);
    c.wide_door(2, [-0.3, 0.0], 4.72, [1.0, 2.1], [OUT, passage]);
    c.finish()
}

/// A corridor 2 m wide, divided by double doors of 1.8 m into three, with rooms on both sides.
#[must_use]
pub fn double_door_corridor() -> Generated {
    let mut c = Carver::new("double-door-corridor");
    c.solid([-0.3, -0.3, -4.45], [18.3, 2.8, 6.45]);
    let ends = [[0.0, 5.9], [6.02, 11.9], [12.02, 18.0]];
    let parts: Vec<Side> = ["west", "middle", "east"]
        .iter()
        .zip(ends)
        .map(|(name, x)| {
            c.room(
                &format!("{name} corridor"),
                [x[0], 0.0, 0.0],
                [x[1], 2.5, 2.0],
            )
        })
        .collect();
    for (i, &part) in parts.iter().enumerate() {
        let x = ends[i];
        if i > 0 {
            let wall = [ends[i - 1][1], x[0]];
            c.wide_door(0, wall, 1.0, [1.8, 2.1], [parts[i - 1], part]);
        }
        let north = c.room(
            &format!("north {i}"),
            [x[0], 0.0, -4.15],
            [x[1], 2.5, -0.15],
        );
        let south = c.room(&format!("south {i}"), [x[0], 0.0, 2.15], [x[1], 2.5, 6.15]);
        c.door(2, [-0.15, 0.0], x[0] + 1.5, [north, part]);
        c.door(2, [2.0, 2.15], x[0] + 4.0, [part, south]);
        c.window(2, [-4.45, -4.15], x[0] + 3.0, [OUT, north]);
        c.window(2, [6.15, 6.45], x[0] + 3.0, [south, OUT]);
    }
    c.wide_door(0, [-0.3, 0.0], 1.0, [1.8, 2.1], [OUT, parts[0]]);
    c.finish()
}

/// Offices behind a facade that is nearly all glass: panes of 1.35 × 2.7 m in bays of 1.4 m,
/// between mullions of 5 cm; the panes are detail.
#[must_use]
pub fn glass_facade_office() -> Generated {
    const BAY: f64 = 1.4;
    let mut c = Carver::new("glass-facade-office");
    let palette = Palette::new(&mut c.site);
    let length = 10.0 * BAY;
    c.solid([-0.2, -0.3, -2.05], [length + 0.2, 3.1, 4.6]);
    let corridor = c.room("corridor", [0.0, 0.0, -1.85], [length, 2.8, 0.0]);
    let mut panes = Vec::new();
    // Rooms in bays: three offices of two, a hall of four.
    for (i, bays) in [[0, 2], [2, 4], [4, 6], [6, 10]].into_iter().enumerate() {
        let low = f64::from(bays[0]) * BAY + if i == 0 { 0.0 } else { 0.05 };
        let high = f64::from(bays[1]) * BAY - if i == 3 { 0.0 } else { 0.05 };
        let room = c.room(&format!("office {i}"), [low, 0.0, 0.1], [high, 2.8, 4.5]);
        c.door(2, [0.0, 0.1], low + 0.8, [corridor, room]);
        for bay in bays[0]..bays[1] {
            let x = f64::from(bay) * BAY;
            // Beside a partition the mullion is as wide as the partition.
            let (min, max) = ((x + 0.025).max(low), (x + BAY - 0.025).min(high));
            c.hole(Window, 2, [min, 0.05, 4.5], [max, 2.75, 4.6], [room, OUT]);
            panes.push(aabb([min, 0.05, 4.5], [max, 2.75, 4.6]));
        }
    }
    c.door(0, [-0.2, 0.0], -0.9, [OUT, corridor]);
    for pane in &panes {
        glaze(&mut c.site, &palette, pane, 2);
    }
    c.finish()
}

/// Two rooms below an attic with a pitched roof, reached through a hatch of 0.8 × 1.2 m.
#[must_use]
pub fn pitched_roof_attic() -> Generated {
    let roof = GableRoof {
        length: 9.6,
        depth: 7.6,
        wall: 0.3,
        floor: 2.85,
        eaves: 3.15,
        slope: 0.9,
        window: Some([3.9, 4.9]),
    };
    let mut c = Carver::new("pitched-roof-attic");
    let tiles = c.site.material("roof tiles", [0.42, 0.13, 0.08]);
    c.solid([0.0, -0.3, 0.0], [roof.length, roof.floor, roof.depth]);
    let west = c.room("west", [0.3, 0.0, 0.3], [5.0, 2.6, 7.3]);
    let east = c.room("east", [5.15, 0.0, 0.3], [9.3, 2.6, 7.3]);
    c.door(0, [5.0, 5.15], 2.0, [west, east]);
    c.door(2, [7.3, 7.6], 2.0, [west, OUT]);
    c.window(2, [7.3, 7.6], 7.0, [east, OUT]);
    c.storey = c.site.storey("attic", roof.floor);
    let loft = c
        .site
        .add_room(Room::new("attic", c.storey, vec![roof.loft()], &[]));
    c.hole(
        Opening,
        1,
        [2.0, 2.6, 3.0],
        [2.8, roof.floor, 4.2],
        [west, loft],
    );
    for (hole, sides) in roof
        .gable_windows()
        .into_iter()
        .zip([[OUT, loft], [loft, OUT]])
    {
        c.site.opening(Window, hole, 0, sides);
    }
    roof.add_to(&mut c.site, tiles, c.material);
    c.finish()
}

/// Every scene of this module, cracks of 5 mm, by the name in its truth.
#[must_use]
pub fn all() -> Vec<Generated> {
    vec![
        two_rooms(),
        two_rooms_crack(0.005),
        zero_thickness_rooms(),
        open_courtyard(),
        room_within_room(),
        l_corridor(),
        stair_hall(),
        rooms_with_closet(),
        double_door_corridor(),
        glass_facade_office(),
        pitched_roof_attic(),
    ]
}
