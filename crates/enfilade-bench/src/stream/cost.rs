//! The time of a frame.

use std::time::{Duration, Instant};

use enfilade::stream::{Changes, SimulatedLink, SimulatedLinkOptions, StreamOptions, Streamer};
use enfilade_testkit::oracle::near_sets;

use super::replay::frame_of;
use super::site::{FRAME, Recorder, Recording, Streamed, offices, route};
use crate::measure::quantile;
use crate::rows::Figure;

/// Frames that are timed idle.
const IDLE: usize = 20_000;
const STRETCHES: usize = 200;

/// A walk, its streamer after the walk, and the times of its frames. [Units: µs]
struct Timed {
    site: Streamed,
    walk: Recording,
    streamer: Streamer,
    link: SimulatedLink,
    times: Vec<f64>,
    now: Duration,
}

/// Walks among offices whose cells see those behind two portals, over a link of 10 MB/s.
fn walk(scene: &str) -> anyhow::Result<Timed> {
    let world = offices(scene)?;
    let pvs = near_sets(&world.graph);
    let site = Streamed::with_pvs(&world, pvs.clone())?;
    let walk = Recorder::new(&site).walk(&route(&site, 3, STRETCHES)?, 1.4)?;
    let link = SimulatedLinkOptions {
        bandwidth: 1e7,
        ..SimulatedLinkOptions::default()
    };
    let mut link = SimulatedLink::new(site.catalog(), link);
    let catalog = site.catalog().clone();
    let mut streamer = Streamer::new(catalog, &world.graph, Some(pvs), StreamOptions::default());
    let mut changes = Changes::default();
    let (mut times, mut now) = (Vec::new(), Duration::ZERO);
    for step in &walk.steps {
        now += FRAME;
        link.advance(now);
        let frame = frame_of(&walk, step, now);
        let start = Instant::now();
        streamer.update(&mut link, &frame, &mut changes);
        times.push(start.elapsed().as_secs_f64() * 1e6);
    }
    Ok(Timed {
        site,
        walk,
        streamer,
        link,
        times,
        now,
    })
}

fn figure(times: &mut [f64], site: &Streamed) -> Figure {
    let at = [0.5, 0.99, 1.0].map(|share| quantile(times, share));
    let note = format!(
        "µs, 99 of 100 frames; half {:.2}, longest {:.1}; {} frames, {} cells, {} pieces",
        at[0],
        at[2],
        times.len(),
        site.world.graph.cells.len(),
        site.catalog().pieces().len(),
    );
    Figure::new(at[1], 20.0, note)
}

pub(super) fn moving(scene: &str) -> anyhow::Result<Figure> {
    let mut timed = walk(scene)?;
    Ok(figure(&mut timed.times, &timed.site))
}

pub(super) fn idle(scene: &str) -> anyhow::Result<Figure> {
    let mut timed = walk(scene)?;
    let mut changes = Changes::default();
    let mut times = Vec::new();
    if let Some(last) = timed.walk.steps.last() {
        for i in 0..IDLE + 3600 {
            timed.now += FRAME;
            timed.link.advance(timed.now);
            let frame = frame_of(&timed.walk, last, timed.now);
            let start = Instant::now();
            timed.streamer.update(&mut timed.link, &frame, &mut changes);
            let us = start.elapsed().as_secs_f64() * 1e6;
            // A minute until all has come.
            times.extend((i >= 3600).then_some(us));
        }
    }
    Ok(figure(&mut times, &timed.site))
}
