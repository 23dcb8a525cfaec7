//! Rows `openings`: the area and the normal of each portal that matches an opening of the truth, beside what rays find there.

use std::path::Path;

use anyhow::Context;
use serde_json::Value;

use super::score::{Match, V3, dot, list, sub, unit, vec3};
use crate::measure::{self, files_of};

use super::hole::{Hole, HolePlace};
use super::levels::objects_of;
use super::worlds::{Form, RoomRows};

/// The largest difference of the areas, as a share of the hole's.
const AREA: f64 = 0.05;
/// The largest angle between the normals. [Units: deg]
const ANGLE: f64 = 3.0;
/// The least share of openings within both.
const SHARE: f64 = 0.98;

/// Worst openings that a building's row lists.
const LISTED: usize = 8;

/// How far a leaf in the structure's file may reach beyond its opening's sides. [Units: wu]
const FRAME: f64 = 0.1;
/// … and out of its wall. [Units: wu]
const SWING: f64 = 0.3;

/// Openings of which the portal has the area and the normal of the hole, the others, and those that rays cannot measure.
#[derive(Default)]
struct MeasuredOpenings {
    n: usize,
    /// The others: by how much each is off, and its description.
    off: Vec<(f64, String)>,
    unbounded: Vec<String>,
}

/// Prints a row for each building, and one for all.
pub(super) fn run(out: &mut RoomRows<'_>) -> anyhow::Result<()> {
    if !out.chosen.has_row("openings") {
        return Ok(());
    }
    let mut all = MeasuredOpenings::default();
    for dir in out.buildings() {
        let name = measure::name(&dir);
        let baked = out.state.building(&dir, Form::Clean);
        match (&baked.graph, &baked.score) {
            (Ok(graph), Some(score)) => {
                let measured =
                    MeasuredOpenings::of(&dir, graph, &score.matches).context(name.clone())?;
                measured.print(&name, out);
                all.n += measured.n;
                all.off.extend(measured.off);
                all.unbounded.extend(measured.unbounded);
            }
            (graph, _) => {
                let why = graph.as_ref().err().map_or("no score", |why| why);
                out.print("openings", &name, None, "a world", Some(false), why);
            }
        }
    }
    // Buildings list theirs.
    all.off.iter_mut().for_each(|o| o.1.clear());
    all.print("all", out);
    Ok(())
}

impl MeasuredOpenings {
    fn of(dir: &Path, graph: &Value, matches: &[Match]) -> anyhow::Result<Self> {
        let truth = std::fs::read_to_string(dir.join("truth.json"))?;
        let truth: Value = serde_json::from_str(&truth)?;
        let openings = list(&truth["openings"]);
        let is_usable = |o: &Value| o["usable"] != false && o["kind"] != "virtual";
        let places: Vec<Option<HolePlace>> = openings
            .iter()
            .map(|o| HolePlace::of(o).filter(|_| is_usable(o)))
            .collect();
        let structure = structure(dir, &places)?;
        let mut out = Self::default();
        for m in matches {
            let Some(place) = &places[m.opening] else {
                continue;
            };
            let others = places.iter().enumerate().filter(|(i, _)| *i != m.opening);
            let others: Vec<&HolePlace> = others.filter_map(|(_, p)| p.as_ref()).collect();
            let mut portals = list(&graph["portals"]).iter();
            let portal = portals.find(|p| p["id"] == m.portal);
            let portal = portal.context("a match without a portal")?;
            let told = format!("{} {}", m.kind, m.name);
            match Hole::of(place, &others, &structure).area() {
                Some(area) => out.add(place, portal, area, &told),
                None => out
                    .unbounded
                    .push(format!("{told} at {}", shown(place.center))),
            }
        }
        Ok(out)
    }

    fn add(&mut self, place: &HolePlace, portal: &Value, by_rays: f64, told: &str) {
        let area = portal["area"].as_f64().unwrap_or(0.0);
        let normal = vec3(&portal["normal"]).map_or([0.0; 3], unit);
        let angle = dot(normal, place.normal).abs().min(1.0).acos().to_degrees();
        let off = (area / by_rays - 1.0).abs();
        self.n += 1;
        if off > AREA || angle > ANGLE {
            let at = shown(place.center);
            let id = &portal["id"];
            let told = format!(
                "{told} at {at}: portal {id} {area:.2} m², rays {by_rays:.2} m², {angle:.1}°"
            );
            self.off.push((off.max(angle / ANGLE * AREA), told));
        }
    }

    fn print(&self, scene: &str, out: &mut RoomRows<'_>) {
        let mut off: Vec<&(f64, String)> = self.off.iter().collect();
        off.sort_by(|a, b| b.0.total_cmp(&a.0));
        let n_right = self.n - off.len();
        let mut note = format!("{n_right} of {}", self.n);
        if !self.unbounded.is_empty() {
            let names = self.unbounded.join(", ");
            note += &format!("; {} that rays do not bound: {names}", self.unbounded.len());
        }
        for (_, told) in off.iter().take(LISTED).filter(|o| !o.1.is_empty()) {
            note += &format!("; {told}");
        }
        if self.n > 0 {
            let value = n_right as f64 / self.n as f64;
            let ok = Some(value >= SHARE);
            out.print(
                "openings",
                scene,
                Some(value),
                &format!(">= {SHARE}"),
                ok,
                &note,
            );
        }
    }
}

fn shown(point: V3) -> String {
    point.map(|x| format!("{x:.2}")).join(" ")
}

/// Returns the triangles of a building without leaves and panes: those of the structure's file. Where that is the only one, objects
/// within an opening of the truth are left out.
fn structure(dir: &Path, places: &[Option<HolePlace>]) -> anyhow::Result<Vec<[V3; 3]>> {
    let (files, details) = files_of(dir);
    let scene = objects_of(files.first().context("a scene without a file")?)?;
    let mut all = Vec::new();
    for object in &scene.objects {
        let mesh = &scene.meshes[object.mesh as usize];
        let triangles = mesh.primitives.iter();
        let triangles = triangles.flat_map(|p| p.placed_triangles(object.transform));
        let triangles: Vec<[V3; 3]> = triangles.map(|t| t.map(|p| p.to_array())).collect();
        let is_within = |place: &HolePlace| {
            let mut points = triangles.iter().flatten();
            points.all(|&p| {
                let [x, y, z] = place.local(sub(p, place.center));
                x.abs() <= place.half[0] + FRAME
                    && y.abs() <= place.half[1] + FRAME
                    && z.abs() <= place.thickness / 2.0 + SWING
            })
        };
        let is_filler = details.is_empty() && places.iter().flatten().any(is_within);
        if !is_filler {
            all.extend(triangles);
        }
    }
    Ok(all)
}
