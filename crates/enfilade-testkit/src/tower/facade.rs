//! The walls around the wings: facades with windows, and plain walls between wings.

use super::model::{BuiltWing, FACADE, Tower, Wall};
use enfilade_demo::solid::{aabb, snapped};
use enfilade_demo::{OpeningKind, Side};

impl Tower<'_> {
    /// Adds walls along x behind the rows: facades with windows, and plain walls between wings.
    pub(super) fn back_walls(&mut self, wings: &[BuiltWing], up: [f64; 2]) {
        let depth = self.size().z;
        let first = wings.first().map(|w| (0, w, [0.0, FACADE]));
        let last = wings.last().map(|w| (1, w, [depth - FACADE, depth]));
        for (row, wing, z) in first.into_iter().chain(last) {
            let rooms = &wing.rows[row];
            for (i, &(x, side)) in rooms.iter().enumerate() {
                let panel = [
                    // The posts where two facades meet belong to this facade.
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
            let x = self.rows_x();
            let body = aabb([x[0], up[0], z[0]], [x[1], up[1], z[1]]);
            self.add_wall(Wall {
                axis: 2,
                body,
                holes: Vec::new(),
                double: false,
            });
        }
    }

    /// Adds west and east facades: entrance and windows at the ends of the corridors.
    pub(super) fn end_walls(&mut self, wings: &[BuiltWing], up: [f64; 2], cross: Option<Side>) {
        let size = self.size();
        let z_end = FACADE + self.inner_depth();
        let z_of = |w: usize| {
            let end = if w + 1 == wings.len() {
                z_end
            } else {
                Self::wing_start(w + 1)
            };
            [Self::wing_start(w), end]
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
}
