//! Lacks of cells, kept up to date piece by piece.

use super::state::State;
use crate::{Catalog, PieceId};
use enfilade_cpg::CellId;

/// Numbers of pieces that a cell lacks to be complete.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Lacks {
    /// Number of its pieces that are neither in memory of the program nor missing from the source.
    pub(crate) n_coming: u32,
    /// Number of those that failed and wait.
    pub(crate) n_failing: u32,
    /// Number of its pieces that the source does not have.
    pub(crate) n_missing: u32,
    /// None of its pieces before this one is absent.
    first: u32,
}

impl Lacks {
    pub(crate) fn is_nothing(self) -> bool {
        self.n_coming == 0 && self.n_missing == 0
    }
}

/// A cell that needs a piece.
#[derive(Clone, Copy, Debug)]
struct Use {
    cell: CellId,
    /// The number of the piece among those of the cell.
    number: u32,
}

/// Lacks of each cell. Changes of states cost the cells that need the piece, and questions about a cell do not cost its pieces.
#[derive(Debug)]
pub(crate) struct Cells {
    lacks: Vec<Lacks>,
    /// Memory of all pieces of each cell. [Units: bytes]
    n_bytes: Vec<u64>,
    /// For each piece, the end of its cells in `uses`.
    ends: Vec<u32>,
    uses: Vec<Use>,
}

impl Cells {
    /// Makes the cells of a catalog of which all pieces are absent.
    pub(crate) fn new(catalog: &Catalog) -> Self {
        let cells = || (0..catalog.n_cells() as u32).map(CellId);
        let mut ends = vec![0_u32; catalog.pieces().len() + 1];
        for piece in cells().flat_map(|c| catalog.pieces_of(c)) {
            ends[piece.idx() + 1] += 1;
        }
        for i in 1..ends.len() {
            ends[i] += ends[i - 1];
        }
        let none = Use {
            cell: CellId(0),
            number: 0,
        };
        // First the starts, which become the ends.
        let mut uses = vec![none; ends.last().map_or(0, |n| *n as usize)];
        for cell in cells() {
            for (number, piece) in (0..).zip(catalog.pieces_of(cell)) {
                let at = &mut ends[piece.idx()];
                uses[*at as usize] = Use { cell, number };
                *at += 1;
            }
        }
        ends.pop();
        let lacks = |cell| Lacks {
            n_coming: catalog.pieces_of(cell).len() as u32,
            ..Lacks::default()
        };
        let n_bytes = |cell| {
            let sizes = catalog.pieces_of(cell).iter();
            sizes.fold(0, |sum: u64, p| {
                sum.saturating_add(catalog.pieces()[p.idx()].n_resident)
            })
        };
        Self {
            lacks: cells().map(lacks).collect(),
            n_bytes: cells().map(n_bytes).collect(),
            ends,
            uses,
        }
    }

    fn range_of(&self, piece: PieceId) -> std::ops::Range<usize> {
        let before = piece.idx().checked_sub(1);
        let first = before.map_or(0, |p| self.ends[p]);
        first as usize..self.ends[piece.idx()] as usize
    }

    /// Returns the cells that need a piece.
    pub(crate) fn of(&self, piece: PieceId) -> impl ExactSizeIterator<Item = CellId> + '_ {
        self.uses[self.range_of(piece)].iter().map(|u| u.cell)
    }

    /// Returns what a cell lacks: nothing if there is no such cell.
    #[inline]
    pub(crate) fn lacks(&self, cell: CellId) -> Lacks {
        self.lacks.get(cell.idx()).copied().unwrap_or_default()
    }

    /// Returns the memory of all pieces of a cell. [Units: bytes]
    #[inline]
    pub(crate) fn n_bytes(&self, cell: CellId) -> u64 {
        self.n_bytes.get(cell.idx()).copied().unwrap_or(0)
    }

    /// Counts the change of a piece's state. O(cells that need it), and nothing on its way from a request to its arrival.
    pub(crate) fn change(&mut self, piece: PieceId, from: State, to: State) {
        let counts = |state: State| {
            let is_coming = !matches!(state, State::Resident | State::Missing);
            let (is_failing, is_missing) = (state == State::Failing, state == State::Missing);
            [is_coming, is_failing, is_missing].map(u32::from)
        };
        let (before, after) = (counts(from), counts(to));
        if before == after && to != State::Absent {
            return;
        }
        for i in self.range_of(piece) {
            let Use { cell, number } = self.uses[i];
            let lacks = &mut self.lacks[cell.idx()];
            let change = |n: &mut u32, k: usize| *n = *n + after[k] - before[k];
            change(&mut lacks.n_coming, 0);
            change(&mut lacks.n_failing, 1);
            change(&mut lacks.n_missing, 2);
            if to == State::Absent {
                lacks.first = lacks.first.min(number);
            }
        }
    }

    /// Returns the first absent piece of a cell. The steps to it are taken once, until one before it is absent again.
    pub(crate) fn first_absent(
        &mut self,
        cell: CellId,
        catalog: &Catalog,
        is_absent: impl Fn(PieceId) -> bool,
    ) -> Option<PieceId> {
        let lacks = self.lacks.get_mut(cell.idx())?;
        let rest = catalog.pieces_of(cell).get(lacks.first as usize..)?;
        let n = rest.iter().take_while(|p| !is_absent(**p)).count();
        lacks.first += n as u32;
        rest.get(n).copied()
    }
}
