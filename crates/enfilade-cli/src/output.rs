//! Where the commands write: files whole or not at all, none of them an input, and standard output for `-`.

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

/// Writes `bytes` to `path`, [whole or not at all](enfilade::whole), or to standard output where it is `-`.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    write_streamed(path, |out| Ok(out.write_all(bytes)?))
}

/// The same for what is made while it is written.
pub(crate) fn write_streamed(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let _is_writing = WRITING.lock();
    if is_stream(path) {
        return match pass_on(fill) {
            // Who prints a table may stop where the reader does; half a file is none.
            Err(e) if is_broken_pipe(&e) => bail!(
                "standard output was closed before the whole file was written; what was read of it is cut off"
            ),
            done => done.map_err(|e| explained(e, || "cannot write to standard output".to_owned())),
        };
    }
    let written = whole::write_with(path, fill);
    written.map_err(|e| {
        explained(e, || {
            format!(
                "cannot write {}; choose another place, or make room there",
                path.display()
            )
        })
    })
}

/// Adds what could not be written, unless it was something else that failed while it was.
fn explained(error: anyhow::Error, what: impl FnOnce() -> String) -> anyhow::Error {
    if error.is::<io::Error>() {
        error.context(what())
    } else {
        error
    }
}

/// What was written.
#[derive(serde::Serialize)]
pub(crate) struct Written {
    /// `None` for standard output. As text: JSON holds no other names.
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

/// The line that says so.
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

/// What a command reads and what it will write: no file is both, and none is written by two.
#[derive(Clone, Default)]
pub(crate) struct Outputs {
    /// By resolved path: an input as it was given, or the option of an output.
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
    /// Of a command that reads these files. Refused where two of them are standard input.
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

    /// Takes down what the inputs turned out to refer to. Refused where one of these is an output.
    pub(crate) fn read(&mut self, references: &[PathBuf]) -> anyhow::Result<()> {
        for path in references {
            let resolved = whole::followed(path);
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

    /// Takes down that `option` names a file to write. Refused where that is an input or what another option writes, says by
    /// its extension that it is something else, or cannot be written: asked before minutes of work are spent on what goes
    /// there.
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

    /// The same for several files of one folder, of which the first is tried.
    pub(crate) fn write_all(
        &mut self,
        option: &'static str,
        format: Format,
        paths: &[PathBuf],
    ) -> anyhow::Result<()> {
        for path in paths {
            // What is a pipe or a terminal on both sides is no file that could be lost.
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

    /// Where results are printed: standard output, or standard error where a file goes there.
    pub(crate) fn printed(&self) -> Box<dyn Write> {
        if self.streamed.is_some() {
            Box::new(Told)
        } else {
            Box::new(printed())
        }
    }
}

/// Writes files into the folder that `option` names. Nobody named the files, so none is written over that may be somebody's:
/// what is there already stays if it is the same, and is refused, before any is written, if it is a link or not an earlier
/// one of ours.
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
                (!is_ours(path, &found))
                    .then_some("is there, and is another file than would be written")
            }
            Ok(meta) if meta.is_symlink() => Some("is a link, and what it leads to would be lost"),
            _ => Some("is there, and is no file"),
        };
        if let Some(why) = refused {
            bail!(
                "{} {why}; move it away, or choose another folder with {option}",
                path.display()
            );
        }
        changed.push((path, bytes));
    }
    changed
        .into_iter()
        .try_for_each(|(path, bytes)| write_whole(path, bytes))
}

/// Makes the folder that `option` names, unless it is there.
pub(crate) fn make_folder(option: &str, path: &Path) -> anyhow::Result<()> {
    refuse_stream(option, path, "several files")?;
    fs::create_dir_all(path).with_context(|| {
        format!(
            "cannot make folder {}; choose another place with {option}",
            path.display()
        )
    })
}

/// Refuses standard output for what is not one file.
pub(crate) fn refuse_stream(option: &str, path: &Path, what: &str) -> anyhow::Result<()> {
    if is_stream(path) {
        bail!(
            "{option} names {what}, which do not go to standard output; give it another name than '-'"
        );
    }
    Ok(())
}

pub(crate) fn is_same_file(a: &Path, b: &Path) -> bool {
    whole::followed(a) == whole::followed(b)
}

/// Whether `path` can be written.
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
