//! Crests: the voxels that no neighbor exceeds, and which of them are peaks.

use enfilade_geom::{Allowance, Sets};
use rayon::prelude::*;

use super::levels::{Levels, OUTDOORS, level};

/// Crest voxels at this many steps from the rim of their plateau, or more, count as peaks.
///
/// So an ascent depends on voxels within that distance only, however large a plateau is.
const FAR: u32 = 255;

/// A box whose voxels are numbered along x, then y, then z.
#[derive(Clone, Copy, Debug)]
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

/// A summit of the field: where a basin starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Peak {
    pub(super) level: u16,
    /// First voxel of its plateau.
    pub(super) voxel: u32,
}

/// A crest voxel as it is found.
#[derive(Clone, Copy)]
struct Crest {
    voxel: u32,
    level: u16,
    /// The neighbors at the same level, a bit for each in the order of [`Shape::neighbors`].
    alike: u8,
}

impl Crest {
    /// Returns the neighbors at the same level, those of `mask`.
    fn beside(&self, shape: Shape, mask: u8) -> impl Iterator<Item = usize> + use<> {
        let [row, layer] = [shape.dims[0] as isize, shape.layer() as isize];
        let steps = [-layer, -row, -1, 1, row, layer];
        let (voxel, alike) = (self.voxel as usize, self.alike & mask);
        let is_alike = move |k: &usize| alike >> k & 1 != 0;
        (0..6)
            .filter(is_alike)
            .map(move |k| voxel.wrapping_add_signed(steps[k]))
    }
}

/// All neighbors.
const AROUND: u8 = 0b11_1111;
/// Those that come after a voxel.
const AFTER: u8 = 0b11_1000;

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
    /// Finds the crests, in slabs of `thick` layers.
    ///
    /// Linear in voxels; a fifth of a byte a voxel, and 16 bytes for each crest voxel, 4 of them to stay.
    pub(super) fn of(shape: Shape, levels: &Levels, thick: usize, allowance: &Allowance) -> Self {
        let found = find(shape, levels, thick, allowance);
        let n_voxels = shape.layer() * shape.dims[2];
        let mut bits = vec![0_u64; n_voxels.div_ceil(64)];
        for crest in &found {
            bits[crest.voxel as usize / 64] |= 1 << (crest.voxel % 64);
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
        crests.measure(shape, &found, allowance);
        crests.number(shape, &found);
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
    fn measure(&mut self, shape: Shape, found: &[Crest], allowance: &Allowance) {
        let beside = |at: u32| {
            let around = found[at as usize].beside(shape, AROUND);
            around.map(|q| self.find(q))
        };
        let is_rim = |&at: &u32| beside(at).any(|q| q.is_none());
        let all = 0..found.len() as u32;
        let mut front: Vec<u32> = all.into_par_iter().filter(is_rim).collect();
        for steps in 1..FAR {
            for &at in &front {
                self.steps[at as usize] = steps;
            }
            if !allowance.spend(1 + front.len() as u64 / 2) {
                return;
            }
            let mut next: Vec<u32> = Vec::new();
            for &at in &front {
                let around = found[at as usize].beside(shape, AROUND);
                let crests = around.filter_map(|q| self.find(q));
                next.extend(crests.filter(|&q| self.steps[q] == FAR).map(|q| q as u32));
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
    fn number(&mut self, shape: Shape, found: &[Crest]) {
        let mut plateaus = Sets::new(found.len());
        for (at, crest) in found.iter().enumerate() {
            if self.steps[at] < FAR {
                continue;
            }
            for q in crest.beside(shape, AFTER) {
                if let Some(other) = self.find(q).filter(|&o| self.steps[o] == FAR) {
                    plateaus.join(at as u32, other as u32);
                }
            }
        }
        // The least member of a set is its first voxel.
        let first = plateaus.into_least();
        let is_peak = |&at: &usize| self.steps[at] == FAR && first[at] as usize == at;
        let level_at = |at: usize| found[at].level;
        let mut order: Vec<usize> = (0..found.len()).filter(is_peak).collect();
        order.par_sort_unstable_by_key(|&at| (std::cmp::Reverse(level_at(at)), at));
        self.peaks = order
            .iter()
            .map(|&at| Peak {
                level: level_at(at),
                voxel: found[at].voxel,
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
fn find(shape: Shape, levels: &Levels, thick: usize, allowance: &Allowance) -> Vec<Crest> {
    let [nx, ny, nz] = shape.dims;
    let of_slab = |buffer: &mut Vec<u16>, s: usize| {
        let own = s * thick..nz.min((s + 1) * thick);
        let read = [own.start.saturating_sub(1), nz.min(own.end + 1)];
        let words = levels.read(shape, read, buffer);
        let row_of = |row: usize| &words[(row - read[0] * ny) * nx..][..nx];
        let mut found = Vec::new();
        let mut most = vec![0_u16; nx];
        for row in own.start * ny..own.end * ny {
            let here = row_of(row);
            let rows = rows_around(shape, row).map(|other| other.map(row_of));
            most.fill(0);
            for other in rows.into_iter().flatten() {
                for (most, word) in most.iter_mut().zip(other) {
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
                    let [z_before, y_before, y_after, z_after] = rows.map(|row| row.map(|r| r[x]));
                    let x_before = (x > 0).then(|| here[x - 1]);
                    let x_after = here.get(x + 1).copied();
                    let around = [z_before, y_before, x_before, x_after, y_after, z_after];
                    let is_alike = |w: Option<u16>| w.is_some_and(|w| level(w) == word);
                    let bits = (0..).zip(around.map(is_alike));
                    found.push(Crest {
                        voxel: (row * nx + x) as u32,
                        level: word,
                        alike: bits.fold(0, |mask, (k, is)| mask | u8::from(is) << k),
                    });
                }
            }
        }
        found
    };
    let is_allowed = allowance.each(1 + (thick * shape.layer()) as u64 / 32);
    let slabs = (0..nz.div_ceil(thick)).into_par_iter().filter(is_allowed);
    let per_slab: Vec<Vec<Crest>> = slabs.map_init(Vec::new, of_slab).collect();
    per_slab.concat()
}

/// Returns the rows that share faces with a row: before it along z and y, and after it along y and z.
pub(super) fn rows_around(shape: Shape, row: usize) -> [Option<usize>; 4] {
    let [_, ny, nz] = shape.dims;
    let (y, z) = (row % ny, row / ny);
    [
        (z > 0).then(|| row - ny),
        (y > 0).then(|| row - 1),
        (y + 1 < ny).then(|| row + 1),
        (z + 1 < nz).then(|| row + ny),
    ]
}
