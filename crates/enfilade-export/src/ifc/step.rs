//! Files of ISO 10303-21 (STEP), as far as it takes to add to one: statements with their places, and their attributes.
//!
//! Everything else stays as it is, byte by byte. O(bytes).

use std::collections::HashMap;
use std::fmt::Write;
use std::ops::Range;

use super::told::IfcError;

/// A file whose statements are known by number.
pub(crate) struct StepFile<'b> {
    bytes: &'b [u8],
    pub(crate) statements: Vec<Statement>,
    by_id: HashMap<u64, usize>,
    /// Where the data ends: new statements go here.
    pub(crate) end: usize,
    /// Largest number of a statement.
    pub(crate) last_id: u64,
}

/// `#id = CLASS(arguments);`
#[derive(Clone, Debug)]
pub(crate) struct Statement {
    pub(crate) id: u64,
    /// In capitals.
    pub(crate) class: String,
    /// All of it, with the semicolon.
    pub(crate) place: Range<usize>,
    /// Place between the outer parentheses.
    arguments: Range<usize>,
}

impl<'b> StepFile<'b> {
    /// Reads the statements of a file.
    pub(crate) fn read(bytes: &'b [u8]) -> Result<Self, IfcError> {
        let head = bytes.iter().position(|b| !b.is_ascii_whitespace());
        let text = bytes.get(head.unwrap_or(0)..).unwrap_or_default();
        let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
        if !text.starts_with(b"ISO-10303-21") {
            return Err(IfcError::NotIfc);
        }
        let mut file = Self {
            bytes,
            statements: Vec::new(),
            by_id: HashMap::new(),
            end: 0,
            last_id: 0,
        };
        for place in statement_places(bytes) {
            // Without the semicolon.
            let text = trimmed(bytes, place.start..place.end - 1);
            if bytes[text.clone()].starts_with(b"#") {
                let at = text.start;
                let mut statement = statement(bytes, text).ok_or(IfcError::Broken { at })?;
                statement.place.end = place.end;
                file.last_id = file.last_id.max(statement.id);
                file.by_id.insert(statement.id, file.statements.len());
                file.statements.push(statement);
            } else if bytes[text.clone()].eq_ignore_ascii_case(b"ENDSEC") {
                file.end = text.start;
            }
        }
        let last = file.statements.last().map_or(0, |s| s.place.end);
        if last == 0 || file.end < last {
            return Err(IfcError::CutOff);
        }
        Ok(file)
    }

    /// Returns the statement with a number.
    pub(crate) fn get(&self, id: u64) -> Option<&Statement> {
        self.by_id.get(&id).map(|&i| &self.statements[i])
    }

    /// Returns the statements of a class, in their order.
    pub(crate) fn of_class<'s>(&'s self, class: &'s str) -> impl Iterator<Item = &'s Statement> {
        self.statements.iter().filter(move |s| s.class == class)
    }

    /// Returns the places of a statement's attributes, without the space around them.
    pub(crate) fn places(&self, statement: &Statement) -> Vec<Range<usize>> {
        split(self.bytes, statement.arguments.clone())
    }

    /// Returns the attributes of a statement as text. Other bytes than UTF-8 are empty: no reference or number has them.
    pub(crate) fn attributes(&self, statement: &Statement) -> Vec<&'b str> {
        let places = self.places(statement).into_iter();
        places
            .map(|place| std::str::from_utf8(&self.bytes[place]).unwrap_or_default())
            .collect()
    }

    /// Returns the numbers of all statements to which one refers.
    pub(crate) fn references(&self, statement: &Statement) -> Vec<u64> {
        let mut found = Vec::new();
        let mut at = statement.arguments.start;
        while at < statement.arguments.end {
            match self.bytes[at] {
                quote @ (b'\'' | b'"') => at = after_quoted(self.bytes, at, quote),
                b'#' => {
                    let digits = self.bytes[at + 1..]
                        .iter()
                        .take_while(|b| b.is_ascii_digit());
                    let end = at + 1 + digits.count();
                    let text = std::str::from_utf8(&self.bytes[at..end]).unwrap_or_default();
                    found.extend(Self::reference(text));
                    at = end;
                }
                _ => at += 1,
            }
        }
        found
    }

    /// Returns the members of a list, `(a,b)`; none of anything else.
    pub(crate) fn list(text: &str) -> Vec<&str> {
        let inner = text.strip_prefix('(').and_then(|t| t.strip_suffix(')'));
        let inner = inner.unwrap_or_default();
        let places = split(inner.as_bytes(), 0..inner.len()).into_iter();
        places.map(|place| &inner[place]).collect()
    }

    /// Returns the number of a reference, `#7`.
    pub(crate) fn reference(text: &str) -> Option<u64> {
        text.strip_prefix('#')?.parse().ok()
    }

    /// Returns the statement to which an attribute refers.
    pub(crate) fn target(&self, text: &str) -> Option<&Statement> {
        self.get(Self::reference(text)?)
    }
}

/// Returns the places of all statements, up to and with their semicolons.
fn statement_places(bytes: &[u8]) -> impl Iterator<Item = Range<usize>> {
    let mut at = 0;
    std::iter::from_fn(move || {
        let start = at;
        while at < bytes.len() {
            match bytes[at] {
                quote @ (b'\'' | b'"') => at = after_quoted(bytes, at, quote),
                b'/' if bytes.get(at + 1) == Some(&b'*') => at = after_comment(bytes, at),
                b';' => {
                    at += 1;
                    return Some(start..at);
                }
                _ => at += 1,
            }
        }
        None
    })
}

/// Returns where a text that begins with a quote ends. A doubled quote inside reads as the end of one and the start of another.
fn after_quoted(bytes: &[u8], at: usize, quote: u8) -> usize {
    let rest = &bytes[at + 1..];
    rest.iter()
        .position(|&b| b == quote)
        .map_or(bytes.len(), |n| at + n + 2)
}

fn after_comment(bytes: &[u8], at: usize) -> usize {
    let rest = &bytes[at + 2..];
    rest.windows(2)
        .position(|w| w == b"*/")
        .map_or(bytes.len(), |n| at + n + 4)
}

/// Returns a place without space and comments before it, and without space behind.
fn trimmed(bytes: &[u8], place: Range<usize>) -> Range<usize> {
    let (mut start, mut end) = (place.start, place.end);
    while start < end {
        if bytes[start].is_ascii_whitespace() {
            start += 1;
        } else if bytes[start..].starts_with(b"/*") {
            start = after_comment(bytes, start).min(end);
        } else {
            break;
        }
    }
    while end > start && bytes[end - 1].is_ascii_whitespace() {
        end -= 1;
    }
    start..end.max(start)
}

fn statement(bytes: &[u8], place: Range<usize>) -> Option<Statement> {
    let text = &bytes[place.clone()];
    let equals = text.iter().position(|&b| b == b'=')?;
    let id = std::str::from_utf8(&text[1..equals])
        .ok()?
        .trim()
        .parse()
        .ok()?;
    let open = text.iter().position(|&b| b == b'(')?;
    let class = std::str::from_utf8(text.get(equals + 1..open)?).ok()?;
    let close = text.iter().rposition(|&b| b == b')')?;
    (open < close).then(|| Statement {
        id,
        class: class.trim().to_ascii_uppercase(),
        arguments: place.start + open + 1..place.start + close,
        place,
    })
}

/// Splits at the commas outside of parentheses and texts; the parts have no space around them.
fn split(bytes: &[u8], range: Range<usize>) -> Vec<Range<usize>> {
    let mut parts = Vec::new();
    let (mut start, mut at, mut depth) = (range.start, range.start, 0_u32);
    while at < range.end {
        match bytes[at] {
            quote @ (b'\'' | b'"') => {
                at = after_quoted(bytes, at, quote);
                continue;
            }
            b'(' => depth += 1,
            b')' => depth = depth.saturating_sub(1),
            b',' if depth == 0 => {
                parts.push(trimmed(bytes, start..at));
                start = at + 1;
            }
            _ => {}
        }
        at += 1;
    }
    let last = trimmed(bytes, start..range.end);
    if !last.is_empty() || !parts.is_empty() {
        parts.push(last);
    }
    parts
}

/// Returns a text of the file as people read it; `None` if the attribute is not one.
pub(crate) fn text_of(attribute: &str) -> Option<String> {
    let inner = attribute
        .strip_prefix('\'')?
        .strip_suffix('\'')?
        .replace("''", "'");
    let mut out = String::new();
    let mut rest = inner.as_str();
    while let Some(at) = rest.find('\\') {
        out.push_str(&rest[..at]);
        rest = &rest[at..];
        let (text, n) = escape(rest).unwrap_or(("\\".to_owned(), 1));
        out.push_str(&text);
        rest = rest.get(n..).unwrap_or_default();
    }
    Some(out + rest)
}

/// Returns what an escape at the start of a text stands for, and its length.
fn escape(text: &str) -> Option<(String, usize)> {
    if let Some(rest) = text.strip_prefix("\\X2\\") {
        let end = rest.find("\\X0\\")?;
        let units: Option<Vec<u16>> = (0..end / 4)
            .map(|i| u16::from_str_radix(rest.get(4 * i..4 * i + 4)?, 16).ok())
            .collect();
        return Some((String::from_utf16_lossy(&units?), end + 8));
    }
    if let Some(rest) = text.strip_prefix("\\X\\") {
        let code = u8::from_str_radix(rest.get(..2)?, 16).ok()?;
        return Some((char::from(code).to_string(), 5));
    }
    if let Some(rest) = text.strip_prefix("\\S\\") {
        let low = rest.chars().next().filter(char::is_ascii)?;
        return Some((char::from(low as u8 | 0x80).to_string(), 4));
    }
    text.starts_with("\\\\").then(|| ("\\".to_owned(), 2))
}

/// Returns a text as files have it, with its quotes.
pub(crate) fn quoted(text: &str) -> String {
    let mut out = String::from("'");
    for c in text.chars() {
        match c {
            '\'' => out.push_str("''"),
            '\\' => out.push_str("\\\\"),
            ' '..='~' => out.push(c),
            c if c.is_control() => out.push(' '),
            c => {
                let mut units = [0; 2];
                out.push_str("\\X2\\");
                for unit in c.encode_utf16(&mut units) {
                    let _ = write!(out, "{unit:04X}");
                }
                out.push_str("\\X0\\");
            }
        }
    }
    out + "'"
}

/// Returns a number as files have it: always with a point.
pub(crate) fn real(x: f64) -> String {
    // Not -0, and no digits that say nothing: a hundredth of a micrometer.
    let rounded = (x * 1e8).round() / 1e8 + 0.0;
    let text = format!("{rounded:?}");
    match text.split_once('e') {
        Some((digits, power)) if digits.contains('.') => format!("{digits}E{power}"),
        Some((digits, power)) => format!("{digits}.E{power}"),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statements_are_found_behind_comments_and_texts() {
        let text = b"ISO-10303-21;HEADER;FILE_SCHEMA(('IFC4'));ENDSEC;DATA;\n/* a; #9=NO(); */ #1 = IFCWALL('it''s; (1)',\n$,(#2,#3));#12=ifcbeam(*,.T.);\nENDSEC;END-ISO-10303-21;";
        let file = StepFile::read(text).unwrap();
        assert_eq!(file.statements.len(), 2);
        let wall = file.get(1).unwrap();
        assert_eq!(file.attributes(wall), ["'it''s; (1)'", "$", "(#2,#3)"]);
        assert_eq!(StepFile::list("(#2,#3)"), ["#2", "#3"]);
        assert_eq!(
            (file.last_id, &*file.get(12).unwrap().class),
            (12, "IFCBEAM")
        );
        assert!(text[file.end..].starts_with(b"ENDSEC;END"));
    }

    #[test]
    fn what_is_no_whole_file_is_refused() {
        assert_eq!(StepFile::read(b"glTF").err(), Some(IfcError::NotIfc));
        let cut = b"ISO-10303-21;HEADER;ENDSEC;DATA;#1=IFCWALL($);#2=IFC";
        assert_eq!(StepFile::read(cut).err(), Some(IfcError::CutOff));
        let broken = b"ISO-10303-21;DATA;#x=IFCWALL($);ENDSEC;";
        assert!(matches!(
            StepFile::read(broken).err(),
            Some(IfcError::Broken { .. })
        ));
    }

    #[test]
    fn texts_and_numbers_are_those_of_the_standard() {
        for text in ["K\u{fc}che", "it's", "a\\b", "\u{1f600}"] {
            assert_eq!(text_of(&quoted(text)).as_deref(), Some(text));
        }
        assert_eq!(
            text_of("'K\\S\\|che \\X\\FC'").as_deref(),
            Some("K\u{fc}che \u{fc}")
        );
        assert_eq!(text_of("$"), None);
        for (x, text) in [
            (1.0, "1.0"),
            (-0.0, "0.0"),
            (1e20, "1.E20"),
            (0.1, "0.1"),
            (3e-8, "3.E-8"),
        ] {
            assert_eq!(real(x), text);
        }
    }
}
