//! Sight: views and lines of sight, sets of visible cells, special portals, doors.

mod doors;
pub(crate) mod facade;
mod passing;
mod pvs;
pub(crate) mod see;
mod statistics;
mod subject;
mod visible;
pub(crate) mod walkthrough;

use crate::rows::Row;

pub(crate) use visible::{visible, visible_past_walls};

/// Real buildings whose doorways become special.
const BUILDINGS: &[&str] = &["kit-edc", "institute", "smiley-west"];

/// Special portals: who passes them, how far they are followed, what is seen.
pub(crate) const SPECIALS: &[Row] = &[
    Row::made("walking through", &["endless"], passing::steps),
    Row::made("in two places", &["offices-40"], passing::bodies_in),
    Row::baked("in two places", BUILDINGS, passing::bodies),
    Row::made(
        "recursion",
        &["facing-mirrors", "endless", "turned", "ring-100"],
        passing::recursion,
    ),
    Row::baked("PVS", BUILDINGS, pvs::pvs),
    Row::made("bad input", &["offices-4"], passing::bad_input),
];

/// The value of worlds to programs and modelers.
pub(crate) const VALUE: &[Row] = &[
    Row::baked("doors: no leaf", &["institute"], doors::without_leaf),
    Row::baked("doors: seen through", &["institute"], doors::seen_through),
    Row::baked("doors: pixels lost", &["institute"], doors::pixels_lost),
    Row::baked("statistics", &["institute", "kit-edc"], statistics::measure),
];
