//! Views: what is in view is there once the streamer says so. And the same with faults.

use std::collections::HashSet;
use std::time::Duration;

use anyhow::{Context, ensure};
use enfilade::World;
use enfilade::runtime::View;
use enfilade::stream::{
    Changes, Eye, InView, PieceId, Policy, SimulatedLink, SimulatedLinkOptions, StandInCause,
    StreamFrame, StreamOptions, Streamer,
};
use enfilade_testkit::Rng;

use super::site::{FRAME, Recorder, Streamed};
use crate::rows::Figure;

const VIEWS: usize = 1000;
/// Most frames until a view is settled: five minutes.
const MOST_FRAMES: u32 = 18_000;
const VIEWS_WITH_FAULTS: usize = 100;

/// A view at rest.
pub(super) struct Stand {
    pub(super) eye: Eye,
    pub(super) in_view: Vec<InView>,
    pub(super) visible: Vec<PieceId>,
}

pub(super) fn draw_stands(site: &Streamed, n: usize) -> anyhow::Result<Vec<Stand>> {
    let mut rng = Rng::new(5);
    let mut recorder = Recorder::new(site);
    let rooms: Vec<_> = site.world.graph.indoor_cells().collect();
    let mut out = Vec::new();
    for _ in 0..1000 * n {
        if out.len() == n {
            break;
        }
        let (id, room) = rooms[rng.below(rooms.len())];
        let [low, high] = room.aabb;
        let at = [0, 1, 2].map(|k| low[k] + (high[k] - low[k]) * rng.unit() as f32);
        if site.sight.locate(at) != Some(id) {
            continue;
        }
        let angle = rng.range(0.0, std::f64::consts::TAU);
        let toward = [angle.cos() as f32, 0.0, angle.sin() as f32];
        let view = View::perspective(at, toward, [0.0, 1.0, 0.0], 1.047, 16.0 / 9.0)?;
        let (cell, in_view, visible) = recorder.see(&view, at).context("the eye is lost")?;
        out.push(Stand {
            eye: Eye {
                cell: Some(cell),
                position: at,
                speed: 1.4,
            },
            in_view,
            visible,
        });
    }
    ensure!(out.len() == n, "too few eyes");
    Ok(out)
}

/// Counts pieces in view that are absent in settled views, from a memory that holds no more than one and a half of the largest
/// view.
pub(super) fn settled(world: &World) -> anyhow::Result<Figure> {
    let site = Streamed::of(world)?;
    let stands = draw_stands(&site, VIEWS)?;
    let of_view = |stand: &Stand| {
        let cells = stand.in_view.iter();
        let pieces = cells.flat_map(|v| site.catalog().pieces_of(v.cell));
        let pieces: HashSet<PieceId> = pieces.copied().collect();
        site.resident(pieces)
    };
    let largest = stands.iter().map(of_view).max().unwrap_or(0);
    let options = StreamOptions {
        max_resident: largest + largest / 2,
        ..StreamOptions::default()
    };
    let mut link = SimulatedLink::new(site.catalog(), SimulatedLinkOptions::default());
    let catalog = site.catalog().clone();
    let pvs = Some(site.pvs.clone());
    let mut streamer = Streamer::new(catalog, &site.world.graph, pvs, options);
    let (mut now, mut n_absent, mut n_visible, mut n_hung) = (Duration::ZERO, 0, 0, 0);
    for stand in &stands {
        n_hung += usize::from(!rest(
            &mut streamer,
            &mut link,
            stand,
            &mut now,
            &mut |_| (),
        ));
        n_visible += stand.visible.len();
        let is_absent = |p: &&PieceId| !streamer.is_resident(**p);
        n_absent += stand.visible.iter().filter(is_absent).count();
    }
    let note = format!("of {n_visible} pieces in {VIEWS} views; {n_hung} views not settled");
    Ok(Figure::new((n_absent + n_hung) as f64, 0.0, note))
}

/// Returns the number of cells in view of which a piece has failed.
fn n_failing_in(changes: &Changes) -> usize {
    let causes = changes.stand_ins.iter().map(|s| s.cause);
    causes.filter(|c| *c == StandInCause::Failing).count()
}

/// Rests in a view until it is settled. Returns `false` if it is not after five minutes.
fn rest(
    streamer: &mut Streamer,
    link: &mut SimulatedLink,
    stand: &Stand,
    now: &mut Duration,
    each: &mut dyn FnMut(&Changes),
) -> bool {
    let mut changes = Changes::default();
    for _ in 0..MOST_FRAMES {
        *now += FRAME;
        link.advance(*now);
        let frame = StreamFrame {
            now: *now,
            eye: stand.eye,
            in_view: &stand.in_view,
        };
        streamer.update(link, &frame, &mut changes);
        each(&changes);
        if streamer.settled() {
            return true;
        }
    }
    false
}

/// Counts views whose settled pieces differ from those without faults, that do not settle, or whose faults are not told. Faults
/// are errors of 10 % of the requests, 30 % short reads, and a link that is cut for two seconds in each view.
pub(super) fn faults(world: &World) -> anyhow::Result<Figure> {
    let site = Streamed::of(world)?;
    let stands = draw_stands(&site, VIEWS_WITH_FAULTS)?;
    let all: u64 = site.resident((0..site.catalog().pieces().len() as u32).map(PieceId));
    // A horizon of nothing: what is settled does not depend on how long it took.
    let options = StreamOptions {
        policy: Policy::Prefetch {
            horizon: Duration::ZERO,
        },
        max_resident: all,
        ..StreamOptions::default()
    };
    let (mut n_different, mut n_hung, mut n_told, mut n_untold) = (0, 0, 0, 0);
    for (seed, stand) in (0..).zip(&stands) {
        let mut sets = Vec::new();
        for has_faults in [false, true] {
            let rate = |r: f64| if has_faults { r } else { 0.0 };
            let link = SimulatedLinkOptions {
                error_rate: rate(0.1),
                short_read_rate: rate(0.3),
                seed,
                ..SimulatedLinkOptions::default()
            };
            let mut link = SimulatedLink::new(site.catalog(), link);
            let pvs = Some(site.pvs.clone());
            let catalog = site.catalog().clone();
            let mut streamer = Streamer::new(catalog, &site.world.graph, pvs, options.clone());
            let mut now = Duration::ZERO;
            let mut told = 0;
            if has_faults {
                let mut changes = Changes::default();
                let mut n_failing = 0;
                for i in 0..140 {
                    link.set_down((1..126).contains(&i));
                    now += FRAME;
                    link.advance(now);
                    let frame = StreamFrame {
                        now,
                        eye: stand.eye,
                        in_view: &stand.in_view,
                    };
                    streamer.update(&mut link, &frame, &mut changes);
                    told += changes.failed.len();
                    n_failing += n_failing_in(&changes);
                }
                n_untold += usize::from(told == 0 || n_failing == 0);
            }
            let mut count = |c: &Changes| told += c.failed.len();
            let is_settled = rest(&mut streamer, &mut link, stand, &mut now, &mut count);
            n_hung += usize::from(!is_settled);
            n_told += told;
            let pieces = (0..site.catalog().pieces().len() as u32).map(PieceId);
            sets.push(
                pieces
                    .filter(|p| streamer.is_resident(*p))
                    .collect::<Vec<_>>(),
            );
        }
        n_different += usize::from(sets[0] != sets[1]);
    }
    let value = (n_different + n_hung + n_untold) as f64;
    let note = format!(
        "of {VIEWS_WITH_FAULTS} views; {n_different} settled otherwise, {n_hung} not settled, {n_untold} untold; \
             {n_told} failures told"
    );
    Ok(Figure::new(value, 0.0, note))
}
