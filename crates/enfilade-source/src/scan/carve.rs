//! The air that the ways from stations to points cross.

use std::collections::HashMap;

use enfilade_geom::DVec3;

use super::cells::ScanGrid;
use super::{REACH, Scan};

/// Ways followed from one station to the points of one voxel: neighbors on a surface cross nearly the same air.
const WAYS: u8 = 3;
/// Half the width of unknown space that is a gap between ways, not a thing: less than the thinnest walls and the air in front of them
/// that is left to planes. [Units: voxels]
pub(super) const BETWEEN: usize = 3;

/// Marks the vertices whose voxel a way crosses, except near its point.
pub(super) fn carve(scan: &Scan, grid: &ScanGrid, free: &mut [bool]) {
    let mut n_ways: HashMap<(u16, usize), u8> = HashMap::new();
    for (p, &s) in scan.points.iter().zip(&scan.station_of) {
        let n = n_ways.entry((s, grid.index(grid.nearest(*p)))).or_insert(0);
        if *n >= WAYS {
            continue;
        }
        *n += 1;
        free_way(grid, scan.stations[usize::from(s)], *p, free);
    }
    for (s, end) in super::gaps::ends(scan) {
        free_way(grid, scan.stations[usize::from(s)], end, free);
    }
}

/// Marks the voxels of a way, except near its end.
fn free_way(grid: &ScanGrid, from: DVec3, to: DVec3, free: &mut [bool]) {
    let way = to - from;
    let length = way.length();
    let end = length - (REACH - 0.5) * grid.step;
    if end > 0.0 {
        walk(grid, from, from + way * (end / length), free);
    }
}

/// Marks all voxels from one point to another, after Amanatides & Woo, "A fast voxel traversal algorithm" (1987).
fn walk(grid: &ScanGrid, from: DVec3, to: DVec3, free: &mut [bool]) {
    // Voxel i is from i - 0.5 to i + 0.5.
    let (a, b) = (grid.scaled(from) + 0.5, grid.scaled(to) + 0.5);
    let way = (b - a).to_array();
    let mut at = a.floor().to_array().map(|c| c.max(0.0) as usize);
    let last = b.floor().to_array().map(|c| c.max(0.0) as usize);
    let start = a.to_array();
    let mut next = [0, 1, 2].map(|i| {
        let edge = if way[i] > 0.0 {
            at[i] as f64 + 1.0
        } else {
            at[i] as f64
        };
        if way[i] == 0.0 {
            f64::INFINITY
        } else {
            (edge - start[i]) / way[i]
        }
    });
    let n: usize = (0..3).map(|i| at[i].abs_diff(last[i])).sum();
    for _ in 0..=n {
        if (0..3).any(|i| at[i] >= grid.size[i]) {
            return;
        }
        free[grid.index(at)] = true;
        let axis = (0..3).fold(0, |m, i| if next[i] < next[m] { i } else { m });
        if way[axis] > 0.0 {
            at[axis] += 1;
        } else {
            at[axis] = at[axis].wrapping_sub(1);
        }
        next[axis] += 1.0 / way[axis].abs();
    }
}

/// Makes voxels free that lie between ways: all unknown space that is at most `2 * BETWEEN` voxels wide along each axis.
///
/// Space behind seen points is matter all the same: see [`super::planes::fill_behind`].
pub(super) fn close_gaps(grid: &ScanGrid, free: &mut [bool]) {
    for (is_grown, axis) in [
        (true, 0),
        (true, 1),
        (true, 2),
        (false, 0),
        (false, 1),
        (false, 2),
    ] {
        spread(grid, free, axis, is_grown);
    }
}

/// Sets to `value` all voxels within [`BETWEEN`] of one that has it, along an axis.
fn spread(grid: &ScanGrid, free: &mut [bool], axis: usize, value: bool) {
    let n = grid.size[axis];
    let stride = grid.size[..axis].iter().product::<usize>();
    let mut row = vec![false; n];
    for start in 0..free.len() / n {
        let first = start % stride + start / stride * stride * n;
        for (i, cell) in row.iter_mut().enumerate() {
            *cell = free[first + i * stride];
        }
        // The last voxel with the value, in both directions.
        let mut last = None;
        for i in 0..n {
            if row[i] == value {
                last = Some(i);
            } else if last.is_some_and(|l| i - l <= BETWEEN) {
                free[first + i * stride] = value;
            }
        }
        let mut last = None;
        for i in (0..n).rev() {
            if row[i] == value {
                last = Some(i);
            } else if last.is_some_and(|l| l - i <= BETWEEN) {
                free[first + i * stride] = value;
            }
        }
    }
}
