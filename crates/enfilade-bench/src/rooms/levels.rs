//! Rows `levels`: levels of games, without a truth of rooms.

use std::path::Path;

use enfilade::geom::scene::Scene;
use enfilade::geom::{Aabb, DVec3};
use enfilade::import::{ImportOptions, RoleRules, import};
use serde_json::Value;

use super::cases::cases;
use super::score::{V3, list, vec3};
use crate::measure;
use crate::process::beside_scenes;

use super::bars::Bar;
use super::worlds::RoomRows;

/// A level, and what its page says.
struct GameLevel {
    file: &'static str,
    rooms: Bar,
    /// Door objects with a portal at their place.
    doors: Option<Bar>,
    /// Share of the volume of all rooms that the largest has: halls that are one cell are nearly all of it.
    largest: Option<Bar>,
}

const LEVELS: [GameLevel; 2] = [
    GameLevel {
        file: "freedoom-e1m1.glb",
        rooms: Bar::Least(10.0),
        doors: Some(Bar::Least(17.0)),
        largest: None,
    },
    GameLevel {
        file: "dive.glb",
        rooms: Bar::Least(10.0),
        doors: None,
        largest: Some(Bar::Most(0.5)),
    },
];

/// The least volume of a room: 4 m² under a ceiling of 2.5 m. [Units: wu³]
const ROOM: f64 = 10.0;

/// Prints the rows of the levels and of the small cases.
pub(super) fn run(out: &mut RoomRows<'_>) -> anyhow::Result<()> {
    let folder = beside_scenes("levels");
    for level in &LEVELS {
        let file = folder.as_ref().map(|dir| dir.join(level.file));
        let is_wanted = out.chosen.has_row("levels: rooms") && out.chosen.has_scene(level.file);
        let Some(file) = file.filter(|f| is_wanted && f.is_file()) else {
            continue;
        };
        let baked = out.state.level(&file);
        match &baked.graph {
            Ok(graph) => level.print(&file, graph, out)?,
            Err(why) => out.print("levels", level.file, None, "a world", Some(false), why),
        }
    }
    if !out.chosen.has_row("levels: case") {
        return Ok(());
    }
    for (case, file) in cases() {
        let name = measure::file_name(&file);
        if out.chosen.has_scene(&name) {
            let (ok, found) = out.state.case(case, &file)?.judged(case);
            let value = Some(f64::from(u8::from(ok)));
            out.print(
                "levels: case",
                &name,
                value,
                &case.wanted(),
                Some(ok),
                &found,
            );
        }
    }
    Ok(())
}

impl GameLevel {
    fn print(&self, file: &Path, graph: &Value, out: &mut RoomRows<'_>) -> anyhow::Result<()> {
        let mut print = |row: &str, value: f64, bar: Bar, note: &str| {
            let ok = Some(bar.passes(value));
            out.print(row, self.file, Some(value), &bar.text(), ok, note);
        };
        let volume = |c: &Value| c["volume"].as_f64().unwrap_or(0.0);
        let cells = list(&graph["cells"]).iter();
        let rooms = cells.filter(|c| c["kind"] == "room" && c["outdoor"] != true);
        let volumes: Vec<f64> = rooms.map(volume).filter(|&v| v >= ROOM).collect();
        let largest = volumes.iter().copied().fold(0.0, f64::max);
        let note = format!("the largest has {largest:.0} m³");
        print("levels: rooms", volumes.len() as f64, self.rooms, &note);
        if let Some(bar) = self.largest {
            let share = largest / volumes.iter().sum::<f64>();
            print("levels: largest room", share, bar, "of the volume of all");
        }
        if let Some(bar) = self.doors {
            let (n, missing) = n_doors_with_portal(&objects_of(file)?, graph);
            let note = format!("without: {}", missing.join(", "));
            print("levels: doors", n as f64, bar, &note);
        }
        Ok(())
    }
}

/// Returns a file's objects, each with the role that the file gives it, and none left out.
pub(super) fn objects_of(file: &Path) -> anyhow::Result<Scene> {
    let roles = RoleRules {
        is_manual: true,
        ..RoleRules::default()
    };
    let options = ImportOptions {
        roles,
        ..ImportOptions::default()
    };
    Ok(import(&[file.to_owned()], &[], &options)?.scene)
}

/// The distance in plan from a door object to the center of its portal. [Units: wu]
const REACH: f64 = 0.5;
/// Height of the passage below a door object that is only the flat underside of a raised leaf. [Units: wu]
const PASSAGE: f64 = 4.0;

/// Counts objects called `door_…` in whose place, seen from above and at its height, an upright portal lies; returns the names of the
/// others.
fn n_doors_with_portal(scene: &Scene, graph: &Value) -> (usize, Vec<String>) {
    let portals: Vec<Aabb> = (list(&graph["portals"]).iter())
        .filter(|p| vec3(&p["normal"]).is_some_and(|n| n[1].abs() < 0.5))
        .map(|p| {
            let points: Vec<V3> = list(&p["outline"]).iter().filter_map(vec3).collect();
            Aabb::of_points(&points.into_iter().map(DVec3::from).collect::<Vec<_>>())
        })
        .collect();
    let doors = (0..scene.objects.len()).filter(|&i| scene.objects[i].name.starts_with("door_"));
    let (mut n, mut missing) = (0, Vec::new());
    for door in doors {
        let mut place = scene.object_aabb(door).expanded(REACH);
        if place.size().y < 2.0 * REACH + 0.1 {
            place.min.y -= PASSAGE;
        }
        let is_there = |portal: &&Aabb| {
            let middle = (portal.min + portal.max) / 2.0;
            let at = DVec3::new(
                middle.x,
                place.min.y.max(middle.y).min(place.max.y),
                middle.z,
            );
            place.contains(at) && place.overlaps(portal)
        };
        if portals.iter().any(|p| is_there(&p)) {
            n += 1;
        } else {
            missing.push(scene.objects[door].name.clone());
        }
    }
    (n, missing)
}

/// Returns the name of a level or case for rows.
pub(super) fn files() -> Vec<(String, std::path::PathBuf)> {
    let folder = beside_scenes("levels");
    let levels = LEVELS
        .iter()
        .filter_map(|l| Some(folder.as_ref()?.join(l.file)));
    let levels = levels.filter(|file| file.is_file());
    levels.map(|file| (measure::name(&file), file)).collect()
}
