//! Heights at which storeys end: the middles of slabs.
//!
//! A slab shows as two large level surfaces close above each other. Builders keep storeys separate there.
//!
//! Cost: linear in triangles.

use enfilade_geom::{Attitude, DVec3, Triangle, triangle_area_normal};

/// Least share of the scene's plan that the surfaces of a level cover.
const MIN_SHARE: f64 = 0.08;
/// Largest distance between the two faces of one slab. [Units: wu]
const MAX_SLAB: f64 = 0.5;

/// Least vertical part of the unit normal of an opening in a slab: within 26 degrees of level, as the faces of voxels show it.
/// Higher, and rooms join through holes in slabs (the dungeon kit's); lower, and flights of stairs count as holes (duplex).
const LEVEL: f64 = 0.9;
/// An opening nearer than this to the middle of a slab lies in it. [Units: wu]
const NEAR: f64 = 0.2;

/// Returns `true` if an opening with this normal at this height lies in one of the `slabs`.
pub(crate) fn lies_in_slab(normal: DVec3, height: f64, slabs: &[f64]) -> bool {
    normal.y.abs() > LEVEL && slabs.iter().any(|h| (h - height).abs() < NEAR)
}

/// Returns the heights (+Y) of the middles of slabs, ascending. [Units: wu]
#[must_use]
pub(crate) fn slab_heights(triangles: &[Triangle]) -> Vec<f64> {
    let mut levels: Vec<(f64, f64)> = Vec::new(); // height, area
    let (mut lo, mut hi) = ([f64::MAX; 2], [f64::MIN; 2]);
    for t in triangles {
        for p in t {
            for (k, v) in [p.x, p.z].into_iter().enumerate() {
                lo[k] = lo[k].min(v);
                hi[k] = hi[k].max(v);
            }
        }
        let n = triangle_area_normal(t);
        if Attitude::of(n) == Attitude::Level {
            levels.push(((t[0].y + t[1].y + t[2].y) / 3.0, n.y.abs() * 0.5));
        }
    }
    let plan = (hi[0] - lo[0]).max(0.0) * (hi[1] - lo[1]).max(0.0);
    levels.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    // Surfaces within 3 cm are one level.
    let mut merged: Vec<(f64, f64)> = Vec::new();
    for (y, area) in levels {
        match merged.last_mut() {
            Some(last) if y - last.0 < 0.03 => last.1 += area,
            _ => merged.push((y, area)),
        }
    }
    merged.retain(|l| l.1 >= MIN_SHARE * plan);
    // The largest level first: it and the largest other one close by are the two faces of a slab.
    // Sills, lintels, treads and finishes next to them are not slabs of their own.
    merged.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.total_cmp(&b.0)));
    let mut heights = Vec::new();
    while let Some(&(y, _)) = merged.first() {
        let other = merged[1..].iter().find(|l| (l.0 - y).abs() < MAX_SLAB);
        let (lo, hi) = other.map_or((y, y), |l| (y.min(l.0), y.max(l.0)));
        heights.push((lo + hi) * 0.5);
        merged.retain(|l| l.0 < lo - MAX_SLAB || l.0 > hi + MAX_SLAB);
    }
    heights.sort_by(f64::total_cmp);
    heights
}
