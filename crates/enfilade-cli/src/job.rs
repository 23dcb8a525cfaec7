//! `enfilade job`: visibility computed in shards, by any number of processes that share a folder.
//!
//! A job is a folder with a copy of the input, a manifest, and the shards that are done, each a file named by the hash of all
//! that it depends on. A shard's bytes are always the same, so it may be computed twice, copied, and merged in any
//! order.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context, bail};
use enfilade::vis::{VisBlocks, VisConfig, VisContext, VisPlan, plain_sight};
use enfilade::whole;
use enfilade_cli::input::{name_of, read};
use enfilade_cli::values::bytes;
use serde::{Deserialize, Serialize};

use super::blocks::BlockFolder;
use super::{Input, Pvs, PvsMode, distance, input_of, pool_of, run_with};
use crate::limits::watch;
use crate::progress::StageBar;
use crate::screen::{print_json, printed};

const MANIFEST: &str = "manifest.json";

/// Computes visibility in shards, by several processes or machines that share a folder: `plan`, then `run` anywhere, and
/// `finish`.
#[derive(clap::Args)]
pub(crate) struct Job {
    #[command(subcommand)]
    step: JobStep,
}

#[derive(clap::Subcommand)]
enum JobStep {
    Plan(JobPlan),
    Run(JobRun),
    Merge(JobMerge),
    Finish(JobFinish),
}

/// Divides the work for a world or a Quake portal file into shards, and prints their keys, one a line.
#[derive(clap::Args)]
struct JobPlan {
    /// World written by `enfilade bake`, or Quake portal file; `-` for standard input.
    input: PathBuf,
    /// Folder of the job; left as it is if the same job is there.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Thoroughness of the search.
    #[arg(long, value_enum, default_value_t = PvsMode::Exact)]
    mode: PvsMode,
    /// Treat everything farther than this as hidden.
    #[arg(long, value_name = "DISTANCE", value_parser = distance)]
    far: Option<f64>,
    /// Most memory of a process that computes a shard: a number and K, M, G or T. Less makes more shards.
    #[arg(long, value_name = "BYTES", default_value = "8G", value_parser = bytes)]
    max_memory: u64,
    /// Most special portals on one line of sight.
    #[arg(long, value_name = "N", default_value_t = VisConfig::default().max_specials)]
    max_specials: u32,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
}

/// Computes shards that are not there yet.
#[derive(clap::Args)]
struct JobRun {
    /// Folder of the job.
    dir: PathBuf,
    /// Keys of shards; all that are missing if not given.
    keys: Vec<String>,
    /// Number of threads; one per core if not given. The result is the same.
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
}

/// Copies shards from other folders of the same job. Any order and grouping gives the same folder.
#[derive(clap::Args)]
struct JobMerge {
    /// Folder of the job.
    dir: PathBuf,
    /// Other folders of it.
    #[arg(required = true)]
    from: Vec<PathBuf>,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
}

/// Puts all shards together: the same bytes as `enfilade pvs` on one machine.
#[derive(clap::Args)]
struct JobFinish {
    /// Folder of the job.
    dir: PathBuf,
    /// File for the answer, as text; `-` for standard output.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Write the world with the answer in it.
    #[arg(long, value_name = "OUT.glb")]
    into: Option<PathBuf>,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
}

/// Settings of a job, and its shards.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Manifest {
    kind: String,
    version: String,
    /// Name of the input's copy in the folder.
    input: String,
    mode: PvsMode,
    far: Option<f64>,
    max_memory: u64,
    max_specials: u32,
    shards: Vec<String>,
}

/// Counts of a step.
#[derive(Serialize)]
struct ShardCounts {
    done: usize,
    there: usize,
    missing: usize,
}

pub(crate) fn run(args: &Job) -> anyhow::Result<()> {
    match &args.step {
        JobStep::Plan(args) => plan(args),
        JobStep::Run(args) => run_shards(args),
        JobStep::Merge(args) => merge(args),
        JobStep::Finish(args) => finish(args),
    }
}

fn plan(args: &JobPlan) -> anyhow::Result<()> {
    let bytes = read(&args.input)?;
    let input = input_of(&args.input, &bytes)?;
    let extension = if input.world.is_some() { "glb" } else { "prt" };
    let mut manifest = Manifest {
        kind: "pvs".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        input: format!("input.{extension}"),
        mode: args.mode,
        far: args.far,
        max_memory: args.max_memory,
        max_specials: args.max_specials,
        shards: Vec::new(),
    };
    manifest.shards = with_plan(&manifest, &input, |plan| Ok(keys_of(plan)))
        .with_context(|| name_of(&args.input))?;
    if args.output.exists() {
        if manifest_of(&args.output).ok() != Some(manifest_copy(&manifest)?) {
            bail!(
                "{} is there already and holds something else; choose another folder",
                args.output.display()
            );
        }
    } else {
        let text = serde_json::to_string_pretty(&manifest)?;
        let files = [(MANIFEST, text.as_bytes()), (&manifest.input, &bytes[..])];
        whole::write_folder(&args.output, files)
            .with_context(|| format!("cannot write {}", args.output.display()))?;
    }
    let mut out = printed();
    if args.json {
        return print_json(out, &manifest);
    }
    for key in &manifest.shards {
        writeln!(out, "{key}")?;
    }
    out.flush().context("cannot write to standard output")
}

/// The manifest as it comes back from its file.
fn manifest_copy(manifest: &Manifest) -> anyhow::Result<Manifest> {
    Ok(serde_json::from_str(&serde_json::to_string(manifest)?)?)
}

fn manifest_of(dir: &Path) -> anyhow::Result<Manifest> {
    let path = dir.join(MANIFEST);
    let text = fs::read(&path).with_context(|| {
        format!(
            "cannot read {}; make the job with `enfilade job plan`",
            path.display()
        )
    })?;
    let manifest: Manifest =
        serde_json::from_slice(&text).with_context(|| format!("{}: damaged", path.display()))?;
    let name = &manifest.input;
    if !["input.glb", "input.prt"].contains(&name.as_str()) || manifest.kind != "pvs" {
        bail!(
            "{}: not a job of this command; plan it again",
            path.display()
        );
    }
    Ok(manifest)
}

/// The manifest of a job and its input. Refused if the shards are not those that this version would plan.
fn open(dir: &Path) -> anyhow::Result<(Manifest, Input)> {
    let manifest = manifest_of(dir)?;
    let path = dir.join(&manifest.input);
    let input = input_of(&path, &read(&path)?)?;
    let keys = with_plan(&manifest, &input, |plan| Ok(keys_of(plan)))?;
    if keys != manifest.shards {
        bail!(
            "{}: planned by another version, or its input has changed; plan it again in a new folder",
            dir.display()
        );
    }
    Ok((manifest, input))
}

fn config_of(manifest: &Manifest) -> VisConfig {
    VisConfig {
        mode: manifest.mode.into(),
        far: manifest.far,
        max_memory: manifest.max_memory,
        max_specials: manifest.max_specials,
        ..VisConfig::default()
    }
}

/// Does something with the plan of a job.
fn with_plan<T>(
    manifest: &Manifest,
    input: &Input,
    then: impl FnOnce(&VisPlan<'_>) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let config = config_of(manifest);
    let plain = input.world.as_ref().map(|world| plain_sight(&world.graph));
    let graph = plain.as_ref().unwrap_or(&input.graph);
    then(&VisPlan::new(graph, &config, input.hash)?)
}

fn keys_of(plan: &VisPlan<'_>) -> Vec<String> {
    let blocks = 0..plan.n_blocks();
    blocks.map(|b| format!("{:016x}", plan.key(b))).collect()
}

fn shards(dir: &Path) -> BlockFolder {
    BlockFolder::at(dir.join("shards"))
}

/// Returns the blocks that are not there, or damaged.
fn missing(plan: &VisPlan<'_>, folder: &mut BlockFolder) -> Vec<usize> {
    let is_there = |folder: &mut BlockFolder, block| {
        let bytes = folder.get(plan.key(block));
        bytes.is_some_and(|bytes| plan.is_block(block, &bytes))
    };
    (0..plan.n_blocks())
        .filter(|&block| !is_there(folder, block))
        .collect()
}

fn run_shards(args: &JobRun) -> anyhow::Result<()> {
    let (manifest, input) = open(&args.dir)?;
    watch(None, Some(manifest.max_memory))?;
    let strange = args.keys.iter().find(|key| !manifest.shards.contains(key));
    if let Some(key) = strange {
        bail!(
            "{key} is not a shard of {}; its manifest lists them",
            args.dir.display()
        );
    }
    let mut folder = shards(&args.dir);
    let pool = pool_of(args.threads)?;
    let done = with_plan(&manifest, &input, |plan| {
        let is_asked =
            |block: &usize| args.keys.is_empty() || args.keys.contains(&manifest.shards[*block]);
        let mut left = missing(plan, &mut folder);
        let n_missing = left.len();
        left.retain(is_asked);
        let n_asked = (0..plan.n_blocks()).filter(is_asked).count();
        let bar = StageBar::new();
        let mut has_begun = false;
        let is_full = AtomicBool::new(false);
        let mut context = VisContext {
            on_round: &mut |done, total| {
                if !std::mem::replace(&mut has_begun, true) {
                    bar.start("searching", total);
                }
                bar.set(done);
                !is_full.load(Ordering::Relaxed)
            },
            walls: input.walls.as_deref(),
            checkpoint: None,
        };
        pool.install(|| {
            plan.search(&left, &mut context, &mut |block, bytes, is_complete| {
                if is_complete {
                    folder.put(plan.key(block), &bytes);
                    is_full.store(folder.error.is_some(), Ordering::Relaxed);
                }
            })
        });
        bar.finish();
        Ok(ShardCounts {
            done: left.len(),
            there: n_asked - left.len(),
            missing: n_missing - left.len(),
        })
    })?;
    report(folder, &done, args.json, "computed")
}

fn merge(args: &JobMerge) -> anyhow::Result<()> {
    let (manifest, input) = open(&args.dir)?;
    for from in &args.from {
        if manifest_of(from)? != manifest {
            bail!(
                "{} and {} are different jobs",
                from.display(),
                args.dir.display()
            );
        }
    }
    let mut folder = shards(&args.dir);
    let done = with_plan(&manifest, &input, |plan| {
        let left = missing(plan, &mut folder);
        let mut n_copied = 0;
        for &block in &left {
            let found = args.from.iter().find_map(|from| {
                let bytes = shards(from).get(plan.key(block));
                bytes.filter(|bytes| plan.is_block(block, bytes))
            });
            if let Some(bytes) = found {
                folder.put(plan.key(block), &bytes);
                n_copied += 1;
            }
        }
        Ok(ShardCounts {
            done: n_copied,
            there: plan.n_blocks() - left.len(),
            missing: left.len() - n_copied,
        })
    })?;
    report(folder, &done, args.json, "copied")
}

fn report(
    folder: BlockFolder,
    done: &ShardCounts,
    is_json: bool,
    word: &str,
) -> anyhow::Result<()> {
    if let Some(error) = folder.error {
        return Err(error);
    }
    let mut out = printed();
    if is_json {
        return print_json(out, done);
    }
    writeln!(
        out,
        "{} shards {word}, {} there before; {} are missing",
        done.done, done.there, done.missing
    )?;
    out.flush().context("cannot write to standard output")
}

fn finish(args: &JobFinish) -> anyhow::Result<()> {
    let (manifest, input) = open(&args.dir)?;
    let mut folder = shards(&args.dir);
    let left = with_plan(&manifest, &input, |plan| Ok(missing(plan, &mut folder)))?;
    if let Some(&first) = left.first() {
        bail!(
            "{} of {} shards are missing or damaged, such as {}; compute them with `enfilade job run {}`",
            left.len(),
            manifest.shards.len(),
            manifest.shards[first],
            args.dir.display()
        );
    }
    let pvs = Pvs {
        input: args.dir.join(&manifest.input),
        output: Some(args.output.clone()),
        into: args.into.clone(),
        parts: false,
        volumes: false,
        mode: manifest.mode,
        budget: None::<Duration>,
        max_time: None,
        max_memory: manifest.max_memory,
        far: manifest.far,
        evidence: None,
        max_specials: manifest.max_specials,
        checkpoint: None,
        statistics: None,
        mutual: None,
        threads: None,
        json: args.json,
    };
    run_with(&pvs, Some(folder))
}
