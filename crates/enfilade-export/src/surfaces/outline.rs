//! Vertices that no polygon of a room needs: in the middle of straight edges of all that touch them.

use std::collections::BTreeMap;

use enfilade_geom::DVec3;

use super::merge::Rings;

/// Farthest distance of a vertex from the straight edge that takes its place. [Units: wu]
const STRAIGHT: f64 = 2e-4;

/// Drops vertices in the middle of straight edges, the same ones from all polygons, so that neighbors still share all edges.
///
/// O(n log n) for n vertices of all loops.
pub(crate) fn straightened(points: &[DVec3], polygons: &mut [Rings]) {
    let mut places: BTreeMap<u32, Vec<[usize; 2]>> = BTreeMap::new();
    for (i, rings) in polygons.iter().enumerate() {
        for (k, ring) in rings.iter().enumerate() {
            for &v in ring {
                places.entry(v).or_default().push([i, k]);
            }
        }
    }
    for (v, at) in places {
        let is_straight = |&[i, k]: &[usize; 2]| is_between(points, &polygons[i][k], v);
        if at.iter().all(is_straight) {
            for [i, k] in at {
                polygons[i][k].retain(|&w| w != v);
            }
        }
    }
}

/// Returns `true` if a vertex lies on the straight line between its neighbors in a loop, and leaves a polygon.
fn is_between(points: &[DVec3], ring: &[u32], v: u32) -> bool {
    let n = ring.len();
    let mut found = (0..n).filter(|&i| ring[i] == v);
    let (Some(i), None) = (found.next(), found.next()) else {
        return false;
    };
    if n < 4 {
        return false;
    }
    let [a, b] = [ring[(i + n - 1) % n], ring[(i + 1) % n]].map(|w| points[w as usize]);
    let p = points[v as usize];
    let along = b - a;
    let t = (p - a).dot(along) / along.length_squared();
    t > 0.0 && t < 1.0 && (a + along * t).distance(p) <= STRAIGHT
}
