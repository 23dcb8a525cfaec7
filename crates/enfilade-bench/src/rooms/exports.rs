//! Rooms for other trades: how their surfaces close, what lies behind them, and how large they are beside the architects' spaces.

use std::collections::BTreeMap;

use anyhow::Context;
use enfilade::cpg::{CellId, World};
use enfilade::geom::DVec3;
use enfilade_export::{
    Behind, BoundarySurface, FloorMap, FloorMapOptions, SurfaceLevel, SurfaceOptions, room_surfaces,
};
use enfilade_report::{find_storeys, portals_csv, room_facts};
use serde_json::Value;

use super::score::{list, text, vec3};
use crate::rows::{Figure, folder_of};

/// Largest difference of areas and of volumes, as a share.
const ALIKE: f64 = 0.03;
/// Distance of the points on a surface behind which the neighbor is looked for. [Units: wu]
const STEP: f64 = 0.2;
/// Steps of the march to the neighbor. [Units: wu]
const MARCH: f64 = 1e-3;
/// Pixels of a map that are compared.
const N_PIXELS: usize = 10_000;

/// Counts rooms, at both levels, whose surfaces do not close: an edge without an opposite, a sum of area vectors above 1e-3 m², or a
/// volume off by more than 0.5 %.
pub(super) fn open(world: &World) -> anyhow::Result<Figure> {
    let (mut told, mut n_rooms) = (Vec::new(), 0);
    for level in [SurfaceLevel::First, SurfaceLevel::Second] {
        let options = SurfaceOptions {
            level,
            ..SurfaceOptions::default()
        };
        for room in room_surfaces(world, &options) {
            let off = room.volume / f64::from(world.graph[room.cell].volume) - 1.0;
            let is_closed = room.n_open_edges == 0 && room.gap <= 1e-3 && off.abs() <= 0.005;
            if !is_closed {
                let (open, gap) = (room.n_open_edges, room.gap);
                told.push(format!(
                    "cell {} at {level:?}: {open} edges, {gap:.4} m², volume off by {:.2} %",
                    room.cell.0,
                    100.0 * off
                ));
            }
            n_rooms += 1;
        }
    }
    let note = format!(
        "of {n_rooms} rooms and voids at two levels; {}",
        told.join("; ")
    );
    Ok(Figure::new(told.len() as f64, 0.0, note))
}

/// Measures the share of the surfaces behind which a march through the construction, by millimeters, finds something else.
pub(super) fn neighbors(world: &World) -> anyhow::Result<Figure> {
    let (mut n_wrong, mut n) = (0, 0);
    for room in room_surfaces(world, &SurfaceOptions::default()) {
        for surface in &room.surfaces {
            for p in points_on(surface) {
                n += 1;
                let found = marched(world, p, DVec3::from(surface.normal));
                let is_right = match surface.behind {
                    Behind::Cell(cell) => found == Some(cell),
                    Behind::Ground => found.is_none_or(|c| world.graph[c].outdoor),
                    Behind::Matter => found.is_none(),
                };
                n_wrong += usize::from(!is_right);
            }
        }
    }
    let share = n_wrong as f64 / (n as f64).max(1.0);
    Ok(Figure::new(share, 0.03, format!("{n_wrong} of {n} points")))
}

/// Returns points of a surface, on a grid in its plane, so that their number goes with the area.
fn points_on(surface: &BoundarySurface) -> Vec<DVec3> {
    let normal = DVec3::from(surface.normal);
    let (u, v) = normal.any_orthonormal_pair();
    let origin = DVec3::from(surface.loops[0][0]);
    let flat = |p: &[f64; 3]| {
        let d = DVec3::from(*p) - origin;
        [d.dot(u), d.dot(v)]
    };
    let rings: Vec<Vec<[f64; 2]>> = surface
        .loops
        .iter()
        .map(|ring| ring.iter().map(flat).collect())
        .collect();
    let ends = |k: usize| {
        let all = rings[0].iter().map(|p| p[k]);
        all.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)))
    };
    let (x, y) = (ends(0), ends(1));
    let mut found = Vec::new();
    for i in (x.0 / STEP).floor() as i64..=(x.1 / STEP).ceil() as i64 {
        for k in (y.0 / STEP).floor() as i64..=(y.1 / STEP).ceil() as i64 {
            // Off the edges of builders' grids.
            let at = [(i as f64 + 0.37) * STEP, (k as f64 + 0.41) * STEP];
            if rings.iter().filter(|ring| is_inside(ring, at)).count() % 2 == 1 {
                found.push(origin + u * at[0] + v * at[1]);
            }
        }
    }
    found
}

fn is_inside(ring: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let mut is_in = false;
    for (i, a) in ring.iter().enumerate() {
        let b = ring[(i + 1) % ring.len()];
        if (a[1] > y) != (b[1] > y) && x < a[0] + (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]) {
            is_in = !is_in;
        }
    }
    is_in
}

/// Steps along the normal until there is air again. Surfaces lie within two millimeters of the tree's.
fn marched(world: &World, from: DVec3, normal: DVec3) -> Option<CellId> {
    let steps = (4..=1500).map(|k| from + normal * (MARCH * f64::from(k)));
    steps.filter_map(|p| world.graph.locator.locate(p)).next()
}

/// Measures the share of the rooms found whose floor area or volume, without the recesses of openings, is off by more than 3 %. A room
/// is found if most of its points are in a cell that has none of another room.
pub(super) fn spaces(world: &World, scene: &str) -> anyhow::Result<Figure> {
    let truth = truth_of(scene)?;
    let options = SurfaceOptions {
        level: SurfaceLevel::First,
        by_object: false,
        fills_recesses: true,
        tolerance: 5e-4,
        ..SurfaceOptions::default()
    };
    let bodies = room_surfaces(world, &options);
    let facts = room_facts(world);
    let mut by_cell: BTreeMap<CellId, Vec<&Value>> = BTreeMap::new();
    for room in list(&truth["rooms"]) {
        if let Some(cell) = cell_of(world, room) {
            by_cell.entry(cell).or_default().push(room);
        }
    }
    let (mut n, mut off) = (0, Vec::new());
    for (cell, rooms) in by_cell {
        let (&[room], Some(body)) = (rooms.as_slice(), bodies.iter().find(|b| b.cell == cell))
        else {
            continue;
        };
        let facts = facts.iter().find(|f| f.cell == cell);
        let area = facts.map_or(f64::NAN, |f| f.floor_area);
        let share = |found: f64, name: &str| found / room[name].as_f64().unwrap_or(f64::NAN) - 1.0;
        let (area, volume) = (share(area, "floor_area"), share(body.volume, "volume"));
        n += 1;
        if !(area.abs() <= ALIKE && volume.abs() <= ALIKE) {
            let (name, area, volume) = (text(&room["name"]), 100.0 * area, 100.0 * volume);
            off.push(format!("{name} {area:.1} {volume:.1}"));
        }
    }
    let share = off.len() as f64 / f64::from(n.max(1));
    let note = format!("of {n} rooms; off by % of area, volume: {}", off.join(", "));
    Ok(Figure::new(share, 0.05, note))
}

fn truth_of(scene: &str) -> anyhow::Result<Value> {
    let path = folder_of(scene)
        .context("no such scene")?
        .join("truth.json");
    let text = std::fs::read_to_string(&path)?;
    serde_json::from_str(&text).with_context(|| path.display().to_string())
}

/// Returns the cell that has most of a room's points.
fn cell_of(world: &World, room: &Value) -> Option<CellId> {
    let points: Vec<_> = list(&room["sample_points"])
        .iter()
        .filter_map(vec3)
        .collect();
    let mut counts: BTreeMap<CellId, usize> = BTreeMap::new();
    for p in &points {
        if let Some(cell) = world.graph.locator.locate(DVec3::from(*p)) {
            *counts.entry(cell).or_default() += 1;
        }
    }
    let (cell, most) = counts.into_iter().max_by_key(|c| c.1)?;
    (2 * most > points.len()).then_some(cell)
}

/// Measures the share of the usable doors of an IFC model, by GlobalId, whose line in the table of openings is not there or does not
/// have the architects' two rooms.
pub(super) fn doors(world: &World, scene: &str) -> anyhow::Result<Figure> {
    let truth = truth_of(scene)?;
    let rooms: BTreeMap<String, Option<CellId>> = (list(&truth["rooms"]).iter())
        .map(|room| (text(&room["id"]), cell_of(world, room)))
        .collect();
    let table = portals_csv(world);
    let rows: Vec<Vec<&str>> = table.lines().map(|l| l.split(',').collect()).collect();
    let (mut n, mut off) = (0, Vec::new());
    for door in list(&truth["openings"]) {
        if text(&door["kind"]) != "door" || door["usable"] == false {
            continue;
        }
        n += 1;
        let id = text(&door["id"]);
        let is_right = |row: &Vec<&str>| {
            let cells = [row[2], row[3]].map(|c| c.parse().ok().map(CellId));
            let sides = list(&door["rooms"]).iter().map(text);
            let mut sides = sides.map(|side| {
                let is_side = |cell: &Option<CellId>| match side.as_str() {
                    "outside" => cell.is_some_and(|c| !world.graph[c].is_indoors()),
                    side => cell.is_some() && rooms.get(side) == Some(cell),
                };
                [0, 1].map(|k| is_side(&cells[k]))
            });
            let (a, b) = (sides.next(), sides.next());
            let (Some(a), Some(b)) = (a, b) else {
                return false;
            };
            (a[0] && b[1]) || (a[1] && b[0])
        };
        let mut own = rows
            .iter()
            .filter(|r| r.last().is_some_and(|o| o.ends_with(&id)));
        if !own.any(is_right) {
            off.push(text(&door["name"]));
        }
    }
    let share = off.len() as f64 / f64::from(n.max(1));
    let note = format!("of {n} doors: {}", off.join(", "));
    Ok(Figure::new(share, 0.02, note))
}

/// Counts the pixels of maps of all storeys, 10,000 of each, whose label in the picture is not the cell that `locate` finds at
/// the place that the file beside the picture gives them.
pub(super) fn labels(world: &World) -> anyhow::Result<Figure> {
    let (mut n_wrong, mut n) = (0_u32, 0);
    for storey in find_storeys(world).iter().filter(|s| !s.is_between) {
        let options = FloorMapOptions {
            floor: storey.floor,
            ..FloorMapOptions::default()
        };
        let map = FloorMap::new(world, &options)?;
        let (picture, [resolution, west, south]) = (map.labels_pgm(), placed(&map.yaml("x.pgm"))?);
        let size = picture.len() - 2 * map.width * map.height;
        for k in 0..N_PIXELS {
            let i = k * map.labels.len() / N_PIXELS;
            let (column, row) = (i % map.width, i / map.width);
            let x = west + (column as f64 + 0.5) * resolution;
            let north = south + ((map.height - row) as f64 - 0.5) * resolution;
            let cell = world.graph.locator.locate(DVec3::new(x, map.level, -north));
            let cell = cell.filter(|&c| world.graph[c].is_place());
            let label = [picture[size + 2 * i], picture[size + 2 * i + 1]];
            n += 1;
            n_wrong +=
                u32::from(u32::from(u16::from_be_bytes(label)) != cell.map_or(0, |c| c.0 + 1));
        }
    }
    Ok(Figure::new(
        f64::from(n_wrong),
        0.0,
        format!("of {n} pixels"),
    ))
}

/// Returns resolution, west and south of the file beside a map.
fn placed(yaml: &str) -> anyhow::Result<[f64; 3]> {
    let value = |name: &str| yaml.lines().find_map(|l| l.strip_prefix(name));
    let [resolution, origin] = ["resolution: ", "origin: ["].map(value);
    let [resolution, origin] = [resolution, origin].map(|v| v.context("a map without its place"));
    let mut origin = origin?.split(", ").map(str::parse);
    let mut next = || origin.next().context("a map without an origin");
    Ok([resolution?.parse()?, next()??, next()??])
}
