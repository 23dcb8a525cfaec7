//! `enfilade bake`: makes a world from a scene.

mod advice;
mod cracks;
pub(crate) mod delaunay;
mod doorless;
pub(crate) mod found;
mod gaps;
mod leak_path;
mod leaking;
mod reasons;
pub(crate) mod settings;

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, bail};
use enfilade::bake::{BakeConfig, BakeContext, BakeOutput, Resolution, bake};
use enfilade::cpg::wire::decode_glb;
use enfilade::cpg::{PortalKind, World};
use enfilade::geom::scene::Scene;
use enfilade::geom::shown;
use enfilade::import::ImportReport;
use enfilade::internals::bake::delaunay::LEAST_BALL;
use enfilade::world::{Space, WalkMapKey};
use serde::Serialize;

use crate::formats::Format;
use crate::inspect::{write_holes, write_seals};
use crate::limits::watch_bake;
use crate::output::{Outputs, Written, write_whole};
use crate::pieces::PieceFolder;
use crate::progress::{BakeBar, StageBar};
use crate::screen::{Told, Warned, is_watched, print_json, write_lines};
use crate::specials::described;
use crate::walk::{self, Walks, WorldFile};
use enfilade_cli::input::{import_scene, is_stream, names_of};
use enfilade_cli::memory::held_memory;
use enfilade_cli::world::encode_whole;
use enfilade_report::{Verdict, is_empty};

/// Finds the rooms and doorways of a scene and writes them as a world.
#[derive(Clone, clap::Args)]
pub(crate) struct Bake {
    /// Scene files: GLB, glTF, OBJ, PLY, STL, Quake MAP, implicit scenes in JSON, volumes (NIfTI, NRRD), scans (E57, PLY), or IFC, which needs ifcopenshell (`pip install ifcopenshell`) or
    /// web-ifc (`npm install web-ifc`). Several become one scene; `-` is standard input.
    #[arg(required = true, value_name = "IN")]
    inputs: Vec<PathBuf>,
    /// World to write, one GLB; `-` for standard output.
    #[arg(short, long, value_name = "OUT.glb")]
    output: PathBuf,
    /// Keep a map of floors beside it, as OUT.walk, so that `path` and `view --living` start at once.
    #[arg(long)]
    walk: bool,
    /// Print JSON for machines.
    #[arg(long)]
    pub(crate) json: bool,
    /// Folder for finished pieces of the work: a bake that was killed goes on from them. Removed when the world is written.
    #[arg(long, value_name = "DIR")]
    checkpoint: Option<PathBuf>,
    /// Write the world although it has no room, as `--leak-path` does, too; otherwise, nothing is written then, and the
    /// exit code is 1.
    #[arg(long)]
    allow_empty: bool,
    #[command(flatten)]
    pub(crate) options: settings::BakeOptions,
}

pub(crate) fn run(args: &Bake) -> anyhow::Result<()> {
    begin(&args.options, &args.inputs)?;
    run_with(args, None)
}

/// Starts enforcing the limits of a bake of `scene`, also where nothing looks at them.
pub(crate) fn begin(options: &settings::BakeOptions, scene: &[PathBuf]) -> anyhow::Result<()> {
    watch_bake(&names_of(scene), options.max_time, options.max_memory)
}

/// A scene that is ready to be baked.
pub(crate) struct Readied {
    pub(crate) scene: Scene,
    pub(crate) config: BakeConfig,
    /// Other files that the scene refers to.
    pub(crate) references: Vec<PathBuf>,
    report: ImportReport,
}

/// Reads the scene and the settings.
///
/// # Errors
/// If they cannot be read, or a map leaks that should be sealed.
pub(crate) fn readied(args: &Bake) -> anyhow::Result<Readied> {
    let began = Instant::now();
    let settings = settings::resolve(&args.options)?;
    let bar = StageBar::new();
    bar.start("reading", 0);
    let imported = import_scene(&args.inputs, &args.options.detail, &settings.import)?;
    bar.finish();
    let (mut scene, report) = (imported.scene, imported.report);
    scene.rooms.extend_from_slice(&settings.bake.names);
    let config = settings.bake.config_for(&scene);
    scene.is_open_world |= leaking::is_open_world(args, &scene, &config)?;
    let mut config = settings.bake.config_for(&scene);
    config.budget.began = Some(began);
    config.costs.cost.check(&scene.materials)?;
    Ok(Readied {
        references: report.references.clone(),
        scene,
        config,
        report,
    })
}

/// Takes pieces of the bake from a folder that stays; or from that of `--checkpoint`, which goes when the world is written.
pub(crate) fn run_with(args: &Bake, kept: Option<&PieceFolder>) -> anyhow::Result<()> {
    let options = &args.options;
    let mut outputs = Outputs::reading(options.inputs(&args.inputs))?;
    outputs.write("-o", Format::World, &args.output)?;
    if args.walk {
        if is_stream(&args.output) {
            bail!("--walk writes a file beside the world; give -o a file, not '-'");
        }
        outputs.write("--walk", Format::Walk, &walk::beside(&args.output))?;
    }
    if let Some(path) = &options.leak {
        outputs.write("--leak", Format::Leak, path)?;
    }
    let readied = &readied(args)?;
    let Readied {
        scene,
        config,
        references,
        report,
    } = readied;
    outputs.read(references)?;
    found::refuse(report)?;
    found::report_import(scene, report, options.verbose)?;
    let mut leak_path = match options.leak_path {
        Some(from) => Some(leak_path::look_as_asked(
            scene,
            config,
            from,
            options.threads,
        )?),
        None => None,
    };
    let own = args.checkpoint.clone().map(PieceFolder::at);
    let pieces = kept.or(own.as_ref());
    if !scene.given_portals.is_empty() && !config.keeps_given {
        let n = scene.given_portals.len();
        writeln!(
            Told,
            "openings that a designer marked: {n} (--given portals puts portals there)"
        )?;
    }
    let name = || names_of(&args.inputs);
    let began = Instant::now();
    let baked = bake_scene(scene, config, options.threads, pieces);
    let mut baked = baked.with_context(name)?;
    if let Some(path) = &leak_path {
        baked.world.leak_path = path.points();
    } else if baked.n_indoors() == 0 {
        leak_path = Some(leak_path::look_unasked(scene, config, options.threads)?);
    }
    let told = &mut baked.world.graph.provenance.settings;
    told.extend(report.settings.clone());
    let verdict = advice::verdict(args, readied, &baked.world, began.elapsed())?;
    if is_empty(&baked.world) {
        let why = verdict.why();
        // Whoever asks for the way out wants to see it.
        if !args.allow_empty && options.leak_path.is_none() {
            report_bake(&baked, config, options.verbose)?;
            if let Some(path) = &leak_path {
                path.write(&mut path.says())?;
            }
            bail!(
                "{}: no room was found, and nothing was written: {why}; --allow-empty writes the world all the same",
                name()
            );
        }
        writeln!(Warned, "no room was found: {why}")?;
    }
    let bytes =
        encode_whole(&mut baked.world).context("the baked world breaks an invariant (a bug)")?;
    write_whole(&args.output, &bytes)?;
    if args.walk {
        // Readers get this world, rounded.
        let world = decode_glb(&bytes)?;
        let (space, walks) = (Space::new(world)?, Walks::usual());
        let file = WorldFile {
            path: &args.output,
            hash: WalkMapKey::hash(&bytes),
        };
        walk::keep(file, &space, &walks, &walks.map(&space))?;
    }
    if let Some(own) = own.filter(|_| kept.is_none()) {
        finish_pieces(&own)?;
    }
    report_bake(&baked, config, options.verbose)?;
    if let Some(path) = &leak_path {
        path.write(&mut path.says())?;
    }
    warn_of_separators(&baked.world)?;
    let mut out = outputs.printed();
    let written = Written::new(&args.output, &bytes);
    if args.json {
        return print_json(out, &BakeReport::new(&baked, written, verdict));
    }
    print_summary(&mut out, &baked.world)?;
    writeln!(out, "{written}")?;
    writeln!(out, "{verdict}")?;
    Ok(())
}

fn warn_of_separators(world: &World) -> io::Result<()> {
    if world.graph.statistics.counts.get("separators") == Some(&0.0) && world.graph.cells.len() > 1
    {
        writeln!(
            Warned,
            "no separator divides the scene: if it has rooms, their openings do not lie in planes of its surfaces; \
             --method watershed or delaunay does not need planes"
        )?;
    }
    Ok(())
}

/// Bakes on its own thread pool, with a progress line; reports the chosen method and the reason.
pub(crate) fn bake_scene(
    scene: &Scene,
    config: &BakeConfig,
    threads: Option<u16>,
    pieces: Option<&PieceFolder>,
) -> anyhow::Result<BakeOutput> {
    let bar = BakeBar::new(scene, config);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.map_or(0, usize::from))
        .build()?;
    let mut context = BakeContext::new(&bar, None).measured_by(held_memory);
    if let Some(pieces) = pieces {
        context = context.keeping(pieces);
    }
    let baked = pool.install(|| bake(scene, config, &context))?;
    drop(bar);
    Ok(baked)
}

/// Tells how far pieces helped, and removes them.
fn finish_pieces(pieces: &PieceFolder) -> anyhow::Result<()> {
    if pieces.n_found() > 0 {
        let n = pieces.n_found();
        let s = if n == 1 { "" } else { "s" };
        writeln!(Told, "went on from {n} piece{s} of an earlier bake")?;
    }
    if let Some(error) = pieces.take_error() {
        writeln!(Warned, "--checkpoint: {error:#}; the world is written")?;
    }
    pieces.remove()
}

/// Leaks with a line: those wide enough to be intended.
const LEAKS_SHOWN: usize = 10;

fn report_bake(baked: &BakeOutput, config: &BakeConfig, verbose: bool) -> anyhow::Result<()> {
    let mut err = Told;
    // The others are reported before the work.
    if let Resolution::Balls { radius } = baked.resolution {
        writeln!(
            err,
            "the points on surfaces resolve all air at least {radius:.3} m in radius"
        )?;
        let wanted = config.min_opening * LEAST_BALL;
        if radius > wanted {
            writeln!(
                Warned,
                "coarser than the {wanted:.3} m requested: the scene would need more points than fit in memory; \
                 narrower openings are found, but may get wrong weights"
            )?;
        }
    }
    for note in &baked.notes {
        write_lines(&mut Warned, note)?;
    }
    if verbose || is_watched() {
        for ((stage, time), (_, work)) in baked.times.iter().zip(&baked.work) {
            let (seconds, work) = (time.as_secs_f64(), *work as f64 / 1e6);
            writeln!(
                err,
                "{:>20} {seconds:>8.3} s {work:>8.1} M of work",
                stage.name()
            )?;
        }
    }
    if verbose {
        reasons::write_reasons(&mut err, &baked.world.graph)?;
    }
    gaps::write_gaps(&mut err, baked, LEAKS_SHOWN)?;
    cracks::write_cracks(&mut Warned, baked)?;
    let graph = &baked.world.graph;
    for special in graph.special_ids() {
        let name = shown(&graph.specials[special.idx()].name);
        writeln!(
            err,
            "'{name}' becomes {special}: {}",
            described(graph, special)
        )?;
    }
    write_seals(&mut err, &baked.world)?;
    write_holes(&mut err, &baked.world.graph, LEAKS_SHOWN)?;
    doorless::write_doorless(&mut Warned, &baked.world.graph)?;
    Ok(())
}

/// Counts of what was found.
#[derive(Serialize)]
pub(crate) struct Summary {
    triangles: usize,
    cells_indoors: usize,
    /// Those of them in which nobody can stand.
    voids: usize,
    /// Areas of open land.
    #[serde(skip_serializing_if = "is_zero")]
    areas_of_land: usize,
    portals: usize,
    doors: usize,
    windows: usize,
    open: usize,
    cracks: usize,
    detail_objects: usize,
    special_portals: usize,
}

fn is_zero(n: &usize) -> bool {
    *n == 0
}

impl Summary {
    pub(crate) fn of(world: &World) -> Self {
        let graph = &world.graph;
        let count = |kind| graph.portals.iter().filter(|p| p.kind == kind).count();
        let triangles = graph.statistics.counts.get("input_triangles");
        Self {
            triangles: triangles.copied().unwrap_or(0.0) as usize,
            cells_indoors: graph.cells.iter().filter(|c| c.is_indoors()).count(),
            areas_of_land: graph.cells.iter().filter(|c| c.is_land).count(),
            voids: graph.cells.iter().filter(|c| c.is_void).count(),
            portals: graph.portals.len(),
            doors: count(PortalKind::Door),
            windows: count(PortalKind::Window),
            open: count(PortalKind::Open),
            cracks: count(PortalKind::Crack),
            detail_objects: world.details.len(),
            special_portals: graph.specials.len(),
        }
    }
}

/// The summary as a table.
pub(crate) fn print_summary(out: &mut impl Write, world: &World) -> io::Result<()> {
    let summary = Summary::of(world);
    for (name, n) in [
        ("triangles", summary.triangles),
        ("cells indoors", summary.cells_indoors),
        ("portals", summary.portals),
        ("  doors", summary.doors),
        ("  windows", summary.windows),
        ("  open", summary.open),
        ("  cracks", summary.cracks),
        ("detail objects", summary.detail_objects),
    ] {
        writeln!(out, "{name:<16} {n:>9}")?;
    }
    // Few worlds have any.
    for (name, n) in [
        ("voids", summary.voids),
        ("areas of land", summary.areas_of_land),
        ("special portals", summary.special_portals),
    ] {
        if n > 0 {
            writeln!(out, "{name:<16} {n:>9}")?;
        }
    }
    Ok(())
}

/// The output of `--json`.
#[derive(Serialize)]
struct BakeReport<'a> {
    #[serde(flatten)]
    written: Written,
    #[serde(flatten)]
    summary: Summary,
    method: &'static str,
    notes: &'a [String],
    /// Gaps in the model that became portals.
    gaps: usize,
    /// Seconds of each stage.
    seconds: BTreeMap<&'static str, f64>,
    verdict: Verdict,
}

impl<'a> BakeReport<'a> {
    fn new(baked: &'a BakeOutput, written: Written, verdict: Verdict) -> Self {
        let times = baked.times.iter();
        Self {
            written,
            summary: Summary::of(&baked.world),
            method: baked.method.name(),
            notes: &baked.notes,
            gaps: baked.leaks.len(),
            seconds: times.map(|(s, t)| (s.name(), t.as_secs_f64())).collect(),
            verdict,
        }
    }
}
