//! `enfilade pvs`: computes visibility before run-time.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use enfilade::cpg::wire::{decode_glb, encode_glb};
use enfilade::cpg::{self, CellId, SightGraph, World};
use enfilade::geom::{DVec3, Triangle};
use enfilade::import::{PrtFile, PvsText, read_prt, write_pvs_text};
use enfilade::internals::vis::see_parts_through;
use enfilade::vis::{
    VisCheckpoint, VisConfig, VisContext, VisMode, VisOutput, WorldVis, see_all, see_world,
};

use enfilade_verify::structural_triangles;

use self::statistics::Statistics;
use crate::formats::Format;
use crate::limits::watch;
use crate::output::{Outputs, is_same_file, write_whole};
use crate::pieces::PieceFolder;
use crate::progress::StageBar;
use crate::screen::{json_text, print_json};
use enfilade_cli::input::{is_address, is_stream, name_of, read};
use enfilade_cli::values::{bytes, seconds};

mod statistics;

/// Computes the potentially visible set of a world or a Quake portal file: for each cell, the cells visible from it,
/// directly or through special portals. Writes it as text.
#[derive(clap::Args)]
pub(crate) struct Pvs {
    /// World written by `enfilade bake`, or Quake portal file (PRT1, PRT2, PRT1-AM or Quake 3); `-` for standard input.
    pub(crate) input: PathBuf,
    /// File for the answer, as text; `-` for standard output. X.pvs beside the input if not given.
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: Option<PathBuf>,
    /// Write the world with the answer in it, for use at run-time; may be the input itself.
    #[arg(long, value_name = "OUT.glb", conflicts_with = "far")]
    pub(crate) into: Option<PathBuf>,
    /// Also store, for each pair of cells, the triangles and objects of one visible from the other, so that the
    /// run-time draws less.
    #[arg(long, requires = "into")]
    pub(crate) parts: bool,
    /// Also store the visible volume of each pair of cells: the part of one cell that is visible from the other
    /// through portals, as convex pieces.
    #[arg(long, requires = "into")]
    pub(crate) volumes: bool,
    /// Thoroughness of the search.
    #[arg(long, value_enum, default_value_t = PvsMode::Exact)]
    pub(crate) mode: PvsMode,
    /// Stop searching after this long; the answer is then larger than necessary, but still correct.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub(crate) budget: Option<Duration>,
    /// End without an answer after this long.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub(crate) max_time: Option<Duration>,
    /// Search a graph whose tables would be larger in blocks that fit, refuse one that does not fit itself, and end
    /// rather than use more memory: a number and K, M, G or T.
    #[arg(long, value_name = "BYTES", default_value = "8G", value_parser = bytes)]
    pub(crate) max_memory: u64,
    /// Treat everything farther than this as hidden.
    #[arg(long, value_name = "DISTANCE", value_parser = distance)]
    pub(crate) far: Option<f64>,
    /// Record why each pair counts as visible or hidden, for `enfilade verify --evidence`. Refused for a world with
    /// special portals.
    #[arg(long, value_name = "FILE")]
    pub(crate) evidence: Option<PathBuf>,
    /// Most special portals on one line of sight. What longer lines show is bounded by the cells they may lead to.
    #[arg(long, value_name = "N", default_value_t = VisConfig::default().max_specials)]
    pub(crate) max_specials: u32,
    /// Save the search to this file every half minute and when --budget ends it, and continue from it next time;
    /// refused for another graph or other settings, removed when the search is done. Large graphs do not need it: the
    /// blocks that are done are kept in OUT.blocks until the answer is written.
    #[arg(long, value_name = "FILE")]
    pub(crate) checkpoint: Option<PathBuf>,
    /// Write statistics for modelers as JSON: the cells, objects and triangles visible from each cell, and the ten
    /// worst viewpoints.
    #[arg(long, value_name = "FILE")]
    pub(crate) statistics: Option<PathBuf>,
    /// Write the pairs that see each other, each once, for radiosity and acoustics: pairs of cells, and of the
    /// surfaces of a world; as text.
    #[arg(long, value_name = "FILE")]
    pub(crate) mutual: Option<PathBuf>,
    /// Number of threads; one per core if not given. The result is the same.
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Print JSON for machines.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, clap::ValueEnum, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum PvsMode {
    /// Separating planes only.
    Fast,
    /// All that planes and lines can decide.
    Exact,
}

impl From<PvsMode> for VisMode {
    fn from(mode: PvsMode) -> Self {
        match mode {
            PvsMode::Fast => Self::Fast,
            PvsMode::Exact => Self::Exact,
        }
    }
}

/// The printed report.
#[derive(serde::Serialize)]
struct PvsReport {
    cells: usize,
    portals: usize,
    /// Ordered pairs, including each cell with itself.
    pairs: usize,
    mean_visible: f64,
    mean_visible_percent: f64,
    /// Pairs proved visible by a line: the lower bound.
    proved_visible: usize,
    /// Pairs that count as visible because nothing was proved.
    undecided: usize,
    /// Pairs that separating planes alone leave.
    base_pairs: u64,
    complete: bool,
    lines: usize,
    steps: u64,
    /// Absent if the world has no special portals.
    #[serde(skip_serializing_if = "Option::is_none")]
    specials: Option<SpecialChains>,
    /// Pairs of which the second does not see the first.
    #[serde(skip)]
    one_way: usize,
    seconds: f64,
    /// Mean numbers of triangles of walls and objects visible from a cell: those that its visible volumes meet, and
    /// those of whole cells. Absent without --parts, --volumes, --statistics and --mutual.
    #[serde(skip_serializing_if = "Option::is_none")]
    mean_triangles: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mean_triangles_of_cells: Option<f64>,
    /// All triangles, if those are given.
    #[serde(skip_serializing_if = "Option::is_none")]
    triangles: Option<usize>,
    /// For each cell, the number of visible cells.
    visible_cells: Vec<usize>,
    /// The ten cells with most visible cells, the worst first.
    worst: Vec<usize>,
    /// Their names.
    #[serde(skip)]
    worst_names: Vec<String>,
}

/// Counts of what was seen through special portals.
#[derive(serde::Serialize)]
struct SpecialChains {
    /// Pairs of cells that see each other through special portals; some also see each other directly.
    pairs: usize,
    /// Chains of special portals looked into.
    chains: u64,
    /// Chains cut at the bound: all that they may lead to counts as visible.
    cut_chains: u64,
}

pub(crate) fn run(args: &Pvs) -> anyhow::Result<()> {
    run_with(args, None)
}

/// Takes the blocks of a large search from a folder that stays; or from one beside the answer, which goes when that is
/// written.
pub(crate) fn run_with(args: &Pvs, kept: Option<PieceFolder>) -> anyhow::Result<()> {
    watch(args.max_time, Some(args.max_memory))?;
    let (outputs, output) = outputs_of(args)?;
    let input = read_input(&args.input)?;
    let graph = &input.graph;
    if args.into.is_some() && input.world.is_none() {
        bail!(
            "{} is a portal file: only a world can store an answer (--into)",
            name_of(&args.input)
        );
    }
    let start = Instant::now();
    let is_kept = kept.is_some();
    let blocks = kept.or_else(|| (!is_stream(&output)).then(|| PieceFolder::beside(&output)));
    let found = compute(args, &input, blocks.as_ref())?;
    let is_complete = found.vis.is_complete;
    let mut report = report(&input, &found, start.elapsed());
    let WorldVis {
        mut vis, through, ..
    } = found;
    if let Some(world) = &input.world
        && (args.parts || args.volumes || args.statistics.is_some() || args.mutual.is_some())
    {
        add_parts(args, world, &mut vis.cells, &through)?;
        report.seconds = start.elapsed().as_secs_f64();
    }
    let statistics = Statistics::new(&vis.cells, input.world.as_ref(), graph);
    if vis.cells.parts.is_some() {
        let [seen, of_cells] = statistics.mean_triangles();
        report.mean_triangles = Some(seen);
        report.mean_triangles_of_cells = Some(of_cells);
        report.triangles = Some(statistics.n_triangles);
    }
    let ranges = |c| vis.cells.runs_from(CellId(c)).iter().map(|&[a, b]| (a, b));
    let rows = (0..graph.n_cells).map(|c| ranges(c).collect()).collect();
    let text = write_pvs_text(&PvsText {
        notes: notes(&report, args.mode),
        rows,
    });
    write_whole(&output, text.as_bytes())?;
    if let (Some(path), Some(evidence)) = (&args.evidence, &vis.evidence) {
        write_whole(path, evidence)?;
    }
    if let Some(path) = &args.statistics {
        let text = json_text(&serde_json::to_string_pretty(&statistics)?);
        write_whole(path, text.as_bytes())?;
    }
    if let Some(path) = &args.mutual {
        let text = statistics::mutual(&vis.cells, input.world.as_ref());
        write_whole(path, text.as_bytes())?;
    }
    if let (Some(path), Some(world)) = (&args.into, input.world) {
        let mut pvs = vis.cells;
        pvs.parts = pvs.parts.filter(|_| args.parts);
        pvs.volumes = pvs.volumes.filter(|_| args.volumes);
        let pvs = Some(pvs);
        let bytes = encode_glb(&World { pvs, ..world })?;
        write_whole(path, &bytes)?;
    }
    if let Some(blocks) = blocks.filter(|_| is_complete && !is_kept) {
        blocks.remove()?;
    }
    print(outputs.printed(), &report, args.json)
}

/// The graph to search, and its world if it has one.
pub(crate) struct Input {
    pub(crate) graph: SightGraph,
    pub(crate) walls: Option<Vec<Triangle>>,
    pub(crate) world: Option<World>,
    /// Hash of the file.
    pub(crate) hash: u64,
}

impl Input {
    /// The name of a cell. Clusters of a portal file are named by number.
    fn name(&self, cell: usize) -> String {
        let id = CellId(cell as u32);
        let world = self.world.as_ref();
        world.map_or_else(|| id.to_string(), |w| w.graph[id].name.clone())
    }
}

/// Reads a portal file or a world as a graph for visibility; for a world, also the blocking triangles.
pub(crate) fn read_graph(path: &Path) -> anyhow::Result<(SightGraph, Option<Vec<Triangle>>)> {
    let input = read_input(path)?;
    Ok((input.graph, input.walls))
}

fn read_input(path: &Path) -> anyhow::Result<Input> {
    input_of(path, &read(path)?)
}

/// Returns what the bytes of a file hold; `path` is named in errors.
pub(crate) fn input_of(path: &Path, bytes: &[u8]) -> anyhow::Result<Input> {
    // FNV-1a: distinguishes files; not safe against forgery.
    let hash = bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    if bytes.starts_with(b"glTF") {
        let world = decode_glb(bytes).with_context(|| name_of(path))?;
        let walls: Vec<Triangle> = structural_triangles(&world)
            .into_iter()
            .map(|(triangle, _)| triangle)
            .collect();
        return Ok(Input {
            graph: SightGraph::of_graph(&world.graph),
            walls: Some(walls),
            world: Some(world),
            hash,
        });
    }
    let text = std::str::from_utf8(bytes)
        .ok()
        .with_context(|| format!("{}: not text, so not a portal file", name_of(path)))?;
    let file = read_prt(text).with_context(|| name_of(path))?;
    Ok(Input {
        graph: sight_graph(&file),
        walls: None,
        world: None,
        hash,
    })
}

/// The graph of a portal file.
pub(crate) fn sight_graph(file: &PrtFile) -> SightGraph {
    let winding = |points: &[[f64; 3]]| points.iter().map(|&p| DVec3::from_array(p)).collect();
    let portals = file.portals.iter();
    SightGraph::of_windings(
        file.n_clusters,
        portals.map(|portal| (portal.clusters, winding(&portal.points))),
    )
}

/// Checks the outputs before the work, and returns them with the path of the answer. Only `--into` may be the input
/// itself: it keeps the world and adds an answer.
fn outputs_of(args: &Pvs) -> anyhow::Result<(Outputs, PathBuf)> {
    let path = match &args.output {
        Some(path) => path.clone(),
        None if is_stream(&args.input) => args.input.clone(),
        None if is_address(&args.input) => {
            bail!("an address has no folder for the answer; name a file with -o")
        }
        None => args.input.with_extension("pvs"),
    };
    let mut outputs = Outputs::reading([&args.input])?;
    outputs.write("-o", Format::Visible, &path)?;
    let others = [
        ("--evidence", Format::Evidence, &args.evidence),
        ("--statistics", Format::Statistics, &args.statistics),
        ("--mutual", Format::Pairs, &args.mutual),
        ("--checkpoint", Format::Search, &args.checkpoint),
    ];
    for (option, format, other) in others {
        if let Some(other) = other {
            outputs.write(option, format, other)?;
        }
    }
    if let Some(into) = &args.into
        && (is_stream(into) || !is_same_file(into, &args.input))
    {
        outputs.write("--into", Format::World, into)?;
    }
    Ok((outputs, path))
}

fn compute(
    args: &Pvs,
    input: &Input,
    mut blocks: Option<&PieceFolder>,
) -> anyhow::Result<WorldVis> {
    let config = VisConfig {
        mode: args.mode.into(),
        far: args.far,
        max_memory: args.max_memory,
        max_specials: args.max_specials,
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
    // A search that cannot be saved goes on; the error is reported at its end.
    let mut unsaved = None;
    let mut save = |bytes: Vec<u8>| {
        if let Some(path) = &args.checkpoint {
            unsaved = write_whole(path, &bytes).err();
        }
    };
    let resume = args.checkpoint.as_deref().map(read_checkpoint);
    let checkpoint = VisCheckpoint {
        blocks: match &mut blocks {
            Some(blocks) => Some(blocks),
            None => None,
        },
        resume: resume.transpose()?.flatten(),
        salt: input.hash,
        every: match args.checkpoint {
            Some(_) => Duration::from_secs(30),
            None => Duration::MAX,
        },
        save: &mut save,
    };
    let mut context = VisContext {
        on_round: &mut on_round,
        walls: input.walls.as_deref(),
        checkpoint: Some(checkpoint),
    };
    let answer = pool(args)?.install(|| match &input.world {
        Some(world) => see_world(&world.graph, &config, &mut context),
        None => see_all(&input.graph, &config, &mut context).map(WorldVis::of),
    });
    bar.finish();
    let found = answer.with_context(|| match &args.checkpoint {
        Some(path) => format!("{}, {}", name_of(&args.input), path.display()),
        None => name_of(&args.input),
    })?;
    let unkept = blocks.and_then(PieceFolder::take_error);
    if let Some(error) = unsaved.or(unkept) {
        return Err(error.context("cannot save the search"));
    }
    if let Some(path) = &args.checkpoint
        && found.vis.is_complete
        && path.exists()
    {
        fs::remove_file(path).with_context(|| format!("cannot remove {}", path.display()))?;
    }
    Ok(found)
}

/// Adds the visible parts for each pair of cells: volumes, and their contents.
fn add_parts(
    args: &Pvs,
    world: &World,
    pvs: &mut cpg::Pvs,
    through: &cpg::Pvs,
) -> anyhow::Result<()> {
    let (volumes, parts) = pool(args)?.install(|| see_parts_through(world, pvs, through))?;
    pvs.parts = Some(parts);
    pvs.volumes = Some(volumes);
    Ok(())
}

fn pool(args: &Pvs) -> anyhow::Result<rayon::ThreadPool> {
    pool_of(args.threads)
}

pub(crate) fn pool_of(threads: Option<usize>) -> anyhow::Result<rayon::ThreadPool> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build()
        .context("cannot start threads; try --threads 1")
}

/// The saved search, if any.
fn read_checkpoint(path: &Path) -> anyhow::Result<Option<Vec<u8>>> {
    match fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error).with_context(|| format!("cannot read {}", path.display())),
    }
}

fn report(input: &Input, found: &WorldVis, took: Duration) -> PvsReport {
    let vis: &VisOutput = &found.vis;
    let world = input.world.as_ref();
    let has_specials = world.is_some_and(|w| !w.graph.specials.is_empty());
    let cells = vis.cells.n_cells();
    let pairs = vis.cells.n_pairs();
    let undecided = vis.undecided.n_pairs();
    let visible_cells: Vec<usize> = (0..cells as u32)
        .map(|c| vis.cells.n_visible_from(CellId(c)))
        .collect();
    let mut worst: Vec<usize> = (0..cells).collect();
    worst.sort_by_key(|&c| (std::cmp::Reverse(visible_cells[c]), c));
    worst.truncate(10);
    let mean = pairs as f64 / cells.max(1) as f64;
    let is_one_way = |&(a, b): &(CellId, CellId)| !vis.cells.sees(b, a);
    let one_way = match has_specials {
        true => vis.cells.pairs().filter(is_one_way).count(),
        false => 0,
    };
    PvsReport {
        cells,
        portals: input.graph.portals.len(),
        pairs,
        mean_visible: mean,
        mean_visible_percent: 100.0 * mean / cells.max(1) as f64,
        proved_visible: pairs - undecided,
        undecided,
        base_pairs: vis.n_base,
        complete: vis.is_complete,
        lines: vis.n_lines as usize,
        steps: vis.n_steps,
        specials: has_specials.then(|| SpecialChains {
            pairs: found.through.n_pairs(),
            chains: found.n_chains,
            cut_chains: found.n_cut,
        }),
        one_way,
        seconds: took.as_secs_f64(),
        mean_triangles: None,
        mean_triangles_of_cells: None,
        triangles: None,
        visible_cells,
        worst_names: worst.iter().map(|&c| input.name(c)).collect(),
        worst,
    }
}

/// Notes of the text file: only what is the same on every run.
fn notes(report: &PvsReport, mode: PvsMode) -> Vec<String> {
    let mode = match mode {
        PvsMode::Fast => "fast",
        PvsMode::Exact => "exact",
    };
    vec![
        format!("kind enfilade {}, {mode}", env!("CARGO_PKG_VERSION")),
        format!("portals {}", report.portals),
        format!("visible_pairs {}", report.pairs),
        format!("proved_visible_pairs {}", report.proved_visible),
        format!("mean_visible {:.3}", report.mean_visible),
        format!("mean_visible_percent {:.3}", report.mean_visible_percent),
        format!("asymmetric_pairs {}", report.one_way),
    ]
}

fn print(mut out: Box<dyn Write>, report: &PvsReport, is_json: bool) -> anyhow::Result<()> {
    if is_json {
        return print_json(out, report);
    }
    let r = report;
    let percent = |n: usize| 100.0 * n as f64 / r.pairs.max(1) as f64;
    writeln!(out, "{} cells, {} portals", r.cells, r.portals)?;
    writeln!(
        out,
        "{} pairs: a cell sees {:.1} cells on average, {:.1} % of all",
        r.pairs, r.mean_visible, r.mean_visible_percent
    )?;
    writeln!(
        out,
        "{:.1} % of the pairs proved, {} undecided; planes alone would leave {} pairs",
        percent(r.proved_visible),
        r.undecided,
        r.base_pairs
    )?;
    if let (Some(seen), Some(of_cells), Some(n)) =
        (r.mean_triangles, r.mean_triangles_of_cells, r.triangles)
    {
        let share = 100.0 * seen / n.max(1) as f64;
        writeln!(
            out,
            "a cell sees {seen:.0} of {n} triangles on average, {share:.1} %; the cells that it sees hold {of_cells:.0}"
        )?;
    }
    if let Some(s) = &r.specials {
        writeln!(
            out,
            "special portals: {} of the pairs through {} chains; {} more cut at the bound, of which all that they may lead to counts",
            s.pairs, s.chains, s.cut_chains
        )?;
    }
    if !r.complete {
        writeln!(
            out,
            "stopped by --budget: the answer is larger than necessary"
        )?;
    }
    let worst: Vec<String> = r
        .worst
        .iter()
        .zip(&r.worst_names)
        .map(|(&c, name)| format!("{name} ({})", r.visible_cells[c]))
        .collect();
    writeln!(out, "cells that see most: {}", worst.join(", "))?;
    writeln!(out, "{:.2} s", r.seconds)?;
    writeln!(
        out,
        "pair: a cell and one that counts as seen from it, itself included; proved: by a line of sight between them; undecided: \
         neither that nor its absence is proved; planes: the quick test on which the search improves"
    )?;
    out.flush().context("cannot write to standard output")
}

pub(crate) fn distance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x >= 0.0 => Ok(x),
        _ => Err("a distance of at least 0 is needed".into()),
    }
}
