//! Rows `spoilt`: buildings as exporters, scanners and web pipelines spoil them, beside the same buildings clean.

use super::score::{Score, list};
use crate::measure;

use super::bars::Bar;
use super::worlds::{Form, RoomRows, TriedBake};

/// A way to spoil a building, and how far its rooms and doors may be from those of the clean one.
pub(super) struct Spoiling {
    pub(super) form: Form,
    rooms: Bar,
    doors: Option<Bar>,
}

/// Most portals, as a multiple of the clean world's.
const PORTALS: f64 = 1.2;

const fn by(name: &'static str, how: &'static [&'static str], within: f64) -> Spoiling {
    Spoiling {
        form: Form::Spoilt(name, how),
        rooms: Bar::Within(within),
        doors: Some(Bar::Within(within)),
    }
}

pub(super) const SPOILINGS: [Spoiling; 6] = [
    by("10um", &["--jitter", "1e-5"], 0.03),
    by("1mm", &["--jitter", "1e-3"], 0.03),
    by("missing", &["--drop", "0.005"], 0.03),
    by("snapped", &["--snap", "0.001"], 0.03),
    by("stripped", &["--strip"], 0.1),
    Spoiling {
        form: Form::Merged,
        // Only rooms lost count: values are what is found more.
        rooms: Bar::Least(-0.03),
        doors: None,
    },
];

/// Prints the rows of each way: what is found more than in the clean building, and the ratio of portals.
pub(super) fn run(out: &mut RoomRows<'_>) -> anyhow::Result<()> {
    let (mut n, mut n_good) = (0, 0);
    for spoiling in &SPOILINGS {
        let name = spoiling.form.name();
        if !out.chosen.has_row(&format!("spoilt: {name}")) {
            continue;
        }
        for dir in out.buildings() {
            let clean = out.state.building(&dir, Form::Clean);
            let spoilt = out.state.building(&dir, spoiling.form);
            n += 1;
            n_good += usize::from(spoiling.print(&measure::name(&dir), &clean, &spoilt, out));
        }
    }
    if n > 0 {
        let note = format!("{n_good} of {n} buildings and ways within all bars");
        let value = n_good as f64 / n as f64;
        out.print("spoilt", "all", Some(value), "1", Some(n == n_good), &note);
    }
    Ok(())
}

impl Spoiling {
    /// Prints the rows of one building; returns `true` if all bars are met.
    fn print(
        &self,
        scene: &str,
        clean: &TriedBake,
        spoilt: &TriedBake,
        out: &mut RoomRows<'_>,
    ) -> bool {
        let row = format!("spoilt: {}", self.form.name());
        let whys = [clean, spoilt].map(|b| b.graph.as_ref().err());
        if let Some(why) = whys.into_iter().flatten().next() {
            out.print(&row, scene, None, "a world", Some(false), why);
            return false;
        }
        let mut is_good = true;
        let more = |of: fn(&Score) -> Option<f64>| {
            let of = |b: &TriedBake| b.score.as_ref().and_then(of);
            let (before, after) = (of(clean)?, of(spoilt)?);
            Some((after - before, format!("{after:.3} of {before:.3}")))
        };
        let portals = [clean, spoilt].map(|b| {
            let graph = b.graph.as_ref().ok();
            graph.map_or(0, |g| list(&g["portals"]).len())
        });
        let ratio = portals[1] as f64 / portals[0].max(1) as f64;
        let rows = [
            ("rooms", more(|s| s.figures[0]), Some(self.rooms)),
            ("doors", more(|s| s.figures[1]), self.doors),
            (
                "portals",
                Some((ratio, format!("{} of {}", portals[1], portals[0]))),
                Some(Bar::Most(PORTALS)),
            ),
        ];
        for (what, value, bar) in rows {
            if let (Some((value, note)), Some(bar)) = (value, bar) {
                let ok = bar.passes(value);
                is_good &= ok;
                let row = format!("{row} {what}");
                out.print(&row, scene, Some(value), &bar.text(), Some(ok), &note);
            }
        }
        is_good
    }
}
