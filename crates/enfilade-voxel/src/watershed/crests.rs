//! Crests: the voxels that no neighbor exceeds, and which of them are peaks.

use enfilade_geom::{Allowance, Sets};
use rayon::prelude::*;

use super::levels::{Levels, OUTDOORS, level};
use super::shape::Shape;

/// Crest voxels at this many steps from the rim of their plateau, or more, count as peaks.
///
/// So an ascent depends on voxels within that distance only, however large a plateau is.
const FAR: u8 = u8::MAX;

/// A summit of the field: where a basin starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Peak {
    pub(super) level: u16,
    /// First voxel of its plateau.
    pub(super) voxel: u32,
}

/// All neighbors in a mask of those alike, a bit for each in the order of [`Shape::neighbors`].
const AROUND: u8 = 0b11_1111;

/// The crests of a field: free voxels, not outdoors, that no neighbor exceeds.
pub(super) struct Crests {
    /// The crest voxels.
    crests: Ranked,
    /// For each crest voxel the steps along its plateau to a voxel with a higher neighbor; [`FAR`] on a peak. A byte each: to keep
    /// only those inside plateaus took a tenth longer.
    steps: Vec<u8>,
    /// Those of the crest voxels that are on peaks, by their position among all.
    summits: Ranked,
    /// Those of these that begin a run of voxels on one peak along x, by their position among them.
    runs: Ranked,
    /// The number of the peak of each run.
    peak_of: Vec<u32>,
    /// Deepest first, then by voxel.
    pub(super) peaks: Vec<Peak>,
}

/// For each crest voxel the mask of neighbors at the same level.
type Alike = Vec<u8>;

/// A set of indices, each of which tells its position among all.
#[derive(Default)]
struct Ranked {
    bits: Vec<u64>,
    /// Number of members before each [`BLOCK`] of `bits`.
    before: Vec<u32>,
    n: usize,
}

/// Words between two counts. With 8, a flood took half as long again: counting bits takes a dozen instructions a word.
const BLOCK: usize = 2;

impl Ranked {
    fn of(bits: Vec<u64>) -> Self {
        let mut n = 0;
        let count = |words: &[u64]| {
            n += count_ones(words);
            n - count_ones(words)
        };
        let before = bits.chunks(BLOCK).map(count).collect();
        Self {
            n: n as usize,
            bits,
            before,
        }
    }

    /// Returns the places at which `is_in` holds. Threads share the work.
    fn where_in(all: &[u8], is_in: impl Fn(u8) -> bool + Sync) -> Self {
        let word = |part: &[u8]| {
            let bits = (0..).zip(part.iter().map(|&s| u64::from(is_in(s))));
            bits.fold(0, |word, (k, bit)| word | bit << k)
        };
        Self::of(all.par_chunks(64).map(word).collect())
    }

    fn contains(&self, index: usize) -> bool {
        self.bits[index / 64] >> (index % 64) & 1 != 0
    }

    /// Returns the position of an index among all members.
    fn position(&self, index: usize) -> Option<usize> {
        self.contains(index).then(|| self.n_below(index))
    }

    /// Returns the number of members below an index.
    fn n_below(&self, index: usize) -> usize {
        let (at, block) = (index / 64, index / 64 / BLOCK);
        let below = self.bits[at] & ((1 << (index % 64)) - 1);
        let n = count_ones(&self.bits[block * BLOCK..at]) + below.count_ones();
        (self.before[block] + n) as usize
    }

    /// Returns all members, each with its position, in order. Threads share the work.
    fn all(&self) -> impl ParallelIterator<Item = (usize, usize)> + '_ {
        let blocks = self.bits.par_chunks(BLOCK).zip(&self.before).enumerate();
        blocks.flat_map_iter(|(b, (words, &before))| members_of(b, words, before))
    }

    /// Returns all members, each with its position, one after the other.
    fn iter(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let blocks = self.bits.chunks(BLOCK).zip(&self.before).enumerate();
        blocks.flat_map(|(b, (words, &before))| members_of(b, words, before))
    }
}

fn count_ones(words: &[u64]) -> u32 {
    words.iter().map(|word| word.count_ones()).sum()
}

/// Returns the members in block `b` of a set, each with its position, given the number of members before it.
fn members_of(b: usize, words: &[u64], before: u32) -> impl Iterator<Item = (usize, usize)> + '_ {
    let of_word = move |(w, &word): (usize, &u64)| {
        let mut rest = word;
        std::iter::from_fn(move || {
            let bit = rest.trailing_zeros() as usize;
            rest &= rest.wrapping_sub(1);
            (bit < 64).then_some((b * BLOCK + w) * 64 + bit)
        })
    };
    let members = words.iter().enumerate().flat_map(of_word);
    (before as usize..).zip(members)
}

impl Crests {
    /// Finds the crests, in slabs of `thick` layers.
    ///
    /// Linear in voxels; an eighth of a byte a voxel, and 2 bytes for each crest voxel for the time of the search.
    pub(super) fn of(shape: Shape, levels: &Levels, thick: usize, allowance: &Allowance) -> Self {
        let (bits, alike) = find(shape, levels, thick, allowance);
        let mut crests = Self {
            crests: Ranked::of(bits),
            steps: Vec::new(),
            summits: Ranked::default(),
            runs: Ranked::default(),
            peak_of: Vec::new(),
            peaks: Vec::new(),
        };
        let steps = crests.measure(shape, &alike, allowance);
        let peaks = crests.number(shape, &steps, &alike);
        drop(alike);
        crests.steps = steps;
        crests.rank(shape, levels, &peaks);
        crests
    }

    /// Returns the steps from a voxel to one with a higher neighbor; 0 if it has one itself.
    fn steps_of(&self, voxel: usize) -> u8 {
        self.crests.position(voxel).map_or(0, |at| self.steps[at])
    }

    /// Measures the steps of all crest voxels breadth first, from the rims of plateaus inward; [`FAR`] on a peak.
    fn measure(&self, shape: Shape, alike: &Alike, allowance: &Allowance) -> Vec<u8> {
        let around = |at: usize, voxel: usize| beside(shape, voxel, alike[at] & AROUND);
        // Most crest voxels are rims, so these are never listed.
        let of_rim =
            |(at, voxel)| match around(at, voxel).any(|q| self.crests.position(q).is_none()) {
                true => 1,
                false => FAR,
            };
        let mut steps: Vec<u8> = self.crests.all().map(of_rim).collect();
        if !allowance.spend(1 + steps.len() as u64 / 2) {
            return steps;
        }
        let steps_of = |steps: &[u8], q: usize| self.crests.position(q).map_or(0, |at| steps[at]);
        let is_next = |&(at, voxel): &(usize, usize)| {
            steps[at] == FAR && around(at, voxel).any(|q| steps_of(&steps, q) == 1)
        };
        let next = self.crests.all().filter(is_next);
        let mut front: Vec<u32> = next.map(|(_, voxel)| voxel as u32).collect();
        for n in 2..FAR {
            for &voxel in &front {
                if let Some(at) = self.crests.position(voxel as usize) {
                    steps[at] = n;
                }
            }
            if front.is_empty() || !allowance.spend(1 + front.len() as u64 / 2) {
                return steps;
            }
            let onward = |&voxel: &u32| {
                let voxel = voxel as usize;
                let inner = self.crests.position(voxel).into_iter();
                let around = inner.flat_map(move |at| around(at, voxel));
                let is_next = |&q: &usize| steps_of(&steps, q) == FAR;
                around.filter(is_next).map(|q| q as u32)
            };
            let many = front.par_iter().with_min_len(1 << 12);
            let mut next: Vec<u32> = many.flat_map_iter(onward).collect();
            next.par_sort_unstable();
            next.dedup();
            front = next;
        }
        steps
    }

    /// Finds the peaks: sets of crest voxels at one level that the rims do not reach. Returns the first voxel of each, and
    /// leaves the numbers in this order.
    fn number(&mut self, shape: Shape, steps: &[u8], alike: &Alike) -> Vec<usize> {
        self.summits = Ranked::where_in(steps, |s| s == FAR);
        // Never listed: on large plateaus, a list would be the largest thing in memory.
        let on_peaks = || self.crests.iter().filter(|&(at, _)| steps[at] == FAR);
        let mut starts = vec![0_u64; self.summits.n.div_ceil(64)];
        let mut next = usize::MAX;
        for (k, (at, voxel)) in on_peaks().enumerate() {
            let goes_on = voxel == next && alike[at] & 1 << 2 != 0;
            starts[k / 64] |= u64::from(!goes_on) << (k % 64);
            next = voxel + 1;
        }
        self.runs = Ranked::of(starts);
        let mut plateaus = Sets::new(self.runs.n);
        let after = [(shape.dims[0], 1 << 4), (shape.layer(), 1 << 5)];
        let mut n_runs = 0;
        for (k, (at, voxel)) in on_peaks().enumerate() {
            n_runs += u32::from(self.runs.contains(k));
            // Both voxels of a pair ascend.
            let alike = after.into_iter().filter(|a| alike[at] & a.1 != 0);
            for (step, _) in alike {
                let other = self.crests.position(voxel + step);
                if let Some(other) = other.and_then(|at| self.summits.position(at)) {
                    plateaus.join(n_runs - 1, self.run_of(other) as u32);
                }
            }
        }
        // The least member of a set begins with its first voxel. The number of each run's peak takes its place.
        let mut number_of = plateaus.into_least();
        let mut peaks = Vec::new();
        let starts = on_peaks()
            .enumerate()
            .filter(|(k, _)| self.runs.contains(*k));
        for (run, (_, (_, voxel))) in starts.enumerate() {
            let first = number_of[run] as usize;
            if first == run {
                number_of[run] = peaks.len() as u32;
                peaks.push(voxel);
            } else {
                number_of[run] = number_of[first];
            }
        }
        self.peak_of = number_of;
        peaks
    }

    /// Returns the run of a summit voxel.
    fn run_of(&self, summit: usize) -> usize {
        self.runs
            .position(summit)
            .unwrap_or_else(|| self.runs.n_below(summit) - 1)
    }

    /// Sorts the peaks, given the first voxel of each in ascending order.
    fn rank(&mut self, shape: Shape, levels: &Levels, peaks: &[usize]) {
        let layers: Vec<&[usize]> = peaks
            .chunk_by(|a, b| a / shape.layer() == b / shape.layer())
            .collect();
        let of_layer = |buffer: &mut Vec<u16>, voxels: &&[usize]| -> Vec<Peak> {
            let z = voxels[0] / shape.layer();
            let words = levels.read(shape, [z, z + 1], buffer);
            let peak = |&voxel: &usize| Peak {
                level: level(words[voxel - z * shape.layer()]),
                voxel: voxel as u32,
            };
            voxels.iter().map(peak).collect()
        };
        let found: Vec<Vec<Peak>> = layers.par_iter().map_init(Vec::new, of_layer).collect();
        let found = found.concat();
        let mut order: Vec<usize> = (0..found.len()).collect();
        order.par_sort_unstable_by_key(|&k| (std::cmp::Reverse(found[k].level), k));
        let mut rank = vec![0_u32; order.len()];
        for (n, &k) in order.iter().enumerate() {
            rank[k] = n as u32;
        }
        for number in &mut self.peak_of {
            *number = rank[*number as usize];
        }
        self.peaks = order.into_iter().map(|k| found[k]).collect();
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
        if steps == FAR {
            let at = self.crests.position(voxel);
            let summit = at.and_then(|at| self.summits.position(at));
            return Err(summit.map_or(0, |k| self.peak_of[self.run_of(k)]));
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

/// Returns the neighbors of a voxel in a mask.
fn beside(shape: Shape, voxel: usize, mask: u8) -> impl Iterator<Item = usize> {
    let [row, layer] = [shape.dims[0] as isize, shape.layer() as isize];
    let steps = [-layer, -row, -1, 1, row, layer];
    let is_in = move |k: &usize| mask >> k & 1 != 0;
    (0..6)
        .filter(is_in)
        .map(move |k| voxel.wrapping_add_signed(steps[k]))
}

/// Returns a bit for each voxel, set for crests, and for each of these the neighbors at the same level.
fn find(shape: Shape, levels: &Levels, thick: usize, allowance: &Allowance) -> (Vec<u64>, Alike) {
    let n_slabs = shape.dims[2].div_ceil(thick);
    let n_voxels = shape.layer() * shape.dims[2];
    let (mut bits, mut alike) = (vec![0_u64; n_voxels.div_ceil(64)], Alike::new());
    let is_allowed = |s: &usize| allowance.spend(1 + shape.n_of_slab(*s, thick) as u64 / 32);
    // Some slabs at a time, so that lists of voxels are short.
    let many = 2 * rayon::current_num_threads();
    for from in (0..n_slabs).step_by(many) {
        let slabs = (from..n_slabs.min(from + many)).into_par_iter();
        let found: Vec<Vec<(u32, u8)>> = slabs
            .filter(is_allowed)
            .map_init(Vec::new, |buffer, s| {
                find_in_slab(shape, levels, [s, thick], buffer)
            })
            .collect();
        for (voxel, mask) in found.into_iter().flatten() {
            bits[voxel as usize / 64] |= 1 << (voxel % 64);
            alike.push(mask);
        }
    }
    (bits, alike)
}

/// Returns the crest voxels of slab `s` of those of `thick` layers, each with its mask, in ascending order.
fn find_in_slab(
    shape: Shape,
    levels: &Levels,
    [s, thick]: [usize; 2],
    buffer: &mut Vec<u16>,
) -> Vec<(u32, u8)> {
    let [nx, ny, nz] = shape.dims;
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
                let mask = bits.fold(0, |mask, (k, is)| mask | u8::from(is) << k);
                found.push(((row * nx + x) as u32, mask));
            }
        }
    }
    found
}

/// Returns the rows that share faces with a row: before it along z and y, and after it along y and z.
fn rows_around(shape: Shape, row: usize) -> [Option<usize>; 4] {
    let [_, ny, nz] = shape.dims;
    let (y, z) = (row % ny, row / ny);
    [
        (z > 0).then(|| row - ny),
        (y > 0).then(|| row - 1),
        (y + 1 < ny).then(|| row + 1),
        (z + 1 < nz).then(|| row + ny),
    ]
}
