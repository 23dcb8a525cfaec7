//! `enfilade see`: prints what one view sees.

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context;
use clap::ValueEnum;
use enfilade::cpg::World;
use enfilade::runtime::{Narrowing, SeeOptions, Seen, Sight, SightState, View, Viewer};
use serde_json::json;

use crate::limits::Limits;
use crate::screen::{self, printed_at_once};
use enfilade_cli::values::{point, size};
use enfilade_cli::world::read_world;

/// Prints the cells, portals and triangles that a view sees, near to far, and the time of the query.
#[derive(clap::Args)]
pub(crate) struct See {
    /// World written by `enfilade bake`; `-` for standard input.
    world: PathBuf,
    /// Position of the eye, in meters.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    eye: [f32; 3],
    /// The point looked at, in meters; not a direction. +Y is up in the picture.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    look: [f32; 3],
    /// Angle from the lower to the upper edge of the picture, in degrees; from 180 on, and if the picture is wider
    /// than 170 degrees, the view is all around the eye.
    #[arg(long, value_name = "DEG", default_value_t = 60.0)]
    fov: f32,
    /// Width and height of the picture; only their ratio counts.
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "1280x720")]
    size: [u32; 2],
    /// Treat everything farther than this along the view direction as hidden, in meters.
    #[arg(long, value_name = "METERS")]
    far: Option<f32>,
    /// Way in which portals narrow the view: by rectangles, by their outlines, or by outlines of 8 edges.
    #[arg(long, value_enum, default_value_t = SeeMode::PolygonK)]
    mode: SeeMode,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
}

/// Ways in which portals narrow the view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SeeMode {
    Rect,
    Polygon,
    PolygonK,
}

impl SeeMode {
    pub(crate) fn narrowing(self) -> Narrowing {
        match self {
            Self::Rect => Narrowing::Rectangle,
            Self::Polygon => Narrowing::Polygon,
            Self::PolygonK => SeeOptions::default().narrowing,
        }
    }
}

/// Times that a view is queried; the least is printed.
const REPEATS: usize = 21;

pub(crate) fn run(args: &See) -> anyhow::Result<()> {
    args.limits.begin()?;
    let world = read_world(&args.world)?;
    let toward = [0, 1, 2].map(|k| args.look[k] - args.eye[k]);
    let aspect = args.size[0] as f32 / args.size[1] as f32;
    let up = [0.0, 1.0, 0.0];
    let mut view = View::perspective(args.eye, toward, up, args.fov.to_radians(), aspect)?;
    if let Some(far) = args.far {
        view = view.with_far(far)?;
    }
    let sight = Sight::build(&world).with_context(|| args.world.display().to_string())?;
    let state = SightState::new(&sight);
    let options = SeeOptions {
        narrowing: args.mode.narrowing(),
        ..SeeOptions::default()
    };
    let mut viewer = Viewer::with_options(&sight, options);
    let mut seconds = f64::INFINITY;
    for _ in 0..REPEATS {
        let start = Instant::now();
        std::hint::black_box(viewer.see(&sight, &state, &view));
        seconds = seconds.min(start.elapsed().as_secs_f64());
    }
    let seen = viewer.see(&sight, &state, &view);
    let eye_cell = sight.locate(args.eye).map(|c| c.0);
    let mut out = printed_at_once();
    if args.json {
        print_json(&mut out, &world, &sight, &seen, eye_cell, seconds)?;
    } else {
        print_table(&mut out, &world, &sight, &seen, eye_cell, seconds)?;
    }
    out.flush().context("cannot write to standard output")
}

/// Numbers of visible triangles of structure and of details.
fn triangles(sight: &Sight, seen: &Seen<'_>) -> [u64; 2] {
    let chunks = seen.chunks().iter();
    let structure = chunks
        .map(|c| u64::from(sight.chunks()[c.0 as usize].n_triangles()))
        .sum();
    [structure, seen.n_triangles() - structure]
}

fn print_json(
    out: &mut impl Write,
    world: &World,
    sight: &Sight,
    seen: &Seen<'_>,
    eye_cell: Option<u32>,
    seconds: f64,
) -> anyhow::Result<()> {
    let visits: Vec<_> = seen
        .visits()
        .iter()
        .map(|v| {
            json!({
                "cell": v.cell.0, "via": v.via.map(|p| p.0), "rectangle": v.rectangle,
                "face": v.face, "depth": v.depth,
            })
        })
        .collect();
    let [structure, details] = triangles(sight, seen);
    let counts = seen.counts();
    let mut batches: Vec<u32> = seen
        .chunks()
        .iter()
        .map(|c| sight.chunks()[c.0 as usize].batch)
        .collect();
    batches.sort_unstable();
    batches.dedup();
    let report = json!({
        "eye_cell": eye_cell,
        "cells": seen.cells().iter().map(|c| c.0).collect::<Vec<_>>(),
        "portals": seen.portals().iter().map(|p| p.0).collect::<Vec<_>>(),
        "batches": batches,
        "details": seen.details().iter().map(|d| d.0).collect::<Vec<_>>(),
        "visits": visits,
        "counts": {
            "cells": seen.cells().len(), "of_cells": world.graph.cells.len(),
            "portals": seen.portals().len(), "of_portals": world.graph.portals.len(),
            "triangles": structure, "detail_triangles": details,
            "of_triangles": sight.n_triangles(), "clips": counts.clips,
            "spared": counts.spared, "shadowed": counts.shadowed,
            "capped": counts.is_capped,
        },
        "seconds": seconds,
    });
    screen::print_json(out, &report)
}

fn print_table(
    out: &mut impl Write,
    world: &World,
    sight: &Sight,
    seen: &Seen<'_>,
    eye_cell: Option<u32>,
    seconds: f64,
) -> anyhow::Result<()> {
    let name = |c: u32| world.graph.cells[c as usize].name.as_str();
    match eye_cell {
        Some(c) => writeln!(out, "eye in {}", name(c))?,
        None => writeln!(
            out,
            "eye in no cell: all that meets the view counts as visible"
        )?,
    }
    writeln!(out, "{:>8} {:>12}  cell", "depth m", "portal")?;
    for v in seen.visits() {
        let via = v.via.map_or("-".to_owned(), |p| p.to_string());
        writeln!(out, "{:>8.2} {via:>12}  {}", v.depth, name(v.cell.0))?;
    }
    let [structure, details] = triangles(sight, seen);
    writeln!(
        out,
        "{} of {} cells, {} of {} portals, {} of {} triangles ({} of furniture and other objects), {:.1} µs",
        seen.cells().len(),
        world.graph.cells.len(),
        seen.portals().len(),
        world.graph.portals.len(),
        structure + details,
        sight.n_triangles(),
        details,
        seconds * 1e6
    )?;
    writeln!(
        out,
        "depth: distance along the view to the nearest point of the portal; portal: the one through which the cell is seen"
    )?;
    Ok(())
}
