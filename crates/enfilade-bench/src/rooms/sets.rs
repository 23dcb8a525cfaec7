//! Rows of the sets: rooms and doors as architects mean them.
//!
//! The first six buildings are those of `cargo xtask score`. The method was made without the four of `scenes2` and the six of
//! `scenes3`, from exporters of other kinds.

use super::score::Score;
use crate::measure;

use super::bars::Bar;
use super::worlds::{Form, RoomRows};

/// A set of buildings, and bars of its figures over all its buildings.
struct Set {
    name: &'static str,
    scenes: &'static [&'static str],
    bars: &'static [(&'static str, Bar)],
}

const SETS: [Set; 3] = [
    Set {
        name: "first",
        scenes: &[
            "duplex",
            "fzk-haus",
            "institute",
            "jasmin-sun",
            "kit-edc",
            "samplehouse4",
        ],
        bars: &[
            ("rooms", Bar::Least(0.92)),
            ("doors", Bar::Least(0.98)),
            ("windows", Bar::Least(0.98)),
        ],
    },
    Set {
        name: "more",
        scenes: &["clinic", "janesville", "procthor4", "smiley-west"],
        bars: &[
            ("rooms", Bar::Least(0.93)),
            ("doors", Bar::Least(0.98)),
            ("extra", Bar::Most(1.0)),
        ],
    },
    Set {
        name: "scenes3",
        scenes: &[
            "bristol-house",
            "edu-school",
            "kit-level",
            "kit-level-ceiling",
            "kit-level-unnamed",
            "revit-demo2",
        ],
        bars: &[
            ("rooms", Bar::Least(0.92)),
            ("doors", Bar::Least(0.95)),
            ("windows", Bar::Least(0.92)),
            ("extra", Bar::Most(0.5)),
            ("spare", Bar::Most(0.2)),
        ],
    },
];

/// Bars of one building.
const OF_ONE: [(&str, &str, Bar); 5] = [
    ("clinic", "rooms", Bar::Least(0.93)),
    ("clinic", "cracks", Bar::Most(60.0)),
    ("clinic", "cells", Bar::Most(300.0)),
    ("janesville", "rooms", Bar::Least(0.6)),
    ("janesville", "extra", Bar::Most(1.0)),
];

/// A figure of a building, and what it counts in that of its set.
struct SetFigure {
    name: &'static str,
    of: fn(&Score) -> Option<f64>,
    /// `None` if the set has no such figure.
    weight: Option<fn(&Score) -> usize>,
}

const fn figure(
    name: &'static str,
    of: fn(&Score) -> Option<f64>,
    weight: Option<fn(&Score) -> usize>,
) -> SetFigure {
    SetFigure { name, of, weight }
}

const FIGURES: [SetFigure; 7] = [
    figure("rooms", |s| s.figures[0], Some(|s| s.n_rooms)),
    figure("doors", |s| s.figures[1], Some(|s| s.n_doors)),
    figure("windows", |s| s.figures[2], Some(|s| s.n_windows)),
    figure("extra", |s| s.figures[4], Some(|s| s.n_rooms)),
    figure("spare", |s| s.spare, Some(|s| s.n_rooms)),
    figure("cells", |s| Some(s.n_cells as f64), None),
    figure("cracks", |s| Some(s.n_cracks as f64), None),
];

/// Prints the rows of each set.
pub(super) fn run(out: &mut RoomRows<'_>) -> anyhow::Result<()> {
    let (there, chosen) = (out.buildings(), out.chosen);
    for set in &SETS {
        let is_wanted = |f: &&SetFigure| chosen.has_row(&format!("{}: {}", set.name, f.name));
        let figures: Vec<&SetFigure> = FIGURES.iter().filter(is_wanted).collect();
        if figures.is_empty() {
            continue;
        }
        let mut baked = Vec::new();
        for scene in set.scenes.iter().filter(|s| chosen.has_scene(s)) {
            match there.iter().find(|dir| measure::name(dir) == *scene) {
                Some(dir) => baked.push(out.state.building(dir, Form::Clean)),
                None => out.print(set.name, scene, None, "", None, "the scene is not there"),
            }
            if let Some(Err(why)) = baked.last().map(|b| b.graph.as_ref()) {
                out.print(set.name, scene, None, "a world", Some(false), why);
            }
        }
        let scores: Vec<&Score> = baked.iter().filter_map(|b| b.score.as_ref()).collect();
        for figure in figures {
            set.print(figure, &scores, out);
        }
    }
    Ok(())
}

impl Set {
    /// Prints a figure of each building, and that of the set.
    fn print(&self, figure: &SetFigure, scores: &[&Score], out: &mut RoomRows<'_>) {
        let row = format!("{}: {}", self.name, figure.name);
        let mut print = |scene: &str, value: f64, bar: Option<Bar>, note: &str| {
            let text = bar.map_or_else(String::new, Bar::text);
            let ok = bar.map(|b| b.passes(value));
            out.print(&row, scene, Some(value), &text, ok, note);
        };
        for s in scores {
            let Some(value) = (figure.of)(s) else {
                continue;
            };
            let note = s.failed.join("; ");
            let note = if figure.name == "rooms" { &*note } else { "" };
            let bar = OF_ONE.iter().find(|b| b.0 == s.name && b.1 == figure.name);
            print(&s.name, value, bar.map(|b| b.2), note);
        }
        let Some(weight) = figure.weight else {
            return;
        };
        let known = || {
            scores
                .iter()
                .filter_map(|s| Some(((figure.of)(s)?, weight(s) as f64)))
        };
        let total: f64 = known().map(|(_, w)| w).sum();
        if total > 0.0 {
            let value = known().map(|(f, w)| f * w).sum::<f64>() / total;
            let bar = self.bars.iter().find(|b| b.0 == figure.name);
            print("all", value, bar.map(|b| b.1), "of all in the set");
        }
    }
}
