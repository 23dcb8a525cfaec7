//! Planes through the points of a voxel and of those around it.

use std::collections::BTreeMap;

use enfilade_geom::{DMat3, DVec3};

use super::cells::ScanGrid;
use super::{REACH, Scan};
use crate::qef::eigen;

/// Fewer points around a voxel are noise: mixed echoes at edges float in the air.
const LEAST_POINTS: f64 = 4.0;
/// Smallest sum of weights of planes at a vertex for their distance to count.
const LEAST_WEIGHT: f64 = 0.05;

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
    /// Index of the voxel.
    voxel: usize,
}

/// Returns a plane for each voxel with enough points.
pub(super) fn of_scan(scan: &Scan, grid: &ScanGrid) -> Vec<PointPlane> {
    let mut sums: BTreeMap<usize, Sums> = BTreeMap::new();
    for (p, s) in scan.points.iter().zip(&scan.station_of) {
        let at = grid.nearest(*p);
        let d = *p - grid.point(at);
        let sum = sums.entry(grid.index(at)).or_insert(Sums::ZERO);
        sum.n += 1.0;
        sum.p += d;
        sum.pp += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        sum.up += (scan.stations[usize::from(*s)] - *p).normalize_or_zero();
    }
    let mut found = Vec::new();
    for (&voxel, own) in &sums {
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
            voxel,
        });
    }
    found
}

/// Replaces the values near planes by the distance from them.
pub(super) fn blend(planes: &[PointPlane], grid: &ScanGrid, free: &[bool], values: &mut [f32]) {
    let reach = REACH as usize + 1;
    let mut sums: BTreeMap<usize, [f64; 2]> = BTreeMap::new();
    for plane in planes {
        let at = grid.at(plane.voxel);
        let from = at.map(|c| c.saturating_sub(reach));
        let to = [0, 1, 2].map(|a| (at[a] + reach).min(grid.size[a] - 1));
        for z in from[2]..=to[2] {
            for y in from[1]..=to[1] {
                for x in from[0]..=to[0] {
                    let d = (grid.point([x, y, z]) - plane.at) / grid.step;
                    let near = 1.0 - d.length_squared() / (REACH * REACH);
                    if near <= 0.0 {
                        continue;
                    }
                    let weight = near.powi(4);
                    let sum = sums.entry(grid.index([x, y, z])).or_insert([0.0; 2]);
                    sum[0] += weight * plane.normal.dot(d);
                    sum[1] += weight;
                }
            }
        }
    }
    for (i, [sum, weight]) in sums {
        if weight >= LEAST_WEIGHT {
            let d = (sum / weight).clamp(-REACH, REACH) * grid.step;
            // Beyond the edges of what was seen, planes go on; the unknown does not become air.
            if d < 0.0 || free[i] || weight >= 0.5 {
                values[i] = d as f32;
            }
        }
    }
}
