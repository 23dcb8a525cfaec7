//! `enfilade report`: writes a page about a world.

#[cfg(feature = "render")]
mod pictures;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context;
use enfilade::cpg::{CellId, Pvs, World};
use enfilade::geom::Triangle;
use enfilade::runtime::Sight;
use enfilade::vis::{VisConfig, VisContext, see_world};
use enfilade_report::{ReportParts, Table, report_html};
use enfilade_verify::structural_triangles;

use crate::formats::Format;
use crate::limits::Limits;
use crate::output::{Outputs, Written, write_whole};
use crate::screen::print_json;
use crate::walk_page;
use enfilade_cli::input::{is_stream, name_of};
use enfilade_cli::world::read_world;
use enfilade_report::{Verdict, cells_in_words};

/// Writes a self-contained page: plans, the graph, visibility, tables, pictures.
#[derive(clap::Args)]
pub(crate) struct Report {
    /// World written by `enfilade bake`; `-` for standard input.
    world: PathBuf,
    /// File for the page; `-` for standard output.
    #[arg(short, long, value_name = "HTML")]
    output: PathBuf,
    #[cfg(feature = "render")]
    #[command(flatten)]
    pictures: pictures::PictureOptions,
    /// Title of the page; by default the file's name in words, `World` for standard input.
    #[arg(long, value_name = "TEXT")]
    title: Option<String>,
    /// Also write a first-person walk for the browser beside the page, NAME-walk.html, and link it. It opens the world
    /// where it is now, from any server of files, such as `enfilade serve`.
    #[arg(long)]
    walk: bool,
    /// Print a report on the page as JSON for machines.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
}

/// The output of `--json`.
#[derive(serde::Serialize)]
struct PageReport<'a> {
    #[serde(flatten)]
    written: Written,
    pictures: usize,
    notes: &'a [String],
}

/// Limit of the visibility search, in openings tested from openings; pairs that are undecided then count as visible.
/// Twice what a clinic of 660 rooms needs. A count instead of a time, so that the page of a world is always the same.
const BUDGET: u64 = 2_000_000;
/// Time limit for worlds made to take long; the page may differ then.
const LONGEST: Duration = Duration::from_secs(300);

pub(crate) fn run(args: &Report) -> anyhow::Result<()> {
    args.limits.begin()?;
    let mut outputs = Outputs::reading([&args.world])?;
    outputs.write("-o", Format::Page, &args.output)?;
    let walk = match args.walk {
        true => Some(walk_page::beside(&args.output)?),
        false => None,
    };
    if let Some(walk) = &walk {
        outputs.write("--walk", Format::Page, walk)?;
    }
    let world = read_world(&args.world)?;
    let mut parts = ReportParts {
        title: args.title.clone().unwrap_or_else(|| title_of(&args.world)),
        walk: walk.as_deref().map(walk_page::address_of_page),
        ..ReportParts::default()
    };
    parts.verdict = Some(Verdict::of(&world, &[]).untried());
    parts.visible = visible(&world, &mut parts.notes)?;
    let sight = Sight::build(&world).with_context(|| name_of(&args.world))?;
    parts
        .tables
        .push(in_numbers(&world, &sight, &parts.visible));
    #[cfg(feature = "render")]
    pictures::add(&mut parts, &args.pictures, &world, &sight)?;
    let page = report_html(&world, &parts);
    if let Some(walk) = &walk {
        walk_page::write(walk, &args.world, parts.title.clone(), &world)?;
    }
    write_whole(&args.output, page.as_bytes())?;
    let written = Written::new(&args.output, page.as_bytes());
    if !args.json {
        return Ok(writeln!(outputs.printed(), "{written}")?);
    }
    let report = PageReport {
        written,
        pictures: parts.figures.len(),
        notes: &parts.notes,
    };
    print_json(outputs.printed(), &report)
}

/// Returns the name of a file in words: `town-hall_2.glb` is `Town hall 2`.
pub(crate) fn title_of(path: &Path) -> String {
    if is_stream(path) {
        return "World".into();
    }
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let words = stem.replace(['-', '_'], " ");
    let mut letters = words.trim().chars();
    let first = letters.next().map(|c| c.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}

fn visible(world: &World, notes: &mut Vec<String>) -> anyhow::Result<Pvs> {
    let start = Instant::now();
    let mut on_round = |done: u64, _: u64| done < BUDGET && start.elapsed() < LONGEST;
    let walls: Vec<Triangle> = structural_triangles(world)
        .into_iter()
        .map(|(triangle, _)| triangle)
        .collect();
    let mut context = VisContext {
        on_round: &mut on_round,
        walls: Some(&walls),
        checkpoint: None,
    };
    let out = see_world(&world.graph, &VisConfig::default(), &mut context)?.vis;
    if !out.is_complete {
        notes.push(
            "The visibility search did not finish: the matrix shows more than can be seen.".into(),
        );
    }
    Ok(out.cells)
}

fn row(cells: &[&str]) -> Vec<String> {
    cells.iter().map(ToString::to_string).collect()
}

/// The counts by which the papers describe their scenes.
fn in_numbers(world: &World, sight: &Sight, visible: &Pvs) -> Table {
    let graph = &world.graph;
    let (n_cells, n_portals) = (graph.cells.len(), graph.portals.len());
    let structure: usize = world
        .batches
        .iter()
        .map(|b| b.primitive.indices.len() / 3)
        .sum();
    let most = graph
        .cells
        .iter()
        .map(|c| c.portals.len())
        .max()
        .unwrap_or(0);
    let mean = |sum: usize| format!("{:.2}", sum as f64 / n_cells.max(1) as f64);
    let seen = visible.n_pairs();
    let by_cell = (0..visible.n_cells() as u32).map(|c| visible.n_visible_from(CellId(c)));
    let most_seen = by_cell.max().unwrap_or(0);
    Table {
        title: "In numbers".into(),
        note: "Totals, and how much of them a room has.".into(),
        rows: vec![
            row(&["", "all", "mean of a room", "most of a room"]),
            row(&[
                &format!("cells: {}", cells_in_words(graph)),
                &n_cells.to_string(),
                "",
                "",
            ]),
            row(&[
                "doorways",
                &n_portals.to_string(),
                &mean(2 * n_portals),
                &most.to_string(),
            ]),
            row(&[
                "triangles of structure",
                &structure.to_string(),
                &mean(structure),
                "",
            ]),
            row(&[
                "triangles with objects",
                &sight.n_triangles().to_string(),
                &mean(sight.n_triangles() as usize),
                "",
            ]),
            row(&["rooms seen", "", &mean(seen), &most_seen.to_string()]),
        ],
    }
}
