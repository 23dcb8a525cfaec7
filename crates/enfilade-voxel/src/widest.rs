//! The widest path from a voxel to the edge of the box.
//!
//! The *bottleneck* of a path is its least distance to occupied voxels; the widest path has the greatest
//! bottleneck of all (Pollack, "The Maximum Capacity Through a Network", 1960). The search resembles the
//! watershed's flood: from the deepest voxel of the front downwards (Meyer, "Topographic Distance and
//! Watershed Lines", 1994, §4), with a bucket per level. Of all widest paths it takes the shortest:
//! Dijkstra's algorithm with buckets (Dial, "Shortest-Path Forest with Topological Ordering", 1969) in the
//! air that is at least as wide as the bottleneck.
//!
//! A step goes to one of 26 neighbors, and only if all voxels of the box around both are wide enough: a
//! path never slips between two voxels that touch at an edge or a vertex.

use enfilade_geom::Allowance;

use super::components::{Connectivity, flood};
use super::grid::BitVolume;

/// A path from a voxel to the edge of the box.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WidestPath {
    /// Voxel indices from the start on; each is one of the 26 neighbors of the one before, the last lies in
    /// the outermost layer.
    pub voxels: Vec<usize>,
    /// Index in `voxels` of the narrowest one, or of one that steps past it: wider air that reaches the edge begins behind it.
    /// On a stretch of constant narrowest width, such as a passage, its far end.
    pub narrowest: usize,
    /// Squared distance there. [Units: vx²]
    pub bottleneck: u16,
}

/// Returns the widest path from `start` to the outermost layer of the box, and of those the shortest;
/// `None` if occupied voxels close every way, or `start` is occupied.
///
/// `distances` are squared, as from [`distance_squared`](super::distance_squared): 0 is occupied, and all
/// air from 65,535 on (256 voxels) is equally wide. [Units: vx²]
///
/// Linear in voxels and levels. Takes a byte and two bits per voxel, and 8 to 16 bytes per voxel of the front.
/// Deterministic.
///
/// # Panics
/// If `distances` does not have one value per voxel, or `start` is out of range.
#[must_use]
pub fn widest_path(
    dims: [usize; 3],
    distances: &[u16],
    start: usize,
    allowance: &Allowance,
) -> Option<WidestPath> {
    assert_eq!(
        dims.iter().product::<usize>(),
        distances.len(),
        "one distance a voxel"
    );
    let bottleneck = bottleneck(dims, distances, start, allowance)?;
    let voxels = shortest(dims, distances, start, bottleneck, allowance);
    let beyond = flood(
        &BitVolume::from_fn(dims, |i| distances[i] > bottleneck),
        &border(dims),
        Connectivity::Faces6,
    );
    // Nothing is in the way after the narrowest place. If nothing is wider, it is the last.
    let end = voxels.iter().position(|&v| beyond.get_index(v));
    let before = || (0..end.unwrap_or(voxels.len())).rev();
    let is_narrow = |&i: &usize| distances[voxels[i]] == bottleneck;
    // A diagonal step may pass beside the narrowest voxels without touching one.
    let leads_by_narrow = |&i: &usize| {
        let next = *voxels.get(i + 1).unwrap_or(&voxels[i]);
        narrowest_around(dims, distances, [voxels[i], next]) == bottleneck
    };
    let narrowest = before()
        .find(is_narrow)
        .or_else(|| before().find(leads_by_narrow))?;
    Some(WidestPath {
        voxels,
        narrowest,
        bottleneck,
    })
}

impl WidestPath {
    /// Returns the vertices of a polyline along the path with few of them, as voxel indices: every voxel that it touches is as
    /// wide as the bottleneck. The positions `keep` in [`Self::voxels`], ascending, remain vertices.
    ///
    /// Each vertex is followed by the last voxel before the first that is not in sight: time is at most the length of the path
    /// times the box's diagonal. `dims` and `distances` must be those of the search.
    #[must_use]
    pub fn corners(&self, dims: [usize; 3], distances: &[u16], keep: &[usize]) -> Vec<usize> {
        let last = self.voxels.len() - 1;
        let mut out = vec![self.voxels[0]];
        let mut from = 0;
        for i in 1..=last {
            let is_in_sight = |to: usize| {
                let ends = [self.voxels[from], self.voxels[to]];
                is_clear_line(dims, distances, ends, self.bottleneck)
            };
            let is_kept = keep.contains(&i) || i == last;
            if is_kept && is_in_sight(i) {
                from = i;
            } else if !is_in_sight(i) {
                // A step is always in sight, so the one before is beyond the vertex.
                out.push(self.voxels[i - 1]);
                from = if is_kept { i } else { i - 1 };
            }
            if is_kept {
                out.push(self.voxels[i]);
            }
        }
        out
    }
}

/// Returns the least squared distance in the box around both ends of a step.
fn narrowest_around(dims: [usize; 3], distances: &[u16], ends: [usize; 2]) -> u16 {
    let [a, b] = ends.map(|i| coords(dims, i));
    let vertex = |c: usize| [0, 1, 2].map(|k| if c >> k & 1 == 1 { a[k] } else { b[k] });
    let at = |[x, y, z]: [usize; 3]| distances[x + dims[0] * (y + dims[1] * z)];
    (0..8).map(|c| at(vertex(c))).min().unwrap_or(0)
}

/// Returns `true` if all voxels touched by the line between the centers of two are wide enough.
fn is_clear_line(dims: [usize; 3], distances: &[u16], ends: [usize; 2], least: u16) -> bool {
    let strides = [1, dims[0] as isize, (dims[0] * dims[1]) as isize];
    let [a, b] = ends.map(|i| coords(dims, i));
    let span = [0, 1, 2].map(|k| b[k].abs_diff(a[k]));
    let mut done = [0; 3];
    let mut at = ends[0];
    while done != span {
        // Along an axis the line leaves its next voxel at (done + 1/2) / span of its length.
        let is_first = |k: usize| {
            done[k] < span[k]
                && (0..3).all(|l| (2 * done[k] + 1) * span[l] <= (2 * done[l] + 1) * span[k])
        };
        let step = [0, 1, 2].map(|k| match (is_first(k), b[k] > a[k]) {
            (false, _) => 0,
            (true, true) => 1,
            (true, false) => -1,
        });
        if !is_clear(distances, at, step, strides, least) {
            return false;
        }
        for k in 0..3 {
            done[k] += step[k].unsigned_abs();
            at = at.wrapping_add_signed(step[k] * strides[k]);
        }
    }
    true
}

/// Returns the outermost layer of voxels.
#[must_use]
pub fn border(dims: [usize; 3]) -> BitVolume {
    let [nx, ny, nz] = dims;
    let mut out = BitVolume::new(dims);
    for z in 0..nz {
        for y in 0..ny {
            if y + 1 == ny || z + 1 == nz || y == 0 || z == 0 {
                out.fill_row(y + ny * z, 0..nx);
            } else {
                out.set(0, y, z, true);
                out.set(nx - 1, y, z, true);
            }
        }
    }
    out
}

fn is_border(dims: [usize; 3], at: [usize; 3]) -> bool {
    (0..3).any(|k| at[k] == 0 || at[k] + 1 == dims[k])
}

pub(super) fn coords([nx, ny, _]: [usize; 3], index: usize) -> [usize; 3] {
    [index % nx, index / nx % ny, index / (nx * ny)]
}

/// Returns the greatest squared distance at which air connects `start` to the outermost layer.
fn bottleneck(
    dims: [usize; 3],
    distances: &[u16],
    start: usize,
    allowance: &Allowance,
) -> Option<u16> {
    let mut seen = BitVolume::new(dims);
    let mut mark = |at: [usize; 3]| {
        let is_new = !seen.get(at[0], at[1], at[2]);
        seen.set(at[0], at[1], at[2], true);
        is_new
    };
    let strides = [1, dims[0], dims[0] * dims[1]];
    let mut level = distances[start];
    let mut buckets: Vec<Vec<usize>> = vec![Vec::new(); usize::from(level) + 1];
    buckets[usize::from(level)].push(start);
    mark(coords(dims, start));
    while level > 0 {
        let Some(v) = buckets[usize::from(level)].pop() else {
            level -= 1;
            continue;
        };
        if !allowance.spend(1) {
            return None;
        }
        let at = coords(dims, v);
        if is_border(dims, at) {
            return Some(level);
        }
        for axis in 0..3 {
            // Inside of the outermost layer there are neighbors on all sides.
            for (next, beside) in [
                (v - strides[axis], at[axis] - 1),
                (v + strides[axis], at[axis] + 1),
            ] {
                let mut to = at;
                to[axis] = beside;
                if distances[next] > 0 && mark(to) {
                    buckets[usize::from(level.min(distances[next]))].push(next);
                }
            }
        }
    }
    None
}

/// Steps to the 26 neighbors with their lengths in tenths of a voxel, rounded.
const STEPS: [([isize; 3], usize); 26] = {
    const LENGTHS: [usize; 4] = [0, 10, 14, 17];
    let mut out = [([0; 3], 0); 26];
    let (mut n, mut k) = (0, 0);
    while k < 27 {
        let step = [
            k as isize % 3 - 1,
            k as isize / 3 % 3 - 1,
            k as isize / 9 - 1,
        ];
        let moved = (step[0] != 0) as usize + (step[1] != 0) as usize + (step[2] != 0) as usize;
        if moved > 0 {
            out[n] = (step, LENGTHS[moved]);
            n += 1;
        }
        k += 1;
    }
    out
};
/// Number of buckets in use at a time: one for each length up to the longest.
const RING: usize = 18;
/// Marks the start, where other voxels have the index of the step that reached them.
const BEGIN: u8 = 26;
const UNSEEN: u8 = u8::MAX;

/// Returns the shortest path from `start` to the outermost layer through voxels of at least `least`.
fn shortest(
    dims: [usize; 3],
    distances: &[u16],
    start: usize,
    least: u16,
    allowance: &Allowance,
) -> Vec<usize> {
    let strides = [1, dims[0] as isize, (dims[0] * dims[1]) as isize];
    let offset = |step: [isize; 3]| -> isize { (0..3).map(|k| step[k] * strides[k]).sum() };
    let mut came_by = vec![UNSEEN; distances.len()];
    let mut ring: [Vec<(usize, u8)>; RING] = std::array::from_fn(|_| Vec::new());
    ring[0].push((start, BEGIN));
    let (mut now, mut waiting) = (0, 1);
    while waiting > 0 {
        let Some((v, step)) = ring[now % RING].pop() else {
            now += 1;
            continue;
        };
        waiting -= 1;
        if came_by[v] != UNSEEN {
            continue;
        }
        came_by[v] = step;
        if !allowance.spend(4) {
            break;
        }
        let at = coords(dims, v);
        if is_border(dims, at) {
            return way_to(v, &came_by, &offset);
        }
        for (k, &(step, length)) in STEPS.iter().enumerate() {
            let next = v.wrapping_add_signed(offset(step));
            if came_by[next] == UNSEEN && is_clear(distances, v, step, strides, least) {
                ring[(now + length) % RING].push((next, k as u8));
                waiting += 1;
            }
        }
    }
    vec![start]
}

/// Returns `true` if all voxels of the box around both ends of a step are wide enough.
fn is_clear(
    distances: &[u16],
    from: usize,
    step: [isize; 3],
    strides: [isize; 3],
    least: u16,
) -> bool {
    (1..8).all(|corner: usize| {
        let along = |k: usize| {
            if corner >> k & 1 == 1 {
                step[k] * strides[k]
            } else {
                0
            }
        };
        distances[from.wrapping_add_signed(along(0) + along(1) + along(2))] >= least
    })
}

fn way_to(end: usize, came_by: &[u8], offset: &impl Fn([isize; 3]) -> isize) -> Vec<usize> {
    let mut out = vec![end];
    let mut at = end;
    while let Some(&(step, _)) = STEPS.get(usize::from(came_by[at])) {
        at = at.wrapping_add_signed(-offset(step));
        out.push(at);
    }
    out.reverse();
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance_squared;
    use proptest::prelude::*;

    /// Greatest level at which a plain flood gets from `start` to the edge, tried level by level.
    fn oracle(dims: [usize; 3], distances: &[u16], start: usize) -> Option<u16> {
        let gets_out = |level: u16| {
            let mut is_wet = vec![false; distances.len()];
            is_wet[start] = distances[start] >= level;
            // Sweeps over everything until nothing changes.
            loop {
                let mut changed = false;
                for z in 0..dims[2] {
                    for y in 0..dims[1] {
                        for x in 0..dims[0] {
                            let i = x + dims[0] * (y + dims[1] * z);
                            if !is_wet[i] {
                                continue;
                            }
                            if x == 0 || y == 0 || z == 0 {
                                return true;
                            }
                            if x + 1 == dims[0] || y + 1 == dims[1] || z + 1 == dims[2] {
                                return true;
                            }
                            let [row, layer] = [dims[0], dims[0] * dims[1]];
                            for j in [i - 1, i + 1, i - row, i + row, i - layer, i + layer] {
                                if !is_wet[j] && distances[j] >= level {
                                    is_wet[j] = true;
                                    changed = true;
                                }
                            }
                        }
                    }
                }
                if !changed {
                    return false;
                }
            }
        };
        (1..=distances[start]).rev().find(|&level| gets_out(level))
    }

    fn check(dims: [usize; 3], distances: &[u16], start: usize) {
        let found = widest_path(dims, distances, start, &Allowance::default());
        let expected = oracle(dims, distances, start);
        assert_eq!(found.as_ref().map(|p| p.bottleneck), expected);
        let Some(path) = found else { return };
        assert_eq!(path.voxels[0], start);
        let last = path.voxels[path.voxels.len() - 1];
        assert!(is_border(dims, coords(dims, last)));
        // If all the air that the path sweeps were wider, so were a path from face to face within it.
        let least_of_step = |i: usize| {
            let next = path.voxels[(i + 1).min(path.voxels.len() - 1)];
            narrowest_around(dims, distances, [path.voxels[i], next])
        };
        let least = (0..path.voxels.len()).map(least_of_step).min();
        assert_eq!(least, expected);
        assert_eq!(Some(least_of_step(path.narrowest)), expected);
        for pair in path.voxels.windows(2) {
            let [a, b] = [coords(dims, pair[0]), coords(dims, pair[1])];
            assert!((0..3).all(|k| a[k].abs_diff(b[k]) <= 1));
            // The whole box around both is air.
            for c in 0..8 {
                let at = [0, 1, 2].map(|k| if c >> k & 1 == 1 { a[k] } else { b[k] });
                let i = at[0] + dims[0] * (at[1] + dims[1] * at[2]);
                assert!(Some(distances[i]) >= expected);
            }
        }
        check_corners(dims, distances, &path);
    }

    fn check_corners(dims: [usize; 3], distances: &[u16], path: &WidestPath) {
        let keep = [path.narrowest, path.voxels.len() / 2];
        let corners = path.corners(dims, distances, &keep);
        assert!(corners.len() <= path.voxels.len());
        assert_eq!(corners[0], path.voxels[0]);
        assert_eq!(corners.last(), path.voxels.last());
        assert!(keep.iter().all(|&k| corners.contains(&path.voxels[k])));
        for pair in corners.windows(2) {
            let [a, b] = [pair[0], pair[1]].map(|i| coords(dims, i).map(|c| c as f64));
            for t in 0..=1000 {
                let t = f64::from(t) / 1000.0;
                let p = [0, 1, 2].map(|k| (a[k] + (b[k] - a[k]) * t).round() as usize);
                let i = p[0] + dims[0] * (p[1] + dims[1] * p[2]);
                assert!(distances[i] >= path.bottleneck, "{pair:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn the_bottleneck_is_that_of_the_widest_of_all_paths(
            nx in 1usize..14, ny in 1usize..12, nz in 1usize..12,
            filled in 0.0..0.5f64, seed in 1u64.., start in any::<usize>(),
        ) {
            let dims = [nx, ny, nz];
            let n = nx * ny * nz;
            let mut s = seed;
            let mut random = || {
                s ^= s << 13;
                s ^= s >> 7;
                s ^= s << 17;
                (s >> 11) as f64 / (1_u64 << 53) as f64
            };
            let bits: Vec<bool> = (0..n).map(|_| random() < filled).collect();
            check(dims, &distance_squared(&BitVolume::from_fn(dims, |i| bits[i]), &Allowance::default()), start % n);
            // Any numbers will do for distances.
            let numbers: Vec<u16> = (0..n).map(|_| (random() * 7.0) as u16).collect();
            check(dims, &numbers, start % n);
        }
    }

    #[test]
    fn a_step_that_slants_past_the_narrowest_voxels_is_the_narrowest_place() {
        // Two rooms one voxel high in a layer, joined across an edge by two voxels that are narrower.
        let dims = [6, 6, 3];
        let mut distances = vec![0; 6 * 6 * 3];
        let mut set = |x: usize, y: usize, d: u16| distances[x + 6 * (y + 6)] = d;
        for (x, y, d) in [
            (2, 2, 9),
            (3, 2, 4),
            (2, 3, 4),
            (3, 3, 9),
            (4, 3, 9),
            (5, 3, 9),
        ] {
            set(x, y, d);
        }
        let start = 2 + 6 * (2 + 6);
        let path = widest_path(dims, &distances, start, &Allowance::default()).unwrap();
        assert_eq!((path.bottleneck, path.narrowest), (4, 0));
        check(dims, &distances, start);
    }

    #[test]
    fn the_narrowest_place_is_the_far_end_of_the_narrowest_stretch() {
        // A row of voxels: a room, a passage of three, a wider bay, the edge.
        let row = [0, 9, 9, 4, 4, 4, 6, 5, 8];
        let mut distances = vec![0; 9 * 9];
        distances[36..45].copy_from_slice(&row);
        let path = widest_path([9, 9, 1], &distances, 37, &Allowance::default()).unwrap();
        // In a single layer, every voxel is at the edge.
        assert_eq!((path.voxels.len(), path.narrowest), (1, 0));
        let mut deep = vec![0; 9 * 9 * 3];
        deep[81..162].copy_from_slice(&distances);
        let path = widest_path([9, 9, 3], &deep, 81 + 37, &Allowance::default()).unwrap();
        assert_eq!(path.voxels, (118..126).collect::<Vec<_>>());
        assert_eq!((path.bottleneck, path.narrowest), (4, 4));
    }

    #[test]
    fn of_two_ways_as_wide_the_shorter_is_taken() {
        let dims = [41, 21, 21];
        // A box of air, shut but for a hole near one end of each long side.
        let inside = |i: usize| {
            let [x, y, z] = coords(dims, i);
            let is_wall = (5..36).contains(&x) && (5..16).contains(&y) && (5..16).contains(&z);
            let is_room = (6..35).contains(&x) && (6..15).contains(&y) && (6..15).contains(&z);
            let is_hole = [8, 30].iter().any(|&h| x.abs_diff(h) < 3) && z.abs_diff(10) < 3;
            is_wall && !is_room && !(is_hole && y == 15)
        };
        let distances = distance_squared(&BitVolume::from_fn(dims, inside), &Allowance::default());
        let at = |x: usize| x + dims[0] * (10 + dims[1] * 10);
        for (start, hole) in [(12, 8), (27, 30)] {
            let path = widest_path(dims, &distances, at(start), &Allowance::default()).unwrap();
            let narrowest = coords(dims, path.voxels[path.narrowest]);
            assert_eq!(narrowest, [hole, 15, 10], "from {start}");
            assert_eq!(path.bottleneck, 9);
        }
    }
}
