//! Rows of bits.

use rayon::prelude::*;

/// A square table of bits, a row after the other.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct BitTable {
    n_words: usize,
    words: Vec<u64>,
}

impl BitTable {
    pub(super) fn new(n_rows: usize, n_columns: usize) -> Self {
        let n_words = n_columns.div_ceil(64);
        Self {
            n_words,
            words: vec![0; n_rows * n_words],
        }
    }

    #[inline]
    pub(super) fn n_words(&self) -> usize {
        self.n_words
    }

    #[inline]
    pub(super) fn row(&self, row: usize) -> &[u64] {
        &self.words[row * self.n_words..][..self.n_words]
    }

    #[inline]
    pub(super) fn row_mut(&mut self, row: usize) -> &mut [u64] {
        &mut self.words[row * self.n_words..][..self.n_words]
    }

    #[inline]
    pub(super) fn get(&self, row: usize, column: usize) -> bool {
        get(self.row(row), column)
    }

    #[inline]
    pub(super) fn set(&mut self, row: usize, column: usize) {
        set(self.row_mut(row), column);
    }

    #[inline]
    pub(super) fn clear(&mut self, row: usize, column: usize) {
        self.row_mut(row)[column / 64] &= !(1 << (column % 64));
    }

    /// Rows as columns, of a table with so many rows.
    pub(super) fn transposed(&self, n_rows: usize) -> Self {
        let mut out = Self::new(self.n_words * 64, n_rows);
        let n_words = out.n_words;
        let rows = out.words.par_chunks_mut((64 * n_words).max(1));
        rows.enumerate().for_each(|(word, rows)| {
            for first in (0..n_rows).step_by(64) {
                let mut block = [0; 64];
                for (k, b) in block.iter_mut().enumerate().take(n_rows - first) {
                    *b = self.words[(first + k) * self.n_words + word];
                }
                transpose_block(&mut block);
                for (k, &b) in block.iter().enumerate() {
                    rows[k * n_words + first / 64] = b;
                }
            }
        });
        out
    }

    pub(super) fn words(&self) -> &[u64] {
        &self.words
    }

    pub(super) fn words_mut(&mut self) -> &mut [u64] {
        &mut self.words
    }
}

/// Exchanges halves, then halves of halves, down to single bits. Warren, *Hacker's Delight*, section 7-3.
fn transpose_block(block: &mut [u64; 64]) {
    let mut width = 32;
    let mut mask = u64::MAX >> 32;
    while width > 0 {
        for k in (0..64).filter(|k| k & width == 0) {
            let moved = ((block[k] >> width) ^ block[k + width]) & mask;
            block[k] ^= moved << width;
            block[k + width] ^= moved;
        }
        width /= 2;
        mask ^= mask << width;
    }
}

#[inline]
pub(super) fn get(row: &[u64], column: usize) -> bool {
    row[column / 64] >> (column % 64) & 1 != 0
}

#[inline]
pub(super) fn set(row: &mut [u64], column: usize) {
    row[column / 64] |= 1 << (column % 64);
}

#[inline]
pub(super) fn clear(row: &mut [u64], column: usize) {
    row[column / 64] &= !(1 << (column % 64));
}

/// Sets the bits `from..to`.
#[inline]
pub(super) fn set_range(row: &mut [u64], from: usize, to: usize) {
    for_words(from, to, |word, mask| row[word] |= mask);
}

/// Clears the bits `from..to`.
#[inline]
pub(super) fn clear_range(row: &mut [u64], from: usize, to: usize) {
    for_words(from, to, |word, mask| row[word] &= !mask);
}

/// Whether any of the bits `from..to` is set.
#[inline]
pub(super) fn any_in_range(row: &[u64], from: usize, to: usize) -> bool {
    let mut any = false;
    for_words(from, to, |word, mask| any |= row[word] & mask != 0);
    any
}

#[inline]
fn for_words(from: usize, to: usize, mut visit: impl FnMut(usize, u64)) {
    let mut at = from;
    while at < to {
        let word = at / 64;
        let end = to.min((word + 1) * 64);
        let n = end - at;
        let mask = if n == 64 { u64::MAX } else { (1 << n) - 1 };
        visit(word, mask << (at % 64));
        at = end;
    }
}

/// Positions of the bits that are set, ascending.
#[inline]
pub(super) fn ones(row: &[u64]) -> impl Iterator<Item = usize> + '_ {
    row.iter().enumerate().flat_map(|(i, &word)| {
        let mut rest = word;
        std::iter::from_fn(move || {
            (rest != 0).then(|| {
                let bit = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                i * 64 + bit
            })
        })
    })
}

#[inline]
pub(super) fn count(row: &[u64]) -> usize {
    row.iter().map(|w| w.count_ones() as usize).sum()
}

/// Writes `a & b` where `words` says, and says whether it has a bit there in common with `wanted`.
#[inline]
pub(super) fn and_into(
    words: &[u32],
    out: &mut [u64],
    (a, b): (&[u64], &[u64]),
    wanted: &[u64],
) -> bool {
    let n = out.len();
    let (a, b, wanted) = (&a[..n], &b[..n], &wanted[..n]);
    let mut any = 0;
    for &i in words {
        let i = i as usize;
        let both = a[i] & b[i];
        out[i] = both;
        any |= both & wanted[i];
    }
    any != 0
}

#[inline]
pub(super) fn meets(a: &[u64], b: &[u64]) -> bool {
    a.iter().zip(b).any(|(x, y)| x & y != 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_turned_twice_is_itself() {
        let (n_rows, n_columns) = (130, 70);
        let mut table = BitTable::new(n_rows, n_columns);
        for i in 0..n_rows {
            for j in (0..n_columns).filter(|j| (i * i + 3 * j) % 7 < 2) {
                table.set(i, j);
            }
        }
        let turned = table.transposed(n_rows);
        for i in 0..n_rows {
            for j in 0..n_columns {
                assert_eq!(table.get(i, j), turned.get(j, i), "{i} {j}");
            }
        }
    }

    #[test]
    fn ranges_reach_across_words() {
        let mut row = vec![0; 3];
        set_range(&mut row, 60, 130);
        assert_eq!(
            ones(&row).collect::<Vec<_>>(),
            (60..130).collect::<Vec<_>>()
        );
        assert!(any_in_range(&row, 129, 140) && !any_in_range(&row, 130, 192));
        clear_range(&mut row, 61, 129);
        assert_eq!(ones(&row).collect::<Vec<_>>(), [60, 129]);
        assert_eq!(count(&row), 2);
    }
}
