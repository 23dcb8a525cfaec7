//! `cargo xtask bench trust`: hostile and huge input, figure by figure with its bar.
//!
//! Each figure is a row: as JSON a line `{"row", "scene", "value", "bar", "ok"}`, where `value` and `ok` are null if
//! something that it needs is not there, and `note` then says what.

mod budgets;
mod gate;
mod inputs;
mod mutate;
mod mutated;
mod order;
mod random;

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Context;
use serde_json::json;

use crate::{RELEASE, run_to_end, target_dir};

/// What is asked for.
#[derive(Default)]
pub(crate) struct TrustOptions {
    /// A JSON object a line instead of a table.
    pub(crate) is_json: bool,
    /// Beginnings of rows; all where empty.
    pub(crate) rows: Vec<String>,
    /// Which damaged files are tried, by number.
    pub(crate) runs: Range<usize>,
    /// Which shuffles are tried, by number.
    pub(crate) shuffles: Range<usize>,
    /// Beginnings of the names of scenes that are shuffled; all where empty.
    pub(crate) scenes: Vec<String>,
}

/// The parts by the first word of their rows: a module and a line here for each.
const PARTS: &[(&str, Part)] = &[
    ("case", budgets::cases),
    ("gate", gate::run),
    ("large", budgets::large),
    ("mutated", mutated::run),
    ("nasty", budgets::nasty),
    ("order", order::run),
];

type Part = fn(&mut Figures) -> anyhow::Result<()>;

/// The `n` damaged files from number `from` on; as many as there are by default if `n` is not given.
pub(crate) fn runs(from: usize, n: Option<usize>) -> Range<usize> {
    from..from.saturating_add(n.unwrap_or(mutated::COUNT))
}

/// As [`runs`], of shuffles.
pub(crate) fn shuffles(from: usize, n: Option<usize>) -> Range<usize> {
    from..from.saturating_add(n.unwrap_or(order::COUNT))
}

/// Measures and prints; fails where a bar is not met.
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
    eprintln!("{passed} bars met, {failed} not met, {unknown} unknown");
    anyhow::ensure!(failed == 0, "{failed} bars are not met");
    Ok(())
}

/// What is printed.
struct Figures {
    is_json: bool,
    /// Where inputs and outputs go.
    folder: PathBuf,
    /// Damaged files that are tried.
    runs: Range<usize>,
    /// Shuffles that are tried.
    shuffles: Range<usize>,
    /// Beginnings of the names of scenes that are shuffled.
    scenes: Vec<String>,
    /// Bars not met, met and unknown.
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

    /// Runs the command `enfilade` under GNU time, for at most so many seconds.
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

/// What came of a command.
struct Ran {
    code: Option<i32>,
    seconds: f64,
    /// Peak of resident memory. [Units: GiB]
    gigabytes: f64,
    said: String,
}

/// Whether a file has these bytes.
fn holds(path: &Path, bytes: &[u8]) -> bool {
    std::fs::read(path).is_ok_and(|found| found == bytes)
}
