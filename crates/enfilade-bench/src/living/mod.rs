//! `bench living`: what lives in worlds, figure by figure with its bar.
//!
//! A row is a file beside this one and a line in [`ROWS`].

mod graphs;
mod paths;
mod sound;

use crate::rows::Measure::{Baked, Made};
use crate::rows::Row;

/// Graphs of 1,500 cells.
const GRAPHS: &[&str] = &["tower-1500", "city-1500", "lattice-1500"];

pub(crate) const ROWS: &[Row] = &[
    Row {
        name: "paths: distances",
        scenes: GRAPHS,
        measure: Made(paths::distances),
    },
    Row {
        name: "paths: contraction",
        scenes: &["tower-1500", "city-1500"],
        measure: Made(paths::contraction),
    },
    Row {
        name: "paths: next hop",
        scenes: GRAPHS,
        measure: Made(paths::next_hop),
    },
    Row {
        name: "paths: door flip",
        scenes: &["tower-1500", "city-1500"],
        measure: Made(paths::door_flip),
    },
    Row {
        name: "paths: flip, mean",
        scenes: &["lattice-1500"],
        measure: Made(paths::mean_flip),
    },
    Row {
        name: "paths: length",
        scenes: &["institute"],
        measure: Baked(paths::institute),
    },
    Row {
        name: "paths: length",
        scenes: &["recast-dungeon"],
        measure: Baked(paths::dungeon),
    },
    Row {
        name: "sound: length",
        scenes: &["offices-16"],
        measure: Made(sound::length),
    },
    Row {
        name: "sound: direction",
        scenes: &["offices-16"],
        measure: Made(sound::direction),
    },
    Row {
        name: "sound: doorway",
        scenes: &["offices-100"],
        measure: Made(sound::doorway),
    },
    Row {
        name: "sound: doorway",
        scenes: &["institute"],
        measure: Baked(sound::doorway_baked),
    },
    Row {
        name: "sound: reverb",
        scenes: &["coupled-rooms"],
        measure: Made(sound::reverb),
    },
    Row {
        name: "sound: cost",
        scenes: &["offices-1000"],
        measure: Made(sound::cost),
    },
];
