//! Skies of scenes: boxes, domes and spheres around everything else, whatever they are called.
//!
//! A sky is far from what it surrounds, touches nothing but ground that runs to it, and is overhead and on all sides. A hall
//! stands on or near what is in it, and a valley has no ceiling.

use enfilade_geom::scene::{Role, Scene};
use enfilade_geom::{Aabb, Bvh, ConvexSolid, DVec3, Ray, Triangle, triangle_area_normal};

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
/// Most skies in each other, and most sheets of one.
const NESTED: usize = 3;
const SHEETS: usize = 12;
/// Least share of its box that a sheet of a sky fills.
const WHOLE: f64 = 0.99;
/// Rise of the rays that look for the sky on all sides, beside their run: over the rim of a dome, below its top.
const RISE: f64 = 0.3;

/// Returns the objects that are skies, ascending. `O(n log n)` in objects, and a few passes over the triangles.
#[must_use]
pub fn skies(scene: &Scene) -> Vec<usize> {
    let boxes: Vec<Aabb> = (0..scene.objects.len())
        .map(|i| scene.object_aabb(i))
        .collect();
    let mut all: Vec<usize> = (0..boxes.len())
        .filter(|&i| !boxes[i].is_empty() && scene.objects[i].role == Role::Structural)
        .collect();
    let volume = |i: usize| boxes[i].volume();
    all.sort_by(|&a, &b| volume(b).total_cmp(&volume(a)).then(a.cmp(&b)));
    let mut found = sheets_around(scene, &all, &boxes);
    all.retain(|i| !found.contains(i));
    // A dome of clouds may lie in one of stars.
    while let Some(n) = (1..=NESTED.min(all.len().saturating_sub(1))).find(|&n| {
        let (skies, inside) = all.split_at(n);
        let lie_in = skies
            .windows(2)
            .all(|w| encloses(&boxes[w[0]], &boxes[w[1]]));
        lie_in && is_sky(scene, &skies[n - 1..], inside, &boxes)
    }) {
        found.extend(all.drain(..n));
    }
    found.sort_unstable();
    found
}

/// Returns the sheets of a box around everything else that is not one object: walls, a lid, and a bottom that nothing touches. All are
/// whole rectangles, while a hall has a doorway.
fn sheets_around(scene: &Scene, all: &[usize], boxes: &[Aabb]) -> Vec<usize> {
    let longest = |b: &Aabb| b.size().max_element();
    let whole = all.iter().fold(Aabb::EMPTY, |sum, &i| sum.union(boxes[i]));
    let is_sheet = |b: &Aabb| b.size().min_element() < FLAT * longest(b);
    let is_wide = |&i: &usize| is_sheet(&boxes[i]) && longest(&boxes[i]) > GROUND * longest(&whole);
    let (sheets, rest): (Vec<usize>, Vec<usize>) = all.iter().partition(|i| is_wide(i));
    let inside = rest.iter().fold(Aabb::EMPTY, |sum, &i| sum.union(boxes[i]));
    let width = wide(&whole);
    let is_ground = |i: &usize| is_ground(&boxes[*i], width) && boxes[*i].max.y < inside.max.y;
    let touches = |i: &usize| boxes[*i].max.y > inside.min.y - NEAR;
    let (grounds, sky): (Vec<usize>, Vec<usize>) =
        sheets.iter().partition(|i| is_ground(i) && touches(i));
    let others: Vec<usize> = rest.iter().chain(&grounds).copied().collect();
    let is_whole = |&i: &usize| {
        let size = boxes[i].size();
        let across = [size.x * size.y, size.y * size.z, size.z * size.x];
        let area = |t: &Triangle| triangle_area_normal(t).length() / 2.0;
        let own: f64 = triangles_of(scene, &[i]).iter().map(area).sum();
        own >= WHOLE * across.into_iter().fold(0.0, f64::max)
    };
    let is_box = sky.len() > 1 && sky.len() <= SHEETS && sky.iter().all(is_whole);
    if is_box && is_sky(scene, &sky, &others, boxes) {
        sky
    } else {
        Vec::new()
    }
}

/// Returns `true` if a box is around another in plan, and as high.
fn encloses(outer: &Aabb, inner: &Aabb) -> bool {
    let around = |k: usize| outer.min[k] < inner.min[k] && outer.max[k] > inner.max[k];
    around(0) && around(2) && outer.max.y > inner.max.y
}

/// Returns `true` if the solids of a sky lie beyond all others on four sides and overhead. Level ground may run to them, or farther.
#[must_use]
pub fn is_sky_around(sky: &[ConvexSolid], others: &[ConvexSolid]) -> bool {
    let of = |all: &[ConvexSolid]| all.iter().map(ConvexSolid::aabb).collect::<Vec<Aabb>>();
    let [sky, others] = [sky, others].map(of);
    let union =
        |all: &mut dyn Iterator<Item = &Aabb>| all.fold(Aabb::EMPTY, |sum, b| sum.union(*b));
    let width = wide(&union(&mut sky.iter()));
    let bounds = union(&mut others.iter().filter(|b| !is_ground(b, width)));
    let middle = bounds.center();
    let is_beyond = |axis: usize, side: f64| {
        let is_past = |b: &&Aabb| {
            let near = if side < 0.0 {
                -b.max[axis]
            } else {
                b.min[axis]
            };
            let end = if side < 0.0 {
                -bounds.min[axis]
            } else {
                bounds.max[axis]
            };
            near >= end - NEAR
        };
        let across = if axis == 0 { 2 } else { 0 };
        let is_there = |b: &Aabb| b.min[across] < middle[across] && b.max[across] > middle[across];
        sky.iter().filter(is_past).any(is_there)
    };
    let sides = [(0, -1.0), (0, 1.0), (2, -1.0), (2, 1.0), (1, 1.0)];
    !bounds.is_empty() && sides.into_iter().all(|(axis, side)| is_beyond(axis, side))
}

fn wide(b: &Aabb) -> f64 {
    b.size().x.max(b.size().z)
}

/// Returns `true` for level ground below a sky of this width.
fn is_ground(b: &Aabb, sky: f64) -> bool {
    b.size().y < FLAT * wide(b) && wide(b) > GROUND * sky
}

/// Returns `true` if objects together are a sky around others.
fn is_sky(scene: &Scene, sky: &[usize], others: &[usize], boxes: &[Aabb]) -> bool {
    let own = sky.iter().fold(Aabb::EMPTY, |sum, &i| sum.union(boxes[i]));
    let is_inside = |i: &usize| !is_ground(&boxes[*i], wide(&own));
    let inside: Vec<usize> = others.iter().copied().filter(is_inside).collect();
    let bounds = inside
        .iter()
        .fold(Aabb::EMPTY, |all, &i| all.union(boxes[i]));
    if bounds.is_empty() || wide(&bounds) < INSIDE[0] || bounds.size().y < INSIDE[1] {
        return false;
    }
    let around = bounds.expanded(NEAR);
    let is_low = own.min.y < bounds.max.y;
    if !(encloses(&own, &around) && is_low && wide(&own) >= WIDER * wide(&bounds)) {
        return false;
    }
    let triangles = triangles_of(scene, sky);
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
    use enfilade_geom::scene::{Mesh, Object, Primitive};
    use enfilade_geom::{DMat4, Plane};

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
        // Hardly wider than the other.
        let two = [HOUSE, around(90.0, -90.0), around(100.0, -100.0)];
        assert_eq!(skies(&scene(&two)), [1, 2]);
    }

    #[test]
    fn sheets_on_all_sides_are_one_sky_and_the_walls_of_a_hall_are_not() {
        let sheet = |axis: usize, at: f64, low: f64| {
            let [mut min, mut max] = [[-60.0, low, -60.0], [60.0, 60.0, 60.0]];
            (min[axis], max[axis]) = (at, at);
            [min, max]
        };
        let sides = |low| {
            [(0, -60.0), (0, 60.0), (2, -60.0), (2, 60.0), (1, 60.0)]
                .map(|(k, at)| sheet(k, at, low))
        };
        let six = [&[HOUSE][..], &sides(-60.0), &[sheet(1, -60.0, 0.0)]].concat();
        assert_eq!(skies(&scene(&six)), [1, 2, 3, 4, 5, 6]);
        // The ground on which the house stands stays.
        let five = [&[HOUSE][..], &sides(-0.2), &[sheet(1, -0.2, 0.0)]].concat();
        assert_eq!(skies(&scene(&five)), [1, 2, 3, 4, 5]);
        let open = [&[HOUSE][..], &sides(-0.2)[1..]].concat();
        assert!(skies(&scene(&open)).is_empty());
        // With a doorway in a wall, it is a hall around a house.
        let mut hall = scene(&five);
        let wall = &mut hall.meshes[1].primitives[0];
        let has_area = |t: &[u32]| {
            let [a, b, c] =
                [0, 1, 2].map(|k| DVec3::from(wall.positions[t[k] as usize].map(f64::from)));
            triangle_area_normal(&[a, b, c]).length() > 0.0
        };
        let half = wall
            .indices
            .chunks(3)
            .find(|t| has_area(t))
            .map(<[u32]>::to_vec);
        wall.indices = half.unwrap();
        assert!(skies(&hall).is_empty());
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

    fn boxed([min, max]: [[f64; 3]; 2]) -> ConvexSolid {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let sides = |k: usize| {
            let high = Plane::through(DVec3::from(max), axes[k]);
            [high, Plane::through(DVec3::from(min), -axes[k])]
        };
        let planes: Vec<Plane> = (0..3).flat_map(sides).collect();
        ConvexSolid::from_planes(&planes, 1e4, 1e-6).unwrap()
    }

    /// Four walls and a lid of sky around a square of this half width, from a height on.
    fn box_of_sky(half: f64, low: f64, high: f64) -> Vec<ConvexSolid> {
        let far = half + 1.0;
        let boxes = [
            [[-far, low, -far], [-half, high, far]],
            [[half, low, -far], [far, high, far]],
            [[-half, low, -far], [half, high, -half]],
            [[-half, low, half], [half, high, far]],
            [[-far, high, -far], [far, high + 1.0, far]],
        ];
        boxes.into_iter().map(boxed).collect()
    }

    #[test]
    fn brushes_of_sky_on_four_sides_and_above_are_around_a_world_and_a_lid_is_not() {
        let sky = box_of_sky(40.0, -1.0, 20.0);
        let house = boxed(HOUSE);
        let ground = boxed([[-60.0, -1.0, -60.0], [60.0, -0.2, 60.0]]);
        let tower = boxed([[50.0, 0.0, 0.0], [55.0, 30.0, 5.0]]);
        assert!(is_sky_around(&sky, &[house.clone(), ground.clone()]));
        assert!(!is_sky_around(&sky, &[house.clone(), tower]));
        assert!(!is_sky_around(&sky, &[ground]));
        for gone in 0..5 {
            let mut open = sky.clone();
            open.remove(gone);
            assert!(
                !is_sky_around(&open, std::slice::from_ref(&house)),
                "{gone}"
            );
        }
        // A court below a lid of sky, whose walls are a level's.
        let walls = box_of_sky(30.0, 0.0, 20.0)[..4].to_vec();
        assert!(!is_sky_around(&sky[4..], &walls));
        assert!(!is_sky_around(&[], &walls));
    }
}
