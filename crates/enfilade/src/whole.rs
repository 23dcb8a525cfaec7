//! Writing of files, whole or not at all.
//!
//! Data goes first to a file beside the target, `.NAME.PROCESS-TIME.tmp`, which is locked while it is written and
//! then renamed, and so are folders. A killed run leaves such a file or folder behind, unlocked; [`remove_left`] recognizes it by
//! the missing lock.
//! [`save`](crate::save) and the command `enfilade` follow this rule; files beside a world may do so, too.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Most names tried beside a target. All differ; another process may remove a few, taken for leftovers between
/// creation and locking.
const MOST_TRIES: usize = 100;

/// Writes `bytes` to a file beside `path` and renames it, so that a reader sees the old file or the new one and never
/// a part, whatever happens in between.
///
/// [Follows](followed) symbolic links. An existing target that is not a regular file (`/dev/stdout`, a named pipe) is
/// written directly, because nothing can be renamed over it. Several threads and processes may write to one path: the
/// last one's file stays.
///
/// # Errors
///
/// If the file cannot be written; the earlier file then stays as it was.
pub fn write(path: impl AsRef<Path>, bytes: &[u8]) -> io::Result<()> {
    write_with(path, |out| out.write_all(bytes))
}

/// Like [`write()`], for data made while it is written; `fill` should write many bytes at a time.
///
/// # Errors
///
/// Those of [`write()`] and of `fill`; the earlier file then stays as it was.
pub fn write_with<E: From<io::Error>>(
    path: impl AsRef<Path>,
    fill: impl FnOnce(&mut dyn Write) -> Result<(), E>,
) -> Result<(), E> {
    let path = followed(path);
    if fs::metadata(&path).is_ok_and(|m| !m.is_file() && !m.is_dir()) {
        return fill(&mut OpenOptions::new().write(true).open(&path)?);
    }
    let (aside, mut file) = open_aside(&path)?;
    let filled = fill(&mut file).and_then(|()| Ok(file.sync_all()?));
    // Holds the lock until the file has the target's name, so that no process takes it for a leftover.
    let written = filled.and_then(|()| Ok(fs::rename(&aside, &path)?));
    if written.is_err() {
        // The first error is the one to report.
        let _ = fs::remove_file(&aside);
    }
    written
}

/// Writes files, by their paths in it, to a folder beside `path` and renames that, so that a reader sees the old folder or the
/// new one and never a part; between the two there is none for a moment. Replaces what is at `path`. A killed run leaves a folder
/// `.NAME.PROCESS-TIME.tmp`, which the next call for the path that succeeds [removes](remove_left).
///
/// # Errors
///
/// If a file cannot be written; the earlier folder then stays as it was.
pub fn write_folder<P: AsRef<Path>, B: AsRef<[u8]>>(
    path: impl AsRef<Path>,
    files: impl IntoIterator<Item = (P, B)>,
) -> io::Result<()> {
    let path = followed(path);
    let (new, lock) = make_aside(&path)?;
    let fill = || {
        for (name, bytes) in files {
            let name = new.join(name);
            fs::create_dir_all(folder_of(&name))?;
            let mut file = File::create(name)?;
            file.write_all(bytes.as_ref())?;
            file.sync_all()?;
        }
        replace(&new, &path)
    };
    let written = fill();
    drop(lock);
    match written {
        Ok(()) => remove_left(&[&path]),
        // The first error is the one to report.
        Err(_) => drop(fs::remove_dir_all(&new)),
    }
    written
}

/// Makes a folder beside a path, for this call alone, and locks it on systems that lock folders.
fn make_aside(path: &Path) -> io::Result<(PathBuf, Option<File>)> {
    for _ in 0..MOST_TRIES {
        let aside = aside(path)?;
        match fs::create_dir(&aside) {
            Err(e) if e.kind() == ErrorKind::AlreadyExists => continue,
            made => made?,
        }
        let lock = File::open(&aside).ok();
        let is_taken = |lock: &File| matches!(lock.try_lock(), Err(fs::TryLockError::WouldBlock));
        // Another process may have removed it as a leftover before it was locked.
        if !lock.as_ref().is_some_and(is_taken) && aside.exists() {
            return Ok((aside, lock));
        }
    }
    Err(no_name())
}

fn no_name() -> io::Error {
    io::Error::new(ErrorKind::AlreadyExists, "no name beside it is free")
}

/// Puts a folder in the place of another, which goes.
fn replace(new: &Path, path: &Path) -> io::Result<()> {
    if !path.is_dir() {
        return fs::rename(new, path);
    }
    let old = aside(path)?;
    fs::rename(path, &old)?;
    if let Err(error) = fs::rename(new, path) {
        fs::rename(&old, path)?;
        return Err(error);
    }
    fs::remove_dir_all(old)
}

/// Tests if [`write()`] to `path` could create its file: makes the file beside it and removes it again. Leaves `path`
/// alone.
///
/// # Errors
///
/// The obstacle: a folder that is missing or read-only, or a `path` that is a folder.
pub fn try_write(path: impl AsRef<Path>) -> io::Result<()> {
    let path = followed(path);
    match fs::metadata(&path) {
        // A link that remains after following leads in a circle.
        Err(_) if path.is_symlink() => {
            Err(io::Error::other("it is a link that leads back to itself"))
        }
        Ok(m) if m.is_dir() => Err(io::Error::other("it is a folder")),
        Ok(m) if !m.is_file() => Ok(()),
        _ => {
            let (aside, file) = open_aside(&path)?;
            drop(file);
            fs::remove_file(&aside)
        }
    }
}

/// Removes files and folders that killed runs left beside these paths, which lie in one folder. One that a run is
/// writing now is locked and stays; so do folders on systems that lock none (Windows). Linear in the size of the folder.
///
/// Skips what it cannot remove: they only take disk space.
pub fn remove_left<P: AsRef<Path>>(paths: &[P]) {
    let paths: Vec<PathBuf> = paths.iter().map(followed).collect();
    let Some(entries) = paths.first().and_then(|p| fs::read_dir(folder_of(p)).ok()) else {
        return;
    };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let target = name.to_str().and_then(target_of).map(OsStr::new);
        if target.is_none() || !paths.iter().any(|p| p.file_name() == target) {
            continue;
        }
        // A pipe of such a name is not ours, and opening it would wait.
        let Ok(kind) = entry.file_type() else {
            continue;
        };
        if (kind.is_file() || kind.is_dir())
            && let Ok(file) = File::open(entry.path())
            && file.try_lock().is_ok()
        {
            let remove = if kind.is_dir() {
                fs::remove_dir_all
            } else {
                fs::remove_file
            };
            let _ = remove(entry.path());
        }
    }
}

/// Longest chain of links; systems follow about as many.
const MOST_LINKS: usize = 40;

/// Returns the file that a path denotes after following links, including a link to a file that does not exist yet.
/// For links in a circle, returns the path itself.
pub fn followed(path: impl AsRef<Path>) -> PathBuf {
    let path = path.as_ref();
    let mut at = path.to_owned();
    for _ in 0..MOST_LINKS {
        if let Ok(found) = fs::canonicalize(&at) {
            return found;
        }
        match fs::read_link(&at) {
            // Relative to the folder of the link.
            Ok(target) => at = folder_of(&at).join(target),
            // The file does not exist. Links may lead to its folder, too.
            Err(_) => {
                let name = at.file_name().map(OsStr::to_owned);
                let folder = fs::canonicalize(folder_of(&at)).ok();
                return folder
                    .zip(name)
                    .map_or(at, |(folder, name)| folder.join(name));
            }
        }
    }
    path.to_owned()
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Makes a file in the same folder (a rename must not cross file systems), for this call alone, and locks it.
fn open_aside(path: &Path) -> io::Result<(PathBuf, File)> {
    for _ in 0..MOST_TRIES {
        let aside = aside(path)?;
        let file = match OpenOptions::new().write(true).create_new(true).open(&aside) {
            Ok(file) => file,
            // Another thread's, of the same moment.
            Err(e) if e.kind() == ErrorKind::AlreadyExists => continue,
            Err(e) => return Err(e),
        };
        // On a file system without locks, work on without; leftovers are not recognized there either.
        let is_taken = matches!(file.try_lock(), Err(fs::TryLockError::WouldBlock));
        // Another process may have removed it as a leftover before it was locked.
        if !is_taken && aside.exists() {
            return Ok((aside, file));
        }
    }
    Err(no_name())
}

/// Returns a fresh name: a process that looks up a name long after its file is gone must not find another file.
fn aside(path: &Path) -> io::Result<PathBuf> {
    let name = path
        .file_name()
        .ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "it is not a file name"))?;
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    let time = since.unwrap_or_default().as_nanos();
    let mut hidden = OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{}-{time}.tmp", std::process::id()));
    Ok(path.with_file_name(hidden))
}

/// Returns the name of the target from the name of the file written beside it.
fn target_of(name: &str) -> Option<&str> {
    let (target, process) = name
        .strip_prefix('.')?
        .strip_suffix(".tmp")?
        .rsplit_once('.')?;
    let (process, time) = process.split_once('-')?;
    let is_number = |text: &str| text.parse::<u128>().is_ok();
    (is_number(process) && is_number(time)).then_some(target)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fresh_folder(name: &str) -> PathBuf {
        let folder =
            std::env::temp_dir().join(format!("enfilade-whole-{}-{name}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[test]
    fn a_file_is_replaced_and_nothing_is_left_beside_it() {
        let folder = fresh_folder("replaced");
        let path = folder.join("w.glb");
        write(&path, b"old and longer").unwrap();
        write(&path, b"new").unwrap();
        try_write(&path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_folder_is_replaced_whole_or_stays() {
        let folder = fresh_folder("folder");
        let path = folder.join("w.enf");
        write_folder(&path, [("a/b", "old"), ("c", "gone")]).unwrap();
        write_folder(&path, [("a/b", "new")]).unwrap();
        assert_eq!(fs::read(path.join("a/b")).unwrap(), b"new");
        assert!(!path.join("c").exists());
        // A file cannot be a folder, too.
        assert!(write_folder(&path, [("a", "no"), ("a/b", "no")]).is_err());
        assert_eq!(fs::read(path.join("a/b")).unwrap(), b"new");
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn folders_that_killed_runs_left_go_once_a_run_succeeds() {
        let folder = fresh_folder("left-folders");
        let path = folder.join("w.enf");
        for left in [".w.enf.17-1.tmp", ".w.enf.18-1.tmp", ".v.enf.17-1.tmp"] {
            fs::create_dir_all(folder.join(left).join("deep")).unwrap();
            fs::write(folder.join(left).join("deep/half"), b"half").unwrap();
        }
        let written = File::open(folder.join(".w.enf.18-1.tmp")).unwrap();
        written.lock().unwrap();
        // A call that fails removes nothing: what was left may be all that there is.
        assert!(write_folder(&path, [("a", "no"), ("a/b", "no")]).is_err());
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 3);
        write_folder(&path, [("a", "new")]).unwrap();
        assert!(!folder.join(".w.enf.17-1.tmp").exists());
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 3);
        drop(written);
        write_folder(&path, [("a", "new")]).unwrap();
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 2);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_failed_write_leaves_nothing() {
        let folder = fresh_folder("failed");
        // A directory cannot be replaced by a file.
        let path = folder.join("taken");
        fs::create_dir_all(path.join("full")).unwrap();
        assert!(write(&path, b"new").is_err() && try_write(&path).is_err());
        // Nor is a partial file left.
        let half = |out: &mut dyn Write| {
            out.write_all(b"half")?;
            Err(io::Error::other("no more"))
        };
        assert!(write_with(folder.join("taken/half"), half).is_err());
        assert_eq!(fs::read_dir(&path).unwrap().count(), 1);
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn what_a_killed_run_left_goes_and_what_another_writes_stays() {
        let folder = fresh_folder("left");
        let (gone, stays) = (
            [".w.glb.17-1.tmp", ".w.glb.17-1795503000000000000.tmp"],
            [
                ".w.glb.x-1.tmp",
                ".w.glb.1-x.tmp",
                ".w.glb.17.tmp",
                ".v.glb.17-1.tmp",
                "w.glb.17-1.tmp",
            ],
        );
        for name in gone.iter().chain(&stays) {
            fs::write(folder.join(name), b"half").unwrap();
        }
        let written = File::create(folder.join(".w.glb.18-1.tmp")).unwrap();
        written.lock().unwrap();
        remove_left(&[folder.join("w.glb"), folder.join("x.glb")]);
        let is_there = |name: &str| folder.join(name).exists();
        assert!(!gone.iter().any(|name| is_there(name)));
        for name in stays.iter().chain(&[".w.glb.18-1.tmp"]) {
            assert!(is_there(name), "{name}");
        }
        fs::remove_dir_all(&folder).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn a_symbolic_link_stays_one() {
        let folder = fresh_folder("link");
        let (target, link) = (folder.join("target"), folder.join("link"));
        fs::write(&target, b"old").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        write(&link, b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&target).unwrap(), b"new");
        // A link to a file that does not exist yet, through another link; and two links that lead to each other.
        fs::remove_file(&target).unwrap();
        let other = folder.join("other");
        std::os::unix::fs::symlink("./link", &other).unwrap();
        assert_eq!(followed(&other), followed(&target));
        write(&other, b"made").unwrap();
        assert!(fs::symlink_metadata(&other).unwrap().is_symlink());
        assert_eq!(fs::read(&target).unwrap(), b"made");
        let circle = ["one", "two"].map(|name| folder.join(name));
        std::os::unix::fs::symlink("two", &circle[0]).unwrap();
        std::os::unix::fs::symlink("one", &circle[1]).unwrap();
        assert_eq!(followed(&circle[0]), circle[0]);
        assert!(try_write(&circle[0]).is_err());
        fs::remove_dir_all(&folder).unwrap();
    }
}
