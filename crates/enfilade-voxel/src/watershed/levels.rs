//! Levels of distance, layer by layer: plain, or packed as they are measured.
//!
//! The distances of a slab need the slices within the largest distance in it only, so they are measured slab by slab, and a
//! whole field is never held. They are the same as those of [`distance_squared_near`](super::super::distance_squared_near):
//! where a voxel's nearest surface could lie beyond the slices read, more are read.

use std::borrow::Cow;
use std::ops::Range;

use enfilade_geom::Allowance;
use rayon::prelude::*;

use super::super::edt::{LANES, Span, Tables, along_rows, load, within_slice, work_of};
use super::super::grid::{BitVolume, for_runs};
use super::super::sparse::SparseVolume;
use super::basins::STEPS;
use super::shape::Shape;

/// The part of a word that is a level; 0 is occupied.
const LEVEL: u16 = 0x3FFF;
/// Marks a free voxel that is known to be outdoors.
pub(super) const OUTDOORS: u16 = 0x8000;

/// Layers measured at a time.
const THICK: usize = 32;
/// Slices read on either side of them at first, for rooms of up to so many voxels. It doubles where that is too few.
const HALO: usize = 16;

pub(super) fn level(word: u16) -> u16 {
    word & LEVEL
}

pub(super) fn is_outdoors(word: u16) -> bool {
    word & OUTDOORS != 0
}

/// Levels of all voxels of a box.
#[derive(Clone, Debug)]
pub(super) enum Levels {
    Plain(Vec<u16>),
    Packed(Vec<PackedLayer>),
}

impl Levels {
    /// Converts squared distances to levels, in place, and marks the free voxels of `outdoors`.
    pub(super) fn of(shape: Shape, mut squared: Vec<u16>, outdoors: &Outdoors<'_>) -> Self {
        let table = table();
        let rows = squared.par_chunks_mut(shape.dims[0].max(1)).enumerate();
        rows.with_min_len(64)
            .for_each(|(row, words)| to_levels(shape, row, words, &table, outdoors));
        Self::Plain(squared)
    }

    /// Measures the distances to what `blocked` holds, with less work in `far`.
    pub(super) fn measured(
        blocked: &SparseVolume,
        far: &SparseVolume,
        allowance: &Allowance,
    ) -> Self {
        Self::measured_in(THICK, blocked, far, allowance)
    }

    /// Does [`Self::measured`] in slabs of `thick` layers.
    fn measured_in(
        thick: usize,
        blocked: &SparseVolume,
        far: &SparseVolume,
        allowance: &Allowance,
    ) -> Self {
        let shape = Shape {
            dims: blocked.dims(),
        };
        let [nx, ny, nz] = shape.dims;
        if shape.layer() == 0 {
            return Self::Packed(Vec::new());
        }
        let (table, tables) = (table(), Tables::of(nx));
        let outdoors = Outdoors::AtBorder(far);
        let mut near = Slices {
            of: 0..0,
            room: 0,
            words: Vec::new(),
        };
        let mut halo = HALO;
        let mut layers: Vec<PackedLayer> = Vec::with_capacity(nz);
        let mut words: Vec<u16> = Vec::new();
        for from in (0..nz).step_by(thick) {
            let to = nz.min(from + thick);
            words.resize((to - from) * shape.layer(), 0);
            loop {
                let span = Span {
                    n: nz,
                    read: [from.saturating_sub(halo), nz.min(to + halo)],
                    own: [from, to],
                };
                near.read(blocked, far, span.read, &tables, allowance);
                if near.sweep(far, span, &mut words, allowance) {
                    break;
                }
                halo *= 2;
            }
            if allowance.is_over() {
                break;
            }
            let layer = |(z, words): (usize, &mut [u16])| {
                for (row, words) in (z * ny..).zip(words.chunks_mut(nx)) {
                    to_levels(shape, row, words, &table, &outdoors);
                }
                PackedLayer::of(nx, words)
            };
            let own = words.par_chunks_mut(shape.layer()).enumerate();
            layers.par_extend(own.map(|(k, words)| layer((from + k, words))));
        }
        Self::Packed(layers)
    }

    /// Returns the levels of layers `from..to`, in `buffer` if they were packed.
    pub(super) fn read<'a>(
        &'a self,
        shape: Shape,
        [from, to]: [usize; 2],
        buffer: &'a mut Vec<u16>,
    ) -> &'a [u16] {
        let layer = shape.layer();
        match self {
            Self::Plain(words) => &words[from * layer..to * layer],
            Self::Packed(layers) => {
                buffer.resize((to - from) * layer, 0);
                for (packed, words) in layers[from..to].iter().zip(buffer.chunks_mut(layer)) {
                    packed.write(shape.dims[0], words);
                }
                buffer
            }
        }
    }
}

/// A packed layer.
#[derive(Clone, Debug)]
pub(super) struct PackedLayer {
    /// Rows that differ from the one before: in the sky, few.
    rows: Vec<u32>,
    /// These rows.
    block: Vec<u8>,
}

impl PackedLayer {
    /// Packs rows of `nx` words.
    fn of(nx: usize, words: &[u16]) -> Self {
        let row = |at: usize| &words[at * nx..][..nx];
        let differs = |at: &u32| *at == 0 || row(*at as usize) != row(*at as usize - 1);
        let rows: Vec<u32> = (0..(words.len() / nx) as u32).filter(differs).collect();
        let all = rows.len() * nx == words.len();
        let some: Vec<&[u16]> = rows.iter().map(|&at| row(at as usize)).collect();
        let some = if all {
            Cow::Borrowed(words)
        } else {
            Cow::Owned(some.concat())
        };
        let mut block = lz4_flex::block::compress(bytemuck::cast_slice(&some));
        block.shrink_to_fit();
        Self { rows, block }
    }

    /// Writes the layer's words.
    fn write(&self, nx: usize, words: &mut [u16]) {
        let n = self.rows.len() * nx;
        let packed = bytemuck::cast_slice_mut(&mut words[..n]);
        let found = lz4_flex::block::decompress_into(&self.block, packed);
        assert_eq!(found.ok(), Some(2 * n), "a layer as it was packed");
        // From the last row on, so that none is overwritten before it is moved.
        let mut end = words.len() / nx;
        for (k, &at) in self.rows.iter().enumerate().rev() {
            for row in (at as usize..end).rev().filter(|row| *row > k) {
                words.copy_within(k * nx..(k + 1) * nx, row * nx);
            }
            end = at as usize;
        }
    }
}

/// Returns the level of each squared distance.
fn table() -> Vec<u16> {
    (0..=u16::MAX)
        .map(|d| (f64::from(d).sqrt() * f64::from(STEPS)) as u16)
        .collect()
}

/// Voxels known to be outdoors, if they are free.
pub(super) enum Outdoors<'a> {
    Nothing,
    Only(&'a BitVolume),
    /// These, and all at the border of the box.
    AtBorder(&'a SparseVolume),
}

impl Outdoors<'_> {
    /// Calls `run(from, to)` for runs of voxels of a row; some may overlap.
    pub(super) fn for_runs(&self, shape: Shape, row: usize, mut run: impl FnMut(usize, usize)) {
        let [nx, ny, nz] = shape.dims;
        let (y, z) = (row % ny, row / ny);
        match self {
            Self::Nothing => {}
            Self::Only(set) => for_runs(set.row(row), |from, to| run(from as usize, to as usize)),
            Self::AtBorder(_) if y == 0 || z == 0 || y + 1 == ny || z + 1 == nz => run(0, nx),
            Self::AtBorder(set) => {
                for_runs(set.row(row), |from, to| run(from as usize, to as usize));
                run(0, 1);
                run(nx - 1, nx);
            }
        }
    }
}

fn to_levels(shape: Shape, row: usize, words: &mut [u16], table: &[u16], outdoors: &Outdoors<'_>) {
    for word in &mut *words {
        *word = table[usize::from(*word)];
    }
    outdoors.for_runs(shape, row, |from, to| {
        for word in &mut words[from..to] {
            *word |= if *word == 0 { 0 } else { OUTDOORS };
        }
    });
}

/// Squared distances within slices one after the other, in a ring: pieces of memory for each would lie between the packed
/// layers, of no use to what comes later.
struct Slices {
    of: Range<usize>,
    /// Number of slices that the ring holds.
    room: usize,
    words: Vec<u16>,
}

impl Slices {
    /// Ensures that the slices `from..to` are there, and no others.
    fn read(
        &mut self,
        blocked: &SparseVolume,
        far: &SparseVolume,
        [from, to]: [usize; 2],
        tables: &Tables<u16>,
        allowance: &Allowance,
    ) {
        let [nx, ny, _] = blocked.dims();
        if to - from > self.room {
            self.widen(from..to, nx * ny);
        }
        let (room, before) = (self.room, self.of.clone());
        let measure = |scratch: &mut Vec<[u16; LANES]>, (at, slice): (usize, &mut [u16])| {
            let k = from + (at + room - from % room) % room;
            if k < to && !before.contains(&k) {
                slice.fill(0); // only free voxels are written
                if allowance.spend(work_of(nx * ny)) {
                    within_slice(blocked, Some(far), k, slice, tables, scratch);
                }
            }
        };
        let ring = self.words.par_chunks_mut(nx * ny).enumerate();
        ring.for_each_init(Vec::new, measure);
        self.of = from..to;
    }

    /// Makes room for all slices of a range, and keeps those of them that are there.
    fn widen(&mut self, range: Range<usize>, n: usize) {
        let room = range.len();
        let mut words = vec![0; room * n];
        let kept = self.of.start.max(range.start)..self.of.end.min(range.end);
        for k in kept.clone() {
            let slice = &self.words[k % self.room * n..][..n];
            words[k % room * n..][..n].copy_from_slice(slice);
        }
        (self.of, self.room, self.words) = (kept, room, words);
    }

    /// Writes the squared distances of a slab; returns `false` if more slices could matter.
    fn sweep(
        &self,
        far: &SparseVolume,
        span: Span,
        words: &mut [u16],
        allowance: &Allowance,
    ) -> bool {
        let [nx, ny, _] = far.dims();
        let n_own = span.own[1] - span.own[0];
        let mut columns: Vec<Vec<&mut [u16]>> =
            (0..ny).map(|_| Vec::with_capacity(n_own)).collect();
        for (row, words) in words.chunks_mut(nx).enumerate() {
            columns[row % ny].push(words);
        }
        let slice = |k: usize| &self.words[k % self.room * nx * ny..][..nx * ny];
        let read = span.read[0]..span.read[1];
        columns
            .par_iter_mut()
            .enumerate()
            .map_init(Vec::new, |scratch, (j, rows)| {
                if !allowance.spend(work_of(nx * n_own)) {
                    return true;
                }
                let around = read.clone().map(|k| &slice(k)[j * nx..][..nx]);
                load(around, scratch);
                along_rows(rows, span, scratch, &|k, b| far.row(j + ny * k)[b])
            })
            .reduce(|| true, |a, b| a && b)
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::{border, distance_squared_near, far_outdoors};
    use super::*;
    use proptest::prelude::*;

    proptest! {
        // Covers V13.
        #[test]
        fn levels_measured_slab_by_slab_are_those_of_the_whole_field(
            dims in [1_usize..150, 1_usize..30, 1_usize..90],
            places in prop::collection::vec(any::<usize>(), 0..12),
            thick in 1_usize..40,
        ) {
            let shape = Shape { dims };
            let mut blocked = BitVolume::new(dims);
            for place in places {
                let at = shape.coords(place % dims.iter().product::<usize>());
                blocked.set(at[0], at[1], at[2], true);
            }
            let allowance = Allowance::default();
            let far = far_outdoors(&blocked, &allowance);
            let mut outdoors = border(dims);
            far.add_to(&mut outdoors);
            let whole = distance_squared_near(&blocked, &far.dense(), &allowance);
            let whole = Levels::of(shape, whole, &Outdoors::Only(&outdoors));
            let blocked = SparseVolume::of(&blocked);
            let slabs = Levels::measured_in(thick, &blocked, &far, &allowance);
            let (mut a, mut b) = (Vec::new(), Vec::new());
            let all = [0, dims[2]];
            prop_assert_eq!(slabs.read(shape, all, &mut a), whole.read(shape, all, &mut b));
        }
    }
}
