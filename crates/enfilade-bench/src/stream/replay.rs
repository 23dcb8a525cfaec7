//! Replays of recorded walks over a simulated link.

use std::time::Duration;

use enfilade::stream::{Changes, Eye, Frame, LinkOptions, SimulatedLink, StreamOptions, Streamer};

use super::site::{FRAME, Site, Step, Walk};

/// Longest time to load the first view.
const MOST_FRAMES: u32 = 600 * 60;

/// The outcome of a replay.
#[derive(Default)]
pub(super) struct Outcome {
    /// Pieces in view and not in memory, summed over the frames.
    pub(super) n_absent: usize,
    /// Frames with such a piece.
    pub(super) n_frames: usize,
    /// Size in transit of all requests. [Units: bytes]
    pub(super) n_bytes: u64,
    pub(super) n_requests: u64,
    /// Time until the first view was settled.
    pub(super) start: Duration,
}

/// Replays a walk: the walker waits until the first view is settled, and then walks.
pub(super) fn replay(
    site: &Site,
    walk: &Walk,
    options: StreamOptions,
    link: LinkOptions,
) -> Outcome {
    let mut link = SimulatedLink::new(site.catalog(), link);
    let catalog = site.catalog().clone();
    let pvs = Some(site.pvs.clone());
    let mut streamer = Streamer::new(catalog, &site.world.graph, pvs, options);
    let mut changes = Changes::default();
    let mut out = Outcome::default();
    let Some(first) = walk.steps.first() else {
        return out;
    };
    let mut now = Duration::ZERO;
    let mut frame = |now, step: &Step, streamer: &mut Streamer| {
        link.advance(now);
        streamer.update(&mut link, &frame_of(walk, step, now), &mut changes);
    };
    for _ in 0..MOST_FRAMES {
        frame(now, first, &mut streamer);
        if streamer.settled() {
            break;
        }
        now += FRAME;
    }
    out.start = now;
    for step in &walk.steps {
        frame(out.start + FRAME + step.now, step, &mut streamer);
        let is_absent = |p: &&_| !streamer.is_resident(**p);
        let n = step.visible.iter().filter(is_absent).count();
        out.n_absent += n;
        out.n_frames += usize::from(n > 0);
    }
    let counts = streamer.counts();
    (out.n_bytes, out.n_requests) = (counts.bytes_requested, counts.n_requests);
    out
}

/// Returns the input of a frame.
pub(super) fn frame_of<'a>(walk: &Walk, step: &'a Step, now: Duration) -> Frame<'a> {
    Frame {
        now,
        eye: Eye {
            cell: Some(step.cell),
            position: step.at,
            speed: walk.speed,
        },
        in_view: &step.in_view,
    }
}
