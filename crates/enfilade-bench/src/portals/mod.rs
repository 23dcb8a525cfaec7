//! `bench portals`: special portals, each figure with its bar.
//!
//! To add a row, add a file beside this one and a line in [`ROWS`].

mod passing;
mod pictures;
mod pvs;

use crate::living::{baked, made};
use crate::rows::Row;

/// Real buildings whose doorways become special.
const BUILDINGS: &[&str] = &["kit-edc", "institute", "smiley-west"];

pub(crate) const ROWS: &[Row] = &[
    made("mirrors", &["offices-8"], pictures::mirrors_in),
    baked("mirrors", BUILDINGS, pictures::mirrors),
    made("teleporters", &["offices-8"], pictures::teleporters_in),
    baked("teleporters", BUILDINGS, pictures::teleporters),
    made("passes", &["offices-8"], pictures::passes_in),
    baked("passes", BUILDINGS, pictures::passes),
    made("walking through", &["endless"], passing::steps),
    made("in two places", &["offices-40"], passing::bodies_in),
    baked("in two places", BUILDINGS, passing::bodies),
    made(
        "recursion",
        &["facing-mirrors", "endless", "turned", "ring-100"],
        passing::recursion,
    ),
    baked("PVS", BUILDINGS, pvs::pvs),
    made("bad input", &["offices-4"], passing::bad_input),
];
