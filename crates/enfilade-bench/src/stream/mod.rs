//! Worlds in pieces over a simulated link in virtual time, each figure with its bar.
//!
//! To add a row, add a file beside this one and a line in [`ROWS`].

mod budget;
mod cost;
mod eviction;
mod first;
mod pops;
mod replay;
mod settled;
mod site;
mod size;

pub(crate) use size::{TownStep, run_step};

use crate::rows::Row;
pub(crate) use first::furnished;

/// Real buildings to walk in.
const BUILDINGS: &[&str] = &[
    "institute",
    "duplex",
    "fzk-haus",
    "recast-dungeon",
    "clinic",
];
/// Generated towns.
const TOWNS: &[&str] = &["offices-1000"];
/// A generated town that is furnished to 2 GB.
const LARGE: &[&str] = &["offices-10000"];

pub(crate) const ROWS: &[Row] = &[
    Row::made("settled", TOWNS, settled::settled_in),
    Row::baked("settled", BUILDINGS, settled::settled),
    Row::made("no pops", TOWNS, pops::pops_in),
    Row::baked("no pops", BUILDINGS, pops::pops),
    Row::made("bytes: radius", TOWNS, pops::radius_in),
    Row::baked("bytes: radius", BUILDINGS, pops::radius),
    Row::made("bytes: reached", TOWNS, pops::reached_in),
    Row::baked("bytes: reached", BUILDINGS, pops::reached),
    Row::made("eviction: Belady", TOWNS, eviction::belady_in),
    Row::baked("eviction: Belady", BUILDINGS, eviction::belady),
    Row::made("eviction: peers", TOWNS, eviction::peers_in),
    Row::baked("eviction: peers", BUILDINGS, eviction::peers),
    Row::made("budget", &["random"], budget::budget),
    Row::made("faults", TOWNS, settled::faults_in),
    Row::baked("faults", BUILDINGS, settled::faults),
    Row::baked(
        "first picture",
        &["institute", "clinic"],
        first::first_picture,
    ),
    Row::made("cost of a frame: idle", &["offices-10000"], cost::idle),
    Row::made("cost of a frame: moving", &["offices-10000"], cost::moving),
    Row::made("size: memory", LARGE, size::memory_of),
    Row::made("size: absent", LARGE, size::absent),
    Row::made("size: first picture", LARGE, size::first_picture),
];
