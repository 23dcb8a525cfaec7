//! Squares labeled with their rooms: the walls between them, and the locator.

use enfilade_cpg::{CellId, Locator, LocatorNode};
use enfilade_geom::{Aabb, DMat3, DVec3};

/// A rectangle, and the direction in which it was cut out of its wall.
pub(super) type Quad = [DVec3; 4];

/// The grid under construction.
pub(super) struct Grid {
    pub(super) size: [usize; 3],
    /// Boundaries of squares per axis: `size + 1` numbers each.
    pub(super) at: [Vec<f64>; 3],
    /// Cell of each square, x fastest, then y.
    pub(super) label: Vec<u32>,
    pub(super) outdoors: Option<u32>,
    pub(super) turn: DMat3,
}

/// A wall face between two squares, or a square and the outdoors.
#[derive(Clone, Copy)]
pub(super) struct Face {
    pub(super) axis: usize,
    /// The square on the upper side (its index along `axis` is the plane's).
    pub(super) square: [usize; 3],
    /// Cells on the lower and upper side; `None` for solid ground.
    pub(super) cells: [Option<u32>; 2],
}

impl Grid {
    /// Returns the square at an index of `label`.
    pub(super) fn square(&self, i: usize) -> [usize; 3] {
        let [x, y, _] = self.size;
        [i % x, i / x % y, i / x / y]
    }

    fn label_at(&self, square: [usize; 3]) -> u32 {
        self.label[(square[2] * self.size[1] + square[1]) * self.size[0] + square[0]]
    }

    pub(super) fn faces(&self) -> Vec<Face> {
        let mut out = Vec::new();
        for axis in 0..3 {
            let mut n = self.size;
            n[axis] += 1;
            for i in 0..n[0] * n[1] * n[2] {
                let square = [i % n[0], i / n[0] % n[1], i / n[0] / n[1]];
                out.extend(self.face(axis, square));
            }
        }
        out
    }

    /// Returns the face across `axis` below a square; `None` within a room.
    fn face(&self, axis: usize, square: [usize; 3]) -> Option<Face> {
        let mut below = square;
        let lower = if square[axis] == 0 {
            self.outdoors
        } else {
            below[axis] -= 1;
            Some(self.label_at(below))
        };
        let upper = if square[axis] == self.size[axis] {
            self.outdoors
        } else {
            Some(self.label_at(square))
        };
        (lower != upper).then_some(Face {
            axis,
            square,
            cells: [lower, upper],
        })
    }

    /// Returns the part of a face from `low` to `high` (0 to 1 along the two other axes, in cyclic order),
    /// counter-clockwise about the axis.
    pub(super) fn rectangle(&self, face: &Face, low: [f64; 2], high: [f64; 2]) -> Quad {
        let (a, b) = ((face.axis + 1) % 3, (face.axis + 2) % 3);
        let along = |k: usize, t: f64| {
            let (from, to) = (self.at[k][face.square[k]], self.at[k][face.square[k] + 1]);
            from + (to - from) * t
        };
        let point = |s: f64, t: f64| {
            let mut p = DVec3::ZERO;
            p[face.axis] = self.at[face.axis][face.square[face.axis]];
            p[a] = along(a, s);
            p[b] = along(b, t);
            self.turn * p
        };
        [
            point(low[0], low[1]),
            point(high[0], low[1]),
            point(high[0], high[1]),
            point(low[0], high[1]),
        ]
    }

    pub(super) fn locator(&self) -> Locator {
        let mut planes = Vec::new();
        let mut first = [0; 3];
        for (axis, first) in first.iter_mut().enumerate() {
            *first = planes.len() as u32;
            let n = self.turn.col(axis);
            planes.extend(self.at[axis].iter().map(|x| [n.x, n.y, n.z, -x]));
        }
        let mut bounds = Aabb::EMPTY;
        for corner in 0..8 {
            let pick = |k: usize| {
                self.at[k][if corner >> k & 1 == 1 {
                    self.size[k]
                } else {
                    0
                }]
            };
            bounds = bounds.including(self.turn * DVec3::new(pick(0), pick(1), pick(2)));
        }
        let mut nodes = Vec::new();
        // Six planes cut the box off from the ground or the outdoors, for turned grids.
        let outside = Locator::leaf(self.outdoors.map(CellId));
        for (axis, &low) in first.iter().enumerate() {
            for (side, plane) in [(0, low), (1, low + self.size[axis] as u32)] {
                let next = nodes.len() as i32 + 1;
                let children = if side == 0 {
                    [next, outside]
                } else {
                    [outside, next]
                };
                nodes.push(LocatorNode { plane, children });
            }
        }
        let inner = self.split(&mut nodes, [0; 3], self.size, &first);
        // A grid of one room has no node of its own.
        nodes[5].children[1] = inner;
        Locator {
            bounds,
            outside: self.outdoors.map(CellId),
            planes,
            nodes,
            root: 0,
        }
    }

    fn split(
        &self,
        nodes: &mut Vec<LocatorNode>,
        low: [usize; 3],
        high: [usize; 3],
        first: &[u32; 3],
    ) -> i32 {
        let axis = (0..3).max_by_key(|&k| high[k] - low[k]).unwrap_or(0);
        if high[axis] - low[axis] <= 1 {
            let leaf = Locator::leaf(Some(CellId(self.label_at(low))));
            // The root of a grid of one square must be a node.
            return leaf;
        }
        let middle = (low[axis] + high[axis]) / 2;
        let at = nodes.len();
        nodes.push(LocatorNode {
            plane: first[axis] + middle as u32,
            children: [0; 2],
        });
        let (mut below, mut above) = (high, low);
        below[axis] = middle;
        above[axis] = middle;
        let upper = self.split(nodes, above, high, first);
        let lower = self.split(nodes, low, below, first);
        nodes[at].children = [upper, lower];
        at as i32
    }
}
