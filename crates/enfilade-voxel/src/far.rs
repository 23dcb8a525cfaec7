//! Air that is certainly outdoors and far from everything, found before the flood at a quarter of the resolution.
//!
//! Around a winding level or a site most of the volume is sky. The distance field has its greatest values there, so a
//! distance transform and a flood spend most of their time on empty space. A watershed of blocks of 4³ voxels takes a 64th
//! of the time and finds nearly all of it.
//!
//! The decisions equal those of the full flood: a block counts only if it lies well away from everything occupied, in the
//! outdoor basin, and in no ball of air centered in another basin. Distances in all other air remain exact, and with them
//! all peaks and saddles.

use enfilade_geom::Allowance;
use rayon::prelude::*;

use super::edt::distance_squared;
use super::grid::BitVolume;
use super::sparse::{SparseVolume, VoxelRows};
use super::watershed::{WatershedOptions, watershed};
use super::widest::border;

/// Edge of a block. [Units: vx]
const EDGE: usize = 4;
/// Blocks per word of voxels.
const PER_WORD: usize = 64 / EDGE;
/// Blocks nearer than this to an occupied one are left to the flood. [Units: blocks]
const NEAR: f64 = 4.0;
/// Largest difference between the distance of voxels and that of their blocks: twice two half diagonals.
/// [Units: blocks]
const ASTRAY: f64 = 4.0;
/// Basins of blocks with dynamics below this are rounding. [Units: blocks]
const NOISE: f64 = 0.5;

/// Returns free voxels that are outdoors and at least eight voxels away from everything set in `blocked`; a subset.
///
/// Linear in voxels; takes a tenth of a byte per voxel during the search.
#[must_use]
pub fn far_outdoors(blocked: &impl VoxelRows, allowance: &Allowance) -> SparseVolume {
    let blocks = blocks_of(blocked);
    let dims = blocks.dims();
    let squared = distance_squared(&blocks, allowance);
    let options = WatershedOptions {
        h: NOISE,
        outdoors: Some(border(dims)),
    };
    let flood = watershed(dims, squared.clone(), &options, allowance);
    let depth = |v: usize| f64::from(squared[v]).sqrt();
    // Reach of the ball around each block of another basin, rounded up.
    let mut reach: Vec<u16> = (0..squared.len())
        .into_par_iter()
        .map(|v| match flood.labels.get(v) {
            0 | 1 => 0,
            _ => (depth(v) + ASTRAY).ceil() as u16 + 1,
        })
        .collect();
    spread(dims, &mut reach);
    let is_far = |v: usize| flood.labels.get(v) == 1 && reach[v] == 0 && depth(v) >= NEAR;
    voxels_of(blocked.dims(), &BitVolume::from_fn(dims, is_far))
}

/// Returns the blocks with a voxel set, with a margin of one block around them.
fn blocks_of(voxels: &impl VoxelRows) -> BitVolume {
    let [nx, ny, nz] = voxels.dims();
    let mut out = BitVolume::new([nx, ny, nz].map(|n| n.div_ceil(EDGE) + 2));
    let [bx, by, bz] = out.dims();
    let mut row = vec![0_u64; nx.div_ceil(64)];
    for k in 0..bz - 2 {
        for j in 0..by - 2 {
            row.fill(0);
            for z in k * EDGE..nz.min((k + 1) * EDGE) {
                for y in j * EDGE..ny.min((j + 1) * EDGE) {
                    let words = row.iter_mut().zip(voxels.row(y + ny * z));
                    words.for_each(|(all, word)| *all |= word);
                }
            }
            for i in 0..bx - 2 {
                let word = row[i / PER_WORD] >> (i % PER_WORD * EDGE);
                if word & ((1 << EDGE) - 1) != 0 {
                    out.set(i + 1, j + 1, k + 1, true);
                }
            }
        }
    }
    out
}

/// Returns the voxels of a box of `dims` whose blocks are set.
fn voxels_of([nx, ny, nz]: [usize; 3], blocks: &BitVolume) -> SparseVolume {
    let [.., by, _] = blocks.dims();
    let tail = u64::MAX >> (63 - (nx + 63) % 64);
    SparseVolume::from_rows([nx, ny, nz], |row, words| {
        let from = blocks.row(row % ny / EDGE + 1 + by * (row / ny / EDGE + 1));
        for i in 0..nx.div_ceil(EDGE) {
            if from[(i + 1) / 64] >> ((i + 1) % 64) & 1 != 0 {
                words[i / PER_WORD] |= ((1 << EDGE) - 1) << (i % PER_WORD * EDGE);
            }
        }
        if let Some(last) = words.last_mut() {
            *last &= tail;
        }
    })
}

/// Replaces each value by the maximum over all values minus the steps to them, diagonal ones counting as one: cubes, which
/// contain the balls. Two scans, each over half of the 26 neighbors.
fn spread([nx, ny, nz]: [usize; 3], reach: &mut [u16]) {
    let (row, layer) = (nx as isize, (nx * ny) as isize);
    let mut back: Vec<[isize; 3]> = Vec::new();
    for dz in -1..=0 {
        for dy in -1..=1 {
            for dx in -1..=1 {
                if (dz, dy, dx) < (0, 0, 0) {
                    back.push([dx, dy, dz]);
                }
            }
        }
    }
    for sign in [1, -1] {
        let steps: Vec<isize> = back
            .iter()
            .map(|[dx, dy, dz]| sign * (dx + dy * row + dz * layer))
            .collect();
        let n = reach.len();
        for at in 0..n {
            let v = if sign > 0 { at } else { n - 1 - at };
            let (x, y, z) = (v % nx, v / nx % ny, v / (nx * ny));
            // The outermost blocks are outdoors.
            if x == 0 || y == 0 || z == 0 || x + 1 == nx || y + 1 == ny || z + 1 == nz {
                continue;
            }
            let most = steps.iter().map(|s| reach[v.wrapping_add_signed(*s)]).max();
            reach[v] = reach[v].max(most.unwrap_or(0).saturating_sub(1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Connectivity, Labels, Watershed, distance_squared_near, flood};
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    const DIMS: [usize; 3] = [150, 90, 120];

    /// Fills the shell of the box from `lo` to one before `hi`, two voxels thick, with a doorway of the given height and width
    /// through the side of least x.
    fn hall(voxels: &mut BitVolume, lo: [usize; 3], hi: [usize; 3], door: [usize; 2]) {
        for z in lo[2]..hi[2] {
            for y in lo[1]..hi[1] {
                for x in lo[0]..hi[0] {
                    let at = [x, y, z];
                    let is_shell = (0..3).any(|k| at[k] < lo[k] + 2 || at[k] + 2 >= hi[k]);
                    let middle = (lo[2] + hi[2]) / 2;
                    let is_door = x < lo[0] + 2
                        && y < lo[1] + 2 + door[0]
                        && 2 * z.abs_diff(middle) < door[1];
                    if is_shell && !is_door {
                        voxels.set(x, y, z, true);
                    }
                }
            }
        }
    }

    fn halls() -> impl Strategy<Value = BitVolume> {
        let one = [
            (2usize..60, 25usize..60),
            (2usize..30, 25usize..60),
            (2usize..50, 25usize..60),
        ];
        let door = [(5usize..45), (3usize..45)];
        prop::collection::vec((one, door), 1..4).prop_map(|boxes| {
            let mut voxels = BitVolume::new(DIMS);
            for (sides, door) in boxes {
                let lo = sides.map(|(from, _)| from);
                hall(
                    &mut voxels,
                    lo,
                    sides.map(|(from, length)| from + length),
                    door,
                );
            }
            voxels
        })
    }

    /// Excess depth of a hall over its exit that survives rounding to blocks: the noise, and half the diagonals of two blocks
    /// for each of both depths. [Units: vx]
    const ROUNDED: f64 = (NOISE + 2.0 * 1.733) * EDGE as f64;

    fn flooded(
        voxels: &BitVolume,
        squared: Vec<u16>,
        far: Option<&BitVolume>,
        h: f64,
    ) -> Watershed {
        let mut outdoors = border(DIMS);
        far.into_iter().for_each(|far| outdoors.union_with(far));
        let options = WatershedOptions {
            h,
            outdoors: Some(outdoors),
        };
        assert_eq!(squared.len(), voxels.n_voxels());
        watershed(DIMS, squared, &options, &Allowance::default())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]
        #[test]
        fn far_air_is_free_and_hangs_together_with_the_border_and_no_hall_is_lost(
            voxels in halls()
        ) {
            let squared = distance_squared(&voxels, &Allowance::default());
            let far = far_outdoors(&voxels, &Allowance::default()).dense();
            prop_assert!(far.iter_set().all(|v| squared[v] >= 64), "eight voxels away");
            let open = flood(&voxels.complement(), &border(DIMS), Connectivity::Faces6);
            prop_assert!(far.iter_set().all(|v| open.get_index(v)), "open to the border");

            let near = distance_squared_near(&voxels, &far, &Allowance::default());
            let plain = flooded(&voxels, squared.clone(), None, 0.5);
            let fast = flooded(&voxels, near.clone(), Some(&far), 0.5);
            for v in 0..squared.len() {
                // A basin of another label may be the same: outdoors is 1 in both.
                let is_indoors = |labels: &Labels| labels.get(v) > 1;
                if is_indoors(&fast.labels) {
                    prop_assert!(is_indoors(&plain.labels), "voxel {v} was outdoors");
                    prop_assert_eq!(near[v], squared[v], "distance of voxel {}", v);
                }
            }
            // Blocks round distances. So an alcove, nearly as wide at its opening as inside, may become outdoors; a hall that is
            // deeper than its exit by more than that rounding must not.
            let halls = flooded(&voxels, squared.clone(), None, ROUNDED);
            let mut middles: BTreeMap<u32, usize> = BTreeMap::new();
            for v in (0..squared.len()).filter(|&v| halls.labels.get(v) > 1) {
                let middle = middles.entry(halls.labels.get(v)).or_insert(v);
                if squared[v] > squared[*middle] {
                    *middle = v;
                }
            }
            for (hall, &middle) in &middles {
                prop_assert!(fast.labels.get(middle) > 1, "the middle of hall {hall}");
            }
        }
    }

    #[test]
    fn most_of_a_sky_is_found_and_nothing_of_a_closed_hall() {
        let mut voxels = BitVolume::new(DIMS);
        hall(&mut voxels, [20, 3, 20], [80, 40, 80], [20, 9]);
        let far = far_outdoors(&voxels, &Allowance::default()).dense();
        let inside = far.iter_set().filter(|&v| {
            let at = [v % DIMS[0], v / DIMS[0] % DIMS[1], v / (DIMS[0] * DIMS[1])];
            (20..80).contains(&at[0]) && (3..40).contains(&at[1]) && (20..80).contains(&at[2])
        });
        assert_eq!(inside.count(), 0);
        assert!(
            far.count() * 2 > far.n_voxels(),
            "{} of {}",
            far.count(),
            far.n_voxels()
        );
    }
}
