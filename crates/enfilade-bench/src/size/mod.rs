//! Size: what holds for inputs of any size; growth; levels put together from many pieces.
//!
//! A [`SizeStep`] is measured in a process of its own.

mod bakes;
pub(crate) mod growth;
pub(crate) mod levels;
mod pvs;
mod shards;

use crate::rows::Row;

/// Generated towns, and the largest of them.
const TOWNS: &[&str] = &["town-1000", "town-10000", "town-100000"];
const LARGE: &[&str] = &["town-100000"];
/// Houses in one outdoor cell, into which thousands of windows look.
const VILLAGES: &[&str] = &["village-5000"];

/// Office towers, shared buildings, and those of them that are put on land.
const TOWER: &[&str] = &["tower-1024"];
const TOWERS: &[&str] = &["tower-1024", "tower-10240"];
const HIGH_TOWER: &[&str] = &["tower-10240"];
const CLINIC: &[&str] = &["clinic"];
const HOUSE: &[&str] = &["fzk-haus"];
const BUILDINGS: &[&str] = &["fzk-haus", "jasmin-sun", "institute", "duplex"];

pub(crate) const ROWS: &[Row] = &[
    Row::made("bake: growth", TOWER, bakes::growth),
    Row::made("bake: seconds", TOWERS, bakes::seconds),
    Row::named("bake: seconds", CLINIC, bakes::seconds_shared),
    Row::made("bake: memory", HIGH_TOWER, bakes::memory),
    Row::made("bsp: time", TOWER, bakes::bsp_time),
    Row::made("bsp: memory", TOWER, bakes::bsp_memory),
    Row::named("land: seconds", HOUSE, bakes::seconds_on_land),
    Row::named("land: rooms lost", BUILDINGS, bakes::lost_on_land),
    Row::named("land: rooms lost of three", BUILDINGS, bakes::lost_on_site),
    Row::named("shards: differing", BUILDINGS, shards::differing),
    Row::named("shards: time of two", BUILDINGS, shards::time_of_two),
    Row::made("pvs: memory", LARGE, pvs::memory_of),
    Row::made("pvs: rate", LARGE, pvs::rate),
    Row::made("pvs: missed", TOWNS, pvs::missed),
    Row::made("pvs: missed", VILLAGES, pvs::missed),
];

/// Measurements that need a process of their own, as its memory counts.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum SizeStep {
    /// Compute what is visible in a generated town, and follow lines through it.
    Pvs,
}

/// Runs a step on a scene; prints its figures as a line of JSON.
pub(crate) fn run_step(step: SizeStep, scene: &str) -> anyhow::Result<()> {
    let figures = match step {
        SizeStep::Pvs => pvs::measure(scene)?,
    };
    println!("{figures}");
    Ok(())
}
