//! Enclosure of air: the number of directions, out of six, in which something is in the way.
//!
//! A room need not be a basin of the distance field: where a whole wall is missing, the air is as wide at its edge as in
//! its middle, and a flood drains it. But it still has a floor, a ceiling and three walls.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use enfilade_geom::Allowance;

use super::components::{Connectivity, flood};
use super::grid::BitVolume;
use super::widest::{border, coords};

/// Returns, per free voxel, the number of directions among the six along the axes with an occupied voxel at any distance;
/// 0 for occupied voxels, which are those at distance 0.
///
/// Linear in voxels. Takes a byte per voxel and a byte per column.
#[must_use]
pub fn enclosure([nx, ny, _]: [usize; 3], distances: &[u16], allowance: &Allowance) -> Vec<u8> {
    let n = distances.len();
    let mut out = vec![0; n];
    for is_upwards in [true, false] {
        let mut x_blocked = 0;
        let mut y_blocked = vec![0_u8; nx];
        let mut z_blocked = vec![0_u8; nx * ny];
        for k in 0..n {
            let i = if is_upwards { k } else { n - 1 - k };
            if k % nx == 0 {
                x_blocked = 0;
            }
            if k % (nx * ny) == 0 {
                if !allowance.spend(1 + (nx * ny / 16) as u64) {
                    return out;
                }
                y_blocked.fill(0);
            }
            let (row, layer) = (&mut y_blocked[i % nx], &mut z_blocked[i % (nx * ny)]);
            if distances[i] == 0 {
                (x_blocked, *row, *layer) = (1, 1, 1);
            } else {
                out[i] += x_blocked + *row + *layer;
            }
        }
    }
    out
}

/// Enclosed air: with four sides a passage, with five a room without a wall or roof.
pub const ENCLOSED: std::ops::RangeInclusive<u8> = 4..=6;
/// Smallest volume, as a fraction of the larger air, at which more enclosed air is preferred.
const SHARE: f64 = 0.5;

/// Returns the deepest voxel of the largest connected air that is enclosed on four sides or more, open to the outermost layer
/// and somewhere as deep as `least_depth`; `None` if there is no such air. Of equally deep voxels, the one in the middle of
/// the largest connected group.
///
/// Prefers air enclosed on five or six sides to larger air that is less enclosed, if it has half its volume. Linear
/// in voxels; takes three bits per voxel, and 8 bytes per voxel of the front. [Units of `least_depth`: vx²]
#[must_use]
pub fn deepest_enclosed(
    dims: [usize; 3],
    distances: &[u16],
    enclosure: &[u8],
    least_depth: u16,
    allowance: &Allowance,
) -> Option<usize> {
    let air = BitVolume::from_fn(dims, |i| distances[i] > 0);
    let open = flood(&air, &border(dims), Connectivity::Faces6);
    drop(air);
    let air_of =
        |level: u8| BitVolume::from_fn(dims, |i| enclosure[i] >= level && open.get_index(i));
    let mut best: Option<(usize, usize, u8)> = None;
    for level in ENCLOSED {
        let Some((volume, seed)) = largest(&mut air_of(level), distances, least_depth, allowance)
        else {
            continue;
        };
        if best.is_none_or(|(of, ..)| volume as f64 >= SHARE * of as f64) {
            best = Some((volume, seed, level));
        }
    }
    let (_, seed, level) = best?;
    let (mut deepest, mut depth) = (Vec::new(), 0);
    gather(&mut air_of(level), seed, allowance, |i| {
        if distances[i] > depth {
            depth = distances[i];
            deepest.clear();
        }
        if distances[i] == depth {
            deepest.push(i);
        }
    });
    // All voxels halfway up a room are equally deep; take the largest group of them.
    let mut floors = BitVolume::new(dims);
    for &i in &deepest {
        let [x, y, z] = coords(dims, i);
        floors.set(x, y, z, true);
    }
    let (_, seed) = largest(&mut floors.clone(), distances, 0, allowance)?;
    deepest.clear();
    gather(&mut floors, seed, allowance, |i| deepest.push(i));
    middle_of(dims, &deepest)
}

/// Returns the volume and a voxel of the largest connected part that is deep enough; ties by index. Clears `set`.
fn largest(
    set: &mut BitVolume,
    distances: &[u16],
    least_depth: u16,
    allowance: &Allowance,
) -> Option<(usize, usize)> {
    let mut best: Option<(usize, usize)> = None;
    for seed in 0..set.n_voxels() {
        if !set.get_index(seed) {
            continue;
        }
        let (mut volume, mut depth) = (0, 0);
        gather(set, seed, allowance, |i| {
            volume += 1;
            depth = depth.max(distances[i]);
        });
        if depth >= least_depth && best.is_none_or(|(of, _)| volume > of) {
            best = Some((volume, seed));
        }
    }
    best
}

/// Visits all voxels connected to `seed` through faces within `set`, and removes them from it.
fn gather(set: &mut BitVolume, seed: usize, allowance: &Allowance, mut visit: impl FnMut(usize)) {
    let dims = set.dims();
    let [x, y, z] = coords(dims, seed);
    set.set(x, y, z, false);
    let mut front = vec![seed];
    while let Some(i) = front.pop().filter(allowance.each(1)) {
        visit(i);
        for [x, y, z] in neighbors(dims, i) {
            if set.get(x, y, z) {
                set.set(x, y, z, false);
                front.push(x + dims[0] * (y + dims[1] * z));
            }
        }
    }
}

/// Returns the voxel nearest to the mean of some voxels; ties by index.
fn middle_of(dims: [usize; 3], voxels: &[usize]) -> Option<usize> {
    let at = |i: usize| coords(dims, i).map(|c| c as f64);
    let n = voxels.len() as f64;
    let mean = [0, 1, 2].map(|k| voxels.iter().map(|&i| at(i)[k]).sum::<f64>() / n);
    let off = |i: usize| -> f64 { (0..3).map(|k| (at(i)[k] - mean[k]).powi(2)).sum() };
    let nearest = |a: &&usize, b: &&usize| off(**a).total_cmp(&off(**b)).then(a.cmp(b));
    voxels.iter().min_by(nearest).copied()
}

/// Radius, as a fraction of the largest ball so far, below which the ascent stops: it passes furniture, but not doors.
const PINCH: f64 = 0.6;

/// Returns a deepest voxel of the air around a free one. A flood through voxels at least as enclosed as the start takes the
/// deepest first, and ends when the next is narrower than `PINCH` of the deepest so far. Of equally deep voxels, the first
/// reached.
///
/// `O(n log n)` in the voxels flooded. Takes a bit per voxel, and 16 bytes per voxel of the front.
#[must_use]
pub fn ascend(
    dims: [usize; 3],
    distances: &[u16],
    enclosure: &[u8],
    start: usize,
    allowance: &Allowance,
) -> usize {
    let mut seen = BitVolume::new(dims);
    let mut front = BinaryHeap::from([(distances[start], Reverse(start))]);
    let mut best = start;
    while let Some((depth, Reverse(v))) = front.pop() {
        if !allowance.spend(2) {
            break;
        }
        if f64::from(depth) < PINCH * PINCH * f64::from(distances[best]) {
            break;
        }
        if depth > distances[best] {
            best = v;
        }
        for [x, y, z] in neighbors(dims, v) {
            let next = x + dims[0] * (y + dims[1] * z);
            let is_part = distances[next] > 0 && enclosure[next] >= enclosure[start];
            if is_part && !seen.get(x, y, z) {
                seen.set(x, y, z, true);
                front.push((distances[next], Reverse(next)));
            }
        }
    }
    best
}

/// Returns the voxels that share a face with one.
fn neighbors(dims: [usize; 3], of: usize) -> impl Iterator<Item = [usize; 3]> {
    let at = coords(dims, of);
    (0..6).filter_map(move |k: usize| {
        let (axis, mut next) = (k / 2, at);
        next[axis] = if k.is_multiple_of(2) {
            at[axis].checked_sub(1)?
        } else {
            Some(at[axis] + 1).filter(|&c| c < dims[axis])?
        };
        Some(next)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance_squared;

    const N: [usize; 3] = [40, 20, 30];

    /// The shell of the box from `lo` to `hi`, without the voxels for which `hole` returns `true`.
    fn shell(lo: [usize; 3], hi: [usize; 3], hole: impl Fn([usize; 3]) -> bool + Sync) -> Vec<u16> {
        let bits = BitVolume::from_fn(N, |i| {
            let at = [i % N[0], i / N[0] % N[1], i / (N[0] * N[1])];
            let is_in = |by: usize| (0..3).all(|k| lo[k] + by <= at[k] && at[k] + by <= hi[k]);
            is_in(0) && !is_in(1) && !hole(at)
        });
        distance_squared(&bits, &Allowance::default())
    }

    fn start(distances: &[u16]) -> Option<[usize; 3]> {
        let found = deepest_enclosed(
            N,
            distances,
            &enclosure(N, distances, &Allowance::default()),
            9,
            &Allowance::default(),
        )?;
        Some([found % N[0], found / N[0] % N[1], found / (N[0] * N[1])])
    }

    #[test]
    fn enclosure_equals_a_walk_to_the_edge() {
        let distances = shell([4, 3, 5], [30, 15, 21], |[x, y, z]| {
            x == 30 || (y == 15 && z < 12)
        });
        let found = enclosure(N, &distances, &Allowance::default());
        let at = |p: [isize; 3]| (0..3).all(|k| (0..N[k] as isize).contains(&p[k]));
        for (i, &sides) in found.iter().enumerate() {
            let from = [i % N[0], i / N[0] % N[1], i / (N[0] * N[1])].map(|c| c as isize);
            let mut expected = 0;
            for (axis, by) in (0..3).flat_map(|a| [(a, 1), (a, -1)]) {
                let mut p = from;
                while at(p) && distances[i] > 0 {
                    let [x, y, z] = p.map(|c| c as usize);
                    if distances[x + N[0] * (y + N[1] * z)] == 0 {
                        expected += 1;
                        break;
                    }
                    p[axis] += by;
                }
            }
            assert_eq!(sides, expected, "{from:?}");
        }
    }

    #[test]
    fn the_middle_of_a_room_without_a_wall_is_found() {
        let room = shell([4, 3, 5], [30, 15, 21], |at| at[0] == 30);
        let [x, y, z] = start(&room).unwrap();
        assert!((9..30).contains(&x) && (8..=10).contains(&y) && (11..=15).contains(&z));
        // A closed shell has no way out; a floor alone encloses no air.
        assert_eq!(start(&shell([4, 3, 5], [30, 15, 21], |_| false)), None);
        assert_eq!(start(&shell([4, 3, 5], [30, 15, 21], |at| at[1] > 3)), None);
        // Too narrow for a room.
        assert_eq!(
            start(&shell([4, 3, 5], [30, 8, 21], |at| at[0] == 30)),
            None
        );
    }

    #[test]
    fn a_point_by_the_wall_rises_to_the_middle_of_its_room_and_not_out_of_it() {
        let room = shell([4, 3, 5], [30, 15, 21], |at| at[0] == 30);
        let sides = enclosure(N, &room, &Allowance::default());
        for p in [[5, 4, 6], [29, 14, 20], [29, 9, 13], [17, 4, 20]] {
            let i = p[0] + N[0] * (p[1] + N[1] * p[2]);
            let top = ascend(N, &room, &sides, i, &Allowance::default());
            assert!(room[top] >= room[i] && room[top] >= 25, "{p:?}");
            assert!(top % N[0] < 30, "{p:?}");
        }
    }
}
