//! Edges of walls about which shortest paths bend: more than half of their surroundings is air of the cell.
//!
//! A shortest path among walls bends only at such edges (Sharir & Schorr, "On shortest paths in polyhedral spaces", 1986). They
//! are found by querying the locator on a small circle about each edge, not from the mesh: whatever its triangles, an edge
//! within a flat wall has as much air as solid around it, and a convex one has more air. Collinear edges are joined before.
//! O(edges · points along them). A surface that turns by less than a step of the circle, 11°, from triangle to triangle counts
//! as flat.

use std::collections::BTreeMap;

use enfilade_cpg::CellId;
use enfilade_geom::{DVec3, Triangle};

use crate::layout::Layout;

/// A convex edge, and a point of it just off the wall.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Corner {
    /// Point at which paths may bend. [Units: wu]
    pub at: DVec3,
    /// Ends of the edge along which the point may slide. [Units: wu]
    pub edge: [DVec3; 2],
}

/// Radius of the circle: less than the thickness of walls, more than gaps by rounding. [Units: wu]
const AROUND: f64 = 0.02;
/// Number of points on the circle.
const N_AROUND: usize = 32;
/// Lines nearer to each other than this are one. [Units: wu]
const SAME_LINE: f64 = 1e-3;

/// Returns the [`Corner`]s of a cell with these walls: points at most `spacing` apart along the edges, `off` from the wall.
/// [Units: wu]
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
        // Runs along which the edge is convex.
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

/// Returns the direction into the air at a convex edge; zero for other edges. `flat` lies along a wall at the edge.
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
    // The edge of a sheet without thickness has air all around: go away from the sheet.
    match n {
        0..=16 => DVec3::ZERO,
        N_AROUND => -u,
        _ => sum.normalize_or(-u),
    }
}

/// Returns the edges of triangles, joined where they are collinear and touch: both ends, and a direction into a triangle there.
fn lines(walls: &[Triangle]) -> Vec<(DVec3, DVec3, DVec3)> {
    type Key = [i64; 6];
    /// Start and end along the line.
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
