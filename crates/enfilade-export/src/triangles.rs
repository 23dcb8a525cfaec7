//! Triangles of polygons with holes, with every vertex of their loops: meshes of neighbors that share vertices are watertight.
//!
//! A constrained Delaunay triangulation in the plane (Chew 1989, by the crate `spade`); triangles are kept by the even-odd rule.
//! O(n log n) for n vertices, and O(n²) for the rule. Where it does not have all edges of the loops, because those cross, each loop is
//! a fan: its triangles may lie over one another, but meet those of its neighbors.

use std::collections::{BTreeMap, HashMap};

use enfilade_geom::{DVec2, DVec3, Plane};
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation as _};

struct Corner {
    at: Point2<f64>,
    number: usize,
}

impl HasPosition for Corner {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.at
    }
}

/// Returns the triangles of a polygon as numbers of its vertices, loop after loop, counter-clockwise about the normal.
///
/// The edges that they do not share are those of the loops.
pub(crate) fn triangulated(loops: &[Vec<[f64; 3]>], normal: [f64; 3]) -> Vec<[usize; 3]> {
    let triangles = constrained(loops, normal);
    if has_edges_of(loops, &triangles) {
        return triangles;
    }
    let mut fans = Vec::new();
    let mut first = 0;
    for ring in loops {
        fans.extend((1..ring.len().saturating_sub(1)).map(|i| [first, first + i, first + i + 1]));
        first += ring.len();
    }
    fans
}

/// Returns `true` if the edges of triangles cancel, but for those of the loops.
fn has_edges_of(loops: &[Vec<[f64; 3]>], triangles: &[[usize; 3]]) -> bool {
    let mut known: HashMap<[u64; 3], usize> = HashMap::new();
    let mut ids = Vec::new();
    for p in loops.iter().flatten() {
        let next = known.len();
        ids.push(*known.entry(p.map(f64::to_bits)).or_insert(next));
    }
    let mut counts: BTreeMap<[usize; 2], i32> = BTreeMap::new();
    let mut count = |a: usize, b: usize, sign: i32| {
        let [a, b] = [ids[a], ids[b]];
        let sign = if a < b { sign } else { -sign };
        *counts.entry([a.min(b), a.max(b)]).or_default() += sign;
    };
    for [a, b, c] in triangles {
        count(*a, *b, 1);
        count(*b, *c, 1);
        count(*c, *a, 1);
    }
    let mut first = 0;
    for ring in loops {
        for i in 0..ring.len() {
            count(first + i, first + (i + 1) % ring.len(), -1);
        }
        first += ring.len();
    }
    counts.values().all(|&n| n == 0)
}

fn constrained(loops: &[Vec<[f64; 3]>], normal: [f64; 3]) -> Vec<[usize; 3]> {
    let Some(origin) = loops.first().and_then(|l| l.first()) else {
        return Vec::new();
    };
    let origin = DVec3::from(*origin);
    let (u, v) = Plane::through(origin, DVec3::from(normal)).basis();
    // The triangulation takes no numbers that are nearly zero.
    let sound = |x: f64| if x.abs() < 1e-12 { 0.0 } else { x };
    let flat = |p: &[f64; 3]| {
        let d = DVec3::from(*p) - origin;
        DVec2::new(sound(d.dot(u)), sound(d.dot(v)))
    };
    let rings: Vec<Vec<DVec2>> = loops.iter().map(|l| l.iter().map(flat).collect()).collect();
    let mut mesh = ConstrainedDelaunayTriangulation::<Corner>::new();
    let mut number = 0;
    for ring in &rings {
        let mut handles = Vec::with_capacity(ring.len());
        for p in ring {
            let at = Point2::new(p.x, p.y);
            let known = match mesh.locate(at) {
                spade::PositionInTriangulation::OnVertex(handle) => Some(handle),
                _ => None,
            };
            // A vertex that two loops share keeps its first number.
            match known.map_or_else(|| mesh.insert(Corner { at, number }), Ok) {
                Ok(handle) => handles.push(handle),
                Err(_) => return Vec::new(),
            }
            number += 1;
        }
        for (i, &a) in handles.iter().enumerate() {
            let b = handles[(i + 1) % handles.len()];
            if a != b && mesh.can_add_constraint(a, b) {
                mesh.add_constraint(a, b);
            }
        }
    }
    let faces = mesh.inner_faces().map(|f| f.vertices());
    let inside = faces.filter(|corners| {
        let at = corners.map(|c| DVec2::new(c.position().x, c.position().y));
        is_inside(&rings, (at[0] + at[1] + at[2]) / 3.0)
    });
    inside
        .map(|corners| corners.map(|c| c.data().number))
        .collect()
}

fn is_inside(rings: &[Vec<DVec2>], p: DVec2) -> bool {
    let mut is_in = false;
    for ring in rings {
        for (i, &a) in ring.iter().enumerate() {
            let (a, b) = (a - p, ring[(i + 1) % ring.len()] - p);
            if (a.y > 0.0) != (b.y > 0.0) && a.x + (b.x - a.x) * (a.y / (a.y - b.y)) > 0.0 {
                is_in = !is_in;
            }
        }
    }
    is_in
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(half: f64) -> Vec<[f64; 3]> {
        vec![
            [-half, -half, 0.0],
            [half, -half, 0.0],
            [half, half, 0.0],
            [-half, half, 0.0],
        ]
    }

    #[test]
    fn a_square_with_a_hole_keeps_its_area_and_all_vertices() {
        let mut hole = square(1.0);
        hole.reverse();
        let mut outer = square(2.0);
        outer.insert(1, [0.5, -2.0, 0.0]); // in the middle of an edge
        let loops = [outer, hole];
        let points: Vec<DVec3> = loops.iter().flatten().map(|&p| DVec3::from(p)).collect();
        let triangles = triangulated(&loops, [0.0, 0.0, 1.0]);
        let area = |t: &[usize; 3]| {
            let [a, b, c] = t.map(|i| points[i]);
            0.5 * (b - a).cross(c - a).z
        };
        assert!(triangles.iter().all(|t| area(t) > 0.0));
        let sum: f64 = triangles.iter().map(area).sum();
        assert!((sum - 12.0).abs() < 1e-12, "{sum}");
        assert!((0..9).all(|i| triangles.iter().flatten().any(|&v| v == i)));
    }
}
