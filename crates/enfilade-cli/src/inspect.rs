//! `enfilade inspect`: prints the contents of a world.

mod doors;
mod objects;
mod specials;
mod why;

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::PathBuf;

use anyhow::Context;
use doors::FittingReport;
use enfilade::bake::simplify::CostModel;
use enfilade::cpg::{Cell, CellPortalGraph, PortalKind, RoomFacts, World};
use enfilade::internals::bake::simplify::portal_scores;
use enfilade::internals::cpg::Seals;
pub(crate) use objects::cell_of;
use serde::Serialize;
use specials::SpecialReport;

use crate::limits::Limits;
use crate::screen::{At, Rounded, print_json, printed_at_once};
use enfilade_cli::world::read_world;
use enfilade_report::{cells_in_words, room_facts};

/// Shows the cells, portals and statistics of a world.
#[derive(clap::Args)]
pub(crate) struct Inspect {
    /// World written by `enfilade bake`; `-` for standard input.
    world: PathBuf,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
    /// Print the scores of portals, too, by which `enfilade simplify` removes them, and all counts of the builder.
    #[arg(long)]
    all: bool,
    #[command(flatten)]
    limits: Limits,
    /// Instead, list the objects that this cell sees, given by name or id, with their triangles.
    #[arg(long, value_name = "CELL")]
    objects: Option<String>,
    /// Instead, tell why this cell and its portals are there, or this portal (portal-5), or `all`: the decision of the bake, its reason, how close
    /// it was, and the facts behind it. `all` begins with what is most in doubt.
    #[arg(long, value_name = "CELL|portal-N|all", conflicts_with = "objects")]
    why: Option<String>,
}

pub(crate) fn run(args: &Inspect) -> anyhow::Result<()> {
    args.limits.begin()?;
    let world = read_world(&args.world)?;
    let mut out = printed_at_once();
    if let Some(cell) = &args.objects {
        objects::write(&mut out, &world, cell, args.json)?;
    } else if let Some(what) = &args.why {
        why::write(&mut out, &world.graph, what, args.json)?;
    } else if args.json {
        print_json(&mut out, &report(&world))?;
    } else {
        write_tables(&mut out, &world, args.all)?;
    }
    out.flush().context("cannot write to standard output")
}

#[derive(Serialize)]
struct Inspection<'a> {
    cells: Vec<CellReport<'a>>,
    portals: Vec<PortalReport<'a>>,
    /// Absent if there are none, as in worlds of version 1.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    specials: Vec<SpecialReport<'a>>,
    suspected_holes: Vec<HoleReport>,
    seals: SealReport,
    stats: Stats<'a>,
}

#[derive(Serialize)]
struct CellReport<'a> {
    id: usize,
    name: &'a str,
    aabb: [[f32; 3]; 2],
    volume: f32,
    triangles: u32,
    detail_triangles: u32,
    portals: Vec<u32>,
    outdoor: bool,
    /// `room`, `outdoors` or `void`.
    kind: &'static str,
    /// Absent for all but rooms.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    room: Option<RoomReport>,
}

#[derive(Serialize)]
struct RoomReport {
    storeys: Vec<String>,
    floor_area: f64,
    area_above_1_5: f64,
    area_above_2_3: f64,
    height: f64,
    doors: usize,
    windows: usize,
}

impl RoomReport {
    fn of(room: &RoomFacts) -> Self {
        let rounded = |n: f64| (1000.0 * n).round() / 1000.0;
        Self {
            storeys: room.storeys.clone(),
            floor_area: rounded(room.floor_area),
            area_above_1_5: rounded(room.area_above_1_5),
            area_above_2_3: rounded(room.area_above_2_3),
            height: rounded(room.height),
            doors: room.n_doors,
            windows: room.n_windows,
        }
    }
}

#[derive(Serialize)]
struct PortalReport<'a> {
    id: usize,
    cells: [u32; 2],
    kind: &'static str,
    area: f32,
    width: f32,
    height: f32,
    pieces: usize,
    visible_volume: f64,
    balance: f64,
    score: f64,
    normal: [f32; 3],
    outline: &'a [[f32; 3]],
    fittings: Vec<FittingReport>,
}

/// An opening to the outdoors that may be a hole of the model.
#[derive(Serialize)]
struct HoleReport {
    portal: u32,
    position: [f32; 3],
    reason: String,
}

/// Polygons that close gaps of the model.
#[derive(Serialize)]
struct SealReport {
    count: usize,
    area: f64,
    largest_area: f64,
    largest_position: [f64; 3],
}

/// Times and memory peaks differ from run to run and are not in the file, which is the same every time.
#[derive(Serialize)]
struct Stats<'a> {
    input_triangles: u64,
    seconds: BTreeMap<String, f64>,
    peak_bytes: u64,
    generator: &'a str,
    method: &'a str,
    input_hash: &'a str,
    settings: &'a BTreeMap<String, String>,
    counts: &'a BTreeMap<String, f64>,
}

fn report(world: &World) -> Inspection<'_> {
    let graph = &world.graph;
    let mut rooms: BTreeMap<usize, RoomReport> = room_facts(world)
        .iter()
        .map(|room| (room.cell.0 as usize, RoomReport::of(room)))
        .collect();
    let cells = graph.cells.iter().enumerate().map(|(id, c)| CellReport {
        id,
        name: &c.name,
        aabb: c.aabb,
        volume: c.volume,
        triangles: c.n_triangles,
        detail_triangles: c.n_detail_triangles,
        portals: c.portals.iter().map(|p| p.0).collect(),
        outdoor: c.outdoor,
        kind: cell_kind(c),
        room: rooms.remove(&id),
    });
    let scores = portal_scores(world, &CostModel::default());
    let portals = graph
        .portals
        .iter()
        .zip(&scores)
        .enumerate()
        .map(|(id, (p, s))| {
            let [width, height] = p.size();
            PortalReport {
                id,
                cells: p.cells.map(|c| c.0),
                kind: kind_name(p.kind),
                area: p.area,
                width,
                height,
                pieces: p.pieces.len(),
                visible_volume: s.visible_volume,
                balance: s.balance,
                score: s.score(),
                normal: p.normal,
                outline: &p.outline,
                fittings: p.fittings.iter().map(FittingReport::of).collect(),
            }
        });
    let holes = graph.suspected_holes().into_iter().map(|h| HoleReport {
        portal: h.portal.0,
        position: h.position,
        reason: h.reason.to_string(),
    });
    let seals = Seals::of(world);
    Inspection {
        cells: cells.collect(),
        portals: portals.collect(),
        specials: (graph.special_ids())
            .map(|id| SpecialReport::of(graph, id))
            .collect(),
        suspected_holes: holes.collect(),
        seals: SealReport {
            count: seals.count,
            area: seals.area,
            largest_area: seals.largest.0,
            largest_position: seals.largest.1,
        },
        stats: Stats {
            input_triangles: input_triangles(world),
            seconds: BTreeMap::new(),
            peak_bytes: 0,
            generator: &graph.provenance.generator,
            method: &graph.provenance.method,
            input_hash: &graph.provenance.input_hash,
            settings: &graph.provenance.settings,
            counts: &graph.statistics.counts,
        },
    }
}

fn input_triangles(world: &World) -> u64 {
    world
        .graph
        .statistics
        .counts
        .get("input_triangles")
        .map_or(0, |&n| n as u64)
}

fn cell_kind(cell: &Cell) -> &'static str {
    match cell {
        _ if cell.outdoor => "outdoors",
        _ if cell.is_void => "void",
        _ if cell.is_land => "land",
        _ => "room",
    }
}

pub(crate) fn kind_name(kind: PortalKind) -> &'static str {
    match kind {
        PortalKind::Open => "open",
        PortalKind::Door => "door",
        PortalKind::Window => "window",
        PortalKind::Crack => "crack",
    }
}

fn write_tables(out: &mut impl Write, world: &World, all: bool) -> io::Result<()> {
    write_cells(out, world)?;
    writeln!(out)?;
    write_portals(out, world, all)?;
    writeln!(out)?;
    specials::write(out, &world.graph)?;
    if write_holes(out, &world.graph, usize::MAX)? {
        writeln!(out)?;
    }
    write_seals(out, world)?;
    write_totals(out, world, all)
}

/// The cells, the largest first.
fn write_cells(out: &mut impl Write, world: &World) -> io::Result<()> {
    let graph = &world.graph;
    let rooms = room_facts(world);
    let mut by_volume: Vec<(usize, &Cell)> = graph.cells.iter().enumerate().collect();
    // Ids break ties, so that the table is reproducible.
    by_volume.sort_by(|a, b| b.1.volume.total_cmp(&a.1.volume).then(a.0.cmp(&b.0)));
    writeln!(
        out,
        "{:>6}  {:<16} {:<8} {:>7} {:>9} {:>9} {:>11} {:>8} {:>10} {:>10}",
        "cell",
        "name",
        "kind",
        "storey",
        "floor m²",
        "height m",
        "volume m³",
        "portals",
        "triangles",
        "detail"
    )?;
    for (id, c) in by_volume {
        let at = rooms.binary_search_by_key(&id, |room| room.cell.0 as usize);
        let room = at.ok().map(|at| &rooms[at]);
        let [storey, floor, height] = room.map_or(Default::default(), |room| {
            let lengths = [room.floor_area, room.height].map(|n| format!("{n:.2}"));
            let [floor, height] = lengths;
            [room.storeys.join(" "), floor, height]
        });
        writeln!(
            out,
            "{id:>6}  {:<16} {:<8} {storey:>7} {floor:>9} {height:>9} {:>11.2} {:>8} {:>10} {:>10}",
            c.name,
            cell_kind(c),
            c.volume,
            c.portals.len(),
            c.n_triangles,
            c.n_detail_triangles,
        )?;
    }
    writeln!(
        out,
        "floor: as seen from above, without the recesses of doors and windows; height: over most of it; triangles: of walls, seen without passing a portal; detail: of furniture and other objects in it"
    )?;
    let is_void = graph.cells.iter().any(|c| c.is_void);
    if is_void {
        writeln!(
            out,
            "void: a space in which nobody can stand, such as a shaft or a hollow wall"
        )?;
    }
    Ok(())
}

/// The portals, by id.
fn write_portals(out: &mut impl Write, world: &World, with_scores: bool) -> io::Result<()> {
    let graph = &world.graph;
    let scores = match with_scores {
        true => portal_scores(world, &CostModel::default()),
        false => Vec::new(),
    };
    let titles = match with_scores {
        true => format!(" {:>10} {:>8} {:>10}", "seen m³", "balance", "score"),
        false => String::new(),
    };
    writeln!(
        out,
        "{:>12}  {:<8} {:>21} {:>9} {:>9} {:>10} {:>7}{titles}  middle in m",
        "portal", "kind", "cells", "width m", "height m", "area m²", "pieces",
    )?;
    for id in graph.portal_ids() {
        let p = &graph[id];
        let [width, height] = p.size();
        let at = At::of(p.center());
        let [one, other] = p.cells.map(|c| &graph[c].name);
        let cells = format!("{one} – {other}");
        let scored = scores.get(id.idx()).map_or_else(String::new, |s| {
            let (seen, balance) = (s.visible_volume, s.balance);
            format!(" {seen:>10.1} {balance:>8.0} {:>10.0}", s.score())
        });
        // A string, so that it is padded to the column.
        let id = id.to_string();
        writeln!(
            out,
            "{id:>12}  {:<8} {cells:>21} {width:>9.2} {height:>9.2} {:>10.3} {:>7}{scored}  {at}",
            kind_name(p.kind),
            p.area,
            p.pieces.len(),
        )?;
    }
    if graph.portals.iter().any(|p| p.pieces.len() > 1) {
        writeln!(
            out,
            "pieces: parts of the opening, as between the bars of a frame"
        )?;
    }
    if with_scores {
        writeln!(
            out,
            "seen m³: air from which the portal is seen; balance: difference between the costs of its cells; score: their \
             product, and the highest is removed first by `simplify`"
        )?;
    }
    Ok(())
}

/// Lists openings to the outdoors that may be holes of the model, if any.
pub(crate) fn write_holes(
    out: &mut impl Write,
    graph: &CellPortalGraph,
    most: usize,
) -> io::Result<bool> {
    let holes = graph.suspected_holes();
    if holes.is_empty() {
        return Ok(false);
    }
    writeln!(
        out,
        "{} openings to outdoors may be holes of the model, largest first:",
        holes.len()
    )?;
    for h in holes.iter().take(most) {
        let p = &graph[h.portal];
        let (at, [width, height]) = (At::of(h.position), p.size());
        let cell = p
            .cells
            .iter()
            .find(|&&c| !graph[c].outdoor)
            .map_or("-", |&c| &graph[c].name);
        writeln!(
            out,
            "  at {at}: {width:.2} × {height:.2} m, {} of {cell}, {}",
            h.portal, h.reason
        )?;
    }
    if holes.len() > most {
        writeln!(
            out,
            "  and {} more; `enfilade inspect` lists all",
            holes.len() - most
        )?;
    }
    Ok(true)
}

/// Lists the gaps of the model that were closed, if any.
pub(crate) fn write_seals(out: &mut impl Write, world: &World) -> io::Result<()> {
    let seals = Seals::of(world);
    if seals.count == 0 {
        return Ok(());
    }
    let (area, at) = (seals.largest.0, At(seals.largest.1));
    writeln!(
        out,
        "{} gaps in the model were closed by seals (polygons across gaps narrower than --smallest-hole), {:.3} m² in all; \
         the largest at {at}: {area:.3} m²",
        seals.count, seals.area
    )
}

/// Counts of builders whose names need words.
const COUNTS: [(&str, &str); 6] = [
    ("basins", "parts of the air as the flood divided it"),
    ("leaks", "gaps of the model that became portals"),
    ("leaves", "convex pieces of space that the walls part"),
    ("occupied_voxels", "those that walls meet"),
    ("screens", "openings that were proposed as portals"),
    ("seals", "polygons that close gaps"),
];

fn write_totals(out: &mut impl Write, world: &World, all: bool) -> io::Result<()> {
    let graph = &world.graph;
    let mut row = |name: &str, value: String| writeln!(out, "{name:<22} {value}");
    row("cells", cells_in_words(graph))?;
    let mut kinds = BTreeMap::new();
    for p in &graph.portals {
        *kinds.entry(p.kind).or_insert(0_usize) += 1;
    }
    let kinds: Vec<String> = kinds
        .iter()
        .map(|(k, n)| format!("{n} {}", kind_name(*k)))
        .collect();
    let kinds = if kinds.is_empty() {
        String::new()
    } else {
        format!(" ({})", kinds.join(", "))
    };
    row("portals", format!("{}{kinds}", graph.portals.len()))?;
    if !graph.specials.is_empty() {
        row("special portals", graph.specials.len().to_string())?;
    }
    if let Some(doors) = doors::summary(world) {
        row("doors", doors)?;
    }
    let most = graph
        .cells
        .iter()
        .map(|c| c.portals.len())
        .max()
        .unwrap_or(0);
    let n_cells = graph.cells.len().max(1) as f64;
    let mean = |n: u64| format!("{:.1}", n as f64 / n_cells);
    let ends = graph.portals.len() as u64 * 2;
    row(
        "portals a cell",
        format!("{} on average, {most} at most", mean(ends)),
    )?;
    let stored: u64 = world
        .batches
        .iter()
        .map(|b| b.primitive.indices.len() as u64 / 3)
        .sum();
    let seen: u64 = graph.cells.iter().map(|c| u64::from(c.n_triangles)).sum();
    row("input triangles", input_triangles(world).to_string())?;
    row(
        "stored triangles",
        format!("{stored}, {} a cell on average", mean(seen)),
    )?;
    row("detail objects", world.details.len().to_string())?;
    let locator = &graph.locator;
    row(
        "locator",
        format!(
            "{} nodes, {} planes",
            locator.nodes.len(),
            locator.planes.len()
        ),
    )?;
    row(
        "made by",
        format!(
            "{} ({})",
            graph.provenance.generator, graph.provenance.method
        ),
    )?;
    row("input hash", graph.provenance.input_hash.clone())?;
    if !all {
        return Ok(());
    }
    for (name, value) in &graph.statistics.counts {
        if name != "input_triangles" {
            row(&name.replace('_', " "), Rounded(*value).to_string())?;
        }
    }
    let known = |name: &&(&str, &str)| graph.statistics.counts.contains_key(name.0);
    let words: Vec<String> = COUNTS
        .iter()
        .filter(known)
        .map(|(name, words)| format!("{}: {words}", name.replace('_', " ")))
        .collect();
    if !words.is_empty() {
        writeln!(out, "{}", words.join("; "))?;
    }
    Ok(())
}
