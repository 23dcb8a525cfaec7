//! `enfilade name`: renames the rooms of a world.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context, bail};
use enfilade::bake::names::rename_cells;
use enfilade::cpg::wire::encode_glb;
use enfilade::cpg::{CellId, CellPortalGraph};
use enfilade::geom::{DVec3, shown};
use serde::Serialize;

use crate::formats::Format;
use crate::inspect::cell_of;
use crate::limits::Limits;
use crate::output::{Outputs, Written, write_whole};
use crate::screen::{Warned, print_json};
use enfilade_cli::values::point;
use enfilade_cli::world::read_world;

/// Renames rooms of a world.
///
/// Plans, reports, paths, `inspect` and the viewer show the names, and commands take them for cells. In a bake, the table `[names]`
/// of the settings file does the same.
#[derive(clap::Args)]
#[command(group(clap::ArgGroup::new("names").required(true).multiple(true)))]
pub(crate) struct Name {
    /// World from any builder; `-` for standard input.
    #[arg(value_name = "W.glb")]
    world: PathBuf,
    /// World to write; `-` for standard output.
    #[arg(short, long, value_name = "OUT.glb")]
    output: PathBuf,
    /// Point in a room, in meters, and the room's new name; repeatable.
    #[arg(long, num_args = 2, value_names = ["X,Y,Z", "NAME"], group = "names", allow_hyphen_values = true)]
    at: Vec<String>,
    /// Cell, by number or present name, and its new name; repeatable.
    #[arg(long, num_args = 2, value_names = ["CELL", "NAME"], group = "names", allow_hyphen_values = true)]
    cell: Vec<String>,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
}

/// The output of `--json`.
#[derive(Serialize)]
struct NameReport {
    #[serde(flatten)]
    written: Written,
    names: Vec<Named>,
    warnings: Vec<String>,
}

/// A cell that was renamed.
#[derive(Serialize)]
struct Named {
    cell: u32,
    before: String,
    after: String,
}

/// A name as it was asked for, and the cell that gets it.
struct Renaming {
    /// The option, for messages.
    option: String,
    /// The cell was found by a point.
    by_point: bool,
    cell: CellId,
    name: String,
}

pub(crate) fn run(args: &Name) -> anyhow::Result<()> {
    args.limits.begin()?;
    let mut outputs = Outputs::reading([&args.world])?;
    outputs.write("-o", Format::World, &args.output)?;
    let mut world = read_world(&args.world)?;
    let graph = &mut world.graph;
    let asked = asked(args, graph)?;
    let mut warnings: Vec<String> = asked
        .iter()
        .filter(|a| a.by_point)
        .filter_map(|a| {
            let kind = match &graph[a.cell] {
                cell if cell.outdoor => "the outdoors",
                cell if cell.is_void => "a void, in which nobody can stand",
                _ => return None,
            };
            Some(format!("{}: this is no room, but {kind}", a.option))
        })
        .collect();
    let before: Vec<String> = asked.iter().map(|a| graph[a.cell].name.clone()).collect();
    let names: Vec<(CellId, String)> = asked.iter().map(|a| (a.cell, a.name.clone())).collect();
    let after = rename_cells(graph, &names);
    for (ask, after) in asked.iter().zip(&after) {
        if ask.name != *after {
            warnings.push(format!(
                "{}: another cell has this name; this one is called '{}'",
                ask.option,
                shown(after)
            ));
        }
    }
    let bytes = encode_glb(&world).context("the new world breaks an invariant (a bug)")?;
    write_whole(&args.output, &bytes)?;
    for warning in &warnings {
        writeln!(Warned, "{warning}")?;
    }
    let report = NameReport {
        written: Written::new(&args.output, &bytes),
        names: (asked.iter().zip(before).zip(after))
            .map(|((ask, before), after)| Named {
                cell: ask.cell.0,
                before,
                after,
            })
            .collect(),
        warnings,
    };
    let mut out = outputs.printed();
    if args.json {
        return print_json(out, &report);
    }
    for named in &report.names {
        writeln!(
            out,
            "{:>12}  {} → {}",
            named.cell, named.before, named.after
        )?;
    }
    writeln!(out, "{}", report.written)?;
    Ok(())
}

/// Finds the cells to rename, those at points first.
fn asked(args: &Name, graph: &CellPortalGraph) -> anyhow::Result<Vec<Renaming>> {
    let mut all: Vec<Renaming> = Vec::new();
    for (by_point, values) in [(true, &args.at), (false, &args.cell)] {
        let option = if by_point { "--at" } else { "--cell" };
        for pair in values.chunks(2) {
            let [place, name] = pair else { continue };
            let name = name.trim();
            let option = format!("{option} {} '{}'", shown(place), shown(name));
            if name.is_empty() {
                bail!("{option}: a name needs at least one letter");
            }
            let cell = if by_point {
                let at = point(place).map_err(anyhow::Error::msg);
                let at = DVec3::from_array(at.with_context(|| option.clone())?.map(f64::from));
                graph.locator.locate(at).with_context(|| {
                    format!(
                        "{option}: the point is in a wall or another solid, in no room; give a point in the air, or --cell with a \
                         number that `enfilade inspect` lists"
                    )
                })?
            } else {
                cell_of(graph, place).with_context(|| option.clone())?
            };
            if let Some(other) = all.iter().find(|a| a.cell == cell) {
                bail!(
                    "{option}: {cell} has a name already, by {}; a room has one name",
                    other.option
                );
            }
            all.push(Renaming {
                option,
                by_point,
                cell,
                name: name.to_owned(),
            });
        }
    }
    Ok(all)
}
