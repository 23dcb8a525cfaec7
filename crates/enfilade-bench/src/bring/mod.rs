//! `bench bring`: the value of worlds to programs and modelers, each figure with its bar.
//!
//! To add a row, add a file beside this one and a line in [`ROWS`].

mod doors;
mod statistics;

use crate::rows::Measure::Baked;
use crate::rows::Row;

pub(crate) const ROWS: [Row; 4] = [
    Row {
        name: "doors: no leaf",
        scenes: &["institute"],
        measure: Baked(doors::without_leaf),
    },
    Row {
        name: "doors: seen through",
        scenes: &["institute"],
        measure: Baked(doors::seen_through),
    },
    Row {
        name: "doors: pixels lost",
        scenes: &["institute"],
        measure: Baked(doors::pixels_lost),
    },
    Row {
        name: "statistics",
        scenes: &["institute", "kit-edc"],
        measure: Baked(statistics::measure),
    },
];
