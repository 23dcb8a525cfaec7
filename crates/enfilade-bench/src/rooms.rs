//! `bench rooms`: rooms and doors as architects mean them, over two sets of buildings, each figure with its bar.
//!
//! The first six are those of `cargo xtask score`. The method was made without the other four (`scenes2`), from exporters
//! of other kinds.

use crate::process::{scenes_dir, scenes_in};
use crate::rows::{Chosen, RowPrinter};
use crate::score::{Score, score_scene};

/// A set of buildings, and its bars: shares of rooms, doors and windows, and extra portals a room.
struct Set {
    name: &'static str,
    scenes: &'static [&'static str],
    /// The least share of rooms.
    rooms: f64,
    /// The least share of doors.
    doors: f64,
    /// The least share of windows.
    windows: Option<f64>,
    /// The most portals a room that match none of the architect's openings.
    extra: Option<f64>,
}

const SETS: [Set; 2] = [
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
        rooms: 0.92,
        doors: 0.98,
        windows: Some(0.98),
        extra: None,
    },
    Set {
        name: "more",
        scenes: &["clinic", "janesville", "procthor4", "smiley-west"],
        rooms: 0.93,
        doors: 0.98,
        windows: None,
        extra: Some(1.0),
    },
];

/// Most cells of a scene, outdoors included.
const CELLS: [(&str, usize); 1] = [("clinic", 300)];

/// Measures the rows; an error if a bar is missed.
pub(crate) fn bench_rooms(chosen: &Chosen, is_json: bool) -> anyhow::Result<()> {
    let mut printer = RowPrinter::new(is_json);
    let dir = scenes_dir();
    let more = dir
        .as_ref()
        .and_then(|d| d.parent())
        .map(|d| d.join("scenes2"));
    let folders: Vec<_> = dir.iter().chain(&more).flat_map(|d| scenes_in(d)).collect();
    for set in &SETS {
        let mut scores = Vec::new();
        for scene in set.scenes.iter().filter(|s| chosen.has_scene(s)) {
            match folders.iter().find(|f| f.ends_with(scene)) {
                Some(folder) => scores.push(score_scene(folder, None)?),
                None => printer.print(set.name, scene, None, "", None, "the scene is not there"),
            }
        }
        let scores = scores.iter().collect::<Vec<_>>();
        set.print_all(&scores, chosen, &mut printer);
    }
    printer.finish()
}

impl Set {
    /// Prints the figures of each scene, without bars, and those of the set.
    fn print_all(&self, scores: &[&Score], chosen: &Chosen, out: &mut RowPrinter) {
        let least = |bar: f64, v: f64| (format!(">= {bar}"), v >= bar);
        let most = |bar: f64, v: f64| (format!("<= {bar}"), v <= bar);
        let mut row = |what: &str, k: usize, weight: &dyn Fn(&Score) -> f64, bar: Option<f64>| {
            let name = format!("{}: {what}", self.name);
            if !chosen.has_row(&name) {
                return;
            }
            for s in scores.iter().filter(|s| s.figures[k].is_some()) {
                let note = s.failed.join("; ");
                let note = if k == 0 { note.as_str() } else { "" };
                out.print(&name, &s.name, s.figures[k], "", None, note);
            }
            let known = || {
                let figure = |s: &&Score| Some((s.figures[k]?, weight(s)));
                scores.iter().filter_map(figure)
            };
            let total: f64 = known().map(|(_, w)| w).sum();
            if total > 0.0 {
                let value = known().map(|(f, w)| f * w).sum::<f64>() / total;
                let judged = bar.map(|b| {
                    if k == 4 {
                        most(b, value)
                    } else {
                        least(b, value)
                    }
                });
                let (bar, ok) = judged.unzip();
                out.print(
                    &name,
                    "all",
                    Some(value),
                    &bar.unwrap_or_default(),
                    ok,
                    "of all in the set",
                );
            }
        };
        row("rooms", 0, &|s| s.n_rooms as f64, Some(self.rooms));
        row("doors", 1, &|s| s.n_doors as f64, Some(self.doors));
        row("windows", 2, &|s| s.n_windows as f64, self.windows);
        row("extra", 4, &|s| s.n_rooms as f64, self.extra);
        for s in scores {
            let bar = CELLS.iter().find(|c| c.0 == s.name);
            let name = format!("{}: cells", self.name);
            if let Some((_, most)) = bar
                && chosen.has_row(&name)
            {
                out.print(
                    &name,
                    &s.name,
                    Some(s.n_cells as f64),
                    &format!("<= {most}"),
                    Some(s.n_cells <= *most),
                    "",
                );
            }
        }
    }
}
