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
    Row::built("settled", TOWNS, site::offices, settled::settled),
    Row::baked("settled", BUILDINGS, settled::settled),
    Row::built("no pops", TOWNS, site::offices, pops::pops),
    Row::baked("no pops", BUILDINGS, pops::pops),
    Row::built("bytes: radius", TOWNS, site::offices, pops::radius),
    Row::baked("bytes: radius", BUILDINGS, pops::radius),
    Row::built("bytes: reached", TOWNS, site::offices, pops::reached),
    Row::baked("bytes: reached", BUILDINGS, pops::reached),
    Row::built("eviction: Belady", TOWNS, site::offices, eviction::belady),
    Row::baked("eviction: Belady", BUILDINGS, eviction::belady),
    Row::built("eviction: peers", TOWNS, site::offices, eviction::peers),
    Row::baked("eviction: peers", BUILDINGS, eviction::peers),
    Row::made("budget", &["random"], budget::budget),
    Row::built("faults", TOWNS, site::offices, settled::faults),
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
