//! A bake as a job: the rooms of each building apart from others.

use std::ffi::OsString;
use std::path::Path;

use anyhow::{Context, bail};
use clap::Parser;
use enfilade::bake::BakeContext;
use enfilade::internals::bake::{bake_pieces, is_piece, piece_keys};

use super::shards::{JobFinish, JobRun, Shards};
use crate::bake::{self, Bake, Readied};
use crate::pieces::PieceFolder;
use crate::progress::BakeBar;
use crate::pvs::pool_of;
use enfilade_cli::memory::held_memory;

/// A bake of one file.
pub(super) struct BakedJob {
    /// The command line but for the output.
    words: Vec<OsString>,
    max_memory: Option<u64>,
    readied: Readied,
}

/// The options of `enfilade bake` as a command line of their own.
#[derive(Parser)]
#[command(no_binary_name = true)]
struct BakeAlone {
    #[command(flatten)]
    bake: Bake,
}

impl BakedJob {
    pub(super) fn of(
        path: &Path,
        options: &[String],
        max_memory: Option<u64>,
    ) -> anyhow::Result<Self> {
        let mut words: Vec<OsString> = options.iter().map(OsString::from).collect();
        words.push(path.into());
        let options = parsed(&words, Path::new("-"), max_memory)?;
        bake::begin(&options.options, &[path.to_owned()])?;
        let readied = bake::readied(&options)?;
        if let Some(file) = readied.references.first() {
            bail!(
                "{} refers to {}: a job takes scenes in one file, such as a GLB",
                path.display(),
                file.display()
            );
        }
        Ok(Self {
            words,
            max_memory,
            readied,
        })
    }
}

/// Returns the options of a bake to `output`.
fn parsed(words: &[OsString], output: &Path, max_memory: Option<u64>) -> anyhow::Result<Bake> {
    let output = ["-o".into(), OsString::from(output)];
    let line = words.iter().cloned().chain(output);
    let mut bake = BakeAlone::try_parse_from(line)
        .context("options of `enfilade bake`")?
        .bake;
    bake.options.max_memory = bake.options.max_memory.or(max_memory);
    Ok(bake)
}

/// Pieces that are never there: for a plan.
struct Nowhere;

impl enfilade::bake::Pieces for Nowhere {
    fn get(&self, _key: &str) -> Option<Vec<u8>> {
        None
    }

    fn put(&self, _key: &str, _bytes: &[u8]) {}
}

impl Shards for BakedJob {
    fn keys(&self) -> anyhow::Result<Vec<String>> {
        let Readied { scene, config, .. } = &self.readied;
        let context = BakeContext::default().keeping(&Nowhere);
        Ok(piece_keys(scene, config, &context)?)
    }

    fn is_whole(&self, _shard: usize, key: &str, bytes: &[u8]) -> bool {
        is_piece(key, bytes)
    }

    fn compute(&self, wanted: &[usize], folder: &PieceFolder, args: &JobRun) -> anyhow::Result<()> {
        if wanted.is_empty() {
            return Ok(());
        }
        let Readied { scene, config, .. } = &self.readied;
        let bar = BakeBar::new(scene, config);
        let context = BakeContext::new(&bar, None)
            .measured_by(held_memory)
            .keeping(folder);
        let mut shard = 0..;
        let is_wanted = |_: &str| {
            let is_wanted = shard.next().is_some_and(|k| wanted.contains(&k));
            is_wanted && !folder.has_error()
        };
        let pool = pool_of(args.threads)?;
        pool.install(|| bake_pieces(scene, config, &context, is_wanted))?;
        Ok(())
    }

    fn finish(&self, folder: PieceFolder, args: &JobFinish) -> anyhow::Result<()> {
        if args.into.is_some() {
            bail!("--into is for visibility: a bake writes its world to -o");
        }
        let mut bake = parsed(&self.words, &args.output, self.max_memory)?;
        bake.json |= args.json;
        bake::run_with(&bake, Some(&folder))
    }
}
