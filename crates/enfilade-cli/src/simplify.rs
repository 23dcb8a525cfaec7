//! `enfilade simplify`: a graph becomes a simpler one, of cells within bounds.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use enfilade::bake::bound::keep_bounds;
use enfilade::bake::simplify::{CostModel, Metric, Simplified, SimplifySettings};
use enfilade::cpg::World;
use enfilade::cpg::wire::encode_glb;

use crate::output::{check_target, write_atomically};
use crate::world::read_world;

/// Merges and cuts cells of a world until their costs are within bounds.
#[derive(clap::Args)]
pub(crate) struct Simplify {
    /// World, whatever built it.
    #[arg(value_name = "IN.glb")]
    input: PathBuf,
    /// World to write.
    #[arg(short, long, value_name = "OUT.glb")]
    output: PathBuf,
    /// Merge until there are no more cells than this, as far as the cost bound allows.
    #[arg(long, value_name = "N")]
    max_cells: Option<usize>,
    /// Merge until there are no more portals than this, as far as the cost bound allows.
    #[arg(long, value_name = "N")]
    max_portals: Option<usize>,
    /// Merge cells that cost less than this, as far as the upper bound allows.
    #[arg(long, value_name = "COST", value_parser = parse_cost)]
    min_cost: Option<f64>,
    /// Cells that cost more than this are cut, and none is merged to more; what cannot be met is told.
    #[arg(long, value_name = "COST", value_parser = parse_cost)]
    max_cost: Option<f64>,
    /// With `--max-cost`: cut the outdoors, too.
    #[arg(long)]
    split_outdoors: bool,
    /// How portals are compared.
    #[arg(long, value_enum, default_value_t = MetricName::ExpectedTriangles)]
    metric: MetricName,
    /// What a triangle costs.
    #[arg(long, value_name = "COST", value_parser = parse_cost, default_value_t = 1.0)]
    triangle_cost: f64,
    /// What a square meter costs.
    #[arg(long, value_name = "COST", value_parser = parse_cost, default_value_t = 0.0)]
    area_cost: f64,
    /// Multiplies the cost of detail objects; 0 where only structure counts.
    #[arg(long, value_name = "FACTOR", value_parser = parse_cost, default_value_t = 1.0)]
    detail_cost: f64,
    /// Multiplies the cost of a material, e.g. `--material-cost water=3`.
    #[arg(long, value_name = "NAME=FACTOR", value_parser = parse_material)]
    material_cost: Vec<(String, f64)>,
}

#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum MetricName {
    /// Triangles that sampled views draw more without the portal.
    ExpectedTriangles,
    /// Volume that sees the portal, times the difference of the cells' costs.
    VisibleVolume,
}

fn parse_cost(text: &str) -> Result<f64, String> {
    let value: f64 = text
        .parse()
        .map_err(|_| format!("'{text}' is not a number"))?;
    if value >= 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(format!("{value} is not at least 0"))
    }
}

fn parse_material(text: &str) -> Result<(String, f64), String> {
    let (name, factor) = text
        .rsplit_once('=')
        .ok_or("give a material's name, '=' and a number")?;
    Ok((name.to_owned(), parse_cost(factor)?))
}

pub(crate) fn run(args: &Simplify) -> anyhow::Result<()> {
    let numbers = args.max_cells.or(args.max_portals);
    if numbers.is_none() && args.min_cost.or(args.max_cost).is_none() {
        bail!("nothing to do: give --max-cells, --max-portals, --min-cost or --max-cost");
    }
    if let (Some(min), Some(max)) = (args.min_cost, args.max_cost)
        && min > max
    {
        bail!("--min-cost {min} is above --max-cost {max}; no cell can be within both");
    }
    check_target(&args.output)?;
    let world = read_world(&args.input)?;
    let settings = SimplifySettings {
        min_cost: args.min_cost.unwrap_or(0.0),
        max_cost: args.max_cost,
        outdoors: args.split_outdoors,
        max_cells: args.max_cells,
        max_portals: args.max_portals,
        metric: match args.metric {
            MetricName::ExpectedTriangles => Metric::ExpectedTriangles,
            MetricName::VisibleVolume => Metric::VisibleVolume,
        },
        cost: CostModel {
            triangle: args.triangle_cost,
            area: args.area_cost,
            detail: args.detail_cost,
            materials: args.material_cost.iter().cloned().collect(),
        },
    };
    settings.cost.check(&world.materials)?;
    let bounded = keep_bounds(&world, &settings);
    write(
        &args.output,
        &world,
        &bounded.world,
        &costs_text(bounded.costs),
    )?;
    if let Some(note) = bounded.note() {
        writeln!(io::stderr(), "{note}")?;
    }
    Ok(())
}

/// What its cells cost.
pub(crate) fn cost_line(s: &Simplified) -> String {
    costs_text([s.min_cost, s.max_cost])
}

fn costs_text([min, max]: [f64; 2]) -> String {
    format!("cost of a cell {min:.0} to {max:.0}\n")
}

/// Writes a world made from another one, and says how they compare.
pub(crate) fn write(path: &Path, before: &World, after: &World, note: &str) -> anyhow::Result<()> {
    let bytes = encode_glb(after).context("the new world breaks an invariant (a bug)")?;
    write_atomically(path, &bytes)?;
    let count = |w: &World| (w.graph.cells.len(), w.graph.portals.len());
    let ((cells, portals), (c, p)) = (count(before), count(after));
    let mut out = io::stdout().lock();
    writeln!(out, "cells   {cells:>7} → {c}")?;
    writeln!(out, "portals {portals:>7} → {p}")?;
    write!(out, "{note}")?;
    writeln!(
        out,
        "wrote {} ({:.1} MB)",
        path.display(),
        bytes.len() as f64 / 1e6
    )?;
    Ok(())
}
