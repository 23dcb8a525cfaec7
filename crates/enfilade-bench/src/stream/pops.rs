//! Pieces in view that are not there, over the least bandwidth that a walk needs, and the bytes that it takes.

use std::collections::HashSet;
use std::time::Duration;

use anyhow::{Context, ensure};
use enfilade::geom::{DVec3, Triangle};
use enfilade::internals::geom::{Bvh, Ray};
use enfilade::internals::stream::{deadlines, due_times, least_bandwidth};
use enfilade::stream::{PieceId, SimulatedLinkOptions, StreamOptions};
use enfilade::{CellId, World};
use enfilade_testkit::Rng;

use super::replay::{Outcome, frame_of, replay};
use super::site::{Recorder, Recording, Streamed, route};
use crate::rows::Figure;

const LATENCY: Duration = Duration::from_millis(50);
/// Speeds of walking and running. [Units: wu/s]
const SPEEDS: [f32; 2] = [1.4, 5.0];
/// Bandwidth of the link on which bytes are counted. [Units: bytes/s]
const NORMAL: f64 = 1e6;
/// Stretches of a walk.
const STRETCHES: usize = 60;
/// Factor over the least bandwidth.
const MORE: f64 = 1.25;
/// Rays from each place of a walk.
const RAYS: usize = 2000;

/// Returns the least bandwidth for a walk: for all ways that it could go on, and for the way that it goes.
fn bandwidths(site: &Streamed, walk: &Recording) -> anyhow::Result<[f64; 2]> {
    let first = walk.steps.first().context("no walk")?;
    let eye = frame_of(walk, first, first.now).eye;
    let any = deadlines(&eye, site.catalog(), &site.world.graph, &site.pvs);
    let cells: Vec<(Duration, CellId)> = walk.steps.iter().map(|s| (s.now, s.cell)).collect();
    let this = due_times(&cells, site.catalog(), &site.pvs);
    Ok([any, this].map(|due| least_bandwidth(&due, site.catalog(), LATENCY)))
}

fn options() -> StreamOptions {
    StreamOptions {
        max_resident: u64::MAX,
        ..StreamOptions::default()
    }
}

fn replay_at(site: &Streamed, walk: &Recording, bandwidth: f64) -> Outcome {
    let link = SimulatedLinkOptions {
        latency: LATENCY,
        bandwidth,
        ..SimulatedLinkOptions::default()
    };
    replay(site, walk, options(), link)
}

/// Counts frame × piece in view and absent.
fn pops_of(site: &Streamed) -> anyhow::Result<Figure> {
    let mut recorder = Recorder::new(site);
    let (mut value, mut notes) = (0, Vec::new());
    for speed in SPEEDS {
        let walk = recorder.walk(&route(site, 1, STRETCHES)?, speed)?;
        let [any, this] = bandwidths(site, &walk)?;
        ensure!(any.is_finite(), "a piece is due within the latency");
        // One byte a second if a walk needs no more than what may be seen at its start.
        let out = replay_at(site, &walk, MORE * any.max(1.0));
        let known = replay_at(site, &walk, MORE * this.max(1.0));
        value += out.n_absent;
        notes.push(format!(
            "{speed} m/s: {} of {} frames with an absent piece at {:.0} B/s; at {:.0} B/s, 1.25 × the least for who knows \
             the way, {}",
            out.n_frames,
            walk.steps.len(),
            MORE * any,
            MORE * this,
            known.n_frames,
        ));
    }
    Ok(Figure::new(value as f64, 0.0, notes.join("; ")))
}

/// Returns the bytes of a walk without pops, divided by those of loading by radius: all pieces of cells within the least radius
/// that holds all that is ever in view, at infinite bandwidth.
fn radius_of(site: &Streamed) -> anyhow::Result<Figure> {
    let mut recorder = Recorder::new(site);
    let walk = recorder.walk(&route(site, 1, STRETCHES)?, SPEEDS[0])?;
    let out = replay_at(site, &walk, NORMAL);
    ensure!(out.n_absent == 0, "{} absent pieces", out.n_absent);
    let graph = &site.world.graph;
    let mut cells_of = vec![Vec::new(); site.catalog().pieces().len()];
    for cell in graph.cell_ids() {
        for piece in site.catalog().pieces_of(cell) {
            cells_of[piece.idx()].push(cell);
        }
    }
    let distance = |at: [f32; 3], cell: CellId| {
        let [low, high] = graph[cell].aabb;
        let d = [0, 1, 2].map(|k| (low[k] - at[k]).max(at[k] - high[k]).max(0.0));
        (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt()
    };
    let mut radius = 0.0_f32;
    for step in &walk.steps {
        for piece in &step.visible {
            let all = cells_of[piece.idx()].iter().map(|c| distance(step.at, *c));
            radius = radius.max(all.fold(f32::INFINITY, f32::min));
        }
    }
    let mut loaded = HashSet::new();
    for step in walk.steps.iter().step_by(10) {
        let near = graph.cell_ids().filter(|c| distance(step.at, *c) <= radius);
        loaded.extend(near.flat_map(|c| site.catalog().pieces_of(c)));
    }
    let by_radius = site.packed(loaded.into_iter().copied());
    let all = site.packed((0..cells_of.len() as u32).map(PieceId));
    let note = format!(
        "{} kB, {} kB by a radius of {radius:.1} m, of {} kB; {} absent",
        out.n_bytes / 1000,
        by_radius / 1000,
        all / 1000,
        out.n_absent,
    );
    Ok(Figure::new(
        out.n_bytes as f64 / by_radius as f64,
        0.5,
        note,
    ))
}

/// Returns the bytes of a walk without pops, divided by those of the pieces of the cells that rays from places on it reach.
fn reached_of(site: &Streamed) -> anyhow::Result<Figure> {
    let mut recorder = Recorder::new(site);
    let walk = recorder.walk(&route(site, 1, STRETCHES)?, SPEEDS[0])?;
    let out = replay_at(site, &walk, NORMAL);
    ensure!(out.n_absent == 0, "{} absent pieces", out.n_absent);
    let world = &site.world;
    let mut triangles: Vec<Triangle> = Vec::new();
    for batch in &world.batches {
        triangles.extend(batch.primitive.triangles());
    }
    let bvh = Bvh::build(&triangles);
    let mut rng = Rng::new(1);
    let mut reached: HashSet<CellId> = HashSet::new();
    let mut last = DVec3::splat(f64::INFINITY);
    let mut n_places = 0;
    for step in &walk.steps {
        let at = DVec3::from_array(step.at.map(f64::from));
        if at.distance(last) < 0.25 {
            continue;
        }
        last = at;
        n_places += 1;
        reached.insert(step.cell);
        for _ in 0..RAYS {
            let ray = Ray {
                origin: at,
                direction: rng.turn() * DVec3::X,
                t_max: 1e4,
            };
            if let Some(hit) = bvh.closest_hit(&ray, |_| false) {
                // A little before the wall.
                let p = at + ray.direction * (hit.t - 0.01).max(0.0);
                reached.extend(world.graph.locate(p.as_vec3().to_array()));
            }
        }
    }
    let pieces: HashSet<PieceId> = reached
        .iter()
        .flat_map(|c| site.catalog().pieces_of(*c))
        .copied()
        .collect();
    let true_bytes = site.packed(pieces);
    let note = format!(
        "{} kB, {} kB of {} cells of {} reached by {RAYS} rays from each of {n_places} places",
        out.n_bytes / 1000,
        true_bytes / 1000,
        reached.len(),
        world.graph.cells.len(),
    );
    Ok(Figure::new(
        out.n_bytes as f64 / true_bytes as f64,
        1.3,
        note,
    ))
}

pub(super) fn pops(world: &World) -> anyhow::Result<Figure> {
    pops_of(&Streamed::of(world)?)
}

pub(super) fn radius(world: &World) -> anyhow::Result<Figure> {
    radius_of(&Streamed::of(world)?)
}

pub(super) fn reached(world: &World) -> anyhow::Result<Figure> {
    reached_of(&Streamed::of(world)?)
}
