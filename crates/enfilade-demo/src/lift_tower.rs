//! The living demo: a tower of three storeys around a lift shaft, and the cabin of the lift.

use enfilade_geom::{Aabb, DVec3};

use crate::furniture::{Furniture, Palette, glaze, hang_door};
use crate::picture;
use crate::site::{Generated, Site};
use crate::solid::{MeshBuilder, Steps, aabb};
use crate::truth::{Convex, OpeningKind, Room, Side};

/// Number of storeys.
const STOREYS: usize = 3;
/// Height from floor to floor, and thickness of slabs. [Units: wu]
const HEIGHT: f64 = 3.2;
const SLAB: f64 = 0.3;
/// Outer size in plan, and thickness of outer walls. [Units: wu]
const LENGTH: f64 = 14.6;
const DEPTH: f64 = 9.6;
const OUTER: f64 = 0.3;
/// Clear widths along x: rooms in the west, the hall, rooms in the east. [Units: wu]
const WEST: [f64; 2] = [OUTER, 4.9];
const HALL: [f64; 2] = [5.05, 9.55];
const EAST: [f64; 2] = [9.7, LENGTH - OUTER];
/// Clear depths along z: the rooms in the north and in the south. [Units: wu]
const NORTH: [f64; 2] = [OUTER, 4.7];
const SOUTH: [f64; 2] = [4.85, DEPTH - OUTER];
/// The shaft in plan, and the wall in front of it. [Units: wu]
const SHAFT_X: [f64; 2] = [5.05, 6.95];
const SHAFT_Z: [f64; 2] = [OUTER, 2.2];
const FRONT: [f64; 2] = [2.2, 2.4];
/// Width and height of the doors of the shaft and the cabin. [Units: wu]
const GATE: [f64; 2] = [1.0, 2.1];
/// Angle of the shaft's doors, which shows where they open to. [Units: degrees]
const AJAR: f64 = 4.0;
/// Thickness of the cabin's walls, and the gap between its front and the shaft's. [Units: wu]
const SHEET: f64 = 0.05;
const GAP: f64 = 0.02;
/// Height of the cabin's room. [Units: wu]
const CABIN: f64 = 2.25;

const STEPS: Steps = Steps {
    n: 18,
    riser: HEIGHT / 18.0,
    going: 0.26,
    waist: 0.18,
};
/// Where the stairs stand along x, with room on both sides, and their upper end along z. [Units: wu]
const STAIRS_X: [f64; 2] = [7.15, 8.2];
const STAIRS_Z: f64 = 3.2;

/// A tower with a lift, as two scenes.
pub struct LiftTower {
    /// The tower: in each storey a hall with stairs and the door of the shaft, and four furnished rooms.
    pub tower: Generated,
    /// The cabin, in the tower's coordinates, at the lowest storey.
    pub cabin: Generated,
    /// Motions of the cabin to each storey. [Units: wu]
    pub stops: Vec<DVec3>,
    /// A point on the floor in the middle of each room, storey by storey, the hall first. [Units: wu]
    pub places: Vec<DVec3>,
    /// A lamp under the ceiling of each room, in the same order, and one in the cabin. [Units: wu]
    pub lamps: Vec<DVec3>,
    /// The lamp in the cabin, in its coordinates. [Units: wu]
    pub cabin_lamp: DVec3,
    /// A radio on the table of a room behind a door. [Units: wu]
    pub radio: DVec3,
}

/// Makes the tower with a lift of the living demo: three storeys, each with a hall and four furnished rooms behind doors that are
/// shut; stairs, windows, a lawn around it.
#[must_use]
pub fn lift_tower() -> LiftTower {
    let mut build = Build::new();
    let (mut places, mut lamps) = (Vec::new(), Vec::new());
    for storey in 0..STOREYS {
        build.storey(storey);
        let floor = storey as f64 * HEIGHT;
        let at = |x: f64, z: f64| DVec3::new(x, floor, z);
        let [studio, office, lounge, bedroom] = rooms().map(|[x, z]| at(middle(x), middle(z)));
        let hall = at(6.1, 4.6);
        // Beside the furniture in the middle of each room.
        places.extend([
            hall + DVec3::Z,
            studio + DVec3::Z,
            office + DVec3::Z,
            lounge - DVec3::X * 1.5,
            bedroom - DVec3::X * 1.5,
        ]);
        let ceiling = DVec3::Y * (HEIGHT - SLAB - 0.35);
        lamps.extend([hall, studio, office, lounge, bedroom].map(|p| p + ceiling));
    }
    build.finish_walls();
    let cabin = cabin();
    LiftTower {
        tower: build.site.finish(),
        cabin,
        stops: (0..STOREYS)
            .map(|k| DVec3::Y * (k as f64 * HEIGHT))
            .collect(),
        places,
        lamps,
        cabin_lamp: DVec3::new(middle(SHAFT_X), CABIN - 0.25, middle(SHAFT_Z)),
        // On the table in the south-eastern room of the first floor.
        radio: DVec3::new(middle(EAST), HEIGHT + 0.95, middle(SOUTH)),
    }
}

fn middle([a, b]: [f64; 2]) -> f64 {
    f64::midpoint(a, b)
}

/// Clear extents of the four rooms of a storey along x and z.
fn rooms() -> [[[f64; 2]; 2]; 4] {
    [[WEST, NORTH], [WEST, SOUTH], [EAST, NORTH], [EAST, SOUTH]]
}

struct Build {
    site: Site,
    palette: Palette,
    plaster: u32,
    oak: u32,
    furniture: Furniture,
    /// The storeys' halls, for the holes in the slabs.
    halls: Vec<Side>,
    shaft: Side,
}

impl Build {
    fn new() -> Self {
        let mut site = Site::new("lift-tower");
        let palette = Palette::new(&mut site);
        let plaster = site.material("plaster", [0.80, 0.78, 0.74]);
        let oak = site.textured_material("oak floor", picture::oak_planks());
        let furniture = Furniture::new(&mut site, &palette);
        let lowest = site.storey("ground floor", 0.0);
        let top = STOREYS as f64 * HEIGHT - SLAB;
        let [x, z] = [SHAFT_X, SHAFT_Z];
        let shaft = site.room(
            "lift shaft",
            lowest,
            aabb([x[0], 0.0, z[0]], [x[1], top, z[1]]),
        );
        Self {
            site,
            palette,
            plaster,
            oak,
            furniture,
            halls: Vec::new(),
            shaft,
        }
    }

    /// Adds the walls, doors and furniture of a storey.
    fn storey(&mut self, storey: usize) {
        let up = [storey as f64 * HEIGHT, (storey + 1) as f64 * HEIGHT - SLAB];
        if storey > 0 {
            self.site.storey(&format!("floor {storey}"), up[0]);
        }
        let air = |[x, z]: [[f64; 2]; 2]| aabb([x[0], up[0], z[0]], [x[1], up[1], z[1]]);
        let flight = (
            air([STAIRS_X, [STAIRS_Z, STAIRS_Z + STEPS.run()]]),
            STEPS.volume_below(STAIRS_X[1] - STAIRS_X[0], up[1]),
        );
        let solids = if storey + 1 < STOREYS {
            &[flight][..]
        } else {
            &[]
        };
        let south = Convex::of_aabb(&air([HALL, [FRONT[1], DEPTH - OUTER]]));
        let beside = Convex::of_aabb(&air([[SHAFT_X[1] + 0.15, HALL[1]], [OUTER, FRONT[1]]]));
        let name = format!("hall {storey}");
        let hall = self
            .site
            .add_room(Room::new(&name, storey, vec![south, beside], solids));
        self.halls.push(hall);
        let names = ["studio", "office", "lounge", "bedroom"];
        let sides: Vec<Side> = rooms()
            .iter()
            .zip(names)
            .map(|(plan, name)| {
                self.site
                    .room(&format!("{name} {storey}"), storey, air(*plan))
            })
            .collect();
        self.outer_walls(storey, up, hall, &sides);
        for (i, x) in [[WEST[1], HALL[0]], [HALL[1], EAST[0]]]
            .into_iter()
            .enumerate()
        {
            let doors: Vec<TowerHole> = [[3.0, 3.9], [5.2, 6.1]]
                .into_iter()
                .enumerate()
                .map(|(k, along)| {
                    let room = sides[2 * i + k];
                    let rooms = if i == 0 { [room, hall] } else { [hall, room] };
                    TowerHole::door(along, up[0], rooms)
                })
                .collect();
            self.wall(0, x, [OUTER, DEPTH - OUTER], up, &doors);
        }
        for x in [WEST, EAST] {
            self.wall(2, [NORTH[1], SOUTH[0]], x, up, &[]);
        }
        self.furnish(storey, up[0]);
        if storey + 1 < STOREYS {
            let mut stairs = MeshBuilder::new(self.oak);
            let foot = DVec3::new(middle(STAIRS_X), up[0], STAIRS_Z + STEPS.run());
            stairs.flight(foot, -DVec3::Z, STAIRS_X[1] - STAIRS_X[0], &STEPS);
            self.site.structure("stairs", stairs);
        }
    }

    fn outer_walls(&mut self, storey: usize, up: [f64; 2], hall: Side, rooms: &[Side]) {
        let sill = [up[0] + 0.8, up[0] + 2.3];
        let out = Side::Outside;
        let window = |along, rooms| TowerHole {
            along,
            up: sill,
            kind: OpeningKind::Window,
            rooms,
            swing: 0.0,
        };
        let [studio, office, lounge, bedroom] = [0, 1, 2, 3].map(|k| rooms[k]);
        self.wall(
            2,
            [0.0, OUTER],
            [0.0, LENGTH],
            up,
            &[
                window([1.6, 3.6], [out, studio]),
                window([7.6, 9.0], [out, hall]),
                window([11.0, 13.0], [out, lounge]),
            ],
        );
        let mut front = vec![
            window([1.6, 3.6], [office, out]),
            window([11.0, 13.0], [bedroom, out]),
        ];
        front.push(if storey == 0 {
            TowerHole::door([6.6, 7.8], up[0], [hall, out])
        } else {
            window([6.0, 8.2], [hall, out])
        });
        self.wall(2, [DEPTH - OUTER, DEPTH], [0.0, LENGTH], up, &front);
        let inner = [OUTER, DEPTH - OUTER];
        let west = [
            window([1.6, 3.4], [out, studio]),
            window([6.2, 8.0], [out, office]),
        ];
        self.wall(0, [0.0, OUTER], inner, up, &west);
        let east = [
            window([1.6, 3.4], [lounge, out]),
            window([6.2, 8.0], [bedroom, out]),
        ];
        self.wall(0, [LENGTH - OUTER, LENGTH], inner, up, &east);
    }

    /// Adds the slabs, the shaft and the surroundings.
    fn finish_walls(&mut self) {
        let top = STOREYS as f64 * HEIGHT;
        let well = |low: f64, high: f64| {
            aabb(
                [SHAFT_X[0], low, SHAFT_Z[0]],
                [SHAFT_X[1], high, SHAFT_Z[1]],
            )
        };
        for k in 0..=STOREYS {
            let (low, high) = (k as f64 * HEIGHT - SLAB, k as f64 * HEIGHT);
            let mut holes = Vec::new();
            if (1..STOREYS).contains(&k) {
                holes.push(well(low, high));
                let end = STAIRS_Z + 0.85 * STEPS.run();
                let hole = aabb([STAIRS_X[0], low, STAIRS_Z], [STAIRS_X[1], high, end]);
                holes.push(hole);
                let halls = [self.halls[k - 1], self.halls[k]];
                self.site.opening(OpeningKind::Opening, hole, 1, halls);
            }
            let mut slab = MeshBuilder::new(self.plaster);
            slab.paint_top(self.oak);
            slab.carved(&[aabb([0.0, low, 0.0], [LENGTH, high, DEPTH])], &holes);
            self.site.structure("floor slab", slab);
        }
        let top_of_shaft = [0.0, top - SLAB];
        let gates: Vec<TowerHole> = (0..STOREYS)
            .map(|k| {
                let floor = k as f64 * HEIGHT;
                let x = middle(SHAFT_X);
                TowerHole {
                    along: [x - 0.5 * GATE[0], x + 0.5 * GATE[0]],
                    up: [floor, floor + GATE[1]],
                    kind: OpeningKind::Door,
                    rooms: [self.shaft, self.halls[k]],
                    // Towards the hall, or it would hit the cabin.
                    swing: AJAR,
                }
            })
            .collect();
        let front = [SHAFT_X[0], SHAFT_X[1] + 0.15];
        self.wall(2, FRONT, front, top_of_shaft, &gates);
        self.wall(
            0,
            [SHAFT_X[1], SHAFT_X[1] + 0.15],
            SHAFT_Z,
            top_of_shaft,
            &[],
        );
        let turf = self.site.material("turf", [0.13, 0.30, 0.09]);
        let mut lawn = MeshBuilder::new(turf);
        lawn.cuboid(aabb(
            [-14.0, -0.6, -14.0],
            [LENGTH + 14.0, -0.02, DEPTH + 14.0],
        ));
        self.site.structure("ground", lawn);
    }

    /// Adds a wall across `axis` (0: x, 2: z) between `faces`, over `along` and `up`, with leaves and panes in its holes.
    fn wall(
        &mut self,
        axis: usize,
        faces: [f64; 2],
        along: [f64; 2],
        up: [f64; 2],
        holes: &[TowerHole],
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
            if hole.kind == OpeningKind::Window {
                glaze(&mut self.site, &self.palette, void, axis);
            } else {
                hang_door(&mut self.site, &self.palette, void, axis, hole.swing);
            }
        }
    }

    fn furnish(&mut self, storey: usize, floor: f64) {
        let f = &self.furniture;
        let [studio, office, lounge, bedroom] = rooms().map(|[x, z]| [middle(x), middle(z)]);
        let mut put = |name: &str, mesh: u32, [x, z]: [f64; 2], yaw: f64| {
            self.site.furnish(name, mesh, DVec3::new(x, floor, z), yaw);
        };
        put("desk", f.desk, [studio[0] - 1.6, studio[1]], 90.0);
        put("chair", f.chair, [studio[0] - 0.8, studio[1]], -90.0);
        put("shelf", f.shelf, [studio[0] + 1.0, NORTH[0] + 0.25], 0.0);
        put("desk", f.desk, [office[0] - 1.6, office[1]], 90.0);
        put("chair", f.chair, [office[0] - 0.8, office[1]], -90.0);
        put("plant", f.plant, [WEST[1] - 0.5, SOUTH[1] - 0.5], 0.0);
        put("sofa", f.sofa, [lounge[0], NORTH[0] + 0.6], 0.0);
        put("table", f.table, lounge, 0.0);
        put("plant", f.plant, [EAST[1] - 0.5, NORTH[1] - 0.5], 0.0);
        put("table", f.table, bedroom, 0.0);
        put("bed", f.bed, [EAST[1] - 1.2, SOUTH[1] - 1.1], -90.0);
        put(
            "wardrobe",
            f.wardrobe,
            [EAST[0] + 1.2, SOUTH[1] - 0.4],
            180.0,
        );
        if storey == 0 {
            put("plant", f.plant, [HALL[0] + 0.4, DEPTH - OUTER - 0.4], 0.0);
        }
    }
}

/// A hole in a wall: along the wall, up, its kind, and the rooms in ascending order across it.
struct TowerHole {
    along: [f64; 2],
    up: [f64; 2],
    kind: OpeningKind,
    rooms: [Side; 2],
    /// Opening angle of a leaf towards its second side; 0 is shut. [Units: degrees]
    swing: f64,
}

impl TowerHole {
    fn door(along: [f64; 2], floor: f64, rooms: [Side; 2]) -> Self {
        Self {
            along,
            up: [floor, floor + 2.1],
            kind: OpeningKind::Door,
            rooms,
            swing: 0.0,
        }
    }
}

/// Returns the cabin at the lowest storey: a box of sheet metal, its door towards the hall, a rail on its back.
fn cabin() -> Generated {
    let mut site = Site::new("lift-cabin");
    let steel = site.material("brushed steel", [0.55, 0.57, 0.60]);
    let floor = site.material("rubber", [0.12, 0.12, 0.14]);
    let lowest = site.storey("cabin", 0.0);
    // Away from the walls of the shaft, the front by a small gap.
    let [x, z] = [
        [SHAFT_X[0] + 0.05, SHAFT_X[1] - 0.05],
        [SHAFT_Z[0] + 0.05, SHAFT_Z[1] - GAP],
    ];
    let inside = aabb(
        [x[0] + SHEET, 0.0, z[0] + SHEET],
        [x[1] - SHEET, CABIN, z[1] - SHEET],
    );
    let around = aabb([x[0], -SHEET, z[0]], [x[1], CABIN + SHEET, z[1]]);
    let gate = [middle(x) - 0.5 * GATE[0], middle(x) + 0.5 * GATE[0]];
    let hole = aabb([gate[0], 0.0, z[1] - SHEET], [gate[1], GATE[1], z[1]]);
    let mut shell = MeshBuilder::new(steel);
    shell.carved(&[around], &[inside, hole]);
    site.structure("cabin", shell);
    let room = site.room("cabin", lowest, inside);
    let rooms = [room, Side::Outside];
    site.opening(OpeningKind::Opening, hole, 2, rooms);
    let mut mat = MeshBuilder::new(floor);
    mat.cuboid(aabb(
        [inside.min.x + 0.05, 0.0, inside.min.z + 0.05],
        [inside.max.x - 0.05, 0.005, inside.max.z - 0.05],
    ));
    site.detail("mat", mat);
    let mut rail = MeshBuilder::new(floor);
    rail.cuboid(aabb(
        [inside.min.x + 0.1, 0.92, inside.min.z + 0.03],
        [inside.max.x - 0.1, 0.96, inside.min.z + 0.07],
    ));
    site.detail("rail", rail);
    site.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tower_and_its_cabin_are_as_planned() {
        let it = lift_tower();
        assert_eq!(it.tower.truth.rooms.len(), 1 + 5 * STOREYS);
        assert_eq!(it.cabin.truth.rooms.len(), 1);
        let doors = |g: &Generated| {
            let all = g.truth.openings.iter();
            all.filter(|o| o.kind == OpeningKind::Door).count()
        };
        // Four rooms and the shaft in each storey, and the entrance.
        assert_eq!(doors(&it.tower), 5 * STOREYS + 1);
        for (p, room) in it.places.iter().zip(0..) {
            assert!(
                it.tower.truth.room_at(*p + DVec3::Y).is_some(),
                "{room} {p}"
            );
        }
        assert_eq!(it.tower.truth.faults(), Vec::<String>::new());
        assert_eq!(it.cabin.truth.faults(), Vec::<String>::new());
    }
}
