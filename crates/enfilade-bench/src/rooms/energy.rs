//! Energy models: what Honeybee says of ours, which rooms it takes for neighbors, and what is left when they are read again.

use std::collections::BTreeMap;
use std::process::Command;

use anyhow::Context;
use enfilade::bake::{BakeConfig, BakeContext, Silent, bake};
use enfilade::cpg::{CellId, World};
use enfilade::geom::DVec3;
use enfilade::import::{ImportOptions, import};
use enfilade_export::{Behind, SurfaceOptions, gbxml, hbjson, room_surfaces};
use enfilade_report::room_facts;
use serde_json::Value;

use super::score::{center_and_area, list, text, vec3};
use crate::process::{output_of, python};
use crate::rows::{Figure, RowPrinter, folder_of};

/// Largest difference of areas, as a share.
const ALIKE: f64 = 0.03;

/// Areas by the names of two rooms. [Units: m²]
type Areas = BTreeMap<[String; 2], f64>;

/// Prints, of a model on standard input, a line for each error that Honeybee finds, and the area of each face that has another room
/// behind it.
const HONEYBEE: &str = "
import json, sys
import honeybee_energy
from honeybee.model import Model
model = Model.from_dict(json.load(sys.stdin))
errors = model.check_all(raise_exception=False).splitlines()
names = {room.identifier: room.display_name for room in model.rooms}
pairs = []
for room in model.rooms:
    for face in room.faces:
        if face.boundary_condition.name == 'Surface':
            other = face.boundary_condition.boundary_condition_objects[-1]
            pairs.append([room.display_name, names[other], face.area])
print(json.dumps({'errors': errors, 'pairs': pairs}))
";

/// Returns what Honeybee says of a world's model.
fn said_by_honeybee(world: &World) -> anyhow::Result<Value> {
    let said = output_of(
        Command::new(python()).args(["-c", HONEYBEE]),
        Some(&hbjson(world).text),
    );
    let said = said.context("needs `pip install honeybee-energy`, in $ENFILADE_PYTHON")?;
    let last = said.lines().last().unwrap_or_default();
    serde_json::from_str(last).context("Honeybee's answer")
}

/// Counts the errors of `check_all`.
pub(super) fn errors(world: &World) -> anyhow::Result<Figure> {
    let said = said_by_honeybee(world)?;
    let errors = list(&said["errors"]);
    let first = errors.first().map_or_else(String::new, text);
    Ok(Figure::new(errors.len() as f64, 0.0, first))
}

/// Measures the share of the area between rooms, by their surfaces of second level, that Honeybee has not between the same two.
pub(super) fn adjacency(world: &World) -> anyhow::Result<Figure> {
    let mut exact = Areas::new();
    let graph = &world.graph;
    for room in room_surfaces(world, &SurfaceOptions::default()) {
        for surface in &room.surfaces {
            if let Behind::Cell(other) = surface.behind
                && other != room.cell
                && graph[room.cell].is_room()
                && graph[other].is_room()
            {
                let names = [room.cell, other].map(|c| graph[c].name.clone());
                *exact.entry(names).or_default() += surface.area;
            }
        }
    }
    let said = said_by_honeybee(world)?;
    let mut written = Areas::new();
    for pair in list(&said["pairs"]) {
        let names = [&pair[0], &pair[1]].map(text);
        *written.entry(names).or_default() += pair[2].as_f64().unwrap_or_default();
    }
    let whole: f64 = exact.values().sum();
    let lost = exact.iter().map(|(names, &area)| {
        let lost = area - written.get(names).copied().unwrap_or_default();
        (lost.max(0.0), names)
    });
    let lost: Vec<_> = lost.collect();
    let share = lost.iter().map(|l| l.0).sum::<f64>() / whole.max(f64::MIN_POSITIVE);
    let worst = lost.iter().max_by(|a, b| a.0.total_cmp(&b.0));
    let worst = worst.map_or(String::new(), |(area, [a, b])| {
        format!(", most between {a} and {b}: {area:.1}")
    });
    Ok(Figure::new(share, 0.02, format!("of {whole:.0} m²{worst}")))
}

/// Measures the share of the rooms that are not there again once the model is written as HBJSON, read and baked: a room with most of
/// its points to itself, and a floor area within 3 %.
pub(super) fn again(world: &World) -> anyhow::Result<Figure> {
    let path = std::env::temp_dir().join(format!("enfilade-{}.hbjson", std::process::id()));
    std::fs::write(&path, hbjson(world).text)?;
    let imported = import(std::slice::from_ref(&path), &[], &ImportOptions::default());
    std::fs::remove_file(&path)?;
    let scene = imported?.scene;
    let context = BakeContext::new(&Silent, None);
    let again = bake(&scene, &BakeConfig::default(), &context)?.world;
    let mut in_cell: BTreeMap<CellId, Vec<&str>> = BTreeMap::new();
    for room in &scene.rooms {
        let cells = room.points.iter().map(|&p| again.graph.locator.locate(p));
        let mut counts: BTreeMap<CellId, usize> = BTreeMap::new();
        cells
            .flatten()
            .for_each(|c| *counts.entry(c).or_default() += 1);
        if let Some((&cell, &most)) = counts.iter().max_by_key(|c| c.1)
            && 2 * most > room.points.len()
            && again.graph[cell].is_room()
        {
            in_cell.entry(cell).or_default().push(&room.name);
        }
    }
    let again_facts = room_facts(&again);
    let found = again_facts.iter().filter_map(|facts| {
        let names = in_cell.get(&facts.cell)?;
        (names.len() == 1).then(|| (names[0], facts.floor_area))
    });
    let found: BTreeMap<&str, f64> = found.collect();
    let mut off = Vec::new();
    let mut n = 0;
    for facts in room_facts(world).iter() {
        let room = &world.graph[facts.cell];
        if !room.is_room() {
            continue;
        }
        n += 1;
        match found.get(&*room.name) {
            None => off.push(format!("{} is gone", room.name)),
            Some(area) => {
                let share = area / facts.floor_area - 1.0;
                if share.abs() > ALIKE {
                    off.push(format!("{} {:+.1} %", room.name, 100.0 * share));
                }
            }
        }
    }
    let share = off.len() as f64 / f64::from(n.max(1));
    let note = format!("of {n} rooms: {}", off.join(", "));
    Ok(Figure::new(share, 0.08, note))
}

/// Writes gbXML from the sheets and the truth of a scene, and tells what is in a file, with Python's own parser.
const SOURCE: &str = include_str!("../../peers/gbxml_source.py");
/// Farthest middle of an opening from that of the source. [Units: m]
const NEAR: f64 = 0.3;

/// Prints how much of an energy model is left when it is read as gbXML, baked with its surfaces of air as portals, and written as
/// gbXML: the shares of its spaces, usable doors and windows, and areas that are not there.
///
/// A space is there if one of the same name is, alone in it; its area, if that is within 3 %; an opening, if one is near its middle,
/// in a surface between the same spaces.
pub(super) fn round_trip(out: &mut RowPrinter<'_>, scene: &str) -> anyhow::Result<()> {
    let names = ["gbxml: spaces", "gbxml: openings", "gbxml: areas"];
    if !names.iter().any(|name| out.chosen.has_row(name)) || !out.chosen.has_scene(scene) {
        return Ok(());
    }
    let Some(folder) = folder_of(scene) else {
        names.iter().for_each(|name| out.missing(name, scene));
        return Ok(());
    };
    let run =
        |args: &[&str]| output_of(Command::new(python()).args(["-c", SOURCE]).args(args), None);
    let file = std::env::temp_dir().join(format!("enfilade-{}.gbxml", std::process::id()));
    let path = file.display().to_string();
    run(&["write", &folder.display().to_string(), &path])?;
    let scene_read = import(std::slice::from_ref(&file), &[], &ImportOptions::default())?.scene;
    let context = BakeContext::new(&Silent, None);
    let config = BakeConfig {
        keeps_given: true,
        ..BakeConfig::default()
    };
    let world = bake(&scene_read, &config, &context)?.world;
    std::fs::write(&file, gbxml(&world))?;
    let said: Value = serde_json::from_str(&run(&["read", &path])?)?;
    std::fs::remove_file(&file)?;

    let truth: Value = serde_json::from_slice(&std::fs::read(folder.join("truth.json"))?)?;
    let found: BTreeMap<String, f64> = (list(&said["spaces"]).iter())
        .map(|s| (text(&s["name"]), s["area"].as_f64().unwrap_or(f64::NAN)))
        .collect();
    let (mut gone, mut off) = (Vec::new(), Vec::new());
    let mut of_id = BTreeMap::from([("outside".to_owned(), None)]);
    for room in list(&truth["rooms"]) {
        let name = text(&room["name"]);
        match found.get(&name) {
            None => gone.push(name.clone()),
            Some(area) => {
                let share = area / room["floor_area"].as_f64().unwrap_or(f64::NAN) - 1.0;
                if share.is_nan() || share.abs() > ALIKE {
                    off.push(format!("{name} {:+.1} %", 100.0 * share));
                }
            }
        }
        of_id.insert(text(&room["id"]), Some(name));
    }
    let there: Vec<(Vec<String>, DVec3)> = (list(&said["openings"]).iter())
        .map(|o| {
            (
                list(&o["spaces"]).iter().map(text).collect(),
                middle(&o["points"]),
            )
        })
        .collect();
    let (mut n, mut missed) = (0, Vec::new());
    for opening in list(&truth["openings"]) {
        if opening["usable"] == false
            || !["door", "window"].contains(&text(&opening["kind"]).as_str())
        {
            continue;
        }
        n += 1;
        let sides = list(&opening["rooms"]).iter();
        let mut sides: Vec<String> = sides
            .filter_map(|id| of_id.get(&text(id)).cloned()?)
            .collect();
        sides.sort();
        let at = middle(&opening["corners"]);
        if !there
            .iter()
            .any(|(names, p)| *names == sides && p.distance(at) <= NEAR)
        {
            missed.push(text(&opening["name"]));
        }
    }
    let n_rooms = of_id.len() - 1;
    for (name, list, n, most) in [
        (names[0], &gone, n_rooms, 0.08),
        (names[1], &missed, n, 0.05),
        (names[2], &off, n_rooms - gone.len(), 0.0),
    ] {
        let share = list.len() as f64 / n.max(1) as f64;
        out.at_most(
            name,
            scene,
            share,
            most,
            &format!("of {n}: {}", list.join(", ")),
        );
    }
    Ok(())
}

/// Returns the center of the polygon with these vertices.
fn middle(points: &Value) -> DVec3 {
    let points: Vec<_> = list(points).iter().filter_map(vec3).collect();
    DVec3::from(center_and_area(&points).0)
}
