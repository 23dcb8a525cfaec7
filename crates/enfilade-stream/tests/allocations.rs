//! A frame in which nothing changes allocates nothing.

mod common;

use common::{Program, piece_a_cell};
use enfilade_stream::{SimulatedLinkOptions, StreamFrame, StreamOptions};
use enfilade_testkit::oracle::near_sets;
use enfilade_testkit::{GridParams, room_grid};

// Covers W1.
#[test]
fn idle_frames_allocate_nothing() {
    let world = room_grid(&GridParams::offices(1000, 1));
    let catalog = piece_a_cell(&world, 1000);
    for max_resident in [50_000, 1 << 30] {
        let options = StreamOptions {
            max_resident,
            ..StreamOptions::default()
        };
        let pvs = Some(near_sets(&world.graph));
        let link = SimulatedLinkOptions::default();
        let mut program = Program::new(&world, &catalog, pvs, options, link);
        let view: Vec<(u32, f32)> = (0..60).map(|c| (c, 0.01)).collect();
        program.look(&world, 3, &view);
        program.settle();
        program.frames(2000);
        assert!(program.source.on_their_way.is_empty());
        let count = allocation_counter::measure(|| {
            for _ in 0..100 {
                let frame = StreamFrame {
                    now: program.now,
                    eye: program.eye,
                    in_view: &program.view,
                };
                program
                    .streamer
                    .update(&mut program.source, &frame, &mut program.changes);
            }
        });
        assert_eq!(count.count_total, 0);
    }
}
