//! Watershed of the distance field: rooms as the basins around its maxima.
//!
//! The free voxels are flooded from deep to shallow (Meyer, "Topographic distance and watershed
//! lines", 1994; Haumont, Debeir and Sillion, "Volumetric Cell-and-Portal Generation", 2003): each
//! regional maximum of the distance starts a basin when its level is reached, and a basin spreads to its
//! neighbors in order of level, first come first served within one level, so that influence zones divide
//! plateaus. The saddle of two basins is where they first meet. A basin whose dynamics (peak minus saddle;
//! Grimaud, "A new measure of contrast", 1992) are below `h` joins the deeper one at once. After the flood
//! has fallen `h` below a peak, that basin is final, so every recorded contact is between two basins of
//! the answer.
//!
//! **Levels** are distances in steps of 1/64 voxel, rounded down. Consecutive squares of distances below 32
//! voxels are further apart than that, so only wider spaces lose any order.
//!
//! **Memory:** the flood works in place, in the array of squared distances: a word holds a voxel's level
//! until a basin reaches it, and then the basin's number. 16-bit words can number 16,383 live basins;
//! numbers of merged ones are reused. If more than half of that are alive, the volume moves into 32-bit
//! words. The queue holds the shell of voxels within one voxel below the flood's level.

mod basins;
mod flood;
mod queue;

use enfilade_geom::Allowance;
use rayon::prelude::*;

use super::grid::BitVolume;
use basins::STEPS;
use flood::Flood;

pub use basins::{Basin, Labels, Saddle, Watershed};

/// Options of [`watershed`].
#[derive(Clone, Debug, Default)]
pub struct WatershedOptions {
    /// Basins with dynamics (peak minus highest saddle) below this join a deeper one. [Units: vx]
    /// [Limit: 0 and above]
    pub h: f64,
    /// The free voxels set here form one basin, infinitely deep, with label 1.
    pub outdoors: Option<BitVolume>,
}

/// Floods a field of squared distances from deep to shallow.
///
/// `squared` is the result of [`distance_squared`](super::distance_squared) for a box of `dims`; 0 is
/// occupied, and distances of 256 voxels and more count as one level. Its memory becomes the labels.
///
/// Linear in the voxels. In addition to the 2 bytes per voxel it takes about 4 bytes for each voxel of
/// the largest shell one voxel thick (0.4 bytes per voxel of a furnished building at 5 cm), and 4 for each
/// local maximum. If more than 8,191 basins are alive at once it takes 4 bytes per voxel, and 6 during the
/// move.
///
/// # Panics
/// If `squared` or `outdoors` is not of size `dims`, there are 2³² voxels or more, or `h` is negative or
/// NaN.
#[must_use]
pub fn watershed(
    dims: [usize; 3],
    squared: Vec<u16>,
    options: WatershedOptions,
    allowance: &Allowance,
) -> Watershed {
    let n: usize = dims.iter().product();
    assert_eq!(squared.len(), n, "a distance for each of {dims:?} voxels");
    assert!(u32::try_from(n).is_ok(), "fewer than 2^32 voxels");
    assert!(
        options.h >= 0.0,
        "h must not be negative, got {}",
        options.h
    );
    let mut words = squared;
    to_levels(&mut words);
    let starts = local_maxima(dims, &words, options.outdoors.as_ref(), allowance);
    let h = (options.h * f64::from(STEPS))
        .ceil()
        .min(f64::from(u32::MAX)) as u32;
    let mut flood = Flood::new(dims, words, starts, h);
    let outdoors = options.outdoors.is_some();
    if let Some(seeds) = options.outdoors {
        assert_eq!(seeds.dims(), dims, "outdoors of the same size");
        flood.seed(&seeds);
    }
    if flood.run(allowance) {
        if allowance.is_over() {
            return Watershed::unflooded(n);
        }
        return flood.finish(outdoors);
    }
    let mut wide = flood.widened();
    assert!(
        wide.run(allowance),
        "30 bits number more basins than there are voxels"
    );
    if allowance.is_over() {
        return Watershed::unflooded(n);
    }
    wide.finish(outdoors)
}

/// Marks the dams between basins, one voxel thick: each voxel that shares a face with one of a lesser
/// label other than 0. The remaining voxels of different basins do not touch.
///
/// # Panics
/// If `labels` is not of size `dims`.
#[must_use]
pub fn mark_dams(dims: [usize; 3], labels: &Labels) -> BitVolume {
    assert_eq!(
        labels.len(),
        dims.iter().product::<usize>(),
        "a label for each voxel"
    );
    match labels {
        Labels::U16(v) => dams(dims, v),
        Labels::U32(v) => dams(dims, v),
    }
}

fn dams<T: Copy + Ord + Default + Sync>(dims: [usize; 3], labels: &[T]) -> BitVolume {
    let [nx, ny, _] = dims;
    let mut out = BitVolume::new(dims);
    if labels.is_empty() {
        return out;
    }
    let per_row = out.row_words();
    out.words_mut()
        .par_chunks_mut(per_row)
        .enumerate()
        .with_min_len(16)
        .for_each(|(row, words)| {
            let rows = Neighbors::of(labels, dims, row, ny);
            for x in 0..nx {
                let here = rows.here[x];
                let dam = |other: T| other != T::default() && other < here;
                if (x > 0 && dam(rows.here[x - 1]))
                    || (x + 1 < nx && dam(rows.here[x + 1]))
                    || rows.around.iter().flatten().any(|r| dam(r[x]))
                {
                    words[x / 64] |= 1 << (x % 64);
                }
            }
        });
    out
}

/// A row and the four that share faces with it: y - 1, z - 1, y + 1, z + 1.
struct Neighbors<'a, T> {
    here: &'a [T],
    around: [Option<&'a [T]>; 4],
}

impl<'a, T> Neighbors<'a, T> {
    fn of(values: &'a [T], [nx, _, nz]: [usize; 3], row: usize, ny: usize) -> Self {
        let (y, z) = (row % ny, row / ny);
        let at = |row: usize| &values[row * nx..(row + 1) * nx];
        Self {
            here: at(row),
            around: [
                (y > 0).then(|| at(row - 1)),
                (z > 0).then(|| at(row - ny)),
                (y + 1 < ny).then(|| at(row + 1)),
                (z + 1 < nz).then(|| at(row + ny)),
            ],
        }
    }
}

/// Converts squared distances to levels, in place.
fn to_levels(words: &mut [u16]) {
    let table: Vec<u16> = (0..=u16::MAX)
        .map(|d| (f64::from(d).sqrt() * f64::from(STEPS)) as u16)
        .collect();
    words.par_chunks_mut(1 << 14).for_each(|part| {
        for w in part {
            *w = table[usize::from(*w)];
        }
    });
}

/// Returns voxels where a basin may start, deepest first, then by index.
///
/// No neighbor is higher, and no earlier neighbor in the scan is equal: every regional maximum has such a
/// voxel, its first. None is in `outdoors`.
fn local_maxima(
    dims: [usize; 3],
    levels: &[u16],
    outdoors: Option<&BitVolume>,
    allowance: &Allowance,
) -> Vec<u32> {
    let [nx, ny, nz] = dims;
    let mut found: Vec<u32> = (0..ny * nz)
        .into_par_iter()
        .with_min_len(16)
        .filter(allowance.each(1 + nx as u64 / 32))
        .fold(Vec::new, |mut found, row| {
            let rows = Neighbors::of(levels, dims, row, ny);
            let [y0, z0, y1, z1] = rows.around;
            let taken = outdoors.map(|o| o.row(row));
            let is_taken = |x: usize| taken.is_some_and(|t| t[x / 64] >> (x % 64) & 1 != 0);
            for x in 0..nx {
                let here = rows.here[x];
                let below = |r: Option<&[u16]>| r.is_none_or(|r| r[x] < here);
                let not_above = |r: Option<&[u16]>| r.is_none_or(|r| r[x] <= here);
                if here > 0
                    && (x == 0 || rows.here[x - 1] < here)
                    && (x + 1 == nx || rows.here[x + 1] <= here)
                    && below(y0)
                    && below(z0)
                    && not_above(y1)
                    && not_above(z1)
                    && !is_taken(x)
                {
                    found.push((row * nx + x) as u32);
                }
            }
            found
        })
        .reduce(Vec::new, |mut a, mut b| {
            a.append(&mut b);
            a
        });
    found.par_sort_unstable_by_key(|&v| (std::cmp::Reverse(levels[v as usize]), v));
    found
}

#[cfg(test)]
mod tests;
