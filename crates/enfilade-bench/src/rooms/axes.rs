//! Rows `axes`: scenes turned so that z points up, in other units, and far from the origin, in a format that states
//! none of this. The bake must end with the options that make it right, all in one message, and with them the world
//! must be that of the scene as it was.

use enfilade::geom::DVec3;
use enfilade::geom::scene::Scene;
use enfilade::import::{ImportOptions, import};
use enfilade_testkit::{TowerParams, furnished_house, mixed, office_tower};

use super::bakes::{BakeDone, bake, shared, write_obj};
use crate::measure::files_of;
use crate::rows::RowPrinter;

/// A scene in other coordinates.
struct Variant {
    name: &'static str,
    /// Numbers in a meter.
    factor: f64,
    /// Place of its origin.
    away: f64,
    /// Options to expect in the first message. In feet, a house is a plausible hall: its doors show it after the bake.
    options: &'static str,
    /// Options to expect in the verdict.
    after: &'static str,
    /// Bake with the options, too; the others give the same scene.
    is_baked: bool,
}

const VARIANTS: [Variant; 6] = [
    Variant::new("z up", 1.0, "--up z").baked(),
    Variant::new("z up, mm", 1000.0, "--unit mm --up z"),
    Variant::new("z up, cm", 100.0, "--unit cm --up z"),
    Variant::new("z up, in", 1.0 / 0.0254, "--unit in --up z"),
    Variant {
        after: "--unit ft",
        ..Variant::new("z up, ft", 1.0 / 0.3048, "--up z").baked()
    },
    Variant {
        away: 10_000.0,
        ..Variant::new("z up, 10 km", 1.0, "--up z").baked()
    },
];

impl Variant {
    const fn new(name: &'static str, factor: f64, options: &'static str) -> Self {
        Self {
            name,
            factor,
            away: 0.0,
            options,
            after: "",
            is_baked: false,
        }
    }

    const fn baked(mut self) -> Self {
        self.is_baked = true;
        self
    }
}

pub(super) fn run(out: &mut RowPrinter<'_>) -> anyhow::Result<()> {
    let made = [
        ("two rooms", mixed::two_rooms()),
        ("stair hall", mixed::stair_hall()),
        ("house", furnished_house()),
        ("tower", office_tower(&TowerParams::with_rooms(16, 1))),
    ];
    for (name, generated) in made {
        if out.chosen.has_scene(name) {
            measure(name, &generated.scene, out)?;
        }
    }
    for (name, path) in shared() {
        if out.chosen.has_scene(&name) {
            let (files, details) = files_of(&path);
            let options = ImportOptions {
                // Millimeters, as no error but a look shows.
                unit: (name == "hotel-room.glb").then_some(0.001),
                ..ImportOptions::default()
            };
            measure(&name, &import(&files, &details, &options)?.scene, out)?;
        }
    }
    Ok(())
}

fn measure(name: &str, scene: &Scene, out: &mut RowPrinter<'_>) -> anyhow::Result<()> {
    let file = name.replace([' ', '.'], "-");
    let before = bake(&write_obj(scene, &file, |p| p)?, &[])?;
    let is_told = |text: &str| before.said.contains(text);
    // A cave or a vessel has no up, and a scene that is refused as it was made shows nothing here.
    let note = if before.code == Some(0) {
        String::new()
    } else {
        format!("as it was: {}", before.said.lines().last().unwrap_or(""))
    };
    let ok = Some(before.code == Some(0) && !is_told("points up"));
    out.print("axes: as it was", name, None, "no word", ok, &note);
    for variant in &VARIANTS {
        let turned =
            |p: DVec3| variant.factor * (DVec3::new(p.x, -p.z, p.y) + DVec3::splat(variant.away));
        let inputs = write_obj(scene, &file, turned)?;
        let first = bake(&inputs, &[])?;
        let row = format!("axes: {}", variant.name);
        let (value, note) = if first.code == Some(0) {
            apart(&before, &first)
        } else if !ends_with(&first.said, variant.options) {
            let said = first.said.lines().last().unwrap_or("").to_owned();
            (f64::INFINITY, said)
        } else if variant.is_baked {
            let mut args = words(variant.options);
            let mut then = bake(&inputs, &args)?;
            let after = then.report["verdict"]["reasons"].to_string();
            if !variant.after.is_empty() && after.contains(variant.after) {
                args.extend(words(variant.after));
                then = bake(&inputs, &args)?;
            }
            apart(&before, &then)
        } else {
            (0.0, String::new())
        };
        let value_shown = value.is_finite().then_some(value);
        out.print(
            &row,
            name,
            value_shown,
            "<= 0.05",
            Some(value <= 0.05),
            &note,
        );
    }
    Ok(())
}

/// Returns `true` if a message proposes these options together, and no other.
fn ends_with(said: &str, options: &str) -> bool {
    let said = said.replace("--unit 0.001", "--unit mm");
    let told: Vec<&str> = ["--unit mm", "--unit cm", "--unit in", "--unit ft", "--up z"]
        .into_iter()
        .filter(|option| said.contains(option))
        .collect();
    told.join(" ") == options
}

fn words(options: &str) -> Vec<String> {
    options.split_whitespace().map(str::to_owned).collect()
}

/// Returns the share of rooms and doors that one bake found more than the other.
fn apart(before: &BakeDone, then: &BakeDone) -> (f64, String) {
    let (a, b) = (before.found(), then.found());
    let share = |k: usize| (a[k] - b[k]).abs() as f64 / a[k].max(1) as f64;
    let note = match then.code {
        Some(0) if a == b => String::new(),
        Some(0) => format!("rooms and doors: {a:?}, then {b:?}"),
        _ => then.said.lines().last().unwrap_or("").to_owned(),
    };
    match then.code {
        Some(0) => (share(0).max(share(1)), note),
        _ => (f64::INFINITY, note),
    }
}
