//! Rows `verify`: `enfilade verify` on every world of this benchmark, and on those of the other builders.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::judge::cases::cases;
use crate::measure;
use crate::process::binary;
use crate::rows::RowPrinter;
use crate::score::{list, text};

use super::levels::files;
use super::spoilt::SPOILINGS;
use super::worlds::{Form, Worlds};

/// The builders beside the watershed, which the default is for every building: none is made of brushes.
const METHODS: [&str; 2] = ["bsp", "delaunay"];

/// Lines of sight for each view of a frame.
const RAYS_A_VIEW: u64 = 100;

/// Most broken promises that a row lists.
const LISTED: usize = 12;

/// Counts of worlds, and of those that passed.
struct Verified<'a> {
    rays: u64,
    out: &'a mut RowPrinter,
    n: usize,
    n_good: usize,
}

/// Prints a row for each world, and one for all.
pub(super) fn run(worlds: &mut Worlds<'_>, rays: u64, out: &mut RowPrinter) -> anyhow::Result<()> {
    let spoilt = SPOILINGS.iter().map(|s| s.form);
    let forms = [Form::Clean].into_iter().chain(spoilt);
    let forms = forms.chain(METHODS.map(Form::Method));
    let mut verified = Verified::new(rays, out);
    for form in forms {
        let row = format!("verify: {}", form.name());
        if !worlds.chosen.has_row(&row) {
            continue;
        }
        for dir in worlds.buildings() {
            let baked = worlds.building(&dir, form);
            let world = baked.graph.as_ref().map(|_| &*baked.world);
            verified.print(&row, &measure::name(&dir), world.map_err(|why| &**why))?;
        }
    }
    verified.levels(worlds)?;
    verified.finish();
    Ok(())
}

/// Prints a row for the world of each level and small case, and one for all.
pub(super) fn run_levels(
    worlds: &mut Worlds<'_>,
    rays: u64,
    out: &mut RowPrinter,
) -> anyhow::Result<()> {
    let mut verified = Verified::new(rays, out);
    verified.levels(worlds)?;
    verified.finish();
    Ok(())
}

impl<'a> Verified<'a> {
    fn new(rays: u64, out: &'a mut RowPrinter) -> Self {
        Self {
            rays,
            out,
            n: 0,
            n_good: 0,
        }
    }

    fn levels(&mut self, worlds: &mut Worlds<'_>) -> anyhow::Result<()> {
        if !worlds.chosen.has_row("verify: levels") {
            return Ok(());
        }
        for (name, file) in files() {
            if worlds.chosen.has_scene(&name) {
                let baked = worlds.level(&file);
                let world = baked.graph.as_ref().map(|_| &*baked.world);
                self.print("verify: levels", &name, world.map_err(|why| &**why))?;
            }
        }
        for (case, file) in cases() {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            if worlds.chosen.has_scene(&name)
                && let Some(world) = &worlds.case(case, &file)?.world
            {
                self.print("verify: levels", &name, Ok(world))?;
            }
        }
        Ok(())
    }

    fn finish(self) {
        let Self { n, n_good, out, .. } = self;
        if n > 0 {
            let note = format!("{n_good} of {n} worlds");
            let value = n_good as f64 / n as f64;
            out.print("verify", "all", Some(value), "1", Some(n == n_good), &note);
        }
    }

    fn print(&mut self, row: &str, scene: &str, world: Result<&Path, &str>) -> anyhow::Result<()> {
        let (code, note) = match world {
            Ok(world) => self.verify(world)?,
            Err(why) => (None, format!("no world: {why}")),
        };
        let ok = code == Some(0);
        self.n += 1;
        self.n_good += usize::from(ok);
        let value = code.map(f64::from);
        self.out.print(row, scene, value, "exit 0", Some(ok), &note);
        Ok(())
    }

    /// Returns the exit code of `verify`, and what it finds broken.
    fn verify(&self, world: &Path) -> anyhow::Result<(Option<i32>, String)> {
        let mut command = Command::new(binary("enfilade"));
        let numbers = [self.rays, self.rays / RAYS_A_VIEW].map(|n| n.to_string());
        command.arg("verify").arg(world);
        command.args(["--rays", &numbers[0], "--sight", &numbers[1], "--json"]);
        let done = command.output()?;
        // Where a promise is broken, it exits with 1 after its report.
        let note = match serde_json::from_slice::<Value>(&done.stdout) {
            Ok(report) => {
                let mut broken = vec![("missed in views", &report["sight"]["missed"])];
                broken.extend(["unsealed", "incomplete", "hidden"].map(|n| (n, &report[n])));
                let broken = broken.into_iter().filter(|(_, n)| **n != 0);
                let broken = broken.map(|(name, n)| format!("{name}: {n}"));
                let all = broken.chain(list(&report["problems"]).iter().map(text));
                all.take(LISTED).collect::<Vec<_>>().join("; ")
            }
            Err(_) => String::from_utf8_lossy(&done.stderr).trim().to_owned(),
        };
        Ok((done.status.code(), note))
    }
}
