//! Figures with bars, a row each: what an issue promises, measured.
//!
//! As JSON a row is a line `{"row", "scene", "value", "bar", "ok"}`, where `value` and `ok` are null if the scene is not there, and
//! `note` says more. Rows share the scenes' bakes.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use enfilade::bake::{BakeConfig, BakeContext, Silent, bake};
use enfilade::cpg::World;
use enfilade::import::{ImportOptions, import};
use serde_json::json;

use crate::measure::files_of;

/// A figure of some scenes.
pub(crate) struct Row {
    pub(crate) name: &'static str,
    pub(crate) scenes: &'static [&'static str],
    pub(crate) measure: Measure,
}

/// How a figure is measured.
pub(crate) enum Measure {
    /// On the bake of a scene of the shared ones.
    Baked(fn(&World) -> anyhow::Result<Figure>),
    /// On what the row makes by itself; it is told the name of the scene.
    Made(fn(&str) -> anyhow::Result<Figure>),
}

/// What was measured, and what it must be.
pub(crate) struct Figure {
    pub(crate) value: f64,
    /// The greatest value that is good.
    pub(crate) most: f64,
    pub(crate) note: String,
}

/// Prints the rows; an error where one does not reach its bar.
pub(crate) fn bench_rows(
    all: &[Row],
    is_json: bool,
    rows: &[String],
    scenes: &[String],
) -> anyhow::Result<()> {
    let is_chosen = |names: &[String], name: &str| {
        names.is_empty() || names.iter().any(|n| name.starts_with(n.as_str()))
    };
    let mut baked: Vec<(&str, Option<World>)> = Vec::new();
    let mut n_missed = 0;
    for row in all.iter().filter(|row| is_chosen(rows, row.name)) {
        for &scene in row.scenes.iter().filter(|scene| is_chosen(scenes, scene)) {
            let figure = match row.measure {
                Measure::Made(measure) => Some(measure(scene).context(scene)?),
                Measure::Baked(measure) => {
                    if !baked.iter().any(|b| b.0 == scene) {
                        baked.push((scene, baked_scene(scene)?));
                    }
                    let world = baked.iter().find(|b| b.0 == scene);
                    let measured = world.and_then(|b| b.1.as_ref()).map(measure);
                    measured.transpose().context(scene)?
                }
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
