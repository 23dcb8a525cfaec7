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
        let between: Option<Vec<[u32; 2]>> = (at.iter())
            .map(|&[i, k]| ends_around(points, &polygons[i][k], v))
            .collect();
        if between.is_some_and(|edges| cancel(&edges)) {
            for [i, k] in at {
                polygons[i][k].retain(|&w| w != v);
            }
        }
    }
}

/// Returns `true` if each edge has its opposite. Where more than two polygons meet in a line, the new edges of some could end
/// elsewhere than those of the others.
fn cancel(edges: &[[u32; 2]]) -> bool {
    let mut sums: BTreeMap<[u32; 2], i32> = BTreeMap::new();
    for &[a, b] in edges {
        *sums.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
    }
    sums.values().all(|&n| n == 0)
}

/// Returns the neighbors of a vertex in a loop, if it lies on the straight line between them, and leaves a polygon.
fn ends_around(points: &[DVec3], ring: &[u32], v: u32) -> Option<[u32; 2]> {
    let n = ring.len();
    let mut found = (0..n).filter(|&i| ring[i] == v);
    let (Some(i), None) = (found.next(), found.next()) else {
        return None;
    };
    if n < 4 {
        return None;
    }
    let ends = [ring[(i + n - 1) % n], ring[(i + 1) % n]];
    let [a, b] = ends.map(|w| points[w as usize]);
    let p = points[v as usize];
    let along = b - a;
    let t = (p - a).dot(along) / along.length_squared();
    let is_between = t > 0.0 && t < 1.0 && (a + along * t).distance(p) <= STRAIGHT;
    is_between.then_some(ends)
}

#[cfg(test)]
mod tests {
    use enfilade_geom::DVec3;

    use super::straightened;
    use crate::surfaces::merge::{Rings, open_edges};

    /// Returns the open edges before and after straightening, and the number of vertices of the first polygon.
    fn straighten(points: &[DVec3], mut polygons: Vec<Rings>) -> ([usize; 2], usize) {
        let n_open = |all: &[Rings]| open_edges(all.iter().flatten().map(Vec::as_slice)).len();
        let before = n_open(&polygons);
        straightened(points, &mut polygons);
        ([before, n_open(&polygons)], polygons[0][0].len())
    }

    #[test]
    fn vertices_that_no_polygon_needs_vanish_only_where_new_edges_meet() {
        // Vertices 0 to 4 on a line; the others beside it.
        let on = (0..5).map(|x| DVec3::new(f64::from(x), 0.0, 0.0));
        let beside = (0..4).map(|z| DVec3::new(2.0, 1.0, f64::from(z)));
        let points: Vec<DVec3> = on.chain(beside).collect();
        // Two polygons share an edge through vertex 2.
        let two = vec![vec![vec![1, 2, 3, 5]], vec![vec![3, 2, 1, 6]]];
        assert_eq!(straighten(&points, two), ([4, 4], 3));
        // Four share edges to vertex 2, but none has the same two.
        let four = vec![
            vec![vec![1, 2, 3, 5]],
            vec![vec![4, 2, 1, 6]],
            vec![vec![3, 2, 0, 7]],
            vec![vec![0, 2, 4, 8]],
        ];
        assert_eq!(straighten(&points, four), ([8, 8], 4));
    }
}
