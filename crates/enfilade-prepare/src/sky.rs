//! Skies of scenes: boxes, domes and spheres around everything else, whatever they are called.
//!
//! A sky is far from what it surrounds, touches nothing but ground that runs to it, and is overhead and on all sides. A hall
//! stands on or near what is in it, and a valley has no ceiling.

use enfilade_geom::scene::{Role, Scene};
use enfilade_geom::{Aabb, Bvh, DVec3, Ray, Triangle};

/// A sky is at least this many times as wide as what it surrounds: a hall around a hut may be wider than the hut, too, but then the
/// hut stands on its floor.
const WIDER: f64 = 2.0;
/// Things nearer than this touch, as pieces of kits overlap and are laid with gaps. [Units: wu]
const NEAR: f64 = 0.05;
/// Least size of what is inside, in plan and in height: a room for a person, not a lamp below the ceiling of a hall. [Units: wu]
const INSIDE: [f64; 2] = [2.5, 1.8];
/// Ground is flatter than this share of its width, and wider than this share of the sky.
const FLAT: f64 = 0.05;
const GROUND: f64 = 0.5;
/// Rise of the rays that look for the sky on all sides, beside their run: over the rim of a dome, below its top.
const RISE: f64 = 0.3;

/// Returns the objects that are skies, ascending. O(n) boxes for each, and one pass over the triangles.
#[must_use]
pub fn skies(scene: &Scene) -> Vec<usize> {
    let boxes: Vec<Aabb> = (0..scene.objects.len())
        .map(|i| scene.object_aabb(i))
        .collect();
    let mut inside: Vec<usize> = (0..boxes.len())
        .filter(|&i| !boxes[i].is_empty() && scene.objects[i].role == Role::Structural)
        .collect();
    let mut found = Vec::new();
    // A dome of clouds may lie in one of stars.
    while let Some(sky) = largest(&inside, &boxes) {
        inside.retain(|&i| i != sky);
        if !is_sky(scene, sky, &inside, &boxes) {
            break;
        }
        found.push(sky);
    }
    found.sort_unstable();
    found
}

fn largest(all: &[usize], boxes: &[Aabb]) -> Option<usize> {
    let volume = |i: &&usize| boxes[**i].volume();
    let largest = all
        .iter()
        .max_by(|a, b| volume(a).total_cmp(&volume(b)).then(b.cmp(a)));
    largest.copied()
}

fn is_sky(scene: &Scene, sky: usize, others: &[usize], boxes: &[Aabb]) -> bool {
    let own = boxes[sky];
    let wide = |b: &Aabb| b.size().x.max(b.size().z);
    let is_ground = |i: &usize| {
        let b = &boxes[*i];
        b.size().y < FLAT * wide(b) && wide(b) > GROUND * wide(&own)
    };
    let inside: Vec<usize> = others.iter().copied().filter(|i| !is_ground(i)).collect();
    let bounds = inside
        .iter()
        .fold(Aabb::EMPTY, |all, &i| all.union(boxes[i]));
    if bounds.is_empty() || wide(&bounds) < INSIDE[0] || bounds.size().y < INSIDE[1] {
        return false;
    }
    let around = bounds.expanded(NEAR);
    let surrounds = |k: usize| own.min[k] < around.min[k] && own.max[k] > around.max[k];
    let is_above = own.max.y > around.max.y && own.min.y < bounds.max.y;
    if !(surrounds(0) && surrounds(2) && is_above && wide(&own) >= WIDER * wide(&bounds)) {
        return false;
    }
    let triangles = triangles_of(scene, &[sky]);
    let shell = Bvh::build(&triangles);
    let middle = DVec3::new(bounds.center().x, bounds.max.y, bounds.center().z);
    let is_seen = |direction: DVec3| {
        let ray = Ray {
            origin: middle,
            direction: direction.normalize(),
            t_max: f64::INFINITY,
        };
        shell.closest_hit(&ray, |_| false).is_some()
    };
    let sides = [DVec3::X, DVec3::Z, -DVec3::X, -DVec3::Z];
    let is_around = sides.into_iter().all(|d| is_seen(d + RISE * DVec3::Y));
    if !(is_around && is_seen(DVec3::Y)) {
        return false;
    }
    let touches = |t: &Triangle| shell.any_in_box(&Aabb::of_points(t).expanded(NEAR), |_| true);
    !triangles_of(scene, &inside).iter().any(touches)
}

fn triangles_of(scene: &Scene, objects: &[usize]) -> Vec<Triangle> {
    let mut wanted = vec![false; scene.objects.len()];
    objects.iter().for_each(|&i| wanted[i] = true);
    let all = scene.triangle_sources(Role::Structural);
    let own = all.filter(|s| wanted[s.object as usize]);
    own.map(|s| scene.world_triangle(s)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::DMat4;
    use enfilade_geom::scene::{Mesh, Object, Primitive};

    /// Returns a scene of boxes.
    fn scene(boxes: &[[[f64; 3]; 2]]) -> Scene {
        let mut scene = Scene::default();
        for (i, [min, max]) in (0..).zip(boxes) {
            let all = Aabb::new(DVec3::from(*min), DVec3::from(*max)).triangles();
            let points = all.as_flattened().iter();
            let positions: Vec<[f32; 3]> = points.map(|p| p.as_vec3().to_array()).collect();
            scene.meshes.push(Mesh {
                name: String::new(),
                primitives: vec![Primitive {
                    indices: (0..positions.len() as u32).collect(),
                    positions,
                    ..Primitive::default()
                }],
            });
            scene.objects.push(Object {
                name: format!("Cube.{i:03}"),
                mesh: i,
                transform: DMat4::IDENTITY,
                role: Role::Structural,
                reason: String::new(),
                filling: None,
                node: None,
            });
        }
        scene
    }

    const HOUSE: [[f64; 3]; 2] = [[0.0, -0.2, 0.0], [8.0, 3.0, 5.0]];

    fn around(half: f64, low: f64) -> [[f64; 3]; 2] {
        [[-half, low, -half], [half, half, half]]
    }

    #[test]
    fn a_box_far_around_everything_is_sky_also_on_ground_and_in_another() {
        let ground = [[-40.0, -0.3, -40.0], [40.0, -0.2, 40.0]];
        assert_eq!(skies(&scene(&[HOUSE, around(500.0, -500.0)])), [1]);
        assert_eq!(skies(&scene(&[around(40.0, -0.4), HOUSE, ground])), [0]);
        let two = [around(90.0, -90.0), around(40.0, -40.0), HOUSE];
        assert_eq!(skies(&scene(&two)), [0, 1]);
    }

    #[test]
    fn halls_and_shells_are_no_sky() {
        let none = [0_usize; 0];
        // On its floor.
        let standing = [[[-40.0, -0.2, -40.0], [40.0, 20.0, 40.0]], HOUSE];
        assert_eq!(skies(&scene(&standing)), none);
        // Hardly wider.
        let near = [[[-2.0, -1.0, -2.0], [10.0, 4.0, 7.0]], HOUSE];
        assert_eq!(skies(&scene(&near)), none);
        // A lamp in a hall.
        let lamp = [
            [[-40.0, 0.0, -40.0], [40.0, 20.0, 40.0]],
            [[0.0, 18.0, 0.0], [1.0, 19.0, 1.0]],
        ];
        assert_eq!(skies(&scene(&lamp)), none);
        assert_eq!(skies(&scene(&[HOUSE])), none);
    }
}
