//! A walk through a world in pieces, over a slow link: `cargo run --release -p enfilade --example streaming`.

#![allow(clippy::print_stdout)]

use std::error::Error;
use std::time::Duration;

use enfilade::cpg::Portal;
use enfilade::stream::{
    Changes, Eye, InView, SimulatedLink, SimulatedLinkOptions, StreamFrame, StreamOptions,
    Streamer, WorldPieces,
};
use enfilade::vis::{VisConfig, VisContext, see_world};
use enfilade::{Sight, SightState, View, Viewer};
use enfilade_testkit::{GridParams, room_grid};

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    // A row of ten rooms; in a program of yours, a packed world.
    let world = room_grid(&GridParams {
        size: [10, 1, 1],
        furniture: 6,
        ..GridParams::two_rooms()
    });
    let mut context = VisContext {
        on_round: &mut |_, _| true,
        walls: None,
        checkpoint: None,
    };
    let visible = see_world(&world.graph, &VisConfig::default(), &mut context)?;
    let catalog = WorldPieces::of_world(&world, &|_| Vec::new()).catalog;
    let link = SimulatedLinkOptions {
        bandwidth: 2e3,
        ..SimulatedLinkOptions::default()
    };
    let mut source = SimulatedLink::new(&catalog, link);
    let pvs = Some(visible.vis.cells);
    let mut streamer = Streamer::new(catalog, &world.graph, pvs, StreamOptions::default());

    let sight = Sight::build(&world)?;
    let (state, mut viewer) = (SightState::new(&sight), Viewer::new(&sight));
    let mut changes = Changes::default();
    let doorways: Vec<[f32; 3]> = world.graph.portals.iter().map(Portal::center).collect();
    let (mut now, mut n_late) = (Duration::ZERO, 0);
    for pair in doorways.windows(2) {
        let d = [0, 1, 2].map(|k| pair[1][k] - pair[0][k]);
        let n = ((d[0] * d[0] + d[2] * d[2]).sqrt() / 1.4 * 60.0) as u32;
        for i in 0..n {
            let t = (i as f32 + 0.5) / n as f32;
            let position = [0, 1, 2].map(|k| pair[0][k] + d[k] * t);
            let view = View::perspective(position, d, [0.0, 1.0, 0.0], 1.0, 1.6)?;
            let seen = viewer.see(&sight, &state, &view);
            // All shares alike: a program has them from `seen.visits()`.
            let cells = seen.cells().iter();
            let in_view: Vec<InView> = cells.map(|&cell| InView { cell, share: 0.1 }).collect();
            now += Duration::from_micros(16_667);
            source.advance(now);
            let frame = StreamFrame {
                now,
                eye: Eye {
                    cell: sight.locate(position),
                    position,
                    speed: 1.4,
                },
                in_view: &in_view,
            };
            streamer.update(&mut source, &frame, &mut changes);
            n_late += usize::from(!changes.stand_ins.is_empty());
        }
        let counts = streamer.counts();
        println!(
            "{:5.1} s: {} pieces came, {} bytes in memory, {n_late} frames with a stand-in so far",
            now.as_secs_f64(),
            counts.n_loaded,
            counts.n_kept,
        );
    }
    assert!(streamer.view_settled());
    Ok(())
}
