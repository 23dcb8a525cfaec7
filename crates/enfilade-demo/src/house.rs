//! The demo: a furnished house of two storeys and an attic.

use enfilade_geom::{Aabb, DVec3};

use crate::furniture::{Comforts, Furniture, Palette, glaze, hang_door};
use crate::picture;
use crate::roof::GableRoof;
use crate::site::{Generated, Site};
use crate::solid::{MeshBuilder, Steps, aabb};
use crate::truth::{Convex, OpeningKind, Room, Side};

/// Thickness of outer and inner walls. [Units: wu]
const OUTER: f64 = 0.36;
/// Outer size of the house in plan, along x and z. [Units: wu]
const LENGTH: f64 = 11.0;
const DEPTH: f64 = 8.6;
/// Floor and ceiling of the two storeys, and the floor of the attic. [Units: wu]
const GROUND: [f64; 2] = [0.0, 2.6];
const UPPER: [f64; 2] = [2.9, 5.4];
const ATTIC: f64 = 5.65;
const ROOF: GableRoof = GableRoof {
    length: LENGTH,
    depth: DEPTH,
    wall: OUTER,
    floor: ATTIC,
    eaves: 6.25,
    slope: 0.84,
    window: Some([6.6, 7.7]),
};

/// Clear widths of the rooms between the walls, along x, and the end of the last ones along z. [Units: wu]
const WEST: [f64; 2] = [OUTER, 4.3];
const MID: [f64; 2] = [4.45, 7.05];
const EAST: [f64; 2] = [7.2, LENGTH - OUTER];
const NORTH_END: f64 = DEPTH - OUTER;
/// Faces of the outer walls along x, and the extents of outer walls along x and z. [Units: wu]
const NORTH: [f64; 2] = [0.0, OUTER];
const SOUTH: [f64; 2] = [DEPTH - OUTER, DEPTH];
const ALL: [f64; 2] = [0.0, LENGTH];
const INNER: [f64; 2] = [OUTER, DEPTH - OUTER];

/// Steps from the hall to the landing.
const STEPS: Steps = Steps {
    n: 16,
    riser: 2.9 / 16.0,
    going: 0.26,
    waist: 0.18,
};

struct House {
    site: Site,
    palette: Palette,
    plaster: u32,
    oak: u32,
}

/// A hole in a wall: along the wall, up, its kind, and the rooms in ascending order across it.
struct HouseHole {
    along: [f64; 2],
    up: [f64; 2],
    kind: OpeningKind,
    rooms: [Side; 2],
    /// Opening angle of a door's leaf towards its second side; 0 is shut. [Units: degrees]
    swing: f64,
}

/// Angle of a leaf that is almost shut. [Units: degrees]
const AJAR: f64 = 8.0;

impl HouseHole {
    fn swung(self, swing: f64) -> Self {
        Self { swing, ..self }
    }
}

fn door(along: [f64; 2], floor: f64, rooms: [Side; 2]) -> HouseHole {
    HouseHole {
        along,
        up: [floor, floor + 2.05],
        kind: OpeningKind::Door,
        rooms,
        swing: 80.0,
    }
}

fn window(along: [f64; 2], up: [f64; 2], rooms: [Side; 2]) -> HouseHole {
    HouseHole {
        along,
        up,
        kind: OpeningKind::Window,
        rooms,
        swing: 0.0,
    }
}

impl House {
    /// Adds a wall across `axis` (0: x, 2: z) between `faces`, over `along` and `up`.
    fn wall(
        &mut self,
        axis: usize,
        faces: [f64; 2],
        along: [f64; 2],
        up: [f64; 2],
        holes: &[HouseHole],
    ) {
        let span = |a: [f64; 2], u: [f64; 2]| {
            if axis == 0 {
                aabb([faces[0], u[0], a[0]], [faces[1], u[1], a[1]])
            } else {
                aabb([a[0], u[0], faces[0]], [a[1], u[1], faces[1]])
            }
        };
        let voids: Vec<Aabb> = holes.iter().map(|h| span(h.along, h.up)).collect();
        let mut wall = MeshBuilder::new(self.plaster);
        wall.carved(&[span(along, up)], &voids);
        self.site.structure("wall", wall);
        for (hole, void) in holes.iter().zip(&voids) {
            self.site.opening(hole.kind, *void, axis, hole.rooms);
            match hole.kind {
                OpeningKind::Door => {
                    hang_door(&mut self.site, &self.palette, void, axis, hole.swing);
                }
                OpeningKind::Window => glaze(&mut self.site, &self.palette, void, axis),
                OpeningKind::Opening | OpeningKind::Virtual => {}
            }
        }
    }

    /// Adds a slab over the whole footprint, wooden on top.
    fn slab(&mut self, low: f64, high: f64, holes: &[Aabb]) {
        let mut slab = MeshBuilder::new(self.plaster);
        slab.paint_top(self.oak);
        slab.carved(&[aabb([0.0, low, 0.0], [LENGTH, high, DEPTH])], holes);
        self.site.structure("floor slab", slab);
    }
}

/// A furnished house of two storeys and an attic, on a lawn.
///
/// Entrance hall with stairs to a landing, living room, kitchen, dining room, toilet; three bedrooms, study and bath; an attic
/// under a pitched roof, reached through a hatch. 12 rooms, 9 doors (the front door and two more shut, two ajar), a passage, 17
/// windows; colored and textured materials; furniture, door leaves and glass as detail.
#[must_use]
pub fn furnished_house() -> Generated {
    let mut site = Site::new("furnished-house");
    let palette = Palette::new(&mut site);
    let plaster = site.material("plaster", [0.82, 0.79, 0.72]);
    let oak = site.textured_material("oak floor", picture::oak_planks());
    let mut house = House {
        site,
        palette,
        plaster,
        oak,
    };
    let rooms = house.add_rooms();
    house.add_floors(&rooms);
    house.add_ground_walls(&rooms);
    house.add_upper_walls(&rooms);
    house.add_roof(rooms.loft);
    house.furnish();
    house.site.finish()
}

/// The rooms, as sides of openings.
struct Rooms {
    living: Side,
    hall: Side,
    toilet: Side,
    kitchen: Side,
    dining: Side,
    landing: Side,
    bedroom_1: Side,
    bedroom_2: Side,
    bedroom_3: Side,
    study: Side,
    bath: Side,
    loft: Side,
}

const OUT: Side = Side::Outside;

impl House {
    fn add_rooms(&mut self) -> Rooms {
        let s = &mut self.site;
        let ground = s.storey("ground floor", GROUND[0]);
        let upper = s.storey("upper floor", UPPER[0]);
        let attic = s.storey("attic", ATTIC);
        let air = |storey: usize, [x, z]: [[f64; 2]; 2]| {
            let up = if storey == ground { GROUND } else { UPPER };
            aabb([x[0], up[0], z[0]], [x[1], up[1], z[1]])
        };
        let room = |s: &mut Site, name: &str, storey: usize, plan: [[f64; 2]; 2]| {
            s.room(name, storey, air(storey, plan))
        };
        // The stairs fill the hall below and, above the slab's underside, the hole.
        let flight_box = aabb([6.05, 0.0, 3.4], [7.05, 2.9, 3.4 + STEPS.run()]);
        let flight = (flight_box, STEPS.volume_below(1.0, GROUND[1]));
        let stair_hall = |s: &mut Site, name: &str, storey: usize, solids: &[(Aabb, f64)]| {
            let part = Convex::of_aabb(&air(storey, [MID, [2.45, NORTH_END]]));
            s.add_room(Room::new(name, storey, vec![part], solids))
        };
        // Rooms are numbered in this order.
        Rooms {
            living: room(s, "living room", ground, [WEST, [OUTER, NORTH_END]]),
            hall: stair_hall(s, "entrance hall", ground, &[flight]),
            toilet: room(s, "toilet", ground, [MID, [OUTER, 2.3]]),
            kitchen: room(s, "kitchen", ground, [EAST, [4.4, NORTH_END]]),
            dining: room(s, "dining room", ground, [EAST, [OUTER, 4.25]]),
            landing: stair_hall(s, "landing", upper, &[]),
            bedroom_1: room(s, "bedroom 1", upper, [WEST, [4.4, NORTH_END]]),
            bedroom_2: room(s, "bedroom 2", upper, [WEST, [OUTER, 4.25]]),
            bedroom_3: room(s, "bedroom 3", upper, [EAST, [OUTER, 4.25]]),
            study: room(s, "study", upper, [EAST, [4.4, NORTH_END]]),
            bath: room(s, "bath", upper, [MID, [OUTER, 2.3]]),
            loft: s.add_room(Room::new("attic", attic, vec![ROOF.loft()], &[])),
        }
    }

    /// Adds the slabs, the stairs and the hatch through them.
    fn add_floors(&mut self, rooms: &Rooms) {
        let stair_hole = aabb([6.05, GROUND[1], 3.4], [7.05, UPPER[0], 6.5]);
        let hatch = aabb([4.6, UPPER[1], 6.3], [5.3, ATTIC, 7.5]);
        let mut stairs = MeshBuilder::new(self.oak);
        let foot = DVec3::new(6.55, 0.0, 3.4 + STEPS.run());
        stairs.flight(foot, -DVec3::Z, 1.0, &STEPS);
        self.site.structure("stairs", stairs);
        self.slab(-0.3, 0.0, &[]);
        self.slab(GROUND[1], UPPER[0], &[stair_hole]);
        self.slab(UPPER[1], ATTIC, &[hatch]);
        for (hole, sides) in [
            (stair_hole, [rooms.hall, rooms.landing]),
            (hatch, [rooms.landing, rooms.loft]),
        ] {
            self.site.opening(OpeningKind::Opening, hole, 1, sides);
        }
    }

    fn add_ground_walls(&mut self, rooms: &Rooms) {
        let sill = [0.9, 2.2];
        self.wall(
            2,
            NORTH,
            ALL,
            GROUND,
            &[
                window([1.4, 3.2], sill, [OUT, rooms.living]),
                window([5.5, 6.1], [1.4, 2.1], [OUT, rooms.toilet]),
                window([8.2, 9.8], sill, [OUT, rooms.dining]),
            ],
        );
        self.wall(
            2,
            SOUTH,
            ALL,
            GROUND,
            &[
                window([1.0, 3.6], [0.3, 2.2], [rooms.living, OUT]),
                door([4.75, 5.75], 0.0, [rooms.hall, OUT]).swung(0.0),
                window([8.2, 9.8], sill, [rooms.kitchen, OUT]),
            ],
        );
        self.wall(
            0,
            [0.0, OUTER],
            INNER,
            GROUND,
            &[
                window([1.5, 3.0], sill, [OUT, rooms.living]),
                window([5.2, 6.7], sill, [OUT, rooms.living]),
            ],
        );
        self.wall(
            0,
            [LENGTH - OUTER, LENGTH],
            INNER,
            GROUND,
            &[
                window([1.6, 3.0], sill, [rooms.dining, OUT]),
                window([5.6, 7.0], sill, [rooms.kitchen, OUT]),
            ],
        );
        self.wall(
            0,
            [4.3, 4.45],
            INNER,
            GROUND,
            &[door([3.2, 4.8], 0.0, [rooms.living, rooms.hall])],
        );
        let passage = HouseHole {
            along: [8.2, 9.6],
            up: [0.0, 2.1],
            kind: OpeningKind::Opening,
            rooms: [rooms.dining, rooms.kitchen],
            swing: 0.0,
        };
        self.wall(
            0,
            [7.05, 7.2],
            INNER,
            GROUND,
            &[door([7.38, 8.18], 0.0, [rooms.hall, rooms.kitchen])],
        );
        self.wall(
            2,
            [2.3, 2.45],
            MID,
            GROUND,
            &[door([4.75, 5.55], 0.0, [rooms.toilet, rooms.hall]).swung(0.0)],
        );
        self.wall(2, [4.25, 4.4], EAST, GROUND, &[passage]);
    }

    fn add_upper_walls(&mut self, rooms: &Rooms) {
        let f = UPPER[0];
        let sill = [f + 0.9, f + 2.1];
        self.wall(
            2,
            NORTH,
            ALL,
            UPPER,
            &[
                window([1.6, 3.0], sill, [OUT, rooms.bedroom_2]),
                window([5.3, 6.2], [f + 1.2, f + 2.1], [OUT, rooms.bath]),
                window([8.2, 9.6], sill, [OUT, rooms.bedroom_3]),
            ],
        );
        self.wall(
            2,
            SOUTH,
            ALL,
            UPPER,
            &[
                window([1.6, 3.0], sill, [rooms.bedroom_1, OUT]),
                window([4.9, 6.1], sill, [rooms.landing, OUT]),
                window([8.2, 9.6], sill, [rooms.study, OUT]),
            ],
        );
        self.wall(0, [0.0, OUTER], INNER, UPPER, &[]);
        self.wall(0, [LENGTH - OUTER, LENGTH], INNER, UPPER, &[]);
        self.wall(
            0,
            [4.3, 4.45],
            INNER,
            UPPER,
            &[
                door([2.8, 3.65], f, [rooms.bedroom_2, rooms.landing]),
                door([6.3, 7.15], f, [rooms.bedroom_1, rooms.landing]).swung(0.0),
            ],
        );
        self.wall(
            0,
            [7.05, 7.2],
            INNER,
            UPPER,
            &[
                door([2.55, 3.35], f, [rooms.landing, rooms.bedroom_3]).swung(AJAR),
                door([6.7, 7.5], f, [rooms.landing, rooms.study]),
            ],
        );
        self.wall(2, [4.25, 4.4], WEST, UPPER, &[]);
        self.wall(2, [4.25, 4.4], EAST, UPPER, &[]);
        self.wall(
            2,
            [2.3, 2.45],
            MID,
            UPPER,
            &[door([4.8, 5.6], f, [rooms.bath, rooms.landing]).swung(-AJAR)],
        );
    }

    fn add_roof(&mut self, loft: Side) {
        let tiles = self.site.material("roof tiles", [0.42, 0.13, 0.08]);
        let brick = self.site.material("brick", [0.45, 0.20, 0.14]);
        let turf = self.site.material("turf", [0.13, 0.30, 0.09]);
        ROOF.add_to(&mut self.site, tiles, self.plaster);
        for (i, sides) in [[Side::Outside, loft], [loft, Side::Outside]]
            .into_iter()
            .enumerate()
        {
            let hole = ROOF.gable_windows()[i];
            self.site.opening(OpeningKind::Window, hole, 0, sides);
            glaze(&mut self.site, &self.palette, &hole, 0);
        }
        let mut chimney = MeshBuilder::new(brick);
        chimney.cuboid(aabb([8.0, 9.2, 3.2], [8.6, 10.9, 3.8]));
        self.site.structure("chimney", chimney);
        let mut lawn = MeshBuilder::new(turf);
        lawn.cuboid(aabb(
            [-12.0, -0.5, -12.0],
            [LENGTH + 12.0, -0.15, DEPTH + 12.0],
        ));
        self.site.structure("ground", lawn);
    }

    fn furnish(&mut self) {
        let site = &mut self.site;
        let f = Furniture::new(site, &self.palette);
        let c = Comforts::new(site, &self.palette);
        let up = UPPER[0];
        let mut put = |name: &str, mesh: u32, x: f64, y: f64, z: f64, yaw: f64| {
            site.furnish(name, mesh, DVec3::new(x, y, z), yaw);
        };
        // Living room: seats around a carpet, books opposite the windows.
        put("carpet", c.carpet, 2.35, 0.0, 6.55, 90.0);
        put("sofa", f.sofa, 3.78, 0.0, 6.55, -90.0);
        put("low table", c.low_table, 2.45, 0.01, 6.55, 90.0);
        put("armchair", c.armchair, 1.2, 0.0, 5.75, 70.0);
        put("armchair", c.armchair, 1.2, 0.0, 7.35, 110.0);
        put("painting", c.painting, 4.3, 0.0, 6.55, -90.0);
        for z in [1.3, 2.22] {
            put("shelf", f.shelf, 4.1, 0.0, z, -90.0);
            put("books", c.books, 4.1, 0.0, z, -90.0);
        }
        put("sideboard", c.sideboard, 0.6, 0.0, 2.25, 90.0);
        put("pendant lamp", c.pendant, 2.35, GROUND[1], 6.55, 0.0);
        put("plant", f.plant, 0.75, 0.0, 0.75, 0.0);
        put("plant", f.plant, 0.75, 0.0, 4.2, 0.0);
        put("lamp", f.lamp, 3.95, 0.0, 5.25, 0.0);
        put("plant", f.plant, 4.85, 0.0, 2.9, 0.0);
        put("cabinet", f.cabinet, 4.75, 0.0, 6.0, 90.0);
        put("toilet", f.toilet, 6.6, 0.0, 0.72, 0.0);
        put("kitchen cabinet", f.counter, 10.34, 0.0, 6.0, -90.0);
        put("kitchen cabinet", c.worktop, 9.7, 0.0, 7.94, 180.0);
        put("table", f.table, 8.9, 0.0, 2.2, 90.0);
        for (x, z, yaw) in [
            (8.2, 1.7, 90.0),
            (8.2, 2.7, 90.0),
            (9.6, 1.7, -90.0),
            (9.6, 2.7, -90.0),
        ] {
            put("chair", f.chair, x, 0.0, z, yaw);
        }
        put("plant", f.plant, 10.2, 0.0, 0.8, 0.0);
        put("pendant lamp", c.pendant, 8.9, GROUND[1], 2.2, 0.0);
        put("bed", f.bed, 1.45, up, 6.3, 90.0);
        put("wardrobe", f.wardrobe, 2.6, up, 4.75, 0.0);
        put("lamp", f.lamp, 0.7, up, 7.8, 0.0);
        put("bed", f.bed, 1.45, up, 1.6, 90.0);
        put("wardrobe", f.wardrobe, 2.0, up, 3.9, 180.0);
        put("bed", f.bed, 9.6, up, 1.6, -90.0);
        put("wardrobe", f.wardrobe, 9.0, up, 3.9, 180.0);
        put("desk", f.desk, 10.1, up, 6.3, -90.0);
        put("chair", f.chair, 9.4, up, 6.3, 90.0);
        put("shelf", f.shelf, 8.2, up, 4.6, 0.0);
        put("books", c.books, 8.2, up, 4.6, 0.0);
        put("plant", f.plant, 10.2, up, 7.8, 0.0);
        put("bathtub", f.tub, 6.6, up, 1.3, 90.0);
        put("toilet", f.toilet, 4.9, up, 0.72, 0.0);
        put("lamp", f.lamp, 4.8, up, 5.2, 0.0);
        put("cabinet", f.cabinet, 2.5, ATTIC, 3.0, 10.0);
        put("cabinet", f.cabinet, 3.2, ATTIC, 3.2, 40.0);
        put("shelf", f.shelf, 8.5, ATTIC, 2.4, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::scene::Role;

    #[test]
    fn the_house_is_as_large_as_promised() {
        let house = furnished_house();
        assert_eq!(house.truth.rooms.len(), 12);
        let count = |k| house.truth.openings.iter().filter(|o| o.kind == k).count();
        assert_eq!(count(OpeningKind::Window), 17);
        assert_eq!(count(OpeningKind::Door), 9);
        assert_eq!(count(OpeningKind::Opening), 3);
        let n = house.n_triangles(Role::Structural) + house.n_triangles(Role::Detail);
        assert!((6_000..10_000).contains(&n), "{n} triangles");
        assert_eq!(house.scene.images.len(), 1);
    }
}
