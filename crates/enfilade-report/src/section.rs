//! A section of a world: the cells on a plane, as outlines.
//!
//! The locator is queried on a grid, each point at the height of its cut.

use std::ops::Range;

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

/// The labels of a grid; rows along z, columns along x.
pub(crate) struct Section {
    pub(crate) origin: DVec2,
    pub(crate) step: f64,
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) labels: Vec<Label>,
    /// The cut that decided each point.
    cuts: Vec<u16>,
    /// `true` where something stands or is drawn, and no name should be.
    taken: Vec<bool>,
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
            taken: vec![false; width * height],
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

    /// Number of grid points.
    pub(crate) fn n_points(&self) -> usize {
        self.labels.len()
    }

    /// Returns the index of a grid point.
    pub(crate) fn number(&self, column: usize, row: usize) -> usize {
        row * self.width + column
    }

    /// Returns the position of a grid point. [Units: wu]
    pub(crate) fn center(&self, column: usize, row: usize) -> DVec2 {
        self.corner(column, row) + 0.5 * self.step
    }

    /// Returns the columns and rows of the grid points in a box; `None` if it lies beside the grid.
    pub(crate) fn points_in(&self, low: DVec2, high: DVec2) -> Option<[Range<usize>; 2]> {
        let size = DVec2::new(self.width as f64, self.height as f64);
        let low = ((low - self.origin) / self.step - 0.5)
            .ceil()
            .max(DVec2::ZERO);
        let high = ((high - self.origin) / self.step + 0.5).ceil().min(size);
        let is_in = low.x < high.x && low.y < high.y;
        let columns = low.x as usize..high.x as usize;
        let rows = low.y as usize..high.y as usize;
        is_in.then_some([columns, rows])
    }

    /// Returns the grid points to the right of a point and below it.
    pub(crate) fn next_points(&self, i: usize) -> impl Iterator<Item = usize> + use<> {
        let (row, column) = (i / self.width, i % self.width);
        let right = (column + 1 < self.width).then_some(i + 1);
        let below = (row + 1 < self.height).then_some(i + self.width);
        [right, below].into_iter().flatten()
    }

    /// Returns the height of the cut at each grid point; negative infinity outside of the rooms. [Units: wu]
    pub(crate) fn cut_heights(&self, heights: &[f64]) -> Vec<f64> {
        let cuts = self.labels.iter().zip(&self.cuts);
        cuts.map(|(label, &cut)| match label {
            Label::Cell(_) | Label::Beyond(_) => heights[usize::from(cut)],
            Label::Outdoor | Label::Solid | Label::Void => f64::NEG_INFINITY,
        })
        .collect()
    }

    /// Returns the same grid with other labels.
    pub(crate) fn relabeled(&self, labels: Vec<Label>) -> Self {
        Self {
            labels,
            cuts: Vec::new(),
            taken: Vec::new(),
            ..*self
        }
    }

    /// Returns `true` if nothing stands or is drawn at a grid point.
    pub(crate) fn is_free(&self, column: usize, row: usize) -> bool {
        !self.taken[self.number(column, row)]
    }

    /// Keeps names away from grid points.
    pub(crate) fn take(&mut self, is_taken: impl Fn(usize) -> bool) {
        for (i, taken) in self.taken.iter_mut().enumerate() {
            *taken |= is_taken(i);
        }
    }

    /// Keeps names away from a line.
    pub(crate) fn take_line(&mut self, a: DVec2, b: DVec2) {
        let n = (a.distance(b) / self.step).ceil().clamp(1.0, 1e5) as usize;
        for k in 0..=n {
            if let Some(i) = self.index(a + (b - a) * (k as f64 / n as f64)) {
                self.taken[i] = true;
            }
        }
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

    pub(crate) fn label(&self, column: i64, row: i64) -> Label {
        let is_inside =
            (0..self.width as i64).contains(&column) && (0..self.height as i64).contains(&row);
        if is_inside {
            self.labels[row as usize * self.width + column as usize]
        } else {
            Label::Outdoor
        }
    }

    pub(crate) fn at(&self, corner: (i64, i64)) -> DVec2 {
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
            taken: Vec::new(),
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
