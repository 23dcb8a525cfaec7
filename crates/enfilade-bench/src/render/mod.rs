//! Pictures: special portals, lamps, and doorways drawn as textures.

mod lamps;
mod specials;
pub(crate) mod textures;

use crate::rows::Row;

/// Real buildings with doors.
const LIVED_IN: &[&str] = &["duplex", "institute", "fzk-haus"];
/// Real buildings whose doorways become special.
const BUILDINGS: &[&str] = &["kit-edc", "institute", "smiley-west"];

/// Lamps of buildings.
pub(crate) const LAMPS: &[Row] = &[Row::baked("lamps", LIVED_IN, lamps::pictures)];

/// Views through special portals.
pub(crate) const SPECIALS: &[Row] = &[
    Row::made("mirrors", &["offices-8"], specials::mirrors_in),
    Row::baked("mirrors", BUILDINGS, specials::mirrors),
    Row::made("teleporters", &["offices-8"], specials::teleporters_in),
    Row::baked("teleporters", BUILDINGS, specials::teleporters),
    Row::made("passes", &["offices-8"], specials::passes_in),
    Row::baked("passes", BUILDINGS, specials::passes),
];
