//! `enfilade export`: writes a world as plain data for other programs.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use enfilade::cpg::World;
use enfilade::geom::shown;
use enfilade::import::export_glb;
use enfilade::whole;
use enfilade_report::{
    SceneFiles, cells_csv, graph_dot, graph_graphml, graph_json, portals_csv, surfaces_obj,
};

use crate::formats::Format;
use crate::limits::Limits;
use crate::output::{Outputs, Written, check_folder, refuse_stream, write_whole};
use crate::screen::print_json;
use enfilade_cli::input::{is_stream, name_of};
use enfilade_cli::world::read_world;

/// Writes the graph or the surfaces of a world as plain data, for programs that do not read our extension of glTF.
///
/// The name's ending chooses: `.json` has cells, portals with their polygons, the tree that finds the cell of a point,
/// and visible cells if computed; `.graphml` and `.dot` are for programs that draw graphs; `.csv` is a table of the
/// portals or, with `--cells`, of the cells; `.obj` has the surfaces in groups by cell, without door leaves, for
/// programs that build navigation meshes. Special portals and materials are left out.
///
/// With `--split`, a folder: `graph.json`, as above, and the surfaces with their materials as a .glb for each set of
/// cells that see the same, which `files` in `graph.json` lists. A program loads the files of the cells in view.
#[derive(clap::Args)]
pub(crate) struct Export {
    /// World written by `enfilade bake`; `-` for standard input.
    world: PathBuf,
    /// File to write: .json, .graphml, .dot, .csv or .obj; the folder with `--split`. `-` is JSON to standard output.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Write the table of the cells, not of the portals.
    #[arg(long)]
    cells: bool,
    /// Write a folder: the graph, and a .glb for each set of cells that see the same.
    #[arg(long, conflicts_with = "cells")]
    split: bool,
    /// Print a report on the file as JSON for machines; nothing else is printed.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
}

pub(crate) fn run(args: &Export) -> anyhow::Result<()> {
    args.limits.begin()?;
    let mut outputs = Outputs::reading([&args.world])?;
    if args.split {
        return split(args, &outputs);
    }
    let text_of = writer(args)?;
    outputs.write("-o", Format::PlainData, &args.output)?;
    let world = read_valid(args)?;
    let text = text_of(&world)?.into_bytes();
    write_whole(&args.output, &text)?;
    let written = Written::new(&args.output, &text);
    if args.json {
        return print_json(outputs.printed(), &written);
    }
    writeln!(outputs.printed(), "{written}")?;
    Ok(())
}

/// The file that says which others there are.
const GRAPH: &str = "graph.json";

#[derive(serde::Serialize)]
struct SplitReport {
    folder: String,
    files: usize,
    bytes: u64,
}

/// Writes the graph, and a scene for each set of cells; one scene at a time is in memory.
fn split(args: &Export, outputs: &Outputs) -> anyhow::Result<()> {
    refuse_stream("-o", &args.output, "a folder")?;
    check_folder(&args.output, GRAPH)?;
    let world = read_valid(args)?;
    let files = SceneFiles::of(&world);
    let graph = graph_json(&world, files.files()).context("cannot write JSON")?;
    let mut bytes = 0;
    let scenes = files
        .scenes()
        .map(|(name, scene)| (name, export_glb(&scene)));
    let all = std::iter::once((GRAPH, graph.into_bytes())).chain(scenes);
    let counted = all.inspect(|(_, file)| bytes += file.len() as u64);
    whole::write_folder(&args.output, counted).with_context(|| {
        format!(
            "cannot write {}; choose another place, or free space there",
            args.output.display()
        )
    })?;
    let report = SplitReport {
        folder: args.output.display().to_string(),
        files: files.files().len() + 1,
        bytes,
    };
    if args.json {
        return print_json(outputs.printed(), &report);
    }
    writeln!(
        outputs.printed(),
        "wrote {} ({} files, {:.1} MB)",
        shown(&report.folder),
        report.files,
        bytes as f64 / 1e6
    )?;
    Ok(())
}

fn read_valid(args: &Export) -> anyhow::Result<World> {
    let world = read_world(&args.world)?;
    if let Err(errors) = world.validate() {
        let first = errors.first().map(ToString::to_string).unwrap_or_default();
        bail!(
            "{}: the world is broken, so it is not exported: {first}",
            name_of(&args.world)
        );
    }
    Ok(world)
}

type Writer = fn(&World) -> anyhow::Result<String>;

/// Returns the writer by the extension.
fn writer(args: &Export) -> anyhow::Result<Writer> {
    let path: &Path = &args.output;
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let extension = extension.to_ascii_lowercase();
    if args.cells && extension != "csv" {
        bail!(
            "--cells applies only to a .csv file; leave it out, or give -o a name that ends in .csv"
        );
    }
    Ok(match extension.as_str() {
        "json" => |w| graph_json(w, &[]).context("cannot write JSON"),
        _ if is_stream(path) => |w| graph_json(w, &[]).context("cannot write JSON"),
        "graphml" => |w| Ok(graph_graphml(w)),
        "dot" | "gv" => |w| Ok(graph_dot(w)),
        "csv" if args.cells => |w| Ok(cells_csv(w)),
        "csv" => |w| Ok(portals_csv(w)),
        "obj" => |w| Ok(surfaces_obj(w)),
        _ => bail!(
            "{}: the name does not say what to write; end it in .json, .graphml, .dot, .csv or .obj",
            path.display()
        ),
    })
}
