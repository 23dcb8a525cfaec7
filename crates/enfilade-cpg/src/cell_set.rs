//! Sets of cells as bits.

use crate::CellId;

/// A set of cells of one graph. [Shape: one bit per cell, 64 per word, least significant first]
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct CellSet {
    n_cells: u32,
    words: Vec<u64>,
}

impl CellSet {
    /// Makes an empty set for a graph of `n_cells` cells.
    ///
    /// # Panics
    ///
    /// If there are more cells than ids.
    #[must_use]
    pub fn new(n_cells: usize) -> Self {
        Self {
            n_cells: u32::try_from(n_cells).expect("cell ids are 32 bits"),
            words: vec![0; n_cells.div_ceil(64)],
        }
    }

    /// Makes the set of all cells of a graph of `n_cells` cells.
    #[must_use]
    pub fn all(n_cells: usize) -> Self {
        let mut set = Self::new(n_cells);
        set.insert_all();
        set
    }

    /// Returns the number of cells of the graph.
    #[must_use]
    pub fn n_cells(&self) -> usize {
        self.n_cells as usize
    }

    /// Returns the number of cells in the set.
    #[must_use]
    pub fn len(&self) -> usize {
        self.words.iter().map(|w| w.count_ones() as usize).sum()
    }

    /// Returns `true` if the set has no cells.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.words.iter().all(|&w| w == 0)
    }

    /// Returns `true` if a cell is in the set; `false` for ids beyond the graph.
    #[must_use]
    pub fn contains(&self, cell: CellId) -> bool {
        let i = cell.0 as usize;
        cell.0 < self.n_cells && self.words[i / 64] >> (i % 64) & 1 != 0
    }

    /// Adds a cell; returns `true` if it is new.
    ///
    /// # Panics
    ///
    /// If the graph does not have the cell.
    pub fn insert(&mut self, cell: CellId) -> bool {
        assert!(
            cell.0 < self.n_cells,
            "no cell {} in {}",
            cell.0,
            self.n_cells
        );
        let is_new = !self.contains(cell);
        self.words[cell.0 as usize / 64] |= 1 << (cell.0 % 64);
        is_new
    }

    /// Removes a cell.
    pub fn remove(&mut self, cell: CellId) {
        if cell.0 < self.n_cells {
            self.words[cell.0 as usize / 64] &= !(1 << (cell.0 % 64));
        }
    }

    /// Adds every cell of the graph.
    pub(crate) fn insert_all(&mut self) {
        self.words.fill(u64::MAX);
        let tail = self.n_cells % 64;
        if tail != 0
            && let Some(last) = self.words.last_mut()
        {
            *last = (1 << tail) - 1;
        }
    }

    /// Removes all cells.
    pub fn clear(&mut self) {
        self.words.fill(0);
    }

    /// Adds the cells of another set of the same graph.
    #[doc(hidden)]
    pub fn union_with(&mut self, other: &Self) {
        for (a, b) in self.words.iter_mut().zip(&other.words) {
            *a |= b;
        }
    }

    /// Returns `true` if each cell is also in the other set.
    #[must_use]
    #[doc(hidden)]
    pub fn is_subset(&self, other: &Self) -> bool {
        self.words
            .iter()
            .zip(&other.words)
            .all(|(a, b)| a & !b == 0)
    }

    /// Returns the cells, ascending.
    pub fn iter(&self) -> impl Iterator<Item = CellId> + '_ {
        self.words.iter().enumerate().flat_map(|(i, &word)| {
            let mut rest = word;
            std::iter::from_fn(move || {
                (rest != 0).then(|| {
                    let bit = rest.trailing_zeros();
                    rest &= rest - 1;
                    CellId(i as u32 * 64 + bit)
                })
            })
        })
    }

    /// Returns runs of consecutive ids, end excluded, ascending.
    #[must_use]
    pub(crate) fn ranges(&self) -> Vec<(u32, u32)> {
        let mut ranges: Vec<(u32, u32)> = Vec::new();
        for CellId(c) in self.iter() {
            match ranges.last_mut() {
                Some((_, end)) if *end == c => *end += 1,
                _ => ranges.push((c, c + 1)),
            }
        }
        ranges
    }
}

impl FromIterator<CellId> for CellSet {
    /// Makes a set in the smallest graph that has the cells.
    fn from_iter<T: IntoIterator<Item = CellId>>(cells: T) -> Self {
        let cells: Vec<CellId> = cells.into_iter().collect();
        let n = cells.iter().map(|c| c.0 as usize + 1).max().unwrap_or(0);
        let mut set = Self::new(n);
        for cell in cells {
            set.insert(cell);
        }
        set
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_holds_what_was_put_in() {
        let mut set = CellSet::new(130);
        for c in [0, 1, 2, 63, 64, 129] {
            assert!(set.insert(CellId(c)) && !set.insert(CellId(c)));
        }
        assert_eq!(set.ranges(), [(0, 3), (63, 65), (129, 130)]);
        assert!(!set.contains(CellId(130)) && set.len() == 6);
        set.remove(CellId(1));
        assert!(set.is_subset(&CellSet::all(130)) && !CellSet::all(130).is_subset(&set));
        assert_eq!(CellSet::all(130).len(), 130);
        assert!(CellSet::new(0).is_empty() && CellSet::all(64).len() == 64);
    }
}
