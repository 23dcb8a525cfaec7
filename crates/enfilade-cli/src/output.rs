//! Where the commands write: files whole or not at all, none of them an input, and standard output for `-`.

use std::collections::HashMap;
use std::fmt;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, bail};
use enfilade::whole;
use enfilade_cli::input::is_stream;

use crate::formats::Format;

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
        let mut out = io::stdout().lock();
        let filled = fill(&mut out).and_then(|()| Ok(out.flush()?));
        return filled.map_err(|e| explained(e, || "cannot write to standard output".into()));
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

/// Whether `--quiet` was given: once, before any command runs.
static IS_QUIET: AtomicBool = AtomicBool::new(false);

/// From now on [`Told`] says nothing.
pub(crate) fn be_quiet() {
    IS_QUIET.store(true, Ordering::Relaxed);
}

/// Whether nothing but errors and warnings is to be said.
pub(crate) fn is_quiet() -> bool {
    IS_QUIET.load(Ordering::Relaxed)
}

/// What was written.
#[derive(serde::Serialize)]
pub(crate) struct Written {
    /// `None` for standard output.
    file: Option<PathBuf>,
    bytes: usize,
}

impl Written {
    pub(crate) fn new(path: &Path, bytes: &[u8]) -> Self {
        Self {
            file: (!is_stream(path)).then(|| path.to_owned()),
            bytes: bytes.len(),
        }
    }
}

/// The line that says so.
impl fmt::Display for Written {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "wrote ")?;
        match &self.file {
            Some(file) => write!(f, "{}", file.display())?,
            None => write!(f, "to standard output")?,
        }
        write!(f, " ({:.1} MB)", self.bytes as f64 / 1e6)
    }
}

/// Prints one object as one line.
pub(crate) fn print_json(mut out: impl Write, value: &impl serde::Serialize) -> anyhow::Result<()> {
    serde_json::to_writer(&mut out, value).map_err(io::Error::from)?;
    writeln!(out)
        .and_then(|()| out.flush())
        .context("cannot write to standard output")
}

/// Standard error, for what is said beside the work; `--quiet` silences it. Where nobody reads it any more, as in
/// `enfilade bake … 2>&1 | head -2`, the work goes on.
pub(crate) struct Told;

/// The same for errors, and for warnings: the result is not what was asked for, or probably not what was meant.
pub(crate) struct Warned;

impl Write for Told {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if is_quiet() {
            return Ok(bytes.len());
        }
        Warned.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Write for Warned {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let _ = io::stderr().write_all(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
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
                out.known.insert(resolved(path), Known::Input(path.clone()));
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

    /// Takes down that `option` names a file to write. Refused where that is an input or what another option writes, says by its
    /// extension that it is something else, or cannot be written: asked before minutes of work are spent on what goes there.
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
            let resolved = resolved(path);
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
            Box::new(io::stdout().lock())
        }
    }
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
