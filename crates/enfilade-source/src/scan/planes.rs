//! Planes through the points of a voxel and of those around it.

use std::collections::HashMap;

use enfilade_geom::{DMat3, DVec3, Purse, Tab};

use super::cells::ScanGrid;
use super::{REACH, Scan};
use crate::qef::eigen;

/// Fewer points around a voxel are noise: mixed echoes at edges float in the air.
const LEAST_POINTS: f64 = 4.0;
/// Smallest sum of weights of planes at a vertex for their distance to count.
const LEAST_WEIGHT: f64 = 0.05;

/// Sum of weights at which planes make air of what was not crossed: several of them nearby.
const SURE_WEIGHT: f64 = 0.5;

/// Sums over the points of a voxel, relative to its vertex.
#[derive(Clone, Copy)]
struct Sums {
    n: f64,
    p: DVec3,
    pp: DMat3,
    /// Sum of the unit directions to the stations.
    up: DVec3,
}

impl Sums {
    const ZERO: Self = Self {
        n: 0.0,
        p: DVec3::ZERO,
        pp: DMat3::ZERO,
        up: DVec3::ZERO,
    };
}

/// A plane through points; the normal points to where they were seen from.
pub(super) struct PointPlane {
    at: DVec3,
    normal: DVec3,
}

/// Returns a plane for each voxel with enough points, until the purse is empty.
pub(super) fn of_scan(scan: &Scan, grid: &ScanGrid, purse: Purse<'_>) -> Vec<PointPlane> {
    let mut tab = Tab::from(purse);
    let mut sums: HashMap<usize, Sums> = HashMap::new();
    for (p, s) in scan.points.iter().zip(&scan.station_of) {
        if !tab.spend(2) {
            return Vec::new();
        }
        let Some(at) = grid.voxel(*p) else {
            continue;
        };
        let d = *p - grid.point(at);
        let sum = sums.entry(grid.index(at)).or_insert(Sums::ZERO);
        sum.n += 1.0;
        sum.p += d;
        sum.pp += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        sum.up += (scan.stations[usize::from(*s)] - *p).normalize_or_zero();
    }
    let mut found = Vec::new();
    let mut voxels: Vec<usize> = sums.keys().copied().collect();
    voxels.sort_unstable();
    for voxel in voxels {
        if !tab.spend(20) {
            break;
        }
        let own = &sums[&voxel];
        let at = grid.at(voxel);
        let (mut n, mut p, mut pp, mut up) = (0.0, DVec3::ZERO, DMat3::ZERO, DVec3::ZERO);
        for k in 0..27 {
            let offset = [k % 3, k / 3 % 3, k / 9];
            let other = [0, 1, 2].map(|a| at[a] + offset[a]);
            if (0..3).any(|a| other[a] == 0 || other[a] > grid.size[a]) {
                continue;
            }
            let other = other.map(|c| c - 1);
            let Some(sum) = sums.get(&grid.index(other)) else {
                continue;
            };
            // The other side of a thin wall is another surface.
            if sum.up.dot(own.up) < 0.0 {
                continue;
            }
            let by = grid.point(other) - grid.point(at);
            n += sum.n;
            p += sum.p + by * sum.n;
            let (a, b) = (sum.p, by);
            let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
            pp += sum.pp + outer(a, b) + outer(b, a) + outer(b, b) * sum.n;
            up += sum.up;
        }
        if n < LEAST_POINTS {
            continue;
        }
        let mean = p / n;
        let outer = DMat3::from_cols(mean * mean.x, mean * mean.y, mean * mean.z);
        let (values, vectors) = eigen(pp * (1.0 / n) - outer);
        let least = (0..3).fold(0, |m, i| if values[i] < values[m] { i } else { m });
        let normal = vectors[least];
        let normal = if normal.dot(up) < 0.0 {
            -normal
        } else {
            normal
        };
        // Through the points of the voxel itself, where edges bend the plane around it.
        let middle = grid.point(at) + own.p / own.n;
        let lift = normal.dot(grid.point(at) + mean - middle);
        found.push(PointPlane {
            at: middle + normal * lift * 0.5,
            normal,
        });
    }
    found
}

/// Edge of a block of sums. [Units: voxels]
const BLOCK: usize = 8;
/// Sums of weighted distances, and of weights, of the vertices in a block.
type BlockSums = Box<[[f32; 2]; BLOCK * BLOCK * BLOCK]>;

/// Replaces the values near planes by the distance from them, until the purse is empty; returns the vertices that got one.
pub(super) fn blend(
    planes: &[PointPlane],
    grid: &ScanGrid,
    free: &[bool],
    values: &mut [f32],
    purse: Purse<'_>,
) -> Vec<bool> {
    let mut is_measured = vec![false; values.len()];
    let mut blocks: HashMap<[usize; 3], BlockSums> = HashMap::new();
    for plane in planes.iter().take_while(purse.each(10)) {
        let near = |a: usize, by: f64| {
            let at = grid.scaled(plane.at).to_array()[a] + by;
            (at.max(0.0) as usize).min(grid.size[a] - 1)
        };
        let (from, to) = (
            [0, 1, 2].map(|a| near(a, 1.0 - REACH)),
            [0, 1, 2].map(|a| near(a, REACH)),
        );
        for z in from[2] / BLOCK..=to[2] / BLOCK {
            for y in from[1] / BLOCK..=to[1] / BLOCK {
                for x in from[0] / BLOCK..=to[0] / BLOCK {
                    let block = [x, y, z];
                    let new = || Box::new([[0.0; 2]; BLOCK * BLOCK * BLOCK]);
                    let sums = blocks.entry(block).or_insert_with(new);
                    let first = block.map(|b| b * BLOCK);
                    add_plane(plane, grid, first, [from, to], sums);
                }
            }
        }
    }
    for (block, sums) in blocks {
        for (i, [sum, weight]) in sums.into_iter().enumerate() {
            if f64::from(weight) < LEAST_WEIGHT {
                continue;
            }
            let at = [i % BLOCK, i / BLOCK % BLOCK, i / (BLOCK * BLOCK)];
            let index = grid.index([0, 1, 2].map(|a| block[a] * BLOCK + at[a]));
            let d = (f64::from(sum / weight)).clamp(-REACH, REACH) * grid.step;
            // Planes go on beyond the edges of what was seen; the unknown does not become air there.
            if d < 0.0 || free[index] || f64::from(weight) >= SURE_WEIGHT {
                values[index] = d as f32;
                is_measured[index] = true;
            }
        }
    }
    is_measured
}

/// Adds a plane to the sums of the vertices of a block that lie within two limits.
fn add_plane(
    plane: &PointPlane,
    grid: &ScanGrid,
    first: [usize; 3],
    [from, to]: [[usize; 3]; 2],
    sums: &mut BlockSums,
) {
    let range = |a: usize| from[a].max(first[a])..=to[a].min(first[a] + BLOCK - 1);
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                let d = (grid.point([x, y, z]) - plane.at) / grid.step;
                let near = 1.0 - d.length_squared() / (REACH * REACH);
                if near > 0.0 {
                    let weight = near.powi(4);
                    let [i, j, k] = [x - first[0], y - first[1], z - first[2]];
                    let sum = &mut sums[i + BLOCK * (j + BLOCK * k)];
                    sum[0] += (weight * plane.normal.dot(d)) as f32;
                    sum[1] += weight as f32;
                }
            }
        }
    }
}
