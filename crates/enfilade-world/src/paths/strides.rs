//! Shortest paths over floors, square by square, and straight lines over them.
//!
//! Dijkstra's algorithm, or A* (Hart, Nilsson & Raphael, "A formal basis for the heuristic determination of minimum cost paths",
//! 1968) for a single goal, over 16 directions: along the squares, the diagonals, and the knight's moves between. So paths are at
//! most 2.8 % longer than the shortest on the squares, and are pulled taut afterwards. O(floors · log) of the cell. Lengths are
//! `f32`: exact to a hundredth of a millimeter in a kilometer-wide cell.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use enfilade_cpg::PortalId;
use enfilade_geom::DVec3;

use crate::paths::floors::{Floors, Hindrance};
use crate::paths::grounds::NONE;

/// A search over the floors of one cell, with reusable buffers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Strides {
    labels: Vec<Footprint>,
    stamp: u32,
    heap: BinaryHeap<Reverse<(u32, u32)>>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Footprint {
    length: f32,
    before: u32,
    stamp: u32,
}

impl Strides {
    /// Finds the paths from a floor to all others of its cell, or until `goal` is reached. Passes no portal, nor the open leaves
    /// of those `opened`, nor floors beside drops but those of `edges`, ascending.
    pub(crate) fn spread(
        &mut self,
        floors: &Floors,
        start: u32,
        goal: Option<u32>,
        opened: &[PortalId],
        edges: &[u32],
    ) {
        self.stamp = self.stamp.wrapping_add(1);
        if self.stamp == 0 {
            self.labels.clear();
            self.stamp = 1;
        }
        if self.labels.len() < floors.n_floors() {
            self.labels.resize(floors.n_floors(), Footprint::default());
        }
        self.heap.clear();
        let target = goal.map(|g| floors.point(g));
        let ahead = |floor: u32| target.map_or(0.0, |t| floors.point(floor).distance(t) as f32);
        self.labels[start as usize] = Footprint {
            length: 0.0,
            before: NONE,
            stamp: self.stamp,
        };
        self.heap.push(Reverse((ahead(start).to_bits(), start)));
        while let Some(Reverse((bits, at))) = self.heap.pop() {
            if Some(at) == goal {
                break;
            }
            let length = self.labels[at as usize].length;
            // Rounded as on insertion.
            if f32::from_bits(bits) > length + ahead(at) {
                continue;
            }
            let from = floors.point(at);
            each_move(floors, at, opened, edges, |to| {
                let through = length + floors.point(to).distance(from) as f32;
                let label = &mut self.labels[to as usize];
                if label.stamp != self.stamp || through < label.length {
                    *label = Footprint {
                        length: through,
                        before: at,
                        stamp: self.stamp,
                    };
                    self.heap
                        .push(Reverse(((through + ahead(to)).to_bits(), to)));
                }
            });
        }
    }

    /// Returns the length to a floor; infinite if no path was found. After a search for one goal, only that of the goal is
    /// certainly the least. [Units: wu]
    pub(crate) fn length(&self, to: u32) -> f64 {
        let label = self.labels.get(to as usize);
        let known = label.filter(|l| l.stamp == self.stamp);
        known.map_or(f64::INFINITY, |l| f64::from(l.length))
    }

    /// Returns the floors of the path to one, from its end back to the start, which is left out.
    pub(crate) fn back(&self, to: u32) -> impl Iterator<Item = u32> {
        let mut at = to;
        std::iter::from_fn(move || {
            let here = at;
            at = self.labels[here as usize].before;
            (at != NONE).then_some(here)
        })
    }
}

/// Calls `visit` with the floors around one that are in its cell.
fn each_move(
    floors: &Floors,
    at: u32,
    opened: &[PortalId],
    edges: &[u32],
    mut visit: impl FnMut(u32),
) {
    let mut may = |hindrance| match hindrance {
        Hindrance::Portal(_) => false,
        Hindrance::Leaf(portal) => !opened.contains(&portal),
        Hindrance::Edge(floor) => edges.binary_search(&floor).is_ok(),
    };
    let mut step = |from: u32, direction: usize| floors.step(from, direction % 4, &mut may);
    let beside: [Option<u32>; 4] = std::array::from_fn(|d| step(at, d));
    for d in 0..4 {
        let (Some(a), Some(b)) = (beside[d], beside[(d + 1) % 4]) else {
            continue;
        };
        // Both ways around must lead there, so that the diagonal does not cut across a gap.
        let Some(corner) = step(a, d + 1).filter(|&c| step(b, d) == Some(c)) else {
            continue;
        };
        visit(corner);
        for (side, along, across) in [(a, d, d + 1), (b, d + 1, d)] {
            let far = step(side, along).and_then(|far| step(far, across));
            if let Some(knight) = step(corner, along).filter(|&k| far == Some(k)) {
                visit(knight);
            }
        }
    }
    beside.into_iter().flatten().for_each(visit);
}

/// Walks straight, in plan, from a point of a floor to another point. Calls `visit` with each floor stepped on, and the portal if
/// it is in another cell. Returns the floor at the end; `None` if blocked, or by something for which `may` returns `false`.
pub(crate) fn walk_straight(
    floors: &Floors,
    from: DVec3,
    start: u32,
    to: DVec3,
    may: &mut impl FnMut(Hindrance) -> bool,
    mut visit: impl FnMut(u32, usize, u32),
) -> Option<u32> {
    let squares = floors.squares();
    let (a, b) = (squares.along(from), squares.along(to));
    let (mut at, end) = (a.map(f64::floor), b.map(f64::floor));
    let mut floor = start;
    let delta = [0, 1].map(|k| b[k] - a[k]);
    let sign = delta.map(f64::signum);
    // Start of the next square along the line, by axis.
    let next = |k: usize, at: f64| {
        if at == end[k] {
            return f64::INFINITY;
        }
        (at + sign[k].max(0.0) - a[k]) / delta[k]
    };
    let mut t = [next(0, at[0]), next(1, at[1])];
    while t[0] < f64::INFINITY || t[1] < f64::INFINITY {
        let axis = usize::from(t[1] < t[0]);
        let direction = if sign[axis] > 0.0 { axis } else { axis + 2 };
        let to = floors.step(floor, direction, may)?;
        visit(floor, direction, to);
        floor = to;
        at[axis] += sign[axis];
        t[axis] = next(axis, at[axis]);
    }
    Some(floor)
}
