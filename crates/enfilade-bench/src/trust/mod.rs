//! `bench trust`: hostile and huge input, each figure with its bar.

mod budgets;
mod commands;
mod formats;
mod gate;
mod habits;
mod inputs;
mod leftovers;
mod mutate;
mod mutated;
mod order;
mod random;
mod scenes;
mod states;
mod tampered;
mod tight;

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Context;

use crate::process::{binary, target_dir};
use crate::rows::{Chosen, RowPrinter};

/// The options of the bench.
#[derive(clap::Args)]
pub(crate) struct Trust {
    #[command(flatten)]
    chosen: Chosen,
    /// Number of damaged files of `mutated`, of shuffles of each scene of `order`, and of kills of `leftovers`; 20,000, 20 and
    /// 200 by default.
    #[arg(long)]
    count: Option<usize>,
    /// Index of the first of them.
    #[arg(long, default_value_t = 0)]
    from: usize,
}

impl Trust {
    /// Returns the indices of damaged files or shuffles to try, given their default number.
    fn runs(&self, n: usize) -> Range<usize> {
        self.from..self.from.saturating_add(self.count.unwrap_or(n))
    }
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
    ("leftovers", leftovers::run),
    ("mutated", mutated::run),
    ("nasty", budgets::nasty),
    ("order", order::run),
    ("states", states::run),
    ("tampered", tampered::run),
    ("tight", tight::run),
];

type Part = fn(&mut Figures<'_>) -> anyhow::Result<()>;

/// Measures and prints; fails if a bar is missed.
pub(crate) fn bench_trust(options: &Trust, is_json: bool) -> anyhow::Result<()> {
    let folder = target_dir().join("trust");
    std::fs::create_dir_all(&folder)?;
    let mut rows = Figures {
        printer: RowPrinter::new(is_json),
        folder,
        options,
    };
    for (name, part) in PARTS.iter().copied() {
        if options.chosen.has_row(name) {
            part(&mut rows)?;
        }
    }
    rows.printer.finish()
}

/// The printed figures.
struct Figures<'a> {
    printer: RowPrinter,
    /// Folder of inputs and outputs.
    folder: PathBuf,
    options: &'a Trust,
}

impl Figures<'_> {
    fn print(&mut self, row: &str, scene: &str, value: Option<f64>, bar: &str, ok: Option<bool>) {
        self.printer.print(row, scene, value, bar, ok, "");
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
        timed.arg(binary("enfilade")).args(args);
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
