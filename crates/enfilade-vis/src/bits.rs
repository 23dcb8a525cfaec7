//! Rows of bits.

use rayon::prelude::*;

/// A table of bits, stored row by row.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct BitTable {
    n_words: usize,
    words: Vec<u64>,
}

impl BitTable {
    pub(crate) fn new(n_rows: usize, n_columns: usize) -> Self {
        let n_words = n_columns.div_ceil(64);
        Self {
            n_words,
            words: vec![0; n_rows * n_words],
        }
    }

    #[inline]
    pub(crate) fn n_words(&self) -> usize {
        self.n_words
    }

    #[inline]
    pub(crate) fn row(&self, row: usize) -> &[u64] {
        &self.words[row * self.n_words..][..self.n_words]
    }

    #[inline]
    pub(crate) fn row_mut(&mut self, row: usize) -> &mut [u64] {
        &mut self.words[row * self.n_words..][..self.n_words]
    }

    #[inline]
    pub(crate) fn get(&self, row: usize, column: usize) -> bool {
        get(self.row(row), column)
    }

    #[inline]
    pub(crate) fn set(&mut self, row: usize, column: usize) {
        set(self.row_mut(row), column);
    }

    #[inline]
    pub(crate) fn clear(&mut self, row: usize, column: usize) {
        self.row_mut(row)[column / 64] &= !(1 << (column % 64));
    }

    /// Returns the transpose; column `k` is row `order[k]`.
    pub(crate) fn transposed(&self, order: &[u32]) -> Self {
        let n_rows = order.len();
        let mut out = Self::new(self.n_words * 64, n_rows);
        let n_words = out.n_words;
        let rows = out.words.par_chunks_mut((64 * n_words).max(1));
        rows.enumerate().for_each(|(word, rows)| {
            for first in (0..n_rows).step_by(64) {
                let mut block = [0; 64];
                for (b, &row) in block.iter_mut().zip(&order[first..]) {
                    *b = self.words[row as usize * self.n_words + word];
                }
                transpose_block(&mut block);
                for (k, &b) in block.iter().enumerate() {
                    rows[k * n_words + first / 64] = b;
                }
            }
        });
        out
    }

    /// Returns the number of bits set.
    pub(crate) fn count_all(&self) -> u64 {
        let ones = |w: &u64| u64::from(w.count_ones());
        self.words.iter().map(ones).sum()
    }

    pub(crate) fn words(&self) -> &[u64] {
        &self.words
    }

    pub(crate) fn words_mut(&mut self) -> &mut [u64] {
        &mut self.words
    }
}

/// Transposes a block by exchanging halves, then halves of halves, down to single bits. Warren, *Hacker's Delight*,
/// section 7-3.
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
pub(crate) fn get(row: &[u64], column: usize) -> bool {
    row[column / 64] >> (column % 64) & 1 != 0
}

#[inline]
pub(crate) fn set(row: &mut [u64], column: usize) {
    row[column / 64] |= 1 << (column % 64);
}

#[inline]
pub(crate) fn clear(row: &mut [u64], column: usize) {
    row[column / 64] &= !(1 << (column % 64));
}

/// Returns the bits `start..start + 64`; zeros past the row's end.
#[inline]
pub(crate) fn window(row: &[u64], start: usize) -> u64 {
    let (word, shift) = (start / 64, start % 64);
    let at = |i: usize| row.get(i).copied().unwrap_or(0);
    at(word) >> shift | (at(word + 1) << 1) << (63 - shift)
}

/// Clears the bits of `start..start + 64` that are set in `bits`.
#[inline]
pub(crate) fn clear_window(row: &mut [u64], start: usize, bits: u64) {
    let (word, shift) = (start / 64, start % 64);
    if let Some(low) = row.get_mut(word) {
        *low &= !(bits << shift);
    }
    if let Some(high) = row.get_mut(word + 1) {
        *high &= !((bits >> 1) >> (63 - shift));
    }
}

/// Returns the positions of the set bits of a word, ascending; its lowest bit has the position `start`.
#[inline]
pub(crate) fn ones_from(start: usize, bits: u64) -> impl Iterator<Item = usize> {
    let mut rest = bits;
    std::iter::from_fn(move || {
        (rest != 0).then(|| {
            let bit = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            start + bit
        })
    })
}

/// Returns the positions of the set bits, ascending.
#[inline]
pub(crate) fn ones(row: &[u64]) -> impl Iterator<Item = usize> + '_ {
    row.iter()
        .enumerate()
        .flat_map(|(i, &word)| ones_from(i * 64, word))
}

#[inline]
pub(crate) fn count(row: &[u64]) -> usize {
    row.iter().map(|w| w.count_ones() as usize).sum()
}

/// Writes `a & b` at the positions in `words`; returns `true` if a bit written there is also in `wanted`.
#[inline]
pub(crate) fn and_into(
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

/// Adds the bits of another row.
#[inline]
pub(crate) fn unite(row: &mut [u64], other: &[u64]) {
    for (word, &more) in row.iter_mut().zip(other) {
        *word |= more;
    }
}

#[inline]
pub(crate) fn meets(a: &[u64], b: &[u64]) -> bool {
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
        let order: Vec<u32> = (0..n_rows as u32).map(|i| i * 7 % n_rows as u32).collect();
        let turned = table.transposed(&order);
        for (k, &i) in order.iter().enumerate() {
            for j in 0..n_columns {
                assert_eq!(table.get(i as usize, j), turned.get(j, k), "{i} {j}");
            }
        }
    }

    #[test]
    fn windows_reach_across_words() {
        let row = [0x8000_0000_0000_0001, u64::MAX, 0x10];
        for start in 0..200 {
            let bit = |k: usize| start + k < 192 && get(&row, start + k);
            let expected = (0..64).fold(0, |bits, k| bits | u64::from(bit(k)) << k);
            assert_eq!(window(&row, start), expected, "{start}");
            for bits in [u64::MAX, 0x8000_0000_0000_0001, 1 << 5] {
                let mut left = row;
                clear_window(&mut left, start, bits);
                let is_cleared =
                    |i: usize| i >= start && i < start + 64 && bits >> (i - start) & 1 != 0;
                let kept = (0..192).filter(|&i| get(&row, i) && !is_cleared(i));
                assert!(ones(&left).eq(kept), "{start} {bits:x}");
            }
        }
    }
}
