//! Parts by their boxes: finds those near a box in time that does not grow with the number of parts.
//!
//! A loose grid in levels (Ulrich, "Loose octrees", Game Programming Gems, 2000): each box is listed once, by its center, in the
//! level whose cells are as wide as its longest side, hence sticks out of its cell by half a cell at most. The lists are chains
//! through one table of buckets, so that moving a box allocates nothing. A query that covers more cells of a level than there
//! are boxes in it tests these boxes instead.

use enfilade_geom::{Aabb, DVec3};

use super::id::PartId;

const NONE: u32 = u32::MAX;

/// Levels of the narrowest and widest cells, powers of two: smaller boxes share the first, and beyond the last everything is
/// one cell. [Units: wu, as an exponent]
const LEVELS: [f64; 2] = [-10.0, 50.0];

/// The boxes of all parts, in the root's frame.
#[derive(Default)]
pub(super) struct Neighbors {
    /// Per part.
    entries: Vec<BoxEntry>,
    /// First part of each bucket; a power of two.
    heads: Vec<u32>,
    /// Each level in use with the number of its boxes.
    levels: Vec<(i32, u32)>,
}

struct BoxEntry {
    bounds: Aabb,
    /// `None` for an empty box.
    key: Option<Key>,
    before: u32,
    next: u32,
}

#[derive(Clone, Copy, PartialEq, Eq)]
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

impl Neighbors {
    /// Adds the box of the next part.
    pub(super) fn push(&mut self, bounds: Aabb) {
        self.entries.push(BoxEntry {
            bounds: Aabb::EMPTY,
            key: None,
            before: NONE,
            next: NONE,
        });
        let part = self.entries.len() as u32 - 1;
        if self.entries.len() * 2 > self.heads.len() {
            let n = (self.entries.len() * 4).next_power_of_two();
            self.heads.clear();
            self.heads.resize(n, NONE);
            for at in 0..part {
                self.link(at);
            }
        }
        self.set(PartId(part), bounds);
    }

    /// Returns the box of a part.
    pub(super) fn bounds(&self, part: PartId) -> &Aabb {
        &self.entries[part.idx()].bounds
    }

    /// Moves the box of a part.
    pub(super) fn set(&mut self, part: PartId, bounds: Aabb) {
        let key = Key::of(&bounds);
        let entry = &mut self.entries[part.idx()];
        entry.bounds = bounds;
        if entry.key == key {
            return;
        }
        self.unlink(part.0);
        self.entries[part.idx()].key = key;
        self.link(part.0);
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

    /// Appends the parts whose boxes overlap `bounds`, each once, in no order.
    pub(super) fn near(&self, bounds: &Aabb, into: &mut Vec<PartId>) {
        if bounds.is_empty() {
            return;
        }
        for &(level, n_boxes) in self.levels.iter().filter(|l| l.1 > 0) {
            let side = side_of(level);
            let reach = bounds.expanded(0.5 * side);
            let [low, high] = [reach.min, reach.max].map(|p| cell_of(p, side));
            let n_cells = [0, 1, 2].map(|k| high[k] as f64 - low[k] as f64 + 1.0);
            if n_cells.iter().product::<f64>() > 8.0 + f64::from(n_boxes) {
                self.near_in_level(level, bounds, into);
                continue;
            }
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    for z in low[2]..=high[2] {
                        let at = [x, y, z];
                        self.near_in_cell(Key { level, at }, bounds, into);
                    }
                }
            }
        }
    }

    fn near_in_cell(&self, key: Key, bounds: &Aabb, into: &mut Vec<PartId>) {
        let mut at = self.heads[key.bucket(self.heads.len())];
        while let Some(entry) = self.entries.get(at as usize) {
            if entry.key == Some(key) && entry.bounds.overlaps(bounds) {
                into.push(PartId(at));
            }
            at = entry.next;
        }
    }

    fn near_in_level(&self, level: i32, bounds: &Aabb, into: &mut Vec<PartId>) {
        for (part, entry) in (0..).map(PartId).zip(&self.entries) {
            let is_of_level = entry.key.is_some_and(|key| key.level == level);
            if is_of_level && entry.bounds.overlaps(bounds) {
                into.push(part);
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
        let mut neighbors = Neighbors::default();
        let mut all: Vec<Aabb> = (0..150).map(|_| random_box(&mut rng)).collect();
        for bounds in &all {
            neighbors.push(*bounds);
        }
        let mut n_found = 0;
        for _ in 0..2000 {
            let moved = rng.below(all.len());
            all[moved] = random_box(&mut rng);
            neighbors.set(PartId(moved as u32), all[moved]);
            let asked = random_box(&mut rng);
            let mut found = Vec::new();
            neighbors.near(&asked, &mut found);
            found.sort_unstable();
            let overlapping = (0_u32..).zip(&all).filter(|(_, b)| b.overlaps(&asked));
            let known: Vec<_> = overlapping
                .filter(|(_, b)| !b.is_empty() && !asked.is_empty())
                .map(|(k, _)| PartId(k))
                .collect();
            assert_eq!(found, known);
            n_found += known.len();
        }
        assert!(n_found > 10_000, "{n_found}");
    }
}
