//! The potentially visible set that a world may carry.

use crate::parts::{VisibleParts, VisibleVolumes};
use crate::{CellId, CellSet};

/// The potentially visible set of a graph: for each cell, the cells of which something may be seen from somewhere in
/// it with all portals open.
///
/// A superset of the truth: cells that are not in it are never seen. Stored as runs of consecutive ids, as builders
/// number neighboring rooms by place; a query takes a binary search. Made by `enfilade pvs --into`, or in code from
/// the answer of the search.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pvs {
    /// For each cell, the end of its runs in `runs`.
    pub(crate) ends: Vec<u32>,
    /// First cell and one past the last; in each row ascending, with gaps between runs.
    pub(crate) runs: Vec<[u32; 2]>,
    /// For each pair of cells, the triangles and objects that may be seen, if computed.
    pub parts: Option<VisibleParts>,
    /// For each pair of cells, the volume that may be seen, if kept.
    pub volumes: Option<VisibleVolumes>,
}

impl Pvs {
    /// Makes the set of a graph in which `rows[c]` are the cells that may be seen from cell `c`. Linear in the rows.
    ///
    /// [`World::validate`](crate::World::validate) checks that each cell sees itself and that all ids exist.
    #[must_use]
    pub fn of_rows(rows: &[CellSet]) -> Self {
        let mut pvs = Self::default();
        for row in rows {
            pvs.runs.extend(row.ranges().iter().map(|&(a, b)| [a, b]));
            pvs.ends.push(pvs.runs.len() as u32);
        }
        pvs
    }

    /// Makes the set of a graph in which cell `c` may see the cells of `rows[c]`, ascending without duplicates. Takes
    /// no more memory than the resulting runs.
    #[doc(hidden)]
    pub fn of_ascending<R: IntoIterator<Item = u32>>(rows: impl IntoIterator<Item = R>) -> Self {
        let mut pvs = Self::default();
        for row in rows {
            let first = pvs.runs.len();
            for cell in row {
                match pvs.runs[first..].last_mut() {
                    Some(run) if run[1] == cell => run[1] += 1,
                    _ => pvs.runs.push([cell, cell + 1]),
                }
            }
            pvs.ends.push(pvs.runs.len() as u32);
        }
        pvs
    }

    /// Returns the number of cells of its graph.
    #[must_use]
    pub fn n_cells(&self) -> usize {
        self.ends.len()
    }

    /// Returns `true` if something of `to` may be seen from `from`, and for a cell `from` that its graph does not
    /// have. O(log runs); allocates nothing.
    #[must_use]
    pub fn sees(&self, from: CellId, to: CellId) -> bool {
        if from.idx() >= self.ends.len() {
            return true;
        }
        let row = self.row(from);
        let at = row.partition_point(|run| run[1] <= to.0);
        row.get(at).is_some_and(|run| run[0] <= to.0)
    }

    /// Returns the cells that may be seen from a cell, ascending, including itself; none for a cell that its graph
    /// does not have. Allocates nothing.
    pub fn visible_from(&self, cell: CellId) -> impl Iterator<Item = CellId> + Clone + '_ {
        let cells = self.row(cell).iter().flat_map(|&[a, b]| a..b);
        cells.map(CellId)
    }

    /// Returns the number of cells that may be seen from a cell. O(runs).
    #[must_use]
    pub fn n_visible_from(&self, cell: CellId) -> usize {
        let lengths = self.row(cell).iter().map(|&[a, b]| (b - a) as usize);
        lengths.sum()
    }

    /// Returns the number of ordered pairs of cells that may see each other, including each cell with itself.
    #[must_use]
    pub fn n_pairs(&self) -> usize {
        self.runs.iter().map(|&[a, b]| (b - a) as usize).sum()
    }

    /// Returns the cells that may be seen from a cell as runs of consecutive ids, end excluded; ascending, with gaps
    /// between runs. Empty for a cell that its graph does not have.
    #[must_use]
    #[doc(hidden)]
    pub fn runs_from(&self, cell: CellId) -> &[[u32; 2]] {
        self.row(cell)
    }

    /// Returns ordered pairs of cells, the first seeing the second, ascending: the order of rows in [`Pvs::parts`]
    /// and [`Pvs::volumes`].
    pub fn pairs(&self) -> impl Iterator<Item = (CellId, CellId)> + '_ {
        let cells = (0..self.ends.len() as u32).map(CellId);
        cells.flat_map(|from| self.visible_from(from).map(move |to| (from, to)))
    }

    /// Returns the runs of a cell; none for one that does not exist.
    fn row(&self, cell: CellId) -> &[[u32; 2]] {
        let Some(&end) = self.ends.get(cell.idx()) else {
            return &[];
        };
        let before = cell.idx().checked_sub(1);
        let first = before.map_or(0, |c| self.ends[c]);
        &self.runs[first as usize..end as usize]
    }

    /// Returns the first pair of cells whose parts or volumes break an invariant, and the problem; a problem outside
    /// of all pairs has cell numbers past the last. Linear. The rows of cells must be valid.
    pub(crate) fn pair_problem(&self, n_parts: u32) -> Option<([u32; 2], &'static str)> {
        let n_pairs = self.n_pairs();
        let parts = self
            .parts
            .as_ref()
            .and_then(|p| p.problem(n_pairs, n_parts));
        let volumes = self.volumes.as_ref();
        let (pair, problem) = parts.or_else(|| volumes.and_then(|v| v.problem(n_pairs)))?;
        let n_cells = self.ends.len() as u32;
        let cells = self.pairs().nth(pair).map(|(a, b)| [a.0, b.0]);
        Some((cells.unwrap_or([n_cells; 2]), problem))
    }

    /// Returns the first cell whose row breaks an invariant, and the problem. Linear.
    pub(crate) fn problem(&self, n_cells: usize) -> Option<(u32, &'static str)> {
        if self.ends.len() != n_cells {
            return Some((0, "there must be a row for each cell of the graph"));
        }
        let mut first = 0;
        for (cell, &end) in (0..).zip(&self.ends) {
            if end < first || end as usize > self.runs.len() {
                return Some((cell, "its runs must lie within the list"));
            }
            let row = &self.runs[first as usize..end as usize];
            let is_run = |run: &[u32; 2]| run[0] < run[1] && run[1] as usize <= n_cells;
            if !row.iter().all(is_run) || row.windows(2).any(|w| w[0][1] >= w[1][0]) {
                return Some((
                    cell,
                    "its runs must hold existing cells, ascending, with gaps between runs",
                ));
            }
            if !row.iter().any(|run| (run[0]..run[1]).contains(&cell)) {
                return Some((cell, "it must see itself"));
            }
            first = end;
        }
        let is_all = first as usize == self.runs.len();
        (!is_all).then_some((n_cells as u32, "some runs belong to no cell"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(of: &[&[u32]]) -> Vec<CellSet> {
        let row = |cells: &&[u32]| {
            let mut set = CellSet::new(of.len());
            for &c in *cells {
                set.insert(CellId(c));
            }
            set
        };
        of.iter().map(row).collect()
    }

    #[test]
    fn rows_come_back_cell_by_cell() {
        let sets = rows(&[&[0, 1, 4], &[0, 1], &[2], &[2, 3, 4], &[0, 3, 4]]);
        let pvs = Pvs::of_rows(&sets);
        assert_eq!(pvs.n_cells(), 5);
        assert_eq!(pvs.problem(5), None);
        let ids = |set: &CellSet| set.iter().map(|c| c.0).collect::<Vec<_>>();
        assert_eq!(Pvs::of_ascending(sets.iter().map(ids)), pvs);
        assert_eq!(pvs.n_pairs(), 12);
        for (from, set) in (0..).map(CellId).zip(&sets) {
            assert_eq!(pvs.n_visible_from(from), set.len());
            assert!(pvs.visible_from(from).eq(set.iter()));
            for to in (0..7).map(CellId) {
                assert_eq!(pvs.sees(from, to), set.contains(to), "{from} {to}");
            }
        }
        assert!(pvs.sees(CellId(5), CellId(0)));
        assert_eq!(pvs.visible_from(CellId(5)).count(), 0);
        assert_eq!(Pvs::default().problem(0), None);
    }

    #[test]
    fn broken_rows_are_found() {
        let good = Pvs::of_rows(&rows(&[&[0, 2], &[1], &[0, 2]]));
        let broken = |change: &dyn Fn(&mut Pvs)| {
            let mut pvs = good.clone();
            change(&mut pvs);
            pvs.problem(3).map(|p| p.0)
        };
        assert_eq!(broken(&|_| {}), None);
        assert_eq!(
            good.problem(4),
            Some((0, "there must be a row for each cell of the graph"))
        );
        assert_eq!(broken(&|p| p.ends[1] = 1), Some(1));
        assert_eq!(broken(&|p| p.ends[2] = 9), Some(2));
        assert_eq!(broken(&|p| p.ends[2] = 4), Some(2));
        assert_eq!(broken(&|p| p.runs[1] = [2, 4]), Some(0));
        assert_eq!(broken(&|p| p.runs[1] = [2, 2]), Some(0));
        assert_eq!(broken(&|p| p.runs[1] = [1, 3]), Some(0));
        assert_eq!(broken(&|p| p.runs[2] = [2, 3]), Some(1));
        assert_eq!(broken(&|p| p.runs.push([0, 1])), Some(3));
    }
}
