//! Random worlds, walks, views, budgets and links. Covers W1, W2 and W6.

use crate::common;

use std::collections::HashSet;
use std::time::Duration;

use common::{Program, random_catalog};
use enfilade_cpg::{CellId, Pvs, World};
use enfilade_stream::{
    Catalog, PieceId, Policy, SimulatedLinkOptions, StandInCause, StreamOptions,
};
use enfilade_testkit::oracle::near_sets;
use enfilade_testkit::{GridParams, Rng, room_grid};
use proptest::prelude::*;

const POLICIES: [Policy; 5] = [
    Policy::Minimal,
    Policy::Delayed { first_share: 0.2 },
    Policy::Cache,
    Policy::Prefetch {
        horizon: Duration::from_secs(3),
    },
    Policy::Prefetch {
        horizon: Duration::MAX,
    },
];

fn draw_program(seed: u64, policy: Policy) -> (World, Pvs, Program, bool, Rng) {
    let mut rng = Rng::new(seed);
    let world = room_grid(&GridParams {
        merges: 0.2,
        furniture: 0,
        ..GridParams::offices(6 + rng.below(40), seed)
    });
    let n_cells = world.graph.cells.len();
    let catalog = random_catalog(&mut rng, n_cells);
    let all: u64 = catalog.pieces().iter().map(|p| p.n_resident).sum();
    let options = StreamOptions {
        policy,
        max_resident: (all as f64 * rng.range(0.0, 1.2) * rng.unit()) as u64,
        max_in_flight: rng.below(10),
        max_bytes_in_flight: rng.below(60_000) as u64,
        max_bytes_a_frame: rng.below(60_000) as u64,
        min_share: if rng.chance(0.3) { 0.1 } else { 0.0 },
        flies: rng.chance(0.5),
        step: rng.range(0.0, 2.0) as f32,
        first_retry: Duration::from_millis(rng.below(400) as u64),
        last_retry: Duration::from_secs(2),
    };
    let link = SimulatedLinkOptions {
        latency: Duration::from_millis(rng.below(200) as u64),
        bandwidth: rng.range(5e4, 2e6),
        error_rate: if rng.chance(0.5) { 0.2 } else { 0.0 },
        short_read_rate: rng.range(0.0, 0.5),
        seed,
    };
    let pvs = near_sets(&world.graph);
    let has_pvs = rng.chance(0.8);
    let given = has_pvs.then(|| pvs.clone());
    let program = Program::new(&world, &catalog, given, options, link);
    (world, pvs, program, has_pvs, rng)
}

/// Looks at some of the cells that may be seen from a cell.
fn draw_view(rng: &mut Rng, pvs: &Pvs, cell: u32) -> Vec<(u32, f32)> {
    let mut view = vec![(cell, 1.0)];
    for c in pvs.visible_from(CellId(cell)) {
        if c.0 != cell && rng.chance(0.4) {
            view.push((c.0, rng.unit() as f32));
        }
    }
    view
}

/// Walks from cell to cell, turns, and pins cells, for `n` frames. Returns the pinned cells.
fn roam(program: &mut Program, world: &World, pvs: &Pvs, rng: &mut Rng, n: usize) -> Vec<CellId> {
    let mut cell = rng.below(world.graph.cells.len()) as u32;
    let mut pinned = Vec::new();
    for _ in 0..n {
        if rng.chance(0.05) {
            let exits: Vec<_> = world.graph.exits(CellId(cell)).collect();
            cell = match exits.len() {
                0 => cell,
                n => exits[rng.below(n)].to.0,
            };
        }
        if rng.chance(0.1) {
            let view = draw_view(rng, pvs, cell);
            program.look(world, cell, &view);
        }
        if rng.chance(0.02) {
            let cell = CellId(rng.below(world.graph.cells.len()) as u32);
            if program.streamer.pin(cell).is_ok() {
                pinned.push(cell);
            }
        }
        if rng.chance(0.02) && !pinned.is_empty() {
            program
                .streamer
                .unpin(pinned.swap_remove(rng.below(pinned.len())));
        }
        if rng.chance(0.01) {
            program.source.link.set_down(rng.chance(0.5));
        }
        program.frame();
        for cell in &pinned {
            for piece in program.source.catalog.pieces_of(*cell) {
                assert!(!program.changes.removed.contains(piece), "{cell} is pinned");
            }
        }
    }
    pinned
}

/// The pieces of the cells, each once.
fn pieces_of(catalog: &Catalog, cells: impl IntoIterator<Item = CellId>) -> HashSet<PieceId> {
    let pieces = cells.into_iter().flat_map(|c| catalog.pieces_of(c));
    pieces.copied().collect()
}

/// Roams, comes to rest, and checks what is in memory then.
fn roam_and_settle(seed: u64, policy: Policy) {
    let (world, pvs, mut program, has_pvs, mut rng) = draw_program(seed, policy);
    let pinned = roam(&mut program, &world, &pvs, &mut rng, 400);
    // At rest, all requests end and what is in view and fits is in memory.
    program.source.link.set_down(false);
    let cell = rng.below(world.graph.cells.len()) as u32;
    let view = draw_view(&mut rng, &pvs, cell);
    program.look(&world, cell, &view);
    program.settle();
    let catalog = program.source.catalog.clone();
    let may_be_seen = pieces_of(&catalog, pvs.visible_from(CellId(cell)));
    let must = pieces_of(&catalog, pinned.iter().copied());
    let is_first = may_be_seen
        .union(&must)
        .map(|p| program.source.size(*p))
        .sum::<u64>()
        <= program.source.most;
    if let (Policy::Prefetch { .. }, true, true) = (policy, has_pvs, is_first) {
        assert!(may_be_seen.is_subset(&program.source.resident));
    }
    // Pinned cells, too.
    for _ in 0..36_000 {
        program.frame();
        if program.streamer.settled() && must.is_subset(&program.source.resident) {
            break;
        }
    }
    let min_share = program.options.min_share;
    let in_view = view
        .iter()
        .filter(|v| v.1 >= min_share)
        .map(|v| CellId(v.0));
    let in_view = pieces_of(&catalog, in_view);
    let size = |pieces: &HashSet<PieceId>| -> u64 {
        pieces
            .iter()
            .map(|p| catalog.pieces()[p.idx()].n_resident)
            .sum()
    };
    let both: HashSet<PieceId> = in_view.union(&must).copied().collect();
    if size(&both) <= program.source.most {
        assert!(in_view.is_subset(&program.source.resident));
        assert!(
            program
                .changes
                .stand_ins
                .iter()
                .all(|s| s.cause == StandInCause::Small)
        );
    } else {
        // No piece that is left out would fit in place of all smaller ones on the screen that are not pinned either.
        let share = |p: PieceId| {
            let of = view
                .iter()
                .filter(|v| catalog.pieces_of(CellId(v.0)).contains(&p));
            of.map(|v| v.1).fold(0.0, f32::max)
        };
        for &out in in_view.difference(&program.source.resident) {
            let keeps = |p: &&PieceId| must.contains(p) || share(**p) * 1.5 >= share(out);
            let larger: HashSet<PieceId> = both.iter().filter(keeps).copied().collect();
            assert!(size(&larger) > program.source.most, "{out:?}");
        }
        assert!(!program.changes.stand_ins.is_empty());
    }
    // Nothing is asked for without end.
    program.frames(36_000);
    let n = program.source.log.len();
    program.frames(3_600);
    assert_eq!(program.source.log.len(), n);
    assert!(program.source.on_their_way.is_empty());
    assert!(program.streamer.settled());
    assert!(pieces_of(&catalog, pinned).is_subset(&program.source.resident));
    if policy == Policy::Minimal {
        assert!(program.source.resident.is_subset(&both));
    }
}

#[test]
fn what_found_no_room_is_not_settled_while_a_sweep_waits_and_may_regain_it() {
    // The link fails, so the sweep waits; then the view turns, so there is room.
    roam_and_settle(553_616_917_132_253_936, POLICIES[3]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn memory_is_never_above_the_budget_and_all_settles(seed in any::<u64>(), policy in 0..5_usize) {
        roam_and_settle(seed, POLICIES[policy]);
    }

    #[test]
    fn settled_is_told_in_the_frame_in_which_it_becomes_true(seed in any::<u64>()) {
        let (world, pvs, mut program, _, mut rng) = draw_program(seed, Policy::Cache);
        for _ in 0..10 {
            let cell = rng.below(world.graph.cells.len()) as u32;
            let view = draw_view(&mut rng, &pvs, cell);
            program.look(&world, cell, &view);
            for _ in 0..40 {
                program.frame();
                let is_late = |c: StandInCause| matches!(c, StandInCause::Pending | StandInCause::Failing);
                let late = program.changes.stand_ins.iter().any(|s| is_late(s.cause));
                prop_assert_eq!(program.streamer.settled(), !late);
                let lack: HashSet<CellId> = program.changes.stand_ins.iter().map(|s| s.cell).collect();
                for v in &view {
                    prop_assert_eq!(program.has_cell(v.0), !lack.contains(&CellId(v.0)), "{:?}", v);
                }
            }
        }
    }
}
