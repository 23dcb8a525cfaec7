//! Distinct names of types in a crate: equal names are easily confused.

use std::collections::{BTreeMap, BTreeSet};

/// Returns a line for each name that two files of a crate give to a type, outside tests. `sources` are texts by their
/// path in the repository. O(length of all files).
pub(crate) fn problems(sources: &BTreeMap<String, String>) -> Vec<String> {
    let mut files_of: BTreeMap<(&str, &str), BTreeSet<&str>> = BTreeMap::new();
    for (file, text) in sources {
        let Some((krate, path)) = file.split_once("/src/") else {
            continue;
        };
        // Builds that leave something out have stand-ins of the same name.
        if path.ends_with("tests.rs") || path.ends_with("_left_out.rs") {
            continue;
        }
        let end = text.find("\n#[cfg(test)]\nmod tests {");
        for name in text[..end.unwrap_or(text.len())]
            .lines()
            .filter_map(type_of)
        {
            files_of.entry((krate, name)).or_default().insert(file);
        }
    }
    let twice = files_of.into_iter().filter(|(_, files)| files.len() > 1);
    twice
        .map(|((krate, name), files)| {
            let files: Vec<&str> = files.into_iter().collect();
            format!(
                "{krate} has {} types of the name {name}: {}",
                files.len(),
                files.join(", ")
            )
        })
        .collect()
}

/// Returns the name of the type that a line declares outside of functions and traits.
fn type_of(line: &str) -> Option<&str> {
    let rest = match line.strip_prefix("pub") {
        Some(rest) if rest.starts_with('(') => rest.split_once(") ")?.1,
        Some(rest) => rest.strip_prefix(' ')?,
        None => line,
    };
    let (kind, rest) = rest.split_once(' ')?;
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let name = &rest[..rest.find(|c| !is_word(c)).unwrap_or(rest.len())];
    (["struct", "enum", "type", "trait"].contains(&kind) && !name.is_empty()).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_given_twice_in_a_crate_is_found_outside_tests() {
        let source = |path: &str, text: &str| (path.to_owned(), text.to_owned());
        let sources = BTreeMap::from([
            source(
                "a/src/one.rs",
                "pub(crate) struct Part<'a> {\n    type Item = u8;\n}\n",
            ),
            source(
                "a/src/two.rs",
                "enum Part {}\nstruct Other;\n\n#[cfg(test)]\nmod tests {\nstruct Other2;\n",
            ),
            source("a/src/tests.rs", "struct Other;\n"),
            source("b/src/one.rs", "pub type Part = u8;\nimpl Part {}\n"),
        ]);
        assert_eq!(
            problems(&sources),
            ["a has 2 types of the name Part: a/src/one.rs, a/src/two.rs"]
        );
    }
}
