//! Robustness of rooms and doors against disturbed models, each figure with its bar.
//!
//! Scenes with a truth are baked unchanged and disturbed by the test kit's `generate`, and the results compared.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Context;

use super::figures::{Measured, measure};
use crate::measure::file_name;
use crate::process::{binary, generate, output_of, scenes, scenes_in, target_dir};
use crate::rows::{RowPrinter, shown};

/// Generated scenes, disturbed like the real ones.
const GENERATED: [&str; 7] = [
    "house",
    "tower",
    "two-rooms",
    "stair-hall",
    "double-door-corridor",
    "glass-facade-office",
    "pitched-roof-attic",
];

/// A way to disturb scenes, or none.
struct Case {
    /// Beginning of its row names.
    label: &'static str,
    /// Arguments of `generate`; `None` for `gltf-transform quantize`.
    spoilt: Option<&'static [&'static str]>,
    /// Arguments of `bake`.
    settings: &'static [&'static str],
    judge: fn(&mut MessyRows<'_>, &Measured, &Measured),
}

const CASES: [Case; 13] = [
    moved("moved-1e-6", &["--jitter", "1e-6"], near_moved),
    moved("moved-1e-5", &["--jitter", "1e-5"], near_moved),
    moved("moved-1e-4", &["--jitter", "1e-4"], near_moved),
    moved("moved-1e-3", &["--jitter", "1e-3"], near_moved),
    moved("moved-5e-3", &["--jitter", "5e-3"], far_moved),
    moved(
        "missing-0.005",
        &["--drop", "0.005"],
        |rows, now, before| {
            rows.shares("rooms", now.rooms, before.rooms, 0.05);
            rows.shares("holes", Some(now.holes as f64), Some(1.0), 0.0);
        },
    ),
    moved("missing-0.02", &["--drop", "0.02"], |rows, now, before| {
        rows.shares("rooms", now.rooms, before.rooms, 0.10);
        rows.shares("holes", Some(now.holes as f64), Some(1.0), 0.0);
    }),
    moved("quantized-2mm", &["--snap", "0.002"], quantized),
    Case {
        spoilt: None,
        ..moved("quantized-gltf", &[], quantized)
    },
    moved("unnamed", &["--strip"], |rows, now, before| {
        rows.shares("rooms", now.rooms, before.rooms, 0.05);
        rows.figure("doors", now.doors);
        rows.figure("windows", now.windows);
    }),
    exact("exact-0", &[]),
    exact("exact-1e-5", &["--jitter", "1e-5"]),
    exact("exact-1e-3", &["--jitter", "1e-3"]),
];

const fn moved(
    label: &'static str,
    spoilt: &'static [&'static str],
    judge: fn(&mut MessyRows<'_>, &Measured, &Measured),
) -> Case {
    Case {
        label,
        spoilt: Some(spoilt),
        settings: &[],
        judge,
    }
}

const fn exact(label: &'static str, spoilt: &'static [&'static str]) -> Case {
    Case {
        settings: &["--smallest-hole", "0"],
        ..moved(label, spoilt, |rows, now, before| {
            rows.shares("rooms", now.rooms, before.rooms, 0.03);
            rows.within("cracks a pair and plane", now.cracks as f64, 1.0);
            rows.broken(now);
        })
    }
}

fn near_moved(rows: &mut MessyRows<'_>, now: &Measured, before: &Measured) {
    rows.shares("rooms", now.rooms, before.rooms, 0.03);
    rows.shares("doors", now.doors, before.doors, 0.03);
    rows.within("portals ratio", now.portals_to(before), 1.2);
    rows.within("time ratio", now.seconds / before.seconds, 2.0);
    rows.broken(now);
}

/// Gaps are wider than the default hole: cracks are allowed, but only a few.
fn far_moved(rows: &mut MessyRows<'_>, now: &Measured, before: &Measured) {
    rows.shares("rooms", now.rooms, before.rooms, 0.05);
    rows.shares("doors", now.doors, before.doors, 0.05);
    rows.within("cracks a pair and plane", now.cracks as f64, 1.0);
    rows.within("time ratio", now.seconds / before.seconds, 2.0);
    rows.broken(now);
}

fn quantized(rows: &mut MessyRows<'_>, now: &Measured, before: &Measured) {
    rows.shares("rooms", now.rooms, before.rooms, 0.0);
    rows.shares("doors", now.doors, before.doors, 0.0);
    rows.within("portals ratio", now.portals_to(before), 1.1);
}

/// The name of the rows to print, and figures kept for averages.
pub(crate) struct Messy {
    /// Segments that `verify` tries, and as many rays.
    rays: u64,
    pub(super) folder: PathBuf,
    pub(super) label: String,
    pub(super) scene: String,
    /// True for a real scene: its figures count for averages.
    is_real: bool,
    figures: BTreeMap<String, Vec<f64>>,
    /// The scenes to disturb, once they are made.
    bases: Vec<Base>,
}

impl Messy {
    pub(crate) fn new(rays: u64) -> Self {
        Self {
            rays,
            folder: target_dir().join("messy"),
            label: String::new(),
            scene: String::new(),
            is_real: false,
            figures: BTreeMap::new(),
            bases: Vec::new(),
        }
    }
}

/// The rows of this benchmark.
pub(super) type MessyRows<'a> = RowPrinter<'a, Messy>;

impl MessyRows<'_> {
    fn told(&mut self, row: &str, value: Option<f64>, bar: &str, ok: Option<bool>, note: &str) {
        let row = format!("{} {row}", self.state.label);
        let scene = self.state.scene.clone();
        self.print(&row, &scene, value, bar, ok, note);
    }

    /// Prints a share that may be lower than `wanted` by `slack`. No row if the scene has no such thing.
    pub(super) fn shares(
        &mut self,
        row: &str,
        value: Option<f64>,
        wanted: Option<f64>,
        slack: f64,
    ) {
        if let (Some(value), Some(wanted)) = (value, wanted) {
            let least = (wanted - slack).max(0.0);
            // Shares that differ only by rounding are equal.
            let ok = value >= least - 1e-9;
            self.told(row, Some(value), &format!(">= {least:.2}"), Some(ok), "");
        }
    }

    pub(super) fn within(&mut self, row: &str, value: f64, most: f64) {
        let ok = value <= most;
        self.told(
            row,
            Some(value),
            &format!("<= {}", shown(most)),
            Some(ok),
            "",
        );
    }

    fn broken(&mut self, m: &Measured) {
        match &m.broken {
            Ok(n) => self.within("broken", *n as f64, 0.0),
            Err(why) => self.told("broken", None, "<= 0", Some(false), why),
        }
    }

    /// Keeps a figure for an average.
    fn figure(&mut self, name: &str, value: Option<f64>) {
        if let Some(value) = value.filter(|_| self.state.is_real) {
            self.state
                .figures
                .entry(name.into())
                .or_default()
                .push(value);
        }
    }

    /// Prints the average of the kept figures, if there are any.
    fn average(&mut self, name: &str, least: f64) {
        let kept = self.state.figures.remove(name).unwrap_or_default();
        if !kept.is_empty() {
            self.state.scene = format!("average of {}", kept.len());
            let mean = kept.iter().sum::<f64>() / kept.len() as f64;
            // Bars have two digits, so round to these first.
            let ok = (mean * 100.0).round() >= (least * 100.0).round();
            self.told(name, Some(mean), &format!(">= {least:.2}"), Some(ok), "");
        }
    }

    pub(super) fn failed(&mut self, error: &anyhow::Error) {
        let note = format!("{error:#}");
        let first = note.lines().next().unwrap_or_default().to_owned();
        self.told("bake", None, "", Some(false), &first);
    }
}

/// A scene with a truth, and its undisturbed figures.
struct Base {
    name: String,
    dir: PathBuf,
    is_real: bool,
    measured: Option<Measured>,
}

impl MessyRows<'_> {
    /// Bakes a scene folder and judges it, or prints why that failed.
    fn try_scene(
        &mut self,
        dir: &Path,
        settings: &[&str],
        rays: u64,
        judge: impl FnOnce(&mut Self, &Measured),
    ) -> Option<Measured> {
        let world = self.state.folder.join("world.glb");
        match measure(dir, &world, settings, rays) {
            Ok(m) => {
                judge(self, &m);
                if let Some(unsaid) = m.unsaid {
                    self.within("silence", unsaid as f64, 0.0);
                }
                Some(m)
            }
            Err(error) => {
                self.failed(&error);
                None
            }
        }
    }

    /// Measures a scene as it is, once.
    fn undisturbed(&mut self, base: &mut Base) {
        self.state.label = "undisturbed".into();
        self.state.scene.clone_from(&base.name);
        self.state.is_real = base.is_real;
        if base.measured.is_none() {
            base.measured = self.try_scene(&base.dir, &[], 0, |_, _| ());
        }
    }

    /// Returns the scenes to disturb: real ones with a truth, and generated ones.
    fn bases(&self) -> anyhow::Result<Vec<Base>> {
        let base = |dir: PathBuf, is_real| Base {
            name: file_name(&dir),
            dir,
            is_real,
            measured: None,
        };
        let mut all: Vec<Base> = scenes()
            .into_iter()
            .filter(|d| d.join("truth.json").is_file())
            .map(|d| base(d, true))
            .collect();
        for name in GENERATED.into_iter().filter(|n| self.chosen.has_scene(n)) {
            let dir = self.state.folder.join("as-it-is").join(name);
            generate(&[name, "--rooms", "16"], &dir)?;
            all.push(base(dir, false));
        }
        all.retain(|b| self.chosen.has_scene(&b.name));
        Ok(all)
    }

    /// Prints rows of one disturbance of one scene.
    fn case(&mut self, case: &Case, base: &mut Base) -> anyhow::Result<()> {
        self.undisturbed(base);
        self.state.label = case.label.into();
        let Some(before) = base.measured.clone() else {
            return Ok(());
        };
        let spoilt = self.state.folder.join(case.label).join(&base.name);
        let dir = match case.spoilt {
            Some([]) => base.dir.clone(),
            Some(how) => {
                let from = base.dir.display().to_string();
                generate(&[&[from.as_str()], how].concat(), &spoilt)?;
                spoilt
            }
            None => {
                quantize(&base.dir, &spoilt)?;
                spoilt
            }
        };
        let rays = self.state.rays;
        self.try_scene(&dir, case.settings, rays, |rows, now| {
            (case.judge)(rows, now, &before);
        });
        Ok(())
    }
}

/// Prints rows of each way to disturb scenes.
pub(super) fn cases(rows: &mut MessyRows<'_>) -> anyhow::Result<()> {
    let mut help = Command::new(binary("enfilade"));
    let has_hole = output_of(help.args(["bake", "--help"]), None)?.contains("--smallest-hole");
    let has_quantize = Command::new(QUANTIZE).arg("--version").output().is_ok();
    let mut bases = rows.bases()?;
    for case in CASES.iter().filter(|case| rows.chosen.has_row(case.label)) {
        let lacks = if !case.settings.is_empty() && !has_hole {
            Some(("bake has no --smallest-hole", Some(false)))
        } else if case.spoilt.is_none() && !has_quantize {
            Some(("not installed: npm install -g @gltf-transform/cli", None))
        } else {
            None
        };
        if let Some((note, ok)) = lacks {
            rows.state.label = case.label.into();
            rows.state.scene = "all".into();
            rows.told("rooms", None, "", ok, note);
            continue;
        }
        for base in &mut bases {
            rows.case(case, base)?;
        }
        rows.average("doors", 0.80);
        rows.average("windows", 0.75);
    }
    rows.state.bases = bases;
    Ok(())
}

/// Prints averages of real scenes as they are.
pub(super) fn undisturbed(rows: &mut MessyRows<'_>) -> anyhow::Result<()> {
    let mut bases = std::mem::take(&mut rows.state.bases);
    rows.state.label = "undisturbed".into();
    for base in bases.iter_mut().filter(|b| b.is_real) {
        rows.undisturbed(base);
        if let Some(m) = &base.measured {
            rows.figure("rooms", m.rooms);
            rows.figure("doors", m.doors);
            rows.figure("windows", m.windows);
        }
    }
    rows.average("rooms", 0.92);
    rows.average("doors", 0.98);
    rows.average("windows", 0.99);
    Ok(())
}

/// Prints rows of the test kit's buildings with faults.
pub(super) fn faults(rows: &mut MessyRows<'_>) -> anyhow::Result<()> {
    let folder = rows.state.folder.join("faults");
    generate(&["faults"], &folder)?;
    rows.state.label = "fault".into();
    for dir in scenes_in(&folder) {
        let name = file_name(&dir);
        if !rows.chosen.has_scene(&name) {
            continue;
        }
        rows.state.scene = name;
        rows.try_scene(&dir, &[], 0, |rows, m| {
            rows.shares("rooms", m.rooms, Some(0.95), 0.0);
            rows.shares("doors", m.doors, Some(0.95), 0.0);
            if let Some(extra) = m.extra {
                rows.within("extra portals a room", extra, 0.1);
            }
            if m.n_matter > 0 {
                rows.within("solids with air in them", m.in_matter as f64, 0.0);
            }
        });
    }
    Ok(())
}

/// The program that quantizes, if installed.
const QUANTIZE: &str = "gltf-transform";

/// Quantizes the files of a scene folder.
fn quantize(from: &Path, to: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(to)?;
    for name in ["scene.glb", "detail.glb"] {
        let path = from.join(name);
        if path.is_file() {
            let mut command = Command::new(QUANTIZE);
            command.arg("quantize").arg(path).arg(to.join(name));
            output_of(&mut command, None)?;
        }
    }
    let truth = "truth.json";
    std::fs::copy(from.join(truth), to.join(truth))
        .map(drop)
        .context(truth)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_has_a_label_of_its_own() {
        for (i, a) in CASES.iter().enumerate() {
            assert!(CASES[..i].iter().all(|b| b.label != a.label), "{}", a.label);
        }
    }
}
