//! Text of strangers, made fit to be shown.
//!
//! Names come from files, and files from anybody. On a terminal a name can be a command (move the cursor, set the title,
//! answer as if typed), a line of its own, or letters that are read in another order than they stand. So whatever goes to a
//! terminal, log, report or error message goes through [`shown`]; what cannot be seen is written as Rust writes it in a
//! literal, `\n` or `\u{202e}`.

use std::fmt::{self, Write};

/// Shows a value with [hidden](is_hidden) characters escaped: as one line, in the order in which it is written.
///
/// Fills and aligns as text does. What is visible stays as it is, backslashes too: this is for eyes, not to be read back.
///
/// ```
/// use enfilade_geom::shown;
///
/// let name = "wall\u{1b}[2J\nwrote all";
/// assert_eq!(shown(name).to_string(), r"wall\u{1b}[2J\nwrote all");
/// ```
pub fn shown<T: fmt::Display>(value: T) -> Shown<T> {
    Shown(value)
}

/// A value as [`shown`] shows it.
#[derive(Clone, Copy, Debug)]
pub struct Shown<T>(T);

impl<T: fmt::Display> fmt::Display for Shown<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if f.width().is_none() && f.precision().is_none() {
            return write!(Escaper(f), "{}", self.0);
        }
        let mut text = String::new();
        write!(Escaper(&mut text), "{}", self.0)?;
        f.pad(&text)
    }
}

/// Escapes on the way.
struct Escaper<W>(W);

impl<W: Write> Write for Escaper<W> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        // All between two hidden characters goes in one piece.
        let mut rest = text;
        while let Some((at, c)) = rest.char_indices().find(|(_, c)| is_hidden(*c)) {
            self.0.write_str(&rest[..at])?;
            write!(self.0, "{}", c.escape_default())?;
            rest = &rest[at + c.len_utf8()..];
        }
        self.0.write_str(rest)
    }
}

/// Tells characters that do something else than to be seen: control characters (C0, DEL, C1), line and paragraph separators,
/// marks and overrides of direction, and all that Unicode lets a font ignore, such as zero-width spaces and tags.
///
/// Selectors of a look (U+FE00 to U+FE0F) are none: they stand behind many a visible emoji and change nothing but its look.
/// Joiners are hidden, though some scripts use them: two names that differ by one look the same.
#[must_use]
pub const fn is_hidden(c: char) -> bool {
    matches!(c,
        '\0'..='\u{1f}' | '\u{7f}'..='\u{9f}'
        | '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}' | '\u{1160}' | '\u{17b4}' | '\u{17b5}' | '\u{180b}'..='\u{180f}'
        | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{3164}' | '\u{feff}' | '\u{ffa0}'
        // All specials but the two that are seen.
        | '\u{fff0}'..='\u{fffb}' | '\u{fffe}' | '\u{ffff}'
        | '\u{1bca0}'..='\u{1bca3}' | '\u{1d173}'..='\u{1d17a}' | '\u{e0000}'..='\u{e0fff}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_hidden_is_escaped_and_what_is_seen_stays() {
        for (text, escaped) in [
            (
                "wall\u{1b}]0;owned\u{7}\u{1b}[2J",
                r"wall\u{1b}]0;owned\u{7}\u{1b}[2J",
            ),
            ("a\nwrote b\r\tc\0", r"a\nwrote b\r\tc\u{0}"),
            (
                "\u{7f}\u{80}\u{9b}31m\u{9f}",
                r"\u{7f}\u{80}\u{9b}31m\u{9f}",
            ),
            (
                "gl\u{202e}bl\u{2066}x\u{2069}",
                r"gl\u{202e}bl\u{2066}x\u{2069}",
            ),
            (
                "\u{200e}\u{200f}\u{61c}\u{feff}\u{200b}",
                r"\u{200e}\u{200f}\u{61c}\u{feff}\u{200b}",
            ),
            (
                "\u{2028}\u{2029}\u{ad}\u{e0041}",
                r"\u{2028}\u{2029}\u{ad}\u{e0041}",
            ),
            ("", ""),
            (r"C:\new\u{1b}", r"C:\new\u{1b}"),
            (
                "Küche 2 \u{a0}é e\u{301} 部屋 غرفة 🛋\u{fe0f} \u{fffd}",
                "Küche 2 \u{a0}é e\u{301} 部屋 غرفة 🛋\u{fe0f} \u{fffd}",
            ),
        ] {
            assert_eq!(shown(text).to_string(), escaped);
        }
    }

    #[test]
    fn what_is_escaped_is_no_letter_and_no_control_is_left() {
        let mut n_hidden = 0;
        for c in (0..=u32::from(char::MAX)).filter_map(char::from_u32) {
            assert!(!c.is_control() || is_hidden(c), "{c:?}");
            if is_hidden(c) {
                n_hidden += 1;
                // Fillers count as letters, and are blank.
                let is_filler = matches!(c, '\u{115f}' | '\u{1160}' | '\u{3164}' | '\u{ffa0}');
                assert!(!c.is_alphanumeric() || is_filler, "{c:?}");
                assert_eq!(shown(c).to_string(), c.escape_default().to_string());
            }
        }
        assert!(n_hidden > 4000);
    }

    #[test]
    fn columns_are_as_wide_as_what_is_seen() {
        assert_eq!(
            format!("{:<6}|{:>4}|", shown("a\n"), shown(7)),
            "a\\n   |   7|"
        );
        assert_eq!(format!("{:.2}|", shown("abc")), "ab|");
    }
}
