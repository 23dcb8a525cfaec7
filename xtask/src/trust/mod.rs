//! `cargo xtask bench trust`: hostile and huge input, each figure with its bar.
//!
//! Each figure is a row: in JSON a line `{"row", "scene", "value", "bar", "ok"}`, where `value` and `ok` are null if a
//! requirement is missing, which `note` then names.

mod budgets;
mod commands;
mod gate;
mod habits;
mod inputs;
mod mutate;
mod mutated;
mod order;
mod random;
mod scenes;
mod tampered;
mod tight;

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Context;
use serde_json::json;

use crate::{RELEASE, run_to_end, target_dir};

/// The options of the bench.
#[derive(Default)]
pub(crate) struct TrustOptions {
    /// Print a JSON object per row instead of a table.
    pub(crate) is_json: bool,
    /// Beginnings of row names; empty for all.
    pub(crate) rows: Vec<String>,
    /// Indices of the damaged files to try.
    pub(crate) runs: Range<usize>,
    /// Indices of the shuffles to try.
    pub(crate) shuffles: Range<usize>,
    /// Beginnings of the names of scenes to shuffle; empty for all.
    pub(crate) scenes: Vec<String>,
}

/// The parts by the first word of their rows: a module and a line here for each.
const PARTS: &[(&str, Part)] = &[
    ("bound", budgets::bounds),
    ("case", budgets::cases),
    ("commands", commands::run),
    ("estimate", budgets::estimates),
    ("gate", gate::run),
    ("habits", habits::run),
    ("large", budgets::large),
    ("mutated", mutated::run),
    ("nasty", budgets::nasty),
    ("order", order::run),
    ("tampered", tampered::run),
    ("tight", tight::run),
];

type Part = fn(&mut Figures) -> anyhow::Result<()>;

/// Returns the indices of `n` damaged files starting at `from`; of the default number if `n` is not given.
pub(crate) fn runs(from: usize, n: Option<usize>) -> Range<usize> {
    from..from.saturating_add(n.unwrap_or(mutated::COUNT))
}

/// Same as [`runs`] for shuffles.
pub(crate) fn shuffles(from: usize, n: Option<usize>) -> Range<usize> {
    from..from.saturating_add(n.unwrap_or(order::COUNT))
}

/// Measures and prints; fails if a bar is missed.
pub(crate) fn run(options: &TrustOptions) -> anyhow::Result<()> {
    run_to_end(&mut RELEASE.cargo("build", &["-p", "enfilade-cli"]))?;
    let folder = target_dir().join("trust");
    std::fs::create_dir_all(&folder)?;
    let mut rows = Figures {
        is_json: options.is_json,
        folder,
        runs: options.runs.clone(),
        shuffles: options.shuffles.clone(),
        scenes: options.scenes.clone(),
        n: [0; 3],
    };
    for (name, part) in PARTS.iter().copied() {
        let is_asked = |row: &String| name.starts_with(row.as_str());
        if options.rows.is_empty() || options.rows.iter().any(is_asked) {
            part(&mut rows)?;
        }
    }
    let [failed, passed, unknown] = rows.n;
    eprintln!("{passed} bars met, {failed} missed, {unknown} unknown");
    anyhow::ensure!(failed == 0, "{failed} bars are missed");
    Ok(())
}

/// The printed figures.
struct Figures {
    is_json: bool,
    /// Folder of inputs and outputs.
    folder: PathBuf,
    /// Indices of the damaged files to try.
    runs: Range<usize>,
    /// Indices of the shuffles to try.
    shuffles: Range<usize>,
    /// Beginnings of the names of scenes to shuffle.
    scenes: Vec<String>,
    /// Number of bars missed, met and unknown.
    n: [usize; 3],
}

impl Figures {
    fn print(&mut self, row: &str, scene: &str, value: Option<f64>, bar: &str, ok: Option<bool>) {
        self.n[ok.map_or(2, usize::from)] += 1;
        if self.is_json {
            println!(
                "{}",
                json!({"row": row, "scene": scene, "value": value, "bar": bar, "ok": ok})
            );
            return;
        }
        let value = value.map_or_else(|| "–".to_owned(), |v| format!("{v:.2}"));
        let word = ok.map_or("–", |ok| if ok { "ok" } else { "NOT MET" });
        println!("{row:<24} {scene:<28} {value:>10}  {bar:<10} {word}");
    }

    fn at_most(&mut self, row: &str, scene: &str, value: f64, most: f64) {
        let bar = format!("<= {most}");
        self.print(row, scene, Some(value), &bar, Some(value <= most));
    }

    fn at_least(&mut self, row: &str, scene: &str, value: f64, least: f64) {
        let bar = format!(">= {least}");
        self.print(row, scene, Some(value), &bar, Some(value >= least));
    }

    fn is(&mut self, row: &str, scene: &str, ok: bool) {
        self.print(row, scene, Some(f64::from(u8::from(ok))), "= 1", Some(ok));
    }

    /// Runs the command `enfilade` under GNU time, for at most `most` seconds.
    fn enfilade(&self, args: &[&str], most: u32) -> anyhow::Result<Ran> {
        let mut timed = Command::new("/usr/bin/time");
        timed.args(["-f", "%e %M", "timeout", &most.to_string()]);
        timed.arg(RELEASE.binary("enfilade")).args(args);
        let done = timed
            .current_dir(&self.folder)
            .output()
            .context("needs GNU time as /usr/bin/time (`apt-get install time`)")?;
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        let figures = said.lines().rev().find_map(|line| {
            let (seconds, kilobytes) = line.split_once(' ')?;
            Some((seconds.parse().ok()?, kilobytes.parse::<f64>().ok()?))
        });
        let (seconds, kilobytes) = figures.context("time printed no figures")?;
        Ok(Ran {
            code: done.status.code(),
            seconds,
            gigabytes: kilobytes / f64::from(1 << 20),
            said,
        })
    }

    fn write(&self, name: &str, text: &str) -> anyhow::Result<()> {
        std::fs::write(self.folder.join(name), text).with_context(|| name.to_owned())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }
}

/// The result of a command.
struct Ran {
    code: Option<i32>,
    seconds: f64,
    /// Peak of resident memory. [Units: GiB]
    gigabytes: f64,
    said: String,
}

/// Returns `true` if a file has these bytes.
fn holds(path: &Path, bytes: &[u8]) -> bool {
    std::fs::read(path).is_ok_and(|found| found == bytes)
}
