//! Figures with bars, one per row: the targets of issues, measured.
//!
//! In JSON a row is a line `{"row", "scene", "value", "bar", "ok"}`, where `value` and `ok` are null if a requirement
//! is missing, which `note` then names. Rows share the scenes' bakes.

use std::path::PathBuf;

use anyhow::Context;
use enfilade::bake::{BakeConfig, BakeContext, Silent, bake};
use enfilade::cpg::World;
use enfilade::import::{ImportOptions, import};
use serde_json::json;

use crate::measure::files_of;
use crate::process::{scenes, scenes_dir, scenes_in};

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
    /// As [`Measure::Baked`], with the name of the scene, for files beside it.
    Named(fn(&World, &str) -> anyhow::Result<Figure>),
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

/// The rows and scenes to measure.
#[derive(clap::Args)]
pub(crate) struct Chosen {
    /// Only rows whose names begin with one of these.
    #[arg(long, value_delimiter = ',', value_name = "ROW,...")]
    pub(crate) rows: Vec<String>,
    /// Only scenes whose names begin with one of these. Scenes are folders of $ENFILADE_SCENES, or of
    /// ../shared/scenes, and of scenes2 beside it.
    #[arg(long, value_delimiter = ',', value_name = "SCENE,...")]
    pub(crate) scenes: Vec<String>,
}

impl Chosen {
    pub(crate) fn has_row(&self, name: &str) -> bool {
        is_asked(&self.rows, name)
    }

    pub(crate) fn has_scene(&self, name: &str) -> bool {
        is_asked(&self.scenes, name)
    }
}

/// Returns `true` if a name begins with one of `asked`, or these are none.
fn is_asked(asked: &[String], name: &str) -> bool {
    asked.is_empty() || asked.iter().any(|a| name.starts_with(a.as_str()))
}

/// Prints rows, and counts the bars missed, met and unknown.
pub(crate) struct RowPrinter {
    is_json: bool,
    n: [usize; 3],
}

impl RowPrinter {
    pub(crate) fn new(is_json: bool) -> Self {
        Self { is_json, n: [0; 3] }
    }

    pub(crate) fn print(
        &mut self,
        row: &str,
        scene: &str,
        value: Option<f64>,
        bar: &str,
        ok: Option<bool>,
        note: &str,
    ) {
        self.n[ok.map_or(2, usize::from)] += 1;
        if self.is_json {
            let mut line =
                json!({"row": row, "scene": scene, "value": value, "bar": bar, "ok": ok});
            if !note.is_empty() {
                line["note"] = note.into();
            }
            println!("{line}");
            return;
        }
        let value = value.map_or_else(|| "–".to_owned(), shown);
        let word = ok.map_or("–", |ok| if ok { "ok" } else { "NOT MET" });
        println!("{row:<38} {scene:<28} {value:>10}  {bar:<10} {word} {note}");
    }

    /// Prints the counts.
    pub(crate) fn report(&self) {
        let [missed, met, unknown] = self.n;
        eprintln!("{met} bars met, {missed} missed, {unknown} unknown");
    }

    /// Prints the counts; an error if a bar is missed.
    pub(crate) fn finish(&self) -> anyhow::Result<()> {
        self.report();
        anyhow::ensure!(self.n[0] == 0, "{} bars are missed", self.n[0]);
        Ok(())
    }
}

/// Formats a value with three digits after the point, a whole number without.
pub(crate) fn shown(x: f64) -> String {
    if x == x.trunc() {
        format!("{x:.0}")
    } else {
        format!("{x:.3}")
    }
}

/// Prints the rows; an error if one does not reach its bar.
pub(crate) fn bench_rows(all: &[Row], is_json: bool, chosen: &Chosen) -> anyhow::Result<()> {
    let mut baked: Vec<(&str, Option<World>)> = Vec::new();
    let mut out = RowPrinter::new(is_json);
    for row in all.iter().filter(|row| chosen.has_row(row.name)) {
        for &scene in row.scenes.iter().filter(|scene| chosen.has_scene(scene)) {
            let figure = match row.measure {
                Measure::Made(measure) => Some(measure(scene).context(scene)?),
                Measure::Baked(_) | Measure::Named(_) => {
                    if !baked.iter().any(|b| b.0 == scene) {
                        baked.push((scene, baked_scene(scene)?));
                    }
                    let world = baked.iter().find(|b| b.0 == scene);
                    let measured = world.and_then(|b| b.1.as_ref()).map(|w| match row.measure {
                        Measure::Baked(measure) => measure(w),
                        Measure::Named(measure) => measure(w, scene),
                        Measure::Made(measure) => measure(scene),
                    });
                    measured.transpose().context(scene)?
                }
            };
            match figure {
                Some(Figure { value, most, note }) => {
                    let bar = format!("<= {most}");
                    out.print(
                        row.name,
                        scene,
                        Some(value),
                        &bar,
                        Some(value <= most),
                        &note,
                    );
                }
                None => out.print(row.name, scene, None, "", None, "the scene is missing"),
            }
        }
    }
    out.finish()
}

/// Returns the folder of a scene, if it is there.
pub(crate) fn folder_of(name: &str) -> Option<PathBuf> {
    let beside = scenes_dir().map(|dir| dir.with_file_name("scenes2"));
    let all = scenes()
        .into_iter()
        .chain(beside.iter().flat_map(|dir| scenes_in(dir)));
    all.into_iter().find(|dir| dir.ends_with(name))
}

/// Returns the world of a scene; `None` if the scene is missing.
pub(crate) fn baked_scene(name: &str) -> anyhow::Result<Option<World>> {
    let Some(dir) = folder_of(name) else {
        return Ok(None);
    };
    let (files, detail) = files_of(&dir);
    let imported = import(&files, &detail, &ImportOptions::default())?;
    let context = BakeContext::new(&Silent, None);
    let baked = bake(&imported.scene, &BakeConfig::default(), &context).context(name.to_owned())?;
    Ok(Some(baked.world))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_scenes_are_asked_for_by_how_they_begin() {
        let asked = |list: &[&str], name| {
            let list: Vec<String> = list.iter().map(|s| (*s).to_owned()).collect();
            is_asked(&list, name)
        };
        assert!(asked(&[], "moved-1e-5"));
        assert!(asked(&["fault", "moved"], "moved-1e-5"));
        assert!(!asked(&["moved-1e-3"], "moved-1e-5"));
    }
}
