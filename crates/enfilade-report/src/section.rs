//! A section of a world: the cells on a plane, as outlines.
//!
//! The locator is queried on a grid, each point at the height of its cut; the borders between the resulting labels
//! are traced and simplified. Borders are cut at the points where three labels meet and simplified piece by piece,
//! each the same way from both sides, so that neighbors still share them.

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, World};
use enfilade_geom::{DVec2, DVec3};

use crate::storeys::Page;

/// Cuts are raised by this, so that they avoid model planes at exactly their height.
const OFF_PLANES: f64 = 1.37e-4;
/// Solid matter is drawn up to this far from a room: walls and floors, but not the rock around the level of a game.
/// [Units: wu]
const WALL: f64 = 1.0;
/// Most grid points along the longer side.
const MAX_SIDE: f64 = 1200.0;
/// Finest grid. [Units: wu]
const FINEST: f64 = 0.02;

/// Marks a point at which nothing is drawn.
const NO_CUT: u16 = u16::MAX;

/// The label of a grid point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Label {
    Outdoor,
    Solid,
    /// A space in which nobody can stand.
    Void,
    /// A cell of another storey, seen from this one: the upper part of a hall.
    Beyond(u32),
    Cell(u32),
}

/// The cuts that may apply at each place, the most likely first.
struct Candidates {
    min: DVec2,
    tile: f64,
    width: usize,
    by_tile: Vec<Vec<u16>>,
}

impl Candidates {
    fn new(world: &World, page: &Page, min: DVec2, max: DVec2) -> Self {
        let tile = page.tile;
        let min = (min / tile).floor();
        let size = (max / tile).floor() - min + 1.0;
        let (width, height) = (size.x as usize, size.y as usize);
        let mut by_tile = vec![Vec::new(); width * height];
        let place = |(x, z): (i32, i32)| {
            let (x, z) = (f64::from(x) - min.x, f64::from(z) - min.y);
            let is_inside = x >= 0.0 && z >= 0.0 && x < size.x && z < size.y;
            is_inside.then(|| z as usize * width + x as usize)
        };
        // Small cuts first: they would be lost under large ones.
        let mut order: Vec<u16> = (0..page.cuts.len().min(usize::from(NO_CUT)) as u16).collect();
        let cut = |k: u16| &page.cuts[usize::from(k)];
        order.sort_by_key(|&k| (cut(k).tiles.len(), k));
        for &k in &order {
            for at in cut(k).tiles.iter().filter_map(|&t| place(t)) {
                by_tile[at].push(k);
            }
        }
        // A cell reaches farther than its floor: over furniture, under a stair, into a window.
        for &k in &order {
            for cell in cut(k).tops.keys() {
                let corner = |p: [f32; 3]| {
                    let at = DVec2::new(p[0].into(), p[2].into()) / tile;
                    (at.floor() - min).clamp(DVec2::ZERO, size - 1.0)
                };
                let [low, high] = world.graph[*cell].aabb.map(corner);
                for z in low.y as usize..=high.y as usize {
                    for x in low.x as usize..=high.x as usize {
                        let list: &mut Vec<u16> = &mut by_tile[z * width + x];
                        if !list.contains(&k) {
                            list.push(k);
                        }
                    }
                }
            }
        }
        Self {
            min,
            tile,
            width,
            by_tile,
        }
    }

    fn of(&self, x: f64, z: f64) -> &[u16] {
        let at = (DVec2::new(x, z) / self.tile).floor() - self.min;
        let i = at.y.max(0.0) as usize * self.width + at.x.max(0.0) as usize;
        self.by_tile.get(i).map_or(&[], Vec::as_slice)
    }
}

/// The heights of a page's cuts. [Units: wu]
pub(crate) fn heights(page: &Page, cut_height: f64) -> Vec<f64> {
    let height = |at: Option<f64>, floor: f64| at.unwrap_or(floor + cut_height) + OFF_PLANES;
    page.cuts.iter().map(|c| height(c.at, c.floor)).collect()
}

/// The cell of a label, and `true` if it belongs to the storey.
pub(crate) fn cell_of(label: Label) -> Option<(CellId, bool)> {
    match label {
        Label::Cell(id) => Some((CellId(id), true)),
        Label::Beyond(id) => Some((CellId(id), false)),
        Label::Outdoor | Label::Solid | Label::Void => None,
    }
}

/// Border edges by their start vertex.
type Edges = BTreeMap<(i64, i64), Vec<(i64, i64)>>;

/// The labels of a grid; rows along z, columns along x.
pub(crate) struct Section {
    origin: DVec2,
    step: f64,
    width: usize,
    height: usize,
    labels: Vec<Label>,
    /// The cut that decided each point.
    cuts: Vec<u16>,
}

/// The area that a cell covers on the section.
pub(crate) struct Region {
    /// Closed borders, outer and inner alike, to be filled by the even-odd rule. [Units: wu, x and z]
    pub(crate) borders: Vec<Vec<DVec2>>,
    /// [Units: wu²]
    pub(crate) area: f64,
    /// A point well inside.
    pub(crate) inner: DVec2,
    /// The first column and row that it reaches; then the number of columns and rows.
    pub(crate) first: [usize; 2],
    pub(crate) size: [usize; 2],
}

impl Section {
    /// Samples a page over the rectangle `min` to `max` (x and z); `heights` are those of its cuts.
    pub(crate) fn sample(
        world: &World,
        page: &Page,
        heights: &[f64],
        min: DVec2,
        max: DVec2,
    ) -> Self {
        let size = max - min;
        let step = (size.max_element() / MAX_SIDE).max(FINEST);
        let (width, height) = (
            (size.x / step).ceil() as usize,
            (size.y / step).ceil() as usize,
        );
        let candidates = Candidates::new(world, page, min, max);
        let mut out = Self {
            origin: min,
            step,
            width,
            height,
            labels: Vec::with_capacity(width * height),
            cuts: Vec::with_capacity(width * height),
        };
        for row in 0..height {
            for column in 0..width {
                let x = min.x + (column as f64 + 0.5) * step;
                let z = min.y + (row as f64 + 0.5) * step;
                let at = |k: u16| {
                    let p = DVec3::new(x, heights[usize::from(k)], z);
                    world.graph.locator.locate(p)
                };
                let shown = candidates.of(x, z).iter().find_map(|&k| {
                    let cell = at(k)?;
                    let tops = &page.cuts[usize::from(k)].tops;
                    tops.contains_key(&cell).then_some((Label::Cell(cell.0), k))
                });
                let (label, cut) = shown.unwrap_or_else(|| {
                    let label = match at(0) {
                        None => Label::Solid,
                        Some(c) if world.graph[c].outdoor => Label::Outdoor,
                        Some(c) if world.graph[c].is_void => Label::Void,
                        Some(c) => Label::Beyond(c.0),
                    };
                    (label, 0)
                });
                out.labels.push(label);
                out.cuts.push(cut);
            }
        }
        out.drop_rock();
        out
    }

    /// Turns solid matter far from every room into paper.
    fn drop_rock(&mut self) {
        let is_room = |l: &Label| matches!(l, Label::Cell(_) | Label::Beyond(_));
        let mut is_near: Vec<bool> = self.labels.iter().map(is_room).collect();
        let mut round: Vec<usize> = (0..is_near.len()).filter(|&i| is_near[i]).collect();
        for _ in 0..(WALL / self.step).ceil() as usize {
            let mut next = Vec::new();
            for i in round {
                let (row, column) = (i / self.width, i % self.width);
                let sides = [
                    (column > 0).then(|| i - 1),
                    (column + 1 < self.width).then_some(i + 1),
                    (row > 0).then(|| i - self.width),
                    (row + 1 < self.height).then_some(i + self.width),
                ];
                for side in sides.into_iter().flatten() {
                    if !is_near[side] && self.labels[side] == Label::Solid {
                        is_near[side] = true;
                        next.push(side);
                    }
                }
            }
            round = next;
        }
        for (i, is_near) in is_near.into_iter().enumerate() {
            if self.labels[i] == Label::Solid && !is_near {
                (self.labels[i], self.cuts[i]) = (Label::Outdoor, NO_CUT);
            }
        }
    }

    /// Spacing of the grid. [Units: wu]
    pub(crate) fn step(&self) -> f64 {
        self.step
    }

    /// Returns `true` if a point of the grid has this label.
    pub(crate) fn is(&self, label: Label, column: usize, row: usize) -> bool {
        self.labels[row * self.width + column] == label
    }

    /// The start of a column and a row. [Units: wu]
    pub(crate) fn corner(&self, column: usize, row: usize) -> DVec2 {
        self.origin + DVec2::new(column as f64, row as f64) * self.step
    }

    /// The index of the grid point that contains `p`, if it is in the rectangle.
    fn index(&self, p: DVec2) -> Option<usize> {
        let at = ((p - self.origin) / self.step).floor();
        let is_inside =
            at.x >= 0.0 && at.y >= 0.0 && at.x < self.width as f64 && at.y < self.height as f64;
        is_inside.then(|| at.y as usize * self.width + at.x as usize)
    }

    /// The label at `p`.
    pub(crate) fn label_at(&self, p: DVec2) -> Label {
        self.index(p).map_or(Label::Outdoor, |i| self.labels[i])
    }

    /// The page, and eight times its size around it: nothing beyond is cut.
    pub(crate) fn surroundings(&self) -> [DVec2; 2] {
        let size = DVec2::new(self.width as f64, self.height as f64) * self.step;
        let around = 8.0 * size.max_element();
        [self.origin - around, self.origin + size + around]
    }

    /// Returns `true` if a point near `p`, a border point of its part of the page, is cut by cut `k`.
    pub(crate) fn is_cut_by(&self, k: usize, p: DVec2) -> bool {
        // A wall thinner than the grid is visible from its sides only.
        let reach = 1.5 * self.step;
        let around = [
            DVec2::ZERO,
            DVec2::X * reach,
            DVec2::NEG_X * reach,
            DVec2::Y * reach,
            DVec2::NEG_Y * reach,
        ];
        around.into_iter().any(|d| {
            let at = self.index(p + d);
            at.is_some_and(|i| usize::from(self.cuts[i]) == k)
        })
    }

    fn label(&self, column: i64, row: i64) -> Label {
        let is_inside =
            (0..self.width as i64).contains(&column) && (0..self.height as i64).contains(&row);
        if is_inside {
            self.labels[row as usize * self.width + column as usize]
        } else {
            Label::Outdoor
        }
    }

    fn at(&self, corner: (i64, i64)) -> DVec2 {
        self.origin + DVec2::new(corner.0 as f64, corner.1 as f64) * self.step
    }

    /// Returns slanting lines across the voids, at about this distance. [Units: wu]
    pub(crate) fn hatching(&self, distance: f64) -> Vec<Vec<DVec2>> {
        let (width, height) = (self.width as i64, self.height as i64);
        let every = ((distance * std::f64::consts::SQRT_2 / self.step) as usize).max(2);
        let mut lines = Vec::new();
        for sum in (0..width + height).step_by(every) {
            // Down to the left, from square to square; one more ends the last line.
            let mut begin = None;
            for row in 0..=height {
                let is_void = self.label(sum - row, row) == Label::Void;
                match begin {
                    None if is_void => begin = Some(row),
                    Some(from) if !is_void => {
                        let ends = [from, row].map(|row| self.at((sum - row + 1, row)));
                        lines.push(ends.to_vec());
                        begin = None;
                    }
                    _ => {}
                }
            }
        }
        lines
    }

    /// Every label except the outdoors, with its region.
    pub(crate) fn regions(&self) -> BTreeMap<Label, Region> {
        let mut edges = self.border_edges();
        let depth = self.depths();
        let mut regions: BTreeMap<Label, Region> = BTreeMap::new();
        let mut deepest: BTreeMap<Label, (u32, usize)> = BTreeMap::new();
        let mut counts: BTreeMap<Label, usize> = BTreeMap::new();
        let mut boxes: BTreeMap<Label, [[usize; 2]; 2]> = BTreeMap::new();
        for (i, &label) in self.labels.iter().enumerate() {
            *counts.entry(label).or_default() += 1;
            let at = [i % self.width, i / self.width];
            let [low, high] = boxes.entry(label).or_insert([at, at]);
            for k in 0..2 {
                low[k] = low[k].min(at[k]);
                high[k] = high[k].max(at[k]);
            }
            let best = deepest.entry(label).or_insert((0, i));
            if depth[i] > best.0 {
                *best = (depth[i], i);
            }
        }
        for (label, count) in counts {
            if label == Label::Outdoor {
                continue;
            }
            let (_, i) = deepest[&label];
            let [first, last] = boxes[&label];
            let (row, column) = ((i / self.width) as f64 + 0.5, (i % self.width) as f64 + 0.5);
            let borders = edges
                .remove(&label)
                .map_or_else(Vec::new, |e| self.trace(e));
            regions.insert(
                label,
                Region {
                    borders,
                    area: count as f64 * self.step * self.step,
                    inner: self.origin + DVec2::new(column, row) * self.step,
                    first,
                    size: [last[0] + 1 - first[0], last[1] + 1 - first[1]],
                },
            );
        }
        regions
    }

    /// Border edges of each label, from vertex to vertex, with the label on the right as drawn.
    fn border_edges(&self) -> BTreeMap<Label, Edges> {
        let mut out: BTreeMap<Label, Edges> = BTreeMap::new();
        for row in 0..self.height as i64 {
            for column in 0..self.width as i64 {
                let label = self.label(column, row);
                if label == Label::Outdoor {
                    continue;
                }
                let corners = [
                    (column, row),
                    (column + 1, row),
                    (column + 1, row + 1),
                    (column, row + 1),
                ];
                let sides = [(0, -1), (1, 0), (0, 1), (-1, 0)];
                for k in 0..4 {
                    if self.label(column + sides[k].0, row + sides[k].1) != label {
                        let starts = out.entry(label).or_default();
                        starts
                            .entry(corners[k])
                            .or_default()
                            .push(corners[(k + 1) % 4]);
                    }
                }
            }
        }
        out
    }

    /// Returns `true` if borders of more than two regions, or two borders, meet at a vertex.
    fn is_junction(&self, (x, z): (i64, i64)) -> bool {
        let around = [
            self.label(x - 1, z - 1),
            self.label(x, z - 1),
            self.label(x, z),
            self.label(x - 1, z),
        ];
        (0..4).filter(|&k| around[k] != around[(k + 1) % 4]).count() > 2
    }

    /// Links edges into closed borders and simplifies them.
    fn trace(&self, mut edges: Edges) -> Vec<Vec<DVec2>> {
        let mut borders = Vec::new();
        while let Some((&start, _)) = edges.first_key_value() {
            let (mut path, mut at, mut heading) = (Vec::new(), start, (0, 0));
            while let Some(nexts) = edges.get_mut(&at) {
                // There are two continuations where the label touches itself at a vertex: turn right, which stays at
                // the same square.
                let right = (at.0 - heading.1, at.1 + heading.0);
                let k = nexts
                    .iter()
                    .position(|&n| n == right)
                    .unwrap_or(nexts.len() - 1);
                let next = nexts.swap_remove(k);
                if nexts.is_empty() {
                    edges.remove(&at);
                }
                path.push(at);
                heading = (next.0 - at.0, next.1 - at.1);
                at = next;
                if at == start {
                    break;
                }
            }
            borders.push(self.simplified(path));
        }
        borders
    }

    /// Simplifies a closed border between its junctions.
    fn simplified(&self, mut path: Vec<(i64, i64)>) -> Vec<DVec2> {
        // Without junctions, the smallest vertex and the one farthest from it stay.
        let mut fixed: Vec<usize> = (0..path.len())
            .filter(|&i| self.is_junction(path[i]))
            .collect();
        if fixed.is_empty() {
            let least = (0..path.len()).min_by_key(|&i| path[i]).unwrap_or(0);
            path.rotate_left(least);
            fixed.push(0);
        }
        path.rotate_left(fixed[0]);
        let first = fixed[0];
        let mut stops: Vec<usize> = fixed.iter().map(|i| i - first).collect();
        stops.push(path.len());
        path.push(path[0]);
        let mut out = Vec::new();
        for stop in stops.windows(2) {
            let mut arc: Vec<DVec2> = path[stop[0]..=stop[1]]
                .iter()
                .map(|&c| self.at(c))
                .collect();
            // The neighbor walks the other way; both simplify from the same end.
            let ends = (path[stop[0]], path[stop[1]]);
            let next = (path[stop[0] + 1], path[stop[1] - 1]);
            let is_reversed = (ends.1, next.1) < (ends.0, next.0);
            if is_reversed {
                arc.reverse();
            }
            // The vertices of a slanted line's steps lie up to √2 steps apart across it.
            let mut kept = simplify(&arc, 1.5 * self.step);
            if is_reversed {
                kept.reverse();
            }
            kept.pop();
            out.extend(kept);
        }
        out
    }

    /// Steps from each grid point to the nearest one of another label, in rounds over the four neighbors.
    fn depths(&self) -> Vec<u32> {
        let (w, h) = (self.width as i64, self.height as i64);
        let mut depth = vec![0_u32; self.labels.len()];
        let mut round: Vec<(i64, i64)> = Vec::new();
        let sides = [(0, -1), (1, 0), (0, 1), (-1, 0)];
        for row in 0..h {
            for column in 0..w {
                let label = self.label(column, row);
                // Points beyond the grid count as another label, even for a region that reaches its rim.
                let is_border = sides.iter().any(|s| {
                    let (c, r) = (column + s.0, row + s.1);
                    !(0..w).contains(&c) || !(0..h).contains(&r) || self.label(c, r) != label
                });
                if is_border {
                    depth[(row * w + column) as usize] = 1;
                    round.push((column, row));
                }
            }
        }
        let mut steps = 1;
        while !round.is_empty() {
            steps += 1;
            let mut next = Vec::new();
            for (column, row) in round {
                for s in sides {
                    let (c, r) = (column + s.0, row + s.1);
                    if (0..w).contains(&c) && (0..h).contains(&r) {
                        let i = (r * w + c) as usize;
                        if depth[i] == 0 {
                            depth[i] = steps;
                            next.push((c, r));
                        }
                    }
                }
            }
            round = next;
        }
        depth
    }
}

/// Ramer–Douglas–Peucker: the fewest of the points, ends kept, that stay within `tolerance`.
fn simplify(points: &[DVec2], tolerance: f64) -> Vec<DVec2> {
    let mut keep = vec![false; points.len()];
    keep[0] = true;
    keep[points.len() - 1] = true;
    let mut work = vec![(0, points.len() - 1)];
    while let Some((first, last)) = work.pop() {
        let (a, b) = (points[first], points[last]);
        let along = b - a;
        let length = along.length();
        let distance = |p: DVec2| {
            // A closed arc has no line; use the distance from its end.
            if length > 0.0 {
                along.perp_dot(p - a).abs() / length
            } else {
                p.distance(a)
            }
        };
        let mut worst = (tolerance, 0);
        for (i, &p) in points.iter().enumerate().take(last).skip(first + 1) {
            let d = distance(p);
            if d > worst.0 {
                worst = (d, i);
            }
        }
        if worst.1 > 0 {
            keep[worst.1] = true;
            work.extend([(first, worst.1), (worst.1, last)]);
        }
    }
    points
        .iter()
        .zip(keep)
        .filter(|(_, k)| *k)
        .map(|(p, _)| *p)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbors_share_every_point_of_a_jagged_border() {
        let (width, height) = (120, 90);
        let label = |i: usize| {
            // Uneven teeth: many vertices are equally far from a line, so that the direction of walking decides which
            // is kept.
            let (x, z) = (i % width, i / width);
            Label::Cell(u32::from(x > 50 + z * z % 7 % 4))
        };
        let section = Section {
            origin: DVec2::ZERO,
            step: 0.1,
            width,
            height,
            labels: (0..width * height).map(label).collect(),
            cuts: vec![0; width * height],
        };
        let regions = section.regions();
        let inner = |cell: u32| -> Vec<DVec2> {
            let borders = regions[&Label::Cell(cell)].borders.iter().flatten();
            borders
                .copied()
                .filter(|p| p.x > 0.01 && p.x < 11.99)
                .collect()
        };
        let (mut left, mut right) = (inner(0), inner(1));
        let order = |a: &DVec2, b: &DVec2| a.y.total_cmp(&b.y).then(a.x.total_cmp(&b.x));
        left.sort_by(order);
        right.sort_by(order);
        assert!(left.len() > 10 && left.len() < 200, "{}", left.len());
        assert_eq!(left, right);
        let area: f64 = regions.values().map(|r| r.area).sum();
        assert!((area - 12.0 * 9.0).abs() < 1e-9);
    }
}
