//! `bench bring`: what worlds bring to those who use them, figure by figure with its bar.
//!
//! Each figure is a row: as JSON a line `{"row", "scene", "value", "bar", "ok"}`, where `value` and `ok` are null if the scene is not
//! there, and `note` says more. A row is a file beside this one and a line in [`ROWS`]. Rows share the scenes' bakes.

mod doors;
mod statistics;

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use enfilade::bake::{BakeConfig, BakeContext, Silent, bake};
use enfilade::cpg::World;
use enfilade::import::{ImportOptions, import};
use serde_json::json;

use crate::measure::files_of;

/// A figure of some scenes.
struct Row {
    name: &'static str,
    scenes: &'static [&'static str],
    measure: fn(&World) -> anyhow::Result<Figure>,
}

/// What was measured, and what it must be.
struct Figure {
    value: f64,
    /// The greatest value that is good.
    most: f64,
    note: String,
}

const ROWS: [Row; 4] = [
    Row {
        name: "doors: no leaf",
        scenes: &["institute"],
        measure: doors::without_leaf,
    },
    Row {
        name: "doors: seen through",
        scenes: &["institute"],
        measure: doors::seen_through,
    },
    Row {
        name: "doors: pixels lost",
        scenes: &["institute"],
        measure: doors::pixels_lost,
    },
    Row {
        name: "statistics",
        scenes: &["institute", "kit-edc"],
        measure: statistics::measure,
    },
];

/// Prints the rows; an error where one does not reach its bar.
pub(crate) fn bench_bring(is_json: bool, rows: &[String], scenes: &[String]) -> anyhow::Result<()> {
    let is_chosen = |names: &[String], name: &str| {
        names.is_empty() || names.iter().any(|n| name.starts_with(n.as_str()))
    };
    let mut baked: Vec<(&str, Option<World>)> = Vec::new();
    let mut n_missed = 0;
    for row in ROWS.iter().filter(|row| is_chosen(rows, row.name)) {
        for &scene in row.scenes.iter().filter(|scene| is_chosen(scenes, scene)) {
            if !baked.iter().any(|b| b.0 == scene) {
                baked.push((scene, baked_scene(scene)?));
            }
            let world = baked.iter().find(|b| b.0 == scene);
            let figure = match world.and_then(|b| b.1.as_ref()) {
                Some(world) => Some((row.measure)(world).context(scene)?),
                None => None,
            };
            let ok = figure.as_ref().map(|f| f.value <= f.most);
            n_missed += usize::from(ok == Some(false));
            print(is_json, row.name, scene, figure.as_ref())?;
        }
    }
    if n_missed > 0 {
        bail!("{n_missed} rows do not reach their bars");
    }
    Ok(())
}

fn print(is_json: bool, row: &str, scene: &str, figure: Option<&Figure>) -> io::Result<()> {
    let mut out = io::stdout().lock();
    let bar = figure.map(|f| format!("<= {}", f.most));
    let ok = figure.map(|f| f.value <= f.most);
    let note = figure.map_or("the scene is not there", |f| &f.note);
    if is_json {
        let value = figure.map(|f| f.value);
        let line =
            json!({"row": row, "scene": scene, "value": value, "bar": bar, "ok": ok, "note": note});
        writeln!(out, "{line}")
    } else {
        let value = figure.map_or_else(|| "–".to_owned(), |f| format!("{:.3}", f.value));
        let word = ok.map_or("–", |ok| if ok { "ok" } else { "NOT MET" });
        let bar = bar.unwrap_or_default();
        writeln!(
            out,
            "{row:<20} {scene:<16} {value:>10}  {bar:<8} {word} {note}"
        )
    }
}

/// The world of a scene; `None` where the scene is not there.
fn baked_scene(name: &str) -> anyhow::Result<Option<World>> {
    let dir = std::env::var_os("ENFILADE_SCENES")
        .map_or_else(|| PathBuf::from("../shared/scenes"), PathBuf::from);
    let dir: &Path = &dir.join(name);
    if !dir.join("scene.glb").is_file() {
        return Ok(None);
    }
    let (files, detail) = files_of(dir);
    let imported = import(&files, &detail, &ImportOptions::default())?;
    let context = BakeContext::new(&Silent, None);
    let baked = bake(&imported.scene, &BakeConfig::default(), &context).context(name.to_owned())?;
    Ok(Some(baked.world))
}
