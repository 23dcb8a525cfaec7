//! `enfilade export`: writes a world as plain data for other programs.

mod ifc;
mod maps;
mod solids;
mod walkable;

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use enfilade::cpg::World;
use enfilade::geom::shown;
use enfilade::import::export_glb;
use enfilade::whole;
use enfilade_export::{gbxml, hbjson, indoor_gml};
use enfilade_report::{
    SceneFiles, cells_csv, graph_dot, graph_graphml, graph_json, portals_csv, surfaces_obj,
};

use crate::formats::Format;
use crate::limits::Limits;
use crate::output::{Outputs, Written, check_folder, refuse_stream, write_whole};
use crate::screen::{Told, print_json};
use enfilade_cli::input::{is_stream, name_of};
use enfilade_cli::world::read_world;

/// Writes the graph, the surfaces or the rooms of a world for programs that do not read our extension of glTF.
///
/// The name's ending chooses: `.json` has cells, portals with their polygons, the tree that finds the cell of a point,
/// and visible cells if computed; `.graphml` and `.dot` are for programs that draw graphs; `.csv` is a table of the
/// portals or, with `--cells`, of the cells; `.obj` has the surfaces in groups by cell, without door leaves, for
/// programs that build navigation meshes. Special portals and materials are left out.
///
/// For other trades: `.gbxml` and Honeybee's `.hbjson` are models for energy; `.gml` is IndoorGML; `.pgm` is a map for robots, with
/// its `.yaml`, a picture of labels and a table of the rooms beside it. With `--rooms-solid`, a folder: each room as a closed mesh and
/// for pyroomacoustics. With `--ifc`, the model that was baked, and in it a space for each room, with its quantities and boundaries.
///
/// With `--split`, a folder: `graph.json`, as above, and the surfaces with their materials as a .glb for each set of
/// cells that see the same, which `files` in `graph.json` lists. A program loads the files of the cells in view.
#[derive(clap::Args)]
pub(crate) struct Export {
    /// World written by `enfilade bake`; `-` for standard input.
    world: PathBuf,
    /// File to write: .json, .graphml, .dot, .csv, .obj, .gbxml, .hbjson, .gml, .ifc or .pgm; the folder with `--split` or
    /// `--rooms-solid`. `-` is JSON to standard output.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Write the table of the cells, not of the portals.
    #[arg(long)]
    cells: bool,
    /// Write a folder: the graph, and a .glb for each set of cells that see the same.
    #[arg(long, conflicts_with = "cells")]
    split: bool,
    /// Write a folder: each room as a closed mesh (OBJ, STL), and its walls as JSON for pyroomacoustics.
    #[arg(long, conflicts_with_all = ["cells", "split"])]
    rooms_solid: bool,
    /// Write this IFC file, from which the world was baked, with its rooms as spaces.
    #[arg(long, value_name = "MODEL", conflicts_with_all = ["cells", "split", "rooms_solid"])]
    ifc: Option<PathBuf>,
    /// Give spaces that are in the model, and are rooms, the bodies, quantities and boundaries that were found.
    #[arg(long, requires = "ifc")]
    replace_spaces: bool,
    /// Write boundaries as each room sees them, and not cut where what lies behind changes.
    #[arg(long, requires = "ifc")]
    first_level: bool,
    /// For a map: the storey, as `enfilade plan` names it; the lowest by default.
    #[arg(long, value_name = "NAME")]
    storey: Option<String>,
    /// For a map: side of a pixel in meters; 0.05 by default.
    #[arg(long, value_name = "METERS")]
    resolution: Option<f64>,
    /// Write the floors where a person can stand, in groups by room, into the .obj: furniture and walls are left out by the width of
    /// shoulders, shut doors are passed.
    #[arg(long, conflicts_with_all = ["cells", "split", "rooms_solid", "ifc"])]
    walkable: bool,
    /// Print a report on the file as JSON for machines; nothing else is printed.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
}

pub(crate) fn run(args: &Export) -> anyhow::Result<()> {
    args.limits.begin()?;
    let mut outputs = Outputs::reading([&args.world].into_iter().chain(&args.ifc))?;
    if args.split {
        return split(args, &outputs);
    }
    if args.rooms_solid {
        return solids::run(args, &outputs);
    }
    if let Some(model) = &args.ifc {
        return ifc::run(args, model, &mut outputs);
    }
    if extension_of(&args.output) == "pgm" {
        return maps::run(args, &mut outputs);
    }
    if args.storey.is_some() || args.resolution.is_some() {
        bail!(
            "--storey and --resolution apply only to maps; leave them out, or give -o a name that ends in .pgm"
        );
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
    check_folder("-o", &args.output, GRAPH)?;
    let world = read_valid(args)?;
    let files = SceneFiles::of(&world);
    let graph = graph_json(&world, files.files()).context("cannot write JSON")?;
    let scenes = files
        .scenes()
        .map(|(name, scene)| (name.to_owned(), export_glb(&scene)));
    let all = std::iter::once((GRAPH.to_owned(), graph.into_bytes())).chain(scenes);
    write_files(args, outputs, all)
}

/// Writes the folder of `-o`, and tells how much there is in it.
fn write_files(
    args: &Export,
    outputs: &Outputs,
    files: impl Iterator<Item = (String, Vec<u8>)>,
) -> anyhow::Result<()> {
    let (mut n_files, mut bytes) = (0, 0);
    let counted = files.inspect(|(_, file)| {
        n_files += 1;
        bytes += file.len() as u64;
    });
    whole::write_folder(&args.output, counted).with_context(|| {
        format!(
            "cannot write {}; choose another place, or free space there",
            args.output.display()
        )
    })?;
    let report = SplitReport {
        folder: args.output.display().to_string(),
        files: n_files,
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

/// Returns the ending of a name, in lower case.
fn extension_of(path: &Path) -> String {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    extension.to_ascii_lowercase()
}

/// Refuses worlds without any room, of which there is nothing to tell.
fn check_rooms(world: &World) -> anyhow::Result<()> {
    if world.graph.rooms().next().is_none() {
        bail!("the world has no room; `enfilade inspect` tells what cells it has");
    }
    Ok(())
}

type Writer = fn(&World) -> anyhow::Result<String>;

/// Returns the writer by the extension.
fn writer(args: &Export) -> anyhow::Result<Writer> {
    let path: &Path = &args.output;
    let extension = extension_of(path);
    if args.cells && extension != "csv" {
        bail!(
            "--cells applies only to a .csv file; leave it out, or give -o a name that ends in .csv"
        );
    }
    if args.walkable {
        if extension != "obj" {
            bail!("--walkable applies only to a .obj file; give -o a name that ends in .obj");
        }
        return Ok(|w| {
            check_rooms(w)?;
            walkable::obj(w)
        });
    }
    Ok(match extension.as_str() {
        "json" => |w| graph_json(w, &[]).context("cannot write JSON"),
        _ if is_stream(path) => |w| graph_json(w, &[]).context("cannot write JSON"),
        "graphml" => |w| Ok(graph_graphml(w)),
        "dot" | "gv" => |w| Ok(graph_dot(w)),
        "csv" if args.cells => |w| Ok(cells_csv(w)),
        "csv" => |w| Ok(portals_csv(w)),
        "obj" => |w| Ok(surfaces_obj(w)),
        "gbxml" => |w| {
            check_rooms(w)?;
            Ok(gbxml(w))
        },
        "hbjson" => |w| {
            check_rooms(w)?;
            let model = hbjson(w);
            for note in &model.notes {
                writeln!(Told, "{note}")?;
            }
            Ok(model.text)
        },
        "gml" => |w| {
            check_rooms(w)?;
            Ok(indoor_gml(w))
        },
        "ifc" => {
            bail!("rooms are written into the model that was baked: name it with --ifc MODEL.ifc")
        }
        _ => bail!(
            "{}: the name does not say what to write; end it in .json, .graphml, .dot, .csv, .obj, .gbxml, .hbjson, .gml, .ifc or .pgm",
            path.display()
        ),
    })
}
