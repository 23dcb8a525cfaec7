//! T-junctions: ends of open edges in the middle of other open edges.
//!
//! A crack in a surface leaves every edge on its rim with one triangle only. So both the edges and the points to
//! examine are those of open edges, and a closed mesh costs nothing.

use enfilade_geom::DVec3;
use std::collections::{HashMap, HashSet};

/// Most lookups of a grid cell or a point; beyond it, the answer is a lower bound.
///
/// About two seconds. A scene of a million open edges, evenly spread, needs a tenth of that.
const BUDGET: u64 = 100_000_000;

pub(crate) struct Found {
    pub(crate) n: u64,
    /// Numbers of the first points.
    pub(crate) examples: Vec<u32>,
    pub(crate) is_complete: bool,
}

/// Counts points that lie within `distance` of the inside of an edge they do not end; returns up to `n_examples`.
pub(crate) fn find(points: &[DVec3], open: &[[u32; 2]], distance: f64, n_examples: usize) -> Found {
    let mut found = Found {
        n: 0,
        examples: Vec::new(),
        is_complete: true,
    };
    let mut counted: HashSet<u32> = HashSet::new();
    found.is_complete = for_each(points, open, distance, |_, i, _| {
        if counted.insert(i) {
            found.n += 1;
            if found.examples.len() < n_examples {
                found.examples.push(i);
            }
        }
    });
    found
}

/// Visits each pair of an edge and a point within `distance` of its inside: the edge's index in `open`, the point and
/// its parameter along the edge. `false` if the search was stopped before its end.
pub(crate) fn for_each(
    points: &[DVec3],
    open: &[[u32; 2]],
    distance: f64,
    mut visit: impl FnMut(usize, u32, f64),
) -> bool {
    let mut ends: Vec<u32> = open.iter().flatten().copied().collect();
    ends.sort_unstable();
    ends.dedup();
    let lengths = || {
        open.iter()
            .map(|e| points[e[0] as usize].distance(points[e[1] as usize]))
    };
    let longest = lengths().fold(0.0, f64::max);
    if ends.is_empty() || longest <= 0.0 {
        return true;
    }
    // As wide as a typical edge, so that an edge meets few cells; wider where a very long edge would meet too many.
    let mean = lengths().sum::<f64>() / open.len() as f64;
    let width = mean.max(longest / 4096.0).max(4.0 * distance);
    let cell = |p: DVec3| (p / width).floor().to_array().map(|c| c as i64);
    let mut grid: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    for &i in &ends {
        grid.entry(cell(points[i as usize])).or_default().push(i);
    }
    let mut budget = BUDGET;
    for (edge, &[a, b]) in open.iter().enumerate() {
        let (from, to) = (points[a as usize], points[b as usize]);
        let along = to - from;
        let length = along.length();
        let direction = along / length;
        walk(from, to, distance, width, |key| {
            budget = budget.saturating_sub(1);
            for &i in grid.get(&key).map_or(&[][..], Vec::as_slice) {
                if budget == 0 {
                    return;
                }
                budget -= 1;
                let to_point = points[i as usize] - from;
                let t = to_point.dot(direction);
                let is_inside = t > distance && t < length - distance;
                let off = (to_point - direction * t).length_squared();
                if i != a && i != b && is_inside && off <= distance * distance {
                    visit(edge, i, t);
                }
            }
        });
        if budget == 0 {
            return false;
        }
    }
    true
}

/// Visits every grid cell within `distance` of the segment once, and a few around it.
fn walk(from: DVec3, to: DVec3, distance: f64, width: f64, mut visit: impl FnMut([i64; 3])) {
    let along = to - from;
    let size = along.abs();
    let major = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    let (u, v) = ((major + 1) % 3, (major + 2) % 3);
    let number = |c: f64| (c / width).floor() as i64;
    let low = from[major].min(to[major]) - distance;
    let high = from[major].max(to[major]) + distance;
    for slab in number(low)..=number(high) {
        // The part of the segment with its major coordinate in the slab, extended by the distance.
        let at = |c: f64| ((c - from[major]) / along[major]).clamp(0.0, 1.0);
        let start = at(slab as f64 * width - distance);
        let end = at((slab + 1) as f64 * width + distance);
        let (p, q) = (from + along * start, from + along * end);
        for i in number(p[u].min(q[u]) - distance)..=number(p[u].max(q[u]) + distance) {
            for j in number(p[v].min(q[v]) - distance)..=number(p[v].max(q[v]) + distance) {
                let mut key = [0; 3];
                (key[major], key[u], key[v]) = (slab, i, j);
                visit(key);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Every point against every edge.
    fn brute_force(points: &[DVec3], open: &[[u32; 2]], distance: f64) -> u64 {
        let is_end = |i: usize| open.iter().flatten().any(|&e| e as usize == i);
        let hits = |p: DVec3, i: usize| {
            open.iter().any(|&[a, b]| {
                let (from, to) = (points[a as usize], points[b as usize]);
                let d = (to - from).normalize();
                let (t, length) = ((p - from).dot(d), (to - from).length());
                i != a as usize
                    && i != b as usize
                    && t > distance
                    && t < length - distance
                    && p.distance_squared(from + d * t) <= distance * distance
            })
        };
        (0..points.len())
            .filter(|&i| is_end(i) && hits(points[i], i))
            .count() as u64
    }

    proptest! {
        #[test]
        fn the_grid_finds_what_brute_force_finds(
            // On a coarse lattice, so that some points lie on edges.
            coordinates in prop::collection::vec(prop::array::uniform3(-4i32..4), 4..60),
            scale in 0.01f64..100.0,
        ) {
            let mut unique = coordinates;
            unique.sort_unstable();
            unique.dedup();
            let points: Vec<DVec3> = unique
                .iter()
                .map(|c| DVec3::from_array(c.map(f64::from)) * scale)
                .collect();
            let n = points.len() as u32;
            let open: Vec<[u32; 2]> = (1..n).map(|i| [i / 2, i]).collect();
            // Differs from all distances in the lattice.
            let distance = 1e-4 * scale;
            let found = find(&points, &open, distance, 5);
            prop_assert!(found.is_complete);
            prop_assert_eq!(found.n, brute_force(&points, &open, distance));
        }
    }
}
