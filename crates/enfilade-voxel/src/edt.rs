//! Exact Euclidean distance transform.
//!
//! Squared distance is separable: a pass along x computes the distance to the nearest occupied voxel of
//! the row, passes along y and z compute `min over k of (f(k) + (i - k)²)` (Meijster, Roerdink and
//! Hesselink, "A General Algorithm for Computing Distance Transforms in Linear Time", 2000;
//! Felzenszwalb and Huttenlocher, "Distance Transforms of Sampled Functions", 2012).
//!
//! Both papers build the lower envelope of each line, which branches on every sample. We take the minimum
//! directly, outwards from `k = i`, over [`LANES`] lines at once, and stop as soon as `(i - k)²` exceeds
//! the greatest value of the block: indoors after a few steps, each a handful of vector instructions for
//! all lanes. In 16 bits the loop ends after 255 steps at most. In floating point it need not, so a block
//! that runs for [`PATIENCE`] steps falls back to the envelope, and the time stays linear in the voxels.

use enfilade_geom::Allowance;
use rayon::prelude::*;

use super::grid::{BitVolume, for_runs};
use super::sparse::VoxelRows;

/// Number of neighboring lines processed together.
pub(super) const LANES: usize = 64;

/// Steps outwards after which a floating-point block falls back to the lower envelope.
const PATIENCE: usize = 96;

/// A squared distance.
pub(super) trait Squared: Copy + Send + Sync + PartialOrd + 'static {
    /// No occupied voxel, or too far to represent.
    const FAR: Self;
    const ZERO: Self;
    /// Maximum number of useful steps outwards.
    const MAX_STEPS: usize;
    fn of_steps(k: usize) -> Self;
    fn plus(self, other: Self) -> Self;
    fn least(self, other: Self) -> Self;
    fn greatest(self, other: Self) -> Self;
    fn envelope(block: &[[Self; LANES]], out: &mut impl FnMut(usize, &[Self; LANES]));
}

impl Squared for u16 {
    const FAR: Self = u16::MAX;
    const ZERO: Self = 0;
    // 256² exceeds 16 bits.
    const MAX_STEPS: usize = 255;

    fn of_steps(k: usize) -> Self {
        if k < 256 { (k * k) as u16 } else { u16::MAX }
    }
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self.saturating_add(other)
    }
    #[inline(always)]
    fn least(self, other: Self) -> Self {
        self.min(other)
    }
    #[inline(always)]
    fn greatest(self, other: Self) -> Self {
        self.max(other)
    }
    fn envelope(_: &[[Self; LANES]], _: &mut impl FnMut(usize, &[Self; LANES])) {
        unreachable!("16 bits run out of steps first");
    }
}

impl Squared for f32 {
    const FAR: Self = f32::INFINITY;
    const ZERO: Self = 0.0;
    const MAX_STEPS: usize = PATIENCE;

    fn of_steps(k: usize) -> Self {
        (k * k) as f32
    }
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self + other
    }
    // Not `f32::min`: without NaN this is one instruction.
    #[inline(always)]
    fn least(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
    #[inline(always)]
    fn greatest(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    fn envelope(block: &[[Self; LANES]], out: &mut impl FnMut(usize, &[Self; LANES])) {
        let n = block.len();
        let mut result = vec![[f32::INFINITY; LANES]; n];
        // Parabolas of the envelope: apex, and where each takes over from the one before.
        let (mut apex, mut from) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for lane in 0..LANES {
            apex.clear();
            from.clear();
            let height = |q: usize| f64::from(block[q][lane]);
            for (q, row) in block.iter().enumerate() {
                if row[lane] == f32::INFINITY {
                    continue;
                }
                let mut start = f64::NEG_INFINITY;
                while let Some(&p) = apex.last() {
                    let (a, b) = (p as f64, q as f64);
                    start = ((height(q) + b * b) - (height(p) + a * a)) / (2.0 * (b - a));
                    if start > from[from.len() - 1] {
                        break;
                    }
                    apex.pop();
                    from.pop();
                    start = f64::NEG_INFINITY;
                }
                apex.push(q);
                from.push(start);
            }
            let mut at = 0;
            for (q, row) in result.iter_mut().enumerate() {
                while at + 1 < apex.len() && from[at + 1] <= q as f64 {
                    at += 1;
                }
                if let Some(&p) = apex.get(at) {
                    row[lane] = block[p][lane] + (p.abs_diff(q) * p.abs_diff(q)) as f32;
                }
            }
        }
        for (i, row) in result.iter().enumerate() {
            out(i, row);
        }
    }
}

/// Returns the squared distance from each voxel to the nearest one set in `occupied`, at most 65,535.
/// [Units: vx²]
///
/// Exact below 65,535. Voxels outside the box are not occupied. Takes 2 bytes per voxel for the answer, 16
/// bytes per row along x, and `2 * nx * max(ny, nz)` bytes per thread.
#[must_use]
pub fn distance_squared(occupied: &BitVolume, allowance: &Allowance) -> Vec<u16> {
    transform(occupied, None, allowance)
}

/// As [`distance_squared`], with less work in the voxels of `far`. [Units: vx²]
///
/// Exact wherever the answer is less than at every voxel of `far`, and never too small. A block of 64 voxels
/// in `far` costs a few copies instead of a step for each voxel of its distance.
///
/// # Panics
/// If the two boxes differ in size.
//
// Exact, because the nearest occupied voxel is found through voxels that lie no farther from it: in its row, then in its
// slice.
#[must_use]
pub fn distance_squared_near(
    occupied: &BitVolume,
    far: &BitVolume,
    allowance: &Allowance,
) -> Vec<u16> {
    assert_eq!(occupied.dims(), far.dims(), "boxes of one size");
    transform(occupied, Some(far), allowance)
}

/// Returns the distance from each voxel to the nearest one set in `occupied`; infinite if there is none.
/// [Units: vx]
///
/// Squares below 2²⁴ (4,096 voxels) are exact before the square root. Voxels outside the box are not
/// occupied. Takes 4 bytes per voxel and scratch memory as in [`distance_squared`].
#[must_use]
pub fn distance(occupied: &BitVolume) -> Vec<f32> {
    let mut out: Vec<f32> = transform(occupied, None, &Allowance::default());
    out.par_chunks_mut(1 << 14).for_each(|part| {
        for d in part {
            *d = d.sqrt();
        }
    });
    out
}

/// Work of transforming so many voxels along one axis or two, in units of [`Allowance`].
pub(super) fn work_of(n_voxels: usize) -> u64 {
    1 + n_voxels as u64 / 16
}

fn transform<T: Squared>(
    occupied: &BitVolume,
    far: Option<&BitVolume>,
    allowance: &Allowance,
) -> Vec<T> {
    let [nx, ny, nz] = occupied.dims();
    let mut field = vec![T::ZERO; nx * ny * nz];
    if field.is_empty() {
        return field;
    }
    let tables = Tables::of(nx);
    // Along x and y while a slice is in cache.
    field
        .par_chunks_mut(nx * ny)
        .enumerate()
        .for_each_init(Vec::new, |scratch, (k, slice)| {
            if !allowance.spend(work_of(slice.len())) {
                return;
            }
            within_slice(occupied, far, k, slice, &tables, scratch);
        });
    if nz > 1 {
        let mut columns: Vec<Vec<&mut [T]>> = (0..ny).map(|_| Vec::with_capacity(nz)).collect();
        for (row, values) in field.chunks_mut(nx).enumerate() {
            columns[row % ny].push(values);
        }
        columns
            .par_iter_mut()
            .enumerate()
            .for_each_init(Vec::new, |scratch, (j, rows)| {
                if !allowance.spend(work_of(nx * nz)) {
                    return;
                }
                load(rows.iter().map(|row| &**row), scratch);
                along_rows(rows, Span::whole(nz), scratch, &|k, b| {
                    far.map_or(0, |f| f.row(j + ny * k)[b])
                });
            });
    }
    field
}

/// Squares of steps along x, up and down.
pub(super) struct Tables<T> {
    squares: Vec<T>,
    falling: Vec<T>,
}

impl<T: Squared> Tables<T> {
    pub(super) fn of(nx: usize) -> Self {
        let squares: Vec<T> = (0..=nx).map(T::of_steps).collect();
        Self {
            falling: squares.iter().rev().copied().collect(),
            squares,
        }
    }
}

/// Writes the squared distances of the voxels of slice `k` to those occupied in it.
pub(super) fn within_slice<T: Squared>(
    occupied: &impl VoxelRows,
    far: Option<&impl VoxelRows>,
    k: usize,
    slice: &mut [T],
    tables: &Tables<T>,
    scratch: &mut Vec<[T; LANES]>,
) {
    let [nx, ny, _] = occupied.dims();
    let mut rows: Vec<&mut [T]> = slice.chunks_mut(nx).collect();
    for (j, row) in rows.iter_mut().enumerate() {
        distances_in_row(occupied.row(j + ny * k), row, tables);
    }
    load(rows.iter().map(|row| &**row), scratch);
    along_rows(&mut rows, Span::whole(ny), scratch, &|j, b| {
        far.map_or(0, |f| f.row(j + ny * k)[b])
    });
}

/// Writes the squared distances along one row: rising and falling squares, copied from tables.
fn distances_in_row<T: Squared>(
    bits: &[u64],
    row: &mut [T],
    Tables { squares, falling }: &Tables<T>,
) {
    let n = row.len();
    let mut free_from = 0;
    let mut seen = false;
    let mut gap = |from: usize, to: usize, left: bool, right: bool| {
        let length = to - from;
        let rising = match (left, right) {
            (false, false) => return row[from..to].fill(T::FAR),
            (true, true) => length.div_ceil(2),
            (true, false) => length,
            (false, true) => 0,
        };
        row[from..from + rising].copy_from_slice(&squares[1..=rising]);
        let last = falling.len() - 1;
        row[from + rising..to].copy_from_slice(&falling[last - (length - rising)..last]);
    };
    for_runs(bits, |from, to| {
        if from as usize > free_from {
            gap(free_from, from as usize, seen, true);
        }
        seen = true;
        free_from = to as usize;
    });
    if free_from < n {
        gap(free_from, n, seen, false);
    }
}

/// The rows of a box that a pass reads, and those of them that it writes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    /// Rows of the box.
    pub(super) n: usize,
    /// Rows that are read: from … to.
    pub(super) read: [usize; 2],
    /// Rows that are written.
    pub(super) own: [usize; 2],
}

impl Span {
    fn whole(n: usize) -> Self {
        Self {
            n,
            read: [0, n],
            own: [0, n],
        }
    }

    /// Returns `true` if all rows of the box within `k` of row `i` are read.
    fn contains(&self, i: usize, k: usize) -> bool {
        (self.read[0] == 0 || i >= self.read[0] + k)
            && (self.read[1] == self.n || i + k < self.read[1])
    }
}

/// Copies rows into blocks of [`LANES`] columns.
//
// Lanes past the end hold zero, so that they never need another step.
pub(super) fn load<'a, T: Squared>(
    rows: impl ExactSizeIterator<Item = &'a [T]> + Clone,
    scratch: &mut Vec<[T; LANES]>,
) {
    let n = rows.len();
    let width = rows.clone().next().map_or(0, <[T]>::len);
    scratch.clear();
    scratch.resize(n * width.div_ceil(LANES), [T::ZERO; LANES]);
    for (i, row) in rows.enumerate() {
        for (b, part) in row.chunks(LANES).enumerate() {
            scratch[b * n + i][..part.len()].copy_from_slice(part);
        }
    }
}

/// Writes `min over k of (f(k) + (i - k)²)` to each column `rows[i][x]` of the span's own rows, or a larger value where `far`
/// of a row and a block has a bit. `scratch` holds f for the rows that are read, as [`load`] leaves it.
///
/// Returns `false` if rows that are not read could matter; what it wrote is then of no use.
pub(super) fn along_rows<T: Squared>(
    rows: &mut [&mut [T]],
    span: Span,
    scratch: &[[T; LANES]],
    far: &impl Fn(usize, usize) -> u64,
) -> bool {
    let (n, width) = (span.read[1] - span.read[0], rows[0].len());
    for (b, block) in scratch.chunks(n).enumerate() {
        let from = b * LANES;
        let lanes = LANES.min(width - from);
        let mut write = |i: usize, values: &[T; LANES]| {
            rows[i][from..from + lanes].copy_from_slice(&values[..lanes]);
        };
        match least_parabolas(block, span, &|i| far(i, b), &mut write) {
            Sweep::Done => {}
            Sweep::GaveUp => T::envelope(block, &mut write),
            Sweep::Cut => return false,
        }
    }
    true
}

/// How a sweep over a block ended.
enum Sweep {
    Done,
    /// Too many steps.
    GaveUp,
    /// Rows that are not read could matter.
    Cut,
}

/// Writes the least parabola at each own row of a block, the first one as row 0.
fn least_parabolas<T: Squared>(
    block: &[[T; LANES]],
    span: Span,
    far: &impl Fn(usize) -> u64,
    write: &mut impl FnMut(usize, &[T; LANES]),
) -> Sweep {
    for row in span.own[0]..span.own[1] {
        let (i, to) = (row - span.read[0], row - span.own[0]);
        let mut least = block[i];
        let far = far(row);
        if far == u64::MAX {
            write(to, &least);
            continue;
        }
        // Far lanes never need another step.
        let asks = std::array::from_fn(|lane| {
            if far >> lane & 1 == 0 {
                T::FAR
            } else {
                T::ZERO
            }
        });
        let reach = row.max(span.n - 1 - row);
        let mut most = greatest(&least, &asks);
        let mut k = 1;
        while k <= reach && most > T::of_steps(k) {
            if k > T::MAX_STEPS {
                if T::FAR > T::of_steps(k) {
                    return Sweep::GaveUp;
                }
                break;
            }
            if !span.contains(row, k + STRIDE - 1) {
                return Sweep::Cut;
            }
            most = widened(&mut least, &asks, block, i, k);
            k += STRIDE;
        }
        write(to, &least);
    }
    Sweep::Done
}

/// Rows on each side between two tests of the maximum: a test costs as much as a row.
const STRIDE: usize = 4;

/// Includes the rows `k..k + STRIDE` away from `i` in the minimum; returns the greatest value left.
//
// Not inlined, so that the compiler knows `least` to be unaliased: inlined, it processed one lane at a
// time, five times slower.
#[inline(never)]
fn widened<T: Squared>(
    least: &mut [T; LANES],
    asks: &[T; LANES],
    block: &[[T; LANES]],
    i: usize,
    k: usize,
) -> T {
    let beyond = [T::FAR; LANES];
    let steps: [T; STRIDE] = std::array::from_fn(|s| T::of_steps(k + s));
    let rows: [[&[T; LANES]; 2]; STRIDE] = std::array::from_fn(|s| {
        let before = i.checked_sub(k + s).map_or(&beyond, |at| &block[at]);
        [before, block.get(i + k + s).unwrap_or(&beyond)]
    });
    for lane in 0..LANES {
        let mut v = least[lane];
        for s in 0..STRIDE {
            v = v.least(rows[s][0][lane].least(rows[s][1][lane]).plus(steps[s]));
        }
        least[lane] = v;
    }
    greatest(least, asks)
}

/// Returns the greatest of the lanes that need more steps: those at `FAR` and not at zero.
fn greatest<T: Squared>(values: &[T; LANES], asks: &[T; LANES]) -> T {
    let of = |(&v, &ask): (&T, &T)| v.least(ask);
    values
        .iter()
        .zip(asks)
        .map(of)
        .fold(T::ZERO, Squared::greatest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Brute force: each voxel against every occupied one.
    fn oracle(occupied: &BitVolume) -> Vec<Option<u64>> {
        let [nx, ny, nz] = occupied.dims();
        let at = |i: usize| [i % nx, i / nx % ny, i / nx / ny];
        (0..nx * ny * nz)
            .map(|v| {
                let p = at(v);
                occupied
                    .iter_set()
                    .map(|o| {
                        (0..3)
                            .map(|a| (at(o)[a].abs_diff(p[a]) as u64).pow(2))
                            .sum()
                    })
                    .min()
            })
            .collect()
    }

    fn check(occupied: &BitVolume) {
        let exact = oracle(occupied);
        let squared = distance_squared(occupied, &Allowance::default());
        let plain = distance(occupied);
        for (v, e) in exact.iter().enumerate() {
            assert_eq!(
                u64::from(squared[v]),
                e.map_or(65535, |e| e.min(65535)),
                "voxel {v}"
            );
            assert_eq!(
                plain[v],
                e.map_or(f32::INFINITY, |e| (e as f32).sqrt()),
                "voxel {v}"
            );
        }
    }

    fn scattered(dims: [usize; 3], places: &[usize]) -> BitVolume {
        let mut bits = BitVolume::new(dims);
        for &p in places {
            let p = p % (dims[0] * dims[1] * dims[2]);
            bits.set(
                p % dims[0],
                p / dims[0] % dims[1],
                p / dims[0] / dims[1],
                true,
            );
        }
        bits
    }

    proptest! {
        // Covers V2.
        #[test]
        fn distances_equal_those_to_every_occupied_voxel(
            nx in 1usize..90, ny in 1usize..12, nz in 1usize..12,
            places in prop::collection::vec(any::<usize>(), 0..40),
        ) {
            check(&scattered([nx, ny, nz], &places));
        }
    }

    proptest! {
        #[test]
        fn distances_are_exact_up_to_the_least_far_away_and_never_too_small(
            nx in 1usize..150, ny in 1usize..12, nz in 1usize..12,
            places in prop::collection::vec(any::<usize>(), 0..20),
            from in 0u16..300, left_out in 1usize..9,
        ) {
            let occupied = scattered([nx, ny, nz], &places);
            let exact = distance_squared(&occupied, &Allowance::default());
            // Some of the voxels at least that far away.
            let far = BitVolume::from_fn([nx, ny, nz], |i| exact[i] >= from && i % 9 >= left_out);
            let least = far.iter_set().map(|i| exact[i]).min().unwrap_or(u16::MAX);
            for (i, &d) in distance_squared_near(&occupied, &far, &Allowance::default()).iter().enumerate() {
                prop_assert!(d >= exact[i]);
                prop_assert!(exact[i] >= least || d == exact[i], "voxel {i}");
            }
        }
    }

    #[test]
    fn far_distances_saturate_in_16_bits_and_stay_exact_in_floats() {
        for dims in [[700, 2, 2], [2, 700, 2], [2, 2, 700], [1, 280, 12]] {
            check(&scattered(dims, &[0]));
            check(&scattered(dims, &[dims[0] * dims[1] * dims[2] - 1, 5]));
            check(&scattered(dims, &[]));
        }
        assert_eq!(
            distance_squared(&BitVolume::new([0, 3, 3]), &Allowance::default()),
            Vec::<u16>::new()
        );
    }

    #[test]
    fn the_number_of_threads_changes_nothing() {
        let bits = BitVolume::from_fn([70, 33, 41], |i| i.is_multiple_of(977));
        let one = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .unwrap();
        let many = rayon::ThreadPoolBuilder::new()
            .num_threads(5)
            .build()
            .unwrap();
        assert_eq!(
            one.install(|| distance_squared(&bits, &Allowance::default())),
            many.install(|| distance_squared(&bits, &Allowance::default()))
        );
    }
}
