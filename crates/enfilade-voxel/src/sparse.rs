//! A few voxels of a large box.

use super::grid::BitVolume;

/// Marks a row without voxels.
const CLEAR: u32 = u32::MAX;

/// A set of voxels, most of whose rows along x are empty: 4 bytes for such a row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SparseVolume {
    dims: [usize; 3],
    /// First word of each row, divided by the words of a row.
    rows: Vec<u32>,
    words: Vec<u64>,
}

impl SparseVolume {
    /// Copies the rows that are not empty.
    #[must_use]
    pub fn of(volume: &BitVolume) -> Self {
        let dims = volume.dims();
        let (mut rows, mut words) = (Vec::with_capacity(dims[1] * dims[2]), Vec::new());
        let mut n = 0;
        for row in 0..dims[1] * dims[2] {
            let row = volume.row(row);
            if row.iter().all(|&word| word == 0) {
                rows.push(CLEAR);
            } else {
                rows.push(n);
                n += 1;
                words.extend_from_slice(row);
            }
        }
        Self { dims, rows, words }
    }

    /// Returns `true` if no voxel is set.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    /// Returns `true` if voxel `(i, j, k)` is set.
    ///
    /// # Panics
    /// If it is outside the box.
    #[must_use]
    pub fn get(&self, i: usize, j: usize, k: usize) -> bool {
        let words = self.row(j + self.dims[1] * k);
        words.is_some_and(|words| words[i / 64] >> (i % 64) & 1 != 0)
    }

    /// Sets the same voxels in a volume of the same size.
    ///
    /// # Panics
    /// If it is of another size.
    pub fn add_to(&self, volume: &mut BitVolume) {
        assert_eq!(volume.dims(), self.dims, "boxes of one size");
        for row in 0..self.rows.len() {
            if let Some(words) = self.row(row) {
                volume.unite_row(row, words);
            }
        }
    }

    fn row(&self, row: usize) -> Option<&[u64]> {
        let at = self.rows[row];
        let width = self.dims[0].div_ceil(64);
        (at != CLEAR).then(|| &self.words[at as usize * width..][..width])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_same_voxels_are_set(
            dims in [1_usize..140, 1_usize..6, 1_usize..6], each in 1_usize..300,
        ) {
            let volume = BitVolume::from_fn(dims, |i| i % each == each / 2);
            let sparse = SparseVolume::of(&volume);
            let [nx, ny, nz] = dims;
            for i in 0..nx * ny * nz {
                let [x, y, z] = [i % nx, i / nx % ny, i / (nx * ny)];
                prop_assert_eq!(sparse.get(x, y, z), volume.get_index(i));
            }
            let mut copy = BitVolume::new(dims);
            sparse.add_to(&mut copy);
            prop_assert_eq!(sparse.is_empty(), volume.count() == 0);
            prop_assert_eq!(copy, volume);
        }
    }
}
