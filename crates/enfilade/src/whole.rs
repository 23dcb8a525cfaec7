//! Files that are written whole or not at all.
//!
//! What is written goes to a file beside the target first, `.NAME.PROCESS-TIME.tmp`, which is locked while it is written and
//! renamed when it is done. A run that is killed leaves such a file behind, unlocked; [`remove_left`] knows it by that.
//! [`save`](crate::save) and the command `enfilade` write by this rule, and so may what lies beside a world.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Names tried beside a target. All differ; a few may be taken for left between being made and being locked.
const MOST_TRIES: usize = 100;

/// Writes `bytes` to `path`: aside first, then renamed, so that a reader sees the old file or the new one and never half of
/// one, whatever happens in between.
///
/// [Follows](followed) symbolic links. What exists and is no regular file (`/dev/stdout`, a named pipe) is written to directly, because
/// nothing can be renamed over it. Several threads and processes may write to one path: the last one's file is left.
///
/// # Errors
///
/// When the file cannot be written; what was there is left as it was.
pub fn write(path: impl AsRef<Path>, bytes: &[u8]) -> io::Result<()> {
    write_with(path, |out| out.write_all(bytes))
}

/// The same for what is made while it is written; `fill` had best write many bytes at a time.
///
/// # Errors
///
/// As [`write()`], and those of `fill`; what was there is left as it was.
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
    // The lock is held until the name is the target's: nobody takes the file for one that was left.
    let written = filled.and_then(|()| Ok(fs::rename(&aside, &path)?));
    if written.is_err() {
        // The first error is the one to report.
        let _ = fs::remove_file(&aside);
    }
    written
}

/// Whether [`write()`] to `path` would find a place: makes the file aside and removes it again. Leaves `path` alone.
///
/// # Errors
///
/// Why not: a folder that is missing, is read-only or is `path` itself.
pub fn try_write(path: impl AsRef<Path>) -> io::Result<()> {
    let path = followed(path);
    match fs::metadata(&path) {
        // What is left of a link is one that leads in a circle.
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

/// Removes what killed runs left beside the files of these paths, which lie in one folder. What a run is writing now is
/// locked and stays. Linear in the folder.
///
/// What cannot be removed is passed over: it does no harm but to take room.
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
        if let Ok(file) = File::open(entry.path())
            && file.try_lock().is_ok()
        {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Links in a row that lead somewhere; systems follow about as many.
const MOST_LINKS: usize = 40;

/// The file that a path means once links are followed, also of a link to what is not there yet. Links that lead in a circle
/// mean none: the path itself is returned.
pub fn followed(path: impl AsRef<Path>) -> PathBuf {
    let path = path.as_ref();
    let mut at = path.to_owned();
    for _ in 0..MOST_LINKS {
        if let Ok(found) = fs::canonicalize(&at) {
            return found;
        }
        match fs::read_link(&at) {
            // Relative to where the link lies.
            Ok(target) => at = folder_of(&at).join(target),
            // Nothing is there. Its folder may be reached by links, too.
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

/// Makes a file in the same folder (a rename must not cross file systems), of this call alone, and locks it.
fn open_aside(path: &Path) -> io::Result<(PathBuf, File)> {
    for _ in 0..MOST_TRIES {
        let aside = aside(path)?;
        let file = match OpenOptions::new().write(true).create_new(true).open(&aside) {
            Ok(file) => file,
            // Another thread's, of the same moment.
            Err(e) if e.kind() == ErrorKind::AlreadyExists => continue,
            Err(e) => return Err(e),
        };
        // A disk that has no locks does without; there, nothing is taken for left either.
        let is_taken = matches!(file.try_lock(), Err(fs::TryLockError::WouldBlock));
        // Before it was locked, someone may have taken it for one that was left.
        if !is_taken && aside.exists() {
            return Ok((aside, file));
        }
    }
    Err(io::Error::new(
        ErrorKind::AlreadyExists,
        "no name beside it is free",
    ))
}

/// A name that was never taken before: whoever looks at a file of a name long after it was gone must not find another one.
fn aside(path: &Path) -> io::Result<PathBuf> {
    let name = path
        .file_name()
        .ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "it is no file name"))?;
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    let time = since.unwrap_or_default().as_nanos();
    let mut hidden = OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{}-{time}.tmp", std::process::id()));
    Ok(path.with_file_name(hidden))
}

/// The name of the file beside which a file of this name is written.
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
    fn a_failed_write_leaves_nothing() {
        let folder = fresh_folder("failed");
        // A directory cannot be replaced by a file.
        let path = folder.join("taken");
        fs::create_dir_all(path.join("full")).unwrap();
        assert!(write(&path, b"new").is_err() && try_write(&path).is_err());
        // Nor what ends in the middle.
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
        // One to a file that is not there yet, through another; and two that lead to each other.
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
