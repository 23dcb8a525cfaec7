//! First hits on segments against brute force, partly shut doors, and draw lists.

use std::collections::BTreeSet;

use enfilade_cpg::{DetailObject, PortalId, World};
use enfilade_geom::ray::hit_triangle;
use enfilade_geom::scene::SourceNode;
use enfilade_geom::{DMat4, DVec3, Ray, Triangle};
use enfilade_runtime::{DetailId, DrawList, Sight, SightState, Sightlines, Target, View, Viewer};
use enfilade_testkit::{GridParams, Rng, room_grid};

fn dvec(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

fn point(rng: &mut Rng, world: &World) -> [f32; 3] {
    let b = &world.graph.cells[rng.below(world.graph.cells.len())].aabb;
    [0, 1, 2].map(|k| b[0][k] + (b[1][k] - b[0][k]) * rng.unit() as f32)
}

/// Rotates, scales, mirrors and flattens objects of a world.
fn placed_anyhow(mut world: World, rng: &mut Rng) -> World {
    let objects: Vec<DetailObject> = world.details.clone();
    for (i, object) in objects.into_iter().enumerate() {
        let old = DMat4::from_cols_array(&object.transform.map(f64::from));
        let scale = match i % 4 {
            0 => DVec3::ONE,
            1 => DVec3::new(-1.0, 2.0, 0.5),
            2 => DVec3::new(0.3, 1.7, 1.0),
            _ => DVec3::new(1.0, 0.0, 1.0),
        };
        let turn = DMat4::from_rotation_y(rng.range(0.0, 6.0)) * DMat4::from_scale(scale);
        world.details[i].transform = (old * turn).as_mat4().to_cols_array();
    }
    world
}

/// Returns every hit of a segment by brute force: `t` and target.
fn brute(
    world: &World,
    state: &SightState,
    cuts: &[(PortalId, [f32; 3], [f32; 3])],
    ray: &Ray,
) -> Vec<(f64, Target)> {
    let mut hits = Vec::new();
    let mut add = |t: &Triangle, target: Target| {
        if let Some(h) = hit_triangle(ray, t) {
            hits.push((h.t, target));
        }
    };
    for (batch, b) in (0..).zip(&world.batches) {
        for (triangle, t) in (0..).zip(b.primitive.triangles()) {
            add(&t, Target::Wall { batch, triangle });
        }
    }
    for (d, object) in (0..).zip(&world.details) {
        let m = DMat4::from_cols_array(&object.transform.map(f64::from));
        let mesh = &world.detail_meshes[object.mesh as usize];
        for (primitive, p) in (0..).zip(&mesh.primitives) {
            for (triangle, i) in (0..).zip(p.indices.chunks_exact(3)) {
                let corner = |k: usize| m.transform_point3(dvec(p.positions[i[k] as usize]));
                let detail = DetailId(d);
                let target = Target::Detail {
                    detail,
                    primitive,
                    triangle,
                };
                add(&[0, 1, 2].map(corner), target);
            }
        }
    }
    for id in world.graph.portal_ids() {
        for piece in &world.graph[id].pieces {
            for k in 1..piece.len() - 1 {
                let t = [piece[0], piece[k], piece[k + 1]].map(dvec);
                let Some(h) = hit_triangle(ray, &t) else {
                    continue;
                };
                let is_out = |&(portal, normal, through): &(PortalId, [f32; 3], [f32; 3])| {
                    portal == id && dvec(normal).dot(ray.at(h.t) - dvec(through)) < 0.0
                };
                if !state.is_open(id) || cuts.iter().any(is_out) {
                    add(&t, Target::Portal(id));
                }
            }
        }
    }
    hits.sort_by(|a, b| a.0.total_cmp(&b.0));
    hits
}

#[test]
fn picks_equal_brute_force() {
    let mut rng = Rng::new(5);
    let [mut n_walls, mut n_details, mut n_portals, mut n_none] = [0; 4];
    for seed in 0..4_u32 {
        let world = placed_anyhow(
            room_grid(&GridParams {
                turn: f64::from(seed) * 0.4,
                furniture: 3,
                holes: 0.3,
                ..GridParams::offices(12, u64::from(seed))
            }),
            &mut rng,
        );
        let sight = Sight::build(&world).unwrap();
        let lines = Sightlines::build(&world);
        let mut state = SightState::new(&sight);
        let mut cuts = Vec::new();
        for id in world.graph.portal_ids() {
            match rng.below(3) {
                0 => state.close(id),
                1 => {
                    let outline = &world.graph[id].outline;
                    let normal = [0, 1, 2].map(|k| outline[1][k] - outline[0][k]);
                    let through = world.graph[id].center();
                    state.narrow(id, normal, through);
                    cuts.push((id, normal, through));
                }
                _ => {}
            }
        }
        for i in 0..3_000 {
            let (a, mut b) = (point(&mut rng, &world), point(&mut rng, &world));
            if i % 3 == 0 {
                b = [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * 0.1);
            }
            let ray = Ray::segment(dvec(a), dvec(b));
            let truth = brute(&world, &state, &cuts, &ray);
            let hit = lines.pick(&state, a, b).unwrap();
            // Any target at the same distance up to rounding is right.
            let first = truth.first().map_or(2.0, |h| h.0);
            let near = 1e-6;
            match hit {
                None => {
                    assert!(truth.is_empty(), "{a:?} {b:?} {truth:?}");
                    n_none += 1;
                }
                Some(hit) => {
                    let fits = |h: &(f64, Target)| {
                        h.0 <= first + near && h.1 == hit.target && (h.0 - hit.t).abs() < near
                    };
                    assert!(truth.iter().any(fits), "{a:?} {b:?} {hit:?} {truth:?}");
                    assert!(dvec(hit.position).distance(ray.at(hit.t)) < 1e-4);
                    assert!((dvec(hit.normal).length() - 1.0).abs() < 1e-5);
                    assert!(dvec(hit.normal).dot(ray.direction) <= 1e-6);
                    match hit.target {
                        Target::Wall { .. } => n_walls += 1,
                        Target::Detail { .. } => n_details += 1,
                        Target::Portal(_) => n_portals += 1,
                    }
                }
            }
            let is_matter = |h: &(f64, Target)| !matches!(h.1, Target::Detail { .. });
            assert_eq!(lines.is_clear(&state, a, b), !truth.iter().any(is_matter));
        }
    }
    // Guard against a vacuous comparison.
    let counts = [n_walls, n_details, n_portals, n_none];
    assert!(counts.iter().all(|&n| n > 300), "{counts:?}");
}

#[test]
fn a_hit_reports_its_source_object() {
    let mut world = room_grid(&GridParams {
        furniture: 6,
        ..GridParams::offices(4, 3)
    });
    // One source per structural triangle, and one per detail after them.
    let mut n = 0;
    for batch in &mut world.batches {
        for _ in 0..batch.primitive.indices.len() / 3 {
            batch.sources.push(n, 1);
            n += 1;
        }
    }
    let n_walls = n;
    for detail in &mut world.details {
        detail.source = Some(n);
        n += 1;
    }
    let named = |i: u32| SourceNode {
        name: i.to_string(),
        ..SourceNode::default()
    };
    world.sources = (0..n).map(named).collect();
    let lines = Sightlines::build(&world);
    let state = SightState::new(&Sight::build(&world).unwrap());
    let mut rng = Rng::new(1);
    let mut counts = [0, 0];
    for _ in 0..1_000 {
        let (a, b) = (point(&mut rng, &world), point(&mut rng, &world));
        let Some(hit) = lines.pick(&state, a, b).unwrap() else {
            continue;
        };
        let source = hit.target.source(&world).unwrap();
        match hit.target {
            Target::Wall { batch, triangle } => {
                let before = world.batches[..batch as usize].iter();
                let before: usize = before.map(|b| b.primitive.indices.len() / 3).sum();
                assert_eq!(source, before as u32 + triangle);
                counts[0] += 1;
            }
            Target::Detail { detail, .. } => {
                assert_eq!(source, n_walls + detail.0);
                counts[1] += 1;
            }
            Target::Portal(_) => unreachable!("all are open"),
        }
    }
    assert!(counts.iter().all(|&n| n > 50), "{counts:?}");
}

#[test]
fn objects_can_be_passed_by() {
    let world = room_grid(&GridParams {
        furniture: 6,
        ..GridParams::offices(4, 3)
    });
    let lines = Sightlines::build(&world);
    let state = SightState::new(&Sight::build(&world).unwrap());
    let mut rng = Rng::new(1);
    let mut n = 0;
    for _ in 0..2_000 {
        let (a, b) = (point(&mut rng, &world), point(&mut rng, &world));
        let Some(hit) = lines.pick(&state, a, b).unwrap() else {
            continue;
        };
        let Target::Detail { detail, .. } = hit.target else {
            continue;
        };
        let next = lines.pick_where(&state, a, b, |d| d != detail).unwrap();
        assert!(next.is_none_or(|h| {
            h.t >= hit.t && !matches!(h.target, Target::Detail { detail: d, .. } if d == detail)
        }));
        n += 1;
    }
    assert!(n > 100, "{n}");
}

#[test]
fn points_that_are_not_finite_are_errors_and_not_clear() {
    let world = room_grid(&GridParams::offices(4, 1));
    let lines = Sightlines::build(&world);
    let state = SightState::new(&Sight::build(&world).unwrap());
    let good = [1.0, 1.0, 1.0];
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for k in 0..3 {
            let mut p = good;
            p[k] = bad;
            for (a, b) in [(p, good), (good, p), (p, p)] {
                let error = lines.pick(&state, a, b).unwrap_err();
                assert!(error.to_string().contains("not finite"));
                assert!(!lines.is_clear(&state, a, b));
            }
        }
    }
    assert!(lines.is_clear(&state, good, good));
    assert_eq!(lines.pick(&state, good, good), Ok(None));
    // Far away, but finite.
    let far = [f32::MAX, 1.0, 1.0];
    assert!(lines.pick(&state, good, far).is_ok());
}

#[test]
fn a_draw_list_draws_each_visible_chunk_once_in_few_ranges() {
    let world = room_grid(&GridParams::offices(60, 2));
    let sight = Sight::build(&world).unwrap();
    let state = SightState::new(&sight);
    let (mut viewer, mut list) = (Viewer::new(&sight), DrawList::new());
    let mut rng = Rng::new(4);
    let mut is_shorter = false;
    for _ in 0..200 {
        let (eye, to) = (point(&mut rng, &world), point(&mut rng, &world));
        let toward = [0, 1, 2].map(|k| to[k] - eye[k]);
        let view = View::perspective(eye, toward, [0.0, 1.0, 0.0], 1.2, 1.5).unwrap();
        let seen = viewer.see(&sight, &state, &view);
        list.fill(&sight, &seen);
        let triangle = |batch: u32, i: u32| (batch, i);
        let mut wanted = BTreeSet::new();
        let mut order = Vec::new();
        for &id in seen.chunks() {
            let c = sight[id];
            if !order.contains(&c.batch) {
                order.push(c.batch);
            }
            wanted
                .extend((c.first_index..c.first_index + c.n_indices).map(|i| triangle(c.batch, i)));
        }
        let mut drawn = BTreeSet::new();
        for d in &list {
            assert_eq!(d.indices(&sight).len(), d.n_indices as usize);
            assert!(d.batch(&world).primitive.indices.len() >= d.n_indices as usize);
            for i in d.first_index..d.first_index + d.n_indices {
                assert!(drawn.insert(triangle(d.batch, i)), "drawn twice");
            }
        }
        assert_eq!(drawn, wanted);
        assert_eq!(list.n_triangles(), wanted.len() as u64 / 3);
        // Near to far, each batch in one go; no two ranges of a batch touch.
        let mut batches: Vec<u32> = list.draws().iter().map(|d| d.batch).collect();
        batches.dedup();
        assert_eq!(batches, order);
        for pair in list.draws().windows(2) {
            let end = pair[0].first_index + pair[0].n_indices;
            assert!(pair[0].batch != pair[1].batch || end < pair[1].first_index);
        }
        is_shorter |= list.draws().len() < seen.chunks().len();
    }
    assert!(is_shorter);
}
