//! `bench stranger`: scenes that nobody here made, as their makers export them; each figure with its bar.
//!
//! One file for each kind of row.

mod axes;
mod baked;
mod kinds;
mod merged;
mod verdict;

use crate::rows::{Chosen, RowPrinter};

pub(crate) use merged::{merged_bake, scene_of};

/// Prints the rows whose names begin with the first item.
type RowKind = (
    &'static str,
    fn(&Chosen, &mut RowPrinter) -> anyhow::Result<()>,
);

const PARTS: [RowKind; 4] = [
    ("axes", axes::run),
    ("kinds", kinds::run),
    ("merged", merged::run),
    ("verdict", verdict::run),
];

/// Measures the chosen rows; an error if a bar is missed.
pub(crate) fn bench_stranger(chosen: &Chosen, is_json: bool) -> anyhow::Result<()> {
    let mut out = RowPrinter::new(is_json);
    for (name, run) in PARTS {
        let is_asked = |row: &String| name.starts_with(row.as_str()) || row.starts_with(name);
        if chosen.rows.is_empty() || chosen.rows.iter().any(is_asked) {
            run(chosen, &mut out)?;
        }
    }
    out.finish()
}
