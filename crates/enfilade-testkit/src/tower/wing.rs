//! The rooms of one wing on one storey: two rows along a corridor.

use enfilade_geom::{Aabb, DVec3};

use super::model::{
    BuiltWing, CORRIDOR, CORRIDOR_WALL, PARTITION, ROWS, STAIRWELL, Tower, Wall, Wing,
};
use enfilade_demo::solid::{aabb, snapped};
use enfilade_demo::{Convex, OpeningKind, Room, Side};

impl Tower<'_> {
    /// Builds rooms, corridor, corridor walls and partitions of one wing on one storey.
    pub(super) fn wing(&mut self, wing: &Wing) -> BuiltWing {
        let Wing { s, w, up, .. } = *wing;
        let start = Self::wing_start(w);
        let [west, east] = self.rows_x();
        let corridor_z = [
            start + ROWS[0] + CORRIDOR_WALL,
            start + ROWS[0] + CORRIDOR_WALL + CORRIDOR,
        ];
        let air = aabb([west, up[0], corridor_z[0]], [east, up[1], corridor_z[1]]);
        let name = format!("storey {s}/corridor {w}");
        let mut built = BuiltWing {
            corridor: self.site.room(&name, wing.storey, air),
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
            self.add_row(wing, row, &mut built);
        }
        if let Some(cross) = wing.cross {
            self.add_cross_wall(wing, cross, &built);
        }
        built
    }

    /// Adds the rooms on one side of the corridor.
    fn add_row(&mut self, wing: &Wing, row: usize, built: &mut BuiltWing) {
        let Wing { s, w, up, .. } = *wing;
        let (z, corridor_z) = (built.rows_z[row], built.corridor_z);
        let has_stairs = self.has_stairs && row == 0;
        let spans = self.row_spans(w, row, has_stairs);
        let [west, east] = self.rows_x();
        let mut previous: Option<(Side, bool)> = None;
        for (i, &x) in spans.iter().enumerate() {
            let is_stairs = has_stairs && i == 0;
            let kind = if is_stairs { "stairwell" } else { "office" };
            let name = format!("storey {s}/{kind} {w}{}{i}", ["n", "s"][row]);
            let air = aabb([x[0], up[0], z[0]], [x[1], up[1], z[1]]);
            let parts = vec![Convex::of_aabb(&air)];
            let solids = wing.flight.as_slice();
            let inside = if is_stairs { solids } else { &[] };
            let room = Room::new(&name, wing.storey, parts, inside);
            let side = self.site.add_room(room);
            if is_stairs {
                built.stairwell = Some(side);
            }
            built.rows[row].push((x, side));
            if let Some((before, before_stairs)) = previous {
                let wall_x = [spans[i - 1][1], x[0]];
                self.partition(wall_x, z, up, [before, side], before_stairs);
            }
            previous = Some((side, is_stairs));
            let (wall_z, sides) = if row == 0 {
                ([z[1], corridor_z[0]], [side, built.corridor])
            } else {
                ([corridor_z[1], z[0]], [built.corridor, side])
            };
            // The panel runs to the middle of the partitions at its ends.
            let between = |low: [f64; 2], high: [f64; 2]| snapped(f64::midpoint(low[1], high[0]));
            let is_last = i + 1 == spans.len();
            let panel = [
                if i == 0 {
                    west
                } else {
                    between(spans[i - 1], x)
                },
                if is_last {
                    east
                } else {
                    between(x, spans[i + 1])
                },
            ];
            self.corridor_panel(panel, x, wall_z, up, sides);
            if self.params.furniture && !is_stairs {
                self.furnish(&air, row == 0);
            }
        }
    }

    /// Adds the wall between the cross corridor and the rows, with a double door to the corridor.
    fn add_cross_wall(&mut self, wing: &Wing, cross: Side, built: &BuiltWing) {
        let (up, west) = (wing.up, self.row_start);
        let x = [west - CORRIDOR_WALL, west];
        let is_last = wing.w + 1 == self.rows.len();
        let z_end = built.rows_z[1][1] + if is_last { 0.0 } else { CORRIDOR_WALL };
        let middle = f64::midpoint(built.corridor_z[0], built.corridor_z[1]);
        let hole = aabb(
            [x[0], up[0], middle - 0.8],
            [x[1], up[0] + 2.1, middle + 0.8],
        );
        let start = Self::wing_start(wing.w);
        self.add_wall(Wall {
            axis: 0,
            body: aabb([x[0], up[0], start], [x[1], up[1], z_end]),
            holes: vec![(OpeningKind::Door, hole, [cross, built.corridor])],
            double: false,
        });
    }

    /// Returns the clear extents along x of the rooms of one row.
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

    /// Adds desks along one side wall, shelves along the other; `north` rooms have their window at low z.
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
