//! Doorways in thick walls: how far out of the piece the opening stays as it is.
//!
//! A bake sets a portal anywhere in the depth of its wall. Pieces meet at their outer faces, so the portal of an attachment
//! moves there first, along the straight tunnel that the wall forms around it.

use enfilade_geom::poly::{self, Poly};
use enfilade_geom::{Aabb, Bvh, DVec3, Plane, Ray, Triangle};

use crate::fit::Mouth;

/// Longest tunnel. [Units: wu]
const LONGEST: f64 = 2.0;
/// Distance of a tunnel's walls from the outline at which they still count as there, as of frames in the reveal of a door.
/// [Units: wu]
const BESIDE: f64 = 0.02;
/// Shortest part of a tunnel. [Units: wu]
const SHORTEST: f64 = 1e-4;

/// Returns the depth of the straight tunnel in front of a mouth, 0 if there is none: up to there, walls, floor and lintel follow its
/// outline on all sides, and nothing is in it. [Units: wu]
pub(crate) fn depth(mouth: &Mouth, structure: &[Triangle]) -> f64 {
    let near = Near::new(mouth, structure);
    let mut depth = 0.0;
    for &end in &near.ends {
        if end - depth < SHORTEST {
            continue;
        }
        if !near.is_lined(0.5 * (depth + end)) || near.is_obstructed(depth, end) {
            break;
        }
        depth = end;
    }
    depth
}

/// Triangles beside a tunnel, in the frame of its mouth.
struct Near<'a> {
    mouth: &'a Mouth,
    triangles: Vec<Triangle>,
    bvh: Bvh,
    /// Depths of vertices on its walls, ascending: a wall ends at one of them.
    ends: Vec<f64>,
}

impl<'a> Near<'a> {
    fn new(mouth: &'a Mouth, structure: &[Triangle]) -> Self {
        let outline = mouth.outline.iter().map(|p| DVec3::new(p.x, p.y, 0.0));
        let flat = outline.fold(Aabb::EMPTY, Aabb::including);
        let reach = Aabb::new(flat.min, flat.max + DVec3::Z * LONGEST).expanded(BESIDE);
        let own = structure
            .iter()
            .map(|t| t.map(|p| mouth.frame.point_back(p)));
        let triangles: Vec<Triangle> = own
            .filter(|t| Aabb::of_points(t).overlaps(&reach))
            .collect();
        let vertices = triangles.iter().flatten();
        let on_walls = vertices.filter(|p| reach.contains(**p) && p.z > SHORTEST);
        let mut ends: Vec<f64> = on_walls.map(|p| p.z).collect();
        ends.sort_by(f64::total_cmp);
        Self {
            mouth,
            bvh: Bvh::build(&triangles),
            triangles,
            ends,
        }
    }

    /// Returns `true` if walls follow all sides of the outline at a depth.
    fn is_lined(&self, z: f64) -> bool {
        let n = self.mouth.outline.len();
        let at = |k: usize| self.mouth.outline[k % n].extend(z);
        let middle = (0..n).map(at).sum::<DVec3>() / n as f64;
        (0..n).all(|k| {
            [1.0 / 6.0, 0.5, 5.0 / 6.0].into_iter().all(|t| {
                let rim = at(k).lerp(at(k + 1), t);
                let length = rim.distance(middle);
                let direction = (rim - middle) / length;
                let ray = Ray {
                    origin: middle,
                    direction,
                    t_max: length + BESIDE,
                };
                let hit = self.bvh.closest_hit(&ray, |_| false);
                hit.is_some_and(|hit| hit.t >= length - BESIDE)
            })
        })
    }

    /// Returns `true` if a triangle is in the tunnel between two depths.
    fn is_obstructed(&self, from: f64, to: f64) -> bool {
        let n = self.mouth.outline.len();
        let at = |k: usize| self.mouth.outline[k % n].extend(0.0);
        let mut sides: Vec<Plane> = (0..n)
            .map(|k| {
                let inward = DVec3::Z.cross(at(k + 1) - at(k)).normalize_or_zero();
                Plane::through(at(k) + inward * BESIDE, inward)
            })
            .collect();
        sides.push(Plane::through(DVec3::Z * (from + SHORTEST), DVec3::Z));
        sides.push(Plane::through(DVec3::Z * (to - SHORTEST), -DVec3::Z));
        self.triangles.iter().any(|t| {
            let mut part = Poly::from_slice(t);
            (sides.iter()).all(|side| poly::clip_in_place(&mut part, side, 0.0))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_cpg::{CellId, Portal, PortalKind};

    /// A wall from z = 0 to 0.3 with an opening of 1 × 2 m, in which a portal stands at z = 0.1.
    fn wall() -> (Mouth, Vec<Triangle>) {
        let outline = [[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]];
        let outline: Vec<[f32; 3]> = outline.map(|[x, y]| [x, y, 0.1]).to_vec();
        let portal = Portal {
            cells: [CellId(0), CellId(1)],
            kind: PortalKind::Open,
            normal: [0.0, 0.0, 1.0],
            pieces: vec![outline.clone()],
            outline,
            area: 2.0,
            fittings: Vec::new(),
            why: Vec::new(),
        };
        let solids = [
            [[-3.0, -0.2, 0.0], [0.0, 3.0, 0.3]],
            [[1.0, -0.2, 0.0], [4.0, 3.0, 0.3]],
            [[0.0, -0.2, 0.0], [1.0, 0.0, 0.3]],
            [[0.0, 2.0, 0.0], [1.0, 3.0, 0.3]],
        ];
        let solids = solids.map(|b| b.map(DVec3::from_array));
        let faces = solids.map(|[low, high]| Aabb::new(low, high).triangles());
        (Mouth::of_portal(&portal, DVec3::Z), faces.concat())
    }

    /// Covers W14.
    #[test]
    fn a_tunnel_ends_where_its_wall_does() {
        let (mouth, mut walls) = wall();
        assert!((depth(&mouth, &walls) - 0.2).abs() < 1e-6);
        // Anything in it ends it sooner, here where no ray to its sides passes.
        let low = DVec3::new(0.38, 1.5, 0.2);
        let thing = Aabb::new(low, low + DVec3::splat(0.04)).triangles();
        let with_thing = [&walls[..], &thing].concat();
        assert!((depth(&mouth, &with_thing) - 0.1).abs() < 1e-6);
        // So does a step.
        let step = Aabb::new(DVec3::new(0.0, 0.0, 0.2), DVec3::new(1.0, 0.1, 0.3));
        walls.extend(step.triangles());
        assert!((depth(&mouth, &walls) - 0.1).abs() < 1e-6);
        // Without a floor, there is no tunnel.
        let is_floor = |t: &Triangle| t.iter().all(|p| p.y == 0.0);
        walls.retain(|t| !is_floor(t));
        assert_eq!(depth(&mouth, &walls), 0.0);
    }
}
