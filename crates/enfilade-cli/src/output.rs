//! Writes files whole or not at all.

use std::collections::{HashMap, HashSet};
use std::ffi::{OsStr, OsString};
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

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

/// Standard error, for what is said beside the work. Where nobody reads it any more, as in `enfilade bake … 2>&1 | head -2`,
/// the work goes on.
pub(crate) struct Told;

impl Write for Told {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let _ = io::stderr().write_all(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// What a command reads and what it will write: no file is both, and none is written twice.
#[derive(Clone, Default)]
pub(crate) struct Outputs {
    /// By resolved path: an input as it was given, or the option of an output.
    known: HashMap<PathBuf, Known>,
}

#[derive(Clone)]
enum Known {
    Input(PathBuf),
    Output(&'static str),
}

impl Outputs {
    /// Of a command that reads these files.
    pub(crate) fn reading<'a>(inputs: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        let known = |path: &'a PathBuf| (resolved(path), Known::Input(path.clone()));
        Self {
            known: inputs.into_iter().map(known).collect(),
        }
    }

    /// Takes down what the inputs turned out to refer to. Refused where one of these is an output.
    pub(crate) fn read(&mut self, references: &[PathBuf]) -> anyhow::Result<()> {
        for path in references {
            let resolved = resolved(path);
            if let Some(Known::Output(option)) = self.known.get(&resolved) {
                bail!(
                    "the scene refers to {}, so that is the input, too; choose another name with {option}",
                    path.display()
                );
            }
            self.known.insert(resolved, Known::Input(path.clone()));
        }
        Ok(())
    }

    /// Takes down that `option` names a file to write. Refused where that is an input or another output, or cannot be
    /// written: asked before minutes of work are spent on what goes there.
    pub(crate) fn write(&mut self, option: &'static str, path: &Path) -> anyhow::Result<()> {
        self.write_all(option, &[path.to_owned()])
    }

    /// The same for several files of one folder, of which the first is tried.
    pub(crate) fn write_all(
        &mut self,
        option: &'static str,
        paths: &[PathBuf],
    ) -> anyhow::Result<()> {
        let mut names = HashSet::new();
        for path in paths {
            // What is a pipe or a terminal on both sides is no file that could be lost.
            if fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir()) {
                continue;
            }
            let resolved = resolved(path);
            match self.known.get(&resolved) {
                Some(Known::Input(input)) => bail!(
                    "{} is the input {}; choose another name with {option}",
                    path.display(),
                    input.display()
                ),
                Some(Known::Output(other)) => bail!(
                    "{} is to be written by {other}, too; choose another name with {option}",
                    path.display()
                ),
                None => {}
            }
            names.extend(resolved.file_name().map(OsStr::to_owned));
            self.known.insert(resolved, Known::Output(option));
        }
        if let Some(first) = paths.first() {
            check_target(first, option)?;
            remove_left(&resolved(first), &names);
        }
        Ok(())
    }
}

/// The file that a path means once links are followed; of one that does not exist, as its folder does.
fn resolved(path: &Path) -> PathBuf {
    let by_folder = || {
        let folder = path.parent()?;
        let folder = if folder.as_os_str().is_empty() {
            Path::new(".")
        } else {
            folder
        };
        Some(fs::canonicalize(folder).ok()?.join(path.file_name()?))
    };
    fs::canonicalize(path)
        .ok()
        .or_else(by_folder)
        .unwrap_or_else(|| path.to_owned())
}

pub(crate) fn is_same_file(a: &Path, b: &Path) -> bool {
    resolved(a) == resolved(b)
}

/// Removes what killed runs left beside `path` of files with these names. What a run is writing now is locked and stays.
fn remove_left(path: &Path, names: &HashSet<OsString>) {
    let Some(entries) = path.parent().and_then(|folder| fs::read_dir(folder).ok()) else {
        return;
    };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let of = name.to_str().and_then(|name| {
            let (of, process) = name
                .strip_prefix('.')?
                .strip_suffix(".tmp")?
                .rsplit_once('.')?;
            process.parse::<u32>().is_ok().then_some(of)
        });
        if of.is_some_and(|of| names.contains(OsStr::new(of))) {
            let is_left = File::open(entry.path()).is_ok_and(|f| f.try_lock().is_ok());
            if is_left {
                // One that cannot be removed does no harm but to take room.
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

/// Whether `path` can be written.
fn check_target(path: &Path, option: &str) -> anyhow::Result<()> {
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
                "cannot write {}: there is no folder {}; make it, or choose another place with {option}",
                path.display(),
                folder.display()
            ),
            None => format!(
                "cannot write {}; choose another place with {option}",
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
    // Tells other runs that it is not left over; a disk that has no locks does without.
    let _ = file.try_lock();
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

    #[test]
    fn what_a_killed_run_left_goes_and_what_another_writes_stays() {
        let dir = fresh_dir("left");
        for name in [
            ".w.glb.17.tmp",
            ".w.glb.x.tmp",
            ".v.glb.17.tmp",
            "w.glb.17.tmp",
        ] {
            fs::write(dir.join(name), b"half").unwrap();
        }
        let others = File::create(dir.join(".w.glb.18.tmp")).unwrap();
        others.lock().unwrap();
        Outputs::default().write("-o", &dir.join("w.glb")).unwrap();
        let is_there = |name: &str| dir.join(name).exists();
        assert!(!is_there(".w.glb.17.tmp"));
        for name in [
            ".w.glb.x.tmp",
            ".v.glb.17.tmp",
            "w.glb.17.tmp",
            ".w.glb.18.tmp",
        ] {
            assert!(is_there(name), "{name}");
        }
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
