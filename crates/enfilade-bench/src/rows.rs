//! Figures with bars, one per row: the targets of issues, measured.
//!
//! In JSON a row is a line `{"row", "scene", "value", "bar", "ok", "note"}`, where `value` and `ok` are null if the
//! scene is missing. Rows share the scenes' bakes.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use enfilade::bake::{BakeConfig, BakeContext, Silent, bake};
use enfilade::cpg::World;
use enfilade::import::{ImportOptions, import};
use serde_json::json;

use crate::measure::files_of;

/// A figure and its scenes.
pub(crate) struct Row {
    pub(crate) name: &'static str,
    pub(crate) scenes: &'static [&'static str],
    pub(crate) measure: Measure,
}

/// The input of a measurement.
pub(crate) enum Measure {
    /// The bake of a shared scene.
    Baked(fn(&World) -> anyhow::Result<Figure>),
    /// A scene that the row generates by name.
    Made(fn(&str) -> anyhow::Result<Figure>),
}

/// A measured value and its bar.
pub(crate) struct Figure {
    pub(crate) value: f64,
    /// The largest value that passes.
    pub(crate) most: f64,
    pub(crate) note: String,
}

/// Prints the rows; an error if one does not reach its bar.
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
        bail!("{n_missed} rows miss their bars");
    }
    Ok(())
}

fn print(is_json: bool, row: &str, scene: &str, figure: Option<&Figure>) -> io::Result<()> {
    let mut out = io::stdout().lock();
    let bar = figure.map(|f| format!("<= {}", f.most));
    let ok = figure.map(|f| f.value <= f.most);
    let note = figure.map_or("the scene is missing", |f| &f.note);
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

/// Returns the world of a scene; `None` if the scene is missing.
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
