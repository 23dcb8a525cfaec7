//! Time to place a piece, and to make one world of a level.

use std::time::Instant;

use anyhow::Context;
use enfilade::kit::{InstanceId, Link, PlaceOptions};

use super::scenes::level;
use crate::measure::{cpu_seconds, quantile};
use crate::rows::Figure;

/// Pieces taken away and placed again.
const PLACED: usize = 300;

/// Milliseconds to place a piece with one attachment where it stood, in the level and in its space: the slowest of a hundred.
pub(super) fn place(scene: &str) -> anyhow::Result<Figure> {
    let mut level = level(scene)?.level;
    let mut space = level.space()?;
    let n = level.len();
    let ends = level
        .instances()
        .filter_map(|(id, instance)| match instance.links[..] {
            [Link::Joined(onto)] => Some((id, instance.piece, onto)),
            _ => None,
        });
    let ends: Vec<(InstanceId, usize, _)> = ends.collect();
    let step = (ends.len() / PLACED).max(1);
    let mut times = Vec::new();
    for (id, piece, onto) in ends.into_iter().step_by(step) {
        level.remove(id)?;
        space.follow(&level)?;
        let start = Instant::now();
        level.place(piece, 0, onto, &PlaceOptions::default())?;
        space.follow(&level)?;
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    anyhow::ensure!(
        times.len() > 20,
        "{} pieces have one attachment",
        times.len()
    );
    let slow = quantile(&mut times, 0.99);
    let note = format!(
        "ms; {:.3} ms in the middle of {}; {n} instances",
        quantile(&mut times, 0.5),
        times.len()
    );
    Ok(Figure::new(slow, 2.0, note))
}

/// Seconds of processor time to make one world of a level for each portal, in multiples of those of a level of a tenth.
pub(super) fn flatten(scene: &str) -> anyhow::Result<Figure> {
    let (kind, n) = scene.rsplit_once('-').context("a kind and a number")?;
    let small = format!("{kind}-{}", n.parse::<usize>()? / 10);
    let measure = |scene: &str| -> anyhow::Result<[f64; 2]> {
        let level = level(scene)?.level;
        let mut times = Vec::new();
        let mut n_portals = 0;
        for _ in 0..5 {
            let start = cpu_seconds();
            n_portals = level.flattened()?.graph.portals.len();
            times.push(cpu_seconds() - start);
        }
        let time = quantile(&mut times, 0.5);
        Ok([time, time / n_portals as f64])
    };
    let ([_, few], [time, many]) = (measure(&small)?, measure(scene)?);
    let note = format!(
        "{time:.3} s; {:.3} ms a portal, {:.3} in {small}",
        many * 1e3,
        few * 1e3
    );
    Ok(Figure::new(many / few, 1.5, note))
}
