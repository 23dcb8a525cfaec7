//! Voxels of a large box in rows, most of which are empty or alike.

use super::grid::BitVolume;

/// A set of voxels that is read by rows along x, as a [`BitVolume`] is.
pub trait VoxelRows: Sync {
    /// Returns the numbers of voxels along x, y and z.
    fn dims(&self) -> [usize; 3];

    /// Returns the words of row `row = j + ny * k`.
    fn row(&self, row: usize) -> &[u64];
}

impl VoxelRows for BitVolume {
    fn dims(&self) -> [usize; 3] {
        self.dims()
    }

    fn row(&self, row: usize) -> &[u64] {
        self.row(row)
    }
}

/// A set of voxels that keeps rows along x once for all alike below each other: in a building, walls go straight up.
///
/// 4 bytes for each row, and its words if it is neither empty nor like the one before it.
#[derive(Clone, Debug)]
pub struct SparseVolume {
    dims: [usize; 3],
    /// Position of each row's words, divided by the words of a row.
    rows: Vec<u32>,
    /// The words of an empty row, then of others.
    words: Vec<u64>,
}

impl SparseVolume {
    /// Makes a volume whose rows `write` adds to words that are all clear: `write(row, words)`, with `row = j + ny * k`, in order.
    #[must_use]
    pub fn from_rows(dims: [usize; 3], mut write: impl FnMut(usize, &mut [u64])) -> Self {
        let width = dims[0].div_ceil(64);
        let n_rows = dims[1] * dims[2];
        let mut rows: Vec<u32> = Vec::with_capacity(n_rows);
        let mut words = vec![0; width];
        let mut row = vec![0; width];
        for at in 0..n_rows {
            row.fill(0);
            write(at, &mut row);
            let before = words.len() - width;
            if row.iter().all(|&word| word == 0) {
                rows.push(0);
                continue;
            }
            if words[before..] != row {
                words.extend_from_slice(&row);
            }
            rows.push((words.len() / width.max(1)) as u32 - 1);
        }
        words.shrink_to_fit();
        Self { dims, rows, words }
    }

    /// Copies a volume.
    #[must_use]
    pub fn of(volume: &BitVolume) -> Self {
        let copy = |row: usize, words: &mut [u64]| words.copy_from_slice(volume.row(row));
        Self::from_rows(volume.dims(), copy)
    }

    /// Returns the voxels that are set in one of two volumes.
    ///
    /// # Panics
    /// If they differ in size.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        assert_eq!(self.dims, other.dims, "boxes of one size");
        Self::from_rows(self.dims, |row, words| {
            let both = self.row(row).iter().zip(other.row(row));
            let both = both.map(|(a, b)| a | b);
            words.iter_mut().zip(both).for_each(|(word, b)| *word = b);
        })
    }

    /// Returns the volume with the rows of each slice along z in the opposite order.
    #[must_use]
    pub fn upside_down(&self) -> Self {
        let slices = self.rows.chunks(self.dims[1].max(1));
        Self {
            dims: self.dims,
            rows: slices.flat_map(|s| s.iter().rev()).copied().collect(),
            words: self.words.clone(),
        }
    }

    /// Returns the numbers of voxels along x, y and z.
    #[must_use]
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Returns `true` if no voxel is set.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.iter().all(|&row| row == 0)
    }

    /// Returns the number of set voxels.
    #[must_use]
    pub fn count(&self) -> usize {
        let ones = |row: usize| self.row(row).iter().map(|w| w.count_ones() as usize);
        (0..self.rows.len()).flat_map(ones).sum()
    }

    /// Returns `true` if voxel `(i, j, k)` is set.
    ///
    /// # Panics
    /// If it is outside the box.
    #[must_use]
    #[inline]
    pub fn get(&self, i: usize, j: usize, k: usize) -> bool {
        let [nx, ny, _] = self.dims;
        assert!(i < nx && j < ny, "voxel ({i}, {j}, {k}) outside");
        self.row(j + ny * k)[i / 64] >> (i % 64) & 1 != 0
    }

    /// Returns the volume with a bit for each voxel.
    #[must_use]
    pub fn dense(&self) -> BitVolume {
        let mut volume = BitVolume::new(self.dims);
        self.add_to(&mut volume);
        volume
    }

    /// Sets the same voxels in a volume of the same size.
    ///
    /// # Panics
    /// If it is of another size.
    pub fn add_to(&self, volume: &mut BitVolume) {
        assert_eq!(volume.dims(), self.dims, "boxes of one size");
        for (row, _) in self.rows.iter().enumerate().filter(|(_, at)| **at != 0) {
            volume.unite_row(row, self.row(row));
        }
    }

    /// Returns the words of row `row = j + ny * k`.
    #[must_use]
    #[inline]
    pub fn row(&self, row: usize) -> &[u64] {
        let width = self.dims[0].div_ceil(64);
        &self.words[self.rows[row] as usize * width..][..width]
    }
}

impl VoxelRows for SparseVolume {
    fn dims(&self) -> [usize; 3] {
        self.dims
    }

    fn row(&self, row: usize) -> &[u64] {
        self.row(row)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_same_voxels_are_set(
            dims in [0_usize..140, 1_usize..6, 1_usize..6], each in 1_usize..300, tall in 1_usize..4,
        ) {
            let [nx, ny, nz] = dims;
            // Rows alike below each other, empty ones among them.
            let is_set = |i: usize| (i % nx + i / nx / tall * nx) % each == each / 2;
            let volume = BitVolume::from_fn(dims, is_set);
            let sparse = SparseVolume::of(&volume);
            for i in 0..nx * ny * nz {
                let [x, y, z] = [i % nx, i / nx % ny, i / (nx * ny)];
                prop_assert_eq!(sparse.get(x, y, z), volume.get_index(i));
            }
            prop_assert_eq!(sparse.is_empty(), volume.count() == 0);
            prop_assert_eq!(sparse.count(), volume.count());
            prop_assert_eq!(&sparse.dense(), &volume);

            let other = BitVolume::from_fn(dims, |i| i % 7 == 3);
            let both = sparse.union(&SparseVolume::of(&other)).dense();
            let mut expected = volume;
            expected.union_with(&other);
            prop_assert_eq!(both, expected);
            let turned = sparse.upside_down();
            for row in 0..ny * nz {
                prop_assert_eq!(turned.row(ny - 1 - row % ny + row / ny * ny), sparse.row(row));
            }
        }
    }

    #[test]
    fn a_wall_that_goes_straight_up_is_kept_once() {
        let dims = [640, 50, 4];
        let is_wall = |i: usize| i % 640 == 300 && i / 640 % 50 > 10;
        let sparse = SparseVolume::of(&BitVolume::from_fn(dims, is_wall));
        assert_eq!(sparse.words.len(), 2 * 10);
    }
}
