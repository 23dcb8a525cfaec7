//! Rows `verify`: `enfilade verify` on every world of this benchmark, and on those of the other builders.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

use super::cases::cases;
use super::score::{list, text};
use crate::measure;
use crate::process::binary;

use super::levels::files;
use super::spoilt::SPOILINGS;
use super::worlds::{Form, RoomRows};

/// The builders beside the watershed, which the default is for every building: none is made of brushes.
const METHODS: [&str; 2] = ["bsp", "delaunay"];

/// Lines of sight for each view of a frame.
const RAYS_A_VIEW: u64 = 100;

/// Most broken promises that a row lists.
const LISTED: usize = 12;

/// Counts of worlds, and of those that passed.
#[derive(Default)]
struct Verified {
    n: usize,
    n_good: usize,
}

/// Prints a row for each world, and one for all.
pub(super) fn run(out: &mut RoomRows<'_>) -> anyhow::Result<()> {
    let spoilt = SPOILINGS.iter().map(|s| s.form);
    let forms = [Form::Clean].into_iter().chain(spoilt);
    let forms = forms.chain(METHODS.map(Form::Method));
    let mut verified = Verified::default();
    for form in forms {
        let row = format!("verify: {}", form.name());
        if !out.chosen.has_row(&row) {
            continue;
        }
        for dir in out.buildings() {
            let baked = out.state.building(&dir, form);
            verified.print(&row, &measure::name(&dir), baked.world(), out)?;
        }
    }
    verified.levels(out)
}

/// Prints a row for the world of each level and small case, and one for all.
pub(super) fn run_levels(out: &mut RoomRows<'_>) -> anyhow::Result<()> {
    Verified::default().levels(out)
}

impl Verified {
    /// Prints the rows of levels, and the last one.
    fn levels(mut self, out: &mut RoomRows<'_>) -> anyhow::Result<()> {
        let row = "verify: levels";
        if out.chosen.has_row(row) {
            for (name, file) in files() {
                if out.chosen.has_scene(&name) {
                    let baked = out.state.level(&file);
                    self.print(row, &name, baked.world(), out)?;
                }
            }
            for (case, file) in cases() {
                let name = measure::file_name(&file);
                if out.chosen.has_scene(&name)
                    && let Some(world) = &out.state.case(case, &file)?.world
                {
                    self.print(row, &name, Ok(world), out)?;
                }
            }
        }
        if self.n > 0 {
            let note = format!("{} of {} worlds", self.n_good, self.n);
            let (value, ok) = (self.n_good as f64 / self.n as f64, self.n == self.n_good);
            out.print("verify", "all", Some(value), "1", Some(ok), &note);
        }
        Ok(())
    }

    fn print(
        &mut self,
        row: &str,
        scene: &str,
        world: Result<&Path, &str>,
        out: &mut RoomRows<'_>,
    ) -> anyhow::Result<()> {
        let (code, note) = match world {
            Ok(world) => verify(world, out.state.rays)?,
            Err(why) => (None, format!("no world: {why}")),
        };
        let ok = code == Some(0);
        self.n += 1;
        self.n_good += usize::from(ok);
        out.print(row, scene, code.map(f64::from), "exit 0", Some(ok), &note);
        Ok(())
    }
}

/// Returns the exit code of `verify`, and what it finds broken.
fn verify(world: &Path, rays: u64) -> anyhow::Result<(Option<i32>, String)> {
    let mut command = Command::new(binary("enfilade"));
    let numbers = [rays, rays / RAYS_A_VIEW].map(|n| n.to_string());
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
