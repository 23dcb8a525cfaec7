//! Surfaces of air seen from inside, as shared vertices and triangles.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use enfilade_geom::DVec3;
use enfilade_geom::scene::{Mesh, Primitive};

use crate::solid::{newell, triangulate};

/// A triangle mesh with shared vertices.
#[derive(Clone, Debug, Default)]
pub struct Interior {
    /// Vertices. [Units: wu]
    pub corners: Vec<DVec3>,
    /// Triples of vertices.
    pub triangles: Vec<[u32; 3]>,
}

impl Interior {
    /// Adds a vertex and returns its index.
    pub fn corner(&mut self, p: DVec3) -> u32 {
        self.corners.push(p);
        self.corners.len() as u32 - 1
    }

    /// Adds a quadrangle as two triangles, split from its first vertex.
    pub fn quad(&mut self, q: [u32; 4]) {
        self.triangles
            .extend([[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
    }

    /// Adds a simple polygon.
    pub fn polygon(&mut self, corners: &[u32]) {
        let at: Vec<DVec3> = corners.iter().map(|&i| self.corners[i as usize]).collect();
        self.triangles
            .extend(triangulate(&at).iter().map(|t| t.map(|i| corners[i])));
    }

    /// Splits the longest edge in the middle until there are `n` triangles.
    ///
    /// Each split adds a vertex and two triangles, so the mesh must be closed, without T-junctions, and `n`
    /// even like the number of its triangles. O(n log n).
    pub fn bisect_to(&mut self, n: usize) {
        let mut owner: HashMap<(u32, u32), usize> = HashMap::new();
        let mut longest = BinaryHeap::new();
        let corners = &mut self.corners;
        // Bits of positive numbers compare as the numbers do; ties go to the older vertices.
        let entry = |corners: &[DVec3], a: u32, b: u32| {
            let length = corners[a as usize].distance_squared(corners[b as usize]);
            (length.to_bits(), Reverse(a.min(b)), Reverse(a.max(b)))
        };
        for (i, t) in self.triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                owner.insert((a, b), i);
                if a < b {
                    longest.push(entry(corners, a, b));
                }
            }
        }
        while self.triangles.len() < n {
            let Some((_, Reverse(a), Reverse(b))) = longest.pop() else {
                return;
            };
            let (Some(&left), Some(&right)) = (owner.get(&(a, b)), owner.get(&(b, a))) else {
                continue;
            };
            corners.push(corners[a as usize].midpoint(corners[b as usize]));
            let middle = corners.len() as u32 - 1;
            for (triangle, from, to) in [(left, a, b), (right, b, a)] {
                let t = self.triangles[triangle];
                let apex = t
                    .into_iter()
                    .find(|&c| c != from && c != to)
                    .unwrap_or(from);
                let added = self.triangles.len();
                self.triangles[triangle] = [from, middle, apex];
                self.triangles.push([middle, to, apex]);
                owner.remove(&(from, to));
                owner.insert((from, middle), triangle);
                owner.insert((middle, apex), triangle);
                owner.insert((middle, to), added);
                owner.insert((to, apex), added);
                owner.insert((apex, middle), added);
                longest.push(entry(corners, middle, apex));
            }
            longest.push(entry(corners, a, middle));
            longest.push(entry(corners, middle, b));
        }
    }

    /// Returns the volume of the air inside, with its openings closed by `plugs` (quadrangles that face it).
    pub fn air_volume(&self, triangles: &[[u32; 3]], plugs: &[[u32; 4]]) -> f64 {
        let at = |i: u32| self.corners[i as usize];
        let six = |a: u32, b: u32, c: u32| at(a).dot(at(b).cross(at(c)));
        let walls: f64 = triangles.iter().map(|t| six(t[0], t[1], t[2])).sum();
        let plugs: f64 = plugs
            .iter()
            .map(|q| six(q[0], q[1], q[2]) + six(q[0], q[2], q[3]))
            .sum();
        -(walls + plugs) / 6.0
    }

    /// Returns the mesh with one flat normal per triangle, or with shared vertices and no normals.
    pub fn into_mesh(self, name: &str, material: u32, flat: bool) -> Mesh {
        let mut p = Primitive {
            material: Some(material),
            ..Primitive::default()
        };
        if flat {
            for t in &self.triangles {
                let corners = t.map(|i| self.corners[i as usize]);
                let normal = newell(&corners).normalize_or_zero().as_vec3().to_array();
                p.positions.extend(corners.map(|c| c.as_vec3().to_array()));
                p.normals.extend([normal; 3]);
            }
            p.indices = (0..p.positions.len() as u32).collect();
        } else {
            p.positions = self
                .corners
                .iter()
                .map(|c| c.as_vec3().to_array())
                .collect();
            p.indices = self.triangles.concat();
        }
        Mesh {
            name: name.into(),
            primitives: vec![p],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_testkit::oracle::{n_open_edges, signed_volume};

    #[test]
    fn bisection_evens_out_the_triangles_and_keeps_the_surface() {
        let mut mesh = Interior::default();
        let c: Vec<u32> = (0..8)
            .map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)))
            .map(|p| mesh.corner(p * DVec3::new(8.0, 1.0, 2.0)))
            .collect();
        for q in [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ] {
            mesh.quad(q.map(|i| c[i]));
        }
        mesh.bisect_to(2000);
        assert_eq!((mesh.triangles.len(), mesh.corners.len()), (2000, 1002));
        let triangles: Vec<[DVec3; 3]> = mesh
            .triangles
            .iter()
            .map(|t| t.map(|i| mesh.corners[i as usize]))
            .collect();
        assert_eq!(n_open_edges(&triangles), 0);
        // Halves of binary fractions: exact up to the sum's rounding.
        assert!((signed_volume(&triangles) - 16.0).abs() < 1e-9);
        let longest = triangles
            .iter()
            .flat_map(|t| (0..3).map(|i| t[i].distance(t[(i + 1) % 3])))
            .fold(0.0, f64::max);
        // Triangles of 52 / 2000 square units, half a square each: the long side is 0.32. A
        // factor of 2 allows for one bisection more or less.
        assert!(longest < 0.65, "{longest}");
    }
}
