//! Finished blocks of a large search, in a folder beside the answer, so that a run that was killed goes on from them.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::Context;
use enfilade::vis::VisBlocks;

use crate::output::write_whole;

const EXTENSION: &str = "block";

/// A folder with a file for each block, named by its key. Made when the first block is done.
pub(super) struct BlockFolder {
    path: PathBuf,
    /// The first block that could not be kept. The search goes on without.
    pub(super) error: Option<anyhow::Error>,
}

impl BlockFolder {
    pub(super) fn at(path: PathBuf) -> Self {
        Self { path, error: None }
    }

    /// Takes the folder that belongs to the answer `output`: its name with `.blocks` after it.
    pub(super) fn beside(output: &Path) -> Self {
        let mut name = output.file_name().unwrap_or_default().to_owned();
        name.push(".blocks");
        Self::at(output.with_file_name(name))
    }

    fn file(&self, key: u64) -> PathBuf {
        self.path.join(format!("{key:016x}.{EXTENSION}"))
    }

    /// Removes the blocks, and the folder if nothing else is in it.
    pub(super) fn remove(&self) -> anyhow::Result<()> {
        let cannot = || format!("cannot remove {}", self.path.display());
        let entries = match fs::read_dir(&self.path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
            entries => entries.with_context(cannot)?,
        };
        let mut has_others = false;
        for entry in entries {
            let path = entry.with_context(cannot)?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            // Also what a run that was killed left half written.
            if name.contains(&format!(".{EXTENSION}")) {
                fs::remove_file(&path).with_context(cannot)?;
            } else {
                has_others = true;
            }
        }
        if has_others {
            return Ok(());
        }
        fs::remove_dir(&self.path).with_context(cannot)
    }
}

impl VisBlocks for BlockFolder {
    fn get(&mut self, key: u64) -> Option<Vec<u8>> {
        fs::read(self.file(key)).ok()
    }

    fn put(&mut self, key: u64, bytes: &[u8]) {
        let made = fs::create_dir_all(&self.path)
            .with_context(|| format!("cannot make the folder {}", self.path.display()));
        if let Err(error) = made.and_then(|()| write_whole(&self.file(key), bytes)) {
            self.error.get_or_insert(error);
        }
    }
}
