//! Policies, failures, pins and budgets, one by one. Covers W1, W2 and W6.

use crate::common;

use std::time::Duration;

use common::{Program, piece_a_cell};
use enfilade_cpg::{CellId, CellSet, Pvs, World};
use enfilade_stream::{
    Catalog, FetchError, PieceId, PieceSizes, PinError, Policy, Reply, SimulatedLinkOptions,
    Source, StandInCause, StreamFrame, StreamOptions,
};
use enfilade_testkit::oracle::near_sets;
use enfilade_testkit::{GridParams, room_grid};

/// Rooms in a row with a doorway between each two, 3 to 6 m deep.
fn row_of_rooms(n: usize) -> World {
    room_grid(&GridParams {
        size: [n, 1, 1],
        ..GridParams::two_rooms()
    })
}

/// From each room of a row, the next ones may be seen.
fn neighbors(n: usize) -> Pvs {
    let row = |c: usize| {
        let mut set = CellSet::new(n);
        for other in c.saturating_sub(1)..=(c + 1).min(n - 1) {
            set.insert(CellId(other as u32));
        }
        set
    };
    Pvs::of_rows(&(0..n).map(row).collect::<Vec<_>>())
}

const SIZE: u64 = 10_000;

fn options(policy: Policy, n_pieces: u64) -> StreamOptions {
    StreamOptions {
        policy,
        max_resident: n_pieces * SIZE,
        ..StreamOptions::default()
    }
}

fn slow(bandwidth: f64) -> SimulatedLinkOptions {
    SimulatedLinkOptions {
        bandwidth,
        ..SimulatedLinkOptions::default()
    }
}

fn row_program(n: usize, options: StreamOptions, link: SimulatedLinkOptions) -> (World, Program) {
    let world = row_of_rooms(n);
    let catalog = piece_a_cell(&world, SIZE);
    let program = Program::new(&world, &catalog, Some(neighbors(n)), options, link);
    (world, program)
}

fn log(program: &Program) -> Vec<u32> {
    program.source.log.iter().map(|p| p.0).collect()
}

fn resident(program: &Program) -> Vec<u32> {
    let mut all: Vec<u32> = program.source.resident.iter().map(|p| p.0).collect();
    all.sort_unstable();
    all
}

#[test]
fn minimal_memory_holds_what_is_in_view_and_no_more() {
    let (world, mut program) = row_program(
        5,
        options(Policy::Minimal, 9),
        SimulatedLinkOptions::default(),
    );
    program.look(&world, 0, &[(0, 0.9), (1, 0.1)]);
    program.settle();
    assert_eq!(resident(&program), [0, 1]);
    program.look(&world, 0, &[(0, 1.0)]);
    program.frame();
    assert_eq!(resident(&program), [0]);
    program.look(&world, 4, &[(4, 0.5), (3, 0.5)]);
    program.settle();
    assert_eq!(resident(&program), [3, 4]);
}

#[test]
fn a_slow_link_brings_large_cells_first_and_the_rest_of_the_world_after_the_view() {
    let policy = Policy::Delayed { first_share: 0.2 };
    let (world, mut program) = row_program(6, options(policy, 9), slow(1e5));
    program.look(&world, 2, &[(1, 0.1), (2, 0.6), (3, 0.3)]);
    program.frame();
    assert_eq!(log(&program), [2, 3], "the small one waits");
    while !program.has_cell(2) || !program.has_cell(3) {
        assert_eq!(log(&program), [2, 3]);
        program.frame();
    }
    assert!(!program.streamer.settled());
    program.settle();
    program.frames(600);
    assert_eq!(log(&program)[..3], [2, 3, 1]);
    assert_eq!(resident(&program), [0, 1, 2, 3, 4, 5]);
}

#[test]
fn looking_back_reloads_nothing_that_fits() {
    for policy in [Policy::Cache, Policy::default()] {
        let (world, mut program) =
            row_program(7, options(policy, 4), SimulatedLinkOptions::default());
        let turn = |program: &mut Program| {
            program.look(&world, 3, &[(3, 0.6), (2, 0.4)]);
            program.settle();
            program.look(&world, 3, &[(3, 0.6), (4, 0.4)]);
            program.settle();
        };
        turn(&mut program);
        program.frames(600);
        let n = program.source.log.len();
        assert!((3..=4).contains(&n), "{n}");
        for _ in 0..20 {
            turn(&mut program);
        }
        assert_eq!(program.source.log.len(), n, "{policy:?}");
    }
}

#[test]
fn the_victim_of_a_cache_is_what_is_due_last_not_what_is_oldest() {
    let (world, mut program) = row_program(
        9,
        options(Policy::Cache, 4),
        SimulatedLinkOptions::default(),
    );
    // Cell 8 is in view last before the walk turns back to cell 0; 1 and 2 are older.
    for cell in [1, 2, 8, 0] {
        program.look(&world, cell, &[(cell, 1.0)]);
        program.settle();
        program.frames(2);
    }
    assert_eq!(resident(&program), [0, 1, 2, 8]);
    program.look(&world, 0, &[(0, 0.5), (3, 0.5)]);
    program.settle();
    assert_eq!(resident(&program), [0, 1, 2, 3]);
}

#[test]
fn prefetch_asks_in_the_order_of_deadlines_up_to_its_horizon() {
    let horizon = Duration::from_secs(5);
    let mut options = options(Policy::Prefetch { horizon }, 99);
    options.max_in_flight = 1;
    // So slow that there is no time to lose.
    let (world, mut program) = row_program(12, options, slow(2e3));
    program.look(&world, 5, &[(5, 1.0)]);
    program.settle();
    assert_eq!(log(&program)[0], 5);
    assert_eq!(resident(&program), [4, 5, 6], "all that may be seen now");
    program.frames(6000);
    // In pairs by the distance of the doorways from the eye.
    let x = |portal: usize| world.graph.portals[portal].center()[0];
    let eye = program.eye.position[0];
    let mut expected: Vec<(f32, u32)> = Vec::new();
    for cell in 0..12_u32 {
        // Cell c < 5 is seen from c + 1, whose far doorway is portal c + 1; likewise on the other side.
        let due = match cell {
            0..4 => eye - x(cell as usize + 1),
            7.. => x(cell as usize - 2) - eye,
            _ => continue,
        };
        if due <= 1.4 * 5.0 {
            expected.push((due, cell));
        }
    }
    expected.sort_by(|a, b| a.0.total_cmp(&b.0));
    let expected: Vec<u32> = expected.into_iter().map(|e| e.1).collect();
    assert!(expected.len() >= 2, "{expected:?}");
    assert_eq!(log(&program)[3..], expected);
}

#[test]
fn what_is_due_later_is_fetched_when_the_link_needs_the_time_for_it() {
    let later = |bandwidth| {
        let (world, mut program) = row_program(12, options(Policy::default(), 99), slow(bandwidth));
        program.look(&world, 5, &[(5, 1.0)]);
        program.settle();
        program.frames(3600);
        program.source.log.len() - 3
    };
    // Nine rooms are due within a minute. Over the fast link, only the next ones are.
    let [fast, slow] = [1e6, 2e3].map(later);
    assert!(fast <= 2 && slow == 9, "{fast} {slow}");
}

#[test]
fn what_is_fetched_ahead_takes_the_place_of_what_is_due_later_only() {
    let (world, mut program) = row_program(
        9,
        options(Policy::default(), 3),
        SimulatedLinkOptions::default(),
    );
    program.look(&world, 4, &[(4, 1.0)]);
    program.settle();
    program.frames(600);
    assert_eq!(resident(&program), [3, 4, 5]);
    assert_eq!(
        program.source.log.len(),
        3,
        "nothing goes for what is due later"
    );
    program.look(&world, 5, &[(5, 1.0)]);
    program.settle();
    assert_eq!(resident(&program), [4, 5, 6]);
}

#[test]
fn a_view_that_does_not_fit_gets_its_largest_cells_and_the_rest_is_told() {
    let (world, mut program) = row_program(
        6,
        options(Policy::default(), 2),
        SimulatedLinkOptions::default(),
    );
    let view = [(0, 0.1), (1, 0.2), (2, 0.4), (3, 0.3)];
    program.look(&world, 2, &view);
    program.settle();
    assert_eq!(resident(&program), [2, 3]);
    let told: Vec<_> = program
        .changes
        .stand_ins
        .iter()
        .map(|s| (s.cell.0, s.cause))
        .collect();
    assert_eq!(told, [(0, StandInCause::NoRoom), (1, StandInCause::NoRoom)]);
    // A little change of the shares changes nothing; a large one does.
    program.look(&world, 2, &[(0, 0.1), (1, 0.33), (2, 0.4), (3, 0.3)]);
    program.settle();
    program.frames(60);
    assert_eq!(resident(&program), [2, 3]);
    program.look(&world, 2, &[(0, 0.1), (1, 0.5), (2, 0.4), (3, 0.3)]);
    program.settle();
    assert_eq!(resident(&program), [1, 2]);
}

#[test]
fn a_view_that_flickers_gets_all_it_needs() {
    for policy in [Policy::Cache, Policy::default()] {
        let mut options = options(policy, 2);
        options.max_in_flight = 1;
        let (world, mut program) = row_program(9, options, slow(1e4));
        let mut was_there = [false; 2];
        for i in 0..600 {
            let cell = if i % 2 == 0 { 0 } else { 8 };
            program.look(&world, cell, &[(cell, 1.0)]);
            program.frame();
            for (was, cell) in was_there.iter_mut().zip([0, 8]) {
                *was |= program.has_cell(cell);
            }
        }
        assert_eq!(was_there, [true; 2], "{policy:?}");
        if policy == Policy::Cache {
            assert_eq!(program.source.n_canceled, 0);
            assert_eq!(log(&program), [0, 8]);
        }
    }
}

#[test]
fn the_view_takes_the_place_of_what_is_on_its_way_for_later() {
    let mut options = options(Policy::default(), 9);
    options.max_in_flight = 2;
    let (world, mut program) = row_program(9, options, slow(1e4));
    program.look(&world, 1, &[(1, 1.0)]);
    program.settle();
    while program.source.on_their_way.len() < 2 {
        program.frame();
    }
    program.look(&world, 1, &[(1, 0.5), (8, 0.5)]);
    program.frame();
    assert_eq!(log(&program).last(), Some(&8));
    assert_eq!(program.source.n_canceled, 1);
    program.settle();
    program.frames(1200);
    assert!(program.has_cell(3), "the canceled one comes later");
}

#[test]
fn what_arrives_is_handed_over_in_slices() {
    let mut options = options(Policy::default(), 9);
    options.max_bytes_a_frame = 2 * SIZE;
    let fast = SimulatedLinkOptions {
        bandwidth: 1e12,
        ..SimulatedLinkOptions::default()
    };
    let (world, mut program) = row_program(5, options, fast);
    program.look(
        &world,
        2,
        &[(0, 0.1), (1, 0.1), (2, 0.1), (3, 0.1), (4, 0.1)],
    );
    let mut slices = Vec::new();
    for _ in 0..20 {
        program.frame();
        slices.push(program.changes.added.len());
    }
    slices.retain(|n| *n > 0);
    assert_eq!(slices, [2, 2, 1]);
}

/// Replies as the test asks.
#[derive(Default)]
struct Scripted {
    asked: Vec<PieceId>,
    replies: Vec<Reply>,
}

impl Source for Scripted {
    fn request(&mut self, piece: PieceId) {
        self.asked.push(piece);
    }

    fn cancel(&mut self, _: PieceId) {}

    fn poll(&mut self, replies: &mut Vec<Reply>) {
        replies.append(&mut self.replies);
    }
}

#[test]
fn a_failed_piece_is_asked_for_again_after_twice_the_time_and_blocks_no_other() {
    let (world, mut program) = row_program(
        3,
        options(Policy::Cache, 9),
        SimulatedLinkOptions::default(),
    );
    program.look(&world, 1, &[(0, 0.1), (1, 0.9)]);
    let mut source = Scripted::default();
    let mut frame = |now: u64, source: &mut Scripted| {
        let frame = StreamFrame {
            now: Duration::from_millis(now),
            eye: program.eye,
            in_view: &program.view,
        };
        program
            .streamer
            .update(source, &frame, &mut program.changes);
        let failed = program.changes.failed.clone();
        let causes: Vec<StandInCause> = program.changes.stand_ins.iter().map(|s| s.cause).collect();
        (failed, causes, program.streamer.settled())
    };
    let fail = |source: &mut Scripted| {
        let error = FetchError::Unreachable {
            piece: PieceId(1),
            place: "here".to_owned(),
            problem: "no line".to_owned(),
        };
        source.replies.push(Reply {
            piece: PieceId(1),
            bytes: Err(error),
        });
    };
    frame(0, &mut source);
    assert_eq!(source.asked, [PieceId(1), PieceId(0)]);
    source.replies.push(Reply {
        piece: PieceId(0),
        bytes: Ok(Vec::new()),
    });
    let mut now = 0;
    for wait in [250, 500, 1000, 2000, 4000, 8000, 8000] {
        fail(&mut source);
        let (failed, causes, settled) = frame(now, &mut source);
        assert_eq!(failed[0].retry, Some(Duration::from_millis(now + wait)));
        assert_eq!((causes, settled), (vec![StandInCause::Failing], false));
        let n = source.asked.len();
        frame(now + wait - 1, &mut source);
        assert_eq!(source.asked.len(), n, "too early");
        now += wait;
        frame(now, &mut source);
        assert_eq!(source.asked.len(), n + 1);
        assert_eq!(source.asked.last(), Some(&PieceId(1)));
    }
    // Too large is damaged; and one that does not exist is not waited for.
    source.replies.push(Reply {
        piece: PieceId(1),
        bytes: Ok(vec![0; SIZE as usize + 1]),
    });
    let (failed, ..) = frame(now, &mut source);
    assert!(matches!(failed[0].error, FetchError::Damaged { .. }));
    now += 8000;
    frame(now, &mut source);
    source.replies.push(Reply {
        piece: PieceId(1),
        bytes: Err(FetchError::Missing {
            piece: PieceId(1),
            place: "here".to_owned(),
        }),
    });
    let (failed, causes, settled) = frame(now, &mut source);
    assert_eq!(failed[0].retry, None);
    assert_eq!((causes, settled), (vec![StandInCause::Missing], true));
    let n = source.asked.len();
    frame(now + 1_000_000, &mut source);
    assert_eq!(source.asked.len(), n);
    program.streamer.retry_missing();
    program.frame();
    assert_eq!(program.source.log, [PieceId(1)]);
}

#[test]
fn pinned_cells_are_fetched_together_and_stay() {
    let world = row_of_rooms(6);
    // Two pieces a cell, one of them shared with the next.
    let piece = PieceSizes {
        n_packed: SIZE,
        n_resident: SIZE,
    };
    let rows: Vec<Vec<PieceId>> = (0..6).map(|c| vec![PieceId(c), PieceId(c + 1)]).collect();
    let catalog = Catalog::new(vec![piece; 7], &rows);
    let options = options(Policy::Cache, 5);
    let link = SimulatedLinkOptions::default();
    let mut program = Program::new(&world, &catalog, Some(neighbors(6)), options, link);
    let streamer = &mut program.streamer;
    assert_eq!(streamer.pin(CellId(4)), Ok(()));
    assert_eq!(streamer.pin(CellId(5)), Ok(()));
    assert_eq!(streamer.pin(CellId(5)), Ok(()));
    let no_room = PinError::NoRoom {
        cell: CellId(1),
        needed: 5 * SIZE,
        max: 5 * SIZE,
    };
    assert_ne!(streamer.pin(CellId(1)), Err(no_room), "five fit");
    let too_much = streamer.pin(CellId(2)).unwrap_err();
    assert!(
        too_much.to_string().contains("60000 bytes of 50000"),
        "{too_much}"
    );
    assert!(streamer.pin(CellId(6)).is_err());
    streamer.unpin(CellId(1));
    program.look(&world, 0, &[(0, 1.0)]);
    program.settle();
    program.frames(60);
    assert!(program.has_cell(4) && program.has_cell(5) && program.has_cell(0));
    // The view changes; the pinned stay.
    for cell in [1, 2, 3, 0] {
        program.look(&world, cell, &[(cell, 1.0)]);
        program.settle();
        assert!(program.has_cell(4) && program.has_cell(5) && program.has_cell(cell));
    }
    program.streamer.unpin(CellId(5));
    program.look(&world, 1, &[(1, 1.0), (0, 0.5)]);
    program.settle();
    assert!(program.has_cell(5), "pinned twice");
    program.streamer.unpin(CellId(5));
    program.streamer.unpin(CellId(5));
    program.streamer.unpin(CellId(4));
    program.look(&world, 1, &[(1, 1.0), (2, 1.0), (0, 0.5)]);
    program.settle();
    assert_eq!(resident(&program)[..4], [0, 1, 2, 3]);
}

#[test]
fn without_visible_sets_all_within_reach_is_fetched_nearest_first() {
    let world = row_of_rooms(5);
    let catalog = piece_a_cell(&world, SIZE);
    let mut options = options(Policy::default(), 3);
    options.max_in_flight = 1;
    let mut program = Program::new(
        &world,
        &catalog,
        None,
        options,
        SimulatedLinkOptions::default(),
    );
    program.look(&world, 0, &[(0, 1.0)]);
    program.settle();
    assert_eq!(log(&program), [0, 1, 2]);
    // The set of another graph is none.
    let options = program.options.clone();
    let other = Some(neighbors(4));
    let mut program = Program::new(
        &world,
        &catalog,
        other,
        options,
        SimulatedLinkOptions::default(),
    );
    program.look(&world, 4, &[(4, 1.0)]);
    program.settle();
    assert_eq!(log(&program), [4, 3, 2]);
}

#[test]
fn an_eye_in_no_cell_and_numbers_that_are_none_do_no_harm() {
    let (world, mut program) = row_program(
        3,
        options(Policy::default(), 2),
        SimulatedLinkOptions::default(),
    );
    program.look(&world, 1, &[(1, f32::NAN), (77, 0.5), (0, f32::INFINITY)]);
    program.eye.cell = None;
    program.eye.speed = f32::NAN;
    program.settle_view();
    assert_eq!(resident(&program), [0, 1]);
    program.eye.cell = Some(CellId(77));
    program.eye.position = [f32::NAN; 3];
    program.frames(10);
    program.look(&world, 1, &[]);
    program.settle();
}

#[test]
fn a_cut_link_is_told_and_all_comes_once_it_is_mended() {
    let world = row_of_rooms(8);
    let catalog = piece_a_cell(&world, SIZE);
    let pvs = near_sets(&world.graph);
    let resident_after = |is_cut: bool| {
        let options = options(Policy::default(), 6);
        let link = SimulatedLinkOptions::default();
        let mut program = Program::new(&world, &catalog, Some(pvs.clone()), options, link);
        program.look(&world, 3, &[(3, 0.7), (4, 0.3)]);
        program.eye.position[0] += 0.3; // not in the middle
        let mut n_told = 0;
        if is_cut {
            program.frames(5);
            program.source.link.set_down(true);
            for _ in 0..1200 {
                program.frame();
                n_told += program.changes.failed.len();
                assert!(!program.streamer.settled());
            }
            // Less than one request of each piece in view a second, and few ahead.
            assert!((2..60).contains(&n_told), "{n_told}");
            program.source.link.set_down(false);
        }
        program.settle();
        program.frames(1200);
        resident(&program)
    };
    assert_eq!(resident_after(true), resident_after(false));
}

#[test]
fn a_forgotten_piece_gives_its_memory_back_and_comes_again() {
    let (world, mut program) = row_program(
        6,
        options(Policy::Cache, 6),
        SimulatedLinkOptions::default(),
    );
    for cell in [0, 3] {
        program.look(&world, cell, &[(cell, 1.0)]);
        program.settle_view();
    }
    let streamer = &mut program.streamer;
    let before = streamer.counts().n_kept;
    // Those that are not in memory are none to forget.
    for piece in [0, 0, 5, 77].map(PieceId) {
        streamer.forget(piece);
        program.source.resident.remove(&piece);
    }
    assert_eq!(streamer.counts().n_kept, before - SIZE);
    assert!(!streamer.is_resident(PieceId(0)) && streamer.is_resident(PieceId(3)));
    program.look(&world, 0, &[(0, 1.0)]);
    program.settle_view();
    assert!(program.has_cell(0));
    assert_eq!(log(&program), [0, 3, 0]);
    // Even in view.
    program.streamer.forget(PieceId(0));
    program.source.resident.clear();
    program.source.resident.insert(PieceId(3));
    program.settle_view();
    assert_eq!(log(&program), [0, 3, 0, 0]);
}
