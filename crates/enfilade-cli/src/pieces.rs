//! Finished pieces of long work, in a folder, so that a run that was killed goes on from them.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use anyhow::Context;
use enfilade::bake::Pieces;
use enfilade::vis::VisBlocks;
use enfilade::whole;

use crate::output::write_whole;

const EXTENSION: &str = "block";

/// A folder with a file for each piece, named by its key. Made when the first piece is done.
pub(crate) struct PieceFolder {
    path: PathBuf,
    /// The first piece that could not be kept. The work goes on without.
    error: Mutex<Option<anyhow::Error>>,
    /// Pieces that were asked for and there.
    n_found: AtomicUsize,
}

impl PieceFolder {
    pub(crate) fn at(path: PathBuf) -> Self {
        Self {
            path,
            error: Mutex::default(),
            n_found: AtomicUsize::new(0),
        }
    }

    /// Takes the folder that belongs to the answer `output`: its name with `.blocks` after it.
    pub(crate) fn beside(output: &Path) -> Self {
        let mut name = output.file_name().unwrap_or_default().to_owned();
        name.push(".blocks");
        Self::at(output.with_file_name(name))
    }

    fn file(&self, key: &str) -> PathBuf {
        self.path.join(format!("{key}.{EXTENSION}"))
    }

    /// Returns the number of pieces that were asked for and there.
    pub(crate) fn n_found(&self) -> usize {
        self.n_found.load(Ordering::Relaxed)
    }

    /// Returns the first error so far.
    pub(crate) fn take_error(&self) -> Option<anyhow::Error> {
        let mut error = self.error.lock().unwrap_or_else(PoisonError::into_inner);
        error.take()
    }

    pub(crate) fn has_error(&self) -> bool {
        let error = self.error.lock().unwrap_or_else(PoisonError::into_inner);
        error.is_some()
    }

    /// Removes what killed runs left half written of any piece.
    pub(crate) fn tidy(&self) {
        let names = fs::read_dir(&self.path).into_iter().flatten().flatten();
        let names = names.filter_map(|entry| entry.file_name().into_string().ok());
        let end = format!(".{EXTENSION}");
        let piece = |name: String| {
            let (key, _) = name.strip_prefix('.')?.split_once(&end)?;
            Some(self.file(key))
        };
        let pieces: Vec<PathBuf> = names.filter_map(piece).collect();
        whole::remove_left(&pieces);
    }

    /// Removes the pieces, and the folder if nothing else is in it.
    pub(crate) fn remove(&self) -> anyhow::Result<()> {
        let cannot = || format!("cannot remove {}", self.path.display());
        let entries = match fs::read_dir(&self.path) {
            Err(error)
                if [ErrorKind::NotFound, ErrorKind::NotADirectory].contains(&error.kind()) =>
            {
                return Ok(());
            }
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

impl Pieces for PieceFolder {
    fn get(&self, key: &str) -> Option<Vec<u8>> {
        let found = fs::read(self.file(key)).ok();
        let n = usize::from(found.is_some());
        self.n_found.fetch_add(n, Ordering::Relaxed);
        found
    }

    fn put(&self, key: &str, bytes: &[u8]) {
        let made = fs::create_dir_all(&self.path)
            .with_context(|| format!("cannot make the folder {}", self.path.display()));
        if let Err(error) = made.and_then(|()| write_whole(&self.file(key), bytes)) {
            let mut first = self.error.lock().unwrap_or_else(PoisonError::into_inner);
            first.get_or_insert(error);
        }
    }
}

/// Blocks of a search are named by 16 hexadecimal digits.
impl VisBlocks for &PieceFolder {
    fn get(&mut self, key: u64) -> Option<Vec<u8>> {
        Pieces::get(*self, &format!("{key:016x}"))
    }

    fn put(&mut self, key: u64, bytes: &[u8]) {
        Pieces::put(*self, &format!("{key:016x}"), bytes);
    }
}
