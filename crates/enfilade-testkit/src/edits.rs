//! Random edits of a scene, as builders and players make them: a wall broken, a door cut, furniture moved.
//!
//! Works on any scene of triangles, generated or imported. Holes are cut through whatever structure is there, with new faces
//! around them, so closed solids stay closed.

use enfilade_geom::poly::{self, Poly, Sides};
use enfilade_geom::scene::{Mesh, Object, Primitive, Role, Scene, TriangleSource};
use enfilade_geom::{Aabb, Bvh, DMat4, DVec3, Plane, Ray, Triangle, triangle_area_normal};

use enfilade_demo::Rng;

/// A kind of edit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Edit {
    /// A wall is broken: a hole of 1.5 to 3 m, from the floor nearly to the ceiling.
    WallOut,
    /// A doorway of 0.9 × 2.1 m is cut.
    DoorCut,
    /// A cupboard moves; see [`with_cupboards`].
    Moved,
}

/// Name of the objects that [`Edit::Moved`] moves.
const CUPBOARD: &str = "cupboard";
/// Thinnest and thickest wall that is cut. [Units: wu]
const WALL: [f64; 2] = [0.02, 0.6];
/// Least headroom over a floor. [Units: wu]
const HEADROOM: f64 = 2.2;
/// Most places tried for an edit.
const TRIES: usize = 2000;
/// Distance of holes and cupboards from the floor, so that no faces coincide; far below any hole that counts. [Units: wu]
const OFF_FLOOR: f64 = 0.003;
/// Distance of the points at which a wall is probed: no other wall may meet it there. [Units: wu]
const PROBES: f64 = 0.05;

/// Returns the structural triangles of a scene, and a tree of them.
fn structure(scene: &Scene) -> (Vec<TriangleSource>, Vec<Triangle>, Bvh) {
    let sources: Vec<TriangleSource> = scene.triangle_sources(Role::Structural).collect();
    let triangles: Vec<Triangle> = sources.iter().map(|&s| scene.world_triangle(s)).collect();
    let bvh = Bvh::build(&triangles);
    (sources, triangles, bvh)
}

/// Returns the distance to the first surface along a direction.
fn reach(bvh: &Bvh, origin: DVec3, direction: DVec3) -> Option<f64> {
    let ray = Ray {
        origin,
        direction,
        t_max: 100.0,
    };
    bvh.closest_hit(&ray, |_| false).map(|hit| hit.t)
}

/// Returns `true` if a point is not in matter: surfaces show it their fronts.
fn is_air(bvh: &Bvh, origin: DVec3, direction: DVec3) -> bool {
    [direction, -direction].into_iter().all(|direction| {
        let ray = Ray {
            origin,
            direction,
            t_max: 100.0,
        };
        bvh.closest_hit(&ray, |_| false).is_none_or(|hit| hit.front)
    })
}

/// Adds `n` cupboards, boxes of 1 × 0.5 × 1.8 m, to rooms of a scene: every other one structural, the rest detail.
///
/// They stand where there is a floor, headroom and space around them.
#[must_use]
pub fn with_cupboards(scene: &Scene, n: usize, seed: u64) -> Scene {
    let (_, triangles, bvh) = structure(scene);
    let bounds = Aabb::of_points(triangles.as_flattened());
    let mut rng = Rng::new(seed);
    let mut out = scene.clone();
    for k in 0..n {
        let Some(at) = free_place(&bvh, &bounds, &mut rng) else {
            break;
        };
        let b = cupboard(at);
        let role = [Role::Structural, Role::Detail][k % 2];
        add(&mut out, CUPBOARD, &b.triangles(), role);
    }
    out
}

fn cupboard(at: DVec3) -> Aabb {
    Aabb::new(
        at + DVec3::new(-0.5, OFF_FLOOR, -0.25),
        at + DVec3::new(0.5, 1.8, 0.25),
    )
}

/// Returns a point of a floor under a ceiling with space for a cupboard.
fn free_place(bvh: &Bvh, within: &Aabb, rng: &mut Rng) -> Option<DVec3> {
    (0..TRIES).find_map(|_| {
        let p = rng.point_in(within);
        let at = p - DVec3::Y * reach(bvh, p, -DVec3::Y)?;
        let is_high = reach(bvh, at + DVec3::Y * 0.1, DVec3::Y)? > HEADROOM;
        let is_wide = (0..8).all(|k| {
            let (z, x) = (f64::from(k) * 0.785).sin_cos();
            let clear =
                |h| reach(bvh, at + DVec3::Y * h, DVec3::new(x, 0.0, z)).is_none_or(|d| d > 1.0);
            clear(0.1) && clear(1.0) && clear(1.9)
        });
        (is_high && is_wide).then_some(at)
    })
}

/// Adds an object of triangles in world space.
fn add(scene: &mut Scene, name: &str, triangles: &[Triangle], role: Role) {
    let positions = triangles.as_flattened();
    let node = scene.nodes.len() as u32;
    scene.nodes.push(enfilade_geom::scene::SourceNode {
        name: name.to_owned(),
        ..Default::default()
    });
    scene.meshes.push(Mesh {
        primitives: vec![Primitive {
            positions: positions.iter().map(|p| p.as_vec3().to_array()).collect(),
            indices: (0..positions.len() as u32).collect(),
            ..Primitive::default()
        }],
        ..Mesh::default()
    });
    scene.objects.push(Object {
        name: name.to_owned(),
        mesh: scene.meshes.len() as u32 - 1,
        transform: DMat4::IDENTITY,
        role,
        reason: "added".to_owned(),
        filling: None,
        node: Some(node),
    });
}

/// Returns a scene after one edit at random, and the box of the change; `None` if no place for it is found.
#[must_use]
pub fn edited(scene: &Scene, edit: Edit, rng: &mut Rng) -> Option<(Scene, Aabb)> {
    match edit {
        Edit::Moved => moved(scene, rng),
        Edit::WallOut => {
            let size = [rng.range(1.5, 3.0), rng.range(2.3, 2.6)];
            cut(scene, size, rng)
        }
        Edit::DoorCut => cut(scene, [0.9, 2.1], rng),
    }
}

fn moved(scene: &Scene, rng: &mut Rng) -> Option<(Scene, Aabb)> {
    let named = scene.objects.iter().enumerate();
    let cupboards: Vec<usize> = named
        .filter(|(_, o)| o.name == CUPBOARD)
        .map(|(i, _)| i)
        .collect();
    let i = *cupboards.get(rng.below(cupboards.len().max(1)))?;
    let was = scene.object_aabb(i);
    let (_, _, bvh) = structure(scene);
    let near = Aabb::new(was.center(), was.center()).expanded(3.0);
    let at = free_place(&bvh, &near, rng)?;
    let mut out = scene.clone();
    let off = cupboard(at).center() - was.center();
    out.objects[i].transform = DMat4::from_translation(off.as_vec3().as_dvec3());
    Some((out.clone(), was.union(out.object_aabb(i))))
}

/// Cuts a hole of a width and a height through a wall with rooms or the outdoors on both sides.
fn cut(scene: &Scene, [width, height]: [f64; 2], rng: &mut Rng) -> Option<(Scene, Aabb)> {
    let (sources, triangles, bvh) = structure(scene);
    let upright: Vec<usize> = (0..triangles.len())
        .filter(|&t| {
            let n = triangle_area_normal(&triangles[t]);
            n.y.abs() < 1e-3 * n.length() && n.length() > 1.0
        })
        .collect();
    let hole = (0..TRIES).find_map(|_| {
        let t = *upright.get(rng.below(upright.len().max(1)))?;
        Breach::at(&bvh, &triangles[t], [width, height], rng)
    })?;
    let mut out = scene.clone();
    let mut of_object: Vec<Vec<Triangle>> = vec![Vec::new(); scene.objects.len()];
    let around = hole.aabb();
    let mut is_cut = vec![false; scene.objects.len()];
    for (source, t) in sources.iter().zip(&triangles) {
        let object = source.object as usize;
        if Aabb::of_points(t).overlaps(&around) {
            is_cut[object] = true;
        }
        hole.outside(t, &mut of_object[object]);
    }
    let mut first = true;
    for (i, mut rest) in of_object
        .into_iter()
        .enumerate()
        .filter(|(i, _)| is_cut[*i])
    {
        if std::mem::take(&mut first) {
            rest.extend(hole.reveals());
        }
        let mesh = scene.objects[i].mesh as usize;
        let material = scene.meshes[mesh]
            .primitives
            .first()
            .and_then(|p| p.material);
        let positions: Vec<_> = rest
            .as_flattened()
            .iter()
            .map(|p| p.as_vec3().to_array())
            .collect();
        out.meshes.push(Mesh {
            primitives: vec![Primitive {
                indices: (0..positions.len() as u32).collect(),
                positions,
                material,
                ..Primitive::default()
            }],
            ..Mesh::default()
        });
        out.objects[i].mesh = out.meshes.len() as u32 - 1;
        out.objects[i].transform = DMat4::IDENTITY;
    }
    Some((out, around))
}

/// A box through a wall.
struct Breach {
    /// Middle of its foot, on the wall's front.
    foot: DVec3,
    /// Along the wall, and into it.
    along: DVec3,
    into: DVec3,
    width: f64,
    height: f64,
    thickness: f64,
}

impl Breach {
    fn at(bvh: &Bvh, t: &Triangle, [width, height]: [f64; 2], rng: &mut Rng) -> Option<Self> {
        let normal = triangle_area_normal(t).normalize().with_y(0.0).normalize();
        let (mut u, mut v) = (rng.unit(), rng.unit());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let p = t[0] + (t[1] - t[0]) * u + (t[2] - t[0]) * v;
        let thickness = reach(bvh, p - normal * 1e-3, -normal)? + 1e-3;
        if !(WALL[0]..WALL[1]).contains(&thickness) {
            return None;
        }
        let before = p + normal * 0.3;
        let foot = before.y - reach(bvh, before, -DVec3::Y)?;
        let hole = Self {
            foot: p.with_y(foot + OFF_FLOOR),
            along: DVec3::Y.cross(normal),
            into: -normal,
            width,
            height,
            thickness,
        };
        hole.is_in_one_wall(bvh).then_some(hole)
    }

    /// Returns `true` if the wall is there all around the hole, with air on both sides.
    fn is_in_one_wall(&self, bvh: &Bvh) -> bool {
        let [w, h] = [0.5 * self.width + 0.15, self.height + 0.1];
        let n = (2.0 * w / PROBES).ceil() as usize;
        (0..=n).all(|k| {
            let x = (2.0 * k as f64 / n as f64 - 1.0) * w;
            [0.05, 0.3 * h, 0.6 * h, h].iter().all(|y| {
                let q = self.foot + self.along * x + DVec3::Y * *y;
                let is_at = |origin: DVec3, direction: DVec3, distance: f64| {
                    reach(bvh, origin, direction).is_some_and(|d| (d - distance).abs() < 1e-3)
                };
                let behind = q + self.into * self.thickness;
                let air = 0.25;
                let [near, far] = [q - self.into * air, behind + self.into * air];
                is_at(near, self.into, air)
                    && is_at(far, -self.into, air)
                    && [near, far].iter().all(|p| is_air(bvh, *p, self.along))
            })
        })
    }

    /// Returns the planes of its sides, foot and head; normals point inward. Then those of the wall's faces, a bit outside.
    fn planes(&self) -> [Plane; 6] {
        let head = self.foot + DVec3::Y * self.height;
        let side = self.along * (0.5 * self.width);
        let slack = self.into * 1e-3;
        [
            Plane::through(self.foot - side, self.along),
            Plane::through(self.foot + side, -self.along),
            Plane::through(self.foot, DVec3::Y),
            Plane::through(head, -DVec3::Y),
            Plane::through(self.foot - slack, self.into),
            Plane::through(self.foot + self.into * self.thickness + slack, -self.into),
        ]
    }

    fn corners(&self) -> [[DVec3; 4]; 2] {
        let side = self.along * (0.5 * self.width);
        let up = DVec3::Y * self.height;
        let face = |at: DVec3| [at - side, at + side, at + side + up, at - side + up];
        [
            face(self.foot),
            face(self.foot + self.into * self.thickness),
        ]
    }

    fn aabb(&self) -> Aabb {
        Aabb::of_points(self.corners().as_flattened())
    }

    /// Adds what is left of a triangle.
    fn outside(&self, t: &Triangle, out: &mut Vec<Triangle>) {
        let planes = self.planes();
        if planes
            .iter()
            .any(|p| t.iter().all(|&q| p.signed_distance(q) <= 1e-9))
        {
            out.push(*t);
            return;
        }
        let mut fan = |points: &[DVec3]| {
            let inner = 1..points.len() - 1;
            out.extend(inner.map(|i| [points[0], points[i], points[i + 1]]));
        };
        let mut rest = Poly::from_slice(t);
        for plane in &planes {
            match poly::split(&rest, plane, 1e-9) {
                Sides::Front | Sides::On => {}
                Sides::Back => {
                    fan(&rest);
                    return;
                }
                Sides::Both(inner, outer) => {
                    fan(&outer);
                    rest = inner;
                }
            }
        }
    }

    /// Returns the faces in the wall's thickness; they face into the hole.
    fn reveals(&self) -> Vec<Triangle> {
        let [front, back] = self.corners();
        let middle = self.aabb().center();
        (0..4)
            .flat_map(|k| {
                let l = (k + 1) % 4;
                let [a, b, c, d] = [front[k], front[l], back[l], back[k]];
                [[a, b, c], [a, c, d]]
            })
            .map(|t| {
                let faces_in = triangle_area_normal(&t).dot(middle - t[0]) > 0.0;
                if faces_in { t } else { [t[0], t[2], t[1]] }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{TowerParams, office_tower};

    #[test]
    fn edits_change_what_they_say_and_nothing_else() {
        let tower = office_tower(&TowerParams::with_rooms(16, 1)).scene;
        let scene = with_cupboards(&tower, 4, 1);
        assert_eq!(scene.objects.len(), tower.objects.len() + 4);
        let mut rng = Rng::new(1);
        let area = |scene: &Scene| -> f64 {
            let (_, triangles, _) = structure(scene);
            triangles
                .iter()
                .map(|t| 0.5 * triangle_area_normal(t).length())
                .sum()
        };
        for edit in [Edit::WallOut, Edit::DoorCut, Edit::Moved] {
            let (after, at) = edited(&scene, edit, &mut rng).expect("a place");
            assert!(!at.is_empty());
            let lost = area(&scene) - area(&after);
            let is_cut = edit != Edit::Moved;
            assert_eq!(lost > 1.0, is_cut, "{edit:?}: {lost} m²");
            assert_eq!(after.objects.len(), scene.objects.len());
        }
    }
}
