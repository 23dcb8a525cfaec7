//! Memory of levels as instances, and as worlds in one piece.

use std::hint::black_box;

use anyhow::Context;
use enfilade::world::Space;

use super::LevelStep;
use super::scenes::level;
use crate::measure::memory;
use crate::process::step;
use crate::rows::Figure;

/// Levels held at once, after as many that take up what was freed before: of instances, and in one piece.
const COPIES: [usize; 2] = [40, 4];

/// Memory of a level as a space of instances, as a share of that of its flattened world as a space.
pub(super) fn instances(scene: &str) -> anyhow::Result<Figure> {
    let held = |how| {
        step(&["level-step", how, scene])?
            .as_f64()
            .context("a number")
    };
    let (instances, flattened) = (held("instances")?, held("flattened")?);
    let note = format!("{:.2} of {:.2} MB", instances / 1e6, flattened / 1e6);
    Ok(Figure::new(instances / flattened, 0.1, note))
}

/// Returns the memory that a level takes. [Units: bytes]
pub(super) fn measure(step: LevelStep, scene: &str) -> anyhow::Result<f64> {
    let level = level(scene)?.level;
    let make = || -> anyhow::Result<Space> {
        Ok(match step {
            LevelStep::Instances => level.space()?.space,
            LevelStep::Flattened | LevelStep::Edit => Space::new(level.flattened()?)?,
        })
    };
    let n = COPIES[usize::from(step == LevelStep::Flattened)];
    let mut held = Vec::new();
    let mut before = 0;
    for k in 0..2 * n {
        if k == n {
            before = memory("VmRSS");
        }
        held.push(make()?);
    }
    let after = memory("VmRSS");
    black_box(&held);
    Ok(after.saturating_sub(before) as f64 / n as f64)
}
