//! Tests if a point is in matter, where matter is given by triangles, not by solids.
//!
//! Walls, slabs and columns are modeled as closed surfaces that overlap each other, so neither the
//! surface next to a point nor the parity of crossings decides. The number of surfaces of one object that a
//! ray leaves minus those that it enters is the object's winding number. Each object is tested by itself, so
//! that a ceiling that is a mere sheet does not affect the wall beside it. If an object has holes, rays
//! disagree, and the majority decides.

use enfilade_geom::{Bvh, DVec3, Purse, Ray, Triangle};
use smallvec::SmallVec;

/// Directions along which no wall of a building runs; an odd number, so that there is a majority.
const DIRECTIONS: [[f64; 3]; 7] = [
    [0.831, 0.417, 0.368],
    [-0.771, 0.213, 0.600],
    [0.117, -0.901, 0.418],
    [-0.293, 0.911, -0.290],
    [0.513, 0.329, -0.793],
    [-0.619, -0.447, -0.646],
    [0.377, -0.353, 0.856],
];

/// Triangles that enclose matter.
pub(super) struct Soup<'a> {
    bvh: Bvh,
    /// Object of each triangle; empty if all are one object.
    objects: &'a [u32],
}

impl<'a> Soup<'a> {
    pub(super) fn of(triangles: &[Triangle], objects: &'a [u32]) -> Self {
        Self {
            bvh: Bvh::build(triangles),
            objects,
        }
    }

    /// Returns `true` if most rays from `p` leave more surfaces of some object than they enter. Spends a unit of work
    /// for each surface that a ray crosses; `false` if none is left.
    pub(super) fn is_inside(&self, p: DVec3, purse: Purse<'_>) -> bool {
        let mut n_inside: SmallVec<[(u32, usize); 8]> = SmallVec::new();
        for direction in DIRECTIONS {
            let ray = Ray {
                origin: p,
                direction: DVec3::from(direction),
                t_max: f64::INFINITY,
            };
            let mut hits: SmallVec<[(u32, i32); 32]> = SmallVec::new();
            self.bvh.for_each_hit(&ray, |h| {
                let object = self.objects.get(h.triangle as usize).copied().unwrap_or(0);
                hits.push((object, if h.front { -1 } else { 1 }));
            });
            if !purse.spend(1 + hits.len() as u64) {
                return false;
            }
            hits.sort_unstable();
            for of_one in hits.chunk_by(|a, b| a.0 == b.0) {
                if of_one.iter().map(|h| h.1).sum::<i32>() > 0 {
                    match n_inside.iter_mut().find(|n| n.0 == of_one[0].0) {
                        Some(n) => n.1 += 1,
                        None => n_inside.push((of_one[0].0, 1)),
                    }
                }
            }
        }
        n_inside.iter().any(|n| n.1 > DIRECTIONS.len() / 2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::{Aabb, Allowance};

    /// A closed box, seen from outside.
    fn boxed(min: DVec3, max: DVec3) -> Vec<Triangle> {
        Aabb::new(min, max).triangles()
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
        // And a sheet in mid-air that faces the floor, as ceilings are modeled.
        let sheet = [[-9.0, 3.9, -9.0], [20.0, 3.9, -9.0], [-9.0, 3.9, 20.0]].map(DVec3::from);
        all.push(sheet);
        let any = Purse::endless();
        let objects: Vec<u32> = (0..all.len() as u32).map(|t| t / 12).collect();
        for soup in [Soup::of(&all, &objects), Soup::of(&all[1..], &objects[1..])] {
            for k in 0..1000 {
                // A lattice that avoids the walls' faces.
                let p = DVec3::new(
                    f64::from(k % 10) * 0.6 - 0.73,
                    f64::from(k / 10 % 10) * 0.6 - 0.77,
                    f64::from(k / 100) * 0.6 - 0.71,
                );
                let is_air = p.cmpgt(DVec3::ZERO).all() && p.cmplt(DVec3::splat(4.0)).all();
                assert_eq!(soup.is_inside(p, any), !is_air, "{p}");
            }
            assert!(!soup.is_inside(DVec3::splat(7.0), any));
        }
        // Seven rays that each cross a surface cost more than ten units.
        let little = Allowance::new(10, None);
        assert!(!Soup::of(&all, &objects).is_inside(DVec3::splat(-0.5), (&little).into()));
        assert!(little.is_over());
    }
}
