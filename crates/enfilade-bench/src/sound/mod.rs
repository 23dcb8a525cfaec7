//! Sound in worlds: levels, directions and lengths, echoes, and the time that it takes.

mod decays;
mod heard;
mod lengths;
mod levels;
mod walls;

use crate::rows::Row;
use levels::{DIRECTION, LENGTH, LEVEL};

/// Real buildings to listen in.
const HEARD_IN: &[&str] = &[
    "institute",
    "duplex",
    "fzk-haus",
    "clearpath-office",
    "smiley-west",
];
/// Real buildings to walk through, listening.
const WALKED: &[&str] = &["duplex", "fzk-haus", "institute", "kit-edc"];
/// Buildings with the shapes of rooms by the author of the model.
const WITH_ROOMS: &[&str] = &[
    "duplex",
    "institute",
    "fzk-haus",
    "samplehouse4",
    "kit-edc",
    "jasmin-sun",
    "janesville",
    "smiley-west",
];

/// Levels, directions, lengths and echoes, and their cost.
pub(crate) const ROWS: &[Row] = &[
    Row::made("sound: length", &["offices-16"], heard::length),
    Row::made("sound: direction", &["offices-16"], heard::direction),
    Row::baked("sound: lengths", &["duplex"], lengths::duplex),
    Row::baked("sound: lengths", &["fzk-haus"], lengths::fzk_haus),
    Row::baked("sound: lengths", &["institute"], lengths::institute),
    Row::made("levels", &["offices-100"], levels::made::<LEVEL>),
    Row::baked("levels", HEARD_IN, levels::baked::<LEVEL>),
    Row::made(
        "levels: directions",
        &["offices-100"],
        levels::made::<DIRECTION>,
    ),
    Row::baked("levels: directions", HEARD_IN, levels::baked::<DIRECTION>),
    Row::made("levels: lengths", &["offices-100"], levels::made::<LENGTH>),
    Row::baked("levels: lengths", HEARD_IN, levels::baked::<LENGTH>),
    Row::made("sound: reverb", &["coupled-rooms"], heard::reverb),
    Row::made("reverberation: RT60", &["boxes"], decays::rt60),
    Row::named("reverberation: areas", WITH_ROOMS, walls::areas),
    Row::baked("sound: cost, mean", WALKED, heard::mean_cost),
    Row::baked("sound: cost, 99th of 100", WALKED, heard::most_cost),
];
