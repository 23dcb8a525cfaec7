//! Levels put together from pieces: what they cost, edits, and the same as one bake.

mod bad;
mod city;
mod edited;
mod memory;
mod rebaked;
mod scenes;
mod speed;
mod stitched;
mod undone;

use std::path::Path;

use crate::rows::Row;

/// Levels compared with bakes of their merged meshes, by kind and number of rooms.
const STITCHED: &[&str] = &[
    "dungeon-4",
    "dungeon-40",
    "office-60",
    "maze-100",
    "maze-1000",
];
/// A level of 1,500 instances, and one of a tenth, as those of Gjørup 1999.
const CITY: &[&str] = &["maze-1500"];

/// Scenes that are edited: a real one, and a generated one of so many rooms.
const REBAKED: &[&str] = &["institute", "tower-256"];

/// Kits of random sessions.
const KITS: &[&str] = &["dungeon-kit", "office-kit"];

pub(crate) const ROWS: &[Row] = &[
    Row::made("stitched: cells", STITCHED, stitched::cells),
    Row::made("stitched: portals", STITCHED, stitched::portals),
    Row::made("stitched: promises", STITCHED, stitched::promises),
    Row::made("stitched: pixels", STITCHED, stitched::pixels),
    Row::made("speed: place", &["dungeon-380"], speed::place),
    Row::made("speed: flatten", CITY, speed::flatten),
    Row::made(
        "edit: milliseconds of an operation in the window",
        &["dungeon-380"],
        edited::operation,
    ),
    Row::made(
        "memory: instances",
        &["dungeon-380", "maze-1500"],
        memory::instances,
    ),
    Row::made("city: visible", CITY, city::visible),
    Row::made("city: frame", CITY, city::frame),
    Row::made("city: frame of instances", CITY, city::frame_of_instances),
    Row::made("local rebuild: same", REBAKED, rebaked::same),
    Row::made("local rebuild: time", REBAKED, rebaked::time),
    Row::made("undo: other bytes", KITS, undone::other_bytes),
    Row::made("undo: lost", KITS, undone::lost),
    Row::made("bad input", &["pieces"], bad::taken),
    Row::made(
        "bad input: edits",
        &["dungeon-kit"],
        undone::bad_edits_taken,
    ),
];

/// Measurements that need a process of their own, as its memory counts, or as it is killed.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum LevelStep {
    /// Hold levels as instances.
    Instances,
    /// Hold levels as worlds in one piece.
    Flattened,
    /// Edit with a journal, whose path is the scene.
    Edit,
}

/// Runs a step on a scene; prints its figure.
pub(crate) fn run_step(step: LevelStep, scene: &str) -> anyhow::Result<()> {
    if step == LevelStep::Edit {
        return undone::edit_without_end(Path::new(scene));
    }
    println!("{}", memory::measure(step, scene)?);
    Ok(())
}
