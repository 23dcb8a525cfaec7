//! Rooms and doors: as architects mean them, clean, spoilt, disturbed and merged; what a bake says of itself; other builders.

mod advice;
mod axes;
mod bakes;
mod bars;
pub(crate) mod bsp;
pub(crate) mod builders;
mod cases;
mod code;
mod decay;
mod disturbed;
mod energy;
mod exports;
pub(crate) mod facts;
mod figures;
mod floors;
mod foreign;
mod hole;
mod judge;
mod kinds;
mod levels;
mod marked;
mod merged;
mod openings;
pub(crate) mod score;
mod sets;
mod spoilt;
mod trust;
mod verified;
mod worlds;

use crate::rows::Row;

pub(crate) use disturbed::Messy;
pub(crate) use worlds::Worlds;

/// Buildings and levels, clean and spoilt, beside what architects mean.
pub(crate) const BUILDINGS: &[Row<Worlds>] = &[
    Row::part("", sets::run),
    Row::part("openings", openings::run),
    Row::part("levels", levels::run),
    Row::part("spoilt", spoilt::run),
    Row::part("verify", verified::run),
];

/// Levels of games alone.
pub(crate) const LEVELS: &[Row<Worlds>] = &[
    Row::part("levels", levels::run),
    Row::part("verify: levels", verified::run_levels),
    Row::part("levels", marked::run),
    Row::part("levels", advice::run),
];

/// Decisions of a bake, and its verdict.
pub(crate) const DECISIONS: &[Row] = &[Row::part("", code::run), Row::part("", judge::run)];

/// Scenes of strangers.
pub(crate) const FOREIGN: &[Row] = &[
    Row::part("axes", axes::run),
    Row::part("kinds", kinds::run),
    Row::part("merged", merged::run),
    Row::part("verdict", trust::run),
];

/// Buildings whose rooms are exported: a house, a large building, sheets and solids, metric and imperial.
const EXPORTED: &[&str] = &["duplex", "fzk-haus", "institute", "samplehouse4", "kit-edc"];

/// Energy models: sheets without thickness.
const ENERGY: &[&str] = &["bristol-house", "edu-school"];

/// Rooms for other trades.
pub(crate) const EXPORTS: &[Row] = &[
    Row::baked("open rooms", EXPORTED, exports::open),
    Row::baked("neighbors", EXPORTED, exports::neighbors),
    Row::named("spaces", EXPORTED, exports::spaces),
    Row::named("doors by id", EXPORTED, exports::doors),
    Row::baked("map labels", EXPORTED, exports::labels),
    Row::baked("honeybee errors", EXPORTED, energy::errors),
    Row::baked("honeybee adjacency", EXPORTED, energy::adjacency),
    Row::baked("hbjson again", EXPORTED, energy::again),
    Row::baked("honeybee errors", ENERGY, energy::errors),
    Row::baked("honeybee adjacency", ENERGY, energy::adjacency),
    Row::scene("gbxml", ENERGY, energy::round_trip),
    Row::baked("reverberation", EXPORTED, decay::traced),
];

/// Disturbed models.
pub(crate) const DISTURBED: &[Row<Messy>] = &[
    Row::part("", disturbed::cases),
    Row::part("undisturbed", disturbed::undisturbed),
    Row::part("fault", disturbed::faults),
    Row::part("foreign", foreign::run),
];
