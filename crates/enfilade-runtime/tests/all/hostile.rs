//! Hostile queries: infinities, NaN, the limits of `f32`. Nothing panics, and a point that is not finite is in no cell, sees
//! nothing and meets nothing.

use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::ray::hit_triangle;
use enfilade_geom::scene::Primitive;
use enfilade_geom::{DVec3, Ray};
use enfilade_runtime::{Follower, Sight, SightState, Sightlines, Step, View, Viewer};
use enfilade_testkit::{GridParams, Rng, room_grid};

const NASTY: [f32; 20] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    3.0,
    1e-3,
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::MAX,
    f32::MIN,
    f32::MIN_POSITIVE,
    -f32::MIN_POSITIVE,
    1e-45,
    f32::EPSILON,
    1e10,
    -1e10,
    1e19,
    1e30,
    std::f32::consts::PI,
];

struct Pool {
    rng: Rng,
    world: World,
}

impl Pool {
    fn number(&mut self) -> f32 {
        match self.rng.below(4) {
            0 => f32::from_bits((self.rng.unit() * f64::from(u32::MAX)) as u32),
            1 => (self.rng.unit() * 20.0 - 2.0) as f32,
            _ => NASTY[self.rng.below(NASTY.len())],
        }
    }

    fn point(&mut self) -> [f32; 3] {
        let graph = &self.world.graph;
        let mut p = match self.rng.below(4) {
            // In a cell, at a vertex of a portal.
            0 => {
                let b = graph.cells[self.rng.below(graph.cells.len())].aabb;
                [0, 1, 2].map(|k| b[0][k] + (b[1][k] - b[0][k]) * self.rng.unit() as f32)
            }
            1 => {
                let outline = &graph.portals[self.rng.below(graph.portals.len())].outline;
                outline[self.rng.below(outline.len())]
            }
            _ => return [0, 1, 2].map(|_| self.number()),
        };
        if self.rng.below(2) == 0 {
            p[self.rng.below(3)] = self.number();
        }
        p
    }

    /// Returns the first `t` at which a segment meets a triangle, by brute force.
    fn first_hit(&self, a: [f32; 3], b: [f32; 3]) -> Option<f64> {
        let point = |p: [f32; 3]| DVec3::from_array(p.map(f64::from));
        let ray = Ray::segment(point(a), point(b));
        let batches = self.world.batches.iter().map(|b| &b.primitive);
        let triangles = batches.flat_map(Primitive::triangles);
        let hits = triangles.filter_map(|t| hit_triangle(&ray, &t));
        hits.map(|h| h.t).min_by(f64::total_cmp)
    }

    fn view(&mut self) -> Option<View> {
        let eye = self.point();
        let view = match self.rng.below(4) {
            0 => View::around(eye),
            1 => {
                let m = [0, 1, 2, 3].map(|_| [0, 1, 2, 3].map(|_| self.number()));
                View::from_view_projection(eye, m)
            }
            _ => {
                let (toward, up) = (self.point(), self.point());
                let (fov, aspect) = (self.number(), self.number());
                View::perspective(eye, toward, up, fov, aspect)
            }
        };
        let view = view.ok()?;
        assert!(is_finite(view.eye()), "a view from {:?}", view.eye());
        if self.rng.below(3) == 0 {
            return view.with_far(self.number()).ok();
        }
        Some(view)
    }
}

fn is_finite(p: [f32; 3]) -> bool {
    p.iter().all(|x| x.is_finite())
}

/// Runs every kind of query once.
fn ask(pool: &mut Pool, sight: &Sight, lines: &Sightlines, viewer: &mut Viewer) {
    let mut state = SightState::new(sight);
    for _ in 0..pool.rng.below(4) {
        let portal = PortalId(pool.rng.below(sight.n_portals() + 2) as u32);
        let (normal, through) = (pool.point(), pool.point());
        state.narrow(portal, normal, through);
    }
    state.close(PortalId(pool.rng.below(sight.n_portals() + 2) as u32));
    state.lock(CellId(pool.rng.below(sight.n_cells() + 2) as u32), true);
    let (a, b) = (pool.point(), pool.point());
    let is_segment = is_finite(a) && is_finite(b);
    let told = format!("{a:?} to {b:?}");
    let clear = lines.is_clear(&state, a, b);
    let picked = lines.pick(&state, a, b);
    assert!(is_segment || !clear, "{told} is clear");
    assert_eq!(picked.is_ok(), is_segment, "{told}");
    if let Ok(Some(hit)) = picked {
        assert!((0.0..=1.0).contains(&hit.t), "{told}: {hit:?}");
        assert!(
            is_finite(hit.position) && is_finite(hit.normal),
            "{told}: {hit:?}"
        );
    }
    for hit in [lines.first_hit(a, b), lines.first_hit_by_cells(a, b)] {
        assert!(is_segment || hit.is_none(), "{told}: {hit:?}");
        assert!(
            hit.is_none_or(|h| (0.0..=1.0).contains(&h.t)),
            "{told}: {hit:?}"
        );
    }
    // From farther away, `f64` no longer separates one wall from the next: any answer is right.
    let is_told = is_segment && a.iter().all(|x| x.abs() < 1e9);
    if is_told && pool.rng.below(8) == 0 {
        let truth = pool.first_hit(a, b);
        assert_eq!(lines.first_hit(a, b).map(|h| h.t), truth, "{told}");
        assert!(truth.is_none() || !clear, "{told}");
    }
    assert!(
        is_finite(a) || sight.locate(a).is_none(),
        "{a:?} has a cell"
    );
    let mut follower = Follower::new(sight, a);
    for to in [b, pool.point(), a] {
        let step = follower.step(sight, to);
        assert!(
            is_finite(to) || step == Step::Lost,
            "{told}, {to:?}: {step:?}"
        );
        assert!(
            is_finite(to) || follower.crossed().is_empty(),
            "{told}, {to:?}"
        );
        assert!(follower.cell().is_none_or(|c| c.idx() < sight.n_cells()));
    }
    // A step from a point that is not finite crosses nothing.
    if !is_finite(a) {
        let mut follower = Follower::new(sight, b);
        follower.step(sight, a);
        follower.step(sight, b);
        assert!(follower.crossed().is_empty(), "{told}");
    }
    if let Some(view) = pool.view() {
        let seen = viewer.see(sight, &state, &view);
        assert!(seen.cells().iter().all(|c| c.idx() < sight.n_cells()));
        let aabb = [pool.point(), pool.point()];
        let cells = [
            CellId(pool.rng.below(sight.n_cells()) as u32),
            CellId(u32::MAX),
        ];
        let sees = seen.sees_box(&cells, aabb);
        let is_box = !aabb.as_flattened().iter().any(|x| x.is_nan());
        assert!(is_box || !sees, "{aabb:?} is seen");
        if view.n_faces() == 6 && !seen.visits().is_empty() {
            let everything = [[f32::NEG_INFINITY; 3], [f32::INFINITY; 3]];
            assert!(seen.sees_box(seen.cells(), everything));
        }
        let _ = view.pixels_per_meter(a, b[0], [u32::MAX, 0]);
        viewer.see_through_walls(sight, &view);
    }
}

#[test]
fn a_hundred_thousand_hostile_questions_get_honest_answers() {
    let worlds = [
        room_grid(&GridParams::offices(20, 1)),
        room_grid(&GridParams {
            merges: 0.2,
            holes: 0.3,
            turn: 0.6,
            ..GridParams::offices(12, 2)
        }),
        room_grid(&GridParams {
            size: [2, 1, 1],
            doors: 1.0,
            outdoors: false,
            ..GridParams::offices(2, 3)
        }),
    ];
    for (seed, world) in worlds.into_iter().enumerate() {
        let sight = Sight::build(&world).unwrap();
        let lines = Sightlines::build(&world);
        let mut viewer = Viewer::new(&sight);
        let rng = Rng::new(seed as u64);
        let mut pool = Pool { rng, world };
        for _ in 0..12_000 {
            ask(&mut pool, &sight, &lines, &mut viewer);
        }
    }
}

#[test]
fn a_plane_that_is_none_narrows_nothing() {
    let world = room_grid(&GridParams::two_rooms());
    let lines = Sightlines::build(&world);
    let mut state = SightState::new(&Sight::build(&world).unwrap());
    let outline = &world.graph.portals[0].outline;
    let middle = [0, 1, 2].map(|k| outline.iter().map(|p| p[k]).sum::<f32>() / 4.0);
    let at = |x: f32| [middle[0] + x, middle[1], middle[2]];
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    for x in bad {
        state.narrow(PortalId(0), [0.0, x, 0.0], middle);
        state.narrow(PortalId(0), [0.0, 1.0, 0.0], [0.0, x, 0.0]);
        state.narrow(PortalId(u32::MAX), [0.0, 1.0, 0.0], middle);
    }
    state.narrow(PortalId(0), [0.0; 3], middle);
    assert!(lines.is_clear(&state, at(-1.0), at(1.0)));
    for x in bad {
        assert!(!lines.is_clear(&state, at(-1.0), at(x)));
        assert!(lines.pick(&state, at(x), at(1.0)).is_err());
    }
}
