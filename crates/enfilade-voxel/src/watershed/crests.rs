//! Crests: the voxels that no neighbor exceeds, and which of them are peaks.

use enfilade_geom::{Allowance, Sets};
use rayon::prelude::*;

use super::super::grid::{BitVolume, for_runs};
use super::basins::STEPS;

/// The part of a word that is a level; 0 is occupied.
pub(super) const LEVEL: u16 = 0x3FFF;
/// Marks a free voxel that is known to be outdoors.
const OUTDOORS: u16 = 0x8000;

/// Crest voxels at this many steps from the rim of their plateau, or more, count as peaks.
///
/// So an ascent depends on voxels within that distance only, however large a plateau is.
const FAR: u32 = 255;

/// A box whose voxels are numbered along x, then y, then z.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    pub(super) dims: [usize; 3],
}

impl Shape {
    pub(super) fn layer(&self) -> usize {
        self.dims[0] * self.dims[1]
    }

    pub(super) fn coords(&self, voxel: usize) -> [usize; 3] {
        let [nx, ny, _] = self.dims;
        [voxel % nx, voxel / nx % ny, voxel / (nx * ny)]
    }

    /// Returns the voxels that share a face with the one at `at`, in ascending order.
    pub(super) fn neighbors(&self, [x, y, z]: [usize; 3]) -> impl Iterator<Item = usize> + use<> {
        let [nx, ny, nz] = self.dims;
        let layer = nx * ny;
        let voxel = x + nx * y + layer * z;
        let all = [
            (z > 0, voxel.wrapping_sub(layer)),
            (y > 0, voxel.wrapping_sub(nx)),
            (x > 0, voxel.wrapping_sub(1)),
            (x + 1 < nx, voxel + 1),
            (y + 1 < ny, voxel + nx),
            (z + 1 < nz, voxel + layer),
        ];
        all.into_iter().filter(|n| n.0).map(|n| n.1)
    }
}

/// Converts squared distances to levels, in place, and marks the free voxels of `outdoors`.
pub(super) fn to_levels(dims: [usize; 3], words: &mut [u16], outdoors: Option<&BitVolume>) {
    let table: Vec<u16> = (0..=u16::MAX)
        .map(|d| (f64::from(d).sqrt() * f64::from(STEPS)) as u16)
        .collect();
    let rows = words.par_chunks_mut(dims[0].max(1)).enumerate();
    rows.with_min_len(64).for_each(|(row, words)| {
        for word in &mut *words {
            *word = table[usize::from(*word)];
        }
        if let Some(outdoors) = outdoors {
            for_runs(outdoors.row(row), |from, to| {
                for word in &mut words[from as usize..to as usize] {
                    *word |= if *word == 0 { 0 } else { OUTDOORS };
                }
            });
        }
    });
}

pub(super) fn level(word: u16) -> u16 {
    word & LEVEL
}

pub(super) fn is_outdoors(word: u16) -> bool {
    word & OUTDOORS != 0
}

/// A summit of the field: where a basin starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Peak {
    pub(super) level: u16,
    /// First voxel of its plateau.
    pub(super) voxel: u32,
}

/// The crests of a field: free voxels, not outdoors, that no neighbor exceeds.
pub(super) struct Crests {
    /// One bit a voxel, by index.
    bits: Vec<u64>,
    /// Number of crest voxels before each word of `bits`.
    before: Vec<u32>,
    /// For each crest voxel the steps along its plateau to a voxel with a higher neighbor; on a peak [`FAR`] plus its
    /// number.
    steps: Vec<u32>,
    /// Deepest first, then by voxel.
    pub(super) peaks: Vec<Peak>,
}

impl Crests {
    /// Finds the crests. Linear in voxels; a fifth of a byte a voxel, and 12 bytes for each crest voxel, 4 of them to stay.
    pub(super) fn of(shape: Shape, words: &[u16], allowance: &Allowance) -> Self {
        let found = find(shape, words, allowance);
        let mut bits = vec![0_u64; words.len().div_ceil(64)];
        for &voxel in &found {
            bits[voxel as usize / 64] |= 1 << (voxel % 64);
        }
        let mut n = 0;
        let before = bits
            .iter()
            .map(|word| {
                n += word.count_ones();
                n - word.count_ones()
            })
            .collect();
        let mut crests = Self {
            bits,
            before,
            steps: vec![FAR; found.len()],
            peaks: Vec::new(),
        };
        crests.measure(shape, words, &found, allowance);
        crests.number(shape, words, &found);
        crests
    }

    /// Returns the position of a voxel among all crest voxels.
    fn find(&self, voxel: usize) -> Option<usize> {
        let (word, bit) = (self.bits[voxel / 64], voxel % 64);
        let below = word & ((1 << bit) - 1);
        (word >> bit & 1 != 0)
            .then(|| self.before[voxel / 64] as usize + below.count_ones() as usize)
    }

    /// Returns the steps from a voxel to one with a higher neighbor; 0 if it has one itself.
    fn steps_of(&self, voxel: usize) -> u32 {
        self.find(voxel).map_or(0, |at| self.steps[at])
    }

    /// Measures the steps breadth first, from the rims of plateaus inward.
    fn measure(&mut self, shape: Shape, words: &[u16], found: &[u32], allowance: &Allowance) {
        let level_of = |voxel: usize| level(words[voxel]);
        let beside = |voxel: usize| {
            let here = level_of(voxel);
            let around = shape.neighbors(shape.coords(voxel));
            around.filter(move |&q| level_of(q) == here)
        };
        let is_rim = |&&voxel: &&u32| beside(voxel as usize).any(|q| self.find(q).is_none());
        let mut front: Vec<u32> = found.par_iter().filter(is_rim).copied().collect();
        for steps in 1..FAR {
            for &voxel in &front {
                if let Some(at) = self.find(voxel as usize) {
                    self.steps[at] = steps;
                }
            }
            if !allowance.spend(1 + front.len() as u64 / 2) {
                return;
            }
            let mut next: Vec<u32> = Vec::new();
            for &voxel in &front {
                let is_new = |&q: &usize| self.steps_of(q) == FAR;
                next.extend(beside(voxel as usize).filter(is_new).map(|q| q as u32));
            }
            next.sort_unstable();
            next.dedup();
            if next.is_empty() {
                return;
            }
            front = next;
        }
    }

    /// Numbers the peaks: sets of crest voxels at one level that the rims do not reach.
    fn number(&mut self, shape: Shape, words: &[u16], found: &[u32]) {
        let mut plateaus = Sets::new(found.len());
        for (at, &voxel) in found.iter().enumerate() {
            if self.steps[at] < FAR {
                continue;
            }
            let voxel = voxel as usize;
            let [x, y, z] = shape.coords(voxel);
            let [nx, ny, nz] = shape.dims;
            let nexts = [
                (x + 1 < nx, voxel + 1),
                (y + 1 < ny, voxel + nx),
                (z + 1 < nz, voxel + shape.layer()),
            ];
            for (_, q) in nexts.into_iter().filter(|n| n.0) {
                if level(words[q]) == level(words[voxel])
                    && let Some(other) = self.find(q).filter(|&o| self.steps[o] == FAR)
                {
                    plateaus.join(at as u32, other as u32);
                }
            }
        }
        // The least member of a set is its first voxel.
        let first = plateaus.into_least();
        let is_peak = |&at: &usize| self.steps[at] == FAR && first[at] as usize == at;
        let level_at = |at: usize| level(words[found[at] as usize]);
        let mut order: Vec<usize> = (0..found.len()).filter(is_peak).collect();
        order.par_sort_unstable_by_key(|&at| (std::cmp::Reverse(level_at(at)), at));
        self.peaks = order
            .iter()
            .map(|&at| Peak {
                level: level_at(at),
                voxel: found[at],
            })
            .collect();
        for (n, &at) in order.iter().enumerate() {
            self.steps[at] += n as u32;
        }
        for (at, &first) in first.iter().enumerate() {
            if self.steps[at] == FAR {
                self.steps[at] = self.steps[first as usize];
            }
        }
    }

    /// Returns the next voxel of the ascent from a crest voxel, on the shortest way to its plateau's rim and last of
    /// several; or the number of its peak.
    pub(super) fn ascend(
        &self,
        shape: Shape,
        level: impl Fn(usize) -> u16,
        voxel: usize,
    ) -> Result<usize, u32> {
        let steps = self.steps_of(voxel);
        if steps >= FAR {
            return Err(steps - FAR);
        }
        let here = level(voxel);
        let is_nearer = |&q: &usize| level(q) == here && self.steps_of(q) < steps;
        let next = shape
            .neighbors(shape.coords(voxel))
            .filter(is_nearer)
            .last();
        Ok(next.unwrap_or(voxel))
    }
}

/// Returns all crest voxels, in ascending order.
fn find(shape: Shape, words: &[u16], allowance: &Allowance) -> Vec<u32> {
    let [nx, ny, nz] = shape.dims;
    let row_of = |row: usize| &words[row * nx..(row + 1) * nx];
    let layers = (0..nz).into_par_iter();
    let of_layer = |z: usize| {
        let mut found = Vec::new();
        let mut most = vec![0_u16; nx];
        for y in 0..ny {
            let row = y + ny * z;
            let here = row_of(row);
            most.fill(0);
            let around = [
                (z > 0, row.wrapping_sub(ny)),
                (y > 0, row.wrapping_sub(1)),
                (y + 1 < ny, row + 1),
                (z + 1 < nz, row + ny),
            ];
            for (_, other) in around.into_iter().filter(|a| a.0) {
                for (most, word) in most.iter_mut().zip(row_of(other)) {
                    *most = (*most).max(level(*word));
                }
            }
            for (most, word) in most[1..].iter_mut().zip(here) {
                *most = (*most).max(level(*word));
            }
            for (most, word) in most.iter_mut().zip(&here[1..]) {
                *most = (*most).max(level(*word));
            }
            for (x, (&word, &most)) in here.iter().zip(&most).enumerate() {
                // Neither occupied nor outdoors.
                if word != 0 && word < OUTDOORS && word >= most {
                    found.push((row * nx + x) as u32);
                }
            }
        }
        found
    };
    let is_allowed = allowance.each(1 + shape.layer() as u64 / 32);
    let per_layer: Vec<Vec<u32>> = layers.filter(is_allowed).map(of_layer).collect();
    per_layer.concat()
}
