//! Work that is divided into shards, whatever its kind.

use std::path::PathBuf;

use crate::pieces::PieceFolder;

/// Computes shards that are not there yet.
#[derive(clap::Args)]
pub(super) struct JobRun {
    /// Folder of the job.
    pub(super) dir: PathBuf,
    /// Keys of shards; all that are missing if not given.
    pub(super) keys: Vec<String>,
    /// Number of threads; one per core if not given. The result is the same.
    #[arg(long, value_name = "N")]
    pub(super) threads: Option<usize>,
    /// Print JSON for machines.
    #[arg(long)]
    pub(super) json: bool,
}

/// Puts all shards together: the same bytes as `enfilade bake` or `enfilade pvs` on one machine.
#[derive(clap::Args)]
pub(super) struct JobFinish {
    /// Folder of the job.
    pub(super) dir: PathBuf,
    /// File for the result: a world, or visible cells as text; `-` for standard output.
    #[arg(short, long, value_name = "OUT")]
    pub(super) output: PathBuf,
    /// Visibility: write the world with the answer in it.
    #[arg(long, value_name = "OUT.glb")]
    pub(super) into: Option<PathBuf>,
    /// Print JSON for machines.
    #[arg(long)]
    pub(super) json: bool,
}

/// Work that is divided into shards.
pub(super) trait Shards {
    /// Returns the key of each shard.
    fn keys(&self) -> anyhow::Result<Vec<String>>;

    /// Returns `true` if these are the bytes of a whole shard, whose key is given, too.
    fn is_whole(&self, shard: usize, key: &str, bytes: &[u8]) -> bool;

    /// Computes some shards into a folder. What cannot be kept there is an error of the folder.
    fn compute(&self, wanted: &[usize], folder: &PieceFolder, args: &JobRun) -> anyhow::Result<()>;

    /// Writes the result from all shards.
    fn finish(&self, folder: PieceFolder, args: &JobFinish) -> anyhow::Result<()>;
}
