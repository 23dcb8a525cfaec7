//! `enfilade simplify`: simplifies a graph until its cells are within bounds.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use enfilade::bake::simplify::{CostModel, Metric, SimplifySettings};
use enfilade::cpg::World;
use enfilade::cpg::wire::decode_glb;
use enfilade::import::{PrtFile, read_prt, write_prt};
use enfilade::internals::bake::bound::keep_bounds;
use enfilade::internals::bake::simplify::simplify_graph;
use serde::Serialize;

use crate::formats::Format;
use crate::limits::Limits;
use crate::output::{Outputs, Written, write_whole};
use crate::pvs::sight_graph;
use crate::screen::{Warned, print_json, write_lines};
use enfilade_cli::input::{name_of, read};
use enfilade_cli::world::encode_whole;

/// Merges and cuts cells of a world until their costs are within bounds, or merges clusters of a Quake portal file.
#[derive(clap::Args)]
pub(crate) struct Simplify {
    /// World from any builder, or Quake portal file (PRT1, PRT2, PRT1-AM or Quake 3); `-` for standard input.
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// World or portal file to write, of the same kind as the input; PRT1 becomes PRT2, whose leaves are the clusters
    /// of the input. `-` for standard output.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Merge until there are at most this many cells, as far as the cost bound and the outdoors allow.
    #[arg(long, value_name = "N")]
    max_cells: Option<usize>,
    /// Merge until there are at most this many portals, as far as the cost bound allows.
    #[arg(long, value_name = "N")]
    max_portals: Option<usize>,
    /// Merge cells that cost less than this, as far as the upper bound allows.
    #[arg(long, value_name = "COST", value_parser = parse_cost)]
    min_cost: Option<f64>,
    /// Cut cells that cost more than this, and merge none to more; cells that cannot be cut are reported.
    #[arg(long, value_name = "COST", value_parser = parse_cost)]
    max_cost: Option<f64>,
    /// With `--max-cost`, for worlds: cut the outdoors, too.
    #[arg(long)]
    split_outdoors: bool,
    /// Also merge rooms with the outdoors if a bound cannot be met otherwise; without it, all portals to the outdoors
    /// stay.
    #[arg(long)]
    join_outdoors: bool,
    /// Order in which portals are removed [default: expected-triangles]; in a portal file, which has no surfaces, by
    /// area.
    #[arg(long, value_enum)]
    metric: Option<MetricName>,
    /// Cost of a triangle; in a portal file, of a triangle of a solid face or, without faces, of a leaf.
    #[arg(long, value_name = "COST", value_parser = parse_cost, default_value_t = 1.0)]
    triangle_cost: f64,
    /// Cost of a square meter.
    #[arg(long, value_name = "COST", value_parser = parse_cost, default_value_t = 0.0)]
    area_cost: f64,
    /// Factor on the cost of detail objects; 0 to count only structure.
    #[arg(long, value_name = "FACTOR", value_parser = parse_cost, default_value_t = 1.0)]
    detail_cost: f64,
    /// Factor on the cost of a material, e.g. `--material-cost water=3`.
    #[arg(long, value_name = "NAME=FACTOR", value_parser = parse_material)]
    material_cost: Vec<(String, f64)>,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
}

#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum MetricName {
    /// Triangles that sampled views draw in addition without the portal.
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
    args.limits.begin()?;
    let numbers = args.max_cells.or(args.max_portals);
    if numbers.is_none() && args.min_cost.or(args.max_cost).is_none() {
        bail!("nothing to do: give --max-cells, --max-portals, --min-cost or --max-cost");
    }
    if let (Some(min), Some(max)) = (args.min_cost, args.max_cost)
        && min > max
    {
        bail!("--min-cost {min} is above --max-cost {max}; no cell can be within both");
    }
    let mut outputs = Outputs::reading([&args.input])?;
    let bytes = read(&args.input)?;
    let is_world = bytes.starts_with(b"glTF") || std::str::from_utf8(&bytes).is_err();
    let format = if is_world {
        Format::World
    } else {
        Format::PortalFile
    };
    outputs.write("-o", format, &args.output)?;
    let settings = SimplifySettings {
        doorway: None,
        min_cost: args.min_cost.unwrap_or(0.0),
        max_cost: args.max_cost,
        outdoors: args.split_outdoors,
        join_outdoors: args.join_outdoors,
        max_cells: args.max_cells,
        max_portals: args.max_portals,
        metric: match args.metric {
            None | Some(MetricName::ExpectedTriangles) => Metric::ExpectedTriangles,
            Some(MetricName::VisibleVolume) => Metric::VisibleVolume,
        },
        cost: CostModel {
            triangle: args.triangle_cost,
            area: args.area_cost,
            detail: args.detail_cost,
            materials: args.material_cost.iter().cloned().collect(),
        },
    };
    if !is_world {
        let text = String::from_utf8_lossy(&bytes);
        return simplify_portal_file(args, &outputs, &text, &settings);
    }
    let world = decode_glb(&bytes).with_context(|| name_of(&args.input))?;
    settings.cost.check(&world.materials)?;
    check_portals(args, &world)?;
    let mut bounded = keep_bounds(&world, &settings);
    let graph = &bounded.world.graph;
    let warnings = [
        bounded.note(),
        too_many(args.max_cells, graph.cells.len(), "cells"),
        too_many(args.max_portals, graph.portals.len(), "portals"),
    ];
    let warnings: Vec<String> = warnings.into_iter().flatten().collect();
    let done = Done {
        costs: Some(bounded.costs),
        notes: Vec::new(),
        warning: (!warnings.is_empty()).then(|| warnings.join("\n")),
    };
    write(
        &outputs,
        &args.output,
        &world,
        &mut bounded.world,
        done,
        args.json,
    )
}

/// Refuses a number of portals that merging all rooms does not reach.
fn check_portals(args: &Simplify, world: &World) -> anyhow::Result<()> {
    let graph = &world.graph;
    let outward = graph.portals.iter().filter(|p| {
        let [a, b] = p.cells.map(|c| graph[c].outdoor);
        a != b
    });
    let n = outward.count();
    match args.max_portals {
        Some(most) if n > most && !args.join_outdoors => bail!(
            "--max-portals {most}: {n} portals lead outdoors, and stay; give {n} or more, or --join-outdoors, which merges rooms \
             with the outdoors"
        ),
        _ => Ok(()),
    }
}

/// A warning that more are left than requested, if so.
fn too_many(most: Option<usize>, n: usize, what: &str) -> Option<String> {
    let most = most.filter(|&most| n > most)?;
    Some(format!(
        "{n} {what} are left, more than {most}: no other two may be merged; a higher --max-cost or --join-outdoors may help"
    ))
}

/// A warning that a cell of a portal file exceeds the cost bound, if one does.
fn over_bound(args: &Simplify, max_cost: f64) -> Option<String> {
    let max = args.max_cost.filter(|m| max_cost > *m)?;
    Some(format!(
        "a cell costs {max_cost:.0}, more than {max}, as in the input; only a bake can cut it"
    ))
}

/// Merges the clusters of a portal file.
fn simplify_portal_file(
    args: &Simplify,
    outputs: &Outputs,
    text: &str,
    settings: &SimplifySettings,
) -> anyhow::Result<()> {
    if args.metric.is_some()
        || args.split_outdoors
        || args.join_outdoors
        || args.area_cost > 0.0
        || !args.material_cost.is_empty()
    {
        bail!(
            "--metric, --split-outdoors, --join-outdoors, --area-cost and --material-cost need surfaces, which a portal file does not have"
        );
    }
    let file = read_prt(text).with_context(|| name_of(&args.input))?;
    let graph = sight_graph(&file);
    graph.validate().with_context(|| name_of(&args.input))?;
    let simple = simplify_graph(&graph, &cluster_costs(&file, &settings.cost), settings);
    let merged = file.merged(&simple.cell_of, simple.n_cells);
    let merged_text = write_prt(&merged);
    write_whole(&args.output, merged_text.as_bytes())?;
    let compared = Compared {
        written: Written::new(&args.output, merged_text.as_bytes()),
        cells: [file.n_clusters as usize, merged.n_clusters as usize],
        portals: [file.portals.len(), merged.portals.len()],
        costs: Some([simple.min_cost, simple.max_cost]),
        notes: Vec::new(),
        warning: over_bound(args, simple.max_cost),
    };
    compared.print(
        outputs.printed(),
        args.json,
        ["clusters", "cluster", CLUSTER_COST],
    )
}

/// The costs of the clusters of a portal file: by their solid faces, which Quake 3's files have, else by their
/// leaves.
fn cluster_costs(file: &PrtFile, cost: &CostModel) -> Vec<f64> {
    let mut costs = vec![0.0; file.n_clusters as usize];
    for face in &file.faces {
        costs[face.cluster as usize] += cost.triangle * face.points.len().saturating_sub(2) as f64;
    }
    if file.faces.is_empty() {
        for &cluster in &file.leaf_cluster {
            costs[cluster as usize] += cost.triangle;
        }
    }
    costs
}

/// The cost of a cell in words, of which options set the factors.
const CELL_COST: &str =
    "triangles of walls and objects that the cell sees, unless other costs are given";
/// The cost of a cluster in words.
const CLUSTER_COST: &str =
    "triangles of its solid faces, or its leaves if the file has no faces, times --triangle-cost";

/// A file compared with the one that it was made from.
#[derive(Serialize)]
pub(crate) struct Compared {
    #[serde(flatten)]
    written: Written,
    /// Before and after.
    cells: [usize; 2],
    portals: [usize; 2],
    /// The least and the greatest cost of a cell, if cells were merged.
    costs: Option<[f64; 2]>,
    /// The changes, in words.
    notes: Vec<String>,
    /// Bounds that could not be met.
    warning: Option<String>,
}

impl Compared {
    /// Prints the differences; a bound that could not be met is also a warning.
    /// `what`: the word for cells, for one of them, and for its cost.
    fn print(&self, mut out: Box<dyn Write>, is_json: bool, what: [&str; 3]) -> anyhow::Result<()> {
        if let Some(warning) = &self.warning {
            write_lines(&mut Warned, warning)?;
        }
        if is_json {
            return print_json(out, self);
        }
        let [cells, cell, cost] = what;
        let width = cells.len().max("portals".len());
        for (name, [before, after]) in [(cells, self.cells), ("portals", self.portals)] {
            writeln!(out, "{name:<width$} {before:>7} → {after}")?;
        }
        if let Some([least, most]) = self.costs {
            writeln!(out, "cost of a {cell} {least:.0} to {most:.0}")?;
        }
        for note in &self.notes {
            writeln!(out, "{note}")?;
        }
        writeln!(out, "{}", self.written)?;
        if self.costs.is_some() {
            writeln!(out, "cost: {cost}")?;
        }
        Ok(())
    }
}

/// The changes to a world.
#[derive(Default)]
pub(crate) struct Done {
    pub(crate) costs: Option<[f64; 2]>,
    pub(crate) notes: Vec<String>,
    pub(crate) warning: Option<String>,
}

/// Writes a world made from another one, and reports how they compare.
pub(crate) fn write(
    outputs: &Outputs,
    path: &Path,
    before: &World,
    after: &mut World,
    done: Done,
    is_json: bool,
) -> anyhow::Result<()> {
    let bytes = encode_whole(after).context("the new world breaks an invariant (a bug)")?;
    write_whole(path, &bytes)?;
    let compared = Compared {
        written: Written::new(path, &bytes),
        cells: [before, &*after].map(|w| w.graph.cells.len()),
        portals: [before, &*after].map(|w| w.graph.portals.len()),
        costs: done.costs,
        notes: done.notes,
        warning: done.warning,
    };
    compared.print(outputs.printed(), is_json, ["cells", "cell", CELL_COST])
}
