//! Bricks, and the room of each.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_cpg::{CellId, World};
use enfilade_geom::DVec3;

use super::frame::Frame;
use super::lines::Lines;
use crate::surfaces::RoomSurfaces;

/// Farthest distance of vertical lines along which the rooms' shares of bricks are measured. [Units: wu]
const SAMPLED: f64 = 0.3;
/// Most of these lines across a brick along an axis.
const MOST_SAMPLES: f64 = 8.0;
/// Places of samples off the middle, so that they do not meet edges of the model.
const OFF: [f64; 2] = [0.4987, 0.5021];

/// A grid of bricks of various sizes, each with its cell.
pub(crate) struct Bricks {
    /// Where the bricks end along each axis, ascending.
    pub(crate) ends: [Vec<f64>; 3],
    /// The cell that has most of each brick; `None` is matter.
    cells: Vec<Option<CellId>>,
}

/// Shares of the bricks that a room has, and what is known of those before.
struct Shares {
    /// Heights that belong to any cell, by brick. [Units: wu, summed over samples]
    all: Vec<f64>,
    /// The largest so far, and whose.
    best: Vec<(f64, Option<CellId>)>,
}

impl Bricks {
    /// Divides space by planes, and gives each brick to the cell that has most of it. Rooms are told in the frame's axes.
    pub(crate) fn new(world: &World, frame: &Frame, rooms: &[RoomSurfaces], lines: &Lines) -> Self {
        let ends = [0, 1, 2].map(|a| lines.axes[a].iter().map(|l| l.at).collect::<Vec<f64>>());
        let mut bricks = Self {
            ends,
            cells: Vec::new(),
        };
        let n = bricks.counts().into_iter().product();
        let mut shares = Shares {
            all: vec![0.0; n],
            best: vec![(0.0, None); n],
        };
        let samples = [bricks.samples(0, OFF[0]), bricks.samples(2, OFF[1])];
        for room in rooms {
            bricks.add_shares(room, &samples, &mut shares);
        }
        let n_samples = samples.map(|s| counted(&s));
        bricks.cells = shares.best.iter().map(|b| b.1).collect();
        for at in bricks.places() {
            let number = bricks.number(at);
            let [low, high] = bricks.corners(at);
            let whole = (high.y - low.y) * (n_samples[0][at[0]] * n_samples[1][at[2]]) as f64;
            if shares.all[number] < 0.5 * whole {
                bricks.cells[number] = outer_cell(world, frame, [low, high]);
            }
        }
        bricks.part_edges(world);
        bricks
    }

    pub(crate) fn counts(&self) -> [usize; 3] {
        [0, 1, 2].map(|a| self.ends[a].len() - 1)
    }

    /// Returns the places of all bricks, by number.
    pub(crate) fn places(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        let [nx, ny, nz] = self.counts();
        (0..nx).flat_map(move |x| (0..ny).flat_map(move |y| (0..nz).map(move |z| [x, y, z])))
    }

    fn number(&self, [x, y, z]: [usize; 3]) -> usize {
        let [_, ny, nz] = self.counts();
        (x * ny + y) * nz + z
    }

    /// Returns the cell of a brick; `None` is matter.
    pub(crate) fn cell(&self, at: [usize; 3]) -> Option<CellId> {
        self.cells[self.number(at)]
    }

    fn corners(&self, at: [usize; 3]) -> [DVec3; 2] {
        let corner = |by: usize| DVec3::from([0, 1, 2].map(|a| self.ends[a][at[a] + by]));
        [corner(0), corner(1)]
    }

    fn brick_volume(&self, at: [usize; 3]) -> f64 {
        let [low, high] = self.corners(at);
        (high - low).element_product()
    }

    /// Returns the volume of a cell's bricks. O(bricks).
    pub(crate) fn volume(&self, cell: CellId) -> f64 {
        let own = self.places().filter(|&at| self.cell(at) == Some(cell));
        own.map(|at| self.brick_volume(at)).sum()
    }

    /// Returns places along an axis at which to measure, each with its brick.
    fn samples(&self, axis: usize, off: f64) -> Vec<(f64, usize)> {
        let mut samples = Vec::new();
        for (i, end) in self.ends[axis].windows(2).enumerate() {
            let size = end[1] - end[0];
            let n = (size / SAMPLED).ceil().clamp(1.0, MOST_SAMPLES);
            let places = (0..n as usize).map(|k| end[0] + size * (k as f64 + off) / n);
            samples.extend(places.map(|p| (p, i)));
        }
        samples
    }

    /// Adds the heights at which vertical lines are in a room.
    fn add_shares(
        &self,
        room: &RoomSurfaces,
        samples: &[Vec<(f64, usize)>; 2],
        shares: &mut Shares,
    ) {
        let mut own: BTreeMap<usize, f64> = BTreeMap::new();
        for (column, mut heights) in crossings(room, samples) {
            heights.sort_by(f64::total_cmp);
            let [x, z] = [samples[0][column[0]].1, samples[1][column[1]].1];
            for pair in heights.chunks_exact(2) {
                let first = self.ends[1].partition_point(|&y| y <= pair[0]).max(1) - 1;
                for y in first..self.counts()[1] {
                    let (low, high) = (
                        self.ends[1][y].max(pair[0]),
                        self.ends[1][y + 1].min(pair[1]),
                    );
                    if high <= low {
                        break;
                    }
                    *own.entry(self.number([x, y, z])).or_default() += high - low;
                }
            }
        }
        for (number, share) in own {
            shares.all[number] += share;
            if share > shares.best[number].0 {
                shares.best[number] = (share, Some(room.cell));
            }
        }
    }

    /// Parts rooms that touch themselves along an edge only, where four faces would meet.
    fn part_edges(&mut self, world: &World) {
        let is_room = |c: Option<CellId>| c.is_some_and(|c| world.graph[c].is_room());
        let mut open: Vec<[usize; 3]> = self.places().collect();
        // Filling may make new ones; taking away ends when nothing is left.
        for round in 0.. {
            let mut changes = Vec::new();
            for at in open.drain(..) {
                for [a, b] in [[0, 1], [0, 2], [1, 2]] {
                    if at[a] == 0 || at[b] == 0 {
                        continue;
                    }
                    let four = [[0, 0], [1, 1], [0, 1], [1, 0]].map(|[i, k]| {
                        let mut near = at;
                        near[a] -= i;
                        near[b] -= k;
                        near
                    });
                    let cells = four.map(|p| self.cell(p));
                    for (own, others) in [([0, 1], [2, 3]), ([2, 3], [0, 1])] {
                        let [c, d] = own.map(|i| cells[i]);
                        if c != d || !is_room(c) || others.iter().any(|&i| cells[i] == c) {
                            continue;
                        }
                        let taken = own.map(|i| (four[i], None));
                        let free = others
                            .into_iter()
                            .filter(|&i| cells[i].is_none() && round < 20);
                        let choices = taken.into_iter().chain(free.map(|i| (four[i], c)));
                        let volume = |p: &([usize; 3], Option<CellId>)| self.brick_volume(p.0);
                        changes.extend(choices.min_by(|p, q| volume(p).total_cmp(&volume(q))));
                    }
                }
            }
            if changes.is_empty() {
                break;
            }
            let mut near = BTreeSet::new();
            for (place, cell) in changes {
                let number = self.number(place);
                self.cells[number] = cell;
                // Only their edges may have changed.
                near.extend((0..8).map(|i| [0, 1, 2].map(|a| place[a] + (i >> a & 1))));
            }
            let counts = self.counts();
            near.retain(|at| (0..3).all(|a| at[a] < counts[a]));
            open.extend(near);
        }
    }
}

/// Returns how many samples each brick has along an axis.
fn counted(samples: &[(f64, usize)]) -> Vec<usize> {
    let mut counts = vec![0; samples.last().map_or(0, |s| s.1 + 1)];
    for (_, brick) in samples {
        counts[*brick] += 1;
    }
    counts
}

/// Returns the heights at which vertical lines cross the boundary of a room.
fn crossings(
    room: &RoomSurfaces,
    samples: &[Vec<(f64, usize)>; 2],
) -> BTreeMap<[usize; 2], Vec<f64>> {
    let mut found: BTreeMap<[usize; 2], Vec<f64>> = BTreeMap::new();
    for surface in room.surfaces.iter().filter(|s| s.normal[1].abs() > 1e-3) {
        let normal = DVec3::from(surface.normal);
        let origin = DVec3::from(surface.loops[0][0]);
        let all = surface.loops.iter().flatten();
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        for p in all {
            for (k, axis) in [0, 2].into_iter().enumerate() {
                low[k] = low[k].min(p[axis]);
                high[k] = high[k].max(p[axis]);
            }
        }
        let range = |k: usize| {
            let first = samples[k].partition_point(|s| s.0 < low[k]);
            first..samples[k].partition_point(|s| s.0 <= high[k])
        };
        for i in range(0) {
            for k in range(1) {
                let (x, z) = (samples[0][i].0, samples[1][k].0);
                if is_over(&surface.loops, x, z) {
                    let off = normal.x * (x - origin.x) + normal.z * (z - origin.z);
                    let heights = found.entry([i, k]).or_default();
                    heights.push(origin.y - off / normal.y);
                }
            }
        }
    }
    found
}

/// Returns `true` if a vertical line passes through a polygon. Of two that share an edge, it passes through one.
fn is_over(loops: &[Vec<[f64; 3]>], x: f64, z: f64) -> bool {
    let mut is_in = false;
    for ring in loops {
        for (i, &[x0, _, z0]) in ring.iter().enumerate() {
            let [x1, _, z1] = ring[(i + 1) % ring.len()];
            // The same numbers whichever way the edge is walked.
            let [(x0, z0), (x1, z1)] = if z0 <= z1 {
                [(x0, z0), (x1, z1)]
            } else {
                [(x1, z1), (x0, z0)]
            };
            if (z0 > z) != (z1 > z) && x < x0 + (x1 - x0) * ((z - z0) / (z1 - z0)) {
                is_in = !is_in;
            }
        }
    }
    is_in
}

/// Returns the outdoors or open land that has most of a brick; `None` is matter.
fn outer_cell(world: &World, frame: &Frame, [low, high]: [DVec3; 2]) -> Option<CellId> {
    let mut counts: BTreeMap<Option<CellId>, usize> = BTreeMap::new();
    for corner in 0..8 {
        let share = [0, 1, 2].map(|a| if corner >> a & 1 == 0 { 0.2503 } else { 0.7498 });
        let p = low + (high - low) * DVec3::from(share);
        let cell = world
            .graph
            .locator
            .locate(frame.to_world(p.to_array()).into());
        let outer = cell.filter(|&c| !world.graph[c].is_indoors());
        *counts.entry(outer).or_default() += 1;
    }
    let most = counts.into_iter().max_by_key(|c| c.1);
    most.and_then(|c| c.0)
}
