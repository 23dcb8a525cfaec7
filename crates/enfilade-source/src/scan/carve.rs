//! The air that the ways from stations to points cross.

use std::collections::HashMap;

use enfilade_geom::DVec3;

use super::cells::ScanGrid;
use super::{REACH, Scan};

/// Ways followed from one station to the points of one voxel: neighbors on a surface cross nearly the same air.
const WAYS: u8 = 3;
/// Free voxels among the 26 around an unknown one that make it free: a gap between ways, not a thing.
const SPECK: usize = 16;

/// Marks the vertices whose voxel a way crosses, except near its point.
pub(super) fn carve(scan: &Scan, grid: &ScanGrid, free: &mut [bool]) {
    let mut n_ways: HashMap<(u16, usize), u8> = HashMap::new();
    for (p, &s) in scan.points.iter().zip(&scan.station_of) {
        let n = n_ways.entry((s, grid.index(grid.nearest(*p)))).or_insert(0);
        if *n >= WAYS {
            continue;
        }
        *n += 1;
        let from = scan.stations[usize::from(s)];
        let way = *p - from;
        let length = way.length();
        let end = length - (REACH - 0.5) * grid.step;
        if end > 0.0 {
            walk(grid, from, from + way * (end / length), free);
        }
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

/// Makes voxels free that lie between ways.
pub(super) fn close_specks(grid: &ScanGrid, free: &mut [bool]) {
    let [nx, ny, nz] = grid.size;
    let mut specks = Vec::new();
    for z in 1..nz.saturating_sub(1) {
        for y in 1..ny.saturating_sub(1) {
            for x in 1..nx.saturating_sub(1) {
                if free[grid.index([x, y, z])] {
                    continue;
                }
                let around = (0..27).filter(|k| {
                    let other = [x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1];
                    free[grid.index(other)]
                });
                if around.count() >= SPECK {
                    specks.push(grid.index([x, y, z]));
                }
            }
        }
    }
    for i in specks {
        free[i] = true;
    }
}
