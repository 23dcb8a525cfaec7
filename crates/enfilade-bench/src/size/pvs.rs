//! Visibility in graphs of any size: memory, time for a cell, and the lines that it has to cover.

use std::sync::Arc;

use anyhow::{Context, bail};
use enfilade::cpg::CellId;
use enfilade::geom::DVec3;
use enfilade::vis::{VisConfig, VisContext, see_all};
use enfilade_testkit::{Rng, Town, town, village};
use serde_json::{Value, json};

use crate::kept::Kept;
use crate::measure::{cpu_seconds, memory, quantile};
use crate::process::step;
use crate::rows::Figure;

/// Most memory that the search of a town may take: the bar of the issue. That of a village is too little to search even
/// what a single cell sees. [Units: bytes]
const MOST_MEMORY: u64 = 4 << 30;
const LITTLE_MEMORY: u64 = 64 << 20;
/// Searches of a small town, of whose times the median counts, and the cells from which one is enough.
const REPEATS: usize = 15;
const LARGE: usize = 20_000;
/// Lines followed from random places.
const LINES: usize = 2_000_000;
/// Rooms of a house of a village.
const ROOMS: usize = 5;

fn most_memory(scene: &str) -> u64 {
    if scene.starts_with("village") {
        LITTLE_MEMORY
    } else {
        MOST_MEMORY
    }
}

/// Peak memory of the process. [Units: GiB]
pub(super) fn memory_of(scene: &str) -> anyhow::Result<Figure> {
    let figures = measured(scene)?;
    let number = |name| of(&figures, name);
    let note = format!(
        "GiB; {} cells, {} portals, {} pairs",
        number("cells")?,
        number("portals")?,
        number("pairs")?
    );
    Ok(Figure::new(
        number("peak")? / f64::from(1 << 30),
        MOST_MEMORY as f64 / f64::from(1 << 30),
        note,
    ))
}

/// Seconds for a cell, in multiples of those of the town of 1,000 cells.
pub(super) fn rate(scene: &str) -> anyhow::Result<Figure> {
    let rate = |scene| -> anyhow::Result<f64> {
        let figures = measured(scene)?;
        Ok(1e3 * of(&figures, "seconds")? / of(&figures, "cells")?)
    };
    let (small, large) = (rate("town-1000")?, rate(scene)?);
    let note = format!("{large:.3} and {small:.3} ms of processor time a cell");
    Ok(Figure::new(large / small, 1.5, note))
}

/// Pairs of cells that lines join and the answer lacks. The generator follows the lines by its boxes.
pub(super) fn missed(scene: &str) -> anyhow::Result<Figure> {
    let figures = measured(scene)?;
    let number = |name| of(&figures, name);
    let note = format!(
        "of {} pairs crossed by {LINES} lines; {} of the {} of the answer are not proved",
        number("crossed")?,
        number("undecided")?,
        number("pairs")?
    );
    Ok(Figure::new(number("missed")?, 0.0, note))
}

fn of(figures: &Value, name: &str) -> anyhow::Result<f64> {
    figures[name].as_f64().with_context(|| name.to_owned())
}

/// Returns the figures of a scene, made once.
fn measured(scene: &str) -> anyhow::Result<Arc<Value>> {
    static FOUND: Kept<Value> = Kept::new();
    FOUND.get(scene, || step(&["size-step", "pvs", scene]))
}

/// Makes a town, searches it, and follows lines through it.
pub(super) fn measure(scene: &str) -> anyhow::Result<Value> {
    let (kind, n) = scene.rsplit_once('-').context("a name and a number")?;
    let n: usize = n.parse()?;
    let town = match kind {
        "town" => town(n, 1),
        "village" => village(n.div_ceil(ROOMS), 1),
        _ => bail!("there are towns and villages"),
    };
    let config = VisConfig {
        max_memory: most_memory(scene),
        ..VisConfig::default()
    };
    let mut times = Vec::new();
    let mut found = None;
    for _ in 0..if n < LARGE { REPEATS } else { 1 } {
        let mut context = VisContext {
            on_round: &mut |_, _| true,
            walls: None,
            checkpoint: None,
        };
        let start = cpu_seconds();
        found = Some(see_all(&town.graph, &config, &mut context)?);
        times.push(cpu_seconds() - start);
        // A village takes minutes.
        if times.iter().sum::<f64>() > 20.0 {
            break;
        }
    }
    let peak = memory("VmHWM");
    let vis = found.context("nothing was searched")?;
    let (mut n_crossed, mut n_missed) = (0u64, 0u64);
    follow_all(&town, |a, b| {
        n_crossed += 1;
        n_missed += u64::from(!vis.cells.sees(a, b) || !vis.cells.sees(b, a));
    });
    Ok(json!({
        "cells": town.cells.len(),
        "portals": town.graph.portals.len(),
        "pairs": vis.cells.n_pairs(),
        "undecided": vis.undecided.n_pairs(),
        "seconds": quantile(&mut times, 0.5),
        "peak": peak,
        "crossed": n_crossed,
        "missed": n_missed,
    }))
}

/// Calls `found` with each two cells that a line crosses, the first that in which it begins.
fn follow_all(town: &Town, mut found: impl FnMut(CellId, CellId)) {
    let mut rng = Rng::new(11);
    for _ in 0..LINES {
        let cell = rng.below(town.cells.len()) as u32;
        let from = rng.point_in(&town.cells[cell as usize]);
        if !town.is_in(cell, from) {
            continue;
        }
        // Most cells beside each other are on one floor.
        let direction = rng.turn() * DVec3::X * DVec3::new(1.0, rng.unit(), 1.0);
        town.follow(cell, from, direction, |to| found(CellId(cell), CellId(to)));
    }
}
