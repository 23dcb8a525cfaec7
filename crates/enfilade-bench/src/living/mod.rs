//! `bench living`: things that live in worlds, each figure with its bar.
//!
//! To add a row, add a file beside this one and a line in [`ROWS`].

mod actors;
mod askers;
mod bodies;
mod buildings;
mod decays;
mod graphs;
mod lamps;
mod lengths;
mod levels;
mod parts;
mod paths;
mod rooms;
mod solids;
mod sound;
mod things;
mod walk;
mod walls;

use enfilade::cpg::World;

use crate::rows::{Figure, Measure, Row};

/// Graphs of 1,500 cells.
const GRAPHS: &[&str] = &["tower-1500", "city-1500", "lattice-1500"];
/// Real buildings with doors.
const LIVED_IN: &[&str] = &["duplex", "institute", "fzk-haus"];
/// Real buildings to listen in.
const HEARD_IN: &[&str] = &[
    "institute",
    "duplex",
    "fzk-haus",
    "clearpath-office",
    "smiley-west",
];
/// Real buildings to walk in.
const WALKED_IN: &[&str] = &[
    "duplex",
    "institute",
    "fzk-haus",
    "samplehouse4",
    "kit-edc",
    "jasmin-sun",
    "aws-small-house",
    "clearpath-office",
    "recast-dungeon",
    "procthor4",
    "janesville",
    "smiley-west",
];
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
/// Those of the graphs that contract.
const CONTRACTING: &[&str] = &["tower-1500", "city-1500"];

/// Numbers of moving parts.
const PARTS: &[&str] = &["cabins-10", "cabins-100", "cabins-1600"];

pub(crate) const ROWS: &[Row] = &[
    made("cells of things", &["offices-1000"], things::cells),
    baked("cells of things", LIVED_IN, buildings::cells),
    made("moving", &["offices-1000"], things::moved),
    made("moving: stays", &["offices-1000"], things::stays),
    made("moving: crosses", &["offices-1000"], things::crosses),
    made("moving portals", &["cabin"], rooms::passings),
    made("moving rooms", &["cabins"], rooms::poses),
    baked("moving rooms", LIVED_IN, buildings::poses),
    made("moving rooms: far", &["cabins"], rooms::far),
    made(
        "rooms that move, all askers",
        &["lift-tower"],
        askers::tower,
    ),
    baked("rooms that move, all askers", LIVED_IN, askers::entrance),
    made("parts: one", PARTS, parts::one),
    made("parts: all", &["cabins-1600"], parts::all),
    made("docking", &["cabins"], parts::docking),
    baked("docking", LIVED_IN, buildings::docking),
    made("maze with movers", &["maze"], things::maze),
    made("lights", &["offices-1000"], rooms::lamps),
    baked("lights", LIVED_IN, buildings::lights),
    baked("lamps", LIVED_IN, lamps::pictures),
    made("cost", &["offices-10000"], rooms::cost),
    made("bodies: missed", &["offices-1000"], bodies::missed_in),
    baked("bodies: missed", &["institute"], bodies::missed),
    made(
        "bodies: candidates",
        &["offices-1000"],
        bodies::candidates_in,
    ),
    baked("bodies: candidates", &["institute"], bodies::candidates),
    made("bodies: time", &["offices-1000"], bodies::time_in),
    baked("bodies: time", &["institute"], bodies::time),
    made("actors: state", &["offices-10000"], actors::state),
    baked("actors: state", LIVED_IN, actors::state_in),
    made("actors: cost", &["offices-10000"], actors::cost),
    made("paths: distances", GRAPHS, paths::distances),
    made("paths: contraction", CONTRACTING, paths::contraction),
    made("paths: next hop", GRAPHS, paths::next_hop),
    made("paths: door flip", CONTRACTING, paths::door_flip),
    made("paths: flip, mean", &["lattice-1500"], paths::mean_flip),
    made("paths: search", &["offices-1000"], paths::search),
    baked("paths: length", &["institute"], paths::institute),
    baked("paths: length", &["recast-dungeon"], paths::dungeon),
    baked("walk", WALKED_IN, walk::walk),
    made("sound: length", &["offices-16"], sound::length),
    made("sound: direction", &["offices-16"], sound::direction),
    baked("sound: lengths", &["duplex"], lengths::duplex),
    baked("sound: lengths", &["fzk-haus"], lengths::fzk_haus),
    baked("sound: lengths", &["institute"], lengths::institute),
    made("levels", &["offices-100"], levels::level_in),
    baked("levels", HEARD_IN, levels::level),
    made("levels: directions", &["offices-100"], levels::direction_in),
    baked("levels: directions", HEARD_IN, levels::direction),
    made("levels: lengths", &["offices-100"], levels::length_in),
    baked("levels: lengths", HEARD_IN, levels::length),
    made("sound: reverb", &["coupled-rooms"], sound::reverb),
    made("reverberation: RT60", &["boxes"], decays::rt60),
    named("reverberation: areas", WITH_ROOMS, walls::areas),
    made("sound: cost", &["offices-1000"], sound::cost),
    made(
        "sound: cost, a door moving",
        &["offices-1000"],
        sound::cost_of_door,
    ),
];

pub(crate) const fn made(
    name: &'static str,
    scenes: &'static [&'static str],
    measure: fn(&str) -> anyhow::Result<Figure>,
) -> Row {
    let measure = Measure::Made(measure);
    Row {
        name,
        scenes,
        measure,
    }
}

pub(crate) const fn baked(
    name: &'static str,
    scenes: &'static [&'static str],
    measure: fn(&World) -> anyhow::Result<Figure>,
) -> Row {
    let measure = Measure::Baked(measure);
    Row {
        name,
        scenes,
        measure,
    }
}

pub(crate) const fn named(
    name: &'static str,
    scenes: &'static [&'static str],
    measure: fn(&World, &str) -> anyhow::Result<Figure>,
) -> Row {
    let measure = Measure::Named(measure);
    Row {
        name,
        scenes,
        measure,
    }
}
