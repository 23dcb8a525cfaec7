//! `enfilade pvs`: what can be seen from where, before run-time.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use enfilade::bake::vis::{Blocker, VisConfig, VisContext, VisMode, VisOutput, see_all};
use enfilade::cpg::wire::decode_glb;
use enfilade::cpg::{CellSet, SightGraph, SightPortal};
use enfilade::geom::{Bvh, DVec3, Triangle};
use enfilade::import::{PrtFile, PvsText, read_prt, write_pvs_text};

use enfilade_verify::structural_triangles;

use crate::output::write_atomically;
use crate::progress::StageBar;

/// Computes the potentially visible set of a world or a Quake portal file: for each cell, what can be seen
/// from it. Writes it as text.
#[derive(clap::Args)]
pub(crate) struct Pvs {
    /// World written by `enfilade bake`, or Quake portal file (PRT1, PRT2, PRT1-AM, or that of Quake 3).
    input: PathBuf,
    /// Where to write the answer, as text.
    #[arg(short, long, value_name = "OUT")]
    output: Option<PathBuf>,
    /// How thoroughly to look.
    #[arg(long, value_enum, default_value_t = Mode::Exact)]
    mode: Mode,
    /// Stop searching after this long; the answer is then larger than need be, and no less right.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    budget: Option<Duration>,
    /// Nothing farther than this is seen.
    #[arg(long, value_name = "DISTANCE", value_parser = distance)]
    far: Option<f64>,
    /// Write down why each pair counts as visible or hidden, for `enfilade verify --evidence`.
    #[arg(long, value_name = "FILE")]
    evidence: Option<PathBuf>,
    /// Threads to use; as many as there are cores if not given. The result is the same.
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum Mode {
    /// Sides of planes only.
    Fast,
    /// All that planes and lines can settle.
    Exact,
}

/// What is printed.
#[derive(serde::Serialize)]
struct Report {
    cells: usize,
    portals: usize,
    /// Ordered pairs, each cell with itself among them.
    pairs: usize,
    mean_visible: f64,
    mean_visible_percent: f64,
    /// Pairs that a line proves: the lower bound.
    proved_visible: usize,
    /// Pairs that count as visible because neither was proved.
    undecided: usize,
    /// Pairs left by the sides of planes alone.
    base_pairs: u64,
    complete: bool,
    lines: usize,
    steps: u64,
    seconds: f64,
    /// By cell, how many cells can be seen from it.
    visible_cells: Vec<usize>,
    /// The ten cells from which most can be seen, the worst first.
    worst: Vec<usize>,
}

pub(crate) fn run(args: &Pvs) -> anyhow::Result<()> {
    let (graph, walls) = read_graph(&args.input)?;
    let output = output_path(args)?;
    let start = Instant::now();
    let vis = compute(args, &graph, walls.as_ref())?;
    let report = report(&graph, &vis, start.elapsed());
    let rows = vis.cells.iter().map(CellSet::ranges).collect();
    let text = write_pvs_text(&PvsText {
        notes: notes(&report, args.mode),
        rows,
    });
    write_atomically(&output, text.as_bytes())?;
    if let (Some(path), Some(evidence)) = (&args.evidence, &vis.evidence) {
        write_atomically(path, evidence)?;
    }
    print(&report, args.json)
}

/// Reads a portal file or a world as a graph to look through; with a world, what stands in the way.
pub(crate) fn read_graph(path: &Path) -> anyhow::Result<(SightGraph, Option<Bvh>)> {
    let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    if bytes.starts_with(b"glTF") {
        let world = decode_glb(&bytes).with_context(|| path.display().to_string())?;
        let walls: Vec<Triangle> = structural_triangles(&world)
            .into_iter()
            .map(|(triangle, _)| triangle)
            .collect();
        let walls = Bvh::build(&walls);
        return Ok((SightGraph::of_graph(&world.graph), Some(walls)));
    }
    let text = std::str::from_utf8(&bytes)
        .ok()
        .with_context(|| format!("{}: no text, so no portal file", path.display()))?;
    let file = read_prt(text).with_context(|| path.display().to_string())?;
    Ok((sight_graph(&file), None))
}

/// The portals of a file that light can pass: those with fewer than three corners have no area.
fn sight_graph(file: &PrtFile) -> SightGraph {
    SightGraph {
        n_cells: file.n_clusters,
        portals: file
            .portals
            .iter()
            .filter(|portal| portal.points.len() >= 3)
            .map(|portal| SightPortal {
                cells: portal.clusters,
                winding: portal
                    .points
                    .iter()
                    .map(|&p| DVec3::from_array(p))
                    .collect(),
                pieces: Vec::new(),
            })
            .collect(),
    }
}

fn output_path(args: &Pvs) -> anyhow::Result<PathBuf> {
    let path = args
        .output
        .clone()
        .unwrap_or_else(|| args.input.with_extension("pvs"));
    if same_file(&path, &args.input) {
        bail!(
            "{} is the input; choose another name with -o",
            path.display()
        );
    }
    Ok(path)
}

fn same_file(a: &Path, b: &Path) -> bool {
    a == b || matches!((fs::canonicalize(a), fs::canonicalize(b)), (Ok(a), Ok(b)) if a == b)
}

fn compute(args: &Pvs, graph: &SightGraph, walls: Option<&Bvh>) -> anyhow::Result<VisOutput> {
    let config = VisConfig {
        mode: match args.mode {
            Mode::Fast => VisMode::Fast,
            Mode::Exact => VisMode::Exact,
        },
        far: args.far,
        has_evidence: args.evidence.is_some(),
        ..VisConfig::default()
    };
    let bar = StageBar::new();
    let start = Instant::now();
    let mut has_begun = false;
    let mut on_round = |done: u64, total: u64| {
        if !has_begun {
            has_begun = true;
            bar.start("searching", total);
        }
        bar.set(done);
        args.budget.is_none_or(|budget| start.elapsed() < budget)
    };
    let is_blocked = walls.map(|walls| move |a: DVec3, b: DVec3| walls.any_hit(a, b, |_| false));
    let mut context = VisContext {
        on_round: &mut on_round,
        blocker: is_blocked.as_ref().map(|f| f as Blocker<'_>),
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(args.threads.unwrap_or(0))
        .build()
        .context("cannot start threads; try --threads 1")?;
    let answer = pool.install(|| see_all(graph, &config, &mut context));
    bar.finish();
    answer.with_context(|| args.input.display().to_string())
}

fn report(graph: &SightGraph, vis: &VisOutput, took: Duration) -> Report {
    let cells = vis.cells.len();
    let pairs: usize = vis.cells.iter().map(CellSet::len).sum();
    let undecided: usize = vis.undecided.iter().map(CellSet::len).sum();
    let visible_cells: Vec<usize> = vis.cells.iter().map(CellSet::len).collect();
    let mut worst: Vec<usize> = (0..cells).collect();
    worst.sort_by_key(|&c| (std::cmp::Reverse(visible_cells[c]), c));
    worst.truncate(10);
    let mean = pairs as f64 / cells.max(1) as f64;
    Report {
        cells,
        portals: graph.portals.len(),
        pairs,
        mean_visible: mean,
        mean_visible_percent: 100.0 * mean / cells.max(1) as f64,
        proved_visible: pairs - undecided,
        undecided,
        base_pairs: vis.n_base,
        complete: vis.is_complete,
        lines: vis.witnesses.len(),
        steps: vis.n_steps,
        seconds: took.as_secs_f64(),
        visible_cells,
        worst,
    }
}

/// Notes of the text file: nothing that differs from run to run.
fn notes(report: &Report, mode: Mode) -> Vec<String> {
    let mode = match mode {
        Mode::Fast => "fast",
        Mode::Exact => "exact",
    };
    vec![
        format!("kind enfilade {}, {mode}", env!("CARGO_PKG_VERSION")),
        format!("portals {}", report.portals),
        format!("visible_pairs {}", report.pairs),
        format!("proved_visible_pairs {}", report.proved_visible),
        format!("mean_visible {:.3}", report.mean_visible),
        format!("mean_visible_percent {:.3}", report.mean_visible_percent),
        "asymmetric_pairs 0".into(),
    ]
}

fn print(report: &Report, is_json: bool) -> anyhow::Result<()> {
    let mut out = BufWriter::new(io::stdout().lock());
    if is_json {
        serde_json::to_writer(&mut out, report).map_err(io::Error::from)?;
        writeln!(out)?;
    } else {
        let r = report;
        let percent = |n: usize| 100.0 * n as f64 / r.pairs.max(1) as f64;
        writeln!(out, "{} cells, {} portals", r.cells, r.portals)?;
        writeln!(
            out,
            "{} pairs of cells see each other: {:.2} cells on average, {:.2} %",
            r.pairs, r.mean_visible, r.mean_visible_percent
        )?;
        writeln!(
            out,
            "tightness: {:.2} % of them proved by {} lines, {} undecided; {} by sides of planes alone",
            percent(r.proved_visible),
            r.lines,
            r.undecided,
            r.base_pairs
        )?;
        if !r.complete {
            writeln!(
                out,
                "stopped by --budget: the answer is larger than need be"
            )?;
        }
        let worst: Vec<String> = r
            .worst
            .iter()
            .map(|&c| format!("{c} ({})", r.visible_cells[c]))
            .collect();
        writeln!(out, "cells that see most: {}", worst.join(", "))?;
        writeln!(out, "{:.2} s, {} chains searched", r.seconds, r.steps)?;
    }
    out.flush().context("cannot write to standard output")
}

fn seconds(text: &str) -> Result<Duration, String> {
    text.parse()
        .ok()
        .and_then(|s| Duration::try_from_secs_f64(s).ok())
        .ok_or_else(|| "a number of seconds of at least 0 is needed".into())
}

fn distance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x >= 0.0 => Ok(x),
        _ => Err("a distance of at least 0 is needed".into()),
    }
}
