//! Awake cells: seen or heard, or recently so.
//!
//! An effect that stands in a cell (a fountain, a lift without a rider, a radio) queries [`AwakeCells::is_awake`] and does
//! nothing in a sleeping cell (Gjørup 1999, section 3.3.4). A cell is potentially visible before its contents are seen, so there
//! is time to start. O(cells seen or heard + cells awake); errs to awake.

use enfilade_cpg::CellId;

/// The cells that are seen or heard, or were in the last few seconds.
#[derive(Clone, Debug)]
pub struct AwakeCells {
    /// Last time per cell; -∞ if never. [Units: s]
    last: Vec<f64>,
    awake: Vec<CellId>,
    linger: f64,
    now: f64,
}

impl AwakeCells {
    /// Makes all cells asleep. A cell stays awake for `linger` seconds after it was last seen or heard.
    #[must_use]
    pub fn new(n_cells: usize, linger: f64) -> Self {
        Self {
            last: vec![f64::NEG_INFINITY; n_cells],
            awake: Vec::with_capacity(n_cells),
            linger: linger.max(0.0),
            now: f64::NEG_INFINITY,
        }
    }

    /// Wakes cells that may be seen or heard now: those of a [`Pvs`](enfilade_cpg::Pvs) from each eye's cell
    /// ([`Pvs::visible_from`](enfilade_cpg::Pvs::visible_from)), or of a view, and those from which sound reaches a listener.
    /// Ignores cells that do not exist. Puts cells to sleep when their time is over.
    pub fn update(&mut self, now: f64, perceived: impl IntoIterator<Item = CellId>) {
        self.now = now;
        for cell in perceived {
            let Some(last) = self.last.get_mut(cell.idx()) else {
                continue;
            };
            if *last == f64::NEG_INFINITY {
                self.awake.push(cell);
            }
            *last = now;
        }
        let (last, linger) = (&mut self.last, self.linger);
        self.awake.retain(|cell| {
            let stays = now - last[cell.idx()] <= linger;
            if !stays {
                last[cell.idx()] = f64::NEG_INFINITY;
            }
            stays
        });
    }

    /// Returns `true` if the contents of a cell should be simulated.
    #[must_use]
    pub fn is_awake(&self, cell: CellId) -> bool {
        let last = self.last.get(cell.idx());
        last.is_some_and(|&last| self.now - last <= self.linger)
    }

    /// Returns all awake cells, in arbitrary order.
    #[must_use]
    pub fn cells(&self) -> &[CellId] {
        &self.awake
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_cpg::{CellSet, Pvs};

    /// Covers W13: effects of cells that are not seen or heard sleep, after a while.
    #[test]
    fn cells_sleep_a_while_after_they_were_last_seen_or_heard() {
        let row = |cells: &[u32]| {
            let mut set = CellSet::new(4);
            for &c in cells {
                set.insert(CellId(c));
            }
            set
        };
        let pvs = Pvs::of_rows(&[row(&[0, 1]), row(&[0, 1]), row(&[2]), row(&[3])]);
        let mut awake = AwakeCells::new(4, 2.0);
        let is_awake = |a: &AwakeCells| [0, 1, 2, 3].map(|c| a.is_awake(CellId(c)));
        assert_eq!(is_awake(&awake), [false; 4]);
        let heard = [CellId(3), CellId(9)];
        awake.update(10.0, pvs.visible_from(CellId(0)).chain(heard));
        assert_eq!(is_awake(&awake), [true, true, false, true]);
        awake.update(11.5, pvs.visible_from(CellId(2)));
        assert_eq!(is_awake(&awake), [true; 4]);
        awake.update(12.5, pvs.visible_from(CellId(2)).chain([CellId(1)]));
        assert_eq!(is_awake(&awake), [false, true, true, false]);
        let mut listed = awake.cells().to_vec();
        listed.sort_unstable();
        assert_eq!(listed, [CellId(1), CellId(2)]);
        awake.update(20.0, []);
        assert!(awake.cells().is_empty() && is_awake(&awake) == [false; 4]);
        awake.update(21.0, [CellId(0), CellId(0)]);
        assert_eq!(awake.cells(), [CellId(0)]);
    }
}
