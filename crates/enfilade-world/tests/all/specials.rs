//! Views through mirrors and teleporters contain everything that rays hit there.

use std::collections::{HashMap, HashSet};

use enfilade_cpg::{Pass, PortalId, SpecialId, SpecialPortal, SpecialShape, Way, World};
use enfilade_geom::{Bvh, DMat3, DVec3, Ray, Triangle};
use enfilade_runtime::{Seen, Sight, View};
use enfilade_testkit::{Chain, GridParams, Rng, chains_of, room_grid, with_specials};
use enfilade_world::{PartId, Space, SpaceSeen, SpaceViewer};

/// A structural triangle: batch and vertices.
type Name = (u32, [u32; 3]);

/// Whole-world tracing of rays, without cells: matrices in place of similarities, flat polygons in place of exits.
struct Tracer {
    structure: Bvh,
    names: Vec<Name>,
    specials: Vec<Side>,
}

struct Side {
    polygon: Vec<DVec3>,
    normal: DVec3,
    /// Per pass, the matrix and offset applied to a ray that passes.
    ways: Vec<(DMat3, DVec3)>,
}

fn point(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

impl Tracer {
    fn new(world: &World) -> Self {
        let (mut triangles, mut names): (Vec<Triangle>, _) = (Vec::new(), Vec::new());
        for (b, batch) in (0..).zip(&world.batches) {
            triangles.extend(batch.primitive.triangles());
            names.extend(batch.primitive.triples().iter().map(|t| (b, *t)));
        }
        let specials = world.graph.special_ids().map(|id| {
            let (normal, pieces) = world.graph.special_opening(id);
            let polygon = pieces[0].points.clone();
            let way = |way: &Way| match way {
                Way::Mirror => {
                    let n =
                        DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
                    let linear = DMat3::IDENTITY - n * 2.0;
                    (linear, polygon[0] - linear * polygon[0])
                }
                Way::Lead { map, .. } => (DMat3::from_quat(map.turn) * map.scale, map.at),
                Way::Through | Way::Monitor(_) => panic!("not in this world"),
            };
            let ways = world.graph.specials[id.idx()].passes.iter();
            let ways = ways.map(|pass| way(&pass.way)).collect();
            Side {
                polygon,
                normal,
                ways,
            }
        });
        Self {
            specials: specials.collect(),
            structure: Bvh::build(&triangles),
            names,
        }
    }

    /// Returns the special portal that a ray meets first, before `t_max`.
    fn special(&self, ray: &Ray) -> Option<(f64, usize)> {
        let mut first: Option<(f64, usize)> = None;
        for (i, side) in self.specials.iter().enumerate() {
            let along = side.normal.dot(ray.direction);
            let t = side.normal.dot(side.polygon[0] - ray.origin) / along;
            if along <= 0.0 || t <= 1e-9 || t >= first.map_or(ray.t_max, |f| f.0) {
                continue;
            }
            let p = ray.origin + ray.direction * t;
            let n = side.polygon.len();
            let is_in = (0..n).all(|k| {
                let (a, b) = (side.polygon[k], side.polygon[(k + 1) % n]);
                side.normal.cross(b - a).dot(p - a) > 0.0
            });
            if is_in {
                first = Some((t, i));
            }
        }
        first
    }

    /// Adds the triangles that a ray hits in every way through special portals, up to a depth.
    fn trace(&self, mut ray: Ray, chain: &mut Chain, depth: usize, hits: &mut Vec<(Chain, Name)>) {
        ray.t_max = f64::INFINITY;
        let wall = self.structure.closest_hit(&ray, |_| false);
        ray.t_max = wall.map_or(f64::INFINITY, |hit| hit.t);
        let Some((t, i)) = self.special(&ray) else {
            hits.extend(wall.map(|hit| (chain.clone(), self.names[hit.triangle as usize])));
            return;
        };
        if depth == 0 {
            return;
        }
        for (pass, (linear, offset)) in self.specials[i].ways.iter().enumerate() {
            let on = ray.origin + ray.direction * t;
            let next = Ray {
                origin: *linear * on + *offset,
                direction: *linear * ray.direction,
                t_max: f64::INFINITY,
            };
            chain.push((i as u32, pass));
            self.trace(next, chain, depth - 1, hits);
            chain.pop();
        }
    }
}

fn triangles_of(sight: &Sight, seen: &Seen<'_>) -> HashSet<Name> {
    let mut names = HashSet::new();
    for c in seen.chunks() {
        let chunk = sight.chunks()[c.0 as usize];
        let first = chunk.first_index as usize;
        let indices = &sight.indices(chunk.batch)[first..first + chunk.n_indices as usize];
        names.extend(
            indices
                .chunks_exact(3)
                .map(|t| (chunk.batch, [t[0], t[1], t[2]])),
        );
    }
    names
}

/// Returns the visible triangles by the special portals in which they are seen.
fn answered(space: &Space, seen: &SpaceSeen<'_>) -> HashMap<Chain, HashSet<Name>> {
    let vias = seen.contexts().map(|context| context.via());
    let chains = chains_of(vias.map(|v| v.map(|v| (v.parent, v.special.0, v.pass))));
    let mut answer = HashMap::new();
    for (context, chain) in seen.contexts().zip(chains) {
        let of_root = context.of_part(PartId::ROOT);
        let names = of_root.map(|seen| triangles_of(space.sight(PartId::ROOT), &seen));
        answer.insert(chain, names.unwrap_or_default());
    }
    answer
}

fn random_direction(rng: &mut Rng) -> DVec3 {
    loop {
        let v = DVec3::from_array([0, 1, 2].map(|_| rng.range(-1.0, 1.0)));
        if (0.01..1.0).contains(&v.length_squared()) {
            return v.normalize();
        }
    }
}

/// An eye in a room, or within a little of a special portal.
fn random_eye(world: &World, rng: &mut Rng) -> DVec3 {
    if rng.chance(0.4) {
        let id = SpecialId(rng.below(world.graph.specials.len()) as u32);
        let (normal, pieces) = world.graph.special_opening(id);
        let corners = &pieces[0].points;
        let on = corners[0]
            + (corners[1] - corners[0]) * rng.range(0.05, 0.95)
            + (corners[3] - corners[0]) * rng.range(0.05, 0.95);
        return on - normal * [1e-9, 1e-6, 1e-4, 0.02, 0.3][rng.below(5)];
    }
    let cell = &world.graph.cells[rng.below(world.graph.cells.len())];
    let [low, high] = cell.aabb.map(point);
    low + (high - low) * DVec3::from_array([0, 1, 2].map(|_| rng.range(0.02, 0.98)))
}

// Covers W7, W8 and W9.
#[test]
fn views_through_special_portals_hold_everything_that_rays_hit_there() {
    let (mut n_checked, mut n_deep, mut n_stopped) = (0, 0, 0);
    for seed in 0..12 {
        let params = GridParams {
            outdoors: seed % 2 == 0,
            windows: 0.2,
            furniture: 0,
            ..GridParams::offices(2 + seed as usize * 2, seed)
        };
        let world = with_specials(room_grid(&params), 8 + 2 * seed as usize, seed);
        let tracer = Tracer::new(&world);
        let space = Space::new(world.clone()).unwrap();
        let mut viewer = SpaceViewer::new(&space);
        viewer.specials_mut().max_contexts = 600;
        viewer.specials_mut().min_share = 1e-3;
        let mut rng = Rng::new(seed);
        for i in 0..40 {
            let eye = random_eye(&world, &mut rng);
            if tracer.structure.nearest(eye, 1e-4).is_some() {
                continue;
            }
            let eye = eye.as_vec3();
            let (forward, up) = (random_direction(&mut rng), random_direction(&mut rng));
            let (fov, aspect) = (rng.range(0.4, 1.9), rng.range(0.6, 1.8));
            let to_f32 = |v: DVec3| v.as_vec3().to_array();
            let is_around = i % 8 == 0;
            let view = if is_around {
                View::around(eye.to_array())
            } else {
                let (fov, aspect) = (fov as f32, aspect as f32);
                View::perspective(eye.to_array(), to_f32(forward), to_f32(up), fov, aspect)
            };
            let view = view.unwrap();
            let seen = viewer.see(&space, PartId::ROOT, &view);
            let answer = answered(&space, &seen);
            let stopped = !seen.stopped_specials().is_empty();
            let right = point(to_f32(forward)).cross(point(to_f32(up))).normalize();
            let forward = point(to_f32(forward)).normalize();
            let up = right.cross(forward);
            for _ in 0..200 {
                let tan = (f64::from(fov as f32) * 0.5).tan();
                let (x, y) = (rng.range(-0.999, 0.999), rng.range(-0.999, 0.999));
                let mut direction =
                    forward + right * (tan * f64::from(aspect as f32) * x) + up * (tan * y);
                if is_around {
                    direction = random_direction(&mut rng);
                }
                let ray = Ray {
                    origin: eye.as_dvec3(),
                    direction,
                    t_max: f64::INFINITY,
                };
                let mut hits = Vec::new();
                tracer.trace(ray, &mut Vec::new(), 4, &mut hits);
                for (chain, name) in hits {
                    let Some(names) = answer.get(&chain) else {
                        assert!(
                            stopped,
                            "seed {seed}, view {i}: {chain:?} was not looked into"
                        );
                        n_stopped += 1;
                        continue;
                    };
                    assert!(
                        names.contains(&name),
                        "seed {seed}, view {i}: {name:?} in {chain:?} from {eye}"
                    );
                    n_checked += 1;
                    n_deep += usize::from(chain.len() > 1);
                }
            }
        }
    }
    let counts = [n_checked, n_deep, n_stopped];
    assert!(
        n_checked > 50_000 && n_deep > 1_000 && n_stopped * 20 < n_checked,
        "{counts:?}"
    );
}

#[test]
fn contexts_appear_where_their_special_portals_put_them() {
    let world = with_specials(room_grid(&GridParams::two_rooms()), 2, 5);
    let space = Space::new(world.clone()).unwrap();
    let mut viewer = SpaceViewer::new(&space);
    let mut n = 0;
    for (k, side) in world.graph.specials.iter().enumerate() {
        let (normal, pieces) = world.graph.special_opening(SpecialId(k as u32));
        let middle = pieces[0].mean();
        let eye = (middle - normal * 0.7).as_vec3();
        let toward = normal.as_vec3().to_array();
        let view = View::perspective(eye.to_array(), toward, [0.0, 1.0, 0.0], 1.0, 1.0).unwrap();
        let seen = viewer.see(&space, PartId::ROOT, &view);
        let own = seen.contexts().find(|c| {
            c.via()
                .is_some_and(|v| v.parent == 0 && v.special.idx() == k)
        });
        let own = own.expect("one looks straight at it");
        // Things appear at the polygon, where its image is.
        let image = match &side.passes[0].way {
            Way::Lead { map, .. } => map.point(middle),
            _ => middle,
        };
        assert!(own.map().point(image).distance(middle) < 1e-6);
        let distance = own.view().exact_eye().distance(image);
        assert!((distance / 0.7 * own.map().scale.abs() - 1.0).abs() < 1e-5);
        let (n_plane, h) = own.plane().expect("the eye is before it");
        assert!((n_plane.dot(image - own.view().exact_eye()) - h).abs() < 1e-5);
        n += 1;
    }
    assert_eq!(n, 8);
}

#[test]
fn an_eye_in_an_opening_is_on_both_sides_and_looks_back_by_neither() {
    let world = with_specials(room_grid(&GridParams::offices(6, 3)), 4, 9);
    let space = Space::new(world.clone()).unwrap();
    let mut viewer = SpaceViewer::new(&space);
    viewer.specials_mut().min_share = 0.0;
    for id in world.graph.special_ids() {
        let (normal, pieces) = world.graph.special_opening(id);
        let toward = normal.as_vec3().to_array();
        // Behind the plane by about its rounding.
        let eye = pieces[0].mean() + normal * 3.0 * space.sight(PartId::ROOT).tolerance();
        let view = View::perspective(eye.as_vec3().to_array(), toward, [0.0, 1.0, 0.0], 1.0, 1.0);
        let seen = viewer.see(&space, PartId::ROOT, &view.unwrap());
        let chains: Vec<Chain> = answered(&space, &seen).into_keys().collect();
        assert!(chains.contains(&vec![(id.0, 0)]), "{id}");
        for pair in chains.iter().flat_map(|chain| chain.windows(2)) {
            let Way::Lead { back, .. } = &world.graph.specials[pair[0].0 as usize].passes[0].way
            else {
                assert_ne!(pair[0].0, pair[1].0, "a mirror in itself");
                continue;
            };
            assert_ne!(*back, Some(SpecialId(pair[1].0)), "there and straight back");
        }
    }
}

/// W8: an eye in a doorway with panes on both sides meets that of its cell alone, and what comes out there meets none of them.
#[test]
fn an_eye_in_a_doorway_with_two_panes_meets_one_of_them() {
    let mut world = room_grid(&GridParams::offices(6, 3));
    let rooms = |portal: &PortalId| {
        let cells = world.graph[*portal].cells;
        cells.into_iter().all(|cell| !world.graph[cell].outdoor)
    };
    let doorways: Vec<PortalId> = world.graph.portal_ids().filter(rooms).collect();
    for &portal in &doorways {
        for cell in world.graph[portal].cells {
            world.graph.specials.push(SpecialPortal {
                name: String::new(),
                cell,
                shape: SpecialShape::Portal(portal),
                passes: vec![Pass::new(Way::Through), Pass::new(Way::Mirror)],
            });
        }
    }
    let space = Space::new(world.clone()).unwrap();
    let mut viewer = SpaceViewer::new(&space);
    let near = 0.25 * space.sight(PartId::ROOT).tolerance();
    let mut n = 0;
    for id in world.graph.special_ids() {
        let (normal, pieces) = world.graph.special_opening(id);
        let eye = (pieces[0].mean() - normal * near).as_vec3();
        let at = space.locate(PartId::ROOT, eye.as_dvec3());
        let is_in_room = at.is_some_and(|at| at.cell == world.graph.specials[id.idx()].cell);
        // Rounding may move it past the plane.
        if !is_in_room {
            continue;
        }
        n += 1;
        let toward = normal.as_vec3().to_array();
        let view = View::perspective(eye.to_array(), toward, [0.0, 1.0, 0.0], 1.0, 1.0).unwrap();
        let seen = viewer.see(&space, PartId::ROOT, &view);
        let of = |index: usize| -> Vec<SpecialId> {
            let vias = seen.contexts().filter_map(|c| c.via());
            let own = vias.filter(|via| via.parent == index);
            own.map(|via| via.special).collect()
        };
        let portal = |s: SpecialId| match world.graph.specials[s.idx()].shape {
            SpecialShape::Portal(portal) => Some(portal),
            SpecialShape::Surface { .. } => None,
        };
        let in_doorway = |s: &SpecialId| portal(*s) == portal(id);
        assert_eq!(
            of(0).into_iter().filter(in_doorway).collect::<Vec<_>>(),
            [id]
        );
        for index in 1..seen.contexts().len() {
            let via = seen.context(index).via().map(|via| via.special);
            let again = of(index)
                .into_iter()
                .filter(|s| portal(*s) == via.and_then(portal));
            assert_eq!(again.count(), 0, "{id}: context {index}");
        }
    }
    assert!(n > 4, "{n} eyes");
}
