//! Writers for standard output and standard error that print plain text only.
//!
//! Names of objects, cells and files come from strangers, and on a terminal text can be a command, or look like a
//! line of ours. So everything goes through the writers here, which `cargo xtask tidy` checks: a call of `writeln!`
//! writes one line, whatever its contents, with [hidden characters escaped](shown). Text of several lines is [written
//! as such](write_lines) by code that has escaped the names in it.

use std::fmt;
use std::io::{self, BufWriter, IsTerminal as _, StdoutLock, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use enfilade::geom::shown;
use enfilade::internals::geom::is_hidden;

/// `true` if `--quiet` was given; set once, before any command runs.
static IS_QUIET: AtomicBool = AtomicBool::new(false);

/// Silences [`Told`] from now on.
pub(crate) fn be_quiet() {
    IS_QUIET.store(true, Ordering::Relaxed);
}

/// Returns `true` if only errors and warnings are printed.
pub(crate) fn is_quiet() -> bool {
    IS_QUIET.load(Ordering::Relaxed)
}

/// Returns `true` if standard error is a terminal.
pub(crate) fn is_watched() -> bool {
    io::stderr().is_terminal()
}

/// Standard output for results, line by line.
pub(crate) fn printed() -> Screen<StdoutLock<'static>> {
    Screen(io::stdout().lock())
}

/// Like [`printed`], buffered for long results that nobody waits for; needs a flush.
pub(crate) fn printed_at_once() -> Screen<BufWriter<StdoutLock<'static>>> {
    Screen(BufWriter::with_capacity(1 << 16, io::stdout().lock()))
}

/// Writes bytes of a file to standard output, unchanged.
pub(crate) fn pass_on(
    fill: impl FnOnce(&mut dyn Write) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    fill(&mut out)?;
    Ok(out.flush()?)
}

/// Returns `true` for an error caused by a reader that closed the pipe.
pub(crate) fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error
        .chain()
        .filter_map(|cause| cause.downcast_ref::<io::Error>())
        .any(|e| e.kind() == io::ErrorKind::BrokenPipe)
}

/// A place for people: three coordinates in centimeters, never minus zero. [Units: wu]
pub(crate) struct At(pub(crate) [f64; 3]);

impl At {
    /// Makes a place of a file's numbers.
    pub(crate) fn of(place: [f32; 3]) -> Self {
        Self(place.map(f64::from))
    }
}

impl fmt::Display for At {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Adding zero makes 0 of -0.
        let [x, y, z] = self.0.map(|v| (v * 100.0).round() / 100.0 + 0.0);
        write!(f, "{x:.2} {y:.2} {z:.2}")
    }
}

/// A number for people: three digits, or all of its integer part, and never minus zero.
pub(crate) struct Rounded(pub(crate) f64);

impl fmt::Display for Rounded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let exact = self.0;
        let rounded = if exact.abs() >= 1000.0 || exact == exact.trunc() {
            exact.round()
        } else {
            format!("{exact:.2e}").parse().unwrap_or(exact)
        };
        // Adding zero makes 0 of -0.
        write!(f, "{}", rounded + 0.0)
    }
}

/// A writer of text for people: each call of `writeln!` makes one line.
pub(crate) struct Screen<W>(W);

/// Standard error, for messages beside the result; silenced by `--quiet`. If the reader closes it, as in
/// `enfilade bake … 2>&1 | head -2`, the work goes on.
pub(crate) struct Told;

/// Standard error, for errors, and for warnings that the result is not what was requested or probably not what was
/// meant.
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

/// The text of one call: a line, or a piece of one.
fn escaped_line(text: fmt::Arguments<'_>) -> String {
    let text = text.to_string();
    match text.strip_suffix('\n') {
        Some(line) => format!("{}\n", shown(line)),
        None => shown(text).to_string(),
    }
}

/// Escapes bytes, but keeps their lines.
fn escaped_lines(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let lines = text.split('\n').map(|line| shown(line).to_string());
    lines.collect::<Vec<_>>().join("\n")
}

/// Writes text of several lines and ends the last one. Names in it must be escaped already: a line break in a name
/// would begin a line of its own.
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

/// JSON with hidden characters escaped in its strings: the same value.
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
    fn numbers_for_people_have_few_digits() {
        for (number, text) in [
            (0.099_999_999_999_999_99, "0.1"),
            (0.001_374_639_782_323_491, "0.00137"),
            (-0.0, "0"),
            (1_689_900.0, "1689900"),
            (1234.567, "1235"),
            (-12.345, "-12.3"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(Rounded(number).to_string(), text);
        }
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
