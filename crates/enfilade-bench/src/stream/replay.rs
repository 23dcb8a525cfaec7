//! Replays of recorded walks over a simulated link.

use std::time::Duration;

use enfilade::stream::{
    Changes, Eye, PieceId, SimulatedLink, SimulatedLinkOptions, StreamFrame, StreamOptions,
    Streamer,
};

use super::site::{FRAME, Recording, Step, Streamed};

/// Frames after which the walk begins in any case: ten minutes.
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
}

/// Longest time to load the first view. [Units: s]
const FIRST: f64 = 300.0;

/// Replays a walk: the walker waits until the first view is settled, and then walks. A link that would need more than five minutes
/// for the world is faster until then.
pub(super) fn replay(
    site: &Streamed,
    walk: &Recording,
    options: StreamOptions,
    link: SimulatedLinkOptions,
) -> Outcome {
    let bandwidth = link.bandwidth;
    let mut link = SimulatedLink::new(site.catalog(), link);
    let all = (0..site.catalog().pieces().len() as u32).map(PieceId);
    link.set_bandwidth(bandwidth.max(site.packed(all) as f64 / FIRST));
    let catalog = site.catalog().clone();
    let pvs = Some(site.pvs.clone());
    let mut streamer = Streamer::new(catalog, &site.world.graph, pvs, options);
    let mut changes = Changes::default();
    let mut out = Outcome::default();
    let Some(first) = walk.steps.first() else {
        return out;
    };
    let mut now = Duration::ZERO;
    let mut frame = |now, step: &Step, streamer: &mut Streamer, link: &mut SimulatedLink| {
        link.advance(now);
        streamer.update(link, &frame_of(walk, step, now), &mut changes);
    };
    for _ in 0..MOST_FRAMES {
        frame(now, first, &mut streamer, &mut link);
        if streamer.settled() {
            break;
        }
        now += FRAME;
    }
    link.set_bandwidth(bandwidth);
    for step in &walk.steps {
        frame(now + FRAME + step.now, step, &mut streamer, &mut link);
        let is_absent = |p: &&_| !streamer.is_resident(**p);
        let n = step.visible.iter().filter(is_absent).count();
        out.n_absent += n;
        out.n_frames += usize::from(n > 0);
    }
    let counts = streamer.counts();
    out.n_bytes = counts.bytes_requested;
    out
}

/// Returns the input of a frame.
pub(super) fn frame_of<'a>(walk: &Recording, step: &'a Step, now: Duration) -> StreamFrame<'a> {
    StreamFrame {
        now,
        eye: Eye {
            cell: Some(step.cell),
            position: step.at,
            speed: walk.speed,
        },
        in_view: &step.in_view,
    }
}
