//! `enfilade job`: a bake, or visibility, computed in shards by any number of processes that share a folder.
//!
//! A job is a folder with a copy of the input, a manifest, and the shards that are done, each a file named by the hash of all
//! that it depends on. A shard's bytes are always the same, so it may be computed twice, copied, and merged in any
//! order.

mod baked;
mod seen;
mod shards;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use enfilade::bake::Pieces;
use enfilade::vis::VisConfig;
use enfilade::whole;
use enfilade::world::WalkMapKey;
use enfilade_cli::input::{is_stream, name_of, read};
use enfilade_cli::values::bytes;
use serde::{Deserialize, Serialize};

use crate::limits::watch;
use crate::pieces::PieceFolder;
use crate::pvs::{PvsMode, distance};
use crate::screen::{print_json, printed};
use baked::BakedJob;
use seen::SeenJob;
use shards::{JobFinish, JobRun, Shards};

const MANIFEST: &str = "manifest.json";
const SHARDS: &str = "shards";

/// Computes a bake, or visibility, in shards, by several processes or machines that share a folder: `plan`, then `run` anywhere,
/// and `finish`.
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

/// Divides the work into shards, and prints their keys, one a line. A scene is baked, a shard for each building of it; of a
/// world or a Quake portal file, it is found what is visible from where.
#[derive(clap::Args)]
struct JobPlan {
    /// Scene in one file, world written by `enfilade bake`, or Quake portal file; `-` for a portal file on standard input.
    input: PathBuf,
    /// Folder of the job; left as it is if the same job is there.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Visibility: thoroughness of the search [default: exact].
    #[arg(long, value_enum)]
    mode: Option<PvsMode>,
    /// Visibility: treat everything farther than this as hidden.
    #[arg(long, value_name = "DISTANCE", value_parser = distance)]
    far: Option<f64>,
    /// Most memory of a process that computes a shard, a number and K, M, G or T [default: 8G]. Less makes more shards of
    /// visibility.
    #[arg(long, value_name = "BYTES", value_parser = bytes)]
    max_memory: Option<u64>,
    /// Visibility: most special portals on one line of sight [default: 4].
    #[arg(long, value_name = "N")]
    max_specials: Option<u32>,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
    /// Bake: options of `enfilade bake` after `--`. Files that they name must be there on all machines.
    #[arg(last = true, value_name = "OPTIONS", allow_hyphen_values = true)]
    options: Vec<String>,
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

/// Settings of a job, and its shards.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Manifest {
    version: String,
    /// Name of the input's copy in the folder.
    input: String,
    max_memory: Option<u64>,
    #[serde(flatten)]
    work: Work,
    shards: Vec<String>,
    /// Sum of all of the above and of the input, against damage.
    sum: String,
}

/// The kind of work, and its settings.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum Work {
    Pvs {
        mode: PvsMode,
        far: Option<f64>,
        max_specials: u32,
    },
    /// Options of `enfilade bake`.
    Bake { options: Vec<String> },
}

/// Memory of a process that finds visibility, unless it is set. [Units: bytes]
const MEMORY: u64 = 8_000_000_000;

impl Manifest {
    /// Returns the sum of a manifest of this input.
    fn sum_of(&self, input: &[u8]) -> anyhow::Result<String> {
        // All fields, so that none is forgotten.
        let Self {
            version,
            input: name,
            max_memory,
            work,
            shards,
            sum: _,
        } = self;
        let input = WalkMapKey::hash(input);
        let text = serde_json::to_string(&(version, name, max_memory, work, shards, input))?;
        Ok(format!("{:016x}", WalkMapKey::hash(text.as_bytes())))
    }

    /// Opens the work on the input at `path`.
    fn work(&self, path: PathBuf, bytes: &[u8]) -> anyhow::Result<Box<dyn Shards>> {
        Ok(match &self.work {
            Work::Pvs {
                mode,
                far,
                max_specials,
            } => {
                let config = VisConfig {
                    mode: (*mode).into(),
                    far: *far,
                    max_memory: self.max_memory.unwrap_or(MEMORY),
                    max_specials: *max_specials,
                    ..VisConfig::default()
                };
                Box::new(SeenJob::of(path, bytes, *mode, config)?)
            }
            Work::Bake { options } => Box::new(BakedJob::of(&path, options, self.max_memory)?),
        })
    }
}

/// A job that is there.
struct Opened {
    manifest: Manifest,
    work: Box<dyn Shards>,
}

impl Opened {
    /// Opens a job. Refused if the shards are not those that this version would plan.
    fn at(dir: &Path) -> anyhow::Result<Self> {
        let manifest = manifest_of(dir)?;
        let path = dir.join(&manifest.input);
        let bytes = fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
        let refused = || {
            format!(
                "{}: planned by another version, or its input has changed; plan it again in a new folder",
                dir.display()
            )
        };
        if manifest.sum_of(&bytes)? != manifest.sum {
            bail!(refused());
        }
        let work = manifest.work(path, &bytes)?;
        if work.keys()? != manifest.shards {
            bail!(refused());
        }
        Ok(Self { manifest, work })
    }

    /// Returns the bytes of a shard in a folder, if it is there and whole.
    fn whole(&self, folder: &PieceFolder, shard: usize) -> Option<Vec<u8>> {
        let key = &self.manifest.shards[shard];
        let bytes = folder.get(key)?;
        self.work.is_whole(shard, key, &bytes).then_some(bytes)
    }

    /// Returns the shards that are not there, or damaged.
    fn missing(&self, folder: &PieceFolder) -> Vec<usize> {
        let shards = 0..self.manifest.shards.len();
        shards
            .filter(|&shard| self.whole(folder, shard).is_none())
            .collect()
    }
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
    let mut manifest = Manifest {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        input: String::new(),
        max_memory: args.max_memory,
        work: work_of(args, &bytes)?,
        shards: Vec::new(),
        sum: String::new(),
    };
    manifest.input = copy_name(&manifest.work, args, &bytes)?;
    let bytes = match manifest.work {
        Work::Pvs { .. } => bytes,
        // So far, the beginning was enough for formats of scenes.
        Work::Bake { .. } => fs::read(&args.input)
            .with_context(|| format!("cannot read {}", args.input.display()))?,
    };
    let work = manifest.work(args.input.clone(), &bytes)?;
    manifest.shards = work.keys()?;
    manifest.sum = manifest.sum_of(&bytes)?;
    if args.output.exists() {
        if manifest_of(&args.output).ok() != Some(manifest_copy(&manifest)?) {
            bail!(
                "{} is there already and holds something else; choose another folder",
                args.output.display()
            );
        }
        whole::remove_left(&[&args.output]);
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

/// Returns the work that an input calls for: visibility in a world or a portal file, else a bake.
fn work_of(args: &JobPlan, bytes: &[u8]) -> anyhow::Result<Work> {
    if seen::is_graph(&args.input, bytes) {
        if !args.options.is_empty() {
            bail!(
                "{} is baked already: options after `--` are for scenes that a job bakes",
                name_of(&args.input)
            );
        }
        return Ok(Work::Pvs {
            mode: args.mode.unwrap_or(PvsMode::Exact),
            far: args.far,
            max_specials: args
                .max_specials
                .unwrap_or(VisConfig::default().max_specials),
        });
    }
    let of_visibility = [
        ("--mode", args.mode.is_some()),
        ("--far", args.far.is_some()),
        ("--max-specials", args.max_specials.is_some()),
    ];
    if let Some((option, _)) = of_visibility.into_iter().find(|o| o.1) {
        bail!(
            "{} is a scene, to be baked: {option} is for visibility in a world that `enfilade bake` wrote",
            name_of(&args.input)
        );
    }
    Ok(Work::Bake {
        options: args.options.clone(),
    })
}

/// Returns the name of the input's copy. A scene keeps its name: it tells the format, and some formats name objects after it.
fn copy_name(work: &Work, args: &JobPlan, bytes: &[u8]) -> anyhow::Result<String> {
    if matches!(work, Work::Pvs { .. }) {
        let is_world = bytes.starts_with(b"glTF");
        return Ok(if is_world { "input.glb" } else { "input.prt" }.to_owned());
    }
    let name = args.input.file_name().and_then(|name| name.to_str());
    match name {
        Some(name) if !is_stream(&args.input) && is_copy_name(name) => Ok(name.to_owned()),
        _ => bail!(
            "{}: a job takes a scene in a file with a name of its own, such as town.glb",
            name_of(&args.input)
        ),
    }
}

/// Returns `true` if a file may have this name in a job's folder.
fn is_copy_name(name: &str) -> bool {
    Path::new(name).components().count() == 1 && ![MANIFEST, SHARDS, "..", "."].contains(&name)
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
    let manifest: Manifest = serde_json::from_slice(&text).with_context(|| {
        format!(
            "{}: damaged, or not a job of this command; plan it again",
            path.display()
        )
    })?;
    if !is_copy_name(&manifest.input) {
        bail!(
            "{}: not a job of this command; plan it again",
            path.display()
        );
    }
    Ok(manifest)
}

fn shards_in(dir: &Path) -> PieceFolder {
    PieceFolder::at(dir.join(SHARDS))
}

fn run_shards(args: &JobRun) -> anyhow::Result<()> {
    let job = Opened::at(&args.dir)?;
    let Manifest {
        max_memory, shards, ..
    } = &job.manifest;
    watch(None, *max_memory)?;
    if let Some(strange) = args.keys.iter().find(|key| !shards.contains(key)) {
        bail!(
            "{strange} is not a shard of {}; its manifest lists them",
            args.dir.display()
        );
    }
    let folder = shards_in(&args.dir);
    let is_asked = |shard: &usize| args.keys.is_empty() || args.keys.contains(&shards[*shard]);
    let mut left = job.missing(&folder);
    let n_missing = left.len();
    left.retain(is_asked);
    let n_asked = (0..shards.len()).filter(is_asked).count();
    job.work.compute(&left, &folder, args)?;
    folder.tidy();
    let done = ShardCounts {
        done: left.len(),
        there: n_asked - left.len(),
        missing: n_missing - left.len(),
    };
    report(&folder, &done, args.json, "computed")
}

fn merge(args: &JobMerge) -> anyhow::Result<()> {
    let job = Opened::at(&args.dir)?;
    for from in &args.from {
        if manifest_of(from)? != job.manifest {
            bail!(
                "{} and {} are different jobs",
                from.display(),
                args.dir.display()
            );
        }
    }
    let folder = shards_in(&args.dir);
    let left = job.missing(&folder);
    let mut n_copied = 0;
    for &shard in &left {
        let from = args.from.iter();
        let found = from
            .filter_map(|from| job.whole(&shards_in(from), shard))
            .next();
        if let Some(bytes) = found {
            folder.put(&job.manifest.shards[shard], &bytes);
            n_copied += 1;
        }
    }
    folder.tidy();
    let done = ShardCounts {
        done: n_copied,
        there: job.manifest.shards.len() - left.len(),
        missing: left.len() - n_copied,
    };
    report(&folder, &done, args.json, "copied")
}

fn report(
    folder: &PieceFolder,
    done: &ShardCounts,
    is_json: bool,
    word: &str,
) -> anyhow::Result<()> {
    if let Some(error) = folder.take_error() {
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
    let job = Opened::at(&args.dir)?;
    let folder = shards_in(&args.dir);
    let left = job.missing(&folder);
    if let Some(&first) = left.first() {
        bail!(
            "{} of {} shards are missing or damaged, such as {}; compute them with `enfilade job run {}`",
            left.len(),
            job.manifest.shards.len(),
            job.manifest.shards[first],
            args.dir.display()
        );
    }
    job.work.finish(folder, args)
}
