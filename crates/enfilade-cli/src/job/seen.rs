//! Visibility as a job: blocks of neighboring cells.

use std::path::{Path, PathBuf};
use std::time::Duration;

use enfilade::cpg::wire::is_world;
use enfilade::internals::vis::{VisPlan, plain_sight};
use enfilade::vis::{VisConfig, VisContext};

use super::shards::{JobFinish, JobRun, Shards};
use crate::pieces::PieceFolder;
use crate::progress::StageBar;
use crate::pvs::{self, Input, Pvs, PvsMode, input_of, pool_of};

/// Returns `true` for a world or a portal file; `path` may be `-`.
pub(super) fn is_graph(path: &Path, bytes: &[u8]) -> bool {
    if bytes.starts_with(b"glTF") {
        return is_world(bytes);
    }
    // Standard input has no extension; a portal file begins with its format's name.
    let is_named = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("prt"));
    is_named || bytes.starts_with(b"PRT1")
}

/// Visibility in a world or a portal file.
pub(super) struct SeenJob {
    path: PathBuf,
    input: Input,
    mode: PvsMode,
    config: VisConfig,
}

impl SeenJob {
    pub(super) fn of(
        path: PathBuf,
        bytes: &[u8],
        mode: PvsMode,
        config: VisConfig,
    ) -> anyhow::Result<Self> {
        Ok(Self {
            input: input_of(&path, bytes)?,
            path,
            mode,
            config,
        })
    }

    /// Does something with the plan.
    fn with_plan<T>(&self, then: impl FnOnce(&VisPlan<'_>) -> T) -> anyhow::Result<T> {
        let world = self.input.world.as_ref();
        let plain = world.map(|world| plain_sight(&world.graph));
        let graph = plain.as_ref().unwrap_or(&self.input.graph);
        Ok(then(&VisPlan::new(graph, &self.config, self.input.hash)?))
    }
}

impl Shards for SeenJob {
    fn keys(&self) -> anyhow::Result<Vec<String>> {
        self.with_plan(|plan| {
            let blocks = 0..plan.n_blocks();
            blocks.map(|b| format!("{:016x}", plan.key(b))).collect()
        })
    }

    fn is_whole(&self, shard: usize, _key: &str, bytes: &[u8]) -> bool {
        let is_block = self.with_plan(|plan| plan.is_block(shard, bytes));
        is_block.unwrap_or(false)
    }

    fn compute(&self, wanted: &[usize], folder: &PieceFolder, args: &JobRun) -> anyhow::Result<()> {
        use enfilade::vis::VisBlocks;
        let pool = pool_of(args.threads)?;
        self.with_plan(|plan| {
            let bar = StageBar::new();
            let mut has_begun = false;
            let mut context = VisContext {
                on_round: &mut |done, total| {
                    if !std::mem::replace(&mut has_begun, true) {
                        bar.start("searching", total);
                    }
                    bar.set(done);
                    !folder.has_error()
                },
                walls: self.input.walls.as_deref(),
                checkpoint: None,
            };
            let mut blocks = folder;
            pool.install(|| {
                plan.search(wanted, &mut context, &mut |block, bytes, is_complete| {
                    if is_complete {
                        VisBlocks::put(&mut blocks, plan.key(block), &bytes);
                    }
                })
            });
            bar.finish();
        })
    }

    fn finish(&self, folder: PieceFolder, args: &JobFinish) -> anyhow::Result<()> {
        let pvs = Pvs {
            input: self.path.clone(),
            output: Some(args.output.clone()),
            into: args.into.clone(),
            parts: false,
            volumes: false,
            mode: self.mode,
            budget: None::<Duration>,
            max_time: None,
            max_memory: self.config.max_memory,
            far: self.config.far,
            evidence: None,
            max_specials: self.config.max_specials,
            checkpoint: None,
            statistics: None,
            mutual: None,
            threads: None,
            json: args.json,
        };
        pvs::run_with(&pvs, Some(folder))
    }
}
