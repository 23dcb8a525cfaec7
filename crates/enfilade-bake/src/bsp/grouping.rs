//! Counts of separators and of the cells that they divide, for tables.

use super::leaves::Bsp;
use super::{cells, separator};

/// Counts of separators and cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grouping {
    /// Valid separators.
    pub n_valid: usize,
    /// Valid separators dropped because they cross others.
    pub n_crossing: usize,
    /// Valid separators dropped because one cell lies on both sides.
    pub n_useless: usize,
    /// Separators kept.
    pub n_separators: usize,
    /// Cells.
    pub n_cells: usize,
}

impl Bsp<'_> {
    /// Finds separators and cells, and returns their counts.
    #[must_use]
    pub fn grouping(&self) -> Grouping {
        let found = separator::find(self);
        let n_valid = found.len();
        let cells = cells::part(self, found);
        Grouping {
            n_valid,
            n_crossing: cells.n_crossing,
            n_useless: cells.n_useless,
            n_separators: cells.separators.len(),
            n_cells: cells.n_cells,
        }
    }

    /// Returns the separators that divide cells once those that cross others are dropped, each as positions in
    /// [`Bsp::portals`].
    #[must_use]
    pub fn separators(&self) -> Vec<Vec<usize>> {
        let parted = cells::part(self, separator::find(self));
        let portals = |s: separator::Separator| s.portals.iter().map(|&p| p as usize).collect();
        parted.separators.into_iter().map(portals).collect()
    }
}
