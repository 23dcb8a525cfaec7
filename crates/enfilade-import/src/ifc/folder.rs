//! Temporary folders.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

/// A temporary folder, removed with its contents.
///
/// A file in it stays locked while this process lives; the folder of a killed run has a lock without an owner.
pub(super) struct Folder {
    pub(super) path: PathBuf,
    /// `None` once released.
    lock: Option<File>,
}

/// Prefix of the names of such folders.
const PREFIX: &str = "enfilade-ifc-";
const LOCK: &str = "lock";

impl Folder {
    pub(super) fn new(parent: &Path) -> std::io::Result<Self> {
        remove_left(parent);
        let mut n = 0_u32;
        loop {
            let path = parent.join(format!("{PREFIX}{}-{n}", std::process::id()));
            match fs::create_dir(&path) {
                Ok(()) => {}
                Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists && n < 1000 => {
                    n += 1;
                    continue;
                }
                Err(e) => return Err(e),
            }
            let lock = File::create(path.join(LOCK))?;
            // File systems without locks get none; there, no folder counts as left behind either.
            let is_taken = matches!(lock.try_lock(), Err(fs::TryLockError::WouldBlock));
            // Before it was locked, another run may have removed it as left behind.
            if !is_taken && path.join(LOCK).exists() {
                let lock = Some(lock);
                return Ok(Self { path, lock });
            }
            n += 1;
        }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // Some systems cannot remove an open file.
        drop(self.lock.take());
        // A folder that cannot be removed is left to the system.
        let _ = fs::remove_dir_all(&self.path);
    }
}

/// Removes the folders of killed runs. Linear in the parent folder.
fn remove_left(parent: &Path) {
    for entry in fs::read_dir(parent).into_iter().flatten().flatten() {
        let is_ours = entry
            .file_name()
            .to_str()
            .is_some_and(|n| n.starts_with(PREFIX));
        if !is_ours || !entry.file_type().is_ok_and(|t| t.is_dir()) {
            continue;
        }
        // A folder without a lock is just being made.
        if let Ok(lock) = File::open(entry.path().join(LOCK))
            && lock.try_lock().is_ok()
        {
            drop(lock);
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}
