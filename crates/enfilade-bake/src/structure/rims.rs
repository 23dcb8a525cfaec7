//! Rims: where surfaces end, and the triangles that are missing in them.
//!
//! In a closed surface, triangles traverse every edge as often in one direction as in the other. A surface ends at
//! edges where that fails: at the mouth of a tube, around a sheet, and where an exporter or a hole in a scan left out a
//! triangle. Three such edges around a triangle show that it is missing. The hole is not a doorway, however large: half
//! a floor may be missing, and the hollow of the slab below then joins all rooms that stand on it. So the search for
//! rooms treats it as shut; since it is an opening all the same, it becomes a candidate portal.
//!
//! Needs triangles that share vertices to the bit: if all vertices have moved, all edges are rims, and no three meet.
//!
//! Cost: a sort of the edges, `O(n log n)` in triangles.

use enfilade_geom::{DVec3, Triangle, triangle_area_normal};
use rayon::prelude::*;

/// If more rims than this begin at one vertex, sheets end there, and no triangle is missing. It bounds the search.
const MAX_RIMS: usize = 16;

/// A vertex of a rim, and the opposite vertex of the triangle at the edge that leaves it.
pub(crate) type RimVertex = (DVec3, DVec3);

/// Edges that triangles use once more in one direction than in the other, in the direction of the surplus triangle.
#[derive(Default)]
pub(crate) struct Rims {
    points: Vec<DVec3>,
    /// From, to, opposite vertex; ascending by `from`.
    edges: Vec<[u32; 3]>,
}

impl Rims {
    /// Finds the rims of triangles that share vertices to the bit.
    pub(crate) fn of(triangles: &[Triangle]) -> Self {
        let key = |p: &DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
        let mut points: Vec<DVec3> = triangles.iter().flatten().copied().collect();
        points.par_sort_by_cached_key(key);
        points.dedup();
        points.shrink_to_fit();
        let keys: Vec<[u64; 3]> = points.iter().map(key).collect();
        let index = |p: &DVec3| keys.partition_point(|k| *k < key(p)) as u32;
        let mut edges: Vec<[u32; 3]> = triangles
            .par_iter()
            .flat_map_iter(|t| {
                let v = [0, 1, 2].map(|k| index(&t[k]));
                [[v[0], v[1], v[2]], [v[1], v[2], v[0]], [v[2], v[0], v[1]]]
            })
            .collect();
        let ends = |e: &[u32; 3]| (e[0].min(e[1]), e[0].max(e[1]));
        edges.par_sort_unstable_by_key(|e| (ends(e), *e));
        let mut single: Vec<[u32; 3]> = edges
            .chunk_by(|a, b| ends(a) == ends(b))
            .filter_map(odd_one)
            .collect();
        single.sort_unstable();
        Self {
            points,
            edges: single,
        }
    }

    /// Returns the missing triangles of at least `min_area` wu²: three rims in a ring, each an edge of another
    /// triangle. Independent of the order of the input.
    pub(crate) fn missing_triangles(&self, min_area: f64) -> Vec<Triangle> {
        let from = |v: u32| {
            let at = self.edges.partition_point(|e| e[0] < v);
            let n = self.edges[at..].partition_point(|e| e[0] == v);
            let n = if n > MAX_RIMS { 0 } else { n };
            self.edges[at..at + n].iter()
        };
        let mut out = Vec::new();
        for &[a, b, apex] in &self.edges {
            // Each is found once, from its least vertex. The rims of an isolated triangle are its own edges: there the
            // opposite vertex of each is the third vertex.
            for &[_, c, next_apex] in from(b).filter(|e| a < b && a < e[1]) {
                let is_last = |e: &[u32; 3]| e[1] == a && e[2] != b;
                let triangle = [a, b, c].map(|v| self.points[v as usize]);
                let is_large = triangle_area_normal(&triangle).length() >= 2.0 * min_area;
                if is_large && apex != c && next_apex != a && from(c).any(is_last) {
                    out.push(triangle);
                }
            }
        }
        out
    }

    /// Returns closed loops in which every vertex has one edge in and one out.
    pub(crate) fn loops(&self) -> Vec<Vec<RimVertex>> {
        let next = |v: u32| -> Option<usize> {
            let at = self.edges.partition_point(|e| e[0] < v);
            let is_only = self.edges.get(at).is_some_and(|e| e[0] == v)
                && self.edges.get(at + 1).is_none_or(|e| e[0] != v);
            is_only.then_some(at)
        };
        let mut seen = vec![false; self.edges.len()];
        let mut out = Vec::new();
        for start in 0..self.edges.len() {
            let mut rim = Vec::new();
            let mut at = Some(start);
            while let Some(i) = at.filter(|&i| !seen[i]) {
                seen[i] = true;
                let [from, to, apex] = self.edges[i];
                rim.push((self.points[from as usize], self.points[apex as usize]));
                at = next(to);
            }
            if at == Some(start) && rim.len() >= 3 && next(self.edges[start][0]) == Some(start) {
                out.push(rim);
            }
        }
        out
    }
}

/// Returns the unmatched edge if one direction has exactly one more.
fn odd_one(run: &[[u32; 3]]) -> Option<[u32; 3]> {
    let (up, down): (Vec<[u32; 3]>, Vec<[u32; 3]>) = run.iter().partition(|e| e[0] < e[1]);
    match up.len() as i64 - down.len() as i64 {
        1 => Some(up[0]),
        -1 => Some(down[0]),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::Aabb;

    fn missing_triangles(triangles: &[Triangle]) -> Vec<Triangle> {
        Rims::of(triangles).missing_triangles(0.3)
    }

    fn block(lo: f64, hi: f64) -> Vec<Triangle> {
        Aabb::new(DVec3::splat(lo), DVec3::splat(hi)).triangles()
    }

    fn sorted(t: &Triangle) -> Vec<[u64; 3]> {
        let mut corners = t.map(|p| p.to_array().map(f64::to_bits)).to_vec();
        corners.sort_unstable();
        corners
    }

    #[test]
    fn any_triangle_that_is_missing_is_found() {
        let whole = block(0.0, 3.0);
        assert!(missing_triangles(&whole).is_empty());
        for i in 0..whole.len() {
            let mut t = whole.clone();
            let missing = t.remove(i);
            let found = missing_triangles(&t);
            assert_eq!(found.len(), 1);
            assert_eq!(sorted(&found[0]), sorted(&missing));
            assert!(Rims::of(&t).missing_triangles(5.0).is_empty());
            t.reverse();
            assert_eq!(missing_triangles(&t), found);
        }
    }

    #[test]
    fn missing_triangles_are_found_where_solids_share_edges() {
        // Two blocks that touch along an edge.
        let shift = |t: Triangle, by: DVec3| t.map(|p| p + by);
        let one = block(0.0, 1.0);
        let place = [DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0)];
        let all: Vec<Triangle> = place
            .iter()
            .flat_map(|&by| one.iter().map(move |&t| shift(t, by)))
            .collect();
        for i in 0..all.len() {
            let mut t = all.clone();
            let missing = t.remove(i);
            let found = missing_triangles(&t);
            assert!(
                found.iter().any(|f| sorted(f) == sorted(&missing)),
                "{i}: {missing:?}"
            );
        }
    }

    #[test]
    fn where_too_many_sheets_end_none_is_told_to_be_missing() {
        let corner = DVec3::splat(3.0);
        let mut t = block(0.0, 3.0);
        let at = t.iter().position(|t| t.contains(&corner)).unwrap();
        t.remove(at);
        for (n_sheets, n_missing) in [(MAX_RIMS - 2, 1), (MAX_RIMS, 0)] {
            let tip = |i: usize, k: f64| corner + DVec3::new(i as f64 + 1.0, k, 1.0);
            let sheets = (0..n_sheets).map(|i| [corner, tip(i, 0.0), tip(i, 1.0)]);
            let all: Vec<Triangle> = t.iter().copied().chain(sheets).collect();
            assert_eq!(missing_triangles(&all).len(), n_missing, "{n_sheets}");
        }
    }

    #[test]
    fn what_ends_is_not_missing() {
        let alone = block(0.0, 3.0)[0];
        assert!(missing_triangles(&[alone]).is_empty());
        // No two triangles share a vertex.
        let apart: Vec<Triangle> = block(0.0, 3.0)
            .into_iter()
            .enumerate()
            .map(|(i, t)| t.map(|p| p + DVec3::splat(i as f64 * 1e-6)))
            .collect();
        assert!(missing_triangles(&apart).is_empty());
    }
}
