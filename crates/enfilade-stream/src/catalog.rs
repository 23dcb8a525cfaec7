//! The pieces of a packed world, and the cells that need them.

use enfilade_cpg::CellId;

/// Index of a piece in a [`Catalog`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PieceId(pub u32);

impl PieceId {
    /// Returns its index in [`Catalog::pieces`].
    #[inline]
    #[must_use]
    pub fn idx(self) -> usize {
        self.0 as usize
    }
}

/// Sizes of a piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PieceSizes {
    /// Size in transit. [Units: bytes]
    pub n_packed: u64,
    /// Size in memory once unpacked. [Units: bytes]
    pub n_resident: u64,
}

/// The pieces of a packed world, and the pieces that each cell needs to be complete: its triangles, those it shares with
/// other cells, its objects' meshes, and their pictures.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Catalog {
    pieces: Vec<PieceSizes>,
    /// For each cell, the end of its pieces in `needed`.
    ends: Vec<u32>,
    /// Ascending in each cell, without duplicates.
    needed: Vec<PieceId>,
}

impl Catalog {
    /// Makes the catalog of a world in which cell `c` needs the pieces of `rows[c]`. Numbers that `pieces` does not have are
    /// dropped.
    #[must_use]
    pub fn new(pieces: Vec<PieceSizes>, rows: &[Vec<PieceId>]) -> Self {
        let (mut ends, mut needed) = (Vec::with_capacity(rows.len()), Vec::new());
        for row in rows {
            let mut row: Vec<PieceId> = row
                .iter()
                .copied()
                .filter(|p| p.idx() < pieces.len())
                .collect();
            row.sort_unstable();
            row.dedup();
            needed.extend(row);
            ends.push(needed.len() as u32);
        }
        Self {
            pieces,
            ends,
            needed,
        }
    }

    /// Returns all pieces.
    #[must_use]
    pub fn pieces(&self) -> &[PieceSizes] {
        &self.pieces
    }

    /// Returns the number of cells.
    #[must_use]
    pub fn n_cells(&self) -> usize {
        self.ends.len()
    }

    /// Returns the pieces that a cell needs, ascending; none for a cell that does not exist.
    #[must_use]
    pub fn pieces_of(&self, cell: CellId) -> &[PieceId] {
        let Some(&end) = self.ends.get(cell.idx()) else {
            return &[];
        };
        let before = cell.idx().checked_sub(1);
        let first = before.map_or(0, |c| self.ends[c]);
        &self.needed[first as usize..end as usize]
    }
}
