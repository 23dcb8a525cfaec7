//! The graph in the form that the search uses: two directed portals for each portal, numbered so that those out of
//! one cell are neighbors.

use std::ops::Range;

use enfilade_cpg::SightGraph;
use enfilade_geom::DVec3;
use rayon::prelude::*;

use crate::bits::{self, BitTable};

/// A directed portal.
#[derive(Clone, Debug)]
pub(crate) struct Dir {
    pub(crate) from: u32,
    pub(crate) to: u32,
    /// Number of the direction in the [`SightGraph`] that holds all portals here; see [`Dirs::name`].
    pub(crate) id: u32,
    /// Unit normal, from `from` to `to`; zero if the winding has no area.
    pub(crate) normal: DVec3,
    /// Least and greatest `normal · p` over the winding, which is planar only up to rounding.
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Unit normal about which the vertices run counter-clockwise: `normal` or its opposite.
    pub(crate) turn: DVec3,
    pub(crate) center: DVec3,
    pub(crate) radius: f64,
    /// Range of its vertices in [`Dirs::points`], shared with the opposite direction.
    pub(crate) corners: Range<u32>,
    /// Range of its open convex parts in [`Dirs::pieces`].
    pub(crate) pieces: Range<u32>,
}

/// All directed portals, called directions.
#[derive(Debug)]
pub(crate) struct Dirs {
    /// Number of cells that have a portal. Only these are numbered here, in the graph's order, so that tables of
    /// cells grow with the portals and not with the count in a file.
    pub(crate) n_cells: usize,
    /// For each cell, its number in the graph.
    pub(crate) cells: Vec<u32>,
    /// Number of cells of the graph.
    pub(crate) n_all_cells: usize,
    pub(crate) all: Vec<Dir>,
    /// For each direction, the same portal the other way.
    pub(crate) reverse: Vec<u32>,
    /// For each direction, the number of its portal.
    portals: Vec<u32>,
    /// For each portal, its number in the whole graph.
    names: Vec<u32>,
    /// For each direction, the data used most, side by side: the ball around it (center, radius), its plane (normal,
    /// height half way between `low` and `high`), and the range of exits of the cell that it leads into.
    pub(crate) balls: Vec<[f64; 4]>,
    pub(crate) planes: Vec<[f64; 4]>,
    ahead: Vec<[u32; 2]>,
    /// Directions out of cell `c` are `out_of[c]..out_of[c + 1]`.
    out_of: Vec<u32>,
    /// Ranges of the vertices of each piece in `points`.
    pub(crate) pieces: Vec<Range<u32>>,
    /// Vertices of all windings and pieces.
    pub(crate) points: Vec<DVec3>,
    /// For each vertex of `points`: the inward normal of the edge that starts there, and its offset.
    pub(crate) edges: Vec<(DVec3, f64)>,
    /// Largest absolute coordinate, at least 1e-300. Errors are relative to it.
    pub(crate) scale: f64,
}

/// Smallest group of openings with one normal for which precomputing the heights of all others pays.
const FEW: usize = 4;

impl Dirs {
    /// Takes time and memory linear in the vertices, plus the time to sort the portals.
    pub(crate) fn new(graph: &SightGraph) -> Self {
        let mut cells: Vec<u32> = graph.portals.iter().flat_map(|p| p.cells).collect();
        cells.sort_unstable();
        cells.dedup();
        let mut points = Vec::new();
        let mut edges = Vec::new();
        let mut pieces = Vec::new();
        let mut all = Vec::with_capacity(graph.portals.len() * 2);
        for (i, portal) in graph.portals.iter().enumerate() {
            let turn = unit_normal(&portal.winding);
            let n = portal.winding.len();
            let mut add = |winding: &[DVec3]| {
                let start = points.len() as u32;
                for (k, &p) in winding.iter().enumerate() {
                    let next = winding[(k + 1) % winding.len()];
                    let inward = turn.cross(next - p).normalize_or_zero();
                    edges.push((inward, inward.dot(p)));
                    points.push(p);
                }
                start..points.len() as u32
            };
            let corners = add(&portal.winding);
            let first_piece = pieces.len() as u32;
            if portal.pieces.is_empty() {
                pieces.push(corners.clone());
            }
            pieces.extend(portal.pieces.iter().map(|piece| add(piece)));
            // Both cells are in the list.
            let [a, b] = portal
                .cells
                .map(|c| cells.partition_point(|&other| other < c) as u32);
            let center = portal.winding.iter().sum::<DVec3>() / n as f64;
            let radius = portal
                .winding
                .iter()
                .map(|p| p.distance(center))
                .fold(0.0, f64::max);
            for side in 0..2 {
                let normal = if side == 0 { turn } else { -turn };
                let heights = portal.winding.iter().map(|&p| normal.dot(p));
                all.push(Dir {
                    from: [a, b][side],
                    to: [b, a][side],
                    id: (2 * i + side) as u32,
                    normal,
                    low: heights.clone().fold(f64::INFINITY, f64::min),
                    high: heights.fold(f64::NEG_INFINITY, f64::max),
                    turn,
                    center,
                    radius,
                    corners: corners.clone(),
                    pieces: first_piece..pieces.len() as u32,
                });
            }
        }
        all.sort_by_key(|dir| (dir.from, dir.id));
        let n_cells = cells.len();
        let mut out_of = vec![0u32; n_cells + 1];
        for dir in &all {
            out_of[dir.from as usize + 1] += 1;
        }
        for c in 0..n_cells {
            out_of[c + 1] += out_of[c];
        }
        let mut place = vec![0u32; all.len()];
        for (k, dir) in all.iter().enumerate() {
            place[dir.id as usize] = k as u32;
        }
        let reverse: Vec<u32> = all.iter().map(|dir| place[dir.id as usize ^ 1]).collect();
        let portals = all.iter().map(|dir| dir.id / 2).collect();
        let four = |v: DVec3, w: f64| [v.x, v.y, v.z, w];
        let balls = all.iter().map(|dir| four(dir.center, dir.radius)).collect();
        let plane = |dir: &Dir| four(dir.normal, (dir.low + dir.high) * 0.5);
        let planes = all.iter().map(plane).collect();
        let ahead = all
            .iter()
            .map(|dir| [out_of[dir.to as usize], out_of[dir.to as usize + 1]])
            .collect();
        let scale = points
            .iter()
            .map(|p: &DVec3| p.abs().max_element())
            .fold(1e-300, f64::max);
        Self {
            n_cells,
            cells,
            n_all_cells: graph.n_cells as usize,
            all,
            reverse,
            portals,
            names: (0..graph.portals.len() as u32).collect(),
            balls,
            planes,
            ahead,
            out_of,
            pieces,
            points,
            edges,
            scale,
        }
    }

    /// Takes only some portals of a graph, ascending. Cells, directions and errors are those of the whole: only what the
    /// other portals show is missing.
    pub(crate) fn of_some(graph: &SightGraph, portals: Vec<u32>, scale: f64) -> Self {
        let some = SightGraph {
            n_cells: graph.n_cells,
            portals: (portals.iter())
                .map(|&i| graph.portals[i as usize].clone())
                .collect(),
        };
        Self {
            names: portals,
            scale,
            ..Self::new(&some)
        }
    }

    /// Returns the number of a direction in the whole graph.
    #[inline]
    pub(crate) fn name(&self, dir: usize) -> u32 {
        2 * self.names[self.portals[dir] as usize] + self.all[dir].id % 2
    }

    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.all.len()
    }

    /// Returns the number of cells without a portal. Each sees only itself.
    pub(crate) fn n_alone(&self) -> u64 {
        (self.n_all_cells - self.n_cells) as u64
    }

    /// Returns the directions out of a cell.
    #[inline]
    pub(crate) fn exits(&self, cell: u32) -> Range<usize> {
        self.out_of[cell as usize] as usize..self.out_of[cell as usize + 1] as usize
    }

    /// Returns the directions into a cell.
    #[inline]
    pub(crate) fn entries(&self, cell: u32) -> &[u32] {
        &self.reverse[self.exits(cell)]
    }

    /// Returns the directions out of the cell that a direction leads into.
    #[inline]
    pub(crate) fn after(&self, dir: usize) -> Range<usize> {
        let [start, end] = self.ahead[dir];
        start as usize..end as usize
    }

    /// Returns, as bits, which of the 64 directions from `start` on are in `row` and in `range`.
    #[inline]
    pub(crate) fn window(row: &[u64], range: &Range<usize>, start: usize) -> u64 {
        let n = range.end - start;
        let in_range = if n >= 64 { u64::MAX } else { (1 << n) - 1 };
        bits::window(row, start) & in_range
    }

    #[inline]
    pub(crate) fn winding(&self, dir: usize) -> &[DVec3] {
        let corners = &self.all[dir].corners;
        &self.points[corners.start as usize..corners.end as usize]
    }

    /// Writes the set of directions that lead into the cells of a set.
    pub(crate) fn entries_of(&self, cells: &[u64], out: &mut [u64]) {
        out.fill(0);
        for cell in bits::ones(cells) {
            for &d in self.entries(cell as u32) {
                bits::set(out, d as usize);
            }
        }
    }

    /// Returns for each direction those that a line might cross after it, by sides of planes and the far plane alone.
    ///
    /// Time: a few nanoseconds for each pair of portals, plus directions reached times the exits of a cell.
    pub(crate) fn might_see(&self, clearance: f64, far: Option<f64>) -> BitTable {
        let past = self.past(clearance);
        // For each portal, the directions that have part of it behind them.
        let behind = past.transposed(&self.reverse);
        let n = self.len();
        let mut might = BitTable::new(n, n);
        let n_words = might.n_words().max(1);
        might
            .words_mut()
            .par_chunks_mut(n_words)
            .enumerate()
            .for_each_init(Flood::default, |flood, (first, row)| {
                self.flood(first, (&past, &behind), far, row, flood);
            });
        self.make_symmetric(&mut might);
        might
    }

    fn flood(
        &self,
        first: usize,
        (past, behind): (&BitTable, &BitTable),
        far: Option<f64>,
        row: &mut [u64],
        Flood { left, stack }: &mut Flood,
    ) {
        let in_front = past.row(first);
        // The line crosses the second opening from behind.
        left.clear();
        left.extend_from_slice(behind.row(self.portals[first] as usize));
        // A line crosses a plane once, so it never crosses an opening twice.
        bits::clear(left, first);
        bits::clear(left, self.reverse[first] as usize);
        stack.push(first as u32);
        while let Some(at) = stack.pop() {
            let back = self.reverse[at as usize] as usize;
            let exits = self.after(at as usize);
            for start in exits.clone().step_by(64) {
                let window = Self::window(left, &exits, start);
                bits::clear_window(left, start, window);
                for q in bits::ones_from(start, window) {
                    if q == back {
                        bits::set(left, q);
                    } else if bits::get(in_front, self.portals[q] as usize)
                        && self.is_near(first, q, far)
                    {
                        bits::set(row, q);
                        stack.push(q as u32);
                    }
                }
            }
        }
    }

    /// Returns for each direction the portals that reach far enough in front of its plane to let lines with clearance
    /// through.
    ///
    /// Portals lie in few planes, so heights are computed once for each normal and shared.
    fn past(&self, clearance: f64) -> BitTable {
        let n_portals = self.len() / 2;
        let mut of_id = vec![0u32; self.len()];
        for (d, dir) in self.all.iter().enumerate() {
            of_id[dir.id as usize] = d as u32;
        }
        let mut by_turn: Vec<u32> = (0..self.len() as u32).collect();
        let key = |&d: &u32| self.all[d as usize].turn.to_array().map(f64::to_bits);
        by_turn.sort_by_cached_key(|d| (key(d), *d));
        let groups: Vec<&[u32]> = by_turn.chunk_by(|a, b| key(a) == key(b)).collect();
        let rows: Vec<Vec<(u32, Vec<u64>)>> = groups
            .par_iter()
            .with_max_len(4)
            .map_init(Vec::new, |heights, group| {
                let turn = self.all[group[0] as usize].turn;
                heights.clear();
                if group.len() < FEW {
                    let row = |&d: &u32| (d, self.past_row_alone(d as usize, &of_id, clearance));
                    return group.iter().map(row).collect();
                }
                heights.extend((0..n_portals).map(|i| self.extent(of_id[2 * i] as usize, turn)));
                let rows = group.iter();
                rows.map(|&d| (d, self.past_row(d as usize, heights, &of_id, clearance)))
                    .collect()
            })
            .collect();
        let mut past = BitTable::new(self.len(), n_portals);
        for (d, row) in rows.into_iter().flatten() {
            past.row_mut(d as usize).copy_from_slice(&row);
        }
        past
    }

    /// Returns the least and greatest height of an opening along a direction.
    fn extent(&self, d: usize, axis: DVec3) -> [f64; 2] {
        let mut extent = [f64::INFINITY, f64::NEG_INFINITY];
        for &p in self.winding(d) {
            let height = axis.dot(p);
            extent = [extent[0].min(height), extent[1].max(height)];
        }
        extent
    }

    /// Computes [`Dirs::past_row`] from the balls around openings, and from their vertices where the balls do not
    /// decide.
    fn past_row_alone(&self, d: usize, of_id: &[u32], clearance: f64) -> Vec<u64> {
        let mut row = vec![0; (of_id.len() / 2).div_ceil(64)];
        for (k, pair) in of_id.chunks_exact(2).enumerate() {
            let is_past = self.is_past(d, pair[0] as usize, clearance);
            row[k / 64] |= u64::from(is_past) << (k % 64);
        }
        row
    }

    /// Returns `true` if an opening reaches far enough in front of another's plane to let lines with clearance through.
    #[inline]
    pub(crate) fn is_past(&self, d: usize, other: usize, clearance: f64) -> bool {
        let dir = &self.all[d];
        let slack = 1e-12 * self.scale;
        let [x, y, z, radius] = self.balls[other];
        let height = dir.normal.dot(DVec3::new(x, y, z)) - dir.low;
        dir.normal == DVec3::ZERO
            || height > clearance + slack
            || height + radius > -slack && {
                let corners = self.winding(other).iter().map(|&p| dir.normal.dot(p));
                let reach = corners.fold(f64::NEG_INFINITY, f64::max) - dir.low;
                reach > clearance
                    || reach > 0.0 && reach > clearance * sine(dir.normal, self.all[other].turn)
            }
    }

    fn past_row(&self, d: usize, heights: &[[f64; 2]], of_id: &[u32], clearance: f64) -> Vec<u64> {
        let dir = &self.all[d];
        // An opening without area has no sides.
        let no_sides = dir.normal == DVec3::ZERO;
        let is_turned = dir.normal != dir.turn;
        let words = heights.chunks(64).enumerate().map(|(w, heights)| {
            let (mut sure, mut perhaps) = (0, 0);
            for (k, &[low, high]) in heights.iter().enumerate() {
                let highest = if is_turned { -low } else { high };
                let reach = highest - dir.low;
                sure |= u64::from(no_sides || reach > clearance) << k;
                perhaps |= u64::from(reach > 0.0) << k;
            }
            let mut rest = perhaps & !sure;
            while rest != 0 {
                let k = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                let [low, high] = heights[k];
                let highest = if is_turned { -low } else { high };
                let other = &self.all[of_id[2 * (64 * w + k)] as usize];
                let need = clearance * sine(dir.normal, other.turn);
                sure |= u64::from(highest - dir.low > need) << k;
            }
            sure
        });
        words.collect()
    }

    /// Returns `true` if the balls around two openings are within the far plane's distance of each other. A line from
    /// the first cell to behind `next` crosses both openings.
    #[inline]
    pub(crate) fn is_near(&self, first: usize, next: usize, far: Option<f64>) -> bool {
        let (a, b) = (&self.all[first], &self.all[next]);
        far.is_none_or(|far| a.center.distance(b.center) - a.radius - b.radius <= far)
    }

    /// Clears all pairs that are not visible both ways.
    pub(crate) fn make_symmetric(&self, might: &mut BitTable) {
        let seen_by = might.transposed(&self.reverse);
        let n_words = might.n_words().max(1);
        let rows = might.words_mut().par_chunks_mut(n_words).enumerate();
        rows.for_each(|(a, row)| {
            let seen_back = seen_by.row(self.reverse[a] as usize);
            for (word, &back) in row.iter_mut().zip(seen_back) {
                *word &= back;
            }
        });
    }
}

/// For each direction, which of the next exits a line through it might take.
///
/// A compact copy of some bits of the table of what might be seen, whose rows lie far apart in memory.
#[derive(Debug)]
pub(crate) struct Next(Vec<u64>);

impl Next {
    pub(crate) fn new(dirs: &Dirs, might: &BitTable) -> Self {
        let masks = (0..dirs.len()).map(|d| {
            let exits = dirs.after(d);
            Dirs::window(might.row(d), &exits, exits.start)
        });
        Self(masks.collect())
    }

    /// Returns, as bits, which of the 64 exits behind `d` from `start` on a line through `d` might take.
    #[inline]
    pub(crate) fn window(
        &self,
        might: &BitTable,
        d: usize,
        exits: &Range<usize>,
        start: usize,
    ) -> u64 {
        if start == exits.start {
            return self.0[d];
        }
        Dirs::window(might.row(d), exits, start)
    }

    /// Records, in `might` too, that no line passes `source` and then one of `hidden`, nor the same way back.
    pub(crate) fn hide(
        &mut self,
        dirs: &Dirs,
        might: &mut BitTable,
        source: usize,
        hidden: &[u64],
    ) {
        let back = dirs.reverse[source] as usize;
        for t in bits::ones(hidden) {
            might.clear(dirs.reverse[t] as usize, back);
        }
        for (word, &hidden) in might.row_mut(source).iter_mut().zip(hidden) {
            *word &= !hidden;
        }
        // Only the bits of the exits behind `source`, and of the way back from them, are copied here.
        let exits = dirs.after(source);
        self.0[source] &= !bits::window(hidden, exits.start);
        let place = back - exits.start;
        for start in exits.clone().step_by(64).filter(|_| place < 64) {
            for t in bits::ones_from(start, Dirs::window(hidden, &exits, start)) {
                self.0[dirs.reverse[t] as usize] &= !(1 << place);
            }
        }
    }
}

/// Buffers of a flood, kept between floods.
#[derive(Default)]
struct Flood {
    /// Directions not tested yet among those that have the first opening behind them.
    left: Vec<u64>,
    stack: Vec<u32>,
}

/// Returns the sine of the angle between two planes with unit normals.
#[inline]
pub(crate) fn sine(a: DVec3, b: DVec3) -> f64 {
    let cosine = a.dot(b);
    (1.0 - cosine * cosine).max(0.0).sqrt()
}

/// Returns the unit normal about which the vertices run counter-clockwise, by Newell's sum; zero if rounding swamps
/// their area.
fn unit_normal(winding: &[DVec3]) -> DVec3 {
    let o = winding[0];
    let sum: DVec3 = winding.windows(2).map(|e| (e[0] - o).cross(e[1] - o)).sum();
    let reach = winding
        .iter()
        .map(|p| p.distance_squared(o))
        .fold(0.0, f64::max);
    if sum.length() > 1e-12 * reach {
        sum.normalize_or_zero()
    } else {
        DVec3::ZERO
    }
}

#[cfg(test)]
mod tests;
