//! `enfilade rebake`: bakes again what changed in a scene, and keeps the rest of its world.

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, bail};
use enfilade::bake::BakeContext;
use enfilade::bake::rebake::{Rebaked, rebake};
use enfilade::cpg::CellId;
use serde::Serialize;

use crate::bake::{Summary, begin, found, print_summary, settings};
use crate::formats::Format;
use crate::output::{Outputs, Written, write_whole};
use crate::progress::{BakeBar, StageBar};
use crate::screen::{Told, Warned, print_json, write_lines};
use enfilade_cli::input::{import_scene, names_of};
use enfilade_cli::memory::held_memory;
use enfilade_cli::world::encode_whole;
use enfilade_cli::world::read_world;

/// Bakes again what changed between a world's scene and a new one, and keeps the rest, with the numbers of its cells.
///
/// The result is that of `bake` with the same options, up to numbers. Where a part is not enough, the whole scene is baked, and the
/// reason is told. Visible sets in the world are dropped.
#[derive(clap::Args)]
pub(crate) struct Rebake {
    /// World of the scene as it was; `-` for standard input.
    #[arg(value_name = "OLD.glb")]
    old: PathBuf,
    /// The scene as it is now, in any format of `bake`.
    #[arg(long, required = true, value_name = "NEW", num_args = 1..)]
    source: Vec<PathBuf>,
    /// World to write; `-` for standard output.
    #[arg(short, long, value_name = "OUT.glb")]
    output: PathBuf,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    options: settings::BakeOptions,
}

pub(crate) fn run(args: &Rebake) -> anyhow::Result<()> {
    let began = Instant::now();
    let options = &args.options;
    begin(options, &args.source)?;
    if let Some(option) = options.of_bakes_alone() {
        bail!("{option} is an option of bake; bake the new scene with it to see what is open");
    }
    let mut outputs = Outputs::reading(options.inputs(&args.source).chain([&args.old]))?;
    outputs.write("-o", Format::World, &args.output)?;
    let settings = settings::resolve(options)?;
    let old = read_world(&args.old)?;
    let bar = StageBar::new();
    bar.start("reading", 0);
    let mut imported = import_scene(&args.source, &options.detail, &settings.import)?;
    imported.scene.rooms.extend_from_slice(&settings.bake.names);
    bar.finish();
    outputs.read(&imported.report.references)?;
    found::refuse(&imported.report)?;
    found::report_import(&imported.scene, &imported.report, options.verbose)?;
    let scene = &imported.scene;
    let mut config = settings.bake.config_for(scene);
    config.budget.began = Some(began);

    let bar = BakeBar::new(scene, &config);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads.map_or(0, usize::from))
        .build()?;
    let context = BakeContext::new(&bar, None).measured_by(held_memory);
    let rebaked = pool.install(|| rebake(&old, scene, &config, &context));
    let mut rebaked = rebaked.with_context(|| names_of(&args.source))?;
    drop(bar);
    let told = &mut rebaked.world.graph.provenance.settings;
    told.extend(imported.report.settings.clone());
    let bytes =
        encode_whole(&mut rebaked.world).context("the new world breaks an invariant (a bug)")?;
    write_whole(&args.output, &bytes)?;
    for note in &rebaked.notes {
        write_lines(&mut Warned, note)?;
    }
    if options.verbose {
        for (stage, time) in &rebaked.times {
            writeln!(Told, "{:>20} {:>8.3} s", stage.name(), time.as_secs_f64())?;
        }
    }
    let report = RebakeReport::new(&rebaked, Written::new(&args.output, &bytes));
    let mut out = outputs.printed();
    if args.json {
        return print_json(out, &report);
    }
    print_summary(&mut out, &rebaked.world)?;
    if report.whole.is_none() {
        writeln!(out, "{:<16} {:>9}", "cells changed", report.changed.len())?;
    }
    writeln!(out, "{:<16} {:>9}", "cells gone", report.gone.len())?;
    writeln!(out, "{}", report.written)?;
    Ok(())
}

/// The output of `--json`.
#[derive(Serialize)]
struct RebakeReport {
    #[serde(flatten)]
    written: Written,
    #[serde(flatten)]
    summary: Summary,
    /// Names of cells that are new or in which something changed.
    changed: Vec<String>,
    /// Numbers of old cells that are gone.
    gone: Vec<u32>,
    /// Old and new number of the cells that moved into gaps.
    moved: Vec<[u32; 2]>,
    /// The reason why the whole scene was baked, if it was.
    whole: Option<String>,
    notes: Vec<String>,
}

impl RebakeReport {
    fn new(rebaked: &Rebaked, written: Written) -> Self {
        let graph = &rebaked.world.graph;
        let old = (0..).zip(&rebaked.cell_of);
        let moved = |(o, now): (u32, &Option<CellId>)| now.filter(|c| c.0 != o).map(|c| [o, c.0]);
        Self {
            written,
            summary: Summary::of(&rebaked.world),
            changed: rebaked
                .changed
                .iter()
                .map(|&c| graph[c].name.clone())
                .collect(),
            gone: old
                .clone()
                .filter(|(_, now)| now.is_none())
                .map(|(o, _)| o)
                .collect(),
            moved: old.filter_map(moved).collect(),
            whole: rebaked.whole.map(|why| why.to_string()),
            notes: rebaked.notes.clone(),
        }
    }
}
