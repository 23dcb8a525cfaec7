//! Life in worlds: things, actors and bodies, rooms that move, ways and walks.

mod actors;
mod askers;
mod bodies;
mod buildings;
mod gaps;
mod graphs;
mod lit;
mod moving;
mod parts;
mod search;
mod solids;
mod things;
mod walk;

use crate::rows::Row;

/// Graphs of 1,500 cells.
const GRAPHS: &[&str] = &["tower-1500", "city-1500", "lattice-1500"];

/// Those of them that contract.
const CONTRACTING: &[&str] = &["tower-1500", "city-1500"];

/// Numbers of moving parts.
const PARTS: &[&str] = &["cabins-10", "cabins-100", "cabins-1600"];

/// Real buildings with doors.
const LIVED_IN: &[&str] = &["duplex", "institute", "fzk-haus"];

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

/// Things in cells, and rooms that move.
pub(crate) const MOVING: &[Row] = &[
    Row::made("cells of things", &["offices-1000"], things::cells),
    Row::baked("cells of things", LIVED_IN, buildings::cells),
    Row::made("moving", &["offices-1000"], things::moved),
    Row::made("moving: stays", &["offices-1000"], things::stays),
    Row::made("moving: crosses", &["offices-1000"], things::crosses),
    Row::made("moving portals", &["cabin"], moving::passings),
    Row::made("moving rooms", &["cabins"], moving::poses),
    Row::baked("moving rooms", LIVED_IN, buildings::poses),
    Row::made("moving rooms: far", &["cabins"], moving::far),
    Row::made(
        "rooms that move, all askers",
        &["lift-tower"],
        askers::tower,
    ),
    Row::baked("rooms that move, all askers", LIVED_IN, askers::entrance),
    Row::made("parts: one", PARTS, parts::one),
    Row::made("parts: all", &["cabins-1600"], parts::all),
    Row::made("docking", &["cabins"], parts::docking),
    Row::baked("docking", LIVED_IN, buildings::docking),
    Row::made("maze with movers", &["maze"], things::maze),
    Row::made("lights", &["offices-1000"], moving::lamps),
    Row::baked("lights", LIVED_IN, buildings::lights),
];

/// Bodies, actors, paths and walks.
pub(crate) const WALKING: &[Row] = &[
    Row::made("cost", &["offices-10000"], moving::cost),
    Row::built(
        "bodies: missed",
        &["offices-1000"],
        bodies::made,
        bodies::missed,
    ),
    Row::baked("bodies: missed", &["institute"], bodies::missed),
    Row::built(
        "bodies: candidates",
        &["offices-1000"],
        bodies::made,
        bodies::candidates,
    ),
    Row::baked("bodies: candidates", &["institute"], bodies::candidates),
    Row::built(
        "bodies: time",
        &["offices-1000"],
        bodies::made,
        bodies::time,
    ),
    Row::baked("bodies: time", &["institute"], bodies::time),
    Row::made("actors: state", &["offices-10000"], actors::state),
    Row::baked("actors: state", LIVED_IN, actors::state_in),
    Row::made("actors: cost", &["offices-10000"], actors::cost),
    Row::made("paths: distances", GRAPHS, search::distances),
    Row::made("paths: contraction", CONTRACTING, search::contraction),
    Row::made("paths: next hop", GRAPHS, search::next_hop),
    Row::made("paths: door flip", CONTRACTING, search::door_flip),
    Row::made("paths: flip, mean", &["lattice-1500"], search::mean_flip),
    Row::made("paths: search", &["offices-1000"], search::search),
    Row::baked("paths: length", &["institute"], search::institute),
    Row::baked("paths: length", &["recast-dungeon"], search::dungeon),
    Row::baked("walk", WALKED_IN, walk::walk),
];
