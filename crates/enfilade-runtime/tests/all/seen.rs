//! The answer contains everything that rays hit, on worlds that are exact by construction.

use std::collections::{BTreeSet, HashMap};

use enfilade_cpg::{CellId, World};
use enfilade_geom::{Bvh, DMat4, DVec3, Ray, Triangle};
use enfilade_runtime::{Narrowing, SeeOptions, Seen, Sight, SightState, View, Viewer};
use enfilade_testkit::{GridParams, Rng, courtyard, room_grid};
use proptest::prelude::*;

/// A world with all its triangles: structural ones by batch, then those of details.
struct Truth {
    world: World,
    structure: Bvh,
    /// Batch and vertices of each structural triangle.
    source: Vec<(u32, [u32; 3])>,
    details: Bvh,
    detail_of: Vec<u32>,
}

fn to_dvec(p: [f32; 3]) -> DVec3 {
    DVec3::new(p[0].into(), p[1].into(), p[2].into())
}

impl Truth {
    fn new(world: World) -> Self {
        let (mut triangles, mut source): (Vec<Triangle>, _) = (Vec::new(), Vec::new());
        for (b, batch) in world.batches.iter().enumerate() {
            source.extend(batch.primitive.triples().iter().map(|t| (b as u32, *t)));
            triangles.extend(batch.primitive.triangles());
        }
        let (mut movable, mut detail_of): (Vec<Triangle>, _) = (Vec::new(), Vec::new());
        for (d, detail) in world.details.iter().enumerate() {
            let m = DMat4::from_cols_array(&detail.transform.map(f64::from));
            for p in &world.detail_meshes[detail.mesh as usize].primitives {
                movable.extend(p.placed_triangles(m));
                detail_of.resize(movable.len(), d as u32);
            }
        }
        Self {
            structure: Bvh::build(&triangles),
            details: Bvh::build(&movable),
            world,
            source,
            detail_of,
        }
    }

    /// Returns all targets that rays in the view hit: triangles by batch and vertices, and details.
    fn hit(&self, rng: &mut Rng, view: &Camera, n: usize) -> Vec<Hit> {
        let mut out = Vec::new();
        for _ in 0..n {
            let mut ray = Ray {
                origin: to_dvec(view.eye),
                direction: view.direction(rng),
                t_max: f64::INFINITY,
            };
            if let Some(hit) = self.structure.closest_hit(&ray, |_| false) {
                ray.t_max = hit.t;
                out.push(Hit::Triangle(self.source[hit.triangle as usize]));
            }
            self.details.for_each_hit(&ray, |h| {
                out.push(Hit::Detail(self.detail_of[h.triangle as usize]));
            });
        }
        out
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Hit {
    Triangle((u32, [u32; 3])),
    Detail(u32),
}

/// A camera for both the runtime and the rays.
#[derive(Clone, Copy, Debug)]
struct Camera {
    eye: [f32; 3],
    toward: [f32; 3],
    up: [f32; 3],
    fov_y: f32,
    aspect: f32,
}

impl Camera {
    fn random(rng: &mut Rng, eye: DVec3) -> Self {
        let mut direction = || {
            let z = rng.range(-1.0, 1.0);
            let phi = rng.range(0.0, std::f64::consts::TAU);
            let r = (1.0 - z * z).sqrt();
            [(r * phi.cos()) as f32, (r * phi.sin()) as f32, z as f32]
        };
        Self {
            eye: eye.as_vec3().to_array(),
            toward: direction(),
            up: direction(),
            fov_y: rng.range(0.1, 2.2) as f32,
            aspect: rng.range(0.5, 2.0) as f32,
        }
    }

    fn view(&self) -> View {
        View::perspective(self.eye, self.toward, self.up, self.fov_y, self.aspect).unwrap()
    }

    fn direction(&self, rng: &mut Rng) -> DVec3 {
        let forward = to_dvec(self.toward).normalize();
        let right = forward.cross(to_dvec(self.up)).normalize();
        let up = right.cross(forward);
        let tan = (f64::from(self.fov_y) * 0.5).tan();
        let (x, y) = (rng.range(-0.9999, 0.9999), rng.range(-0.9999, 0.9999));
        forward + right * (tan * f64::from(self.aspect) * x) + up * (tan * y)
    }
}

fn answered(sight: &Sight, seen: &Seen<'_>) -> HashMap<Hit, ()> {
    let mut out = HashMap::new();
    for c in seen.chunks() {
        let chunk = sight.chunks()[c.0 as usize];
        let first = chunk.first_index as usize;
        let indices = &sight.indices(chunk.batch)[first..first + chunk.n_indices as usize];
        for t in indices.chunks_exact(3) {
            out.insert(Hit::Triangle((chunk.batch, [t[0], t[1], t[2]])), ());
        }
    }
    for d in seen.details() {
        out.insert(Hit::Detail(d.0), ());
    }
    out
}

fn eye_in(world: &World, rng: &mut Rng, i: usize) -> DVec3 {
    let portals = &world.graph.portals;
    if i.is_multiple_of(3) && !portals.is_empty() {
        // In a doorway: on its plane, up to `f32` rounding, or near it.
        let p = &portals[rng.below(portals.len())];
        let (a, b, c) = (
            to_dvec(p.outline[0]),
            to_dvec(p.outline[1]),
            to_dvec(p.outline[3]),
        );
        let on = a + (b - a) * rng.range(0.05, 0.95) + (c - a) * rng.range(0.05, 0.95);
        let away = [0.0, 1e-6, 1e-4, 0.02, 0.3][rng.below(5)];
        return on + to_dvec(p.normal) * away * rng.range(-1.0, 1.0);
    }
    let all = &world.graph.cells[rng.below(world.graph.cells.len())].aabb;
    let (low, high) = (to_dvec(all[0]), to_dvec(all[1]));
    low + (high - low) * DVec3::new(rng.unit(), rng.unit(), rng.unit())
}

const MODES: [Narrowing; 4] = [
    Narrowing::Polygon,
    Narrowing::PolygonOf(8),
    Narrowing::PolygonOf(3),
    Narrowing::Rectangle,
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    // Covers R1, R2 and R3.
    #[test]
    fn every_ray_hit_is_in_the_answer_in_every_mode(
        seed in 0_u64..1 << 32, rooms in 2_usize..160, merges in 0.0_f64..0.5,
        turn in prop_oneof![Just(0.0), 0.1_f64..3.0], outdoors: bool, max_clips in prop_oneof![Just(20_000_u32), 1_u32..20],
    ) {
        let params = GridParams { merges, turn, outdoors, holes: 0.3, ..GridParams::offices(rooms, seed) };
        let truth = Truth::new(room_grid(&params));
        let sight = Sight::build(&truth.world).unwrap();
        let state = SightState::new(&sight);
        let mut rng = Rng::new(seed);
        let mut viewers = MODES.map(|narrowing| {
            Viewer::with_options(&sight, SeeOptions { narrowing, max_clips, ..SeeOptions::default() })
        });
        for i in 0..24 {
            let eye = eye_in(&truth.world, &mut rng, i);
            if truth.structure.nearest(eye, 1e-4).is_some() {
                continue; // In a wall: which side is a rounding.
            }
            let camera = Camera::random(&mut rng, eye);
            let hits = truth.hit(&mut rng, &camera, 60);
            for (viewer, mode) in viewers.iter_mut().zip(MODES) {
                let seen = viewer.see(&sight, &state, &camera.view());
                let answer = answered(&sight, &seen);
                for hit in &hits {
                    prop_assert!(answer.contains_key(hit), "{mode:?} {camera:?} {hit:?}");
                }
                for (d, detail) in truth.world.details.iter().enumerate() {
                    // Moving objects: `sees_box` must not lose anything that the lists hold.
                    let m = DMat4::from_cols_array(&detail.transform.map(f64::from));
                    let corners = (0..8).map(|c| {
                        m.transform_point3(DVec3::from([0, 1, 2].map(|k| f64::from(c >> k & 1))))
                    });
                    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
                    for p in corners {
                        (low, high) = (low.min(p), high.max(p));
                    }
                    let aabb = [low, high].map(|p| p.as_vec3().to_array());
                    if hits.contains(&Hit::Detail(d as u32)) {
                        prop_assert!(seen.sees_box(&detail.cells, aabb));
                    } else if !answer.contains_key(&Hit::Detail(d as u32)) {
                        let shadowed = seen.counts().shadowed > 0;
                        let grown = truth.world.graph.cells.len() > 1 && seen.sees_box(&detail.cells, aabb);
                        // Boxes in the tree are grown by the tolerance; these are not.
                        prop_assert!(shadowed || !grown);
                    }
                }
                let cells: BTreeSet<CellId> = seen.cells().iter().copied().collect();
                prop_assert_eq!(cells.len(), seen.cells().len(), "a cell twice");
                let chunks: BTreeSet<_> = seen.chunks().iter().collect();
                prop_assert_eq!(chunks.len(), seen.chunks().len(), "a chunk twice");
                let details: BTreeSet<_> = seen.details().iter().collect();
                prop_assert_eq!(details.len(), seen.details().len(), "a detail twice");
                if !seen.counts().is_capped {
                    prop_assert!(seen.visits().is_sorted_by(|a, b| a.depth <= b.depth), "near to far");
                }
            }
        }
    }

    #[test]
    fn a_view_all_around_contains_any_other_view(seed in 0_u64..1 << 32) {
        let world = room_grid(&GridParams { merges: 0.2, ..GridParams::offices(60, seed) });
        let sight = Sight::build(&world).unwrap();
        let state = SightState::new(&sight);
        let (mut one, mut all) = (Viewer::new(&sight), Viewer::new(&sight));
        let mut rng = Rng::new(seed);
        for i in 0..8 {
            let eye = eye_in(&world, &mut rng, i);
            let camera = Camera::random(&mut rng, eye);
            let around = all.see(&sight, &state, &View::around(camera.eye).unwrap());
            let truth = Truth::new(world.clone());
            if truth.structure.nearest(eye, 1e-4).is_some() { continue; }
            let hits = truth.hit(&mut rng, &camera, 60);
            let answer = answered(&sight, &around);
            prop_assert!(hits.iter().all(|h| answer.contains_key(h)));
            prop_assert!(one.see(&sight, &state, &camera.view()).visits().iter().all(|v| v.face == 0));
        }
    }
}

/// Where nothing is joined, a tighter region sees less. (Which visits are joined depends on which wait together, and so
/// on their order: in general only sums can be compared; see `docs/benchmarks/sight.md`.)
// Covers R2.
#[test]
fn polygons_answer_no_more_than_rectangles() {
    let (mut polygon, mut rectangle, mut joined) = (0, 0, 0);
    for seed in 0..40 {
        let world = room_grid(&GridParams {
            turn: 0.7,
            ..GridParams::offices(100, seed)
        });
        let sight = Sight::build(&world).unwrap();
        let state = SightState::new(&sight);
        let viewer = |narrowing| {
            Viewer::with_options(
                &sight,
                SeeOptions {
                    narrowing,
                    ..SeeOptions::default()
                },
            )
        };
        let (mut by_polygon, mut by_rectangle) =
            (viewer(Narrowing::Polygon), viewer(Narrowing::Rectangle));
        let mut rng = Rng::new(seed);
        for i in 0..40 {
            let eye = eye_in(&world, &mut rng, i);
            let view = Camera::random(&mut rng, eye).view();
            let a = by_polygon.see(&sight, &state, &view);
            let b = by_rectangle.see(&sight, &state, &view);
            polygon += a.n_triangles();
            rectangle += b.n_triangles();
            if a.counts().spared + b.counts().spared > 0 {
                joined += 1;
                continue;
            }
            let wide: BTreeSet<CellId> = b.cells().iter().copied().collect();
            assert!(
                a.cells().iter().all(|c| wide.contains(c)),
                "seed {seed}, view {i}"
            );
            let wide = answered(&sight, &b);
            assert!(answered(&sight, &a).keys().all(|h| wide.contains_key(h)));
        }
    }
    assert!(polygon < rectangle, "{polygon} {rectangle}");
    assert!(
        joined < 1200,
        "most views must have been compared: {joined}"
    );
}

// Covers R4.
#[test]
fn a_courtyard_of_64_windows_is_bounded() {
    for one_room in [false, true] {
        let world = courtyard(16, one_room);
        let sight = Sight::build(&world).unwrap();
        let state = SightState::new(&sight);
        let mut viewer = Viewer::new(&sight);
        let n_exits = 2 * world.graph.portals.len() as u32;
        let mut rng = Rng::new(5);
        for i in 0..2000 {
            let eye = eye_in(&world, &mut rng, i);
            let view = Camera::random(&mut rng, eye).view();
            let seen = viewer.see(&sight, &state, &view);
            if seen.counts().is_eye_lost {
                continue;
            }
            // The bound proved in `see.rs`.
            assert!(seen.visits().len() <= 16 * world.graph.cells.len());
            assert!(seen.counts().clips <= 16 * n_exits);
            // The measured number stays far below it: in a ring of one room, the start and the court.
            let most = if one_room { 20 } else { 300 };
            assert!(seen.visits().len() <= most, "{}", seen.visits().len());
        }
    }
}

#[test]
fn closed_portals_locked_cells_and_doors_ajar() {
    let world = room_grid(&GridParams {
        size: [2, 1, 1],
        doors: 1.0,
        windows: 0.0,
        outdoors: false,
        ..GridParams::offices(2, 1)
    });
    let sight = Sight::build(&world).unwrap();
    let mut state = SightState::new(&sight);
    let mut viewer = Viewer::new(&sight);
    let portal = &world.graph.portals[0];
    let corner = to_dvec(portal.outline[0]);
    let middle = portal.outline.iter().map(|&p| to_dvec(p)).sum::<DVec3>() / 4.0;
    let eye = middle - DVec3::X * 1.5;
    let see = |state: &SightState, viewer: &mut Viewer, at: DVec3, toward: DVec3| -> Vec<u32> {
        let view = View::perspective(
            at.as_vec3().to_array(),
            toward.as_vec3().to_array(),
            [0.0, 1.0, 0.0],
            1.2,
            1.5,
        )
        .unwrap();
        viewer
            .see(&sight, state, &view)
            .cells()
            .iter()
            .map(|c| c.0)
            .collect()
    };
    assert_eq!(see(&state, &mut viewer, eye, DVec3::X), [0, 1]);
    assert_eq!(see(&state, &mut viewer, eye, -DVec3::X), [0]);
    state.close(enfilade_cpg::PortalId(0));
    assert_eq!(see(&state, &mut viewer, eye, DVec3::X), [0]);
    state.open(enfilade_cpg::PortalId(0));
    state.lock(CellId(1), true);
    assert_eq!(see(&state, &mut viewer, eye, DVec3::X), [0]);
    state.lock(CellId(1), false);

    // A sliding door, open by a tenth at the side of the first vertex.
    let along = (to_dvec(portal.outline[2]) - corner) * DVec3::Z;
    let edge = corner + along * 0.1;
    let (normal, through) = ((-along).as_vec3().to_array(), edge.as_vec3().to_array());
    state.narrow(enfilade_cpg::PortalId(0), normal, through);
    assert_eq!(see(&state, &mut viewer, eye, DVec3::X), [0, 1]);
    let gap = corner + along * 0.05 - eye;
    let narrow = |at: DVec3| {
        View::perspective(
            eye.as_vec3().to_array(),
            at.as_vec3().to_array(),
            [0.0, 1.0, 0.0],
            0.02,
            1.0,
        )
        .unwrap()
    };
    let n = |viewer: &mut Viewer, view| viewer.see(&sight, &state, &view).cells().len();
    assert_eq!(
        n(&mut viewer, narrow(DVec3::new(gap.x, 0.0, gap.z))),
        2,
        "through the gap"
    );
    assert_eq!(n(&mut viewer, narrow(DVec3::X)), 1, "at the leaf");

    // On the plane: in the opening both rooms are seen, whatever the view direction.
    for away in [0.0, 1e-7, -1e-7] {
        state.open(enfilade_cpg::PortalId(0));
        let at = middle + DVec3::X * away;
        for toward in [DVec3::X, -DVec3::X, DVec3::Z] {
            let mut cells = see(&state, &mut viewer, at, toward);
            cells.sort_unstable();
            assert_eq!(cells, [0, 1]);
        }
    }
}

#[test]
fn an_eye_in_no_cell_sees_every_cell_and_each_object_once() {
    let world = room_grid(&GridParams {
        outdoors: false,
        ..GridParams::offices(30, 4)
    });
    assert!(!world.details.is_empty());
    let sight = Sight::build(&world).unwrap();
    let state = SightState::new(&sight);
    let mut viewer = Viewer::new(&sight);
    let middle = to_dvec(world.graph.cells[0].aabb[0]) + DVec3::splat(0.5);
    for (eye, is_lost) in [
        ([-500.0, 1.0, -500.0], true),
        (middle.as_vec3().to_array(), false),
    ] {
        let seen = viewer.see(&sight, &state, &View::around(eye).unwrap());
        assert_eq!(seen.counts().is_eye_lost, is_lost);
        let details: BTreeSet<_> = seen.details().iter().map(|d| d.0).collect();
        assert_eq!(details.len(), seen.details().len(), "an object came twice");
        if is_lost {
            assert_eq!(seen.cells().len(), world.graph.cells.len());
            assert_eq!(details.len(), world.details.len());
        }
    }
}

/// A viewer answers one view after another: an occluder of one must not affect the next.
#[test]
fn an_eye_in_no_cell_sees_unlisted_triangles_after_any_query() {
    let mut world = courtyard(8, true);
    let middle = DVec3::new(15.0, 1.5, 15.0);
    let away: Vec<DVec3> = (0..16)
        .map(|k| f64::from(k) * std::f64::consts::TAU / 16.0)
        .map(|angle| DVec3::new(angle.cos(), 0.0, angle.sin()))
        .collect();
    // A wall across the room on one side of the yard, which casts a shadow there.
    let mut wall = world.batches[0].clone();
    wall.cells = vec![CellId(1)];
    wall.primitive = enfilade_geom::scene::Primitive {
        positions: [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]]
            .map(|[x, y]| [x, y, 10.0])
            .to_vec(),
        indices: vec![0, 1, 2, 0, 2, 3],
        ..Default::default()
    };
    world.batches.push(wall);
    let first = world.batches.len() as u32;
    for d in &away {
        let mut batch = world.batches[0].clone();
        batch.cells.clear();
        let corner = |x: f64, y: f64| {
            let p = middle + *d * 1000.0 + DVec3::new(-d.z * x, y, d.x * x);
            p.as_vec3().to_array()
        };
        batch.primitive = enfilade_geom::scene::Primitive {
            positions: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(0.0, 1.0)],
            indices: vec![0, 1, 2],
            ..Default::default()
        };
        world.batches.push(batch);
    }
    let sight = Sight::build(&world).unwrap();
    let state = SightState::new(&sight);
    let mut viewer = Viewer::new(&sight);
    let mut rng = Rng::new(3);
    let view = |eye: DVec3, toward: DVec3| {
        let [eye, toward] = [eye, toward].map(|v| v.as_vec3().to_array());
        View::perspective(eye, toward, [0.0, 1.0, 0.0], 0.5, 1.0).unwrap()
    };
    for _ in 0..200 {
        let inside = DVec3::new(
            rng.range(0.2, 2.8),
            rng.range(0.2, 2.8),
            rng.range(0.2, 29.0),
        );
        for (k, d) in away.iter().enumerate() {
            viewer.see(&sight, &state, &view(inside, *d));
            let seen = viewer.see(&sight, &state, &view(middle + *d * 900.0, *d));
            assert!(seen.counts().is_eye_lost);
            let wanted = first + k as u32;
            let found = seen
                .chunks()
                .iter()
                .any(|c| sight.chunks()[c.0 as usize].batch == wanted);
            assert!(found, "triangle {k} after a view from {inside}");
        }
    }
}

#[test]
fn a_closed_door_is_shut_whatever_the_pose_of_its_leaf() {
    let world = room_grid(&GridParams::offices(9, 1));
    let sight = Sight::build(&world).unwrap();
    let mut state = SightState::new(&sight);
    let door = enfilade_cpg::PortalId(0);
    for _ in 0..9 {
        state.narrow(door, [1.0, 0.0, 0.0], [0.0; 3]);
        assert!(state.is_open(door));
    }
    state.close(door);
    state.narrow(door, [0.0, 0.0, 1.0], [0.0; 3]);
    assert!(!state.is_open(door));
    state.open(door);
    assert!(state.is_open(door));
}

#[test]
fn empty_and_hostile_worlds() {
    let sight = Sight::build(&World::default()).unwrap();
    let view = View::around([0.0; 3]).unwrap();
    let mut viewer = Viewer::new(&sight);
    let seen = viewer.see(&sight, &SightState::new(&sight), &view);
    assert!(seen.cells().is_empty() && seen.counts().is_eye_lost);

    let world = room_grid(&GridParams {
        doors: 0.0,
        windows: 0.0,
        holes: 0.0,
        ..GridParams::offices(9, 1)
    });
    assert!(world.graph.portals.is_empty());
    let sight = Sight::build(&world).unwrap();
    let mut viewer = Viewer::new(&sight);
    let view = View::around([1.0, 1.0, 1.0]).unwrap();
    let seen = viewer.see(&sight, &SightState::new(&sight), &view);
    assert_eq!(seen.cells(), [CellId(0)]);

    let good = room_grid(&GridParams::offices(9, 1));
    let broken = |change: &dyn Fn(&mut World)| {
        let mut world = good.clone();
        change(&mut world);
        Sight::build(&world).map(|_| ()).unwrap_err().to_string()
    };
    let itself = broken(&|w| w.graph.portals[0].cells = [CellId(1); 2]);
    assert!(itself.contains("portal 0"), "{itself}");
    broken(&|w| w.graph.portals[1].cells[1] = CellId(99));
    for n in 0..3 {
        broken(&|w| w.graph.portals[0].outline.truncate(n));
    }
    broken(&|w| w.graph.portals[0].outline[2][1] = f32::NAN);
    broken(&|w| w.graph.portals[0].normal = [0.0; 3]);
    broken(&|w| w.batches[0].primitive.positions[0][0] = f32::INFINITY);
    broken(&|w| w.batches[0].primitive.indices[0] = 9999);
    broken(&|w| w.batches[0].cells = vec![CellId(999)]);
    broken(&|w| w.details[0].mesh = 7);
    broken(&|w| w.details[0].transform[0] = f32::NAN);
}

/// An outline of very many vertices is reduced outwards and loses nothing.
#[test]
fn a_round_window_of_a_thousand_vertices() {
    let mut world = room_grid(&GridParams {
        size: [2, 1, 1],
        doors: 1.0,
        outdoors: false,
        furniture: 0,
        ..GridParams::offices(2, 1)
    });
    let portal = &mut world.graph.portals[0];
    let middle = portal.outline.iter().map(|&p| to_dvec(p)).sum::<DVec3>() / 4.0;
    let ring: Vec<[f32; 3]> = (0..1000)
        .map(|i| {
            let (s, c) = (f64::from(i) * std::f64::consts::TAU / 1000.0).sin_cos();
            (middle + 0.3 * DVec3::new(0.0, c, s)).as_vec3().to_array()
        })
        .collect();
    portal.outline.clone_from(&ring);
    portal.pieces = vec![ring.clone()];
    let sight = Sight::build(&world).unwrap();
    let mut viewer = Viewer::with_options(
        &sight,
        SeeOptions {
            narrowing: Narrowing::Polygon,
            ..SeeOptions::default()
        },
    );
    let state = SightState::new(&sight);
    let eye = middle - DVec3::X;
    for p in &ring {
        // Just inside the rim, through a very narrow view.
        let toward = middle + (to_dvec(*p) - middle) * 0.999 - eye;
        let view = View::perspective(
            eye.as_vec3().to_array(),
            toward.as_vec3().to_array(),
            [0.0, 1.0, 0.0],
            1e-4,
            1.0,
        )
        .unwrap();
        assert_eq!(viewer.see(&sight, &state, &view).cells().len(), 2);
        let toward = middle + (to_dvec(*p) - middle) * 1.1 - eye;
        let view = View::perspective(
            eye.as_vec3().to_array(),
            toward.as_vec3().to_array(),
            [0.0, 1.0, 0.0],
            1e-4,
            1.0,
        )
        .unwrap();
        assert_eq!(viewer.see(&sight, &state, &view).cells().len(), 1);
    }
}

// Covers R7.
#[test]
fn portals_of_a_small_share_are_listed_and_not_followed() {
    let world = room_grid(&GridParams::offices(100, 3));
    let sight = Sight::build(&world).unwrap();
    let state = SightState::new(&sight);
    let (mut whole, mut stopping) = (Viewer::new(&sight), Viewer::new(&sight));
    let mut rng = Rng::new(3);
    let (mut n_stopped, mut n_spared) = (0, 0);
    for i in 0..60 {
        let eye = eye_in(&world, &mut rng, i);
        let view = Camera::random(&mut rng, eye).view();
        stopping.options_mut().min_share = 0.0;
        assert!(stopping.see(&sight, &state, &view).stopped().is_empty());
        stopping.options_mut().min_share = 0.02;
        let all = whole.see(&sight, &state, &view);
        let some = stopping.see(&sight, &state, &view);
        let cells: BTreeSet<CellId> = all.cells().iter().copied().collect();
        assert!(some.cells().iter().all(|c| cells.contains(c)), "view {i}");
        // Everything visible is seen, or lies behind a listed portal.
        let behind: BTreeSet<CellId> = some.stopped().iter().map(|s| s.1).collect();
        assert!(some.cells().len() == cells.len() || !behind.is_empty());
        for &(portal, cell) in some.stopped() {
            assert!(world.graph[portal].cells.contains(&cell));
            assert!(all.portals().contains(&portal), "view {i}");
        }
        // No visit is smaller.
        for v in some.visits().iter().filter(|v| v.via.is_some()) {
            let [l, b, r, t] = v.rectangle;
            assert!((r - l) * (t - b) * 0.25 >= 0.02 * 0.999, "view {i}: {v:?}");
        }
        n_stopped += some.stopped().len();
        n_spared += cells.len() - some.cells().len();
    }
    assert!(n_stopped > 10 && n_spared > 10, "{n_stopped} {n_spared}");
}

// Covers R7.
#[test]
fn a_view_ends_at_stops_and_goes_on_through_those_passed() {
    let world = room_grid(&GridParams::offices(30, 5));
    let sight = Sight::build(&world).unwrap();
    let state = SightState::new(&sight);
    let mut viewer = Viewer::new(&sight);
    let mut rng = Rng::new(8);
    let mut n_passed = 0;
    for i in 0..40 {
        let eye = eye_in(&world, &mut rng, i).as_vec3().to_array();
        let view = View::around(eye).unwrap();
        let all: BTreeSet<CellId> = viewer
            .see(&sight, &state, &view)
            .cells()
            .iter()
            .copied()
            .collect();
        // Nothing is nearer than 0, but for portals around the eye.
        viewer.stops_mut().beyond = 0.0;
        let seen = viewer.see(&sight, &state, &view);
        let few: BTreeSet<CellId> = seen.cells().iter().copied().collect();
        let stopped = seen.stopped().to_vec();
        assert!(few.is_subset(&all));
        assert!(stopped.iter().all(|(_, into)| all.contains(into)));
        for &(portal, into) in &stopped {
            viewer.stops_mut().pass(portal, into);
            let seen = viewer.see(&sight, &state, &view);
            assert!(seen.cells().contains(&into), "{portal} into {into}");
            viewer.stops_mut().stop(portal, into);
            let seen = viewer.see(&sight, &state, &view);
            assert!(seen.stopped().contains(&(portal, into)));
            n_passed += 1;
        }
        viewer.stops_mut().clear();
        let again: BTreeSet<CellId> = viewer
            .see(&sight, &state, &view)
            .cells()
            .iter()
            .copied()
            .collect();
        assert_eq!(again, all);
    }
    assert!(n_passed > 20, "{n_passed}");
}
