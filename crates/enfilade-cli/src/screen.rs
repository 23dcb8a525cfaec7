//! What is said, on standard output and standard error: nothing gets there but text.
//!
//! Names of objects, cells and files are strangers' text, and on a terminal text can be a command, or look like a line of
//! ours. So all that is printed goes through the writers here, and `cargo xtask tidy` knows it: a call of `writeln!` writes
//! one line, whatever is in it, with [hidden characters escaped](shown). Text of several lines is [written as
//! such](write_lines) by who has escaped the names in it.

use std::fmt;
use std::io::{self, BufWriter, IsTerminal as _, StdoutLock, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use enfilade::geom::{is_hidden, shown};

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

/// Whether somebody watches standard error.
pub(crate) fn is_watched() -> bool {
    io::stderr().is_terminal()
}

/// Standard output for results, line by line.
pub(crate) fn printed() -> Screen<StdoutLock<'static>> {
    Screen(io::stdout().lock())
}

/// The same for long ones, which nobody waits for; to be flushed.
pub(crate) fn printed_at_once() -> Screen<BufWriter<StdoutLock<'static>>> {
    Screen(BufWriter::with_capacity(1 << 16, io::stdout().lock()))
}

/// Bytes of a file to standard output, as they are.
pub(crate) fn pass_on(
    fill: impl FnOnce(&mut dyn Write) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    fill(&mut out)?;
    Ok(out.flush()?)
}

/// Tells an error that came of a reader who has seen enough.
pub(crate) fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error
        .chain()
        .filter_map(|cause| cause.downcast_ref::<io::Error>())
        .any(|e| e.kind() == io::ErrorKind::BrokenPipe)
}

/// A writer of text for people: one call of `writeln!` is one line.
pub(crate) struct Screen<W>(W);

/// Standard error, for what is said beside the work; `--quiet` silences it. Where nobody reads it any more, as in
/// `enfilade bake … 2>&1 | head -2`, the work goes on.
pub(crate) struct Told;

/// The same for errors, and for warnings: the result is not what was asked for, or probably not what was meant.
pub(crate) struct Warned;

impl<W: Write> Write for Screen<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write_all(escaped_lines(bytes).as_bytes())?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }

    fn write_fmt(&mut self, text: fmt::Arguments<'_>) -> io::Result<()> {
        self.0.write_all(escaped_line(text).as_bytes())
    }
}

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

    fn write_fmt(&mut self, text: fmt::Arguments<'_>) -> io::Result<()> {
        if is_quiet() {
            return Ok(());
        }
        Warned.write_fmt(text)
    }
}

impl Write for Warned {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let _ = io::stderr().write_all(escaped_lines(bytes).as_bytes());
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }

    fn write_fmt(&mut self, text: fmt::Arguments<'_>) -> io::Result<()> {
        let _ = io::stderr().write_all(escaped_line(text).as_bytes());
        Ok(())
    }
}

/// What one call writes: a line, or a piece of one.
fn escaped_line(text: fmt::Arguments<'_>) -> String {
    let text = text.to_string();
    match text.strip_suffix('\n') {
        Some(line) => format!("{}\n", shown(line)),
        None => shown(text).to_string(),
    }
}

/// Bytes keep their lines.
fn escaped_lines(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let lines = text.split('\n').map(|line| shown(line).to_string());
    lines.collect::<Vec<_>>().join("\n")
}

/// Writes text of several lines, the last of which need not end. Names in it are escaped already, or a line break in one of
/// them would begin a line of its own.
pub(crate) fn write_lines(out: &mut impl Write, text: &impl fmt::Display) -> io::Result<()> {
    let mut text = text.to_string();
    if !text.is_empty() && !text.ends_with('\n') {
        text.push('\n');
    }
    out.write_all(text.as_bytes())
}

/// Prints one object as one line.
pub(crate) fn print_json(mut out: impl Write, value: &impl serde::Serialize) -> anyhow::Result<()> {
    let mut text = json_text(&serde_json::to_string(value)?);
    text.push('\n');
    out.write_all(text.as_bytes())
        .and_then(|()| out.flush())
        .context("cannot write to standard output")
}

/// JSON whose strings show what is in them: the same value, with hidden characters escaped as JSON does it.
pub(crate) fn json_text(json: &str) -> String {
    let mut out = String::with_capacity(json.len());
    for c in json.chars() {
        // A line break stands between values: in strings it is escaped already.
        if is_hidden(c) && c != '\n' {
            let units = &mut [0; 2];
            for unit in c.encode_utf16(units) {
                out += &format!("\\u{unit:04x}");
            }
        } else {
            out.push(c);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAME: &str = "wall\u{1b}[2J\u{202e}\nwrote x\n";

    #[test]
    fn a_call_writes_one_line_and_bytes_keep_theirs() {
        let mut out = Screen(Vec::new());
        writeln!(out, "in {NAME}").unwrap();
        write!(out, "{NAME:>3}").unwrap();
        writeln!(out).unwrap();
        write_lines(&mut out, &"a\u{9b}\nb").unwrap();
        let boxed: &mut dyn Write = &mut out;
        let name = "c\n";
        writeln!(boxed, "{name}").unwrap();
        let text = String::from_utf8(out.0).unwrap();
        let shown = r"wall\u{1b}[2J\u{202e}\nwrote x";
        assert_eq!(
            text,
            format!("in {shown}\\n\n{shown}\n\na\\u{{9b}}\nb\nc\\n\n")
        );
    }

    #[test]
    fn json_stays_the_same_value_and_shows_all_of_it() {
        let value = serde_json::json!({ NAME: [NAME, "\u{7f}\u{9b}\u{e0041}é\u{feff}\u{0}\\n"] });
        for text in [
            json_text(&serde_json::to_string(&value).unwrap()),
            json_text(&serde_json::to_string_pretty(&value).unwrap()),
        ] {
            assert!(!text.chars().any(|c| is_hidden(c) && c != '\n'), "{text}");
            assert_eq!(
                serde_json::from_str::<serde_json::Value>(&text).unwrap(),
                value
            );
        }
    }
}
