//! A bake and its figures.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, bail};
use serde_json::Value;

use super::score::{V3, center_and_area, dot, inspect, list, locate, score_world, sub, unit, vec3};
use crate::process::{add_scene_files, bake_command, binary};

/// The figures of a bake.
#[derive(Clone)]
pub(super) struct Measured {
    /// Shares as in `docs/benchmarks/rooms.md`; `None` if the scene has nothing of the kind.
    pub(super) rooms: Option<f64>,
    pub(super) doors: Option<f64>,
    pub(super) windows: Option<f64>,
    pub(super) extra: Option<f64>,
    pub(super) portals: usize,
    /// Openings to the outdoors that are listed as possible holes, and holes in surfaces.
    pub(super) holes: usize,
    /// Most crack portals between the same pair of cells in one plane.
    pub(super) cracks: usize,
    /// Points of the truth in closed solids, and those that lie in an indoor cell.
    pub(super) n_matter: usize,
    pub(super) in_matter: usize,
    /// Wall time of the bake. [Units: s]
    pub(super) seconds: f64,
    /// Broken promises found by `verify`, or why it failed.
    pub(super) broken: Result<u64, String>,
    /// Number of conditions that the bake should have reported but did not; `None` if there were none to report.
    pub(super) unsaid: Option<usize>,
}

impl Measured {
    pub(super) fn portals_to(&self, before: &Self) -> f64 {
        self.portals as f64 / before.portals.max(1) as f64
    }
}

/// Shorter bakes are repeated, and the fastest counts. [Units: s]
const SHORT: f64 = 2.0;
const REPEATS: usize = 3;

/// Bakes a scene folder with `settings`, scores and verifies it. Without `rays`, it is not verified.
pub(super) fn measure(
    dir: &Path,
    world: &Path,
    settings: &[&str],
    rays: u64,
) -> anyhow::Result<Measured> {
    let mut seconds = f64::INFINITY;
    let mut said = String::new();
    for i in 0..REPEATS {
        let mut command = bake_command(dir, world);
        command.args(settings);
        let start = Instant::now();
        let done = command.output().context("cannot start enfilade")?;
        seconds = seconds.min(start.elapsed().as_secs_f64());
        said = String::from_utf8_lossy(&done.stderr).into_owned();
        if !done.status.success() {
            bail!("bake: {}: {}", done.status, said.trim());
        }
        if i == 0 && seconds > SHORT {
            break;
        }
    }
    let graph = inspect(world)?;
    let row = score_world(dir, world, &graph)?;
    let [rooms, doors, windows, _, extra, ..] = row.figures;
    let truth: Value = serde_json::from_str(&std::fs::read_to_string(dir.join("truth.json"))?)?;
    let matter: Vec<V3> = list(&truth["matter"]).iter().filter_map(vec3).collect();
    Ok(Measured {
        rooms,
        doors,
        windows,
        extra,
        portals: list(&graph["portals"]).len(),
        holes: list(&graph["suspected_holes"]).len() + n_missing(&said),
        cracks: cracks_in_one_plane(&graph),
        n_matter: matter.len(),
        in_matter: n_cells_of_matter(&graph, world, &matter, &truth)?,
        seconds,
        broken: if rays > 0 {
            broken(dir, world, rays)
        } else {
            Ok(0)
        },
        unsaid: unsaid(&graph, &said),
    })
}

/// Counts the points in indoor cells that are not rooms: a box taken for furniture stands in a room's air.
fn n_cells_of_matter(
    graph: &Value,
    world: &Path,
    matter: &[V3],
    truth: &Value,
) -> anyhow::Result<usize> {
    if matter.is_empty() {
        return Ok(0);
    }
    let points = list(&truth["rooms"])
        .iter()
        .flat_map(|r| list(&r["sample_points"]));
    let points: Vec<V3> = points.filter_map(vec3).collect();
    let rooms: BTreeSet<String> = locate(world, &points)?.into_iter().collect();
    let indoors = indoor_ids(graph);
    let cells = locate(world, matter)?;
    let is_wrong = |id: &&String| indoors.contains(*id) && !rooms.contains(*id);
    Ok(cells.iter().filter(is_wrong).count())
}

/// Counts the points in indoor cells.
pub(super) fn n_indoors(graph: &Value, world: &Path, points: &[V3]) -> anyhow::Result<usize> {
    if points.is_empty() {
        return Ok(0);
    }
    let indoors = indoor_ids(graph);
    let cells = locate(world, points)?;
    Ok(cells.iter().filter(|&id| indoors.contains(id)).count())
}

fn indoor_ids(graph: &Value) -> BTreeSet<String> {
    let indoors = list(&graph["cells"]).iter();
    let indoors = indoors.filter(|c| c["outdoor"] != true);
    indoors.map(|c| c["id"].to_string()).collect()
}

/// Returns the number of holes in surfaces that the bake reports.
fn n_missing(said: &str) -> usize {
    let rows = said.lines();
    let count = |row: &str| {
        let count = row.strip_prefix("holes in surfaces")?;
        count.split_whitespace().next()?.parse::<usize>().ok()
    };
    rows.filter_map(count).sum()
}

/// Counts the promises that `verify` finds broken; lines blocked by the source's triangles are not tried.
fn broken(dir: &Path, world: &Path, rays: u64) -> Result<u64, String> {
    let mut command = Command::new(binary("enfilade"));
    command.arg("verify").arg(world);
    add_scene_files(&mut command, dir, Some("--source"));
    command.args(["--rays", &rays.to_string(), "--json"]);
    let done = command.output().map_err(|e| e.to_string())?;
    // If promises are broken, it exits with 1 after its report.
    let report: Value = serde_json::from_slice(&done.stdout)
        .map_err(|_| String::from_utf8_lossy(&done.stderr).trim().to_owned())?;
    let count = |name: &str| {
        report[name]
            .as_u64()
            .ok_or(format!("verify gives no {name}"))
    };
    Ok(count("unsealed")? + count("incomplete")? + list(&report["problems"]).len() as u64)
}

/// Returns a portal's normal and center.
fn place(portal: &Value) -> Option<(V3, V3)> {
    let outline: Vec<V3> = list(&portal["outline"]).iter().filter_map(vec3).collect();
    Some((unit(vec3(&portal["normal"])?), center_and_area(&outline).0))
}

/// Cracks lie in one plane if their normals differ by less than 5 degrees and the center of each lies within this
/// distance of the other's plane: the least width of an intended opening. [Units: wu]
const ONE_PLANE: f64 = 0.01;

/// Returns the most crack portals between the same pair of cells in one plane.
fn cracks_in_one_plane(graph: &Value) -> usize {
    let cracks: Vec<(&Value, V3, V3)> = list(&graph["portals"])
        .iter()
        .filter(|p| p["kind"] == "crack")
        .filter_map(|p| place(p).map(|(normal, middle)| (&p["cells"], normal, middle)))
        .collect();
    let like = |a: &(&Value, V3, V3), b: &(&Value, V3, V3)| {
        let off = sub(b.2, a.2);
        a.0 == b.0
            && dot(a.1, b.1).abs() > 5.0_f64.to_radians().cos()
            && dot(off, a.1).abs().max(dot(off, b.1).abs()) < ONE_PLANE
    };
    let of = |a| cracks.iter().filter(|b| like(a, b)).count();
    cracks.iter().map(of).max().unwrap_or(0)
}

/// Conditions that a bake must report, and the words that do.
const NO_CELLS: [&str; 3] = ["no cell", "no room", "without a cell"];
const NO_DOORWAY: [&str; 2] = ["no doorway", "without doorway"];
const CRACKS: [&str; 2] = ["crack", "gap"];

/// Smaller cells are ducts and hollow walls, which need no doorway. [Units: wu]
const PERSON: [f64; 3] = [0.6, 1.8, 0.6];

/// Counts the conditions that hold but are not reported; `None` if none holds.
fn unsaid(graph: &Value, said: &str) -> Option<usize> {
    let (cells, portals) = (list(&graph["cells"]), list(&graph["portals"]));
    let is_doorway = |p: &&Value| p["kind"] == "open" || p["kind"] == "door";
    let has_doorway = |c: &Value| {
        let mut doorways = portals.iter().filter(is_doorway);
        doorways.any(|p| list(&p["cells"]).contains(&c["id"]))
    };
    let indoors: Vec<&Value> = cells.iter().filter(|c| c["outdoor"] != true).collect();
    let is_room = |c: &&Value| {
        let corner = |i: usize| vec3(&c["aabb"][i]).unwrap_or_default();
        let (low, high) = (corner(0), corner(1));
        (0..3).all(|k| high[k] - low[k] >= PERSON[k])
    };
    let rooms: Vec<&Value> = indoors.iter().copied().filter(is_room).collect();
    let n_cracks = portals.iter().filter(|p| p["kind"] == "crack").count();
    let to_say = [
        (indoors.is_empty(), &NO_CELLS[..]),
        (rooms.iter().any(|c| !has_doorway(c)), &NO_DOORWAY),
        (
            n_cracks > portals.iter().filter(is_doorway).count(),
            &CRACKS,
        ),
    ];
    let said = said.to_lowercase();
    let held = || to_say.iter().filter(|(holds, _)| *holds);
    let is_unsaid = |words: &[&str]| !words.iter().any(|w| said.contains(w));
    (held().count() > 0).then(|| held().filter(|(_, words)| is_unsaid(words)).count())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn portal(cells: [u32; 2], kind: &str, x: f64, z: f64) -> Value {
        let outline = [
            [x, 0.0, z],
            [x, 2.0, z],
            [x, 2.0, z + 1.0],
            [x, 0.0, z + 1.0],
        ];
        json!({"cells": cells, "kind": kind, "normal": [1.0, 0.0, 0.0], "outline": outline})
    }

    #[test]
    fn cracks_of_one_pair_in_one_plane_are_counted() {
        let portals = [
            portal([0, 1], "crack", 0.0, 0.0),
            portal([0, 1], "crack", 0.003, 4.0),
            portal([0, 1], "crack", 0.5, 4.0),
            portal([0, 2], "crack", 0.0, 0.0),
            portal([0, 1], "open", 0.0, 0.0),
        ];
        assert_eq!(cracks_in_one_plane(&json!({"portals": portals})), 2);
        assert_eq!(cracks_in_one_plane(&json!({"portals": []})), 0);
    }

    #[test]
    fn silence_about_nothing_is_no_silence() {
        let sized = |id: u32, outdoor: bool, height: f64| json!({"id": id, "outdoor": outdoor, "aabb": [[0.0, 0.0, 0.0], [4.0, height, 4.0]]});
        let cell = |id: u32, outdoor: bool| sized(id, outdoor, 2.6);
        let rooms = [cell(0, true), cell(1, false), cell(2, false)];
        let sound = json!({"cells": rooms, "portals": [portal([1, 2], "open", 0.0, 0.0)]});
        assert_eq!(unsaid(&sound, ""), None);
        let closed = json!({"cells": rooms, "portals": [portal([0, 1], "open", 0.0, 0.0)]});
        assert_eq!(unsaid(&closed, ""), Some(1));
        assert_eq!(unsaid(&closed, "1 room has No Doorway"), Some(0));
        let plenum = json!({"cells": [cell(0, true), sized(1, false, 0.8)], "portals": []});
        assert_eq!(unsaid(&plenum, ""), None);
        let empty = json!({"cells": [cell(0, true)], "portals": []});
        assert_eq!(unsaid(&empty, "cells"), Some(1));
        let crack = |x| portal([1, 2], "crack", x, 0.0);
        let door = || portal([1, 2], "open", 0.0, 0.0);
        let cracked = |portals: &[Value]| json!({"cells": rooms, "portals": portals});
        assert_eq!(unsaid(&cracked(&[door(), crack(1.0)]), ""), None);
        let many = cracked(&[door(), crack(1.0), crack(2.0)]);
        assert_eq!(unsaid(&many, ""), Some(1));
        assert_eq!(unsaid(&many, "2 gaps let light through"), Some(0));
    }
}
