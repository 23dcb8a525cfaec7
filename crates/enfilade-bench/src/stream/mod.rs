//! `bench stream`: worlds in pieces over a simulated link in virtual time, each figure with its bar.
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

use crate::living::{baked, made};
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
    made("settled", TOWNS, settled::settled_in),
    baked("settled", BUILDINGS, settled::settled),
    made("no pops", TOWNS, pops::pops_in),
    baked("no pops", BUILDINGS, pops::pops),
    made("bytes: radius", TOWNS, pops::radius_in),
    baked("bytes: radius", BUILDINGS, pops::radius),
    made("bytes: reached", TOWNS, pops::reached_in),
    baked("bytes: reached", BUILDINGS, pops::reached),
    made("eviction: Belady", TOWNS, eviction::belady_in),
    baked("eviction: Belady", BUILDINGS, eviction::belady),
    made("eviction: peers", TOWNS, eviction::peers_in),
    baked("eviction: peers", BUILDINGS, eviction::peers),
    made("budget", &["random"], budget::budget),
    made("faults", TOWNS, settled::faults_in),
    baked("faults", BUILDINGS, settled::faults),
    baked(
        "first picture",
        &["institute", "clinic"],
        first::first_picture,
    ),
    made("cost of a frame: idle", &["offices-10000"], cost::idle),
    made("cost of a frame: moving", &["offices-10000"], cost::moving),
    made("size: memory", LARGE, size::memory_of),
    made("size: absent", LARGE, size::absent),
    made("size: first picture", LARGE, size::first_picture),
];
