//! Voxel grids in the world, and volumes with one bit per voxel.

use std::ops::Range;

use enfilade_geom::{Aabb, DVec3};

/// Placement of a box of voxels in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Minimum of voxel `(0, 0, 0)` along each axis. [Units: wu]
    pub origin: DVec3,
    /// Edge of a voxel. [Units: wu] [Limit: above 0]
    pub voxel: f64,
    /// Voxels along x, y and z.
    pub dims: [usize; 3],
}

impl Grid {
    /// Makes the smallest grid of cubes with edge `voxel` around `bounds`, with `pad` more voxels on every
    /// side. An empty box gives the padding alone.
    ///
    /// # Panics
    /// If `voxel` is not a positive number or `bounds` is not finite.
    #[must_use]
    pub fn covering(bounds: &Aabb, voxel: f64, pad: usize) -> Self {
        assert!(
            voxel > 0.0 && voxel.is_finite(),
            "voxel edge must be positive, got {voxel}"
        );
        if bounds.is_empty() {
            return Self {
                origin: DVec3::ZERO,
                voxel,
                dims: [2 * pad; 3],
            };
        }
        assert!(
            bounds.min.is_finite() && bounds.max.is_finite(),
            "bounds must be finite"
        );
        let n = (bounds.size() / voxel).ceil().max(DVec3::ONE);
        // Centered: both sides share the excess of rounding up.
        let origin = bounds.center() - n * (0.5 * voxel) - pad as f64 * voxel;
        Self {
            origin,
            voxel,
            dims: n.to_array().map(|n| n as usize + 2 * pad),
        }
    }

    /// Returns the number of voxels in the box.
    #[must_use]
    pub fn n_voxels(&self) -> usize {
        self.dims.iter().product()
    }

    /// Returns the index of voxel `(i, j, k)`.
    #[must_use]
    pub fn index(&self, i: usize, j: usize, k: usize) -> usize {
        debug_assert!(i < self.dims[0] && j < self.dims[1] && k < self.dims[2]);
        i + self.dims[0] * (j + self.dims[1] * k)
    }

    /// Returns the voxel `(i, j, k)` at `index`.
    #[must_use]
    pub fn coords(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.dims;
        [index % nx, index / nx % ny, index / nx / ny]
    }

    /// Returns the center of voxel `(i, j, k)`, which may lie outside the box. [Units: wu]
    #[must_use]
    pub fn center(&self, i: usize, j: usize, k: usize) -> DVec3 {
        self.to_world(DVec3::new(i as f64, j as f64, k as f64) + 0.5)
    }

    /// Converts a world point to voxel coordinates: voxel `(i, j, k)` spans `i..i + 1`, `j..j + 1`, `k..k + 1`.
    #[must_use]
    pub fn to_voxel(&self, world: DVec3) -> DVec3 {
        (world - self.origin) / self.voxel
    }

    /// Converts voxel coordinates to a world point.
    #[must_use]
    pub fn to_world(&self, voxel: DVec3) -> DVec3 {
        self.origin + voxel * self.voxel
    }

    /// Returns the voxel that contains a world point; `None` outside the box.
    #[must_use]
    pub fn voxel_at(&self, world: DVec3) -> Option<[usize; 3]> {
        let v = self.to_voxel(world).floor().to_array();
        let inside = (0..3).all(|a| v[a] >= 0.0 && v[a] < self.dims[a] as f64);
        inside.then(|| v.map(|c| c as usize))
    }

    /// Returns the whole box in the world.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        let [nx, ny, nz] = self.dims.map(|n| n as f64);
        Aabb::new(self.origin, self.to_world(DVec3::new(nx, ny, nz)))
    }
}

/// A volume of one bit per voxel. Each row along x starts a new 64-bit word; the bits past its end are zero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BitVolume {
    dims: [usize; 3],
    words: Vec<u64>,
}

impl BitVolume {
    /// Makes a volume with all voxels clear. Takes one bit per voxel, rows rounded up to 64.
    #[must_use]
    pub fn new(dims: [usize; 3]) -> Self {
        Self {
            dims,
            words: vec![0; dims[0].div_ceil(64) * dims[1] * dims[2]],
        }
    }

    /// Makes the volume whose bit at each index is `set(index)`, rows in parallel.
    #[must_use]
    pub fn from_fn(dims: [usize; 3], set: impl Fn(usize) -> bool + Sync) -> Self {
        use rayon::prelude::*;
        let mut out = Self::new(dims);
        if dims[0] > 0 {
            let per_row = out.row_words();
            out.words
                .par_chunks_mut(per_row)
                .enumerate()
                .for_each(|(row, words)| {
                    for (w, word) in words.iter_mut().enumerate() {
                        let first = w * 64;
                        for bit in 0..64.min(dims[0] - first) {
                            *word |= u64::from(set(row * dims[0] + first + bit)) << bit;
                        }
                    }
                });
        }
        out
    }

    /// Returns the numbers of voxels along x, y and z.
    #[must_use]
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Returns the number of voxels in the box, set or not.
    #[must_use]
    pub fn n_voxels(&self) -> usize {
        self.dims.iter().product()
    }

    /// Returns the number of words per row along x.
    #[must_use]
    pub(crate) fn row_words(&self) -> usize {
        self.dims[0].div_ceil(64)
    }

    /// Returns all words, rows in order of y, then z; bit `i % 64` of word `i / 64` of a row is voxel `i`.
    #[must_use]
    pub(crate) fn words(&self) -> &[u64] {
        &self.words
    }

    /// As [`Self::words`], mutable. Bits past a row's end must stay zero.
    pub(super) fn words_mut(&mut self) -> &mut [u64] {
        &mut self.words
    }

    /// Returns the words of row `row = j + ny * k`.
    #[must_use]
    pub fn row(&self, row: usize) -> &[u64] {
        let n = self.row_words();
        &self.words[row * n..(row + 1) * n]
    }

    /// Sets one row. Bits past its end must be 0.
    pub fn set_row(&mut self, row: usize, words: &[u64]) {
        let n = self.row_words();
        self.words_mut()[row * n..][..n].copy_from_slice(words);
    }

    /// Sets the voxels `along` x of one row.
    ///
    /// # Panics
    /// If they do not lie in the row.
    pub fn fill_row(&mut self, row: usize, along: Range<usize>) {
        assert!(along.end <= self.dims[0], "{along:?} outside the row");
        let n = self.row_words();
        set_bits(&mut self.words[row * n..][..n], along.start, along.end);
    }

    /// Clears the voxels `along` x of one row.
    ///
    /// # Panics
    /// If they do not lie in the row.
    pub fn clear_row(&mut self, row: usize, along: Range<usize>) {
        assert!(along.end <= self.dims[0], "{along:?} outside the row");
        let n = self.row_words();
        let row = &mut self.words[row * n..][..n];
        for_words(along.start, along.end, |w, mask| row[w] &= !mask);
    }

    /// Sets the voxels of one row that are set in `words`. Bits past its end must be 0.
    pub fn unite_row(&mut self, row: usize, words: &[u64]) {
        let n = self.row_words();
        let own = self.words[row * n..][..n].iter_mut().zip(words);
        own.for_each(|(own, word)| *own |= word);
    }

    /// Returns the bit of voxel `(i, j, k)`.
    ///
    /// # Panics
    /// If the voxel is outside the box.
    #[must_use]
    pub fn get(&self, i: usize, j: usize, k: usize) -> bool {
        let (word, bit) = self.position(i, j, k);
        self.words[word] >> bit & 1 != 0
    }

    /// Returns the bit of the voxel at `index`.
    ///
    /// # Panics
    /// If the index is out of range.
    #[must_use]
    pub fn get_index(&self, index: usize) -> bool {
        let (row, i) = (index / self.dims[0], index % self.dims[0]);
        self.words[row * self.row_words() + i / 64] >> (i % 64) & 1 != 0
    }

    /// Sets or clears the bit of voxel `(i, j, k)`.
    ///
    /// # Panics
    /// If the voxel is outside the box.
    pub fn set(&mut self, i: usize, j: usize, k: usize, value: bool) {
        let (word, bit) = self.position(i, j, k);
        if value {
            self.words[word] |= 1 << bit;
        } else {
            self.words[word] &= !(1 << bit);
        }
    }

    fn position(&self, i: usize, j: usize, k: usize) -> (usize, usize) {
        let [nx, ny, nz] = self.dims;
        assert!(
            i < nx && j < ny && k < nz,
            "voxel ({i}, {j}, {k}) outside {nx} x {ny} x {nz}"
        );
        ((j + ny * k) * self.row_words() + i / 64, i % 64)
    }

    /// Returns the number of set voxels.
    #[must_use]
    pub fn count(&self) -> usize {
        self.words.iter().map(|w| w.count_ones() as usize).sum()
    }

    /// Returns the indices of the set voxels in ascending order.
    pub fn iter_set(&self) -> impl Iterator<Item = usize> + '_ {
        let per_row = self.row_words().max(1);
        self.words.iter().enumerate().flat_map(move |(at, &word)| {
            let base = at / per_row * self.dims[0] + at % per_row * 64;
            let mut rest = word;
            std::iter::from_fn(move || {
                (rest != 0).then(|| {
                    let bit = rest.trailing_zeros() as usize;
                    rest &= rest - 1;
                    base + bit
                })
            })
        })
    }

    /// Returns the volume with every voxel inverted.
    #[must_use]
    pub fn complement(&self) -> Self {
        let mut out = Self {
            dims: self.dims,
            words: self.words.iter().map(|w| !w).collect(),
        };
        if !self.dims[0].is_multiple_of(64) {
            let tail = (1u64 << (self.dims[0] % 64)) - 1;
            let per_row = self.row_words();
            out.words
                .iter_mut()
                .skip(per_row - 1)
                .step_by(per_row)
                .for_each(|w| *w &= tail);
        }
        out
    }

    /// Returns the set voxels that share a face with a clear one in the box.
    #[must_use]
    pub fn rim(&self) -> Self {
        use rayon::prelude::*;
        let [nx, ny, nz] = self.dims;
        let mut out = Self::new(self.dims);
        if nx == 0 {
            return out;
        }
        let per_row = self.row_words();
        let whole = vec![u64::MAX; per_row];
        out.words
            .par_chunks_mut(per_row)
            .enumerate()
            .with_min_len(64)
            .for_each(|(row, words)| {
                let (y, z) = (row % ny, row / ny);
                let here = self.row(row);
                let beside = |exists: bool, at: usize| {
                    if exists { self.row(at) } else { &whole[..] }
                };
                let around = [
                    beside(y > 0, row.wrapping_sub(1)),
                    beside(y + 1 < ny, row + 1),
                    beside(z > 0, row.wrapping_sub(ny)),
                    beside(z + 1 < nz, row + ny),
                ];
                for (w, word) in words.iter_mut().enumerate() {
                    // Nothing is clear beyond both ends of the row.
                    let before = if w == 0 { 1 } else { here[w - 1] >> 63 };
                    let after = here.get(w + 1).map_or(1, |next| next & 1) << 63;
                    let end = nx - 1 - w * 64;
                    let last = if end < 64 { 1 << end } else { 0 };
                    let all = around.iter().fold(u64::MAX, |all, r| all & r[w]);
                    let along = (here[w] << 1 | before) & (here[w] >> 1 | after | last);
                    *word = here[w] & !(along & all);
                }
            });
        out
    }

    /// Clears every voxel that is set in `other`.
    ///
    /// # Panics
    /// If the boxes differ in size.
    pub fn subtract(&mut self, other: &Self) {
        assert_eq!(self.dims, other.dims, "boxes of one size");
        let words = self.words.iter_mut().zip(&other.words);
        words.for_each(|(a, b)| *a &= !b);
    }

    /// Sets every voxel that is set in `other`.
    ///
    /// # Panics
    /// If the boxes differ in size.
    pub fn union_with(&mut self, other: &Self) {
        assert_eq!(self.dims, other.dims, "boxes of one size");
        self.words
            .iter_mut()
            .zip(&other.words)
            .for_each(|(a, b)| *a |= b);
    }
}

/// Sets bits `from..to` of a row.
pub fn set_bits(row: &mut [u64], from: usize, to: usize) {
    for_words(from, to, |w, mask| row[w] |= mask);
}

/// Calls `word` with the index of each word that bits `from..to` lie in, and these bits.
fn for_words(from: usize, to: usize, mut word: impl FnMut(usize, u64)) {
    if from >= to {
        return;
    }
    let (first, last) = (from / 64, (to - 1) / 64);
    let head = !0u64 << (from % 64);
    let tail = !0u64 >> (63 - (to - 1) % 64);
    if first == last {
        word(first, head & tail);
    } else {
        word(first, head);
        (first + 1..last).for_each(|w| word(w, !0));
        word(last, tail);
    }
}

/// Calls `run(from, to)` for each maximal run of set bits `from..to` of a row, ascending.
pub fn for_runs(row: &[u64], mut run: impl FnMut(u32, u32)) {
    let mut open: Option<u32> = None;
    for (w, &word) in row.iter().enumerate() {
        let base = w as u32 * 64;
        match (word, open) {
            (0, None) | (u64::MAX, Some(_)) => continue,
            (0, Some(from)) => {
                run(from, base);
                open = None;
                continue;
            }
            _ => {}
        }
        // Walk the ends of the runs: `edges` has a bit wherever a voxel differs from the one before.
        let mut edges = word ^ (word << 1) ^ u64::from(open.is_some());
        while edges != 0 {
            let at = base + edges.trailing_zeros();
            edges &= edges - 1;
            match open.take() {
                Some(from) => run(from, at),
                None => open = Some(at),
            }
        }
    }
    if let Some(from) = open {
        run(from, row.len() as u32 * 64);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn points_round_trip_between_world_and_voxels() {
        let bounds = Aabb::new(DVec3::new(-1.0, 2.0, 0.5), DVec3::new(3.05, 2.5, 9.0));
        let grid = Grid::covering(&bounds, 0.1, 2);
        assert_eq!(grid.dims, [45, 9, 89]);
        assert!(grid.aabb().contains(bounds.min) && grid.aabb().contains(bounds.max));
        for index in [0, 17, grid.n_voxels() - 1] {
            let [i, j, k] = grid.coords(index);
            assert_eq!(grid.index(i, j, k), index);
            assert_eq!(grid.voxel_at(grid.center(i, j, k)), Some([i, j, k]));
        }
        assert_eq!(grid.voxel_at(grid.origin - 0.01), None);
        assert_eq!(grid.voxel_at(DVec3::NAN), None);
        assert_eq!(Grid::covering(&Aabb::EMPTY, 1.0, 1).dims, [2; 3]);
    }

    proptest! {
        #[test]
        fn bits_count_iterate_and_run_like_a_list_of_booleans(
            nx in 1usize..300, ny in 1usize..4, nz in 1usize..4, seed in any::<u64>(),
            length in prop_oneof![1u64..4, 4u64..200],
        ) {
            let dims = [nx, ny, nz];
            // Runs of about `length` voxels: single ones, and ones that fill whole words.
            let (mut s, mut value) = (seed | 1, false);
            let plain: Vec<bool> = (0..nx * ny * nz).map(|_| {
                s ^= s << 13; s ^= s >> 7; s ^= s << 17;
                value ^= (s >> 33).is_multiple_of(length);
                value
            }).collect();
            let bits = BitVolume::from_fn(dims, |i| plain[i]);
            prop_assert_eq!(bits.count(), plain.iter().filter(|&&b| b).count());
            let listed: Vec<usize> = (0..plain.len()).filter(|&i| plain[i]).collect();
            prop_assert_eq!(bits.iter_set().collect::<Vec<_>>(), listed);
            let other = bits.complement();
            prop_assert_eq!(other.count(), plain.len() - bits.count());
            for (i, &b) in plain.iter().enumerate() {
                let [x, y, z] = [i % nx, i / nx % ny, i / nx / ny];
                prop_assert_eq!(bits.get(x, y, z), b);
                prop_assert_eq!(bits.get_index(i), b);
                prop_assert_eq!(other.get(x, y, z), !b);
            }
            let rim = bits.rim();
            for (v, &is_set) in plain.iter().enumerate() {
                let at = [v % nx, v / nx % ny, v / nx / ny];
                let is_rim = (0..3).any(|k| [-1, 1].into_iter().any(|step| {
                    let mut next = at.map(|c| c as i64);
                    next[k] += step;
                    let is_in = (0..3).all(|k| (0..dims[k] as i64).contains(&next[k]));
                    let [x, y, z] = next.map(|c| c as usize);
                    is_in && !bits.get(x, y, z)
                }));
                prop_assert_eq!(rim.get_index(v), is_set && is_rim);
            }
            for row in 0..ny * nz {
                let mut again = vec![0u64; bits.row_words()];
                let mut last = None;
                for_runs(bits.row(row), |a, b| {
                    assert!(a < b && last.is_none_or(|l| l < a), "runs are maximal and ascend");
                    last = Some(b);
                    set_bits(&mut again, a as usize, b as usize);
                });
                prop_assert_eq!(&again[..], bits.row(row));
            }
        }
    }
}
