//! Whether a point is in matter, where matter is no list of solids but triangles.
//!
//! Walls, slabs and columns are modeled as closed surfaces that overlap each other, so neither the
//! surface next to a point nor the parity of crossings tells. The number of surfaces that a ray leaves
//! less those it enters is the winding number of a closed mesh, and stays right where closed meshes
//! overlap. Where a surface has holes rays disagree, and the majority of them decides.

use enfilade_geom::{Bvh, DVec3, Ray, Triangle};

/// Directions that no wall of a building runs along; an odd number, so that there is a majority.
const DIRECTIONS: [[f64; 3]; 7] = [
    [0.831, 0.417, 0.368],
    [-0.771, 0.213, 0.600],
    [0.117, -0.901, 0.418],
    [-0.293, 0.911, -0.290],
    [0.513, 0.329, -0.793],
    [-0.619, -0.447, -0.646],
    [0.377, -0.353, 0.856],
];

/// Triangles that are asked what lies within them.
pub(super) struct Soup(Bvh);

impl Soup {
    pub(super) fn of(triangles: &[Triangle]) -> Self {
        Self(Bvh::build(triangles))
    }

    /// Whether most rays from `p` leave more surfaces than they enter.
    pub(super) fn is_inside(&self, p: DVec3) -> bool {
        let mut n_inside = 0;
        for (i, direction) in DIRECTIONS.into_iter().enumerate() {
            let ray = Ray {
                origin: p,
                direction: DVec3::from(direction),
                t_max: f64::INFINITY,
            };
            let mut winding = 0;
            self.0.for_each_hit(&ray, |h| winding += if h.front { -1 } else { 1 });
            n_inside += usize::from(winding > 0);
            let (half, left) = (DIRECTIONS.len() / 2, DIRECTIONS.len() - 1 - i);
            if n_inside > half || n_inside + left <= half {
                break;
            }
        }
        n_inside > DIRECTIONS.len() / 2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A closed box, seen from outside.
    fn boxed(min: DVec3, max: DVec3) -> Vec<Triangle> {
        let at = |i: usize| {
            DVec3::new(
                if i & 1 == 0 { min.x } else { max.x },
                if i & 2 == 0 { min.y } else { max.y },
                if i & 4 == 0 { min.z } else { max.z },
            )
        };
        let quads = [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ];
        quads
            .iter()
            .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]])
            .map(|t| t.map(at))
            .collect()
    }

    #[test]
    fn overlapping_boxes_are_matter_and_what_they_enclose_is_air() {
        // Four walls and two slabs that run into each other at every edge, and a missing triangle.
        let mut all = Vec::new();
        for axis in 0..3 {
            for side in 0..2 {
                let (mut min, mut max) = (DVec3::splat(-1.0), DVec3::splat(5.0));
                if side == 0 {
                    max[axis] = 0.0;
                } else {
                    min[axis] = 4.0;
                }
                all.extend(boxed(min, max));
            }
        }
        for soup in [Soup::of(&all), Soup::of(&all[1..])] {
            for k in 0..1000 {
                // A lattice off the walls' faces.
                let p = DVec3::new(
                    f64::from(k % 10) * 0.6 - 0.73,
                    f64::from(k / 10 % 10) * 0.6 - 0.77,
                    f64::from(k / 100) * 0.6 - 0.71,
                );
                let is_air = p.cmpgt(DVec3::ZERO).all() && p.cmplt(DVec3::splat(4.0)).all();
                assert_eq!(soup.is_inside(p), !is_air, "{p}");
            }
            assert!(!soup.is_inside(DVec3::splat(7.0)));
        }
    }
}
