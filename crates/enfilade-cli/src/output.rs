//! Outputs of commands: files, written whole or not at all and never over an input, and standard output for `-`.

use std::collections::HashMap;
use std::fmt;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use anyhow::{Context, bail};
use enfilade::whole;
use enfilade_cli::input::is_stream;

use crate::formats::Format;
use crate::screen::{Told, is_broken_pipe, pass_on, printed};

/// Held while an output is written.
pub(crate) static WRITING: Mutex<()> = Mutex::new(());

/// Writes `bytes` to `path`, [whole or not at all](enfilade::whole), or to standard output if it is `-`.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    write_streamed(path, |out| Ok(out.write_all(bytes)?))
}

/// Like [`write_whole`], for data made while it is written.
pub(crate) fn write_streamed(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let _is_writing = WRITING.lock();
    if is_stream(path) {
        return match pass_on(fill) {
            // A printed table may stop when its reader does; half a file is a failure.
            Err(e) if is_broken_pipe(&e) => bail!(
                "standard output was closed before the whole file was written; the part that was read is cut off"
            ),
            done => done.map_err(|e| explained(e, || "cannot write to standard output".to_owned())),
        };
    }
    let written = whole::write_with(path, fill);
    written.map_err(|e| {
        explained(e, || {
            format!(
                "cannot write {}; choose another place, or free space there",
                path.display()
            )
        })
    })
}

/// Adds the failed action to an I/O error; leaves other errors as they are.
fn explained(error: anyhow::Error, what: impl FnOnce() -> String) -> anyhow::Error {
    if error.is::<io::Error>() {
        error.context(what())
    } else {
        error
    }
}

/// An output that was written.
#[derive(serde::Serialize)]
pub(crate) struct Written {
    /// `None` for standard output. As text: JSON cannot hold other names.
    file: Option<String>,
    bytes: usize,
}

impl Written {
    pub(crate) fn new(path: &Path, bytes: &[u8]) -> Self {
        Self {
            file: (!is_stream(path)).then(|| path.display().to_string()),
            bytes: bytes.len(),
        }
    }
}

/// The line that reports it.
impl fmt::Display for Written {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "wrote ")?;
        match &self.file {
            Some(file) => write!(f, "{file}")?,
            None => write!(f, "to standard output")?,
        }
        write!(f, " ({:.1} MB)", self.bytes as f64 / 1e6)
    }
}

/// The files that a command reads and will write: none is both, and none is written twice.
#[derive(Clone, Default)]
pub(crate) struct Outputs {
    /// Keyed by resolved path: an input as given, or the option of an output.
    known: HashMap<PathBuf, Known>,
    /// The option that writes to standard output.
    streamed: Option<&'static str>,
}

#[derive(Clone)]
enum Known {
    Input(PathBuf),
    Output(&'static str),
}

impl Outputs {
    /// For a command that reads these files. Refused if two of them are standard input.
    pub(crate) fn reading<'a>(
        inputs: impl IntoIterator<Item = &'a PathBuf>,
    ) -> anyhow::Result<Self> {
        let mut out = Self::default();
        let mut is_read = false;
        for path in inputs {
            if !is_stream(path) {
                out.known
                    .insert(whole::followed(path), Known::Input(path.clone()));
            } else if std::mem::replace(&mut is_read, true) {
                bail!(
                    "standard input can be read once only; give '-' for one input, and files for the others"
                );
            }
        }
        Ok(out)
    }

    /// Records the files that the inputs refer to. Refused if one of them is an output.
    pub(crate) fn read(&mut self, references: &[PathBuf]) -> anyhow::Result<()> {
        for path in references {
            let resolved = whole::followed(path);
            if let Some(Known::Output(option)) = self.known.get(&resolved) {
                bail!(
                    "the scene refers to {}, so it is an input, too; choose another name with {option}",
                    path.display()
                );
            }
            self.known.insert(resolved, Known::Input(path.clone()));
        }
        Ok(())
    }

    /// Records that `option` names a file to write. Refused if it is an input or another option's output, if its
    /// extension belongs to another format, or if it cannot be written: checked before minutes of work are spent on
    /// it.
    pub(crate) fn write(
        &mut self,
        option: &'static str,
        format: Format,
        path: &Path,
    ) -> anyhow::Result<()> {
        if !is_stream(path) {
            return self.write_all(option, format, &[path.to_owned()]);
        }
        format.check_stream(option)?;
        match self.streamed.replace(option) {
            Some(other) if other != option => bail!(
                "standard output is to be written by {other}, too; choose another name with {option}"
            ),
            _ => Ok(()),
        }
    }

    /// Like [`write`](Self::write), for several files of one folder; only the first is tested for writing.
    pub(crate) fn write_all(
        &mut self,
        option: &'static str,
        format: Format,
        paths: &[PathBuf],
    ) -> anyhow::Result<()> {
        for path in paths {
            // A pipe or a terminal on both sides is not a file that could be lost.
            if fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir()) {
                continue;
            }
            let resolved = whole::followed(path);
            match self.known.get(&resolved) {
                Some(Known::Input(input)) => bail!(
                    "{} is the input {}; choose another name with {option}",
                    path.display(),
                    input.display()
                ),
                Some(Known::Output(other)) if *other != option => bail!(
                    "{} is to be written by {other}, too; choose another name with {option}",
                    path.display()
                ),
                _ => {}
            }
            format.check(option, path)?;
            self.known.insert(resolved, Known::Output(option));
        }
        if let Some(first) = paths.first() {
            check_target(first, option)?;
            whole::remove_left(paths);
        }
        Ok(())
    }

    /// The writer for printed results: standard output, or standard error if a file goes there.
    pub(crate) fn printed(&self) -> Box<dyn Write> {
        if self.streamed.is_some() {
            Box::new(Told)
        } else {
            Box::new(printed())
        }
    }
}

/// Writes files into the folder that `option` names. The user did not name the files, so none may overwrite a file of
/// the user's: an existing file stays if it is equal; before any is written, links and files that are not earlier
/// ones of ours are refused.
pub(crate) fn write_unnamed(
    option: &str,
    files: &[(PathBuf, Vec<u8>)],
    is_ours: impl Fn(&Path, &[u8]) -> bool,
) -> anyhow::Result<()> {
    let mut changed = Vec::new();
    for (path, bytes) in files {
        let refused = match fs::symlink_metadata(path) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => None,
            Ok(meta) if meta.is_file() => {
                let found =
                    fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
                if found == *bytes {
                    continue;
                }
                (!is_ours(path, &found)).then_some("is there, and differs from the file to write")
            }
            Ok(meta) if meta.is_symlink() => Some("is a link, and its target would be lost"),
            _ => Some("is there, and is not a file"),
        };
        if let Some(why) = refused {
            bail!(
                "{} {why}; move it away, or choose another folder with {option}",
                path.display()
            );
        }
        changed.push((path, bytes));
    }
    for (path, bytes) in changed {
        write_whole(path, bytes)?;
    }
    let paths: Vec<&PathBuf> = files.iter().map(|(path, _)| path).collect();
    whole::remove_left(&paths);
    Ok(())
}

/// Makes the folder that `option` names, unless it exists.
pub(crate) fn make_folder(option: &str, path: &Path) -> anyhow::Result<()> {
    refuse_stream(option, path, "several files")?;
    fs::create_dir_all(path).with_context(|| {
        format!(
            "cannot make folder {}; choose another place with {option}",
            path.display()
        )
    })
}

/// Refuses to replace a folder of something else: one that has files, but not `mark`.
pub(crate) fn check_folder(option: &str, path: &Path, mark: &str) -> anyhow::Result<()> {
    if path.is_file() {
        bail!("{} is a file; give {option} a folder", path.display());
    }
    let is_empty = || fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_none());
    if path.exists() && !path.join(mark).is_file() && !is_empty() {
        bail!(
            "{} is a folder with other contents; choose another name with {option}",
            path.display()
        );
    }
    Ok(())
}

/// Refuses standard output for anything but a single file.
pub(crate) fn refuse_stream(option: &str, path: &Path, what: &str) -> anyhow::Result<()> {
    if is_stream(path) {
        bail!(
            "{option} names {what}, which cannot go to standard output; give it another name than '-'"
        );
    }
    Ok(())
}

pub(crate) fn is_same_file(a: &Path, b: &Path) -> bool {
    whole::followed(a) == whole::followed(b)
}

/// Tests if `path` can be written.
fn check_target(path: &Path, option: &str) -> anyhow::Result<()> {
    whole::try_write(path).with_context(|| {
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
