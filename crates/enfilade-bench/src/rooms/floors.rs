//! The minimum scores of the real scenes.
//!
//! A floor lies 0.01 below the figure in `docs/benchmarks/rooms.md`: rounding passes, one room or door less does not.
//! When figures improve, write them (`cargo xtask score --write`) and raise the floors here; a test compares the two.

use anyhow::bail;

use crate::table::Table;

/// Names of the figures of a score.
pub(crate) const COLUMNS: [&str; 7] = [
    "rooms", "doors", "windows", "cells", "extra", "mcc", "areas",
];

/// A scene, and the minimum shares of rooms, doors and windows: the first three of [`COLUMNS`].
type Floor = (&'static str, [f64; 3]);

const FLOORS: [Floor; 6] = [
    ("duplex", [0.89, 0.99, 0.99]),
    ("fzk-haus", [0.99, 0.99, 0.99]),
    ("institute", [0.99, 0.99, 0.99]),
    ("jasmin-sun", [0.99, 0.99, 0.99]),
    ("kit-edc", [0.99, 0.99, 0.99]),
    ("samplehouse4", [0.74, 0.99, 0.99]),
];

/// Fails with a line for each figure below its floor. Scenes without a floor pass, but are listed.
pub(crate) fn check<'n>(
    out: &mut Table,
    rows: impl Iterator<Item = (&'n str, [Option<f64>; 7])>,
) -> anyhow::Result<()> {
    let mut low = Vec::new();
    for (name, [rooms, doors, windows, ..]) in rows {
        match FLOORS.iter().find(|f| f.0 == name) {
            Some(floor) => low.extend(below(floor, [rooms, doors, windows])),
            None => out.push(format!("{name}: no floor in {}", file!())),
        }
    }
    if !low.is_empty() {
        bail!("{}", low.join("\n"));
    }
    Ok(())
}

/// Returns the figures that are below their floors or missing.
fn below(&(scene, floor): &Floor, shares: [Option<f64>; 3]) -> Vec<String> {
    (0..3)
        .filter(|&k| !shares[k].is_some_and(|share| share >= floor[k]))
        .map(|k| {
            let share = shares[k].map_or_else(|| "none".to_owned(), |s| format!("{s:.3}"));
            format!(
                "{scene}: {} {share}, below the floor of {}",
                COLUMNS[k], floor[k]
            )
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLOOR: Floor = ("a house", [0.89, 0.99, 0.99]);

    #[test]
    fn a_room_less_is_below_the_floor_and_rounding_is_not() {
        let of_21 = |rooms: f64| below(&FLOOR, [Some(rooms / 21.0), Some(1.0), Some(1.0)]);
        assert!(of_21(19.0).is_empty());
        assert_eq!(
            of_21(18.0),
            ["a house: rooms 0.857, below the floor of 0.89"]
        );
    }

    #[test]
    fn a_figure_that_is_gone_is_below_the_floor() {
        assert_eq!(below(&FLOOR, [Some(1.0), None, Some(1.0)]).len(), 1);
        assert_eq!(below(&FLOOR, [Some(f64::NAN); 3]).len(), 3);
    }

    #[test]
    fn floors_lie_a_hundredth_below_what_is_written() {
        let page = std::fs::read_to_string(crate::process::root().join("docs/benchmarks/rooms.md"));
        let page = page.expect("the page of the scores");
        for (scene, floor) in &FLOORS {
            let row = page
                .lines()
                .find_map(|l| l.strip_prefix(&format!("| {scene} |")))
                .unwrap_or_else(|| panic!("{scene} has no row"));
            let written: Vec<f64> = row
                .split('|')
                .skip(1)
                .take(3)
                .map(|f| f.trim().parse().expect("a figure"))
                .collect();
            for (k, written) in written.iter().enumerate() {
                let gap = written - floor[k];
                assert!(
                    (gap - 0.01).abs() < 1e-9,
                    "{scene}: {} is written as {written}, its floor is {}",
                    COLUMNS[k],
                    floor[k]
                );
            }
        }
    }
}
