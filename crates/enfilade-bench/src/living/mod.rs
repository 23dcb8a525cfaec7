//! `bench living`: what lives in worlds, figure by figure with its bar.
//!
//! A row is a file beside this one and a line in [`ROWS`].

mod actors;
mod bodies;

use crate::rows::Measure::{Baked, Made};
use crate::rows::Row;

pub(crate) const ROWS: &[Row] = &[
    Row {
        name: "bodies: missed",
        scenes: &["offices-1000"],
        measure: Made(bodies::missed_in),
    },
    Row {
        name: "bodies: missed",
        scenes: &["institute"],
        measure: Baked(bodies::missed),
    },
    Row {
        name: "bodies: candidates",
        scenes: &["offices-1000"],
        measure: Made(bodies::candidates_in),
    },
    Row {
        name: "bodies: candidates",
        scenes: &["institute"],
        measure: Baked(bodies::candidates),
    },
    Row {
        name: "bodies: time",
        scenes: &["offices-1000"],
        measure: Made(bodies::time_in),
    },
    Row {
        name: "bodies: time",
        scenes: &["institute"],
        measure: Baked(bodies::time),
    },
    Row {
        name: "actors: state",
        scenes: &["offices-10000"],
        measure: Made(actors::state),
    },
    Row {
        name: "actors: cost",
        scenes: &["offices-10000"],
        measure: Made(actors::cost),
    },
];
