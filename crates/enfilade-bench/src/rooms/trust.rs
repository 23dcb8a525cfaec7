//! Rows `verdict`: scenes of strangers, and some that are nothing, with the trust that they deserve. A world without a
//! room is refused.

use std::path::PathBuf;

use enfilade_testkit::{TowerParams, furnished_house, mixed, office_tower};

use super::bakes::{bake, shared, write_boxes, write_obj, write_text};
use crate::measure::files_of;
use crate::rows::RowPrinter;

/// Trust that shared scenes deserve, judged by eye on their plans; for all others, `good` or `fair`.
const DESERVED: [(&str, &[&str], &[&str]); 2] = [
    ("hotel-room.glb", &["--unit", "mm"], &["good", "fair"]),
    // Boxes and ramps on open ground.
    ("nav_test.obj", &[], &["refused"]),
];

pub(super) fn run(out: &mut RowPrinter<'_>) -> anyhow::Result<()> {
    let chosen = out.chosen;
    let mut measure = |name: &str, inputs: &[PathBuf], args: &[&str], deserved: &[&str]| {
        if !chosen.has_scene(name) {
            return anyhow::Ok(());
        }
        let args: Vec<String> = args.iter().map(|a| (*a).to_owned()).collect();
        let done = bake(inputs, &args)?;
        let said = done.said.lines().last().unwrap_or("").to_owned();
        let reasons = done.report["verdict"]["reasons"].as_array();
        let texts = reasons.iter().flat_map(|r| r.iter());
        let texts: Vec<&str> = texts.filter_map(|r| r["text"].as_str()).collect();
        let note = match done.trust() {
            "refused" => said,
            trust => format!("{trust}: {}", texts.join("; ")),
        };
        let is_true = deserved.contains(&done.trust());
        let bar = deserved.join(" or ");
        let value = f64::from(u8::from(is_true));
        out.print("verdict", name, Some(value), &bar, Some(is_true), &note);
        Ok(())
    };
    let good: &[&str] = &["good", "fair"];
    let refused: &[&str] = &["refused"];
    let boxes = |name: &str, boxes: &[(&str, [f64; 3], [f64; 3])]| write_boxes(name, boxes);
    measure("nothing", &[write_text("nothing.obj", "")?], &[], refused)?;
    let slab = boxes("slab.obj", &[("slab", [-4.0, -0.2, -3.0], [4.0, 0.0, 3.0])])?;
    measure("slab", &[slab], &[], refused)?;
    let room = boxes("box.obj", &[("walls", [0.0; 3], [5.0, 3.0, 4.0])])?;
    measure("box", &[room], &[], good)?;
    let standing: Vec<(&str, [f64; 3], [f64; 3])> = (0..27)
        .map(|i| {
            let at = [i % 3, i / 3 % 3, i / 9].map(|k| f64::from(k) * 1.5);
            ("chair", at, at.map(|x| x + 0.6))
        })
        .collect();
    measure(
        "furniture",
        &[boxes("furniture.obj", &standing)?],
        &[],
        refused,
    )?;
    measure(
        "terrain",
        &[write_text("terrain.obj", &terrain())?],
        &[],
        refused,
    )?;
    let made = [
        ("two rooms", mixed::two_rooms()),
        ("courtyard", mixed::open_courtyard()),
        ("stair hall", mixed::stair_hall()),
        ("glass facade", mixed::glass_facade_office()),
        ("house", furnished_house()),
        ("tower", office_tower(&TowerParams::with_rooms(16, 1))),
    ];
    for (name, generated) in made {
        if chosen.has_scene(name) {
            let inputs = write_obj(&generated.scene, &name.replace(' ', "-"), |p| p)?;
            measure(name, &inputs, &[], good)?;
        }
    }
    for (name, path) in shared() {
        let (files, details) = files_of(&path);
        let inputs: Vec<PathBuf> = files.into_iter().chain(details).collect();
        let known = DESERVED.iter().find(|d| d.0 == name);
        let (args, deserved) = known.map_or((&[][..], good), |d| (d.1, d.2));
        measure(&name, &inputs, args, deserved)?;
    }
    Ok(())
}

/// Hills of 40 × 40 m as an OBJ file.
fn terrain() -> String {
    let mut text = String::new();
    for (i, j) in (0..41).flat_map(|i| (0..41).map(move |j| (i, j))) {
        let (x, z) = (f64::from(i), f64::from(j));
        let y = 2.0 * (x * 0.3).sin() + 1.5 * (z * 0.4).cos();
        text += &format!("v {x} {y:.4} {z}\n");
    }
    for (i, j) in (0..40).flat_map(|i| (0..40).map(move |j| (i, j))) {
        let at = i * 41 + j + 1;
        text += &format!("f {at} {} {} {}\n", at + 1, at + 42, at + 41);
    }
    text
}
