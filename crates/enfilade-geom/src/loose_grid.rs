//! Boxes that move, by their places: finds those near a box in time that does not grow with their number.
//!
//! A loose grid in levels (Ulrich, "Loose octrees", Game Programming Gems, 2000): each box is listed once, by its center, in the
//! level whose cells are as wide as its longest side, hence sticks out of its cell by half a cell at most. The lists are chains
//! through one table of buckets, so that moving a box allocates nothing. A query that covers more cells of a level than there
//! are boxes in it tests these boxes instead.

use crate::{Aabb, DVec3};

const NONE: u32 = u32::MAX;

/// Levels of the narrowest and widest cells, powers of two: smaller boxes share the first, and beyond the last everything is
/// one cell. [Units: wu, as an exponent]
const LEVELS: [f64; 2] = [-10.0, 50.0];

/// Boxes with numbers from 0 on, in a loose grid.
#[derive(Clone, Debug, Default)]
pub struct LooseGrid {
    /// Per box.
    entries: Vec<BoxEntry>,
    /// First box of each bucket; a power of two.
    heads: Vec<u32>,
    /// Each level in use with the number of its boxes.
    levels: Vec<(i32, u32)>,
}

#[derive(Clone, Debug)]
struct BoxEntry {
    bounds: Aabb,
    /// `None` for an empty box.
    key: Option<Key>,
    before: u32,
    next: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Key {
    level: i32,
    at: [i64; 3],
}

impl Key {
    fn of(bounds: &Aabb) -> Option<Self> {
        if bounds.is_empty() {
            return None;
        }
        let level = bounds.size().max_element().log2().ceil();
        let level = level.clamp(LEVELS[0], LEVELS[1]) as i32;
        let at = cell_of(bounds.center(), side_of(level));
        Some(Self { level, at })
    }

    fn bucket(&self, n: usize) -> usize {
        // Mixes all bits into the upper ones (Knuth 1973, section 6.4: multiplication by the golden ratio).
        let mix = |h: u64, x: u64| (h ^ x).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(29);
        let at = self.at.iter().fold(0, |h, &x| mix(h, x as u64));
        mix(at, self.level as u64) as usize & (n - 1)
    }
}

fn side_of(level: i32) -> f64 {
    f64::from(level).exp2()
}

fn cell_of(p: DVec3, side: f64) -> [i64; 3] {
    (p / side).floor().to_array().map(|x| x as i64)
}

impl LooseGrid {
    /// Adds the next box; an empty one is near to none. O(1) on average.
    pub fn push(&mut self, bounds: Aabb) {
        self.entries.push(BoxEntry {
            bounds: Aabb::EMPTY,
            key: None,
            before: NONE,
            next: NONE,
        });
        let last = self.entries.len() as u32 - 1;
        if self.entries.len() * 2 > self.heads.len() {
            let n = (self.entries.len() * 4).next_power_of_two();
            self.heads.clear();
            self.heads.resize(n, NONE);
            for at in 0..last {
                self.link(at);
            }
        }
        self.set(last, bounds);
    }

    /// Removes the last box.
    pub fn pop(&mut self) {
        if let Some(last) = self.entries.len().checked_sub(1) {
            self.set(last as u32, Aabb::EMPTY);
            self.entries.pop();
        }
    }

    /// Returns a box.
    ///
    /// # Panics
    ///
    /// If there is no box of this number, as [`LooseGrid::set`] does.
    #[must_use]
    pub fn bounds(&self, number: u32) -> &Aabb {
        &self.entries[number as usize].bounds
    }

    /// Moves a box. O(1).
    pub fn set(&mut self, number: u32, bounds: Aabb) {
        let key = Key::of(&bounds);
        let entry = &mut self.entries[number as usize];
        entry.bounds = bounds;
        if entry.key == key {
            return;
        }
        self.unlink(number);
        self.entries[number as usize].key = key;
        self.link(number);
        let Some(key) = key else { return };
        match self.levels.iter_mut().find(|l| l.0 == key.level) {
            Some(level) => level.1 += 1,
            None => self.levels.push((key.level, 1)),
        }
    }

    fn link(&mut self, at: u32) {
        let Some(key) = self.entries[at as usize].key else {
            return;
        };
        let head = key.bucket(self.heads.len());
        let next = std::mem::replace(&mut self.heads[head], at);
        if next != NONE {
            self.entries[next as usize].before = at;
        }
        let entry = &mut self.entries[at as usize];
        (entry.before, entry.next) = (NONE, next);
    }

    fn unlink(&mut self, at: u32) {
        let BoxEntry {
            key, before, next, ..
        } = self.entries[at as usize];
        let Some(key) = key else { return };
        if before == NONE {
            let head = key.bucket(self.heads.len());
            self.heads[head] = next;
        } else {
            self.entries[before as usize].next = next;
        }
        if next != NONE {
            self.entries[next as usize].before = before;
        }
        if let Some(level) = self.levels.iter_mut().find(|l| l.0 == key.level) {
            level.1 -= 1;
        }
    }

    /// Calls `visit` with the boxes that overlap `bounds`, each once, in no order.
    pub fn for_each_near(&self, bounds: &Aabb, mut visit: impl FnMut(u32)) {
        if bounds.is_empty() {
            return;
        }
        for &(level, n_boxes) in self.levels.iter().filter(|l| l.1 > 0) {
            let side = side_of(level);
            let reach = bounds.expanded(0.5 * side);
            let [low, high] = [reach.min, reach.max].map(|p| cell_of(p, side));
            let n_cells = [0, 1, 2].map(|k| high[k] as f64 - low[k] as f64 + 1.0);
            if n_cells.iter().product::<f64>() > 8.0 + f64::from(n_boxes) {
                self.near_in_level(level, bounds, &mut visit);
                continue;
            }
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    for z in low[2]..=high[2] {
                        let at = [x, y, z];
                        self.near_in_cell(Key { level, at }, bounds, &mut visit);
                    }
                }
            }
        }
    }

    fn near_in_cell(&self, key: Key, bounds: &Aabb, visit: &mut impl FnMut(u32)) {
        let mut at = self.heads[key.bucket(self.heads.len())];
        while let Some(entry) = self.entries.get(at as usize) {
            if entry.key == Some(key) && entry.bounds.overlaps(bounds) {
                visit(at);
            }
            at = entry.next;
        }
    }

    fn near_in_level(&self, level: i32, bounds: &Aabb, visit: &mut impl FnMut(u32)) {
        for (number, entry) in (0..).zip(&self.entries) {
            let is_of_level = entry.key.is_some_and(|key| key.level == level);
            if is_of_level && entry.bounds.overlaps(bounds) {
                visit(number);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_testkit::Rng;

    fn random_box(rng: &mut Rng) -> Aabb {
        let mut vector =
            |reach: f64| DVec3::from_array([0, 1, 2].map(|_| rng.range(-reach, reach)));
        let (low, size) = (vector(40.0), vector(1.0).abs());
        let scale = [0.01, 1.0, 5.0, 200.0][rng.below(4)];
        if rng.below(10) == 0 {
            return Aabb::EMPTY;
        }
        Aabb::new(low, low + size * scale)
    }

    #[test]
    fn boxes_that_overlap_are_found_once_wherever_they_moved() {
        let mut rng = Rng::new(8);
        let mut grid = LooseGrid::default();
        let mut all: Vec<Aabb> = (0..150).map(|_| random_box(&mut rng)).collect();
        for bounds in &all {
            grid.push(*bounds);
        }
        let mut n_found = 0;
        for _ in 0..2000 {
            let moved = rng.below(all.len());
            all[moved] = random_box(&mut rng);
            grid.set(moved as u32, all[moved]);
            let asked = random_box(&mut rng);
            let mut found = Vec::new();
            grid.for_each_near(&asked, |k| found.push(k));
            found.sort_unstable();
            let overlapping = (0_u32..).zip(&all).filter(|(_, b)| b.overlaps(&asked));
            let known: Vec<_> = overlapping
                .filter(|(_, b)| !b.is_empty() && !asked.is_empty())
                .map(|(k, _)| k)
                .collect();
            assert_eq!(found, known);
            n_found += known.len();
        }
        assert!(n_found > 10_000, "{n_found}");
    }
}
