//! Rows `levels: given portals` and `levels: sky time`: marks of designers become portals where they stand; a sky around a level costs
//! little.

use std::path::Path;
use std::time::Instant;

use anyhow::ensure;
use enfilade::geom::scene::GivenPortal;
use enfilade::geom::{Aabb, DVec3};
use enfilade::import::{ImportOptions, export_glb, import};
use serde_json::Value;

use super::score::{inspect, list, vec3};
use super::worlds::RoomRows;
use crate::measure;
use crate::process::{bake_command, beside_scenes, target_dir};

/// Files in which openings are marked, beside the real scenes.
const MARKED: [&str; 5] = [
    "cases/levels/d3-visportal.map",
    "cases/levels/q2-areaportal-entity.map",
    "cases/levels/q3-areaportal-brush.map",
    "cases/levels/helper-portal-in-doorway.glb",
    "levels/q2_areaportals.map",
];
/// Levels in a sky.
const SKIES: [&str; 2] = ["skybox.glb", "skydome40.glb"];
/// Bakes of which the median counts.
const N_BAKES: usize = 5;
/// Greatest distance of a portal's vertices from the plane of its mark, beyond half of the mark's thickness. [Units: wu]
const OFF: f64 = 0.05;

/// Prints both rows.
pub(super) fn run(out: &mut RoomRows<'_>) -> anyhow::Result<()> {
    let there = |file: &str| beside_scenes(file).filter(|f| f.is_file());
    if out.chosen.has_row("levels: given portals") {
        let files = MARKED.iter().filter_map(|file| there(file));
        for file in files.filter(|f| out.chosen.has_scene(&measure::name(f))) {
            given(&file, out)?;
        }
    }
    if out.chosen.has_row("levels: sky time") {
        let skies = SKIES
            .iter()
            .filter_map(|name| there(&format!("cases/levels/{name}")));
        for file in skies.filter(|f| out.chosen.has_scene(&measure::name(f))) {
            // The same level as it is read: without its sky.
            let plain = import(std::slice::from_ref(&file), &[], &ImportOptions::default())?;
            let without = target_dir().join("without-sky.glb");
            std::fs::write(&without, export_glb(&plain.scene))?;
            let without = seconds(&without)?;
            let times = seconds(&file)? / without;
            let note = format!("times {without:.2} s");
            let (row, bar, ok) = ("levels: sky time", "<= 1.5", Some(times <= 1.5));
            out.print(row, &measure::name(&file), Some(times), bar, ok, &note);
        }
    }
    Ok(())
}

/// Prints the share of a file's marks that are portals of its world.
fn given(file: &Path, out: &mut RoomRows<'_>) -> anyhow::Result<()> {
    let marks = import(&[file.to_owned()], &[], &ImportOptions::default())?;
    let marks = marks.scene.given_portals;
    let world = target_dir().join("given.glb");
    let done = bake_command(file, &world)
        .args(["--given", "portals"])
        .output()?;
    ensure!(
        done.status.success(),
        "{}",
        String::from_utf8_lossy(&done.stderr)
    );
    let graph = inspect(&world)?;
    let portals = list(&graph["portals"]);
    let n = marks
        .iter()
        .filter(|mark| portals.iter().any(|p| is_at(p, mark)))
        .count();
    let share = n as f64 / marks.len().max(1) as f64;
    let note = format!("{n} of {} marks", marks.len());
    out.print(
        "levels: given portals",
        &measure::name(file),
        Some(share),
        "1",
        Some(n > 0 && n == marks.len()),
        &note,
    );
    Ok(())
}

/// Returns `true` if a portal lies in a mark.
fn is_at(portal: &Value, mark: &GivenPortal) -> bool {
    let points = list(&portal["outline"]).iter().filter_map(vec3);
    let points: Vec<DVec3> = points.map(DVec3::from).collect();
    let away = |p: &DVec3| mark.normal.dot(*p - mark.outline[0]).abs();
    let around = Aabb::of_points(&mark.outline).expanded(OFF + mark.thickness / 2.0);
    !points.is_empty()
        && points.iter().all(|p| away(p) <= OFF + mark.thickness / 2.0)
        && around.overlaps(&Aabb::of_points(&points))
}

/// Returns the median time of a bake. [Units: s]
fn seconds(file: &Path) -> anyhow::Result<f64> {
    let mut times = Vec::with_capacity(N_BAKES);
    for _ in 0..N_BAKES {
        let began = Instant::now();
        let done = bake_command(file, &target_dir().join("sky.glb")).output()?;
        ensure!(done.status.success(), "{}: not baked", file.display());
        times.push(began.elapsed().as_secs_f64());
    }
    Ok(measure::median(&mut times))
}
