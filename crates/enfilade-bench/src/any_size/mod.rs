//! `bench any-size`: what holds for inputs of any size, each figure with its bar.
//!
//! To add rows, add a file for their family beside this one and lines in [`ROWS`]. What is measured in a process of its
//! own is a [`SizeStep`].

mod bakes;
mod pvs;
mod shards;

use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, ensure};
use serde_json::Value;

use crate::living::{made, named};
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
    made("bake: growth", TOWER, bakes::growth),
    made("bake: seconds", TOWERS, bakes::seconds),
    named("bake: seconds", CLINIC, bakes::seconds_shared),
    made("bake: memory", HIGH_TOWER, bakes::memory),
    made("bsp: time", TOWER, bakes::bsp_time),
    made("bsp: memory", TOWER, bakes::bsp_memory),
    named("land: seconds", HOUSE, bakes::seconds_on_land),
    named("land: rooms lost", BUILDINGS, bakes::lost_on_land),
    named("land: rooms lost of three", BUILDINGS, bakes::lost_on_site),
    named("shards: differing", BUILDINGS, shards::differing),
    named("shards: time of two", BUILDINGS, shards::time_of_two),
    made("pvs: memory", LARGE, pvs::memory_of),
    made("pvs: rate", LARGE, pvs::rate),
    made("pvs: missed", TOWNS, pvs::missed),
    made("pvs: missed", VILLAGES, pvs::missed),
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

/// Runs a step in a process of its own; returns its figures.
fn in_process(step: &str, scene: &str) -> anyhow::Result<Value> {
    let program: PathBuf = std::env::current_exe().context("this program has no path")?;
    let mut command = Command::new(program);
    command.args(["size-step", step, scene]);
    let output = command.output().context("cannot start this program")?;
    ensure!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    Ok(serde_json::from_slice(&output.stdout)?)
}
