//! Assignment of leaves to cells, and tallies of votes.

use std::collections::BTreeMap;

use super::Label;

/// The cell of leaves in no cell.
pub(super) const SOLID: u32 = u32::MAX;

/// The cell of each leaf.
#[derive(Clone, Debug)]
pub struct LeafCells {
    /// Cell of each leaf, or [`SOLID`].
    pub(super) cell_of_leaf: Vec<u32>,
    /// The vote label of each cell; several cells may share one.
    pub label_of_cell: Vec<Label>,
    /// Volume of each cell.
    pub(super) volumes: Vec<f64>,
    /// The cell with the largest volume of leaves at the border of the box, if any touches it.
    pub(super) outside: Option<u32>,
}

/// Weight of the votes of a leaf or component for a label.
pub(super) type Tally = BTreeMap<(u32, Label), f64>;

impl LeafCells {
    /// Returns leaves at the border that ended up in other cells to the outside.
    pub(super) fn keep_border_outside(&mut self, at_border: &[bool], volume_of_leaf: &[f64]) {
        let Some(outside) = self.outside else { return };
        for leaf in (0..at_border.len()).filter(|&l| at_border[l]) {
            let cell = std::mem::replace(&mut self.cell_of_leaf[leaf], outside);
            if cell != outside {
                if cell != SOLID {
                    self.volumes[cell as usize] -= volume_of_leaf[leaf];
                }
                self.volumes[outside as usize] += volume_of_leaf[leaf];
            }
        }
    }

    /// Renumbers the cells without those that lost every leaf, and recomputes their volumes from the leaves.
    pub(super) fn drop_empty(&mut self, volume_of_leaf: &[f64]) {
        let n = self.label_of_cell.len();
        let mut volumes = vec![0.0; n];
        let mut is_kept = vec![false; n];
        for (leaf, &cell) in self.cell_of_leaf.iter().enumerate() {
            if cell != SOLID {
                volumes[cell as usize] += volume_of_leaf[leaf];
                is_kept[cell as usize] = true;
            }
        }
        let mut number = vec![SOLID; n];
        let kept: Vec<usize> = (0..n).filter(|&c| is_kept[c]).collect();
        for (new, &old) in kept.iter().enumerate() {
            number[old] = new as u32;
        }
        for cell in self.cell_of_leaf.iter_mut().filter(|c| **c != SOLID) {
            *cell = number[*cell as usize];
        }
        self.volumes = kept.iter().map(|&c| volumes[c]).collect();
        self.label_of_cell = kept.iter().map(|&c| self.label_of_cell[c]).collect();
        self.outside = self
            .outside
            .map(|c| number[c as usize])
            .filter(|&c| c != SOLID);
    }
}
