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
use crate::process::scenes_and;

/// A figure and its scenes, or a part of rows that prints itself. `S` is what the rows of one list share.
pub(crate) struct Row<S = ()> {
    name: &'static str,
    scenes: &'static [&'static str],
    measure: Measure<S>,
}

/// The input of a measurement.
enum Measure<S> {
    /// The bake of a shared scene.
    Baked(fn(&World) -> anyhow::Result<Figure>),
    /// As [`Measure::Baked`], with the name of the scene, for files beside it.
    Named(fn(&World, &str) -> anyhow::Result<Figure>),
    /// A scene that the row generates by name.
    Made(fn(&str) -> anyhow::Result<Figure>),
    /// Prints rows of a scene.
    Scene(fn(&mut RowPrinter<'_, S>, &str) -> anyhow::Result<()>),
    /// Prints rows of scenes that it chooses itself.
    Part(fn(&mut RowPrinter<'_, S>) -> anyhow::Result<()>),
}

impl<S> Row<S> {
    const fn of(name: &'static str, scenes: &'static [&'static str], measure: Measure<S>) -> Self {
        Self {
            name,
            scenes,
            measure,
        }
    }

    pub(crate) const fn baked(
        name: &'static str,
        scenes: &'static [&'static str],
        measure: fn(&World) -> anyhow::Result<Figure>,
    ) -> Self {
        Self::of(name, scenes, Measure::Baked(measure))
    }

    pub(crate) const fn named(
        name: &'static str,
        scenes: &'static [&'static str],
        measure: fn(&World, &str) -> anyhow::Result<Figure>,
    ) -> Self {
        Self::of(name, scenes, Measure::Named(measure))
    }

    pub(crate) const fn made(
        name: &'static str,
        scenes: &'static [&'static str],
        measure: fn(&str) -> anyhow::Result<Figure>,
    ) -> Self {
        Self::of(name, scenes, Measure::Made(measure))
    }

    /// Returns rows whose names begin with `name`, printed scene by scene.
    pub(crate) const fn scene(
        name: &'static str,
        scenes: &'static [&'static str],
        print: fn(&mut RowPrinter<'_, S>, &str) -> anyhow::Result<()>,
    ) -> Self {
        Self::of(name, scenes, Measure::Scene(print))
    }

    /// Returns rows whose names begin with `name`; with an empty one, the part looks itself which are chosen.
    pub(crate) const fn part(
        name: &'static str,
        print: fn(&mut RowPrinter<'_, S>) -> anyhow::Result<()>,
    ) -> Self {
        Self::of(name, &[], Measure::Part(print))
    }
}

/// A measured value and its bar.
pub(crate) struct Figure {
    pub(crate) value: f64,
    /// The largest value that passes.
    pub(crate) most: f64,
    pub(crate) note: String,
}

impl Figure {
    pub(crate) fn new(value: f64, most: f64, note: impl Into<String>) -> Self {
        let note = note.into();
        Self { value, most, note }
    }
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

    /// Returns `true` if a part whose rows begin with `name` may have a chosen row.
    fn concerns(&self, name: &str) -> bool {
        self.has_row(name) || self.rows.iter().any(|row| row.starts_with(name))
    }
}

/// Returns `true` if a name begins with one of `asked`, or these are none.
fn is_asked(asked: &[String], name: &str) -> bool {
    asked.is_empty() || asked.iter().any(|a| name.starts_with(a.as_str()))
}

/// Measures and prints the chosen rows of lists that share a state; counts the bars missed, met and unknown.
pub(crate) struct RowPrinter<'a, S = ()> {
    pub(crate) chosen: &'a Chosen,
    pub(crate) state: S,
    is_json: bool,
    n: [usize; 3],
    /// Shared scenes so far; `None` if one is missing.
    baked: Vec<(String, Option<World>)>,
}

impl<'a, S> RowPrinter<'a, S> {
    pub(crate) fn new(is_json: bool, chosen: &'a Chosen, state: S) -> Self {
        Self {
            chosen,
            state,
            is_json,
            n: [0; 3],
            baked: Vec::new(),
        }
    }

    /// Measures the rows of a list, each on its scenes.
    pub(crate) fn run(&mut self, rows: &[Row<S>]) -> anyhow::Result<()> {
        for row in rows {
            match row.measure {
                Measure::Part(print) if self.chosen.concerns(row.name) => print(self)?,
                _ => row.scenes.iter().try_for_each(|s| self.measure(row, s))?,
            }
        }
        Ok(())
    }

    /// Measures the rows that have a scene, on this scene alone.
    pub(crate) fn run_scene(&mut self, rows: &[Row<S>], scene: &str) -> anyhow::Result<()> {
        let mut there = rows.iter().filter(|row| row.scenes.contains(&scene));
        there.try_for_each(|row| self.measure(row, scene))
    }

    fn measure(&mut self, row: &Row<S>, scene: &str) -> anyhow::Result<()> {
        if !self.chosen.has_row(row.name) || !self.chosen.has_scene(scene) {
            return Ok(());
        }
        let figure = match row.measure {
            Measure::Made(measure) => Some(measure(scene)),
            Measure::Baked(measure) => self.world(scene)?.map(measure),
            Measure::Named(measure) => self.world(scene)?.map(|world| measure(world, scene)),
            Measure::Scene(print) => return print(self, scene),
            Measure::Part(print) => return print(self),
        };
        match figure.transpose().with_context(|| scene.to_owned())? {
            Some(figure) => self.at_most(row.name, scene, figure.value, figure.most, &figure.note),
            None => self.missing(row.name, scene),
        }
        Ok(())
    }

    /// Returns the bake of a shared scene, made once; `None` if the scene is missing.
    fn world(&mut self, scene: &str) -> anyhow::Result<Option<&World>> {
        let known = self.baked.iter().position(|b| b.0 == scene);
        let at = match known {
            Some(at) => at,
            None => {
                self.baked.push((scene.to_owned(), baked_scene(scene)?));
                self.baked.len() - 1
            }
        };
        Ok(self.baked[at].1.as_ref())
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

    /// Prints a row whose value may not be more than `most`.
    pub(crate) fn at_most(&mut self, row: &str, scene: &str, value: f64, most: f64, note: &str) {
        let (bar, ok) = (format!("<= {most}"), Some(value <= most));
        self.print(row, scene, Some(value), &bar, ok, note);
    }

    /// Prints a row whose value may not be less than `least`.
    pub(crate) fn at_least(&mut self, row: &str, scene: &str, value: f64, least: f64, note: &str) {
        let (bar, ok) = (format!(">= {least}"), Some(value >= least));
        self.print(row, scene, Some(value), &bar, ok, note);
    }

    /// Prints a row that is 1 if what it says is true.
    pub(crate) fn is(&mut self, row: &str, scene: &str, ok: bool) {
        let value = Some(f64::from(u8::from(ok)));
        self.print(row, scene, value, "= 1", Some(ok), "");
    }

    /// Prints a row without a value: its scene is not there.
    pub(crate) fn missing(&mut self, row: &str, scene: &str) {
        self.print(row, scene, None, "", None, "the scene is missing");
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

/// Prints the rows of some lists; an error if one does not reach its bar.
pub(crate) fn bench_rows<S>(
    lists: &[&[Row<S>]],
    is_json: bool,
    chosen: &Chosen,
    state: S,
) -> anyhow::Result<()> {
    let mut out = RowPrinter::new(is_json, chosen, state);
    lists.iter().try_for_each(|rows| out.run(rows))?;
    out.finish()
}

/// Returns the folder of a scene, if it is there.
pub(crate) fn folder_of(name: &str) -> Option<PathBuf> {
    let mut all = scenes_and(&["scenes2"]).into_iter();
    all.find(|dir| dir.ends_with(name))
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
