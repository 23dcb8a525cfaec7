//! Writes files whole or not at all.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;

/// Writes `bytes` to `path`: aside first, then renamed, so that a reader sees the old file or the
/// new one and never half of one, whatever happens in between.
///
/// Follows symbolic links. What exists and is no regular file (`/dev/stdout`, a named pipe) is
/// written to directly, because nothing can be renamed over it.
pub(crate) fn write_atomically(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    write(path, bytes).with_context(|| {
        format!(
            "cannot write {}; choose another place, or make room there",
            path.display()
        )
    })
}

/// Whether `path` can be written, asked before minutes of work are spent on what goes there.
pub(crate) fn check_target(path: &Path) -> anyhow::Result<()> {
    let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let try_it = || match fs::metadata(&path) {
        Ok(m) if m.is_dir() => Err(io::Error::other("it is a folder")),
        Ok(m) if !m.is_file() => Ok(()),
        _ => {
            let aside = aside(&path)?;
            File::create(&aside)?;
            fs::remove_file(&aside)
        }
    };
    try_it().with_context(|| {
        let missing = path
            .parent()
            .filter(|p| !p.as_os_str().is_empty() && !p.is_dir());
        match missing {
            Some(folder) => format!(
                "cannot write {}: there is no folder {}; make it, or choose another place with -o",
                path.display(),
                folder.display()
            ),
            None => format!(
                "cannot write {}; choose another place with -o",
                path.display()
            ),
        }
    })
}

fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    if fs::metadata(&path).is_ok_and(|m| !m.is_file() && !m.is_dir()) {
        return OpenOptions::new().write(true).open(&path)?.write_all(bytes);
    }
    let aside = aside(&path)?;
    let written = write_synced(&aside, bytes).and_then(|()| fs::rename(&aside, &path));
    if written.is_err() {
        // The first error is the one to report; a file that was never made cannot be removed.
        let _ = fs::remove_file(&aside);
    }
    written
}

/// A name in the same directory (a rename must not cross file systems), of this process alone.
fn aside(path: &Path) -> io::Result<PathBuf> {
    let name = path
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "it is no file name"))?;
    let mut hidden = OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{}.tmp", std::process::id()));
    Ok(path.with_file_name(hidden))
}

fn write_synced(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(bytes)?;
    file.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fresh_dir(name: &str) -> PathBuf {
        let dir =
            std::env::temp_dir().join(format!("enfilade-output-{}-{name}", std::process::id()));
        fs::create_dir_all(&dir).unwrap();
        dir
    }

    #[test]
    fn a_file_is_replaced_and_nothing_is_left_beside_it() {
        let dir = fresh_dir("replaced");
        let path = dir.join("w.glb");
        write_atomically(&path, b"old and longer").unwrap();
        write_atomically(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(fs::read_dir(&dir).unwrap().count(), 1);
        fs::remove_dir_all(&dir).unwrap();
    }

    #[test]
    fn a_failed_write_leaves_nothing() {
        let dir = fresh_dir("failed");
        // A directory cannot be replaced by a file.
        let path = dir.join("taken");
        fs::create_dir_all(path.join("full")).unwrap();
        let error = format!("{:#}", write_atomically(&path, b"new").unwrap_err());
        assert!(error.contains("taken"), "{error}");
        assert_eq!(fs::read_dir(&dir).unwrap().count(), 1);
        fs::remove_dir_all(&dir).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn a_symbolic_link_stays_one() {
        let dir = fresh_dir("link");
        let (target, link) = (dir.join("target"), dir.join("link"));
        fs::write(&target, b"old").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        write_atomically(&link, b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&target).unwrap(), b"new");
        fs::remove_dir_all(&dir).unwrap();
    }
}
