//! Wording of comments in Rust sources.
//!
//! A comment line begins with a noun phrase or a verb, says "is not" rather than "is no", and calls the points of a
//! polygon vertices (`docs/glossary.md`).

use std::collections::BTreeMap;

/// First words that leave a reader waiting for the noun.
const OPENINGS: [&str; 5] = ["What", "Whether", "Of", "By", "Who"];

/// Returns a line for each badly worded comment line in `sources` (path in the repository, text). O(length of all texts).
pub(crate) fn problems(sources: &BTreeMap<String, String>) -> Vec<String> {
    sources
        .iter()
        .flat_map(|(file, text)| {
            faults(text).map(move |(line, fault)| format!("{file}:{line}: {fault}"))
        })
        .collect()
}

/// Returns the faults of the comment lines of a text, each with its line number. Skips code blocks of documentation.
fn faults(text: &str) -> impl Iterator<Item = (usize, String)> {
    let mut is_code = false;
    text.lines().enumerate().filter_map(move |(i, line)| {
        let comment = line.trim_start().strip_prefix("//")?;
        let comment = comment.trim_start_matches(['/', '!']).trim_start();
        let is_fence = comment.starts_with("```");
        is_code ^= is_fence;
        if is_code || is_fence {
            return None;
        }
        Some((i + 1, fault(comment)?))
    })
}

/// Returns the first fault of one comment line.
fn fault(comment: &str) -> Option<String> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let first = comment.split(|c| !is_word(c)).next()?;
    if OPENINGS.contains(&first) {
        return Some(format!("begins with {first}; begin with a noun or a verb"));
    }
    let prose = without_quotes(comment);
    let words: Vec<&str> = prose.split(|c| !is_word(c)).collect();
    if words
        .iter()
        .any(|w| ["corner", "corners", "Corner", "Corners"].contains(w))
    {
        return Some("says corner; the word is vertex".to_owned());
    }
    let is_negated = |w: &[&str]| match w {
        // "There is no portal" and "is no longer" are plain English.
        ["there" | "There", ..] | [_, _, _, "longer"] => false,
        [_, "is" | "are", "no", _] => true,
        _ => false,
    };
    // A word before and after, so that each window has four.
    let padded: Vec<&str> = [&[""][..], &words, &[""]].concat();
    padded
        .windows(4)
        .any(is_negated)
        .then(|| "says is no or are no; say is not or are not".to_owned())
}

/// Returns the text without its parts in backticks or double quotes.
fn without_quotes(text: &str) -> String {
    let mut quote = None;
    let is_outside = |c: &char| match quote {
        Some(q) => {
            if *c == q {
                quote = None;
            }
            false
        }
        None if ['`', '"'].contains(c) => {
            quote = Some(*c);
            false
        }
        None => true,
    };
    text.chars().filter(is_outside).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(text: &str) -> Vec<usize> {
        faults(text).map(|(line, _)| line).collect()
    }

    #[test]
    fn a_comment_that_begins_with_a_conjunction_is_found() {
        assert_eq!(
            found("/// What it is.\nfn f() {} // What\n//! Whether.\n// Who\n"),
            [1, 3, 4]
        );
        assert!(found("/// Whatever.\n/// The cell of a point.\n// Offset.\n").is_empty());
    }

    #[test]
    fn is_no_is_found_but_not_after_there() {
        assert_eq!(found("// is no cell\n/// Such are no rooms.\n"), [1, 2]);
        assert!(
            found("// If there is no cell.\n// It is no longer open.\n// is none\n").is_empty()
        );
    }

    #[test]
    fn corners_are_found_outside_quotes_and_code() {
        assert_eq!(
            found("// Corners.\n/// `corners` and \"corner\"\n// n_corners\n// a corner, too\n"),
            [1, 4]
        );
        assert_eq!(
            found("/// ```\n/// // What corner?\n/// ```\n/// corner\nlet corners = 1;\n"),
            [4]
        );
    }
}
