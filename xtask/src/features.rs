//! Coverage of `docs/features.md` by tests.
//!
//! A test of a feature's promise names it in a comment, `Covers R3.` or `Covers Q1, Q4 and Q5.`; a file of tests may
//! do so for all its tests. A test that names an unlisted feature is an error; features that no test names are
//! printed.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use anyhow::{Context, bail};

use crate::{output_of, root};

/// Prints the number of covered features, and the uncovered ones.
pub(crate) fn run() -> anyhow::Result<()> {
    let page = root().join("docs/features.md");
    let page = std::fs::read_to_string(&page).with_context(|| page.display().to_string())?;
    let listed = listed(&page);
    let mut covered: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let files =
        output_of(
            Command::new("git")
                .current_dir(root())
                .args(["ls-files", "--", "crates/*.rs"]),
        )?;
    for file in files.lines() {
        let Ok(text) = std::fs::read_to_string(root().join(file)) else {
            continue;
        };
        for id in named(&text) {
            covered.entry(id).or_default().push(file.to_owned());
        }
    }
    let unknown: Vec<String> = covered
        .iter()
        .filter(|(id, _)| !listed.contains(*id))
        .map(|(id, files)| {
            format!(
                "{id}, covered by {}, is not in docs/features.md",
                files.join(", ")
            )
        })
        .collect();
    if !unknown.is_empty() {
        bail!("{}", unknown.join("\n"));
    }
    let left: Vec<&str> = listed
        .iter()
        .filter(|id| !covered.contains_key(*id))
        .map(String::as_str)
        .collect();
    println!(
        "{} of {} features are named by a test",
        covered.len(),
        listed.len()
    );
    println!("no test names {}", left.join(" "));
    Ok(())
}

/// Returns the ids in the first column of the page's tables.
fn listed(page: &str) -> BTreeSet<String> {
    page.lines()
        .filter_map(|l| l.strip_prefix("| "))
        .filter_map(|l| l.split(' ').next())
        .filter(|word| is_id(word))
        .map(str::to_owned)
        .collect()
}

/// Returns `true` for a capital letter followed by a number.
fn is_id(word: &str) -> bool {
    let mut chars = word.chars();
    chars.next().is_some_and(|c| c.is_ascii_uppercase())
        && word.len() > 1
        && chars.all(|c| c.is_ascii_digit())
}

/// Returns the ids after each `Covers` in comments.
fn named(text: &str) -> BTreeSet<String> {
    let mut ids = BTreeSet::new();
    for comment in text.lines().filter_map(|l| l.split_once("//")).map(|l| l.1) {
        for (at, covers) in comment.match_indices("Covers ") {
            let words = comment[at + covers.len()..].split([' ', ',']);
            for word in words.filter(|w| !w.is_empty() && *w != "and") {
                let id = word.trim_end_matches(['.', ':', ';']);
                if !is_id(id) {
                    break;
                }
                ids.insert(id.to_owned());
            }
        }
    }
    ids
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_after_covers_are_named() {
        let ids = |text: &str| named(text).into_iter().collect::<Vec<_>>().join(" ");
        assert_eq!(ids("//! Planes. Covers R1, R3 and Q12."), "Q12 R1 R3");
        assert_eq!(ids("    // Covers B3: a grid and Z9"), "B3");
        assert_eq!(ids("// R3 is not covered\nlet covers = \"Covers R4\";"), "");
        assert_eq!(ids("// Covers what is there, R5"), "");
    }

    #[test]
    fn ids_in_the_first_column_are_listed() {
        let page =
            "| id | feature |\n| --- | --- |\n| S1 | meshes, as in B2 |\n| V13 | regions |\n";
        let ids: Vec<String> = listed(page).into_iter().collect();
        assert_eq!(ids, ["S1", "V13"]);
    }
}
