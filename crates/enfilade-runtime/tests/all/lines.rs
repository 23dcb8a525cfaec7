//! Lines of sight against brute force, and objects followed from cell to cell.

use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::DVec3;
use enfilade_runtime::{Follower, Sight, SightHit, SightState, Sightlines, Step};
use enfilade_testkit::{GridParams, Rng, room_grid};

fn point(rng: &mut Rng, world: &World) -> [f32; 3] {
    let b = &world.graph.cells[rng.below(world.graph.cells.len())].aabb;
    [0, 1, 2].map(|k| b[0][k] + (b[1][k] - b[0][k]) * rng.unit() as f32)
}

// Covers R6.
#[test]
fn a_million_segments_equal_brute_force() {
    let mut n_by_cells = 0;
    let mut n_hits = 0;
    for (seed, turn) in [(1, 0.0), (2, 0.6), (3, 1.3), (4, 0.0), (5, 2.0)] {
        let params = GridParams {
            merges: 0.15,
            holes: 0.3,
            turn,
            furniture: 0,
            ..GridParams::offices(150, seed)
        };
        let world = room_grid(&params);
        let lines = Sightlines::build(&world);
        let mut rng = Rng::new(seed);
        for i in 0..200_000 {
            let a = point(&mut rng, &world);
            let mut b = point(&mut rng, &world);
            if i % 4 == 0 {
                // Nearby: many of these meet nothing.
                b = [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * 0.05);
            }
            if i % 32 == 1 {
                // To vertices of portals: along walls, through rims.
                let portals = &world.graph.portals;
                let outline = &portals[rng.below(portals.len())].outline;
                b = outline[rng.below(outline.len())];
            }
            let found = lines.first_hit_by_cells(a, b);
            let truth = lines.first_hit(a, b);
            let plain = |h: SightHit| SightHit { cell: None, ..h };
            assert_eq!(found.map(plain), truth, "{a:?} {b:?}");
            n_hits += u32::from(truth.is_some());
            n_by_cells += u32::from(found.is_some_and(|h| h.cell.is_some()));
        }
    }
    assert!(n_hits > 500_000, "{n_hits}");
    // Guard against a vacuous comparison.
    assert!(
        f64::from(n_by_cells) > 0.9 * f64::from(n_hits),
        "{n_by_cells} of {n_hits}"
    );
}

#[test]
fn from_farther_off_than_numbers_can_tell_both_ways_answer_alike() {
    let lines = Sightlines::build(&room_grid(&GridParams::offices(6, 3)));
    let (a, b) = (
        [4.543_794_5e30, 4.0e-41, 0.0],
        [537_395_200.0, 2.646_978e-23, 0.0],
    );
    let found = lines.first_hit_by_cells(a, b);
    let plain = |h: SightHit| SightHit { cell: None, ..h };
    assert_eq!(found.map(plain), lines.first_hit(a, b));
}

#[test]
fn closed_doors_and_odd_points_stop_a_line() {
    let world = room_grid(&GridParams::two_rooms());
    let lines = Sightlines::build(&world);
    let sight = Sight::build(&world).unwrap();
    let mut state = SightState::new(&sight);
    let outline = &world.graph.portals[0].outline;
    let middle: [f32; 3] = [0, 1, 2].map(|k| outline.iter().map(|p| p[k]).sum::<f32>() / 4.0);
    let at = |x: f32| [middle[0] + x, middle[1], middle[2]];
    assert!(lines.is_clear(&state, at(-1.0), at(1.0)));
    state.close(PortalId(0));
    assert!(!lines.is_clear(&state, at(-1.0), at(1.0)));
    assert!(lines.is_clear(&state, at(-1.0), at(-0.1)));
    assert!(!lines.is_clear(&state, at(-1.0), at(-90.0)));
    assert!(lines.first_hit([f32::NAN; 3], at(0.0)).is_none());
    assert!(lines.first_hit(at(-1.0), at(-1.0)).is_none());
}

// Covers P6.
#[test]
fn things_are_followed_through_portals_and_found_again() {
    let world = room_grid(&GridParams {
        merges: 0.1,
        furniture: 0,
        turn: 0.4,
        ..GridParams::offices(60, 2)
    });
    let sight = Sight::build(&world).unwrap();
    let lines = Sightlines::build(&world);
    let mut rng = Rng::new(9);
    let mut follower = Follower::new(&sight, point(&mut rng, &world));
    let (mut n_crossed, mut n_relocated) = (0, 0);
    for i in 0..60_000 {
        let from = follower.position();
        let to = if i % 50 == 0 {
            point(&mut rng, &world)
        } else {
            [0, 1, 2].map(|k| from[k] + rng.range(-1.5, 1.5) as f32)
        };
        let before = follower.cell();
        let is_clear = lines.is_clear(&SightState::new(&sight), from, to);
        let step = follower.step(&sight, to);
        assert_eq!(
            follower.cell().is_some(),
            step != Step::Lost || before.is_some()
        );
        if step != Step::Lost {
            let found = sight.locate(to);
            // Exact: no random point is within rounding of a portal.
            assert_eq!(follower.cell(), found);
        }
        match step {
            Step::Crossed => {
                n_crossed += 1;
                // The portals lead from cell to cell.
                let mut cell = before.unwrap();
                for p in follower.crossed() {
                    let [a, b] = world.graph[*p].cells;
                    assert!(cell == a || cell == b);
                    cell = if cell == a { b } else { a };
                }
                assert_eq!(Some(cell), follower.cell());
            }
            Step::Relocated => {
                n_relocated += 1;
                assert!(!is_clear, "lost on a clear way from {from:?} to {to:?}");
            }
            _ => {}
        }
    }
    assert!(
        n_crossed > 300 && n_relocated > 500,
        "{n_crossed} {n_relocated}"
    );
    let there = follower.teleport(&sight, DVec3::splat(1e6).as_vec3().to_array());
    assert!(matches!(there, Step::Relocated | Step::Stayed));
    let outdoors = world.graph.cells.iter().position(|c| c.outdoor).unwrap();
    assert_eq!(follower.cell(), Some(CellId(outdoors as u32)));
}
