//! Groups of portals give the same answers as portals one by one. Covers P7.

use enfilade_cpg::{PortalId, World};
use enfilade_runtime::{
    Follower, Narrowing, SeeOptions, Seen, Sight, SightOptions, SightState, View, Viewer,
};
use enfilade_testkit::{GridParams, Rng, courtyard, room_grid, window_tower};
use proptest::prelude::*;

/// All lists of an answer, in order. Statistics are left out, since they must differ.
fn lists(seen: &Seen<'_>) -> String {
    let of_visit = |v| (v, seen.planes(v));
    let visits: Vec<_> = seen.visits().iter().map(of_visit).collect();
    format!(
        "{visits:?} {:?} {:?} {:?} {:?} {:?} {}",
        seen.cells(),
        seen.portals(),
        seen.stopped(),
        seen.chunks(),
        seen.details(),
        seen.n_triangles()
    )
}

fn sight(world: &World, portal_group: usize) -> Sight {
    let options = SightOptions {
        portal_group,
        ..SightOptions::default()
    };
    Sight::build_with(world, &options).unwrap()
}

fn point_in(rng: &mut Rng, world: &World) -> [f32; 3] {
    let cells = &world.graph.cells;
    let [low, high] = cells[rng.below(cells.len())].aabb;
    [0, 1, 2].map(|k| low[k] + (high[k] - low[k]) * rng.unit() as f32)
}

/// A point anywhere, or within rounding or a step of a portal.
fn eye_in(rng: &mut Rng, world: &World) -> [f32; 3] {
    let portals = &world.graph.portals;
    if portals.is_empty() || rng.chance(0.6) {
        return point_in(rng, world);
    }
    let p = &portals[rng.below(portals.len())];
    let (a, b, c) = (p.outline[0], p.outline[1], p.outline[3]);
    let (s, t) = (rng.unit() as f32, rng.unit() as f32);
    let away = [0.0, 1e-6, 1e-4, 0.1, 2.0][rng.below(5)] * rng.range(-1.0, 1.0) as f32;
    [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * s + (c[k] - a[k]) * t + p.normal[k] * away)
}

fn view(rng: &mut Rng, eye: [f32; 3]) -> View {
    if rng.chance(0.1) {
        return View::around(eye).unwrap();
    }
    let toward = [0; 3].map(|_| rng.range(-1.0, 1.0) as f32);
    let fov = rng.range(0.1, 2.0) as f32;
    let view = View::perspective(eye, toward, [0.0, 1.0, 0.1], fov, 1.5).unwrap();
    if rng.chance(0.3) {
        return view.with_far(rng.range(0.5, 60.0) as f32).unwrap();
    }
    view
}

/// Worlds with cells of many exits: towers, courtyards, and grids whose squares are mostly joined, rotated so
/// that no box is tight.
fn worlds() -> impl Strategy<Value = World> {
    let grid = (0_u64..1 << 32, 20_usize..120, 0.5_f64..0.95, 0.0_f64..3.0).prop_map(
        |(seed, rooms, merges, turn)| {
            room_grid(&GridParams {
                merges,
                turn,
                windows: 0.9,
                holes: 0.4,
                ..GridParams::offices(rooms, seed)
            })
        },
    );
    prop_oneof![
        3 => grid,
        1 => (5_usize..12, any::<bool>()).prop_map(|(n, one)| courtyard(n, one)),
        2 => (3_usize..8, 1_usize..7, any::<bool>()).prop_map(|(n, m, one)| window_tower(n, m, one)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn groups_of_any_size_change_no_answer(
        world in worlds(), size in prop_oneof![1_usize..12, 12_usize..200], seed: u64,
        min_share in prop_oneof![2 => Just(0.0_f32), 1 => 0.001_f32..0.1], occlusion: bool,
    ) {
        let (single, grouped) = (sight(&world, 0), sight(&world, size));
        let options = SeeOptions {
            narrowing: [Narrowing::Rectangle, Narrowing::Polygon, Narrowing::PolygonOf(4)][size % 3],
            occlusion,
            min_share,
            precomputed: true,
            // A lower limit would cap the ungrouped query first, with a different answer.
            max_clips: u32::MAX,
        };
        let mut viewers = [&single, &grouped].map(|s| Viewer::with_options(s, options));
        let mut state = SightState::new(&single);
        let mut rng = Rng::new(seed);
        for portal in 0..world.graph.portals.len() as u32 {
            match rng.below(20) {
                0 => state.close(PortalId(portal)),
                1 => {
                    let p = &world.graph.portals[portal as usize];
                    let along = [0, 1, 2].map(|k| p.outline[1][k] - p.outline[0][k]);
                    state.narrow(PortalId(portal), along, p.outline[rng.below(4)]);
                }
                _ => {}
            }
        }
        for _ in 0..30 {
            let eye = eye_in(&mut rng, &world);
            let view = view(&mut rng, eye);
            let [a, b] = &mut viewers;
            let (one, many) = (a.see(&single, &state, &view), b.see(&grouped, &state, &view));
            prop_assert!(many.counts().clips <= one.counts().clips);
            prop_assert_eq!(lists(&one), lists(&many));
        }
    }

    #[test]
    fn groups_of_any_size_change_no_way(world in worlds(), size in 1_usize..60, seed: u64) {
        let (single, grouped) = (sight(&world, 0), sight(&world, size));
        let mut rng = Rng::new(seed);
        let at = eye_in(&mut rng, &world);
        let (mut a, mut b) = (Follower::new(&single, at), Follower::new(&grouped, at));
        for _ in 0..100 {
            let to = eye_in(&mut rng, &world);
            prop_assert_eq!(a.step(&single, to), b.step(&grouped, to));
            prop_assert_eq!((a.cell(), a.crossed()), (b.cell(), b.crossed()));
        }
    }
}
