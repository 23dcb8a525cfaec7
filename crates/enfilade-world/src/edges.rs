//! Edges of walls that shortest ways bend about: where the air of a cell takes more than half of what is around them.
//!
//! A shortest way among walls bends only at such edges (Sharir & Schorr, "On shortest paths in polyhedral spaces", 1986). They are
//! found by asking the locator on a small circle about each edge, not by the mesh: whatever its triangles, an edge within a flat
//! wall has as much air as matter around it, and one that points into the air more. Edges in one line are joined before. O(edges ·
//! points along them). What is rounder than a step of the circle, 11°, from triangle to triangle is taken for flat.

use std::collections::BTreeMap;

use enfilade_cpg::CellId;
use enfilade_geom::{DVec3, Triangle};

use crate::layout::Layout;

/// An edge, and a point of it just off the wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Where ways may bend. [Units: wu]
    pub at: DVec3,
    /// Both ends of the edge that they may slide along. [Units: wu]
    pub edge: [DVec3; 2],
}

/// Radius of the circle. [Units: wu] Thinner than walls, wider than what rounding leaves open.
const AROUND: f64 = 0.02;
/// Points of the circle.
const N_AROUND: usize = 32;
/// Lines this near to each other are one. [Units: wu]
const SAME_LINE: f64 = 1e-3;

/// The corners of a cell with these walls: points at most `spacing` from each other along the edges, `off` from the wall. [Units: wu]
pub(crate) fn corners(
    layout: &Layout,
    cell: CellId,
    walls: &[Triangle],
    spacing: f64,
    off: f64,
) -> Vec<Corner> {
    let mut found = Vec::new();
    for (from, to, flat) in lines(walls) {
        let n = (from.distance(to) / spacing).ceil().clamp(1.0, 1e4) as usize;
        let at = |k: f64| from.lerp(to, k / n as f64);
        let away: Vec<DVec3> = (0..n)
            .map(|k| into_air(layout, cell, at(k as f64 + 0.5), to - from, flat))
            .collect();
        // Runs along which the edge points into the air.
        let mut k = 0;
        while k < n {
            let first = k;
            while k < n && away[k] != DVec3::ZERO {
                k += 1;
            }
            let shift = away.get(first).copied().unwrap_or_default() * off;
            let inset = (to - from).normalize_or_zero() * off;
            let edge = [
                at(first as f64) + shift + inset,
                at(k as f64) + shift - inset,
            ];
            found.extend((first..k).map(|k| Corner {
                at: at(k as f64 + 0.5) + shift,
                edge,
            }));
            k += 1;
        }
    }
    found
}

/// Which way the air is about an edge that points into it; zero for an edge that does not. `flat` lies along a wall at the edge.
fn into_air(layout: &Layout, cell: CellId, p: DVec3, along: DVec3, flat: DVec3) -> DVec3 {
    let u = flat.normalize_or_zero();
    let v = along.normalize_or_zero().cross(u);
    let (mut n, mut sum) = (0, DVec3::ZERO);
    for k in 0..N_AROUND {
        // Never along the wall itself.
        let angle = (k as f64 + 0.5) * std::f64::consts::TAU / N_AROUND as f64;
        let d = u * angle.cos() + v * angle.sin();
        if layout.locate(p + d * AROUND) == Some(cell) {
            n += 1;
            sum += d;
        }
    }
    // About the edge of a sheet without thickness there is air all around: away from the sheet.
    match n {
        0..=16 => DVec3::ZERO,
        N_AROUND => -u,
        _ => sum.normalize_or(-u),
    }
}

/// The edges of triangles, those in one line that touch joined: both ends, and a direction into a triangle at it.
fn lines(walls: &[Triangle]) -> Vec<(DVec3, DVec3, DVec3)> {
    type Key = [i64; 6];
    /// From and to along the line.
    type Stretch = (f64, f64);
    let mut by_line: BTreeMap<Key, (DVec3, DVec3, DVec3, Vec<Stretch>)> = BTreeMap::new();
    for t in walls {
        for i in 0..3 {
            let [a, b, c] = [t[i], t[(i + 1) % 3], t[(i + 2) % 3]];
            let mut d = (b - a).normalize_or_zero();
            // One of both directions, whichever way the triangle runs.
            if [d.x, d.y, d.z]
                .into_iter()
                .find(|x| x.abs() > SAME_LINE)
                .is_none_or(|x| x < 0.0)
            {
                d = -d;
            }
            let foot = a - d * a.dot(d);
            let inner = c - a - d * (c - a).dot(d);
            if d == DVec3::ZERO || inner.length() < SAME_LINE {
                continue;
            }
            let rounded = |p: DVec3| p.to_array().map(|x| (x / SAME_LINE).round() as i64);
            let ([x, y, z], [u, v, w]) = (rounded(d), rounded(foot));
            let line = by_line
                .entry([x, y, z, u, v, w])
                .or_insert((d, foot, inner, Vec::new()));
            let (s, t) = (a.dot(line.0), b.dot(line.0));
            line.3.push((s.min(t), s.max(t)));
        }
    }
    let mut lines = Vec::new();
    for (d, foot, inner, mut stretches) in by_line.into_values() {
        stretches.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut joined: Vec<Stretch> = Vec::new();
        for (from, to) in stretches {
            match joined.last_mut().filter(|j| from <= j.1 + SAME_LINE) {
                Some(last) => last.1 = last.1.max(to),
                None => joined.push((from, to)),
            }
        }
        lines.extend(
            joined
                .into_iter()
                .map(|(s, t)| (foot + d * s, foot + d * t, inner)),
        );
    }
    lines
}
