//! A parametric office tower, from a handful of rooms to thousands.

use enfilade_geom::{Aabb, DVec3};

use crate::furniture::{Furniture, Palette, glaze, hang_door};
use crate::rng::Rng;
use crate::site::{Generated, Site};
use crate::solid::{MeshBuilder, Steps, aabb, snapped};
use crate::truth::{Convex, OpeningKind, Room, Side};

/// What an office tower has. [`TowerParams::default`] is 4 storeys of 16 rooms with all of it.
#[derive(Clone, Debug, PartialEq)]
pub struct TowerParams {
    /// Number of storeys. [Limit: >= 1]
    pub storeys: usize,
    /// Rooms of a storey, corridors and stairwells included. [Limit: >= 4]
    pub rooms_per_storey: usize,
    /// Seed of room widths, door places and furniture.
    pub seed: u64,
    /// Desks, chairs, shelves and plants, as detail.
    pub furniture: bool,
    /// Gaps of 2-20 mm where some walls meet slabs or other walls.
    pub cracks: bool,
    /// Some partitions of two leaves with a cavity of 6 cm, which opens into their doorways.
    pub double_walls: bool,
    /// Windows above parapets in the facades.
    pub windows: bool,
    /// Stairwells through all storeys, one a wing.
    pub stairwell: bool,
    /// Door leaves and window panes, as detail.
    pub leaves: bool,
    /// The ground that the tower stands on.
    pub ground: bool,
}

impl Default for TowerParams {
    fn default() -> Self {
        Self {
            storeys: 4,
            rooms_per_storey: 16,
            seed: 1,
            furniture: true,
            cracks: false,
            double_walls: false,
            windows: true,
            stairwell: true,
            leaves: false,
            ground: true,
        }
    }
}

impl TowerParams {
    /// A tower of about `rooms` rooms whose storeys and wings both grow, at constant density:
    /// exact for 16, 64, 256, 1024 and 4096.
    #[must_use]
    pub fn with_rooms(rooms: usize, seed: u64) -> Self {
        // Two storeys at 16 rooms, twice as many for every factor of 4.
        let storeys = 1 << (rooms.max(4).ilog2() / 2).saturating_sub(1);
        let rooms_per_storey = rooms.div_ceil(storeys).max(4);
        Self {
            storeys,
            rooms_per_storey,
            seed,
            ..Self::default()
        }
    }
}

/// Floor to floor. [Units: wu]
const STOREY: f64 = 3.2;
const SLAB: f64 = 0.25;
const FACADE: f64 = 0.3;
const CORRIDOR_WALL: f64 = 0.15;
const PARTITION: f64 = 0.12;
/// A double wall: two leaves and what is between them. [Units: wu]
const LEAF: f64 = 0.08;
const CAVITY: f64 = 0.06;
const CORRIDOR: f64 = 2.0;
/// Clear depth of the rows of rooms on the two sides of a corridor. [Units: wu]
const ROWS: [f64; 2] = [6.2, 4.9];
const STAIRWELL: f64 = 2.8;
/// Mean clear width of an office, with its share of partition. [Units: wu]
const BAY: f64 = 3.7;
/// Rooms that one corridor serves at most.
const WING: usize = 40;

/// A wall across `axis`: the box it fills, holes through it, and the chance of cracks.
struct Wall {
    axis: usize,
    body: Aabb,
    holes: Vec<(OpeningKind, Aabb, [Side; 2])>,
    double: bool,
}

struct Tower<'a> {
    params: &'a TowerParams,
    site: Site,
    palette: Palette,
    furniture: Furniture,
    rng: Rng,
    /// Walls of the storey under construction.
    walls: MeshBuilder,
    /// Length of the rows, between the cross corridor and the east facade. [Units: wu]
    row_length: f64,
    /// West end of the rows. [Units: wu]
    row_start: f64,
    /// Offices in each row of each wing.
    rows: Vec<[usize; 2]>,
    concrete: u32,
}

/// An office tower that stands in the open.
///
/// Storeys of one or more wings: a corridor of 2 m with rooms of varied width on both sides,
/// joined by a cross corridor where there are several wings. Walls are closed solids (facade
/// 30 cm, corridors 15 cm, partitions 12 cm), floors are slabs of 25 cm with holes for the
/// flights of the stairwells. The first room of each wing's north row is its stairwell.
/// 85 to 150 structural triangles a room, the fewer the more rooms lie inside. O(rooms) time and
/// memory.
#[must_use]
pub fn office_tower(params: &TowerParams) -> Generated {
    let mut site = Site::new("office-tower");
    let palette = Palette::new(&mut site);
    let furniture = Furniture::new(&mut site, &palette);
    let concrete = site.material("concrete", [0.55, 0.55, 0.53]);
    let storeys = params.storeys.max(1);
    let per_storey = params.rooms_per_storey.max(4);
    let has_stairs = params.stairwell && storeys > 1;

    let n_wings = per_storey.div_ceil(WING);
    let common = if n_wings > 1 { n_wings + 1 } else { 1 };
    let stairs = if has_stairs { n_wings } else { 0 };
    let offices = per_storey - (common + stairs).min(per_storey - 1);
    // Dealt out one by one, so that no row is longer than another by more than one office.
    let mut rows = vec![[0, 0]; n_wings];
    for i in 0..offices {
        // Rows with a stairwell are full last.
        rows[i / 2 % n_wings][(i + 1) % 2] += 1;
    }
    let longest = rows.iter().flatten().copied().max().unwrap_or(1).max(1);
    let stair_length = if has_stairs {
        STAIRWELL + PARTITION
    } else {
        0.0
    };
    let cross = if n_wings > 1 {
        CORRIDOR + CORRIDOR_WALL
    } else {
        0.0
    };
    let mut tower = Tower {
        params,
        site,
        palette,
        furniture,
        rng: Rng::new(params.seed),
        walls: MeshBuilder::new(concrete),
        row_length: snapped(longest as f64 * BAY + stair_length),
        row_start: FACADE + cross,
        rows,
        concrete,
    };
    tower.build(storeys, has_stairs);
    tower.site.finish()
}

impl Tower<'_> {
    fn build(&mut self, storeys: usize, has_stairs: bool) {
        let wing_depth = ROWS[0] + ROWS[1] + CORRIDOR + 2.0 * CORRIDOR_WALL;
        let n_wings = self.rows.len();
        let inner_depth = n_wings as f64 * wing_depth + (n_wings - 1) as f64 * CORRIDOR_WALL;
        let size = DVec3::new(
            self.row_start + self.row_length + FACADE,
            0.0,
            inner_depth + 2.0 * FACADE,
        );
        let wing_start = |w: usize| FACADE + w as f64 * (wing_depth + CORRIDOR_WALL);
        let steps = Steps {
            n: 18,
            riser: STOREY / 18.0,
            going: 0.27,
            waist: 0.16,
        };
        // Against the stairwell's west wall, with a landing at both ends.
        let flight_x = [self.row_start, self.row_start + 1.3];
        let flight_end = 0.8;
        let stair_hole = |w: usize, floor: f64| {
            let z = wing_start(w) + flight_end;
            aabb(
                [flight_x[0], floor - SLAB, z],
                [flight_x[1], floor, z + 3.6],
            )
        };

        let mut below: Vec<Side> = Vec::new();
        for s in 0..storeys {
            let floor = s as f64 * STOREY;
            let storey = self.site.storey(&format!("storey {s}"), floor);
            let up = [floor, snapped(floor + STOREY - SLAB)];
            let has_flight = has_stairs && s + 1 < storeys;

            let mut slab = MeshBuilder::new(self.concrete);
            let holes: Vec<Aabb> = if has_stairs && s > 0 {
                (0..n_wings).map(|w| stair_hole(w, floor)).collect()
            } else {
                Vec::new()
            };
            slab.carved(
                &[aabb([0.0, floor - SLAB, 0.0], [size.x, floor, size.z])],
                &holes,
            );
            self.site.structure(&format!("slab {s}"), slab);

            let cross = (n_wings > 1).then(|| {
                let air = aabb(
                    [FACADE, up[0], FACADE],
                    [FACADE + CORRIDOR, up[1], FACADE + inner_depth],
                );
                self.site
                    .room(&format!("storey {s}/cross corridor"), storey, air)
            });
            let mut stairwells = Vec::new();
            let mut back = Vec::new();
            for w in 0..n_wings {
                let start = wing_start(w);
                let flight = has_flight.then(|| {
                    let foot = DVec3::new(
                        f64::midpoint(flight_x[0], flight_x[1]),
                        floor,
                        start + flight_end + steps.run(),
                    );
                    let mut mesh = MeshBuilder::new(self.concrete);
                    mesh.flight(foot, -DVec3::Z, flight_x[1] - flight_x[0], &steps);
                    let top = floor + STOREY - SLAB;
                    let air = aabb(
                        [flight_x[0], floor, start + flight_end],
                        [flight_x[1], top, start + flight_end + steps.run()],
                    );
                    self.site.structure(&format!("stairs {s}"), mesh);
                    (
                        air,
                        steps.volume_below(flight_x[1] - flight_x[0], STOREY - SLAB),
                    )
                });
                let solids: Vec<(Aabb, f64)> = flight.into_iter().collect();
                let wing = Wing {
                    s,
                    storey,
                    w,
                    start,
                    up,
                    has_stairs,
                    cross,
                };
                let done = self.wing(&wing, &solids);
                stairwells.extend(done.stairwell);
                back.push(done);
            }
            self.back_walls(&back, up, size.z);
            self.end_walls(&back, up, &wing_start, cross, size, inner_depth);
            for (w, (&low, &high)) in below.iter().zip(&stairwells).enumerate() {
                let hole = stair_hole(w, floor);
                self.site
                    .opening(OpeningKind::Opening, hole, 1, [low, high]);
            }
            below = stairwells;
            let walls = std::mem::replace(&mut self.walls, MeshBuilder::new(self.concrete));
            self.site.structure(&format!("walls {s}"), walls);
        }
        let top = storeys as f64 * STOREY;
        let mut roof = MeshBuilder::new(self.concrete);
        roof.cuboid(aabb([0.0, top - SLAB, 0.0], [size.x, top, size.z]));
        self.site.structure("roof", roof);
        if self.params.ground {
            let turf = self.site.material("turf", [0.2, 0.35, 0.15]);
            let mut ground = MeshBuilder::new(turf);
            ground.cuboid(aabb(
                [-10.0, -0.6, -10.0],
                [size.x + 10.0, -0.15, size.z + 10.0],
            ));
            self.site.structure("ground", ground);
        }
    }

    /// Rooms, corridor, corridor walls and partitions of one wing on one storey.
    fn wing(&mut self, wing: &Wing, solids: &[(Aabb, f64)]) -> BuiltWing {
        let Wing {
            s,
            storey,
            w,
            start,
            up,
            has_stairs,
            cross,
        } = *wing;
        let (west, east) = (self.row_start, snapped(self.row_start + self.row_length));
        let corridor_z = [
            start + ROWS[0] + CORRIDOR_WALL,
            start + ROWS[0] + CORRIDOR_WALL + CORRIDOR,
        ];
        let air = aabb([west, up[0], corridor_z[0]], [east, up[1], corridor_z[1]]);
        let corridor = self
            .site
            .room(&format!("storey {s}/corridor {w}"), storey, air);
        let mut built = BuiltWing {
            corridor,
            corridor_z,
            rows: [Vec::new(), Vec::new()],
            rows_z: [
                [start, start + ROWS[0]],
                [
                    corridor_z[1] + CORRIDOR_WALL,
                    corridor_z[1] + CORRIDOR_WALL + ROWS[1],
                ],
            ],
            stairwell: None,
        };
        for row in 0..2 {
            let z = built.rows_z[row];
            let spans = self.row_spans(w, row, has_stairs && row == 0);
            let mut previous: Option<(Side, bool)> = None;
            for (i, &x) in spans.iter().enumerate() {
                let is_stairs = has_stairs && row == 0 && i == 0;
                let kind = if is_stairs { "stairwell" } else { "office" };
                let name = format!("storey {s}/{kind} {w}{}{i}", ["n", "s"][row]);
                let air = aabb([x[0], up[0], z[0]], [x[1], up[1], z[1]]);
                let parts = vec![Convex::of_aabb(&air)];
                let inside = if is_stairs { solids } else { &[] };
                let side = self.site.add_room(Room::new(&name, storey, parts, inside));
                if is_stairs {
                    built.stairwell = Some(side);
                }
                built.rows[row].push((x, side));
                if let Some((before, before_stairs)) = previous {
                    let wall_x = [spans[i - 1][1], x[0]];
                    self.partition(wall_x, z, up, [before, side], before_stairs);
                }
                previous = Some((side, is_stairs));
                let wall_z = if row == 0 {
                    [z[1], corridor_z[0]]
                } else {
                    [corridor_z[1], z[0]]
                };
                let sides = if row == 0 {
                    [side, corridor]
                } else {
                    [corridor, side]
                };
                // The panel runs to the middle of the partitions at its ends.
                let panel = [
                    if i == 0 {
                        west
                    } else {
                        snapped(f64::midpoint(spans[i - 1][1], x[0]))
                    },
                    if i + 1 == spans.len() {
                        east
                    } else {
                        snapped(f64::midpoint(x[1], spans[i + 1][0]))
                    },
                ];
                self.corridor_panel(panel, x, wall_z, up, sides);
                if self.params.furniture && !is_stairs {
                    self.furnish(&air, row == 0);
                }
            }
        }
        if let Some(cross) = cross {
            // Wall between the cross corridor and the rows, with a double door to the corridor.
            let x = [west - CORRIDOR_WALL, west];
            let last = w + 1 == self.rows.len();
            let z_end = built.rows_z[1][1] + if last { 0.0 } else { CORRIDOR_WALL };
            let middle = f64::midpoint(corridor_z[0], corridor_z[1]);
            let hole = aabb(
                [x[0], up[0], middle - 0.8],
                [x[1], up[0] + 2.1, middle + 0.8],
            );
            self.add_wall(Wall {
                axis: 0,
                body: aabb([x[0], up[0], start], [x[1], up[1], z_end]),
                holes: vec![(OpeningKind::Door, hole, [cross, corridor])],
                double: false,
            });
        }
        built
    }

    /// Clear extents along x of the rooms of one row.
    fn row_spans(&mut self, w: usize, row: usize, has_stairs: bool) -> Vec<[f64; 2]> {
        let n = self.rows[w][row];
        let mut spans = Vec::with_capacity(n + 1);
        let (mut x, end) = (self.row_start, self.row_start + self.row_length);
        if has_stairs {
            let last = if n == 0 { end } else { x + STAIRWELL };
            spans.push([x, snapped(last)]);
            x += STAIRWELL + PARTITION;
        }
        // One in eight is a store room, one in eight a meeting room.
        let widths: Vec<f64> = (0..n)
            .map(|_| match self.rng.below(8) {
                0 => 0.55,
                1 => 1.6,
                _ => self.rng.range(0.8, 1.2),
            })
            .collect();
        let clear = end - x - n.saturating_sub(1) as f64 * PARTITION;
        let scale = clear / widths.iter().sum::<f64>();
        for (i, width) in widths.iter().enumerate() {
            let high = if i + 1 == n { end } else { x + width * scale };
            spans.push([snapped(x), snapped(high)]);
            x = snapped(high) + PARTITION;
        }
        spans
    }

    fn partition(
        &mut self,
        x: [f64; 2],
        z: [f64; 2],
        up: [f64; 2],
        sides: [Side; 2],
        stairs: bool,
    ) {
        let double = self.params.double_walls && !stairs && self.rng.chance(0.4);
        let mut holes = Vec::new();
        if !stairs && self.rng.chance(0.15) {
            let at = self.rng.range(z[0] + 0.4, z[1] - 1.4);
            let hole = aabb([x[0], up[0], at], [x[1], up[0] + 2.05, at + 0.85]);
            holes.push((OpeningKind::Door, hole, sides));
        }
        let body = aabb([x[0], up[0], z[0]], [x[1], up[1], z[1]]);
        self.add_wall(Wall {
            axis: 0,
            body,
            holes,
            double,
        });
    }

    fn corridor_panel(
        &mut self,
        panel: [f64; 2],
        room: [f64; 2],
        z: [f64; 2],
        up: [f64; 2],
        sides: [Side; 2],
    ) {
        let clear = room[1] - room[0];
        let [width, height] = if clear > 4.6 {
            [1.7, 2.1]
        } else {
            [[0.8, 2.05], [0.9, 2.1], [1.0, 2.1]][self.rng.below(3)]
        };
        let width = f64::min(width, clear - 0.3);
        let at = self.rng.range(room[0] + 0.15, room[1] - 0.15 - width);
        let hole = aabb([at, up[0], z[0]], [at + width, up[0] + height, z[1]]);
        self.add_wall(Wall {
            axis: 2,
            body: aabb([panel[0], up[0], z[0]], [panel[1], up[1], z[1]]),
            holes: vec![(OpeningKind::Door, hole, sides)],
            double: false,
        });
    }

    /// Walls along x behind the rows: facades with windows, and plain walls between wings.
    fn back_walls(&mut self, wings: &[BuiltWing], up: [f64; 2], depth: f64) {
        let first = wings.first().map(|w| (0, w, [0.0, FACADE]));
        let last = wings.last().map(|w| (1, w, [depth - FACADE, depth]));
        for (row, wing, z) in first.into_iter().chain(last) {
            let rooms = &wing.rows[row];
            for (i, &(x, side)) in rooms.iter().enumerate() {
                let panel = [
                    // The corner posts belong to this facade.
                    if i == 0 {
                        0.0
                    } else {
                        snapped(f64::midpoint(rooms[i - 1].0[1], x[0]))
                    },
                    if i + 1 == rooms.len() {
                        x[1] + FACADE
                    } else {
                        snapped(f64::midpoint(x[1], rooms[i + 1].0[0]))
                    },
                ];
                let sides = if row == 0 {
                    [Side::Outside, side]
                } else {
                    [side, Side::Outside]
                };
                let mut holes = Vec::new();
                let clear = x[1] - x[0];
                if self.params.windows && clear > 1.2 {
                    let n = if clear > 4.6 { 2 } else { 1 };
                    let bay = clear / f64::from(n);
                    let width = (bay - 0.8).clamp(0.6, 2.4);
                    for k in 0..n {
                        let middle = x[0] + (f64::from(k) + 0.5) * bay;
                        let hole = aabb(
                            [middle - width * 0.5, up[0] + 0.9, z[0]],
                            [middle + width * 0.5, up[0] + 2.3, z[1]],
                        );
                        holes.push((OpeningKind::Window, hole, sides));
                    }
                }
                let body = aabb([panel[0], up[0], z[0]], [panel[1], up[1], z[1]]);
                self.add_wall(Wall {
                    axis: 2,
                    body,
                    holes,
                    double: false,
                });
            }
        }
        for pair in wings.windows(2) {
            let z = [pair[0].rows_z[1][1], pair[1].rows_z[0][0]];
            let x = [self.row_start, snapped(self.row_start + self.row_length)];
            let body = aabb([x[0], up[0], z[0]], [x[1], up[1], z[1]]);
            self.add_wall(Wall {
                axis: 2,
                body,
                holes: Vec::new(),
                double: false,
            });
        }
    }

    /// West and east facades: entrance and windows at the ends of the corridors.
    fn end_walls(
        &mut self,
        wings: &[BuiltWing],
        up: [f64; 2],
        wing_start: &impl Fn(usize) -> f64,
        cross: Option<Side>,
        size: DVec3,
        inner_depth: f64,
    ) {
        let z_of = |w: usize| {
            let end = if w + 1 == wings.len() {
                FACADE + inner_depth
            } else {
                wing_start(w + 1)
            };
            [wing_start(w), end]
        };
        for (w, wing) in wings.iter().enumerate() {
            let z = z_of(w);
            let middle = f64::midpoint(wing.corridor_z[0], wing.corridor_z[1]);
            for (x, west) in [([0.0, FACADE], true), ([size.x - FACADE, size.x], false)] {
                let inside = cross.filter(|_| west).unwrap_or(wing.corridor);
                let sides = if west {
                    [Side::Outside, inside]
                } else {
                    [inside, Side::Outside]
                };
                let entrance = west && up[0] == 0.0 && w == 0;
                let mut holes = Vec::new();
                if entrance {
                    let hole = aabb([x[0], 0.0, middle - 0.9], [x[1], 2.1, middle + 0.9]);
                    holes.push((OpeningKind::Door, hole, sides));
                } else if self.params.windows {
                    let hole = aabb(
                        [x[0], up[0] + 0.9, middle - 0.7],
                        [x[1], up[0] + 2.3, middle + 0.7],
                    );
                    holes.push((OpeningKind::Window, hole, sides));
                }
                let body = aabb([x[0], up[0], z[0]], [x[1], up[1], z[1]]);
                self.add_wall(Wall {
                    axis: 0,
                    body,
                    holes,
                    double: false,
                });
            }
        }
    }

    /// Models a wall, cracked or doubled where asked for, and notes its openings.
    fn add_wall(&mut self, wall: Wall) {
        let Wall {
            axis,
            mut body,
            holes,
            double,
        } = wall;
        if self.params.cracks {
            let along = 2 - axis;
            // Two in three walls are whole.
            match self.rng.below(6) {
                0 => body.max.y -= self.rng.range(0.002, 0.02),
                1 => body.max[along] -= self.rng.range(0.002, 0.02),
                _ => {}
            }
        }
        let voids: Vec<Aabb> = holes.iter().map(|(_, hole, _)| *hole).collect();
        if double {
            let middle = body.center()[axis];
            let leaf = |low: f64| {
                let mut b = body;
                (b.min[axis], b.max[axis]) = (low, low + LEAF);
                b
            };
            for low in [middle - CAVITY * 0.5 - LEAF, middle + CAVITY * 0.5] {
                let leaf = leaf(low);
                let cut: Vec<Aabb> = voids
                    .iter()
                    .map(|v| {
                        let mut v = *v;
                        (v.min[axis], v.max[axis]) = (leaf.min[axis], leaf.max[axis]);
                        v
                    })
                    .collect();
                self.walls.carved(&[leaf], &cut);
            }
        } else {
            self.walls.carved(&[body], &voids);
        }
        for (kind, mut hole, sides) in holes {
            if self.params.leaves {
                match kind {
                    OpeningKind::Window => glaze(&mut self.site, &self.palette, &hole, axis),
                    _ => hang_door(&mut self.site, &self.palette, &hole, axis, 75.0),
                }
            }
            if double {
                let middle = hole.center()[axis];
                let half = CAVITY * 0.5 + LEAF;
                (hole.min[axis], hole.max[axis]) = (middle - half, middle + half);
            }
            self.site.opening(kind, hole, axis, sides);
        }
    }

    /// Desks along one side wall, shelves along the other; `north` rooms have their window at
    /// low z.
    fn furnish(&mut self, air: &Aabb, north: bool) {
        let (f, floor) = (self.furniture, air.min.y);
        let size = air.size();
        if size.x < 2.4 {
            for i in 0..((size.z - 1.6) / 1.0) as usize {
                let z = air.min.z + 0.6 + i as f64;
                self.site.furnish(
                    "shelf",
                    f.shelf,
                    DVec3::new(air.min.x + 0.25, floor, z),
                    90.0,
                );
            }
            return;
        }
        let window = |inward: f64| {
            if north {
                air.min.z + inward
            } else {
                air.max.z - inward
            }
        };
        let n = if size.x > 4.6 { 2 } else { 1 };
        for i in 0..n {
            let z = window(1.2 + 1.9 * f64::from(i));
            self.site
                .furnish("desk", f.desk, DVec3::new(air.min.x + 0.5, floor, z), 90.0);
            let turn = self.rng.range(-30.0, 30.0);
            self.site.furnish(
                "chair",
                f.chair,
                DVec3::new(air.min.x + 1.3, floor, z),
                90.0 + turn,
            );
            let cabinet = DVec3::new(air.min.x + 0.3, floor, z + 0.5);
            self.site.furnish("cabinet", f.cabinet, cabinet, 90.0);
        }
        let shelf = DVec3::new(air.max.x - 0.25, floor, window(1.0));
        self.site.furnish("shelf", f.shelf, shelf, -90.0);
        if self.rng.chance(0.4) {
            let plant = DVec3::new(air.max.x - 0.4, floor, window(2.2));
            self.site.furnish("plant", f.plant, plant, 0.0);
        }
    }
}

/// Where a wing is to be built.
struct Wing {
    s: usize,
    storey: usize,
    w: usize,
    start: f64,
    up: [f64; 2],
    has_stairs: bool,
    cross: Option<Side>,
}

/// What the walls around a wing need to know of it.
struct BuiltWing {
    corridor: Side,
    corridor_z: [f64; 2],
    rows: [Vec<([f64; 2], Side)>; 2],
    rows_z: [[f64; 2]; 2],
    stairwell: Option<Side>,
}
